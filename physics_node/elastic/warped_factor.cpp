// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/warped_factor.h"

#include <algorithm>
#include <array>
#include <type_traits>
#include <utility>

namespace palpate::elastic {
namespace {

// Calls of factor() that leave out the exact stiffness after it has failed again and again.
constexpr int kMostLeftOut = 8;

Cholesky new_cholesky(const Body& body, Precision precision) {
  if (precision == Precision::kFloat) return BlockCholesky<float>(body.pattern(), body.symbolic());
  return BlockCholesky<double>(body.pattern(), body.symbolic());
}

}  // namespace

bool SharedFactors::find(const BlockValues& values, Cholesky& cholesky) const {
  const std::scoped_lock lock(mutex_);
  const auto take = [](auto& own, auto panels) {
    if (panels == nullptr) return false;
    own.set_panels(std::move(panels));
    return true;
  };
  for (const One& one : all_) {
    const bool is_there = cholesky.index() == 0 ? !one.floats.expired() : !one.doubles.expired();
    if (!is_there || one.values != values) continue;
    return cholesky.index() == 0 ? take(std::get<0>(cholesky), one.floats.lock())
                                 : take(std::get<1>(cholesky), one.doubles.lock());
  }
  return false;
}

void SharedFactors::note(const BlockValues& values, const Cholesky& cholesky) {
  const std::scoped_lock lock(mutex_);
  std::erase_if(all_, [](const One& one) { return one.floats.expired() && one.doubles.expired(); });
  One made{.values = values, .floats = {}, .doubles = {}};
  if (cholesky.index() == 0) {
    made.floats = std::get<0>(cholesky).panels();
  } else {
    made.doubles = std::get<1>(cholesky).panels();
  }
  all_.push_back(std::move(made));
}

WarpedFactor::WarpedFactor(const Body& body, Precision precision, bool is_folded)
    : body_(&body), cholesky_(new_cholesky(body, precision)), is_folded_(is_folded) {
  reference_ = no_rotations(body.node_count());
  turns_.resize(9 * body.pattern().size());
  turn_back();
  packed_.resize(3 * body.pattern().size());
}

bool WarpedFactor::factor(const VectorXd& x_m, const std::vector<double>& rotations,
                          const Body::Shift& shift, const Obstacle* obstacle) {
  BlockValues values;
  const auto try_factor = [&](bool is_exact) {
    body_->stiffness(x_m, rotations, shift, !is_exact, values);
    const BlockValues before = is_folded_ && obstacle != nullptr ? values : BlockValues{};
    if (obstacle != nullptr && is_exact) {
      obstacle->add_exact_stiffness(x_m.data(), body_->pattern(), values);
    } else if (obstacle != nullptr) {
      obstacle->add_stiffness(x_m.data(), body_->pattern(), values);
    }
    if (is_folded_) {
      recipe_ = Recipe{.x_m = x_m, .is_exact = is_exact, .of_obstacle = {}};
      for (std::size_t i = 0; i < before.size(); ++i) {
        if (values[i] != before[i]) recipe_->of_obstacle.emplace_back(i, values[i]);
      }
    }
    if (obstacle == nullptr && body_->shared_factors().find(values, cholesky_)) return true;
    if (!std::visit([&](auto& cholesky) { return cholesky.factor(values); }, cholesky_)) {
      return false;
    }
    if (obstacle == nullptr) body_->shared_factors().note(values, cholesky_);
    return true;
  };
  is_ready_ = false;
  recipe_.reset();
  std::visit([](auto& cholesky) { cholesky.unfold(); }, cholesky_);
  packed_.resize(3 * body_->pattern().size());
  turns_.resize(9 * body_->pattern().size());
  if (body_->description().law == Law::kCorotational || body_->has_inverted_element(x_m)) {
    // from inside out the exact stiffness leads to the nearest equilibrium, inside out, and with
    // the corotational law also from beside it
  } else if (left_out_ > 0) {
    --left_out_;
  } else if (try_factor(true)) {
    is_ready_ = true;
    next_left_out_ = 1;
  } else {
    left_out_ = next_left_out_;
    next_left_out_ = std::min(2 * next_left_out_, kMostLeftOut);
  }
  is_ready_ = is_ready_ || try_factor(false);
  shift_ = shift;
  reference_ = rotations;
  turn_back();
  return is_ready_;
}

WarpedFactor WarpedFactor::in(Precision precision) const {
  WarpedFactor other(*body_, precision);
  if (!is_ready_) return other;
  other.is_ready_ = true;
  other.shift_ = shift_;
  other.reference_ = reference_;
  other.turns_ = turns_;
  const auto copy = [&](auto& to) {
    const auto& from = std::get<BlockCholesky<double>>(cholesky_);
    if constexpr (std::is_same_v<std::decay_t<decltype(to)>, BlockCholesky<double>>) {
      to.set_panels(from.panels());
    } else {
      to.set_rounded(*from.panels());
    }
  };
  std::visit(copy, other.cholesky_);
  return other;
}

void WarpedFactor::continue_as(const WarpedFactor& other) {
  const bool is_folded = is_folded_;
  *this = other;
  is_folded_ = is_folded;
  if (!is_folded_) unfold();
}

void WarpedFactor::fold() {
  give_back(turns_);
  give_back(packed_);
  std::visit([&](auto& cholesky) { cholesky.fold(recipe_.has_value() && is_ready_); }, cholesky_);
}

void WarpedFactor::unfold() {
  packed_.resize(3 * body_->pattern().size());
  turns_.resize(9 * body_->pattern().size());
  const auto make = [&](auto& cholesky) {
    cholesky.unfold();
    if (!is_ready_ || cholesky.panels() != nullptr) return;
    BlockValues values;
    body_->stiffness(recipe_->x_m, reference_, shift_, !recipe_->is_exact, values);
    for (const auto& [i, value] : recipe_->of_obstacle) values[i] = value;
    is_ready_ = cholesky.factor(values);
  };
  std::visit(make, cholesky_);
}

void WarpedFactor::turn_to(const std::vector<double>& rotations) {
  const auto& nodes = body_->pattern().nodes;
  for (std::size_t j = 0; j < nodes.size(); ++j) {
    const double* a = rotations.data() + 4 * std::size_t{nodes[j]};
    const double* b = reference_.data() + 4 * std::size_t{nodes[j]};
    // a b̄
    const double w = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
    const double x = a[1] * b[0] - a[0] * b[1] - a[2] * b[3] + a[3] * b[2];
    const double y = a[2] * b[0] - a[0] * b[2] - a[3] * b[1] + a[1] * b[3];
    const double z = a[3] * b[0] - a[0] * b[3] - a[1] * b[2] + a[2] * b[1];
    double* r = turns_.data() + 9 * j;
    r[0] = 1.0 - 2.0 * (y * y + z * z);
    r[1] = 2.0 * (x * y - w * z);
    r[2] = 2.0 * (x * z + w * y);
    r[3] = 2.0 * (x * y + w * z);
    r[4] = 1.0 - 2.0 * (x * x + z * z);
    r[5] = 2.0 * (y * z - w * x);
    r[6] = 2.0 * (x * z - w * y);
    r[7] = 2.0 * (y * z + w * x);
    r[8] = 1.0 - 2.0 * (x * x + y * y);
  }
}

void WarpedFactor::turn_back() {
  std::fill(turns_.begin(), turns_.end(), 0.0);
  for (std::size_t i = 0; i < turns_.size(); i += 9) {
    turns_[i] = turns_[i + 4] = turns_[i + 8] = 1.0;
  }
}

/// Turned back, of the free nodes.
void WarpedFactor::pack(const double* gradient, double* packed) const noexcept {
  const auto& nodes = body_->pattern().nodes;
  for (std::size_t j = 0; j < nodes.size(); ++j) {
    const double* g = gradient + 3 * std::size_t{nodes[j]};
    const double* r = turns_.data() + 9 * j;
    for (std::size_t i = 0; i < 3; ++i) {
      packed[3 * j + i] = r[i] * g[0] + r[3 + i] * g[1] + r[6 + i] * g[2];
    }
  }
}

void WarpedFactor::unpack(const double* packed, double* direction) const noexcept {
  const auto& nodes = body_->pattern().nodes;
  for (const std::uint32_t node : body_->description().fixed_nodes) {
    std::fill_n(direction + 3 * std::size_t{node}, 3, 0.0);
  }
  for (std::size_t j = 0; j < nodes.size(); ++j) {
    const double* d = packed + 3 * j;
    const double* r = turns_.data() + 9 * j;
    double* to = direction + 3 * std::size_t{nodes[j]};
    for (std::size_t i = 0; i < 3; ++i) {
      to[i] = r[3 * i] * d[0] + r[3 * i + 1] * d[1] + r[3 * i + 2] * d[2];
    }
  }
}

void WarpedFactor::solve(const double* gradient, double* direction) {
  pack(gradient, packed_.data());
  std::visit([&](auto& cholesky) { cholesky.solve(packed_.data(), packed_.data()); }, cholesky_);
  unpack(packed_.data(), direction);
}

void WarpedFactor::solve_together(std::span<double* const> vectors) {
  std::vector<std::vector<double>> packed(vectors.size(), std::vector<double>(packed_.size()));
  std::vector<double*> places;
  for (std::size_t k = 0; k < vectors.size(); ++k) {
    pack(vectors[k], packed[k].data());
    places.push_back(packed[k].data());
  }
  std::visit([&](auto& cholesky) { cholesky.solve_together(places); }, cholesky_);
  for (std::size_t k = 0; k < vectors.size(); ++k) unpack(packed[k].data(), vectors[k]);
}

void WarpedFactor::columns(std::span<const std::uint32_t> nodes, std::span<const std::uint32_t> at,
                           std::span<float* const> values) {
  const std::vector<std::int32_t>& row_of = body_->pattern().row_of;
  std::array<std::uint32_t, kMostColumns> rows{};
  std::transform(nodes.begin(), nodes.end(), rows.begin(),
                 [&](std::uint32_t node) { return static_cast<std::uint32_t>(row_of[node]); });
  const auto read = [&](auto& cholesky) {
    cholesky.solve_columns({rows.data(), nodes.size()});
    for (std::size_t i = 0; i < at.size(); ++i) {
      const std::int32_t row = row_of[at[i]];
      for (std::size_t j = 0; j < nodes.size(); ++j) {
        for (std::size_t k = 0; k < 9; ++k) {
          values[j][9 * i + k] = row < 0 ? 0.0F
                                         : static_cast<float>(cholesky.column_entry(
                                               static_cast<std::uint32_t>(row), k / 3, j, k % 3));
        }
      }
    }
  };
  std::visit(read, cholesky_);
}

}  // namespace palpate::elastic
