// SPDX-License-Identifier: Apache-2.0
// tissue_problems.h — the bodies that tissue_bench hangs, presses, slides over and twists, and what
// is known of them in closed form. Size and material are those of the published comparison of
// Newton's solvers with FEniCSx (recorded.h), so that its figures are about the same bodies.
#pragma once

#include <cstdint>
#include <numbers>
#include <vector>

#include "physics_node/elastic/body.h"
#include "physics_node/elastic/sphere_contact.h"

namespace palpate::bench {

inline constexpr double kMu_pa = 1e4;
inline constexpr double kLambda_pa = 5e4;
inline constexpr double kYoung_pa =
    kMu_pa * (3.0 * kLambda_pa + 2.0 * kMu_pa) / (kLambda_pa + kMu_pa);
inline constexpr double kPoissonRatio = 0.5 * kLambda_pa / (kLambda_pa + kMu_pa);
inline constexpr double kDensity_kg_per_m3 = 100.0;
inline constexpr double kGravity_m_per_s2 = 9.80665;

// The bar, along z: held at its upper end, free or turned at z = 0.
inline constexpr double kBarSide_m = 0.6;
inline constexpr double kBarLength_m = 1.6;
inline constexpr double kTwist_rad = std::numbers::pi / 3.0;

// The slab, held at z = 0, and the sphere above its middle.
inline constexpr double kSlabSide_m = 1.0;
inline constexpr double kSlabHeight_m = 0.4;
inline constexpr double kSphereRadius_m = 0.3;
inline constexpr double kPress_m = 0.04;  ///< depth below the untouched surface
inline constexpr double kSlide_m = 0.1;   ///< along x, from the middle

/// The centre of the sphere at this depth, so far from the middle.
[[nodiscard]] inline elastic::Vector3d sphere_at(double depth_m, double along_m = 0.0) {
  return {0.5 * kSlabSide_m + along_m, 0.5 * kSlabSide_m,
          kSlabHeight_m + kSphereRadius_m - depth_m};
}

[[nodiscard]] elastic::Mesh bar_mesh(int across, int along, double length_m = kBarLength_m);
/// Equal cells.
[[nodiscard]] elastic::Mesh slab_mesh(int across, int deep);
/// Equal cells over `fine_m` around the place under the sphere, each further one larger; all of
/// them are moved so that this place is `along_m` from the middle.
[[nodiscard]] elastic::Mesh graded_slab_mesh(int cells, int outer, int deep, double fine_m,
                                             double along_m = 0.0);

[[nodiscard]] std::vector<std::uint32_t> upper_end(const elastic::Mesh& mesh);
[[nodiscard]] std::vector<std::uint32_t> lower_end(const elastic::Mesh& mesh);

[[nodiscard]] elastic::BodyDescription hanging_bar(elastic::Mesh mesh, elastic::Law law);
/// Both ends are fixed nodes: the lower one is turned. No gravity.
[[nodiscard]] elastic::BodyDescription twisted_bar(elastic::Mesh mesh, elastic::Law law);
[[nodiscard]] elastic::BodyDescription held_slab(elastic::Mesh mesh, elastic::Law law);

/// A place on the bar turned about its axis.
[[nodiscard]] elastic::Vector3d turned(const elastic::Vector3d& at_m, double angle_rad);

/// Points of the slab's top within reach of the sphere, from the middle to kSlide_m beside it.
[[nodiscard]] std::vector<elastic::SurfacePoint> top_of_slab(const elastic::Mesh& mesh,
                                                             int per_edge);

// --- closed forms ---

/// How far the end of a bar hangs down by its weight [m]: ρ g L² / 2 E, at small strain, and where
/// its held end may contract.
[[nodiscard]] double slender_sag_m(double gravity_m_per_s2 = kGravity_m_per_s2);
/// Force of a rigid sphere on a half-space [N]: 4/3 E/(1 − ν²) √R d^{3/2} [Hertz1882].
[[nodiscard]] double hertz_newton(double depth_m);
/// The same on a layer that is held at its lower side, to the fourth power of √(R d)/h
/// [Dimitriadis02] eq. (15).
[[nodiscard]] double layer_newton(double depth_m);
/// Torsion of a square bar whose ends may warp: torque over twist per length [N·m²], G β a⁴,
/// β = 0.14058 [Timoshenko70] §109.
[[nodiscard]] double torsion_stiffness_newton_m2();

}  // namespace palpate::bench
