// bench_output.h — what every bench program offers: a table for people, --csv, --json, --plot,
// --quick.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <variant>
#include <vector>

namespace palpate::bench {

struct BenchOptions {
  std::string json_file;
  std::string csv_file;
  std::string plot_folder;  ///< empty: no plots
  bool is_quick = false;

  /// Adds the four options to `app`.
  void add_to(CLI::App& app);
};

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

  /// Prints the text and writes the files asked for. Throws SetupError if one cannot be written.
  void publish(const BenchOptions& options) const;

 private:
  std::vector<Column> columns_;
  std::vector<std::vector<Cell>> rows_;  // an empty row is a gap
};

/// Writes text to a file. Throws SetupError if it cannot.
void write_file(const std::filesystem::path& file, const std::string& text);

/// Runs gnuplot on a script that lies in `folder`, with `folder` as working folder. False, with a
/// line on stderr, where gnuplot is missing or fails.
bool run_gnuplot(const std::filesystem::path& folder, const std::string& script);

}  // namespace palpate::bench
