// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic_tissue/needle/piercing.h"

#include <algorithm>

namespace palpate::physics {
namespace {

// Across the direction of a hole, 15°: more is another hole.
constexpr double kAlongHole = 0.966;
constexpr double kLeast_newton = 1e-3;

double cutting_newton(const Piercing::Laws& laws, const Vector3& tip_m) {
  return std::min(laws.tissue.toughness_at(tip_m) * laws.needle.needle_width_m,
                  kMaxTissueForceNewton);
}

}  // namespace

bool Piercing::presses(const Laws& laws, const Vector3& force_on_tool_newton,
                       const Vector3& place_m, const Vector3& inward,
                       double tip_radius_m) noexcept {
  const double newton = -force_on_tool_newton.dot(inward);
  if (!(newton > kLeast_newton)) return false;
  const double cutting = cutting_newton(laws, place_m);
  const double spreading = laws.tissue.spreading_ratio * cutting;
  const std::size_t known = std::min(count_, kMostHoles);
  for (std::size_t i = 0; i < known; ++i) {
    const Hole& hole = holes_[i];
    if ((hole.entry_m - place_m).norm() > tip_radius_m || hole.inward.dot(inward) < kAlongHole) {
      continue;
    }
    if (newton < spreading) return false;
    now_ = {.entry_m = hole.entry_m, .inward = inward, .deepest_m = hole.deepest_m};
    is_old_ = true;
    index_ = i;
    return true;
  }
  if (newton < std::max(laws.tissue.membrane_newton, cutting + spreading)) return false;
  now_ = {.entry_m = place_m, .inward = inward};
  is_old_ = false;
  return true;
}

void Piercing::update(const Laws& laws, double depth_m, NeedleLaw& law) const noexcept {
  law.inward_world = now_.inward;
  law.cutting_newton = cutting_newton(laws, now_.entry_m + depth_m * now_.inward);
  law.spreading_newton =
      std::min(laws.tissue.spreading_ratio * law.cutting_newton, kMaxTissueForceNewton);
  law.friction_newton_per_m = laws.tissue.friction_newton_per_m;
  law.deepest_m = std::max(law.deepest_m, now_.deepest_m);
}

void Piercing::leave(const NeedleLaw& law) noexcept {
  now_.deepest_m = std::max(now_.deepest_m, law.deepest_m);
  if (!is_old_) index_ = count_++ % kMostHoles;
  is_old_ = true;
  holes_[index_] = now_;
}

}  // namespace palpate::physics
