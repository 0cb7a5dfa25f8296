// SPDX-License-Identifier: Apache-2.0
// block_cholesky.h — direct solution of the linear systems of an elastic body.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "physics_node/elastic/linear/block_matrix.h"
#include "physics_node/elastic/linear/elimination_order.h"

namespace palpate::elastic {

/// Supernodal Cholesky factor of a symmetric positive definite block matrix (multifrontal
/// factorisation in double precision). What is stored of each supernode is [L₁₁⁻¹; L₂₁ L₁₁⁻¹]: a
/// solution is one dense product per supernode down the tree and one up. Scalar float halves the
/// memory that a solution reads, for use where it is repeated (relative error about 10⁻⁶ times the
/// condition number); double for a single exact solution.
template <class Scalar>
class BlockCholesky {
 public:
  /// The analysis belongs to the pattern, not to the values: factors share it.
  BlockCholesky(const BlockPattern& pattern, std::shared_ptr<const SymbolicFactor> symbolic);

  /// Factorises. False: not positive definite; the former factor is lost. Allocates.
  [[nodiscard]] bool factor(const BlockValues& values);

  /// x = A⁻¹ b, both 3 per row of the pattern. b and x may be the same. No allocation.
  void solve(const double* b, double* x);

 private:
  [[nodiscard]] Scalar* panel(std::size_t s) { return panels_.data() + panel_starts_[s]; }

  const BlockPattern* pattern_;
  std::shared_ptr<const SymbolicFactor> symbolic_;
  std::vector<Scalar> panels_;
  std::vector<std::size_t> panel_starts_;
  std::vector<Scalar> solution_;  // in order of elimination
  std::vector<Scalar> work_;      // of one supernode
};

extern template class BlockCholesky<float>;
extern template class BlockCholesky<double>;

}  // namespace palpate::elastic
