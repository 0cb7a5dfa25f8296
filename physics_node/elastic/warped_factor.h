// SPDX-License-Identifier: Apache-2.0
// warped_factor.h — a factorised stiffness that turns with the body.
#pragma once

#include <optional>
#include <span>
#include <variant>
#include <vector>

#include "physics_node/elastic/body.h"
#include "physics_node/elastic/linear/block_cholesky.h"
#include "physics_node/elastic/obstacle.h"

namespace palpate::elastic {

enum class Precision : std::uint8_t { kFloat, kDouble };

/// A⁻¹ ≈ R A₀⁻¹ Rᵀ with A₀ factorised at one configuration and R what every node has turned since
/// [Mueller04]. Symmetric positive definite whatever the configuration: a descent direction
/// always.
class WarpedFactor {
 public:
  WarpedFactor(const Body& body, Precision precision);

  /// Factorises at x: the exact stiffness if it is positive definite, so that a search converges
  /// quadratically; otherwise that of projected tangents, which always is. The exact one is left
  /// out where an element is inverted, and for some calls after it has failed. Allocates. False:
  /// failed; the factor cannot be used.
  [[nodiscard]] bool factor(const VectorXd& x_m, const std::vector<double>& rotations,
                            const Body::Shift& shift, const Obstacle* obstacle);

  /// What the nodes have turned now. No allocation.
  void turn_to(const std::vector<double>& rotations);

  /// As where it was factorised. No allocation.
  void turn_back();

  /// direction = A⁻¹ gradient, 3 per node, 0 at fixed nodes. No allocation.
  void solve(const double* gradient, double* direction);

  /// Where it was factorised: how the nodes `at` give way to unit forces at each of up to
  /// kMostColumns free nodes. values[j] + 9 i: at[i] under forces at nodes[j], 3 × 3, row-major.
  /// Cheaper than as many solutions. Allocates.
  void columns(std::span<const std::uint32_t> nodes, std::span<const std::uint32_t> at,
               std::span<float* const> values);
  static constexpr std::size_t kMostColumns = BlockCholesky<float>::kMostColumns;

  [[nodiscard]] bool is_ready() const noexcept { return is_ready_; }
  [[nodiscard]] const Body::Shift& shift() const noexcept { return shift_; }

 private:
  const Body* body_;
  std::variant<BlockCholesky<float>, BlockCholesky<double>> cholesky_;
  BlockValues values_;
  Body::Shift shift_;
  bool is_ready_ = false;
  int left_out_ = 0;               // calls for which the exact stiffness will not be tried
  int next_left_out_ = 1;          // after another failure
  std::vector<double> reference_;  // rotations where it was factorised
  std::vector<double> turns_;      // 9 per free node
  std::vector<double> packed_;     // 3 per free node
};

}  // namespace palpate::elastic
