// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/linear/block_cholesky.h"

#include <algorithm>
#include <utility>

#include "physics_node/elastic/linear/dense_kernels.h"

namespace palpate::elastic {
namespace {

int rows_of(const Supernode& node) {
  return 3 * static_cast<int>(node.columns + node.rows_below.size());
}

constexpr std::size_t kBlock = std::size_t{3} * kTogether;  // of a row, of all together

// A child's Schur complement is the lower half of a square over 3 per row of its supernode.
std::size_t update_size(const Supernode& node) {
  return 9 * node.rows_below.size() * node.rows_below.size();
}

}  // namespace

template <class Scalar>
BlockCholesky<Scalar>::BlockCholesky(const BlockPattern& pattern,
                                     std::shared_ptr<const SymbolicFactor> symbolic)
    : pattern_(&pattern), symbolic_(std::move(symbolic)) {
  std::size_t& size = panels_size_;
  std::vector<std::size_t> waiting;  // supernodes, as in factor()
  std::size_t waiting_size = 0;
  for (std::size_t s = 0; s < symbolic_->supernodes.size(); ++s) {
    const Supernode& node = symbolic_->supernodes[s];
    panel_starts_.push_back(size);
    const auto rows = static_cast<std::size_t>(padded(rows_of(node)));
    size += rows * 3 * node.columns;
    widest_ = std::max(widest_, rows);
    largest_front_ = std::max(largest_front_, rows * static_cast<std::size_t>(rows_of(node)));
    while (!waiting.empty() && is_child(waiting.back(), s)) {
      waiting_size -= update_size(symbolic_->supernodes[waiting.back()]);
      waiting.pop_back();
    }
    if (node.rows_below.empty()) continue;  // no parent waits for it
    waiting.push_back(s);
    waiting_size += update_size(node);
    most_waiting_ = std::max(most_waiting_, waiting_size);
  }
  unfold();
}

template <class Scalar>
void BlockCholesky<Scalar>::fold(bool may_go) {
  for (auto* room : {&solution_, &work_, &together_, &work_together_}) give_back(*room);
  if (may_go && panels_.use_count() == 1) panels_ = nullptr;
}

template <class Scalar>
void BlockCholesky<Scalar>::unfold() {
  solution_.resize(3 * pattern_->size() + kPadding);
  work_.resize(2 * widest_);
}

template <class Scalar>
bool BlockCholesky<Scalar>::factor(const BlockValues& values) {
  panels_ = nullptr;
  auto made = std::make_shared<Panels>(panels_size_);
  // A stack of updates whose parents have not come yet: column-major, leading dimension 3 × rows
  // below. Memory of its own for each would cost as much as a fifth of the factorisation.
  const auto updates = std::make_unique_for_overwrite<double[]>(most_waiting_);
  double* updates_end = updates.get();
  std::vector<std::size_t> waiting;                       // their supernodes
  std::vector<std::int32_t> place(pattern_->size(), -1);  // block row in the front
  std::vector<double> front;
  front.reserve(largest_front_);
  for (std::size_t s = 0; s < symbolic_->supernodes.size(); ++s) {
    const Supernode& node = symbolic_->supernodes[s];
    const int n = rows_of(node);
    const int pivots = static_cast<int>(3 * node.columns);
    const auto ld = static_cast<std::size_t>(padded(n));
    front.assign(ld * static_cast<std::size_t>(n), 0.0);
    std::int32_t next = 0;
    for (std::uint32_t c = 0; c < node.columns; ++c) place[node.first + c] = next++;
    for (const std::uint32_t row : node.rows_below) place[row] = next++;

    // the matrix's own blocks
    for (std::uint32_t c = 0; c < node.columns; ++c) {
      const std::uint32_t j = symbolic_->order[node.first + c];
      const auto add = [&](std::uint32_t i, std::uint32_t slot, bool is_transposed) {
        const std::uint32_t row = symbolic_->position[i];
        if (row < node.first + c) return;  // was taken when that column was
        double* to =
            front.data() + 3 * std::size_t{c} * ld + 3 * static_cast<std::size_t>(place[row]);
        const double* block = values.data() + 9 * std::size_t{slot};
        for (std::size_t b = 0; b < 3; ++b) {
          for (std::size_t a = 0; a < 3; ++a) {
            to[b * ld + a] = is_transposed ? block[3 * b + a] : block[3 * a + b];
          }
        }
      };
      for (std::uint32_t slot = pattern_->starts[j]; slot < pattern_->starts[j + 1]; ++slot) {
        add(pattern_->rows[slot], slot, false);
      }
      for (std::uint32_t k = symbolic_->row_starts[j]; k < symbolic_->row_starts[j + 1]; ++k) {
        add(symbolic_->row_columns[k], symbolic_->row_slots[k], true);
      }
    }

    // what its children leave
    for (; !waiting.empty() && is_child(waiting.back(), s); waiting.pop_back()) {
      const Supernode& child = symbolic_->supernodes[waiting.back()];
      const auto& rows = child.rows_below;
      const std::size_t m = 3 * rows.size();
      updates_end -= update_size(child);
      for (std::size_t bj = 0; bj < rows.size(); ++bj) {
        for (std::size_t b = 0; b < 3; ++b) {
          const double* from = updates_end + (3 * bj + b) * m;
          double* to = front.data() + (3 * static_cast<std::size_t>(place[rows[bj]]) + b) * ld;
          for (std::size_t bi = bj; bi < rows.size(); ++bi) {
            double* at = to + 3 * static_cast<std::size_t>(place[rows[bi]]);
            at[0] += from[3 * bi];
            at[1] += from[3 * bi + 1];
            at[2] += from[3 * bi + 2];
          }
        }
      }
    }

    if (!partial_cholesky(front.data(), n, pivots)) return false;
    const auto m = static_cast<std::size_t>(n - pivots);
    for (std::size_t j = 0; j < m; ++j) {
      const double* from = front.data() + (static_cast<std::size_t>(pivots) + j) * ld +
                           static_cast<std::size_t>(pivots);
      std::copy(from + j / 3 * 3, from + m, updates_end + j * m + j / 3 * 3);
    }
    if (!node.rows_below.empty()) waiting.push_back(s);
    updates_end += update_size(node);
    invert_pivots(front.data(), n, pivots);
    std::transform(front.begin(), front.begin() + static_cast<std::ptrdiff_t>(ld) * pivots,
                   made->begin() + static_cast<std::ptrdiff_t>(panel_starts_[s]),
                   [](double value) { return static_cast<Scalar>(value); });
  }
  panels_ = std::move(made);
  return true;
}

template <class Scalar>
void BlockCholesky<Scalar>::solve(const double* b, double* x) {
  const std::size_t blocks = pattern_->size();
  for (std::size_t k = 0; k < blocks; ++k) {
    const double* from = b + 3 * std::size_t{symbolic_->order[k]};
    for (std::size_t i = 0; i < 3; ++i) solution_[3 * k + i] = static_cast<Scalar>(from[i]);
  }
  const std::size_t count = symbolic_->supernodes.size();
  for (std::size_t s = 0; s < count; ++s) {
    const Supernode& node = symbolic_->supernodes[s];
    Scalar* mine = solution_.data() + 3 * std::size_t{node.first};
    const int pivots = static_cast<int>(3 * node.columns);
    multiply(panel(s), rows_of(node), pivots, mine, work_.data());
    std::copy(work_.begin(), work_.begin() + pivots, mine);
    const Scalar* change = work_.data() + pivots;
    for (const std::uint32_t row : node.rows_below) {
      Scalar* to = solution_.data() + 3 * std::size_t{row};
      to[0] -= change[0];
      to[1] -= change[1];
      to[2] -= change[2];
      change += 3;
    }
  }
  for (std::size_t s = count; s-- > 0;) {
    const Supernode& node = symbolic_->supernodes[s];
    Scalar* mine = solution_.data() + 3 * std::size_t{node.first};
    const int pivots = static_cast<int>(3 * node.columns);
    const int n = rows_of(node);
    std::copy(mine, mine + pivots, work_.begin());
    Scalar* right = work_.data() + pivots;
    for (const std::uint32_t row : node.rows_below) {
      const Scalar* from = solution_.data() + 3 * std::size_t{row};
      right[0] = -from[0];
      right[1] = -from[1];
      right[2] = -from[2];
      right += 3;
    }
    std::fill(right, work_.data() + padded(n), Scalar{0});
    multiply_transposed(panel(s), n, pivots, work_.data(), mine);
  }
  for (std::size_t k = 0; k < blocks; ++k) {
    double* to = x + 3 * std::size_t{symbolic_->order[k]};
    for (std::size_t i = 0; i < 3; ++i) to[i] = static_cast<double>(solution_[3 * k + i]);
  }
}

template <class Scalar>
void BlockCholesky<Scalar>::solve_together(std::span<double* const> b) {
  together_.assign(kBlock * pattern_->size(), Scalar{0});
  for (std::size_t k = 0; k < pattern_->size(); ++k) {
    const std::size_t from = 3 * std::size_t{symbolic_->order[k]};
    for (std::size_t i = 0; i < 3; ++i) {
      Scalar* to = together_.data() + kBlock * k + kTogether * i;
      for (std::size_t which = 0; which < b.size(); ++which) {
        to[which] = static_cast<Scalar>(b[which][from + i]);
      }
    }
  }
  solve_reached(std::vector<char>(symbolic_->supernodes.size(), 1));
  for (std::size_t k = 0; k < pattern_->size(); ++k) {
    const std::size_t to = 3 * std::size_t{symbolic_->order[k]};
    for (std::size_t i = 0; i < 3; ++i) {
      const Scalar* from = together_.data() + kBlock * k + kTogether * i;
      for (std::size_t which = 0; which < b.size(); ++which) {
        b[which][to + i] = static_cast<double>(from[which]);
      }
    }
  }
}

template <class Scalar>
void BlockCholesky<Scalar>::solve_columns(std::span<const std::uint32_t> rows) {
  together_.assign(kBlock * pattern_->size(), Scalar{0});
  const std::size_t count = symbolic_->supernodes.size();
  std::vector<char> is_reached(count, 0);
  for (std::size_t which = 0; which < rows.size(); ++which) {
    const std::size_t at = symbolic_->position[rows[which]];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      together_[kBlock * at + kTogether * axis + 3 * which + axis] = Scalar{1};
    }
    const auto after = std::upper_bound(
        symbolic_->supernodes.begin(), symbolic_->supernodes.end(), at,
        [](std::size_t place, const Supernode& node) { return place < node.first; });
    is_reached[static_cast<std::size_t>(after - symbolic_->supernodes.begin()) - 1] = 1;
  }
  solve_reached(std::move(is_reached));
}

/// What is in together_, which is zero but in these supernodes.
template <class Scalar>
void BlockCholesky<Scalar>::solve_reached(std::vector<char> is_reached) {
  work_together_.resize(work_.size() / 2 * kTogether);
  const std::size_t count = symbolic_->supernodes.size();
  for (std::size_t s = 0; s < count; ++s) {
    if (is_reached[s] == 0) continue;
    const Supernode& node = symbolic_->supernodes[s];
    if (node.parent >= 0) is_reached[static_cast<std::size_t>(node.parent)] = 1;
    Scalar* mine = together_.data() + kBlock * node.first;
    const int pivots = static_cast<int>(3 * node.columns);
    multiply_together(panel(s), rows_of(node), pivots, mine, work_together_.data());
    std::copy_n(work_together_.data(), kBlock * node.columns, mine);
    const Scalar* change = work_together_.data() + kBlock * node.columns;
    for (const std::uint32_t row : node.rows_below) {
      Scalar* to = together_.data() + kBlock * row;
      for (std::size_t k = 0; k < kBlock; ++k) to[k] -= change[k];
      change += kBlock;
    }
  }
  for (std::size_t s = count; s-- > 0;) {
    const Supernode& node = symbolic_->supernodes[s];
    Scalar* mine = together_.data() + kBlock * node.first;
    const int pivots = static_cast<int>(3 * node.columns);
    Scalar* right = std::copy_n(mine, kBlock * node.columns, work_together_.data());
    for (const std::uint32_t row : node.rows_below) {
      const Scalar* from = together_.data() + kBlock * row;
      for (std::size_t k = 0; k < kBlock; ++k) right[k] = -from[k];
      right += kBlock;
    }
    multiply_transposed_together(panel(s), rows_of(node), pivots, work_together_.data(), mine);
  }
}

template class BlockCholesky<float>;
template class BlockCholesky<double>;

}  // namespace palpate::elastic
