// SPDX-License-Identifier: Apache-2.0
#include "deploy/study/order.h"

#include <spdlog/fmt/fmt.h>

#include "common/core/random.h"

namespace palpate::study {

std::vector<std::vector<std::size_t>> balanced_square(std::size_t n) {
  // the first row goes 0, 1, n−1, 2, n−2, …: all steps between neighbours differ
  std::vector<std::size_t> first{0};
  for (std::size_t low = 1, high = n - 1; first.size() < n; ++low, --high) {
    first.push_back(low);
    if (first.size() < n) first.push_back(high);
  }
  std::vector<std::vector<std::size_t>> rows;
  for (std::size_t shift = 0; shift < n; ++shift) {
    std::vector<std::size_t>& row = rows.emplace_back();
    for (const std::size_t one : first) row.push_back((one + shift) % n);
  }
  if (n % 2 == 0 || n == 1) return rows;
  // with an odd number each pair follows each other as often only together with the mirror images
  for (std::size_t i = 0; i < n; ++i) rows.emplace_back(rows[i].rbegin(), rows[i].rend());
  return rows;
}

std::vector<std::size_t> order_of(const std::vector<std::size_t>& square,
                                  std::uint64_t participant) {
  const auto rows = balanced_square(square.size());
  std::vector<std::size_t> order = rows[(participant - 1) % rows.size()];
  for (std::size_t& place : order) place = square[place];
  return order;
}

std::uint64_t Trial::seed(const Plan& plan) const {
  return fnv1a(fmt::format("{} {} {}", plan.seed, participant, number));
}

std::vector<std::string> Trial::overrides(const Plan& plan) const {
  return plan.overrides_of(condition, alternative, difference_ratio);
}

}  // namespace palpate::study
