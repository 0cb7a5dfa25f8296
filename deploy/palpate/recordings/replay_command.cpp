// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/recording/replay.h"

#include "common/process/options.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/options.h"

namespace palpate {
namespace {

struct ReplayCommand {
  ReplayOptions replay;

  void add_to(CLI::App& app) {
    add_recording_argument(app, replay.file);
    app.add_option("--session", replay.session_file,
                   "publish at the endpoints of this session (default: the recorded session)")
        ->type_name("FILE");
    add_override_option(app, replay.overrides);
    app.add_option("--speed", replay.speed_ratio, "multiple of real time (default: 1)")
        ->type_name("RATIO")
        ->check(CLI::Range(0.001, 1000.0));
    app.add_option("--start", replay.start_s,
                   "skip this many seconds of the recording (default: 0)")
        ->type_name("S")
        ->check(is_start_time());
    app.add_flag("--loop", replay.loops, "repeat until Ctrl-C");
    app.add_option("--wait", replay.wait_s,
                   "wait at most this many seconds for a viewer; 0 does not wait (default: until "
                   "there is one)")
        ->type_name("S")
        ->check(CLI::Range(0.0, 1e6));
    add_insecure_flag(app, replay.is_insecure);
  }
  int run(const Verbosity& verbosity) {
    replay.is_quiet = verbosity.is_quiet;
    run_replay(replay);
    return 0;
  }
};

}  // namespace

Command add_replay_command(CLI::App& app) {
  return add_command<ReplayCommand>(
      app, "replay", "publish a recording in real time: viewers show it like a live session");
}

}  // namespace palpate
