// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <random>
#include <type_traits>
#include <utility>
#include <vector>

#include "physics_node/elastic/body.h"
#include "physics_node/elastic/linear/block_cholesky.h"
#include "physics_node/elastic/linear/dense_kernels.h"

namespace palpate::elastic {
namespace {

Eigen::MatrixXd dense(const BlockPattern& pattern, const BlockValues& values) {
  const auto n = static_cast<Eigen::Index>(3 * pattern.size());
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(n, n);
  for (std::uint32_t j = 0; j < pattern.size(); ++j) {
    for (std::uint32_t s = pattern.starts[j]; s < pattern.starts[j + 1]; ++s) {
      for (Eigen::Index r = 0; r < 3; ++r) {
        for (Eigen::Index c = 0; c < 3; ++c) {
          const double value = values[9 * std::size_t{s} + static_cast<std::size_t>(3 * r + c)];
          A(3 * Eigen::Index{pattern.rows[s]} + r, 3 * Eigen::Index{j} + c) = value;
          A(3 * Eigen::Index{j} + c, 3 * Eigen::Index{pattern.rows[s]} + r) = value;
        }
      }
    }
  }
  return A;
}

TEST(BlockCholesky, SolvesAsADenseFactorisationDoes) {
  for (const bool is_quadratic : {false, true}) {
    for (const auto& [along, across] : {std::pair{3, 1}, {8, 2}, {4, 3}}) {
      const Mesh linear = beam_mesh(along, across);
      const Mesh mesh = is_quadratic ? quadratic(linear) : linear;
      const Body body({.mesh = mesh, .fixed_nodes = {0, 1, 7}});
      BlockValues values;
      body.stiffness(body.rest_m(), no_rotations(body.node_count()), {.per_mass = 1e4}, false,
                     values);
      const Eigen::MatrixXd A = dense(body.pattern(), values);
      VectorXd b(A.rows());
      std::mt19937 random(3);
      for (double& value : b) value = std::uniform_real_distribution<double>(-1, 1)(random);
      const VectorXd expected = A.llt().solve(b);

      VectorXd x(b.size());
      BlockCholesky<double> exact(body.pattern(), body.symbolic());
      ASSERT_TRUE(exact.factor(values));
      exact.solve(b.data(), x.data());
      EXPECT_LT((x - expected).norm(), 1e-9 * expected.norm());
      // together, and as often as it takes
      std::vector<VectorXd> many;
      std::vector<double*> vectors;
      for (int k = 0; k < kTogether; ++k) many.push_back((k + 1.0) * b);
      for (VectorXd& one : many) vectors.push_back(one.data());
      exact.solve_together(vectors);
      for (int k = 0; k < kTogether; ++k) {
        EXPECT_LT((many[static_cast<std::size_t>(k)] - (k + 1.0) * expected).norm(),
                  1e-9 * (k + 1.0) * expected.norm());
      }
      BlockCholesky<float> rough(body.pattern(), body.symbolic());
      ASSERT_TRUE(rough.factor(values));
      rough.solve(b.data(), x.data());
      EXPECT_LT((x - expected).norm(), 1e-3 * expected.norm());

      // in place
      VectorXd same = b;
      exact.solve(same.data(), same.data());
      EXPECT_LT((same - expected).norm(), 1e-9 * expected.norm());
    }
  }
}

TEST(BlockCholesky, BothOrdersOfEliminationTakeEveryNodeOnceAndGiveTheSameSolution) {
  const Body body({.mesh = beam_mesh(10, 4), .fixed_nodes = {0, 1, 2}});
  BlockValues values;
  body.stiffness(body.rest_m(), no_rotations(body.node_count()), {.per_mass = 1e4}, false, values);
  std::vector<VectorXd> solutions;
  for (auto order : {dissection_order(body.pattern(), body.mesh().nodes_m),
                     minimum_degree_order(body.pattern())}) {
    std::vector<bool> is_taken(order.size(), false);
    for (const std::uint32_t row : order) is_taken.at(row) = true;
    EXPECT_EQ(std::count(is_taken.begin(), is_taken.end(), true),
              static_cast<std::ptrdiff_t>(body.pattern().size()));
    BlockCholesky<double> factor(body.pattern(), std::make_shared<const SymbolicFactor>(
                                                     analyse(body.pattern(), std::move(order))));
    ASSERT_TRUE(factor.factor(values));
    VectorXd x = VectorXd::Ones(static_cast<Eigen::Index>(3 * body.pattern().size()));
    factor.solve(x.data(), x.data());
    solutions.push_back(x);
  }
  EXPECT_LT((solutions[0] - solutions[1]).norm(), 1e-9 * solutions[0].norm());
}

/// What every kernel makes of numbers that are always the same, one after the other.
std::vector<double> made_by_kernels(int n, int columns) {
  const auto rows = static_cast<std::size_t>(padded(n));
  const auto width = static_cast<std::size_t>(columns);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> number(-1.0, 1.0);
  std::vector<double> a(rows * static_cast<std::size_t>(n));
  for (double& value : a) value = number(random);
  for (std::size_t j = 0; j < static_cast<std::size_t>(n); ++j) a[rows * j + j] = n;
  EXPECT_TRUE(partial_cholesky(a.data(), n, columns));
  std::vector<double> all;
  const auto keep = [&](const auto& values) {
    for (const auto value : values) all.push_back(static_cast<double>(value));
  };
  for (std::size_t j = 0; j < static_cast<std::size_t>(n); ++j) {
    for (std::size_t i = j; i < static_cast<std::size_t>(n); ++i) all.push_back(a[rows * j + i]);
  }
  invert_pivots(a.data(), n, columns);
  a.resize(rows * width);
  keep(a);
  const auto products = [&](auto one) {
    using Scalar = decltype(one);
    const std::vector<Scalar> m(a.begin(), a.end());
    std::vector<Scalar> x(rows * kTogether);
    for (Scalar& value : x) value = static_cast<Scalar>(number(random));
    std::vector<Scalar> y(x.size());
    multiply(m.data(), n, columns, x.data(), y.data());
    keep(y);
    multiply_transposed(m.data(), n, columns, x.data(), y.data());
    keep(y);
    multiply_together(m.data(), n, columns, x.data(), y.data());
    keep(y);
    multiply_transposed_together(m.data(), n, columns, x.data(), y.data());
    keep(y);
    if constexpr (std::is_same_v<Scalar, float>) {
      add_three(m.data(), n, x.data(), y.data());
      keep(y);
    }
  };
  products(0.0F);
  products(0.0);
  return all;
}

TEST(DenseKernels, GiveTheSameToTheBitWhateverTheProcessorHas) {
  for (const auto& [n, columns] :
       {std::pair{3, 3}, {17, 5}, {40, 40}, {100, 51}, {130, 97}, {333, kMostPivots}}) {
    limit_vectors(16);
    const std::vector<double> expected = made_by_kernels(n, columns);
    for (const int bytes : {32, 64}) {
      SCOPED_TRACE(limit_vectors(bytes));
      const std::vector<double> made = made_by_kernels(n, columns);
      ASSERT_EQ(made.size(), expected.size());
      EXPECT_EQ(std::memcmp(made.data(), expected.data(), sizeof(double) * made.size()), 0) << n;
    }
  }
}

TEST(BlockCholesky, RefusesAMatrixThatIsNotPositiveDefinite) {
  const Body body({.mesh = beam_mesh(8, 2), .fixed_nodes = {0}});
  BlockValues values;
  body.stiffness(body.rest_m(), no_rotations(body.node_count()), {.per_mass = -1e7}, false, values);
  BlockCholesky<double> factor(body.pattern(), body.symbolic());
  EXPECT_FALSE(factor.factor(values));
  values.assign(values.size(), std::nan(""));
  EXPECT_FALSE(factor.factor(values));
}

}  // namespace
}  // namespace palpate::elastic
