// SPDX-License-Identifier: Apache-2.0
// touch.h — one sphere of the tool and one tissue: friction, puncture and the resulting contact.
#pragma once

#include <cstdint>

#include "common/contact/proxy.h"
#include "common/core/messages.h"
#include "common/core/tissue.h"
#include "common/core/vector.h"

namespace palpate {

/// The tip, or the shaft where it is deepest, and one tissue. Positions are relative to the
/// displaced tissue.
struct Touch {
  std::uint32_t tissue = 0;
  bool is_shaft = false;  ///< else the tip
  bool is_rubbed = false;
  bool is_punctured = false;
  double radius_m = 0.0;            ///< of the sphere
  Vector3 arm_m = Vector3::Zero();  ///< from the tip to its centre; W
  Proxy proxy{};
  Vector3 stretch_m = Vector3::Zero();  ///< of the spring of friction, or of the drag; W

  /// ≤ 0 where the sphere does not touch.
  [[nodiscard]] double penetration_m() const noexcept {
    return radius_m - proxy.surface.distance_m;
  }
  /// The tissue acts on the tool whatever the broad phase finds.
  [[nodiscard]] bool has_hold() const noexcept { return proxy.is_held() || is_punctured; }
};

/// Updates friction and puncture after the sphere has moved by `moved_m` relative to the tissue.
/// Where friction holds, its spring moves along, turns with the surface, and slips where it pulls
/// harder than μ times the elastic normal force. Tissue that the tip presses harder than its
/// threshold is punctured: it releases the tip and from then on drags it like dry friction. Slip
/// and puncture dissipate energy. No allocation, no throw.
/// @param relaxed_m  penetration that the tissue has relaxed to
void settle(Touch& touch, const Vector3& moved_m, const KelvinVoigtMaterial& material,
            double relaxed_m) noexcept;

/// The contact of a settled touch, without its total force, its tissue and its surface velocity.
/// No allocation, no throw.
[[nodiscard]] Contact contact_of(const Touch& touch, const KelvinVoigtMaterial& material,
                                 double relaxed_m) noexcept;

}  // namespace palpate
