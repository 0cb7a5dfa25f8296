// options.h — options that several subcommands share, and where their output goes.
#pragma once

#include <CLI/CLI.hpp>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "common/session/session.h"
#include "viewer_node/recording/recording.h"

namespace palpate {

/// SESSION and --set.
struct SessionOptions {
  std::string file;
  std::vector<std::string> overrides;

  void add_to(CLI::App& app);
  /// Throws SetupError.
  [[nodiscard]] Session load() const;
};

/// FILE: a recording to read.
void add_recording_argument(CLI::App& app, std::string& file);
/// --side, of a session or a recording with several devices.
void add_side_option(CLI::App& app, std::string& side);

/// --csv, --json, --record and --overwrite.
struct OutputOptions {
  std::string csv_file;   ///< empty: none
  std::string json_file;  ///< empty: none; "-": standard output
  viewer::RecordOptions record{};

  /// @param more_on_csv  appended to the help text of --csv
  void add_to(CLI::App& app, const std::string& more_on_csv = {});
};

/// Where --json goes: a file, "-" for standard output, or nowhere.
class JsonOutput {
 public:
  /// Construct it before the run: a path that cannot be written then fails before the run, not
  /// after it. The file keeps its content until write(). Throws SetupError.
  explicit JsonOutput(const std::string& path);

  [[nodiscard]] bool is_standard_output() const { return path_ == "-"; }
  /// Throws std::runtime_error if the file cannot be written.
  void write(const nlohmann::ordered_json& json) const;

 private:
  std::string path_;  // empty: nowhere
};

}  // namespace palpate
