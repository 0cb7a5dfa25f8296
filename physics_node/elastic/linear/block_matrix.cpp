// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/linear/block_matrix.h"

namespace palpate::elastic {

BlockPattern pattern_of(const Mesh& mesh, const std::vector<bool>& is_fixed) {
  BlockPattern pattern;
  pattern.row_of.assign(mesh.nodes_m.size(), -1);
  for (std::uint32_t node = 0; node < mesh.nodes_m.size(); ++node) {
    if (is_fixed[node]) continue;
    pattern.row_of[node] = static_cast<std::int32_t>(pattern.nodes.size());
    pattern.nodes.push_back(node);
  }
  std::vector<std::vector<std::uint32_t>> columns(pattern.size());
  for (std::uint32_t j = 0; j < pattern.size(); ++j) columns[j].push_back(j);
  for (std::size_t e = 0; e < mesh.element_count(); ++e) {
    const auto nodes = mesh.element(e);
    for (const std::uint32_t a : nodes) {
      for (const std::uint32_t b : nodes) {
        const std::int32_t i = pattern.row_of[a];
        const std::int32_t j = pattern.row_of[b];
        if (j >= 0 && i > j) {
          columns[static_cast<std::size_t>(j)].push_back(static_cast<std::uint32_t>(i));
        }
      }
    }
  }
  pattern.starts.push_back(0);
  for (auto& column : columns) {
    std::sort(column.begin(), column.end());
    column.erase(std::unique(column.begin(), column.end()), column.end());
    pattern.rows.insert(pattern.rows.end(), column.begin(), column.end());
    pattern.starts.push_back(static_cast<std::uint32_t>(pattern.rows.size()));
  }
  return pattern;
}

}  // namespace palpate::elastic
