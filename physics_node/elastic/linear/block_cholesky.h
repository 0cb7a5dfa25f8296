// SPDX-License-Identifier: Apache-2.0
// block_cholesky.h — direct solution of the linear systems of an elastic body.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "physics_node/elastic/linear/block_matrix.h"
#include "physics_node/elastic/linear/dense_kernels.h"
#include "physics_node/elastic/linear/elimination_order.h"

namespace palpate::elastic {

/// Supernodal Cholesky factor of a symmetric positive definite block matrix (multifrontal
/// factorisation in double precision). What is stored of each supernode is [L₁₁⁻¹; L₂₁ L₁₁⁻¹]: a
/// solution is one dense product per supernode down the tree and one up. Scalar float halves the
/// memory that a solution reads, for use where it is repeated (relative error about 10⁻⁶ times the
/// condition number); double for a single exact solution. Copies share the factor until they make
/// another; they may be used on different threads.
template <class Scalar>
class BlockCholesky {
 public:
  /// The analysis belongs to the pattern, not to the values: factors share it.
  BlockCholesky(const BlockPattern& pattern, std::shared_ptr<const SymbolicFactor> symbolic);

  /// Factorises. False: not positive definite; the former factor is lost. Allocates.
  [[nodiscard]] bool factor(const BlockValues& values);

  /// What a factorisation makes, for another with the same pattern; null: none yet.
  using Panels = std::vector<Scalar>;
  [[nodiscard]] const std::shared_ptr<const Panels>& panels() const noexcept { return panels_; }
  void set_panels(std::shared_ptr<const Panels> panels) noexcept { panels_ = std::move(panels); }
  /// As one that factor() has made in double precision of the same values.
  void set_rounded(const std::vector<double>& panels) {
    panels_ = std::make_shared<const Panels>(panels.begin(), panels.end());
  }
  /// Frees the room for solutions, which unfold() makes again; and what no copy shares of the
  /// factor, if that may go.
  void fold(bool may_go);
  void unfold();

  /// x = A⁻¹ b, both 3 per row of the pattern. b and x may be the same. No allocation.
  void solve(const double* b, double* x);

  /// The same for up to kTogether right-hand sides, which may be the solutions: a panel is read
  /// once for all. Allocates.
  void solve_together(std::span<double* const> b);

  /// Columns of A⁻¹ for up to kMostColumns rows of the pattern, read by column_entry() until the
  /// next call. Costs less than as many solutions: a panel is read once for all, and on the way up
  /// only those that a column reaches. Allocates.
  void solve_columns(std::span<const std::uint32_t> rows);
  /// A⁻¹ at a row of the pattern, for the which-th of the columns, 3 × 3.
  [[nodiscard]] Scalar column_entry(std::uint32_t row, std::size_t i, std::size_t which,
                                    std::size_t axis) const {
    return together_[kTogether * (3 * std::size_t{symbolic_->position[row]} + i) + 3 * which +
                     axis];
  }
  static constexpr std::size_t kMostColumns = kTogether / 3;

 private:
  [[nodiscard]] const Scalar* panel(std::size_t s) const {
    return panels_->data() + panel_starts_[s];
  }
  [[nodiscard]] bool is_child(std::size_t supernode, std::size_t of) const {
    return symbolic_->supernodes[supernode].parent == static_cast<std::int32_t>(of);
  }
  void solve_reached(std::vector<char> is_reached);

  const BlockPattern* pattern_;
  std::shared_ptr<const SymbolicFactor> symbolic_;
  std::shared_ptr<const Panels> panels_;
  std::size_t panels_size_ = 0;
  std::size_t widest_ = 0;         // padded rows of a supernode
  std::size_t largest_front_ = 0;  // in factor(), numbers
  std::size_t most_waiting_ = 0;   // at once, numbers of updates
  std::vector<std::size_t> panel_starts_;
  std::vector<Scalar> solution_;  // in order of elimination
  std::vector<Scalar> work_;      // of one supernode
  std::vector<Scalar> together_;  // solution_ and work_ of solve_columns()
  std::vector<Scalar> work_together_;
};

extern template class BlockCholesky<float>;
extern template class BlockCholesky<double>;

}  // namespace palpate::elastic
