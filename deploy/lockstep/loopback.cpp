// SPDX-License-Identifier: Apache-2.0
#include "deploy/lockstep/loopback.h"

#include <algorithm>
#include <memory>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "common/core/check.h"
#include "common/core/clock.h"
#include "common/task/evaluator.h"
#include "common/telemetry/csv_writer.h"
#include "deploy/lockstep/lockstep_recorder.h"

namespace palpate {
namespace {

constexpr double kSlice_s = 0.01;  // simulated, between two calls of may_go_on

/// Runs to the end, or until may_go_on says no. Throws ReaderHasLeft.
/// @return seconds simulated and seconds of wall time
std::pair<double, double> run_slices(Lockstep& lockstep, const Session& session,
                                     const LoopbackOptions& options,
                                     const CsvWriter* csv = nullptr) {
  const SteadyClock wall;
  const TimePoint begin = wall.now();
  const double whole_s = options.seconds.value_or(session.duration_s);
  double simulated_s = 0.0;
  for (int slices = 1; simulated_s < whole_s; ++slices) {
    simulated_s = options.may_go_on ? std::min(slices * kSlice_s, whole_s) : whole_s;
    lockstep.run_until(from_seconds(simulated_s));
    if (options.may_go_on && !options.may_go_on(simulated_s / whole_s)) break;
    if (options.ends_with_reader && csv != nullptr && !csv->has_reader()) throw ReaderHasLeft();
  }
  return {simulated_s, to_seconds(wall.now() - begin)};
}

void refuse_other_programs(const Session& session) {
  if (session.physics_command.empty()) return;
  throw SetupError(session.file +
                   ": physics.command names a program that runs in real time only; use `palpate "
                   "launch`, or take the field out to simulate the tissue of the session");
}

/// Ends one output; what is lost of it costs no other one.
template <class End>
void end_output(const LoopbackOptions& options, const End& end) {
  try {
    end();
  } catch (const std::runtime_error& error) {
    if (options.lost_outputs == nullptr) throw;
    options.lost_outputs->emplace_back(error.what());
  }
}

void close(CsvWriter& csv, const LoopbackOptions& options) {
  end_output(options, [&] {
    csv.close();
    if (const auto error = csv.take_error()) throw std::runtime_error(*error);
  });
}

}  // namespace

RunReport run_loopback(const Session& session, const LoopbackOptions& options) {
  refuse_other_programs(session);
  std::unique_ptr<CsvWriter> csv;
  if (!options.csv_file.empty()) {
    csv = std::make_unique<CsvWriter>(options.csv_file, options.may_overwrite);
  }

  LockstepOptions lockstep_options = options.lockstep;
  std::optional<LockstepRecorder> recorder;
  if (!options.record.file.empty()) {
    recorder.emplace(options.record, session, options.recorded_by);
    recorder->listen_to(lockstep_options);
  }

  std::optional<TaskEvaluator> task;
  if (session.task && options.task_score != nullptr) {
    TaskConfig config = *session.task;
    config.is_started_by_person = false;  // nobody can
    task.emplace(config, session.scene.tool());
    task->take(lockstep_scene(session));
  }

  RunReport report;
  const Lockstep* running = nullptr;
  Lockstep lockstep(session, lockstep_options, [&](const TickRow& row, const IdealState& ideal) {
    report.statistics.add(row, ideal);
    if (csv) csv->write(row);
    if (task) task->take(row);
    if (recorder) recorder->pump(*running, row, ideal);
  });
  running = &lockstep;
  std::tie(report.simulated_s, report.wall_s) = run_slices(lockstep, session, options, csv.get());
  if (recorder) {
    end_output(options,
               [&] { recorder->finish(lockstep, TimePoint(from_seconds(report.simulated_s))); });
  }
  if (csv) close(*csv, options);
  if (task) {
    task->finish();
    *options.task_score = task->score();
  }
  report.device = lockstep.device_counters();
  report.mofc = lockstep.mofc_counters();
  report.physics = lockstep.physics_counters();
  return report;
}

std::vector<RunReport> run_all_sides(const Session& session, const LoopbackOptions& options) {
  refuse_other_programs(session);
  std::vector<std::unique_ptr<CsvWriter>> tables;
  for (const Side& side : session.sides) {
    if (options.csv_file.empty()) break;
    tables.push_back(std::make_unique<CsvWriter>(csv_file_of(options.csv_file, side.name),
                                                 options.may_overwrite));
  }
  std::vector<RunReport> reports(session.sides.size());
  LockstepOptions lockstep_options = options.lockstep;
  lockstep_options.on_side_row = [&](std::size_t side, const TickRow& row,
                                     const IdealState& ideal) {
    reports[side].statistics.add(row, ideal);
    if (!tables.empty()) tables[side]->write(row);
  };
  Lockstep lockstep(session, lockstep_options, {});
  const auto [simulated_s, wall_s] = run_slices(lockstep, session, options);
  for (const auto& table : tables) close(*table, options);
  for (std::size_t i = 0; i < reports.size(); ++i) {
    reports[i].simulated_s = simulated_s;
    reports[i].wall_s = wall_s;
    reports[i].device = lockstep.device_counters(i);
    reports[i].mofc = lockstep.mofc_counters(i);
    reports[i].physics = lockstep.physics_counters(i);
  }
  return reports;
}

}  // namespace palpate
