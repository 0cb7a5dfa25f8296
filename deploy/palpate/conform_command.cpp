// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cstdio>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "common/core/user/output_file.h"
#include "common/process/acknowledgement.h"
#include "common/process/options.h"
#include "common/process/run_node.h"
#include "common/session/session_file.h"
#include "deploy/conform/apart.h"
#include "deploy/conform/conform_device.h"
#include "deploy/conform/conform_physics.h"
#include "deploy/conform/device_stop.h"
#include "deploy/launch/trust.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/options.h"
#include "deploy/palpate/screen/verdict.h"

namespace palpate {
namespace {

/// Prints the findings of a suite as they come, and writes them at its end.
class Findings {
 public:
  /// @param must_judge_all  what is not judged is a failure, too
  explicit Findings(const OutputOptions& output, bool must_judge_all = false)
      : json_(output),
        out_(output.json_file == "-" ? stderr : stdout),
        must_judge_all_(must_judge_all) {}

  void add(const ConformFinding& found) {
    std::string text = found.check + ": " + found.text;
    if (!found.remedy.empty()) text += "; " + found.remedy;
    if (found.is_checked) {
      text = graded_line(found.is_good ? Grade::kGood : Grade::kBad, text);
      is_good_ = is_good_ && found.is_good;
    } else {
      text = "  -     " + text + "\n";
      is_good_ = is_good_ && !must_judge_all_;
    }
    std::fputs(text.c_str(), out_);
    std::fflush(out_);
    list_.push_back(found);
  }
  /// @return the exit status
  int write() {
    json_.write({{"is_good", is_good_}, {"findings", list_}});
    return is_good_ ? 0 : kExitFailure;
  }

 private:
  JsonOutput json_;
  std::FILE* out_;
  bool must_judge_all_;
  bool is_good_ = true;
  nlohmann::ordered_json list_ = nlohmann::ordered_json::array();
};

void add_output_options(CLI::App& app, OutputOptions& output) {
  app.add_option("--json", output.json_file,
                 "write the findings to this file, - for standard output")
      ->type_name("FILE");
  add_overwrite_flag(app, output.may_overwrite);
  app.footer(
      "Exit status: 0 if all is good, 1 if something falls short or the machine is too busy to "
      "judge it, 2 if it cannot be tried.");
}

struct ConformPhysics {
  ConformOptions options;
  // arrays: behind the values of a vector, the parser would take the -- before the command
  std::array<double, 3> clear_m{0.0, 0.0, 0.005};
  std::array<double, 3> press_m{0.0, 0.0, -0.005};
  OutputOptions output;
  bool is_trusted = false;

  void add_to(CLI::App& app) {
    app.add_option("COMMAND", options.command,
                   "the program and its arguments, behind --; {session} names the session file "
                   "(default: physics.command of --session)")
        ->type_name("");
    app.add_option("--session", options.session_file,
                   "a session whose tissue the program has (default: a half-space below z = 0)")
        ->type_name("FILE");
    app.add_option("--set", options.overrides, "override a field of the session")
        ->type_name("PATH=VALUE")
        ->allow_extra_args(false);
    app.add_option("--clear", clear_m, "a place in W where nothing is touched (default: 0 0 0.005)")
        ->type_name("X Y Z");
    app.add_option("--press", press_m,
                   "a place in W, straight below, where the tool presses (default: 0 0 -0.005)")
        ->type_name("X Y Z");
    add_trust_flag(app, is_trusted);
    add_output_options(app, output);
  }

  int run() {
    options.clear_m = Vector3(clear_m[0], clear_m[1], clear_m[2]);
    options.press_m = Vector3(press_m[0], press_m[1], press_m[2]);
    std::vector<std::string> inputs = options.command;
    if (!options.session_file.empty()) {
      const Session session = load_session(options.session_file, options.overrides);
      if (options.command.empty()) {
        require_trust(session, foreign_code_of(session, true, false), is_trusted);
      }
      const auto read = files_of(session);
      inputs.insert(inputs.end(), read.begin(), read.end());
    }
    check_outputs({{"--json", output.json_file}}, inputs, output.may_overwrite);
    Findings findings(output, true);
    options.on_finding = [&](const ConformFinding& found) { findings.add(found); };
    static_cast<void>(conform_physics(options));
    return findings.write();
  }
};

struct ConformDevice {
  SessionOptions session;
  std::string side;
  ConformDeviceOptions options;
  OutputOptions output;
  bool is_trusted = false;

  void add_to(CLI::App& app) {
    session.add_to(app);
    add_side_option(app, side);
    app.add_flag("--i-understand-this-moves-the-device", options.may_move_hardware,
                 "required for real hardware: the device moves by itself, with up to "
                 "device.peak_force_newton");
    app.add_flag("--without-watchdog", options.may_lack_watchdog,
                 "required for motors that end no force by themselves: they go on pushing if this "
                 "program is killed; keep a hand at the power switch. With up to 1 N, unless the "
                 "session accepts more (device.accept)");
    add_trust_flag(app, is_trusted);
    add_output_options(app, output);
    app.footer(app.get_footer() +
               "\nA real device that does not follow the first small push falls short, too: "
               "device_node would not enable it for more than f_co.\nCtrl-C, SIGTERM and SIGHUP "
               "release the motors, "
               "until the device confirms it or "
               "for 1 s, and end with 130, 143 or 129.");
  }

  int run(const Verbosity& verbosity) {
    const Session loaded = with_only_side(session.load(verbosity), side);
    require_trust(loaded, foreign_code_of(loaded, false, true), is_trusted);
    output.check(loaded, {});
    Findings findings(output);
    // the driver of others may end the program that loads it
    find_apart([&](const OnFinding& on_finding,
                   const std::function<void()>& end) { check(loaded, on_finding, end); },
               [&](const ConformFinding& found) { findings.add(found); });
    return findings.write();
  }

 private:
  void check(const Session& loaded, const OnFinding& on_finding, const std::function<void()>& end) {
    const DeviceStop stop(loaded.side().realtime.priority);
    options.start_up.stop = stop.token();
    options.on_finding = on_finding;
    options.on_hang = [&](const ConformFinding& found) {
      on_finding(found);
      end();
    };
    std::optional<TerminalAcknowledgement> terminal;
    if (is_real(loaded.side().driver)) {
      terminal.emplace();
      options.start_up.prompt = [](const std::string& text) { say(text); };
      options.start_up.is_acknowledged = [&] { return terminal->take(); };
    }
    static_cast<void>(conform_device(loaded, options));
  }
};

}  // namespace

Command add_conform_command(CLI::App& app) {
  CLI::App& conform =
      *app.add_subcommand("conform", "check what others bring against what Palpate relies on");
  conform.require_subcommand(1);
  const Command physics = add_command<ConformPhysics>(
      conform, "physics", "check a physics from elsewhere: palpate conform physics -- ./mine");
  const Command device = add_command<ConformDevice>(
      conform, "device", "check the driver of a session's device; hands off");
  return {&conform, [physics, device](const Verbosity& verbosity) {
            return (physics.parser->parsed() ? physics : device).run(verbosity);
          }};
}

}  // namespace palpate
