// SPDX-License-Identifier: Apache-2.0
// point_tangent.h — derivative of the stress at one point.
#pragma once

#include <Eigen/Core>

#include "physics_node/elastic/material.h"

namespace palpate::elastic {

using Matrix9d = Eigen::Matrix<double, 9, 9>;

using Vector9d = Eigen::Matrix<double, 9, 1>;

/// Rows and columns in the order of a row-major 3 × 3 matrix.
struct PointTangent {
  Matrix9d stiffness;  ///< ∂P/∂F with the pressure λ θ held [Pa]
  Vector9d dilatation;  ///< ∂θ/∂F: with the point's own θ, ∂P/∂F has λ times its square more
};
/// `q`: the rotation of F, for the corotational law.
[[nodiscard]] PointTangent tangent(Law law, const Eigen::Matrix3d& F, double mu, double pressure,
                                   const double* q);

/// (β/h) F₀ C sym(F₀ᵀ ·) with F for F₀, rate = β/h.
[[nodiscard]] Matrix9d viscous_tangent(const Eigen::Matrix3d& F, double mu, double lambda,
                                       double rate);

/// The nearest positive semidefinite matrix, where A is not one. True if it changed.
bool make_semidefinite(Matrix9d& A);

}  // namespace palpate::elastic
