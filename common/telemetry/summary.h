// summary.h — the figures of a run, as text and as JSON.
#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "common/session/session.h"
#include "common/telemetry/metrics.h"
#include "common/telemetry/telemetry.h"
#include "common/telemetry/tick_row.h"

namespace palpate {

/// Accumulates the rows of a run. Definitions: docs/theory.md §7.
class RunStatistics {
 public:
  void add(const TickRow& row, const IdealState& ideal);

  /// Figures that need the ideal are NaN without it.
  [[nodiscard]] std::uint64_t ticks() const { return ticks_; }
  [[nodiscard]] std::uint64_t contact_ticks() const { return contact_ticks_; }
  /// fs against fe, [MOFC] eqs. (15)–(18), per axis.
  [[nodiscard]] Vector3 transparency() const { return transparency_.mean(); }
  /// fs against fe, projected and capped.
  [[nodiscard]] double vector_transparency() const { return rendered_.mean(); }
  /// fs against fi, projected and capped; and the rms of fs − fi over the rms of fi.
  [[nodiscard]] double ideal_transparency() const { return true_to_ideal_.mean(); }
  [[nodiscard]] double force_error_rms_ratio() const { return true_to_ideal_.rms_error_ratio(); }
  /// rms of the difference to the force of the ideal run at the same time, over its rms; includes
  /// the effect of a different hand position.
  [[nodiscard]] double ideal_run_force_error_rms_ratio() const {
    return true_to_ideal_run_.rms_error_ratio();
  }
  /// Share of the samples in which fs and fi differ by more than the force JND.
  [[nodiscard]] double beyond_jnd_ratio() const;
  [[nodiscard]] double minimum_true_energy_joule() const { return minimum_true_energy_joule_; }
  [[nodiscard]] double maximum_force_newton() const { return maximum_force_newton_; }
  /// Of a simulated device: the true speed of the tool at the ticks.
  [[nodiscard]] double top_tool_speed_m_per_s() const { return top_tool_speed_m_per_s_; }
  /// Without the force of an answer, after the first one.
  [[nodiscard]] double longest_fallback_s() const { return longest_fallback_s_; }
  [[nodiscard]] std::array<std::uint64_t, 3> reversals() const { return reversals_.reversals(); }
  [[nodiscard]] std::array<std::uint64_t, 3> ideal_reversals() const {
    return ideal_reversals_.reversals();
  }
  /// Reversals of this run beyond those of the ideal run, all axes; never below 0.
  [[nodiscard]] std::uint64_t excess_reversals() const;
  /// Distance to the ideal run's tool.
  [[nodiscard]] double path_deviation_rms_m() const;
  [[nodiscard]] double path_deviation_peak_m() const;
  /// Clamped ticks over ticks with a requested force.
  [[nodiscard]] double clamp_ratio() const;

 private:
  void add_fallback(const DeviceTick& tick);

  std::uint64_t ticks_ = 0;
  std::uint64_t contact_ticks_ = 0;
  std::uint64_t asked_ticks_ = 0;
  std::uint64_t clamped_ticks_ = 0;
  PaperTransparency transparency_;
  ProjectedTransparency rendered_;
  ProjectedTransparency true_to_ideal_;
  ProjectedTransparency true_to_ideal_run_;
  std::uint64_t beyond_jnd_ = 0;
  double minimum_true_energy_joule_ = kNaN;
  double maximum_force_newton_ = 0.0;
  double top_tool_speed_m_per_s_ = 0.0;
  bool was_answered_ = false;
  std::optional<TimePoint> fallback_from_;
  double longest_fallback_s_ = 0.0;
  ReversalCounter reversals_;
  ReversalCounter ideal_reversals_;
  std::uint64_t deviation_samples_ = 0;
  double deviation2_m2_ = 0.0;
  double deviation_peak_m_ = 0.0;
};

struct RunReport {
  RunStatistics statistics;
  DeviceCounters device;
  MofcCounters mofc;
  PhysicsCounters physics;
  double simulated_s = 0.0;
  double wall_s = 0.0;
};

/// Keys: docs/glossary.md; null where a figure is unknown.
[[nodiscard]] nlohmann::ordered_json summary_json(const Session& session, const RunReport& report);
/// A dozen lines for a terminal.
[[nodiscard]] std::string summary_text(const Session& session, const RunReport& report);

/// With physics.standby: which of the two speaks, and how much it has.
[[nodiscard]] std::string speaker_text(const MofcCounters& mofc);
/// "off", or the commands that the monitor reduced.
[[nodiscard]] std::string monitor_text(const DeviceCounters& device);

/// A number in an fmt format, such as "{:.3f} N"; – where it is not finite.
[[nodiscard]] std::string figure(double value, const char* format);
/// "3.2 µJ", "1.34 J": a unit in which the number has one to three digits before the point.
[[nodiscard]] std::string energy_text(double joule);
/// null for NaN and infinity, which JSON does not have.
[[nodiscard]] nlohmann::ordered_json number_or_null(double value);

/// Share of the *scheduled* ticks (begun and skipped) that were answered in time; NaN before any.
[[nodiscard]] double answered_ratio(const DeviceCounters& counters);

}  // namespace palpate
