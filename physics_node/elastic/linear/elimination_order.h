// SPDX-License-Identifier: Apache-2.0
// elimination_order.h — in which order a sparse factorisation takes the nodes, and what fills in.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "physics_node/elastic/linear/block_matrix.h"

namespace palpate::elastic {

/// Nested dissection by position: the nodes are halved along their longest extent, those of the cut
/// come last, the halves likewise. Returns the rows of the pattern in order of elimination.
[[nodiscard]] std::vector<std::uint32_t> dissection_order(const BlockPattern& pattern,
                                                          std::span<const Vector3d> nodes_m);

/// Approximate minimum degree. The better of the two depends on the shape of the body.
[[nodiscard]] std::vector<std::uint32_t> minimum_degree_order(const BlockPattern& pattern);

/// Consecutive columns of the factor with the same rows below them.
struct Supernode {
  std::uint32_t first = 0;                ///< column
  std::uint32_t columns = 0;              ///< ≤ kMostPivots / 3
  std::vector<std::uint32_t> rows_below;  ///< ascending, all ≥ first + columns
  std::int32_t parent = -1;               ///< the supernode of rows_below.front()
};

/// What a factorisation will look like, in blocks.
struct SymbolicFactor {
  std::vector<std::uint32_t> order;     ///< row of the pattern of each column of the factor
  std::vector<std::uint32_t> position;  ///< its inverse
  std::vector<Supernode> supernodes;    ///< children before parents, siblings as on a stack
  // The pattern by rows: what lies left of the diagonal of each.
  std::vector<std::uint32_t> row_starts;
  std::vector<std::uint32_t> row_columns;
  std::vector<std::uint32_t> row_slots;
  std::size_t stored_blocks = 0;  ///< in all supernodes, zeros included
};

/// @param order  is refined: children are moved to just before their parents, which fills in
/// nothing
[[nodiscard]] SymbolicFactor analyse(const BlockPattern& pattern, std::vector<std::uint32_t> order);

}  // namespace palpate::elastic
