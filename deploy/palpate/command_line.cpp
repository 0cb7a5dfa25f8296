// SPDX-License-Identifier: Apache-2.0
#include "deploy/palpate/command_line.h"

#include <unistd.h>

#include <cstdio>
#include <exception>
#include <memory>
#include <string>
#include <utility>

#include "common/core/check.h"
#include "common/core/user/nearest.h"
#include "common/core/user/output_file.h"
#include "common/core/version.h"
#include "common/process/run_node.h"
#include "common/process/terminal.h"
#include "deploy/conform/device_stop.h"
#include "deploy/palpate/launch/launcher.h"

namespace palpate {
namespace {

/// Help no wider than the terminal.
class HelpOnTerminal : public CLI::Formatter {
 public:
  std::string make_help(const CLI::App* app, std::string name,
                        CLI::AppFormatMode mode) const override {
    return wrapped(CLI::Formatter::make_help(app, std::move(name), mode),
                   terminal_columns(STDOUT_FILENO));
  }
};

int run(int argc, char** argv, const std::function<std::vector<Command>(CLI::App&)>& add) {
  CLI::App app("Runs and checks Palpate deployments.", "palpate");
  app.formatter(std::make_shared<HelpOnTerminal>());
  app.set_version_flag("--version", std::string("palpate ") + version());
  app.require_subcommand(1);
  app.fallthrough();  // --quiet and --verbose may follow the command
  Verbosity verbosity;
  app.add_flag("-q,--quiet", verbosity.is_quiet,
               "print only warnings, errors and requested output: no summary, status or progress");
  app.add_flag("-v,--verbose", verbosity.is_verbose,
               "list the files that are read and, on a terminal, every event of the log, too");
  const std::vector<Command> commands = add(app);
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
  } catch (const ReaderHasLeft&) {
    return 0;
  } catch (const SetupError& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kExitSetupError;
  } catch (const Interrupted& stopped) {
    std::fprintf(stderr, "palpate: %s\n", stopped.what());
    return stopped.exit_status();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "palpate: %s\n", error.what());
    return kExitFailure;
  }
}

}  // namespace

std::string did_you_mean(const CLI::App& app) {
  const auto all = [](const auto*) { return true; };
  // options of the command that was reached and of those around it, and its own commands
  std::vector<std::string> options;
  std::vector<std::string> commands;
  const CLI::App* reached = &app;
  while (reached != nullptr) {
    for (const CLI::Option* option : reached->get_options(all)) {
      for (const std::string& name : option->get_lnames()) options.push_back("--" + name);
    }
    commands.clear();
    const CLI::App* next = nullptr;
    for (const CLI::App* sub : reached->get_subcommands(all)) {
      commands.push_back(sub->get_name());
      if (sub->parsed()) next = sub;
    }
    reached = next;
  }

  std::string text;
  for (const std::string& word : app.remaining(true)) {
    const std::string name = word.substr(0, word.find('='));
    const std::string meant = nearest(name, name.starts_with('-') ? options : commands);
    if (meant.empty() || meant == name || name == "--") continue;
    text.append(name).append(": did you mean ").append(meant).append("?\n");
  }
  return text;
}

int run_command_line(int argc, char** argv,
                     const std::function<std::vector<Command>(CLI::App&)>& add) {
  ignore_output_signals();
  return status_with_output(run(argc, argv, add), "palpate");
}

int run_launcher(int argc, char** argv) {
  return run_command_line(
      argc, argv, [](CLI::App& app) { return std::vector<Command>{add_launch_command(app)}; });
}

}  // namespace palpate
