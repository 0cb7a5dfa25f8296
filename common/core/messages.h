// messages.h — what the nodes say to each other, as plain structs. The wire form is
// proto/palpate/v1; common/link/codec.h converts, whole or not at all.
//
// Frames. Axes of all frames are parallel; a driver converts its device's axes once.
//
//       z ▲            W  world: the scene. Tissue and tool live here.
//         │  y         D  device base: where the hand and the motors are.
//         │ ╱             W and D are related by WorkspaceMap (scale, offset, clutch).
//         └────▶ x     T  tool: origin at the tool tip, orientation of the handle.
//
// A force is named by what it pushes. SI units. Times are on the clock of the node named.
#pragma once

#include <array>
#include <cstdint>

#include "common/core/time.h"
#include "common/core/vector.h"

namespace palpate {

/// Carried by every message.
struct Header {
  std::uint64_t session_id = 0;  ///< random per process start, never 0
  std::uint64_t sequence = 0;    ///< from 0, one more for each message of this sender and kind
  TimePoint sampled_at{};        ///< sender's clock
};

/// One stretch of time during which one force acted on the hand, as the device really applied it.
struct AppliedForce {
  Vector3 force_on_hand_newton = Vector3::Zero();  ///< D
  TimePoint from{};                                ///< device's clock
  TimePoint until{};
  /// Measured at `until`, D. Meaningless unless `has_position_at_end`: when the motor-side
  /// watchdog ended the force by itself nobody read the encoder.
  Vector3 hand_position_at_end_m = Vector3::Zero();
  bool has_position_at_end = true;
};
inline constexpr std::size_t kMaxAppliedForces = 4;

/// Hop 1, device → mofc, every device tick.
struct DeviceState {
  Header header;  ///< session_id: the device's; sampled_at: t_k, the instant of the reading

  Vector3 hand_position_m = Vector3::Zero();                   ///< D, measured at t_k
  Vector3 tool_position_world_m = Vector3::Zero();             ///< W, tool tip
  Quaternion tool_orientation_world = Quaternion::Identity();  ///< W from T, unit
  std::uint32_t buttons = 0;                                   ///< bit i set while button i is held
  bool is_clutched = false;  ///< hand moves, tool rests: nothing may be rendered

  /// The forces that acted since the reading of the previous DeviceState, in time order, without a
  /// gap, up to t_k. Empty in the first message of a session.
  std::array<AppliedForce, kMaxAppliedForces> applied{};
  std::uint32_t applied_count = 0;
};

/// Hop 4, mofc → device: the answer to one DeviceState.
struct ForceCommand {
  Header header;  ///< mofc's

  std::uint64_t answers_session_id = 0;  ///< the DeviceState answered
  std::uint64_t answers_sequence = 0;

  Vector3 force_on_hand_newton = Vector3::Zero();  ///< D, after controller and fade
  Duration valid_for{};  ///< the lease: the longest time this force may act
};

/// Hop 2, mofc → physics.
struct ToolMotion {
  Header header;  ///< mofc's

  std::uint64_t device_session_id = 0;  ///< the DeviceState relayed
  std::uint64_t device_sequence = 0;
  TimePoint device_sampled_at{};  ///< device's clock; echoed back in Interaction

  Vector3 tool_position_world_m = Vector3::Zero();
  Quaternion tool_orientation_world = Quaternion::Identity();
  Vector3 tool_velocity_world_m_per_s = Vector3::Zero();  ///< estimated by mofc
  std::uint32_t buttons = 0;
};

/// One tissue at the tool, touched or about to be: what it does to the tool *there*, and how that
/// changes nearby. contact_model.h evaluates it. The reference is the place and time of the
/// Interaction that carries it; W throughout.
struct Contact {
  std::uint32_t tissue = 0;  ///< index in the scene

  // the surface: a quadric through curvature, seen from the reference
  double penetration_m = 0.0;                 ///< > 0: touching; else how far away, negative
  Vector3 normal_world = Vector3::UnitZ();    ///< unit, out of the tissue
  Matrix3 curvature_per_m = Matrix3::Zero();  ///< Hessian of the distance; symmetric, · normal = 0
  Vector3 surface_velocity_world_m_per_s = Vector3::Zero();

  // the law, in the frame that turns with the surface: its turning is in the curvature
  Vector3 elastic_force_on_tool_newton = Vector3::Zero();  ///< at rest; of the law, touching or not
  Matrix3 d_force_d_position = Matrix3::Zero();            ///< ∂f/∂x of the elastic force [N/m]
  Matrix3 d_force_d_velocity = Matrix3::Zero();            ///< ∂f/∂v [N·s/m]
  double stiffening_newton_per_m2 = 0.0;  ///< c₂: the law's c₂ Δp² along the normal
  double stiffening_newton_per_m3 = 0.0;  ///< c₃: and c₃ Δp³
  // Coulomb friction: a spring along the surface that slips at μ times the elastic normal force
  double friction_coefficient = 0.0;             ///< μ ≥ 0; 0: none, the next two mean nothing
  double friction_stiffness_newton_per_m = 0.0;  ///< k_t > 0
  Vector3 stretch_m = Vector3::Zero();           ///< u₀ of that spring, across the normal
  double stored_energy_joule = 0.0;              ///< elastic; of the law, touching or not
  bool is_adhesive = false;                      ///< may pull while penetrated

  double trust_radius_m = 0.0;  ///< > 0; how far from the reference this describes the tissue

  Vector3 force_on_tool_newton = Vector3::Zero();  ///< at the reference; 0 where not touching
};
inline constexpr std::size_t kMaxContacts = 8;

/// Hop 3, physics → mofc, every physics step.
struct Interaction {
  Header header;  ///< physics'

  std::uint64_t device_session_id = 0;  ///< the DeviceState this answers
  std::uint64_t device_sequence = 0;
  TimePoint device_sampled_at{};  ///< device's clock, echoed

  Vector3 tool_position_world_m = Vector3::Zero();  ///< the tool as physics has it
  Quaternion tool_orientation_world = Quaternion::Identity();
  Vector3 force_on_tool_newton = Vector3::Zero();  ///< W, sum over all tissues
  double stored_energy_joule = 0.0;                ///< elastic, in all tissues touched
  /// Deepest first; those about to be touched after those touched.
  std::array<Contact, kMaxContacts> contacts{};
  std::uint32_t listed_count = 0;   ///< entries of `contacts`
  std::uint32_t contact_count = 0;  ///< all touches; may be larger than the array
};

/// What is made of an Interaction until the next one comes.
enum class InteractionUse : std::uint8_t {
  kLocal,  ///< its local contact model, evaluated at the device's rate
  kHeld,   ///< its force, held
};
}  // namespace palpate
