// SPDX-License-Identifier: Apache-2.0
// options.h — options that several subcommands share, and where their output goes.
#pragma once

#include <CLI/CLI.hpp>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "common/core/user/output_file.h"
#include "common/session/session.h"
#include "deploy/palpate/commands.h"
#include "viewer_node/recording/recording.h"
#include "viewer_node/recording/recording_file.h"

namespace palpate {

/// A line on standard error, of its own also where a status line or progress is shown.
void say(const std::string& text);
/// "FILE: written" for each that is a file.
void say_written(const std::vector<std::string>& files, const Verbosity& verbosity);

/// SESSION and --set.
struct SessionOptions {
  std::string file;
  std::vector<std::string> overrides;

  void add_to(CLI::App& app);
  /// Throws SetupError.
  [[nodiscard]] Session load(const Verbosity& verbosity = {}) const;
};

/// FILE: a recording to read.
void add_recording_argument(CLI::App& app, std::string& file);
/// Exit status of a command that has read the recording; 1 and a line on standard error if it is
/// damaged.
[[nodiscard]] int status_of_damage(const RecordingFile& recording);
/// --side, of a session or a recording with several devices.
void add_side_option(CLI::App& app, std::string& side);

/// --trust, of commands that run or load what a session names.
void add_trust_flag(CLI::App& app, bool& is_trusted);

/// --csv, --json, --record and --overwrite.
struct OutputOptions {
  std::string csv_file;   ///< empty: none
  std::string json_file;  ///< empty: none; "-": standard output
  std::string record_file;
  bool may_overwrite = false;

  /// @param more_on_csv  appended to the help text of --csv
  void add_to(CLI::App& app, const std::string& more_on_csv = {});
  /// check_outputs() of a run. Throws SetupError.
  /// @param tables  the files of --csv
  /// @param input   what the command reads beside the session; empty: nothing
  void check(const Session& session, const std::vector<std::string>& tables,
             const std::string& input = {}) const;
  /// All files, once they are written.
  void say_written(std::vector<std::string> tables, const Verbosity& verbosity) const;
  [[nodiscard]] viewer::RecordOptions record() const {
    return {.file = record_file, .may_overwrite = may_overwrite};
  }
};

/// Where --json goes: a file, standard output, or nowhere.
class JsonOutput {
 public:
  /// Construct it before the run: a path that cannot be written then fails before the run, not
  /// after it. The file keeps its content until write(). Throws SetupError.
  explicit JsonOutput(const OutputOptions& options);

  /// Throws std::runtime_error if the file cannot be written.
  void write(const nlohmann::ordered_json& json);

 private:
  std::optional<OutputFile> file_;
};

}  // namespace palpate
