// SPDX-License-Identifier: Apache-2.0
// messages.h — the messages between the nodes, as plain structs. Their wire form is
// proto/palpate/v1; common/link/codec converts between the two.
//
// Frames. The axes of all frames are parallel; a driver converts its device's axes once.
//
//       z ▲            W  world: the frame of the scene, of tissue and tool.
//         │  y         D  device base: the frame of the hand and the motors.
//         │ ╱             WorkspaceMap relates W and D (scale, offset, clutch).
//         └────▶ x     T  tool: origin at the tool tip, orientation of the handle.
//
// The name of a force says on what it acts. SI units. Times are on the clock of the node named.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <optional>

#include "common/core/elastic/elastic_patch.h"
#include "common/core/time.h"
#include "common/core/tissue.h"
#include "common/core/vector.h"
#include "common/coupling/wave_channel.h"

namespace palpate {

/// Part of every message.
struct Header {
  std::uint64_t session_id = 0;  ///< random per process start, never 0
  std::uint64_t sequence = 0;    ///< from 0, incremented per message of this sender and kind
  TimePoint sampled_at{};        ///< sender's clock
};

/// The handle of a device that turns: three joints whose axes meet in the tip. Values of its joints
/// are Vector3, one component per joint; angles are continuous, without jumps by turns.
///
/// One reading. A torque T about the tip asks the joints for axesᵀ T [N·m]; what the joints turn by
/// turns the tool by axes · dθ.
struct WristPose {
  Vector3 angle_rad = Vector3::Zero();
  Matrix3 axes = Matrix3::Identity();  ///< columns: unit, D, as they stand at these angles
};

/// The same with what the motors of the joints do at the time of the reading.
struct WristState {
  WristPose pose{};
  Vector3 acting_torque_newton_m = Vector3::Zero();  ///< on the hand, per joint
};

/// A time interval during which the device applied a constant force to the hand.
struct AppliedForce {
  Vector3 force_on_hand_newton = Vector3::Zero();  ///< D
  TimePoint from{};                                ///< device's clock
  TimePoint until{};
  /// Measured at `until`, D. Valid only if `has_position_at_end`: when the watchdog of the motor
  /// controller or a release of the motors ends the force, the position is not read.
  Vector3 hand_position_at_end_m = Vector3::Zero();
  bool has_position_at_end = true;
  // only with a wrist, per joint
  Vector3 wrist_torque_newton_m = Vector3::Zero();   ///< on the hand
  Vector3 wrist_angle_at_end_rad = Vector3::Zero();  ///< valid as the position is
};
inline constexpr std::size_t kMaxAppliedForces = 64;

/// Hop 1, device → mofc, every device tick.
struct DeviceState {
  Header header;  ///< session_id: the device's; sampled_at: t_k, the time of the reading

  Vector3 hand_position_m = Vector3::Zero();                   ///< D, measured at t_k
  Vector3 tool_position_world_m = Vector3::Zero();             ///< W, tool tip
  Quaternion tool_orientation_world = Quaternion::Identity();  ///< W from T, unit
  std::uint32_t buttons = 0;                                   ///< bit i: button i is held
  bool is_clutched = false;  ///< hand and tool are decoupled; no force may be rendered

  /// The forces applied since the newest reading whose answer has arrived, in time order, without
  /// gaps, up to t_k; the newest of them if there are more. Empty in the first message of a
  /// session.
  std::array<AppliedForce, kMaxAppliedForces> applied{};
  std::uint32_t applied_count = 0;

  Vector3 acting_force_on_hand_newton = Vector3::Zero();  ///< D, at t_k
  TimePoint acting_until{};  ///< its lease ends then, unless another force replaces it before
  /// M(k) of the monitor, which reduces what this does not cover; infinite: there is none.
  double monitor_energy_joule = std::numeric_limits<double>::infinity();

  std::optional<WristState> wrist{};  ///< none: the device gives no torque
};

/// Hop 4, mofc → device: the answer to one DeviceState.
struct ForceCommand {
  Header header;  ///< mofc's

  std::uint64_t answers_session_id = 0;  ///< the DeviceState answered
  std::uint64_t answers_sequence = 0;
  TimePoint answers_sampled_at{};  ///< its t_k, device's clock: what ended by then is booked

  Vector3 force_on_hand_newton = Vector3::Zero();  ///< D, after controller and fade
  Duration valid_for{};  ///< the lease: the longest time for which this force may be applied
  /// The force begins to act by then after the reading, or not at all; 0: by the device's deadline.
  Duration begins_within{};
  /// What the clamp counts of the energy that the hand has put in, before it regards
  /// monitor_energy_joule; NaN: it keeps no lower bound of it.
  double counted_energy_joule = std::numeric_limits<double>::quiet_NaN();
  Vector3 wrist_torque_newton_m = Vector3::Zero();  ///< on the hand, per joint; with a wrist
};

/// How a rigid tool moves; W.
struct ToolVelocity {
  Vector3 tip_m_per_s = Vector3::Zero();
  Vector3 angular_rad_per_s = Vector3::Zero();

  ToolVelocity() = default;
  ToolVelocity(const Vector3& tip, const Vector3& angular)
      : tip_m_per_s(tip), angular_rad_per_s(angular) {}
  // A tool that does not turn.
  // NOLINTBEGIN(google-explicit-constructor)
  ToolVelocity(double x, double y, double z) : tip_m_per_s(x, y, z) {}
  template <class Derived>
  ToolVelocity(const Eigen::MatrixBase<Derived>& tip) : tip_m_per_s(tip) {}
  // NOLINTEND(google-explicit-constructor)
  /// Of its point there.   @param arm_m  from the tip
  [[nodiscard]] Vector3 at(const Vector3& arm_m) const noexcept {
    return tip_m_per_s + angular_rad_per_s.cross(arm_m);
  }
};

/// What mofc_node did to the tissue in the jaws.
struct GripReport {
  std::uint64_t physics_session_id = 0;  ///< whose Grip it is
  std::uint32_t number = 0;              ///< of that Grip
  Vector3 slip_m = Vector3::Zero();      ///< of the tool since the closing, W
  bool has_let_go = false;               ///< opened, torn or slipped out
};

/// Hop 2, mofc → physics.
struct ToolMotion {
  Header header;  ///< mofc's

  std::uint64_t device_session_id = 0;  ///< the relayed DeviceState
  std::uint64_t device_sequence = 0;
  TimePoint device_sampled_at{};  ///< device's clock; echoed back in Interaction

  Vector3 tool_position_world_m = Vector3::Zero();
  Quaternion tool_orientation_world = Quaternion::Identity();
  Vector3 tool_velocity_world_m_per_s = Vector3::Zero();  ///< estimated by mofc
  std::uint32_t buttons = 0;
  SurfaceReceipts receipts{};  ///< of what hop 3 has carried
  /// The sender solves the contact with elastic bodies itself; the store is that of `receipts`.
  std::optional<ElasticReceipts> elastic_receipts{};

  std::uint64_t physics_term = 0;  ///< which physics all sides use: physics_term.h
  /// Time of moving tissue in the physics in use when this arrives, as far as mofc knows.
  std::optional<TimePoint> scene_time{};

  Wave wave{};                       ///< with wave variables: towards the tissue, W
  std::optional<GripReport> grip{};  ///< none: nothing is held, or physics' own slip counts
  bool wants_torque = false;         ///< the device can render it: contacts say where they act
  /// Estimated by mofc; with a wrist only.
  Vector3 tool_angular_velocity_world_rad_per_s = Vector3::Zero();

  [[nodiscard]] ToolVelocity tool_velocity_world() const noexcept {
    return {tool_velocity_world_m_per_s, tool_angular_velocity_world_rad_per_s};
  }
};

/// How a needle yields along its hole, or a blade along its cut (contact/elastic/grip.h). Its depth
/// is slip_m · inward.
struct NeedleLaw {
  Vector3 inward_world = Vector3::Zero();  ///< unit, of the insertion; zero: no needle but jaws
  double cutting_newton = 0.0;             ///< deeper than `deepest_m`
  double spreading_newton = 0.0;           ///< inward
  double friction_newton_per_m = 0.0;      ///< both ways, by depth
  double deepest_m = 0.0;                  ///< where the hole ends, ≥ 0
  Vector3 edge_world = Vector3::Zero();    ///< unit, across `inward_world`; zero: not a blade
  double friction_newton = 0.0;            ///< both ways, whatever the depth, and along the edge

  [[nodiscard]] bool is_there() const noexcept { return !inward_world.isZero(0.0); }
  [[nodiscard]] bool is_blade() const noexcept { return !edge_world.isZero(0.0); }
};

/// How the jaws of a tool, a needle or a blade hold a tissue. With a_ref = reference − slip_m, the
/// force on the tool is f₀ + K (a − a_ref) at a = tool − slip, whoever moved which of the two.
struct Grip {
  std::uint32_t number = 0;          ///< another one with every closing; 0: nothing is held
  std::uint32_t buttons = 0;         ///< the jaws are open unless all of these are held; 0: no jaws
  double slip_newton = 0.0;          ///< > 0; a larger force slips
  double tear_newton = 0.0;          ///< > 0; a larger force tears: the jaws lose the tissue
  double reach_m = 0.0;              ///< > 0; having slipped farther it is out of the jaws
  Vector3 slip_m = Vector3::Zero();  ///< of the tool since the closing, at the reference
  NeedleLaw needle{};                ///< instead of slip_newton
};

/// Local contact model of one tissue that the tool touches or is close to: the force at the
/// reference and how it varies nearby (theory.md §5; contact_model.h evaluates it). The reference
/// is the tool position and time of the Interaction that carries the contact. All quantities in W.
struct Contact {
  std::uint32_t tissue = 0;  ///< index in the scene

  // surface: a quadric around the reference
  double penetration_m = 0.0;                 ///< > 0: touching; else the negative distance
  Vector3 normal_world = Vector3::UnitZ();    ///< unit, out of the tissue
  Matrix3 curvature_per_m = Matrix3::Zero();  ///< Hessian of the distance; symmetric, · normal = 0
  Vector3 surface_velocity_world_m_per_s = Vector3::Zero();

  // force law, in the frame that rotates with the surface normal (the curvature gives the rotation)
  Vector3 elastic_force_on_tool_newton = Vector3::Zero();  ///< static; also given without touch
  Matrix3 d_force_d_position = Matrix3::Zero();            ///< ∂f/∂x of the elastic force [N/m]
  Matrix3 d_force_d_velocity = Matrix3::Zero();            ///< ∂f/∂v [N·s/m]
  double stiffening_newton_per_m2 = 0.0;  ///< c₂ of the term c₂ Δp² along the normal
  double stiffening_newton_per_m3 = 0.0;  ///< c₃ of the term c₃ Δp³ along the normal
  // Hunt and Crossley: k p (p/p₁)ⁿ⁻¹ + b (p/p₁)ⁿ ṗ along the normal takes the place of the above
  double hunt_crossley_exponent = 0.0;                ///< n ≥ 1; 0: no, next three unused
  double hunt_crossley_depth_m = 0.0;                 ///< p₁ > 0
  double hunt_crossley_stiffness_newton_per_m = 0.0;  ///< k
  double hunt_crossley_damping_newton_s_per_m = 0.0;  ///< b
  // Coulomb friction: a tangential spring that slips at μ times the elastic normal force
  double friction_coefficient = 0.0;             ///< μ ≥ 0; 0: no friction, next two unused
  double friction_stiffness_newton_per_m = 0.0;  ///< k_t > 0
  Vector3 stretch_m = Vector3::Zero();           ///< u₀ of that spring, orthogonal to the normal
  double stored_energy_joule = 0.0;              ///< elastic; also given without touch
  bool is_adhesive = false;                      ///< the force may pull the tool while it touches

  double trust_radius_m = 0.0;  ///< > 0; distance from the reference within which the model holds

  Vector3 force_on_tool_newton = Vector3::Zero();  ///< at the reference; 0 where not touching

  // what the tissue remembers, from which a receiver that has none continues
  bool is_shaft = false;             ///< else the tip
  bool is_behind = false;            ///< the tool is behind a sheet
  bool is_punctured = false;         ///< `stretch_m` is that of the drag
  Vector3 held_m = Vector3::Zero();  ///< from the tool to its proxy
  double relaxed_m = 0.0;            ///< penetration that the tissue has relaxed to
  /// The jaws hold it: adhesive, flat, touching; K symmetric and −K positive definite.
  Grip grip{};
  Vector3 arm_m = Vector3::Zero();  ///< from the tip to where the force acts, at the reference
};
inline constexpr std::size_t kMaxContacts = 8;

/// Hop 3, physics → mofc, every physics step.
struct Interaction {
  Header header;  ///< physics'

  std::uint64_t device_session_id = 0;  ///< the DeviceState to which this responds
  std::uint64_t device_sequence = 0;
  TimePoint device_sampled_at{};  ///< device's clock, echoed

  Vector3 tool_position_world_m = Vector3::Zero();  ///< the tool pose used in this step
  Quaternion tool_orientation_world = Quaternion::Identity();
  Vector3 force_on_tool_newton = Vector3::Zero();  ///< W, sum over all tissues
  double stored_energy_joule = 0.0;                ///< elastic, of all tissues touched
  /// In order of penetration, deepest first; near contacts follow those that touch.
  std::array<Contact, kMaxContacts> contacts{};
  std::uint32_t listed_count = 0;   ///< entries of `contacts`
  std::uint32_t contact_count = 0;  ///< tissues touched; may exceed the size of the array
  SurfaceNews surface{};
  ElasticNews elastic{};

  std::uint64_t physics_term = 0;  ///< highest heard of on hop 2
  Duration scene_ahead{};          ///< time of moving tissue less header.sampled_at
  std::uint64_t steps = 0;         ///< of this physics so far; 0: it does not report them

  Wave wave{};  ///< with wave variables: back to the hand, W; of the stream that it answers
  /// About the tip, W, sum over all tissues; where the tool motion wants it.
  Vector3 torque_on_tool_newton_m = Vector3::Zero();
};

/// How mofc_node uses an Interaction until the next one arrives.
enum class InteractionUse : std::uint8_t {
  kLocal,  ///< evaluates its local contact models at the device's rate
  kHeld,   ///< holds its force
};

// --- copies of messages with long lists: only the entries in use. A DeviceState has room for 64
// applied forces and uses one or two. -------------------------------------------------------------

/// Copies the message. Entries of its lists beyond their counts keep what they were.
template <class T>
void copy_message(const T& from, T& to) noexcept {
  to = from;
}

namespace message_copy {

template <class T, std::size_t kMost>
void copy_used(const std::array<T, kMost>& from, std::uint32_t count, std::array<T, kMost>& to) {
  std::copy_n(from.begin(), std::min<std::size_t>(count, kMost), to.begin());
}

}  // namespace message_copy

inline void copy_message(const DeviceState& from, DeviceState& to) noexcept {
  to.header = from.header;
  to.hand_position_m = from.hand_position_m;
  to.tool_position_world_m = from.tool_position_world_m;
  to.tool_orientation_world = from.tool_orientation_world;
  to.buttons = from.buttons;
  to.is_clutched = from.is_clutched;
  message_copy::copy_used(from.applied, from.applied_count, to.applied);
  to.applied_count = from.applied_count;
  to.acting_force_on_hand_newton = from.acting_force_on_hand_newton;
  to.acting_until = from.acting_until;
  to.monitor_energy_joule = from.monitor_energy_joule;
  to.wrist = from.wrist;
}

inline void copy_message(const SurfaceNews& from, SurfaceNews& to) noexcept {
  to.store_id = from.store_id;
  to.number = from.number;
  to.has_description = from.has_description;
  if (from.has_description) to.description = from.description;
  message_copy::copy_used(from.tiles, from.tile_count, to.tiles);
  to.tile_count = from.tile_count;
  message_copy::copy_used(from.coverages, from.coverage_count, to.coverages);
  to.coverage_count = from.coverage_count;
  message_copy::copy_used(from.pending, from.pending_count, to.pending);
  to.pending_count = from.pending_count;
}

inline void copy_message(const ElasticNews& from, ElasticNews& to) noexcept {
  to.store_id = from.store_id;
  to.number = from.number;
  to.has_point = from.has_point;
  if (from.store_id == 0) return;
  if (from.has_point) {
    to.point = from.point;
  } else {
    to.state = from.state;
  }
}

/// Without the news, which are for the stores of surfaces and of elastic bodies.
inline void copy_without_news(const Interaction& from, Interaction& to) noexcept {
  to.header = from.header;
  to.device_session_id = from.device_session_id;
  to.device_sequence = from.device_sequence;
  to.device_sampled_at = from.device_sampled_at;
  to.tool_position_world_m = from.tool_position_world_m;
  to.tool_orientation_world = from.tool_orientation_world;
  to.force_on_tool_newton = from.force_on_tool_newton;
  to.stored_energy_joule = from.stored_energy_joule;
  message_copy::copy_used(from.contacts, from.listed_count, to.contacts);
  to.listed_count = from.listed_count;
  to.contact_count = from.contact_count;
  to.physics_term = from.physics_term;
  to.scene_ahead = from.scene_ahead;
  to.steps = from.steps;
  to.wave = from.wave;
  to.torque_on_tool_newton_m = from.torque_on_tool_newton_m;
}

inline void copy_message(const Interaction& from, Interaction& to) noexcept {
  copy_without_news(from, to);
  copy_message(from.surface, to.surface);
  copy_message(from.elastic, to.elastic);
}

}  // namespace palpate
