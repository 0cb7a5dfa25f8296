// palpate: runs and checks deployments. This file registers the subcommands (commands.h).
#include <csignal>
#include <cstdio>
#include <exception>
#include <string>

#include "common/core/check.h"
#include "common/core/user/output_file.h"
#include "common/core/version.h"
#include "common/process/run_node.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/screen/help.h"

namespace palpate {
namespace {

int run(int argc, char** argv) {
  CLI::App app("Runs and checks Palpate deployments.", "palpate");
  app.set_version_flag("--version", std::string("palpate ") + version());
  app.require_subcommand(1);
  app.fallthrough();  // --quiet and --verbose may follow the command
  Verbosity verbosity;
  app.add_flag("-q,--quiet", verbosity.is_quiet,
               "print only warnings, errors and requested output: no summary, status or progress");
  app.add_flag("-v,--verbose", verbosity.is_verbose, "list the files that are read, too");
  const Command commands[] = {
      add_launch_command(app),   add_loopback_command(app),    add_info_command(app),
      add_export_command(app),   add_replay_command(app),      add_report_command(app),
      add_cut_command(app),      add_merge_command(app),       add_recover_command(app),
      add_identify_command(app), add_scene_check_command(app), add_conform_command(app),
      add_doctor_command(app),   add_keygen_command(app),      add_make_organ_command(app),
      add_mesh_command(app),     add_sweep_command(app),       add_devices_command(app),
      add_emulate_command(app),  add_explain_command(app),     add_help_command(app),
      add_man_command(app),      add_completion_command(app)};
  // set last: subcommands that exist later would inherit it
  app.footer(
      "Try:  palpate launch deploy/sessions/default.txtpb --seconds 10\n"
      "Each command has its own --help, or: palpate help launch. Terms: palpate explain clamp");

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    const int status = app.exit(error);
    if (status == 0) return 0;
    std::fputs(did_you_mean(app).c_str(), stderr);
    return kExitSetupError;
  }
  try {
    for (const Command& command : commands) {
      if (command.parser->parsed()) return command.run(verbosity);
    }
    return 0;
  } catch (const SetupError& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kExitSetupError;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "palpate: %s\n", error.what());
    return kExitFailure;
  }
}

}  // namespace
}  // namespace palpate

int main(int argc, char** argv) {
  palpate::ignore_output_signals();
  return palpate::status_with_output(palpate::run(argc, argv), "palpate");
}
