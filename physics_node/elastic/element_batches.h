// SPDX-License-Identifier: Apache-2.0
// element_batches.h — the elements of a body in groups of eight, one in each lane of a vector.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "physics_node/elastic/material.h"
#include "physics_node/elastic/mesh.h"

namespace palpate::elastic {

inline constexpr int kLanes = 8;

struct alignas(64) Pack {
  double v[kLanes];  // NOLINT: read as a vector
};

/// Linear tetrahedra have one integration point, quadratic ones four; the deformation gradient is
/// F = Σₖ (yₖ − y₀) ⊗ ∇Lₖ, k = 1…3, with Lₖ the barycentric coordinates. Linear: yₖ = xₖ;
/// quadratic: yₖ = (4Lₖ − 1) xₖ + 4 Σⱼ Lⱼ xₖⱼ at the point, xₖⱼ the node between k and j.
struct ElementBatches {
  int nodes_per_element = 4;
  int points = 1;
  Law law = Law::kCorotational;
  std::size_t batches = 0;
  // Per batch; lanes without an element have volume 0.
  std::vector<std::uint32_t> nodes;   ///< nodes_per_element × kLanes
  std::vector<Pack> gradients_per_m;  ///< 9: ∇Lₖ in row k − 1
  std::vector<Pack> point_volume_m3;
  std::vector<Pack> mu_pa;
  std::vector<Pack> lambda_pa;
  std::vector<Pack> viscosity_s;  ///< β; empty: no element is viscous
  // State per point. The rotation is a starting value that every evaluation improves.
  std::vector<Pack> rotation;  ///< 4: a quaternion; corotational law only
  std::vector<Pack> before;    ///< 9: F at the start of the step; viscous bodies only
  // State per batch: the rotation in the middle of the element. Linear elements of the
  // corotational law use `rotation` instead.
  std::vector<Pack> middle_rotation;
};

/// @param materials  of the regions of the mesh
[[nodiscard]] ElementBatches batches_of(const Mesh& mesh, const std::vector<Material>& materials,
                                        Law law);

/// Adds ∂V/∂x to `gradient` and returns V, the elastic energy [J]; with `step_s` > 0 also the
/// viscous potential of a step of that length from the state of remember(). x and gradient: 3 per
/// node. No allocation.
double add_gradient(ElementBatches& batches, const double* x_m, double step_s, double* gradient);

/// The state at x is the start of the step, for viscosity.
void remember(ElementBatches& batches, const double* x_m);

/// Brings the rotation of every element up to date; 4 packs per batch at the returned address.
const Pack* update_rotations(ElementBatches& batches, const double* x_m);

}  // namespace palpate::elastic
