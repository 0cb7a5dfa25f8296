// SPDX-License-Identifier: Apache-2.0
// verdict.h — judges a run: what went wrong with it, why, and what to do. The only place that does:
// the summaries, the reports, the page and the JSON show what it finds.
#pragma once

#include <cstdint>
#include <limits>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "common/session/session.h"
#include "common/telemetry/summary.h"
#include "common/telemetry/telemetry.h"

namespace palpate {

enum class Grade : std::uint8_t { kGood, kFair, kBad };
[[nodiscard]] const char* name(Grade grade);

// Thresholds; `palpate explain verdict` states them.
inline constexpr double kFairRatio = 0.10;  ///< force error, clamped contact, samples beyond JND, …
inline constexpr double kBadRatio = 0.30;
inline constexpr std::uint64_t kBadReversals = 3;       ///< beyond those of the ideal run
inline constexpr double kFewTicks = 1e-3;               ///< of the ticks: skipped, not answered
inline constexpr double kLeastEnergy_joule = -1e-6;     ///< the guarantee of mode guard
inline constexpr double kFairPhysicsRate_ratio = 0.95;  ///< of physics.rate_hz
inline constexpr double kBadPhysicsRate_ratio = 0.70;

/// What is judged of one device's run. NaN, nullopt or empty where it is not known.
struct RunFacts {
  // the session
  bool is_session_known = false;    ///< false: only its controller is, at most
  std::string controller{};         ///< as controller_text() gives it
  bool is_limited = true;           ///< by MOFC or behind the safety net
  bool is_local = false;            ///< mofc.interaction: local
  bool waits_for_physics = false;   ///< forces are those of the same tick
  bool has_kalman_velocity = true;  ///< mofc.velocity_estimator
  bool is_simulated = true;         ///< the device
  double device_rate_hz = kNaN;
  double physics_rate_hz = kNaN;
  double coulomb_newton = kNaN;         ///< f_co of the profile
  double position_resolution_m = kNaN;  ///< q of the profile
  double latency_s = 0.0;               ///< device.latency_us
  double start_ramp_s = 0.0;
  double force_ratio = 1.0;         ///< device.workspace.force_ratio
  bool is_foreign_physics = false;  ///< physics.command
  std::optional<InteractionDeadband> interaction_deadband{};
  std::optional<MotionDeadband> motion_deadband{};
  double credit_cap_joule = kNaN;  ///< mofc.guard_settings.credit_cap_joule
  double solve_rate_hz = kNaN;     ///< lowest of the elastic tissues; NaN: there is none
  double v_max_m_per_s = std::numeric_limits<double>::infinity();
  double path_m_per_s = 0.0;  ///< fastest place of a recorded path; 0: the path is another one
  double path_at_s = 0.0;
  bool has_tissue = true;
  double duration_s = kNaN;     ///< of the session
  FaultsConfig faults{};        ///< what it simulates to go wrong,
  AdversaryConfig adversary{};  ///< and who

  // the nodes
  struct Node {
    bool is_recorded = true;  ///< false: a recording from which its telemetry was left out
    bool is_heard = true;
    std::uint64_t restarts = 0;
    std::uint64_t peers_refused = 0;
  };
  bool is_in_real_time = true;  ///< false: in lockstep
  std::size_t sides = 1;        ///< of the session
  std::size_t processors = 0;   ///< that all nodes of the session share; 0: not known
  double load = kNaN;           ///< mean load of that machine in the last minute
  Node device_node{};
  Node mofc_node{};
  Node physics_node{};
  DeviceCounters device{};
  MofcCounters mofc{};
  PhysicsCounters physics{};
  double physics_hz = kNaN;              ///< steps per second, as measured
  double physics_gap_s = 0.0;            ///< longest time between two steps
  double physics_gap_ratio = 0.0;        ///< of the time in which it ran
  double physics_busy_ratio = kNaN;      ///< share of that time in which it computed
  std::uint64_t clutched_ticks = 0;      ///< answered while hand and tool were uncoupled
  std::uint64_t ticks_received = 0;      ///< telemetry of the device; 0: not known
  std::uint64_t true_contact_ticks = 0;  ///< by the ideal run; 0: not known

  // what the hand received
  double minimum_true_energy_joule = kNaN;
  double maximum_force_newton = kNaN;
  double force_error_rms_ratio = kNaN;  ///< against the ideal
  double beyond_jnd_ratio = kNaN;
  std::optional<std::uint64_t> excess_reversals{};
};

/// What the session says about the run of one of its sides.
[[nodiscard]] RunFacts facts_of(const Session& session, const Side& side);
/// Of a run in lockstep. @param session  has that side only
[[nodiscard]] RunFacts facts_of(const Session& session, const RunReport& report);

struct RunFinding {
  Grade grade = Grade::kGood;
  std::string what{};    ///< "clamped"; a key for programs
  std::string cause{};   ///< "physics_slow": the finding that explains this one, or itself
  std::string text{};    ///< "physics computed 628 of 1,000 steps a second"
  std::string remedy{};  ///< what to do; empty: nothing
  double share = 1.0;    ///< of the ticks, or of the contact, that it took; 1: not counted so
};

/// Never empty. What happened to nodes and device comes first, then what that did to the force.
[[nodiscard]] std::vector<RunFinding> judge(const RunFacts& facts);
/// The worst of the findings.
[[nodiscard]] Grade grade_of(const std::vector<RunFinding>& findings);
/// Why the run has that grade: of the first of the worst findings; empty if it is good.
[[nodiscard]] std::string cause_of(const std::vector<RunFinding>& findings);

/// Keys: docs/glossary.md.
[[nodiscard]] nlohmann::ordered_json verdict_json(const std::vector<RunFinding>& findings);

}  // namespace palpate
