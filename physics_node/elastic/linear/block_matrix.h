// SPDX-License-Identifier: Apache-2.0
// block_matrix.h — symmetric sparse matrices of 3 × 3 blocks, one row of blocks per free node.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "physics_node/elastic/mesh.h"

namespace palpate::elastic {

/// Which blocks may be nonzero: the diagonal and, for every edge, the one below it. Column j holds
/// rows[starts[j]…starts[j + 1]), ascending, the first of them j.
struct BlockPattern {
  std::vector<std::uint32_t> nodes;  ///< mesh node of each row
  std::vector<std::int32_t> row_of;  ///< of each mesh node, −1: fixed
  std::vector<std::uint32_t> starts;
  std::vector<std::uint32_t> rows;

  [[nodiscard]] std::size_t size() const noexcept { return nodes.size(); }
  /// Place of block (i, j) of free rows i ≥ j. @pre it is in the pattern
  [[nodiscard]] std::uint32_t slot(std::uint32_t i, std::uint32_t j) const noexcept {
    const auto first = rows.begin() + starts[j];
    const auto last = rows.begin() + starts[j + 1];
    return static_cast<std::uint32_t>(std::lower_bound(first, last, i) - rows.begin());
  }
};

/// Of the nodes that share an element. @param is_fixed  per node of the mesh
[[nodiscard]] BlockPattern pattern_of(const Mesh& mesh, const std::vector<bool>& is_fixed);

/// Blocks in the order of the pattern, each row-major.
using BlockValues = std::vector<double>;

/// Gives back what a vector has taken; `= {}` would keep it.
template <class T>
void give_back(std::vector<T>& vector) noexcept {
  std::vector<T>().swap(vector);
}

}  // namespace palpate::elastic
