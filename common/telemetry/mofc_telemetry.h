// SPDX-License-Identifier: Apache-2.0
// mofc_telemetry.h — one record per answer of mofc_node, and its counters since the start.
#pragma once

#include <cstdint>

#include "common/core/messages.h"
#include "common/core/ports.h"
#include "common/core/time.h"
#include "common/core/vector.h"
#include "common/telemetry/loop_counters.h"

namespace palpate {

/// State of the physics as mofc_node sees it.
enum class MofcState : std::uint8_t {
  kNoPhysics = 0,  ///< no message yet, or silent and faded out: requests zero force
  kFree = 1,       ///< fresh, no contact
  kContact = 2,    ///< fresh, contact
  kFading = 3,     ///< silent beyond stale_after
  kClutched = 4,   ///< hand and tool uncoupled: requests zero force
};
[[nodiscard]] const char* name(MofcState state);

/// What the jaws of the tool do, a needle or a blade. What is lost stays so until they open or take
/// hold again.
enum class GripState : std::uint8_t {
  kNone = 0,     ///< hold nothing
  kHolds = 1,    ///< hold a tissue
  kSlips = 2,    ///< hold it, and it slipped in this tick
  kTorn = 3,     ///< lost it: the force was above tear_newton
  kSlipped = 4,  ///< lost it: it slipped out
  kPierced = 5,  ///< a needle or a blade is in a tissue, and moves with it
  kPierces = 6,  ///< a needle goes in or out
  kCuts = 7,     ///< a blade moves in the tissue
};
[[nodiscard]] constexpr bool is_holding(GripState grip) noexcept {
  return grip == GripState::kHolds || grip == GripState::kSlips;
}
[[nodiscard]] constexpr bool is_pierced(GripState grip) noexcept {
  return grip == GripState::kPierced || grip == GripState::kPierces || grip == GripState::kCuts;
}

/// One answer of mofc_node.
struct MofcTick {
  std::uint64_t device_session_id = 0;
  std::uint64_t device_sequence = 0;  ///< the DeviceState answered
  TimePoint device_sampled_at{};      ///< device's clock
  Vector3 requested_force_on_hand_newton =
      Vector3::Zero();  ///< requested, before fade and clamp, D
  /// Per joint of the wrist; NaN without one.
  Vector3 requested_wrist_torque_newton_m = Vector3::Constant(kNaN);
  Vector3 commanded_force_on_hand_newton = Vector3::Zero();  ///< after the clamp, D
  Vector3 f_max_newton = Vector3::Constant(kNaN);            ///< NaN: no bound (controller none)
  double ledger_energy_joule = kNaN;  ///< E' of the controller; NaN: no ledger
  Duration force_age{};  ///< device time since the DeviceState that physics answered; 0 if none
  MofcState state = MofcState::kNoPhysics;
  bool is_clamped = false;
  bool is_in_contact = false;    ///< as physics last reported
  bool is_from_standby = false;  ///< the request is that of physics.standby
  GripState grip = GripState::kNone;
};

struct MofcCounters {
  LinkCounters device_state;
  LinkCounters interaction;
  std::uint64_t ticks = 0;
  std::uint64_t contact_ticks = 0;
  std::uint64_t clamped_ticks = 0;
  std::uint64_t debt_ticks = 0;      ///< of these: E' was below 0, so only what friction bears acts
  std::uint64_t too_fast_ticks = 0;  ///< the hand exceeded the speed assumed by mode guard
  std::uint64_t stale_ticks = 0;
  std::uint64_t late_physics_ticks = 0;  ///< wait_for_physics expired
  std::uint64_t ledger_resets = 0;       ///< new device session, or a gap in the echo
  /// Of contact_ticks and clamped_ticks: within 0.1 s of silent or late physics, or of a tick of
  /// the device that was skipped or had no answer.
  std::uint64_t disturbed_contact_ticks = 0;
  std::uint64_t disturbed_clamped_ticks = 0;
  std::uint64_t motions_dropped = 0;     ///< tool_motion refused by the link
  std::uint64_t motions_suppressed = 0;  ///< not sent: within mofc.motion_deadband
  /// For the transparency of the session so far, projected and capped (docs/theory.md §7.2): its
  /// integral over the time in which a force was requested or acted, and that time. Transparency is
  /// their quotient.
  double transparency_integral_ns = 0.0;
  std::uint64_t transparency_time_ns = 0;
  // with physics.standby; else 0
  LinkCounters standby_interaction = {};
  std::uint64_t physics_term = 0;      ///< odd: the standby speaks
  std::uint64_t standby_ticks = 0;     ///< answered from the standby
  std::uint64_t physics_switches = 0;  ///< of this side, between the two
  // with scene.tool.gripper; else 0
  std::uint64_t grips = 0;          ///< closings that took hold of a tissue
  std::uint64_t grips_torn = 0;     ///< of these, ended by a force above tear_newton
  std::uint64_t grips_slipped = 0;  ///< ended because the tissue had slipped out
  std::uint64_t punctures = 0;      ///< with scene.tool.needle or blade: insertions into a tissue

  /// Of the session so far; NaN while there was no force.
  [[nodiscard]] double transparency() const noexcept {
    return transparency_time_ns > 0
               ? transparency_integral_ns / static_cast<double>(transparency_time_ns)
               : kNaN;
  }
};

}  // namespace palpate
