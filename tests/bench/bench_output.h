// SPDX-License-Identifier: Apache-2.0
// bench_output.h — what every bench program offers: a table for people, --csv, --json, --plot,
// --quick.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <variant>
#include <vector>

#include "common/process/terminal.h"

namespace CLI {
class App;  // its header costs each source 4 s: those with options of their own include it
}

namespace palpate::bench {

struct BenchOptions {
  std::string json_file;
  std::string csv_file;
  std::string plot_folder;  ///< empty: no plots
  bool is_quick = false;
  bool may_overwrite = false;  ///< --json and --csv
};

/// A part of the runs of a long bench: the parts are disjoint and all of them together are whole.
struct Shard {
  std::size_t part = 1;  ///< 1 … of
  std::size_t of = 1;
  /// Whether the i-th run, from 0, belongs to it: the runs are dealt out in turn.
  [[nodiscard]] bool has(std::size_t i) const noexcept { return i % of == part - 1; }
};
/// Adds --shard I/N. Anything else ends run_bench() with status 2.
void add_shard_option(CLI::App& app, Shard& shard);

/// Rows of text and numbers under named columns. Numbers that are not finite are shown as –, as an
/// empty field in CSV and as null in JSON.
class Table {
 public:
  struct Column {
    std::string name;    ///< key in CSV and JSON
    std::string title;   ///< head in the text form
    std::string format;  ///< fmt format of a number; unused for text
  };
  explicit Table(std::vector<Column> columns) : columns_(std::move(columns)) {}

  using Cell = std::variant<std::string, double>;
  /// One cell per column.
  void add(std::vector<Cell> row);
  /// An empty line in the text form.
  void add_gap();

  [[nodiscard]] std::string text() const;
  [[nodiscard]] std::string csv() const;
  [[nodiscard]] nlohmann::ordered_json json() const;

  /// Prints the text and writes the requested files. Throws SetupError if one cannot be written.
  void publish(const BenchOptions& options) const;

 private:
  std::vector<Column> columns_;
  std::vector<std::vector<Cell>> rows_;  // an empty row is a gap
};

/// The progress of a table on a terminal, while the object exists: print nothing meanwhile.
class Steps {
 public:
  /// @param count  how often next() will be called
  explicit Steps(std::size_t count) : count_(count), progress_("measuring") {}
  /// One more is done. Thread-safe.
  void next();

 private:
  std::mutex mutex_;
  std::size_t count_;
  std::size_t done_ = 0;
  Progress progress_;
};

/// What --csv and --json name, if they are given. They throw like palpate::write_file.
void write_table(const BenchOptions& options, const std::string& csv);
void write_json(const BenchOptions& options, const nlohmann::ordered_json& json);

/// Writes a file of a folder of figures, or replaces it. Throws like palpate::write_file.
void write_file(const std::filesystem::path& file, const std::string& text);

/// Writes NAME.gp into `folder` and runs gnuplot on it there; prints the result, or why there is no
/// figure. Throws SetupError if the file cannot be written.
void draw_figure(const std::filesystem::path& folder, const std::string& name,
                 const std::string& script);

/// The load average of the last minute and the number of processors, as text: for figures of real
/// time.
[[nodiscard]] std::string machine_load();

/// The main() of a bench: adds the four options to `app`, parses, runs. Returns the exit status: 2,
/// with the reason on stderr, for a SetupError.
int run_bench(CLI::App& app, BenchOptions& options, int argc, char** argv,
              const std::function<void()>& run);

}  // namespace palpate::bench
