// SPDX-License-Identifier: Apache-2.0
#include "common/process/options.h"
#include "common/session/session_file.h"
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
                 "program stops; keep a hand at the power switch");
  }

  int run(const Verbosity& verbosity) const {
    // the session may include the profile that this command is about to write
    std::vector<std::string> overrides = session.overrides;
    overrides.emplace_back("device.profile_file=");
    const Session loaded = with_only_side(load_session(session.file, overrides), side);
    require_trust(loaded, foreign_code_of(loaded, false, true), is_trusted);
    run_identify(loaded, options);
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
