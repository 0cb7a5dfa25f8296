// SPDX-License-Identifier: Apache-2.0
#include <spdlog/fmt/fmt.h>

#include <cstdio>
#include <deque>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "common/core/check.h"
#include "common/core/user/output_file.h"
#include "common/process/options.h"
#include "common/process/terminal.h"
#include "common/session/session_file.h"
#include "common/task/score.h"
#include "common/telemetry/csv_writer.h"
#include "common/telemetry/flight_recorder.h"
#include "common/telemetry/summary.h"
#include "deploy/lockstep/loopback.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/options.h"
#include "deploy/palpate/screen/verdict.h"
#include "device_node/post_mortem.h"
#include "viewer_node/recording/recording_file.h"

namespace palpate {
namespace {

/// What a flight recorder of device_node writes in real time, of the first fault or reduction by
/// the monitor, or of the end of the run.
class FaultFileWriter {
 public:
  explicit FaultFileWriter(double rate_hz)
      : most_ticks_(device::PostMortem::ticks_of_window(rate_hz)) {}
  void listen_to(LockstepOptions& options) {
    options.journal = &journal_;
    options.on_device_tick = [this](const DeviceTick& tick) { keep(tick); };
  }
  /// @return  of a file; report_command.cpp reads it
  [[nodiscard]] std::string text() {
    if (text_.empty()) write("no fault");
    return text_;
  }

 private:
  void keep(const DeviceTick& tick) {
    if (!text_.empty()) return;
    post_mortem_.take(journal_);
    ticks_.push_back(tick);
    if (ticks_.size() > most_ticks_) ticks_.pop_front();
    if (tick.guard == GuardState::kFault) write("a fault");
    if (tick.is_monitor_reduced) write("a command that the monitor reduced");
  }
  void write(const std::string& what) {
    std::ostringstream out;
    write_flight_header(out, DeviceTick{});
    for (const DeviceTick& tick : ticks_) write_flight_row(out, tick);
    post_mortem_.write(out, "on virtual time, " + what);
    text_ = out.str();
  }

  std::size_t most_ticks_;
  device::Journal journal_;
  device::PostMortem post_mortem_;
  std::deque<DeviceTick> ticks_;
  std::string text_;
};

struct LoopbackCommand {
  SessionOptions session;
  std::string side;
  std::optional<double> seconds;
  OutputOptions output;
  std::string hand_file;
  std::string post_mortem_file;
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
    app.add_option("--post-mortem", post_mortem_file,
                   "write what led to the first fault of the device, or to the first command that "
                   "the monitor reduced; palpate report shows it and computes it again")
        ->type_name("FILE.csv");
    app.add_flag("--no-ideal", has_no_ideal,
                 "skip the ideal force, the ideal run and the figures that need them");
    app.add_flag("--inproc", is_inproc,
                 "pass the messages through ZeroMQ inproc sockets instead of memory");
  }

  int run(const Verbosity& verbosity) const {
    Session loaded = session.load(verbosity);
    if (side.empty() && loaded.sides.size() > 1) return run_all(loaded, verbosity);
    // tissue deforms for each tool separately, so one side alone gets the same forces as beside
    // others
    loaded = with_only_side(std::move(loaded), side);
    output.check(loaded, {output.csv_file}, hand_file);
    std::optional<double> length_s = seconds;
    int status = 0;
    if (!hand_file.empty()) {
      RecordingFile recording(hand_file);
      recording.choose_side(side);
      RecordedPath path = hand_path_of(recording, loaded.side().hand);
      status = status_of_damage(recording);
      if (!length_s) length_s = recording.length_s();
      loaded.side().hand.path = std::move(path);
    }
    JsonOutput json(output);
    const auto warn_of_start = [is_first = true](const PhysicsTick& tick) mutable {
      if (!std::exchange(is_first, false)) return;
      const std::string warning = start_warning(tick);
      if (!warning.empty()) say(warning);
    };
    LoopbackOptions options = loopback_options(length_s);
    options.record = output.record();
    options.recorded_by = "palpate loopback" + (hand_file.empty() ? "" : " --hand " + hand_file);
    options.lockstep.on_physics_tick = warn_of_start;
    FaultFileWriter faults(loaded.side().device.rate_hz);
    if (!post_mortem_file.empty()) {
      std::vector<std::string> inputs = files_of(loaded);
      inputs.push_back(hand_file);
      check_outputs({{"--post-mortem", post_mortem_file},
                     {"--json", output.json_file},
                     {"--record", output.record_file}},
                    inputs, output.may_overwrite);
      faults.listen_to(options.lockstep);
    }
    std::vector<std::string> lost;
    options.lost_outputs = &lost;
    std::optional<TaskScore> task;
    options.task_score = &task;
    const RunReport report =
        watched(loaded, options, verbosity, [&] { return run_loopback(loaded, options); });
    say_if_stopped(report, length_s.value_or(loaded.duration_s));
    if (!post_mortem_file.empty()) {
      write_file("loopback", post_mortem_file, faults.text(), output.may_overwrite);
    }
    if (!verbosity.is_quiet) {
      const std::string verdict = verdict_text(judge(facts_of(loaded, report)));
      std::fputs((summary_text(loaded, report) + verdict).c_str(), stdout);
      if (task) std::fputs(score_text(*task).c_str(), stdout);
    }
    nlohmann::ordered_json all = summary_json(loaded, report);
    if (task) all["task"] = score_json(*task);
    write_json(json, all, lost);
    output.say_written({output.csv_file, post_mortem_file}, verbosity);
    return status;
  }

 private:
  /// All sides together.
  int run_all(const Session& loaded, const Verbosity& verbosity) const {
    if (!hand_file.empty() || !output.record_file.empty() || !post_mortem_file.empty()) {
      throw SetupError(std::string(!hand_file.empty()            ? "--hand"
                                   : !output.record_file.empty() ? "--record"
                                                                 : "--post-mortem") +
                       ": needs one side of the session; give --side NAME");
    }
    std::vector<std::string> tables;
    for (const Side& one : loaded.sides) {
      if (!output.csv_file.empty()) tables.push_back(csv_file_of(output.csv_file, one.name));
    }
    output.check(loaded, tables);
    JsonOutput json(output);
    LoopbackOptions options = loopback_options(seconds);
    std::vector<std::string> lost;
    options.lost_outputs = &lost;
    const std::vector<RunReport> reports =
        watched(loaded, options, verbosity, [&] { return run_all_sides(loaded, options); });
    say_if_stopped(reports.front(), seconds.value_or(loaded.duration_s));
    nlohmann::ordered_json all;
    all["schema_version"] = kSummarySchemaVersion;
    all["session"] = loaded.name;
    for (std::size_t i = 0; i < reports.size(); ++i) {
      const std::string& name = loaded.sides[i].name;
      Session one = with_only_side(loaded, name);
      all["sides"][name] = summary_json(one, reports[i]);
      if (verbosity.is_quiet) continue;
      one.name += ", " + name;
      const std::string verdict = verdict_text(judge(facts_of(one, reports[i])));
      std::fputs((summary_text(one, reports[i]) + verdict).c_str(), stdout);
    }
    write_json(json, all, lost);
    output.say_written(tables, verbosity);
    return 0;
  }

  /// The last output. Throws std::runtime_error with all that was lost.
  static void write_json(JsonOutput& json, const nlohmann::ordered_json& all,
                         std::vector<std::string>& lost) {
    try {
      json.write(all);
    } catch (const std::runtime_error& error) {
      lost.emplace_back(error.what());
    }
    if (!lost.empty()) throw std::runtime_error(fmt::format("{}", fmt::join(lost, "\n")));
  }

  [[nodiscard]] LoopbackOptions loopback_options(std::optional<double> length_s) const {
    return {.seconds = length_s,
            .csv_file = output.csv_file,
            .may_overwrite = output.may_overwrite,
            .ends_with_reader =
                output.json_file.empty() && output.record_file.empty() && post_mortem_file.empty(),
            .lockstep = {.links = is_inproc ? LockstepLinks::kInproc : LockstepLinks::kMemory,
                         .has_ideal = !has_no_ideal}};
  }

  /// Runs with a progress line until the end or a signal.
  template <class Run>
  static std::invoke_result_t<Run> watched(const Session& session, LoopbackOptions& options,
                                           const Verbosity& verbosity, const Run& run) {
    const StopSignal stop;
    std::optional<BusyLine> loading(std::in_place, "loading the session", verbosity.is_quiet);
    std::optional<Progress> progress;
    options.may_go_on = [&](double done) {
      if (loading) progress.emplace("loopback", verbosity.is_quiet);
      loading.reset();
      progress->show(done);
      return !StopSignal::is_requested();
    };
    try {
      std::invoke_result_t<Run> result = run();
      progress.reset();
      return result;
    } catch (const SetupError& error) {
      throw SetupError(with_place(session, error.what()));
    }
  }

  static void say_if_stopped(const RunReport& report, double whole_s) {
    if (report.simulated_s >= whole_s) return;
    say(fmt::format("stopped after {:.2f} s of {:.2f} s", report.simulated_s, whole_s));
  }
};

}  // namespace

Command add_loopback_command(CLI::App& app) {
  return add_command<LoopbackCommand>(
      app, "loopback",
      "run a session in one process on virtual time: repeatable, faster than real time");
}

}  // namespace palpate
