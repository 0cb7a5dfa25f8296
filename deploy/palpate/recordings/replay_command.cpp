// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/recording/replay.h"

#include <unistd.h>

#include <exception>
#include <optional>
#include <stop_token>
#include <thread>

#include "common/core/check.h"
#include "common/process/log.h"
#include "common/process/options.h"
#include "common/process/process_links.h"
#include "common/process/run_node.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/options.h"
#include "deploy/palpate/screen/page.h"
#include "viewer_node/process.h"

namespace palpate {
namespace {

/// A viewer of the replay in this process, for its page; without a status line.
class ReplayPage {
 public:
  /// Throws SetupError.
  explicit ReplayPage(const Session& session)
      : session_(session),
        links_({.priority = 0, .cpu = -1}, tcp_rules(session.security, {KeyRole::kViewer})),
        port_(announce_page(session.viewer.web)),
        thread_([this](const std::stop_token& stop) { run(stop); }) {}

 private:
  void run(const std::stop_token& stop) {
    log_.logger().set_level(spdlog::level::warn);
    viewer::ViewerOptions options;
    options.is_quiet = true;
    if (port_) options.web.descriptor = dup(port_->descriptor());  // the server closes its own
    NodeContext context{.session = session_,
                        .session_id = random_session_id(),
                        .clock = clock_,
                        .log = log_.logger(),
                        .stop = stop};
    try {
      viewer::run_process(context, links_, options);
    } catch (const std::exception& error) {
      say(std::string("no page: ") + error.what());
    }
  }

  Session session_;
  SteadyClock clock_;
  Log log_{"viewer"};
  ProcessLinks links_;
  std::optional<ListeningPort> port_;
  std::jthread thread_;
};

struct ReplayCommand {
  std::string file;
  ReplayOptions replay;
  bool has_no_viewer = false;

  void add_to(CLI::App& app) {
    add_recording_argument(app, file);
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
    app.add_option(
           "--wait", replay.wait_s,
           "wait at most this many seconds until the page is opened, or for a viewer; 0 does "
           "not wait (default: until then)")
        ->type_name("S")
        ->check(CLI::Range(0.0, 1e6));
    app.add_flag("--no-viewer", has_no_viewer,
                 "no page of its own (as with -q): wait for a viewer_node that is started by hand");
    add_insecure_flag(app, replay.is_insecure);
  }
  int run(const Verbosity& verbosity) {
    replay.is_quiet = verbosity.is_quiet;
    std::optional<ReplayPage> page;
    replay.start_page = [&](const Session& session) {
      if (has_no_viewer || verbosity.is_quiet || !session.viewer.web.is_on) return false;
      try {
        page.emplace(session);
      } catch (const SetupError& error) {  // as without the viewer's key
        say(std::string("no page: ") + error.what());
      }
      return page.has_value();
    };
    RecordingFile recording(file);
    const int status = status_of_damage(recording);
    const std::string damage = recording.damage();
    run_replay(replay, recording);
    // what its chunks have lost is known when they are read
    return recording.damage() == damage ? status : status_of_damage(recording);
  }
};

}  // namespace

Command add_replay_command(CLI::App& app) {
  return add_command<ReplayCommand>(
      app, "replay",
      "show a recording like a live session: on a page of its own, and in any viewer");
}

}  // namespace palpate
