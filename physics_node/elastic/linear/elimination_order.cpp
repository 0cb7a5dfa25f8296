// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/linear/elimination_order.h"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>
#include <iterator>
#include <numeric>

#include "physics_node/elastic/linear/dense_kernels.h"

namespace palpate::elastic {
namespace {

constexpr std::size_t kSmallestDissected = 24;  // nodes
constexpr std::uint32_t kMostColumns = kMostPivots / 3;

struct Graph {
  std::vector<std::uint32_t> starts;
  std::vector<std::uint32_t> neighbours;
};

Graph graph_of(const BlockPattern& pattern) {
  Graph graph;
  graph.starts.assign(pattern.size() + 1, 0);
  for (std::uint32_t j = 0; j < pattern.size(); ++j) {
    for (std::uint32_t s = pattern.starts[j] + 1; s < pattern.starts[j + 1]; ++s) {
      ++graph.starts[j + 1];
      ++graph.starts[pattern.rows[s] + 1];
    }
  }
  std::partial_sum(graph.starts.begin(), graph.starts.end(), graph.starts.begin());
  graph.neighbours.resize(graph.starts.back());
  std::vector<std::uint32_t> next(graph.starts.begin(), graph.starts.end() - 1);
  for (std::uint32_t j = 0; j < pattern.size(); ++j) {
    for (std::uint32_t s = pattern.starts[j] + 1; s < pattern.starts[j + 1]; ++s) {
      graph.neighbours[next[j]++] = pattern.rows[s];
      graph.neighbours[next[pattern.rows[s]]++] = j;
    }
  }
  return graph;
}

class Dissection {
 public:
  Dissection(const BlockPattern& pattern, std::span<const Vector3d> nodes_m)
      : pattern_(pattern), nodes_m_(nodes_m), graph_(graph_of(pattern)), side_(pattern.size(), 0) {}

  // Orders rows[0…n): the parts first, the cut last.
  void order(std::span<std::uint32_t> rows) {
    if (rows.size() <= kSmallestDissected) return;
    Vector3d low = position(rows[0]);
    Vector3d high = low;
    for (const std::uint32_t row : rows) {
      low = low.cwiseMin(position(row));
      high = high.cwiseMax(position(row));
    }
    Eigen::Index axis = 0;
    (high - low).maxCoeff(&axis);
    std::sort(rows.begin(), rows.end(), [&](std::uint32_t a, std::uint32_t b) {
      return std::pair(position(a)[axis], a) < std::pair(position(b)[axis], b);
    });
    // nodes of one plane stay on one side
    const double tolerance = 1e-9 * (high - low)[axis];
    std::size_t middle = rows.size() / 2;
    while (middle > 0 &&
           position(rows[middle])[axis] - position(rows[middle - 1])[axis] <= tolerance) {
      --middle;
    }
    if (middle == 0) middle = rows.size() / 2;
    // one plane further or back, whichever is nearer to the middle
    std::size_t other = middle + 1;
    while (other < rows.size() &&
           position(rows[other])[axis] - position(rows[other - 1])[axis] <= tolerance) {
      ++other;
    }
    if (other < rows.size() && other - rows.size() / 2 < rows.size() / 2 - middle) middle = other;

    const std::uint32_t left = ++label_;
    const std::uint32_t right = ++label_;
    for (std::size_t i = 0; i < rows.size(); ++i) side_[rows[i]] = i < middle ? left : right;
    // the cut: those of the right that touch the left, or the other way round
    const auto touches = [&](std::uint32_t row, std::uint32_t label) {
      const auto* first = graph_.neighbours.data() + graph_.starts[row];
      const auto* last = graph_.neighbours.data() + graph_.starts[row + 1];
      return std::any_of(first, last, [&](std::uint32_t n) { return side_[n] == label; });
    };
    std::size_t left_cut = 0;
    std::size_t right_cut = 0;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (i < middle) {
        left_cut += static_cast<std::size_t>(touches(rows[i], right));
      } else {
        right_cut += static_cast<std::size_t>(touches(rows[i], left));
      }
    }
    const bool is_left_cut = left_cut < right_cut;
    std::vector<std::uint32_t> cut;
    std::vector<std::uint32_t> lefts;
    std::vector<std::uint32_t> rights;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const bool is_left = i < middle;
      if (is_left == is_left_cut && touches(rows[i], is_left ? right : left)) {
        cut.push_back(rows[i]);
      } else {
        (is_left ? lefts : rights).push_back(rows[i]);
      }
    }
    auto end = std::copy(lefts.begin(), lefts.end(), rows.begin());
    end = std::copy(rights.begin(), rights.end(), end);
    std::copy(cut.begin(), cut.end(), end);
    if (cut.size() == rows.size()) return;
    order(rows.subspan(0, lefts.size()));
    order(rows.subspan(lefts.size(), rights.size()));
  }

 private:
  [[nodiscard]] const Vector3d& position(std::uint32_t row) const {
    return nodes_m_[pattern_.nodes[row]];
  }

  const BlockPattern& pattern_;
  std::span<const Vector3d> nodes_m_;
  Graph graph_;
  std::vector<std::uint32_t> side_;
  std::uint32_t label_ = 0;
};

std::vector<std::int32_t> elimination_tree(const Graph& graph,
                                           const std::vector<std::uint32_t>& order,
                                           const std::vector<std::uint32_t>& position) {
  const std::size_t n = order.size();
  std::vector<std::int32_t> parent(n, -1);
  std::vector<std::int32_t> ancestor(n, -1);
  for (std::size_t k = 0; k < n; ++k) {
    const std::uint32_t row = order[k];
    for (std::uint32_t s = graph.starts[row]; s < graph.starts[row + 1]; ++s) {
      auto i = static_cast<std::int32_t>(position[graph.neighbours[s]]);
      while (i != -1 && i < static_cast<std::int32_t>(k)) {
        const std::int32_t next = ancestor[static_cast<std::size_t>(i)];
        ancestor[static_cast<std::size_t>(i)] = static_cast<std::int32_t>(k);
        if (next == -1) parent[static_cast<std::size_t>(i)] = static_cast<std::int32_t>(k);
        i = next;
      }
    }
  }
  return parent;
}

std::vector<std::uint32_t> postorder(const std::vector<std::int32_t>& parent) {
  const std::size_t n = parent.size();
  std::vector<std::vector<std::uint32_t>> children(n + 1);
  for (std::uint32_t i = 0; i < n; ++i) {
    children[parent[i] < 0 ? n : static_cast<std::size_t>(parent[i])].push_back(i);
  }
  std::vector<std::uint32_t> post;
  std::vector<std::pair<std::size_t, std::size_t>> stack = {{n, 0}};
  while (!stack.empty()) {
    auto& [node, next] = stack.back();
    if (next < children[node].size()) {
      stack.emplace_back(children[node][next++], 0);
    } else {
      if (node < n) post.push_back(static_cast<std::uint32_t>(node));
      stack.pop_back();
    }
  }
  return post;
}

std::vector<std::uint32_t> inverse_of(const std::vector<std::uint32_t>& order) {
  std::vector<std::uint32_t> position(order.size());
  for (std::uint32_t k = 0; k < order.size(); ++k) position[order[k]] = k;
  return position;
}

// Is the wider supernode worth its zeros? Fewer dense blocks cost less than many small ones.
bool is_worth_merging(std::size_t columns, std::size_t blocks, std::size_t zeros) {
  const double share = static_cast<double>(zeros) / static_cast<double>(blocks);
  if (columns <= 6) return share < 0.6;
  if (columns <= 16) return share < 0.25;
  return share < 0.08;
}

std::size_t blocks_of(std::size_t columns, std::size_t below) {
  return columns * (columns + 1) / 2 + columns * below;
}

}  // namespace

std::vector<std::uint32_t> dissection_order(const BlockPattern& pattern,
                                            std::span<const Vector3d> nodes_m) {
  std::vector<std::uint32_t> rows(pattern.size());
  std::iota(rows.begin(), rows.end(), 0U);
  Dissection(pattern, nodes_m).order(rows);
  return rows;
}

std::vector<std::uint32_t> minimum_degree_order(const BlockPattern& pattern) {
  std::vector<Eigen::Triplet<double>> entries;
  for (std::uint32_t j = 0; j < pattern.size(); ++j) {
    for (std::uint32_t s = pattern.starts[j]; s < pattern.starts[j + 1]; ++s) {
      entries.emplace_back(static_cast<int>(pattern.rows[s]), static_cast<int>(j), 1.0);
      if (pattern.rows[s] != j) {
        entries.emplace_back(static_cast<int>(j), static_cast<int>(pattern.rows[s]), 1.0);
      }
    }
  }
  const auto n = static_cast<Eigen::Index>(pattern.size());
  Eigen::SparseMatrix<double> matrix(n, n);
  matrix.setFromTriplets(entries.begin(), entries.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> permutation;
  Eigen::AMDOrdering<int>()(matrix, permutation);
  std::vector<std::uint32_t> order(pattern.size());
  for (std::size_t k = 0; k < order.size(); ++k) {
    order[k] = static_cast<std::uint32_t>(permutation.indices()[static_cast<Eigen::Index>(k)]);
  }
  return order;
}

SymbolicFactor analyse(const BlockPattern& pattern, std::vector<std::uint32_t> order) {
  const Graph graph = graph_of(pattern);
  SymbolicFactor symbolic;
  symbolic.position = inverse_of(order);
  {
    const std::vector<std::uint32_t> post =
        postorder(elimination_tree(graph, order, symbolic.position));
    std::vector<std::uint32_t> refined;
    for (const std::uint32_t k : post) refined.push_back(order[k]);
    order = std::move(refined);
  }
  symbolic.order = std::move(order);
  symbolic.position = inverse_of(symbolic.order);
  const std::vector<std::int32_t> parent =
      elimination_tree(graph, symbolic.order, symbolic.position);
  const std::size_t n = symbolic.order.size();

  // The rows of every column: those of the matrix and of its children in the tree.
  std::vector<std::vector<std::uint32_t>> rows(n);
  for (std::uint32_t j = 0; j < n; ++j) {
    const std::uint32_t row = symbolic.order[j];
    std::vector<std::uint32_t>& mine = rows[j];
    for (std::uint32_t s = graph.starts[row]; s < graph.starts[row + 1]; ++s) {
      const std::uint32_t i = symbolic.position[graph.neighbours[s]];
      if (i > j) mine.push_back(i);
    }
    // children have added theirs already
    std::sort(mine.begin(), mine.end());
    mine.erase(std::unique(mine.begin(), mine.end()), mine.end());
    if (parent[j] >= 0) {
      auto& above = rows[static_cast<std::size_t>(parent[j])];
      above.insert(above.end(), mine.begin() + 1, mine.end());
    }
  }

  // Columns that follow one another with the same rows, then neighbours in the tree that are small.
  struct Merged {
    Supernode node;
    std::size_t blocks_needed = 0;
  };
  std::vector<Merged> merged;
  for (std::uint32_t j = 0; j < n; ++j) {
    Merged next{.node = {.first = j, .columns = 1, .rows_below = std::move(rows[j])},
                .blocks_needed = 0};
    next.blocks_needed = 1 + next.node.rows_below.size();
    // its last child is the supernode that ends just before it
    while (!merged.empty()) {
      const Merged& child = merged.back();
      if (child.node.rows_below.empty() ||
          child.node.rows_below.front() >= next.node.first + next.node.columns) {
        break;
      }
      const std::size_t columns = child.node.columns + next.node.columns;
      if (columns > kMostColumns) break;
      const std::size_t needed = child.blocks_needed + next.blocks_needed;
      const std::size_t blocks = blocks_of(columns, next.node.rows_below.size());
      if (!is_worth_merging(columns, blocks, blocks - needed)) break;
      next.node.first = child.node.first;
      next.node.columns = static_cast<std::uint32_t>(columns);
      next.blocks_needed = needed;
      merged.pop_back();
    }
    merged.push_back(std::move(next));
  }

  symbolic.row_starts.assign(n + 1, 0);
  for (std::uint32_t j = 0; j < n; ++j) {
    for (std::uint32_t s = pattern.starts[j] + 1; s < pattern.starts[j + 1]; ++s) {
      ++symbolic.row_starts[pattern.rows[s] + 1];
    }
  }
  std::partial_sum(symbolic.row_starts.begin(), symbolic.row_starts.end(),
                   symbolic.row_starts.begin());
  symbolic.row_columns.resize(symbolic.row_starts.back());
  symbolic.row_slots.resize(symbolic.row_starts.back());
  std::vector<std::uint32_t> next_of_row(symbolic.row_starts.begin(),
                                         symbolic.row_starts.end() - 1);
  for (std::uint32_t j = 0; j < n; ++j) {
    for (std::uint32_t s = pattern.starts[j] + 1; s < pattern.starts[j + 1]; ++s) {
      const std::uint32_t at = next_of_row[pattern.rows[s]]++;
      symbolic.row_columns[at] = j;
      symbolic.row_slots[at] = s;
    }
  }

  std::vector<std::int32_t> supernode_of(n);
  for (std::size_t s = 0; s < merged.size(); ++s) {
    const Supernode& node = merged[s].node;
    for (std::uint32_t c = 0; c < node.columns; ++c) {
      supernode_of[node.first + c] = static_cast<std::int32_t>(s);
    }
  }
  for (Merged& one : merged) {
    if (!one.node.rows_below.empty()) one.node.parent = supernode_of[one.node.rows_below.front()];
    symbolic.stored_blocks += blocks_of(one.node.columns, one.node.rows_below.size());
    symbolic.supernodes.push_back(std::move(one.node));
  }
  return symbolic;
}

}  // namespace palpate::elastic
