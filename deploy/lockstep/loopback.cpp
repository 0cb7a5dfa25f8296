#include "deploy/lockstep/loopback.h"

#include <algorithm>
#include <memory>
#include <stdexcept>

#include "common/core/check.h"
#include "common/core/clock.h"
#include "common/telemetry/csv_writer.h"
#include "deploy/lockstep/lockstep_recorder.h"

namespace palpate {
namespace {

constexpr double kSlice_s = 0.01;  // simulated, between two calls of may_go_on

}  // namespace

RunReport run_loopback(const Session& session, const LoopbackOptions& options) {
  if (!session.physics_command.empty()) {
    throw SetupError(session.file +
                     ": physics.command names a program that runs in real time only; use `palpate "
                     "launch`, or take the field out to simulate the tissue of the session");
  }
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

  RunReport report;
  const Lockstep* running = nullptr;
  Lockstep lockstep(session, lockstep_options, [&](const TickRow& row, const IdealState& ideal) {
    report.statistics.add(row, ideal);
    if (csv) csv->write(row);
    if (recorder) recorder->pump(*running, row);
  });
  running = &lockstep;

  const SteadyClock wall;
  const TimePoint begin = wall.now();
  const double whole_s = options.seconds.value_or(session.duration_s);
  for (int slices = 1; report.simulated_s < whole_s; ++slices) {
    report.simulated_s = options.may_go_on ? std::min(slices * kSlice_s, whole_s) : whole_s;
    lockstep.run_until(from_seconds(report.simulated_s));
    if (options.may_go_on && !options.may_go_on(report.simulated_s / whole_s)) break;
  }
  report.wall_s = to_seconds(wall.now() - begin);
  if (recorder) recorder->finish(lockstep, TimePoint(from_seconds(report.simulated_s)));

  if (csv) {
    csv->close();
    if (const auto error = csv->take_error()) throw std::runtime_error(*error);
  }
  report.device = lockstep.device_counters();
  report.mofc = lockstep.mofc_counters();
  report.physics = lockstep.physics_counters();
  return report;
}

}  // namespace palpate
