// SPDX-License-Identifier: Apache-2.0
// piercing.h — a needle on one elastic body, but for how it slips along itself
// (common/contact/elastic/grip.h): when its tip goes in, with what force it goes on, and the holes
// that it leaves.
#pragma once

#include <array>
#include <cstddef>

#include "common/core/messages.h"
#include "common/session/scene_config.h"

namespace palpate::physics {

/// No allocation, no throw.
class Piercing {
 public:
  /// What the tissue is to the needle. Both must outlive a call.
  struct Laws {
    const ElasticMaterial::Pierced& tissue;
    const GripperConfig& needle;
  };

  /// The tip presses on the untouched surface at `place_m`. True: it goes in now. That takes the
  /// force of the membrane, or the one that cuts and spreads if it is more; in a hole of before,
  /// near its entry and along it, only the one that spreads.
  /// @param inward  unit, of the needle   @param tip_radius_m  > 0
  bool presses(const Laws& laws, const Vector3& force_on_tool_newton, const Vector3& place_m,
               const Vector3& inward, double tip_radius_m) noexcept;
  /// How it yields at that depth. @pre  it has gone in
  void update(const Laws& laws, double depth_m, NeedleLaw& law) const noexcept;
  /// It is out: the hole stays.
  void leave(const NeedleLaw& law) noexcept;

  static constexpr std::size_t kMostHoles = 16;  ///< the oldest closes

 private:
  struct Hole {
    Vector3 entry_m = Vector3::Zero();  // on the untouched surface
    Vector3 inward = Vector3::Zero();
    double deepest_m = 0.0;
  };
  std::array<Hole, kMostHoles> holes_{};
  std::size_t count_ = 0;  // made so far
  Hole now_{};
  bool is_old_ = false;  // one of them
  std::size_t index_ = 0;
};

}  // namespace palpate::physics
