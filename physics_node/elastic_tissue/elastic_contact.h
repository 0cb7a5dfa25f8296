// SPDX-License-Identifier: Apache-2.0
// elastic_contact.h — the contact model of an elastic body on hop 3.
#pragma once

#include "common/contact/bounds.h"
#include "common/contact/proxy.h"
#include "common/contact/surface.h"
#include "common/contact/surface_view.h"
#include "common/core/messages.h"
#include "common/core/vector.h"

namespace palpate::physics {

/// A sphere on an elastic body follows Hertz's law within its limits, k p (p/1 mm)^½, and large
/// indentation of soft tissue follows it with a k that varies slowly: so this is the law that is
/// sent, with the k of the present depth. A depth of at least this is used to find k.
inline constexpr double kLeastDepth_m = 0.5e-3;

/// Where that law has the stiffness k; ElasticBody's hertz_newton and shear are those of this
/// depth.
inline constexpr double kHertzDepth_m = 1e-3;

/// k from a force at a depth [N/m].
/// @param penetration_m > 0
[[nodiscard]] double elastic_stiffness(double newton, double penetration_m) noexcept;

/// The depth at which the law with this k has this force; at most 1 m.
[[nodiscard]] double elastic_depth_m(double newton, double stiffness_newton_per_m) noexcept;

/// The contact along `normal` with Hertz's law; no allocation. It is trusted farther than the view
/// is, by the radius of the tip, over which soft tissue evens out its facets, and, before the tip
/// touches, by its distance from the surface: the way there changes nothing of the surface.
/// @param view            of the surface where no tool touches it, from the centre of the tip
/// @param penetration_m   of the tip into that surface, moved by what other tools do
/// @param normal          unit, direction of the force
[[nodiscard]] Contact elastic_contact(std::uint32_t tissue, const SurfaceView& view,
                                      double penetration_m, const Vector3& normal,
                                      double stiffness_newton_per_m, double tip_radius_m) noexcept;

/// A sphere that waits, because the full solution cannot follow its tip, has less force than the
/// tip: that grows as the depth does. Decides only whether the tip goes in.
/// @param penetration_m  of the tip   @param further_m  than the sphere that waits
/// @return  the force at the tip over that of the sphere, ≥ 1; 1 for a tip that appeared inside
[[nodiscard]] double force_ratio_ahead(double penetration_m, double further_m) noexcept;

/// The side of the untouched body on which a tip is, by a proxy that does not pass through its
/// surface (common/contact/proxy.h): a tip that has gone through a thin part is deep below the side
/// from which it came, and one that appears inside is below the nearest.
class TipSide {
 public:
  /// The tip is there. No allocation. False: out of reach, and forgotten.
  /// @param reach_m  from the tip's surface   @param time_s  not before that of the last call
  bool follow(const Surface& surface, const Bounds& bounds, double tip_radius_m, double reach_m,
              const Vector3& tip_m, double time_s) noexcept;
  /// From now on follow() gets another surface, of what is left of the body. A proxy that is
  /// outside of that too goes on.
  void change_to(const Surface& surface) noexcept;
  /// From the centre of the tip. @pre  follow() was true
  [[nodiscard]] const SurfaceView& view() const noexcept { return proxy_.surface; }
  /// Of the sphere, outside. @pre  follow() was true
  [[nodiscard]] const Vector3& place_m() const noexcept { return proxy_.place_m; }
  [[nodiscard]] bool is_known() const noexcept { return is_known_; }

 private:
  Proxy proxy_;
  bool is_known_ = false;
  double time_s_ = 0.0;
};

/// Coulomb friction of one tip on an elastic body: a spring along the surface that slips.
class Rubbing {
 public:
  /// Adds friction to the contact of the tip, which has come here since the last call. No
  /// allocation.
  void settle(const Vector3& tip_m, double friction_coefficient, double shear_newton_per_m,
              Contact& contact) noexcept;
  /// In the last contact.
  [[nodiscard]] const Vector3& force_on_tool_newton() const noexcept { return newton_; }

 private:
  bool is_rubbed_ = false;
  Vector3 tip_m_ = Vector3::Zero();
  Vector3 stretch_m_ = Vector3::Zero();
  Vector3 newton_ = Vector3::Zero();
};

/// The force's direction, or the surface's normal where the force is small or against it. The two
/// differ where the surface is deformed: at a rim, beside an edge, in a deep press.
[[nodiscard]] Vector3 contact_normal(const Vector3& force_on_tool_newton,
                                     const Vector3& surface_normal) noexcept;

}  // namespace palpate::physics
