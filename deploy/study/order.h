// SPDX-License-Identifier: Apache-2.0
// order.h — who has which condition when: balanced Latin squares.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "deploy/study/plan.h"

namespace palpate::study {

/// A Latin square of n conditions in which each follows each other equally often [Williams49]: n
/// rows, with an odd n > 1 twice as many. @pre  n ≥ 1
[[nodiscard]] std::vector<std::vector<std::size_t>> balanced_square(std::size_t n);

/// The conditions of a participant, in order: a row of the square.
/// @param square  which condition has each place of the square, as the key of the folder says
/// @param participant  from 1
[[nodiscard]] std::vector<std::size_t> order_of(const std::vector<std::size_t>& square,
                                                std::uint64_t participant);

/// One trial of a participant.
struct Trial {
  std::uint64_t participant = 1;  ///< from 1
  std::uint64_t number = 1;       ///< of the participant, from 1
  std::size_t block = 0;          ///< of the participant, from 0: which of his conditions
  std::size_t condition = 0;      ///< index in the plan
  std::uint64_t in_block = 0;     ///< from 0
  // of a staircase
  std::size_t alternative = 0;  ///< index in the plan
  double difference_ratio = 0.0;

  /// Drawn from the study's seed, the participant and the number: the same after a restart.
  [[nodiscard]] std::uint64_t seed(const Plan& plan) const;
  /// As --set has them.
  [[nodiscard]] std::vector<std::string> overrides(const Plan& plan) const;
};

}  // namespace palpate::study
