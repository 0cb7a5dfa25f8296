// hand.h — hands that hold a simulated device: where they mean to be, and which buttons they press.
#pragma once

#include <cstdint>
#include <optional>

#include "common/core/random.h"
#include "common/session/simulation_config.h"
#include "device_node/simulation/plant.h"

namespace palpate::device {

/// What a hand notices. D.
struct Felt {
  Vector3 force_on_hand_newton = Vector3::Zero();  ///< rendered
  Vector3 hand_position_m = Vector3::Zero();
  Vector3 hand_velocity_m_per_s = Vector3::Zero();
};

/// Intended point at `t_s` ≥ 0 seconds after the start.
///
/// V: the V starts at s = apex − half_width·tangent + height·normal. For the first t_free seconds
/// the point goes round a circle of radius `amplitude` in the V's plane, through s and above it;
/// then it runs s → apex → end at constant speed and holds at the end. Where the circle would not
/// end at s by itself, what is left is taken back smoothly (3u² − 2u³) over its last quarter turn,
/// or over all of it if it is shorter. So position is continuous; velocity jumps at s, at the apex
/// and at the end, as the paper's V does.
[[nodiscard]] Target target_on(const VPath& path, double t_s) noexcept;
[[nodiscard]] Target target_on(const HoldPath& path, double t_s) noexcept;
[[nodiscard]] Target target_on(const SinusoidPath& path, double t_s) noexcept;
/// Between samples the velocity is constant; held ends have none. A loop jumps from last to first.
[[nodiscard]] Target target_on(const RecordedPath& path, double t_s) noexcept;

/// Seeks to draw energy from the force it feels. At random times it picks one of three ways:
///
///   drain   follow the force at the speed that draws most from a held force against the device's
///           friction, v* = (|F| − f_co)/(2 f_d) ([MOFC] eq. (12)), per axis where the
///           friction is
///   press   back into the scene, roughly against the last force felt, or anywhere
///   shake   to and fro along the force, turning every 0.5 … 25 ms, near sampling periods
///
/// The intended point is never faster than v_max and never farther than radius from the centre.
class HostileHand {
 public:
  /// @param device  its true friction counts
  HostileHand(const HostilePath& path, const SimulatedDeviceConfig& device, std::uint64_t seed);

  /// Call with growing `t_s`.
  [[nodiscard]] Target target(double t_s, const Felt& felt) noexcept;

 private:
  enum class Way : std::uint8_t { kDrain, kPress, kShake };
  void choose(double t_s) noexcept;
  [[nodiscard]] Vector3 wanted_velocity(double t_s, const Felt& felt) const noexcept;
  [[nodiscard]] Vector3 most_draining_velocity(const Vector3& force_on_hand_newton) const noexcept;

  HostilePath path_;
  double viscous_newton_s_per_m_;
  double coulomb_newton_;
  std::optional<FrictionPerAxis> per_axis_;
  Random random_;
  Way way_ = Way::kPress;
  double t_s_ = 0.0;
  double since_s_ = 0.0;
  double until_s_ = 0.0;
  double half_period_s_ = 0.0;
  double speed_m_per_s_ = 0.0;
  Vector3 direction_ = Vector3::UnitZ();
  Vector3 last_force_direction_ = Vector3::Zero();  ///< zero: no force felt yet
  Vector3 position_m_;
};

/// A hand that is led: the intended point follows the goal with a time constant of 50 ms, so that
/// the steps of a pointer are not felt as knocks, never faster than `speed` and never farther than
/// `reach` from the centre.
class LedHand {
 public:
  /// @param from_m  where the intended point is now
  LedHand(const PointerConfig& config, const Vector3& from_m, double t_s)
      : config_(config), position_m_(from_m), goal_m_(from_m), t_s_(t_s) {}

  /// Finite.
  void lead_to(const Vector3& goal_m) noexcept;
  /// Call with growing `t_s`.
  [[nodiscard]] Target target(double t_s) noexcept;

 private:
  PointerConfig config_;
  Vector3 position_m_;
  Vector3 goal_m_;
  double t_s_;
};

/// A hand of the session on its path, until somebody leads it. Same configuration and seed: same
/// hand, to the bit.
class Hand {
 public:
  /// @param device  its true friction is known to a hostile hand
  Hand(const HandConfig& config, const SimulatedDeviceConfig& device, std::uint64_t seed);

  /// Where the hand rests before it starts.
  [[nodiscard]] const Vector3& start_position_m() const noexcept { return start_position_m_; }
  /// Call once per inner step, in order, with the time of its middle since the device's start.
  /// No allocation, no throw.
  [[nodiscard]] Target target(double t_s, const Felt& felt) noexcept;
  /// From now on the hand goes there (D) and stays, and forgets its path. Nothing happens without
  /// hand.pointer in the session.
  void lead_to(const Vector3& goal_m) noexcept;
  /// Bit i set while button i is pressed: from ≤ t < until.
  [[nodiscard]] std::uint32_t buttons(double t_s) const noexcept;

 private:
  HandConfig config_;
  HostileHand hostile_;  ///< at rest unless the path is a hostile one
  Vector3 start_position_m_;
  Vector3 intended_m_;  ///< by the path, at t_s_
  double t_s_ = 0.0;
  std::optional<LedHand> led_;
};

/// Device and hand as one mass.
[[nodiscard]] PlantParameters plant_of(const SimulatedDeviceConfig& device, const HandConfig& hand);

}  // namespace palpate::device
