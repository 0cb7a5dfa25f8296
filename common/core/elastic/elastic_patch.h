// SPDX-License-Identifier: Apache-2.0
// elastic_patch.h — the part of hop 3 with which mofc_node solves the contact with an elastic body
// itself, and its acknowledgement on hop 2.
//
// Of up to kMaxElasticPatches elastic bodies mofc_node keeps a patch: kElasticSlots points of the
// surface, with the compliance at rest between each two. physics_node alone decides which point is
// in which slot, and numbers every change of a slot. A point is sent with the compliance between it
// and the points that were there before it, so each two points are together in one message. After
// every full solution of the body its state at these points follows.
#pragma once

#include <algorithm>
#include <array>
#include <bitset>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "common/core/vector.h"

namespace palpate {

inline constexpr std::size_t kMaxElasticPatches = 2;
inline constexpr std::size_t kElasticSlots = 128;
inline constexpr double kMaxComplianceMPerNewton = 1e3;  // a millimetre of tissue of 1 Pa
inline constexpr double kMinComplianceMPerNewton = 1e-12;
inline constexpr double kMaxElasticRelaxationS = 10.0;
/// Of the compliance. Soft tissue pressed together over something hard gives way far less than at
/// rest.
inline constexpr double kMinComplianceRatio = 0.1;
inline constexpr double kMaxComplianceRatio = 2.0;
/// The surface is carried on for so long without news.
inline constexpr double kLongestCarriedS = 0.25;
/// 1 in the integers of the structs below.
inline constexpr double kElasticScale = 32767.0;

/// A point of the surface.
struct ElasticPoint {
  std::uint32_t patch = 0;               ///< < kMaxElasticPatches
  std::uint32_t slot = 0;                ///< < kElasticSlots; replaces what was there
  std::uint32_t version = 0;             ///< > 0, higher than all before it in this patch
  Vector3 rest_m = Vector3::Zero();      ///< W, untouched
  float rigid_give_m_per_newton = 0.0F;  ///< > 0; of a point that the body does not let give way
  bool is_held = false;                  ///< gives way to that besides: a node of it is fixed
  float step_m_per_newton = 0.0F;        ///< > 0; of 1 in the integers, times kElasticScale
  /// How the point itself gives way: xx xy xz yy yz zz, positive semidefinite.
  std::array<std::int16_t, 6> own{};
  /// The slots of the other points, all with lower versions, and their displacement under a force
  /// at this one: 3 × 3, row-major.
  std::bitset<kElasticSlots> has_other{};
  std::array<std::array<std::int16_t, 9>, kElasticSlots> others{};  ///< by slot
};

/// A point in a state of the body.
struct ElasticPlace {
  std::uint32_t version = 0;           ///< 0: none in this slot
  std::array<std::int16_t, 3> away{};  ///< from `from_m`
  std::array<std::int16_t, 3>
      rest{};  ///< likewise, where it would come to rest; without viscosity as `away`
  std::array<std::int16_t, 3> force{};  ///< on the body

  [[nodiscard]] bool is_pressed() const noexcept {
    return std::any_of(force.begin(), force.end(), [](std::int16_t x) { return x != 0; });
  }
  [[nodiscard]] bool operator==(const ElasticPlace&) const noexcept = default;
};

/// A full solution of the body, at the points of its patch.
struct ElasticState {
  std::uint32_t patch = 0;
  std::uint32_t tissue = 0;  ///< index in the scene
  std::uint32_t number = 0;  ///< > 0, ascending
  double tip_radius_m = 0.0;
  Vector3 center_m = Vector3::Zero();  ///< of the tip in this solution
  Vector3 force_outside_patch_newton =
      Vector3::Zero();  ///< on the tool, from points that are not in the patch
  double friction_coefficient = 0.0;
  double friction_stiffness_newton_per_m = 0.0;  ///< > 0 with friction
  /// Only this tool deforms the body, so it is at rest where nothing presses; the compliance
  /// between there and here is this multiple of that at rest, kMinComplianceRatio …
  /// kMaxComplianceRatio.
  bool has_rest = false;
  double compliance_ratio = 1.0;
  /// Of a viscous body [s]: a point at x moves so that x + compliance_ratio · relaxation_s · ẋ is
  /// where the forces want it. 0: not viscous.
  double relaxation_s = 0.0;
  /// All points on this side that the tip may touch are listed as far as `radius_m`.
  /// @see elastic_distance_m
  Vector3 normal = Vector3::UnitZ();  ///< unit, of the surface at the tip
  Vector3 from_m = Vector3::Zero();   ///< foot of the tip on the surface,
  Vector3 to_m = Vector3::Zero();     ///< and where it moves
  double radius_m = 0.0;              ///< 0: of this body no earlier state counts either
  /// What the body lies on has carried the surface by so much, and carries it on. All places above
  /// and below are W less this: where they would be without.
  Vector3 carried_m = Vector3::Zero();
  Vector3 carried_m_per_s = Vector3::Zero();
  double carried_at_s = 0.0;  ///< time of moving tissue, in this solution
  float away_step_m = 0.0F;   ///< of 1 in the integers, times kElasticScale
  float force_step_newton = 0.0F;
  std::array<ElasticPlace, kElasticSlots> places{};  ///< by slot

  /// At a time of moving tissue. From kLongestCarriedS on it is not known where it went.
  [[nodiscard]] Vector3 carried_by_m(double scene_s) const noexcept {
    const double since_s = std::clamp(scene_s - carried_at_s, 0.0, kLongestCarriedS);
    return carried_m + since_s * carried_m_per_s;
  }
};

/// Distance from the line between the feet of the tip along the surface; places above and below it
/// count half.
[[nodiscard]] inline double elastic_distance_m(const Vector3& normal, const Vector3& from_m,
                                               const Vector3& to_m,
                                               const Vector3& point_m) noexcept {
  const Vector3 line = to_m - from_m;
  const Vector3 there = point_m - from_m;
  const double length2 = line.squaredNorm();
  const double share = length2 > 0.0 ? std::clamp(there.dot(line) / length2, 0.0, 1.0) : 0.0;
  const Vector3 away = there - share * line;
  const double above = normal.dot(away);
  return std::sqrt(std::max(0.0, away.squaredNorm() - 0.75 * above * above));
}

/// In a message with more contacts there is no room for these.
inline constexpr std::uint32_t kMaxContactsWithElastic = 4;

/// Hop 3. Void unless `store_id` is that of the receiver's store.
struct ElasticNews {
  std::uint64_t store_id = 0;  ///< 0: nothing
  std::uint64_t number = 0;    ///< of these messages, from 1
  bool has_point = false;      ///< else it is a state
  ElasticPoint point{};
  ElasticState state{};
};

/// Hop 2.
struct ElasticReceipts {
  std::uint64_t newest = 0;    ///< highest number received; 0: none
  std::uint64_t received = 0;  ///< bit i: number `newest` − i was received
};

}  // namespace palpate
