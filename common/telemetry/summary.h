// SPDX-License-Identifier: Apache-2.0
// summary.h — the figures of a run, as text and as JSON.
#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "common/session/session.h"
#include "common/telemetry/metrics.h"
#include "common/telemetry/request_comparison.h"
#include "common/telemetry/telemetry.h"
#include "common/telemetry/tick_row.h"

namespace palpate {

/// Accumulates the rows of a run. What acted counts for as long as it acted, from the first row on
/// until the last one. Definitions: docs/theory.md §7.
class RunStatistics {
 public:
  /// Rows in order. The time before the first row of a device session, and between rows of which
  /// some are missing, counts only as far as the row says what acted in it.
  void add(const TickRow& row, const IdealState& ideal);

  /// Figures that need the ideal are NaN without it.
  [[nodiscard]] std::uint64_t ticks() const { return ticks_; }
  [[nodiscard]] std::uint64_t contact_ticks() const { return contact_ticks_; }
  /// Answered while hand and tool were uncoupled.
  [[nodiscard]] std::uint64_t clutched_ticks() const { return clutched_ticks_; }
  /// fs against fe, [MOFC] eqs. (15)–(18), per axis.
  [[nodiscard]] Vector3 transparency() const { return requests_.per_axis().mean(); }
  /// fs against fe, projected and capped.
  [[nodiscard]] double vector_transparency() const { return requests_.rendered().transparency(); }
  /// fs against fi, projected and capped.
  [[nodiscard]] double ideal_transparency() const { return to_ideal_.transparency(); }
  /// The torque on the wrist against that of the tissue, projected and capped; the rms of its error
  /// over its rms. NaN without a wrist.
  [[nodiscard]] double torque_transparency() const { return wrist_to_ideal_.transparency(); }
  [[nodiscard]] double torque_error_rms_ratio() const { return wrist_to_ideal_.rms_error_ratio(); }
  /// Of one joint.
  [[nodiscard]] double maximum_torque_newton_m() const { return maximum_torque_newton_m_; }
  /// fs against fi, projected, not capped: above 1 where the force overshoots.
  [[nodiscard]] double gain() const { return to_ideal_.gain(); }
  /// The rms of fs − fi over the rms of fi.
  [[nodiscard]] double force_error_rms_ratio() const { return to_ideal_.rms_error_ratio(); }
  /// The largest mean of |fs − fi| over 20 ms.
  [[nodiscard]] double largest_force_error_newton() const { return largest_error_.value(); }
  /// rms of the difference to the force of the ideal run at the same time, over its rms; includes
  /// the effect of a different hand position.
  [[nodiscard]] double ideal_run_force_error_rms_ratio() const {
    return to_ideal_run_.rms_error_ratio();
  }
  /// Share of the time with a force in which fs and fi differ by more than the force JND.
  [[nodiscard]] double beyond_jnd_ratio() const { return to_ideal_.beyond_jnd_ratio(); }
  [[nodiscard]] double minimum_true_energy_joule() const { return minimum_true_energy_joule_; }
  [[nodiscard]] double maximum_force_newton() const { return maximum_force_newton_; }
  /// Of a simulated device: the true speed of the tool at the ticks.
  [[nodiscard]] double top_tool_speed_m_per_s() const { return top_tool_speed_m_per_s_; }
  /// Likewise of its fastest joint; 0 without a wrist.
  [[nodiscard]] double top_wrist_speed_rad_per_s() const { return top_wrist_speed_rad_per_s_; }
  /// Without the force of an answer, after the first one.
  [[nodiscard]] double longest_fallback_s() const { return longest_fallback_s_; }
  [[nodiscard]] std::array<std::uint64_t, 3> reversals() const { return reversals_.reversals(); }
  [[nodiscard]] std::array<std::uint64_t, 3> ideal_reversals() const {
    return ideal_reversals_.reversals();
  }
  /// Reversals of this run beyond those of the ideal run, all axes; never below 0.
  [[nodiscard]] std::uint64_t excess_reversals() const;
  /// Distance to the ideal run's tool, linear between two rows.
  [[nodiscard]] double path_deviation_rms_m() const;
  [[nodiscard]] double path_deviation_peak_m() const;
  /// Clamped ticks over ticks with a requested force.
  [[nodiscard]] double clamp_ratio() const;

 private:
  void add_fallback(const DeviceTick& tick);
  void compare(const TickRow& row, const IdealState& ideal);
  void add_to_ideal(const ForceComparison& comparison, double elapsed_s);

  std::uint64_t ticks_ = 0;
  std::uint64_t contact_ticks_ = 0;
  std::uint64_t requested_ticks_ = 0;
  std::uint64_t clamped_ticks_ = 0;
  std::uint64_t clutched_ticks_ = 0;
  /// What the next row needs of a row; NaN where it is not known.
  struct Previous {
    std::uint64_t device_session_id = 0;
    std::uint64_t sequence = 0;
    TimePoint sampled_at{};
    LastSwitch last_switch;
    Vector3 ideal_newton;
    Vector3 ideal_run_newton;
    Vector3 deviation_m;  ///< from the ideal run
  };
  std::optional<Previous> previous_;  // of the tick before this one
  RequestComparison requests_;
  ForceComparison to_ideal_;
  ForceComparison wrist_to_ideal_;
  ForceComparison to_ideal_run_;
  LargestMean largest_error_;
  double minimum_true_energy_joule_ = kNaN;
  double maximum_force_newton_ = 0.0;
  double maximum_torque_newton_m_ = kNaN;
  double top_tool_speed_m_per_s_ = 0.0;
  double top_wrist_speed_rad_per_s_ = 0.0;
  bool was_answered_ = false;
  std::optional<TimePoint> fallback_from_;
  double longest_fallback_s_ = 0.0;
  ReversalCounter reversals_;
  ReversalCounter ideal_reversals_;
  double deviation_s_ = 0.0;     // for which both paths are known
  double deviation2_m2s_ = 0.0;  // ∫ |deviation|² dt
  double deviation_peak_m_ = kNaN;
};

struct RunReport {
  RunStatistics statistics;
  DeviceCounters device;
  MofcCounters mofc;
  PhysicsCounters physics;
  double simulated_s = 0.0;
  double wall_s = 0.0;
};

/// Of the JSON summary; raised when a key changes its meaning.
inline constexpr int kSummarySchemaVersion = 2;

/// Keys: docs/glossary.md; null where a figure is unknown.
[[nodiscard]] nlohmann::ordered_json summary_json(const Session& session, const RunReport& report);
/// A dozen lines for a terminal.
[[nodiscard]] std::string summary_text(const Session& session, const RunReport& report);

/// With physics.standby: which of the two speaks, and how much it has.
[[nodiscard]] std::string speaker_text(const MofcCounters& mofc);
/// Full solutions, what failed, measured error and stated bound; empty without elastic tissue.
[[nodiscard]] std::string elastic_text(const PhysicsCounters& physics);
/// The same; null without elastic tissue.
[[nodiscard]] nlohmann::ordered_json elastic_json(const PhysicsCounters& physics);
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
