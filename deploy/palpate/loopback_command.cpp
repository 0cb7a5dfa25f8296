#include <spdlog/fmt/fmt.h>

#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "common/process/options.h"
#include "common/process/terminal.h"
#include "common/telemetry/summary.h"
#include "deploy/lockstep/loopback.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/options.h"
#include "deploy/palpate/screen/verdict.h"
#include "viewer_node/recording/recording_file.h"

namespace palpate {
namespace {

struct LoopbackCommand {
  SessionOptions session;
  std::string side;
  std::optional<double> seconds;
  OutputOptions output;
  std::string hand_file;
  bool has_no_ideal = false;
  bool is_inproc = false;

  void add_to(CLI::App& app) {
    session.add_to(app);
    add_side_option(app, side);
    add_seconds_option(app, seconds, "simulated time in s (default: duration_s of the session)");
    output.add_to(app);
    app.add_option("--hand", hand_file,
                   "lead the simulated hand along the path of this recording, computed from the "
                   "recorded motion and force; without --seconds, run for its length")
        ->type_name("FILE.mcap");
    app.add_flag("--no-ideal", has_no_ideal,
                 "skip the ideal force, the ideal run and the figures that need them");
    app.add_flag("--inproc", is_inproc,
                 "pass the messages through ZeroMQ inproc sockets instead of memory");
  }

  int run(const Verbosity& verbosity) const {
    // tissue deforms for each tool separately, so one side alone gets the same forces as beside
    // others
    Session loaded = with_only_side(session.load(verbosity), side);
    output.check(loaded, {output.csv_file}, hand_file);
    std::optional<double> length_s = seconds;
    if (!hand_file.empty()) {
      RecordingFile recording(hand_file);
      recording.choose_side(side);
      RecordedPath path = hand_path_of(recording, loaded.side().hand);
      if (!length_s) length_s = recording.length_s();
      loaded.side().hand.path = std::move(path);
    }
    JsonOutput json(output);
    const auto warn_of_start = [is_first = true](const PhysicsTick& tick) mutable {
      if (!std::exchange(is_first, false)) return;
      const std::string warning = start_warning(tick);
      if (!warning.empty()) say(warning);
    };
    const StopSignal stop;
    std::optional<BusyLine> loading(std::in_place, "loading the session", verbosity.is_quiet);
    std::optional<Progress> progress;
    const RunReport report = run_loopback(
        loaded,
        {.seconds = length_s,
         .csv_file = output.csv_file,
         .may_overwrite = output.may_overwrite,
         .record = output.record(),
         .recorded_by = "palpate loopback" + (hand_file.empty() ? "" : " --hand " + hand_file),
         .lockstep = {.links = is_inproc ? LockstepLinks::kInproc : LockstepLinks::kMemory,
                      .has_ideal = !has_no_ideal,
                      .on_physics_tick = warn_of_start},
         .may_go_on = [&](double done) {
           if (loading) progress.emplace("loopback", verbosity.is_quiet);
           loading.reset();
           progress->show(done);
           return !StopSignal::is_requested();
         }});
    progress.reset();
    if (StopSignal::is_requested()) {
      say(fmt::format("stopped after {:.2f} s of {:.2f} s", report.simulated_s,
                      length_s.value_or(loaded.duration_s)));
    }
    if (!verbosity.is_quiet) {
      const std::string verdict =
          verdict_text(verdicts_of(loaded.side(), report.device, report.mofc, false));
      std::fputs((summary_text(loaded, report) + verdict).c_str(), stdout);
    }
    json.write(summary_json(loaded, report));
    return 0;
  }
};

}  // namespace

Command add_loopback_command(CLI::App& app) {
  return add_command<LoopbackCommand>(
      app, "loopback",
      "run a session in one process on virtual time: repeatable, faster than real time");
}

}  // namespace palpate
