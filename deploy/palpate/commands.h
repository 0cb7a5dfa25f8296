// SPDX-License-Identifier: Apache-2.0
// commands.h — the subcommands of palpate. Each has a file of its own, with its options beside what
// it does.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <string>

namespace palpate {

/// How much a command tells on standard error and in its summary.
struct Verbosity {
  bool is_quiet = false;    ///< warnings, errors and what the command is asked to print
  bool is_verbose = false;  ///< the files that are read and every event, too
};

struct Command {
  CLI::App* parser;  ///< parsed() is true if the user named this command
  /// Called after parsing. Returns the exit status; throws SetupError for mistakes of the user, any
  /// other exception for failures.
  std::function<int(const Verbosity&)> run;
};

/// An option that names a file, and is given without a name, is a mistake: as with a variable of a
/// script that is not set.
void refuse_empty_files(CLI::App& parser);

/// Adds a subcommand to `app`.
/// @tparam Work  has add_to(CLI::App&) for its options and int run() or int run(const Verbosity&)
template <class Work>
[[nodiscard]] Command add_command(CLI::App& app, const std::string& name,
                                  const std::string& description) {
  CLI::App& parser = *app.add_subcommand(name, description);
  auto work = std::make_shared<Work>();
  work->add_to(parser);
  refuse_empty_files(parser);
  return {&parser, [work](const Verbosity& verbosity) {
            if constexpr (requires { work->run(verbosity); }) {
              return work->run(verbosity);
            } else {
              return work->run();
            }
          }};
}

// Each adds its subcommand to `app`, which must outlive the result.
[[nodiscard]] Command add_launch_command(CLI::App& app);
[[nodiscard]] Command add_loopback_command(CLI::App& app);
[[nodiscard]] Command add_info_command(CLI::App& app);
[[nodiscard]] Command add_export_command(CLI::App& app);
[[nodiscard]] Command add_replay_command(CLI::App& app);
[[nodiscard]] Command add_cut_command(CLI::App& app);
[[nodiscard]] Command add_merge_command(CLI::App& app);
[[nodiscard]] Command add_recover_command(CLI::App& app);
[[nodiscard]] Command add_report_command(CLI::App& app);
[[nodiscard]] Command add_score_command(CLI::App& app);
[[nodiscard]] Command add_make_task_command(CLI::App& app);
[[nodiscard]] Command add_identify_command(CLI::App& app);
[[nodiscard]] Command add_scene_check_command(CLI::App& app);
[[nodiscard]] Command add_conform_command(CLI::App& app);
[[nodiscard]] Command add_doctor_command(CLI::App& app);
[[nodiscard]] Command add_keygen_command(CLI::App& app);
[[nodiscard]] Command add_import_command(CLI::App& app);
[[nodiscard]] Command add_make_organ_command(CLI::App& app);
[[nodiscard]] Command add_mesh_command(CLI::App& app);
[[nodiscard]] Command add_sweep_command(CLI::App& app);
[[nodiscard]] Command add_study_command(CLI::App& app);
[[nodiscard]] Command add_stations_command(CLI::App& app);
[[nodiscard]] Command add_devices_command(CLI::App& app);
[[nodiscard]] Command add_emulate_command(CLI::App& app);
[[nodiscard]] Command add_ros_command(CLI::App& app);
// They print what is made from the definitions of the other commands: add them last.
[[nodiscard]] Command add_explain_command(CLI::App& app);
[[nodiscard]] Command add_help_command(CLI::App& app);
[[nodiscard]] Command add_man_command(CLI::App& app);
[[nodiscard]] Command add_completion_command(CLI::App& app);

}  // namespace palpate
