// SPDX-License-Identifier: Apache-2.0
// warped_factor.h — a factorised stiffness that turns with the body.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <utility>
#include <variant>
#include <vector>

#include "physics_node/elastic/body.h"
#include "physics_node/elastic/linear/block_cholesky.h"
#include "physics_node/elastic/obstacle.h"

namespace palpate::elastic {

enum class Precision : std::uint8_t { kFloat, kDouble };

using Cholesky = std::variant<BlockCholesky<float>, BlockCholesky<double>>;

/// The factors in use of a body that were made where nothing touches it: whoever needs the same
/// again shares them. Thread-safe.
class SharedFactors {
 public:
  /// Of exactly these values. False: there is none, and `cholesky` is as it was.
  [[nodiscard]] bool find(const BlockValues& values, Cholesky& cholesky) const;
  /// For as long as anybody uses it.
  void note(const BlockValues& values, const Cholesky& cholesky);

 private:
  struct One {
    BlockValues values;
    std::weak_ptr<const std::vector<float>> floats;  // one of the two
    std::weak_ptr<const std::vector<double>> doubles;
  };
  mutable std::mutex mutex_;
  std::vector<One> all_;
};

/// A⁻¹ ≈ R A₀⁻¹ Rᵀ with A₀ factorised at one configuration and R what every node has turned since
/// [Mueller04]. Symmetric positive definite whatever the configuration: a descent direction
/// always. Copies are independent of one another.
class WarpedFactor {
 public:
  /// @param is_folded  fold() will be called: what the factor was made of is kept
  WarpedFactor(const Body& body, Precision precision, bool is_folded = false);

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

  /// The same of up to kTogether gradients, each of which becomes its direction. Cheaper than as
  /// many solutions. Allocates.
  void solve_together(std::span<double* const> vectors);

  /// Where it was factorised: how the nodes `at` give way to unit forces at each of up to
  /// kMostColumns free nodes. values[j] + 9 i: at[i] under forces at nodes[j], 3 × 3, row-major.
  /// Cheaper than as many solutions. Allocates.
  void columns(std::span<const std::uint32_t> nodes, std::span<const std::uint32_t> at,
               std::span<float* const> values);
  static constexpr std::size_t kMostColumns = BlockCholesky<float>::kMostColumns;

  /// Of another precision, which must not be a higher one: as if it had been made so.
  [[nodiscard]] WarpedFactor in(Precision precision) const;

  /// The other's factor and turns; folded or not as before.
  void continue_as(const WarpedFactor& other);
  /// Frees what can be made again, to the bit: the room for solutions, and a factor that nobody
  /// shares.
  void fold();
  /// Before turn_to() and solve(), after fold(). Takes as long as factor() where the factor is
  /// gone.
  void unfold();

  [[nodiscard]] bool is_ready() const noexcept { return is_ready_; }
  [[nodiscard]] const Body::Shift& shift() const noexcept { return shift_; }

 private:
  void pack(const double* gradient, double* packed) const noexcept;
  void unpack(const double* packed, double* direction) const noexcept;

  const Body* body_;
  Cholesky cholesky_;
  Body::Shift shift_;
  /// What the factor was made of, with reference_ and shift_.
  struct Recipe {
    VectorXd x_m;
    bool is_exact = false;
    std::vector<std::pair<std::size_t, double>> of_obstacle;  // values that it changed
  };
  std::optional<Recipe> recipe_;  // none: not is_folded, or not made here
  bool is_folded_;
  bool is_ready_ = false;
  int left_out_ = 0;               // calls for which the exact stiffness will not be tried
  int next_left_out_ = 1;          // after another failure
  std::vector<double> reference_;  // rotations where it was factorised
  std::vector<double> turns_;      // 9 per free node
  std::vector<double> packed_;     // 3 per free node
};

}  // namespace palpate::elastic
