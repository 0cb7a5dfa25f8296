// SPDX-License-Identifier: Apache-2.0
#include <exception>

#include "common/process/options.h"
#include "common/session/session_file.h"
#include "deploy/conform/device_stop.h"
#include "deploy/launch/trust.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/identify.h"
#include "deploy/palpate/options.h"

namespace palpate {
namespace {

struct IdentifyCommand {
  SessionOptions session;
  std::string side;
  IdentifyOptions options;
  bool is_trusted = false;

  void add_to(CLI::App& app) {
    session.add_to(app);
    add_side_option(app, side);
    app.add_option("--output", options.profile_file,
                   "write the bounds to this file, - for standard output, for device.profile_file "
                   "of a session")
        ->type_name("FILE");
    add_overwrite_flag(app, options.may_overwrite);
    add_trust_flag(app, is_trusted);
    app.add_flag("--per-axis", options.is_per_axis,
                 "friction per axis, for a device whose axes differ; lowered where motions across "
                 "the axes meet less");
    app.add_flag("--i-understand-this-moves-the-device", options.consent.may_move,
                 "required for real hardware: the device moves by itself, with up to 1 N");
    app.add_flag("--without-watchdog", options.consent.may_lack_watchdog,
                 "required for motors that end no force by themselves: they go on pushing if this "
                 "program is killed; keep a hand at the power switch");
    app.footer(
        "Ctrl-C, SIGTERM and SIGHUP release the motors, until the device confirms it or for 1 s, "
        "and end with exit status 130, 143 or 129.");
  }

  int run(const Verbosity& verbosity) {
    // the session may include the profile that this command is about to write
    std::vector<std::string> overrides = session.overrides;
    overrides.emplace_back("device.profile_file=");
    const Session loaded = with_only_side(load_session(session.file, overrides), side);
    require_trust(loaded, foreign_code_of(loaded, false, true), is_trusted);
    const DeviceStop stop(loaded.side().realtime.priority);
    options.stop = stop.token();
    try {
      run_identify(loaded, options);
    } catch (const std::exception& error) {
      if (stop.signal() == 0) throw;
      throw Interrupted(stop.signal(), error.what());
    }
    say_written({options.profile_file}, verbosity);
    return 0;
  }
};

}  // namespace

Command add_identify_command(CLI::App& app) {
  return add_command<IdentifyCommand>(
      app, "identify", "measure the friction of a session's device with its own motors; hands off");
}

}  // namespace palpate
