// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/point_tangent.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "physics_node/elastic/point_laws.h"

namespace palpate::elastic {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// ∂ cof F / ∂F applied to D
Matrix3d cofactor_change(const Matrix3d& F, const Matrix3d& D) {
  Matrix3d change;
  for (int i = 0; i < 3; ++i) {
    const int i1 = (i + 1) % 3;
    const int i2 = (i + 2) % 3;
    for (int j = 0; j < 3; ++j) {
      const int j1 = (j + 1) % 3;
      const int j2 = (j + 2) % 3;
      change(i, j) = D(i1, j1) * F(i2, j2) + F(i1, j1) * D(i2, j2) - D(i1, j2) * F(i2, j1) -
                     F(i1, j2) * D(i2, j1);
    }
  }
  return change;
}

}  // namespace

PointTangent tangent(Law law, const Matrix3d& F, double mu, double pressure, const double* q) {
  Matrix3d R = Matrix3d::Identity();
  Matrix3d turn = Matrix3d::Zero();  // (tr(S) I − S)⁻¹
  Matrix3d S = Matrix3d::Zero();
  Matrix3d dilatation_gradient;  // ∂θ/∂F
  if (law == Law::kCorotational) {
    R = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized().toRotationMatrix();
    S = R.transpose() * F;
    S = 0.5 * (S + S.transpose()).eval();
    const Matrix3d H = S.trace() * Matrix3d::Identity() - S;
    // near inversion the rotation may turn at any rate: it is held
    if (H.determinant() > 1e-6 && H.trace() > 0.0) turn = H.inverse();
    dilatation_gradient = R;
  } else if (law == Law::kStVenantKirchhoff) {
    const Matrix3d E = 0.5 * (F.transpose() * F - Matrix3d::Identity());
    S = 2.0 * mu * E + pressure * Matrix3d::Identity();
    dilatation_gradient = F;
  } else {
    dilatation_gradient << F.col(1).cross(F.col(2)), F.col(2).cross(F.col(0)),
        F.col(0).cross(F.col(1));
  }

  PointTangent result;
  for (int column = 0; column < 9; ++column) {
    Matrix3d D = Matrix3d::Zero();
    D(column / 3, column % 3) = 1.0;
    Matrix3d change;
    if (law == Law::kCorotational) {
      const Matrix3d B = R.transpose() * D;
      const Vector3d w = turn * Vector3d(B(2, 1) - B(1, 2), B(0, 2) - B(2, 0), B(1, 0) - B(0, 1));
      Matrix3d cross;
      cross << 0, -w.z(), w.y(), w.z(), 0, -w.x(), -w.y(), w.x(), 0;
      change = 2.0 * mu * D + (pressure - 2.0 * mu) * R * cross;
    } else if (law == Law::kStVenantKirchhoff) {
      const Matrix3d C = F.transpose() * D;
      change = D * S + mu * F * (C + C.transpose());
    } else {
      change = mu * D + mu * dilatation_gradient.cwiseProduct(D).sum() * dilatation_gradient +
               (pressure + mu * (F.determinant() - 2.0)) * cofactor_change(F, D);
    }
    for (int row = 0; row < 9; ++row) {
      result.stiffness(row, column) = change(row / 3, row % 3);
    }
    result.dilatation[column] = dilatation_gradient(column / 3, column % 3);
  }
  return result;
}

Matrix9d viscous_tangent(const Matrix3d& F, double mu, double lambda, double rate) {
  Matrix9d A;
  for (int column = 0; column < 9; ++column) {
    Matrix3d D = Matrix3d::Zero();
    D(column / 3, column % 3) = 1.0;
    const Matrix3d C = F.transpose() * D;
    const Matrix3d change =
        rate * F * (mu * (C + C.transpose()) + lambda * C.trace() * Matrix3d::Identity());
    for (int row = 0; row < 9; ++row) A(row, column) = change(row / 3, row % 3);
  }
  return A;
}

bool make_semidefinite(Matrix9d& A) {
  // most are: a factorisation tells at a tenth of the cost
  Matrix9d shifted = A;
  shifted.diagonal().array() += 1e-8 * A.diagonal().cwiseAbs().maxCoeff();
  if (Eigen::LLT<Matrix9d>(shifted).info() == Eigen::Success) return false;
  const Eigen::SelfAdjointEigenSolver<Matrix9d> eigen(A);
  A = eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).asDiagonal() *
      eigen.eigenvectors().transpose();
  return true;
}

}  // namespace palpate::elastic
