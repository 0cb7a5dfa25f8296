// SPDX-License-Identifier: Apache-2.0
// key.h — which code stands for which condition, and which place of the balanced square it has:
// dealt out once, kept in a file, read from there.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "deploy/study/plan.h"

namespace palpate::study {

/// The secret of a folder: who knows the plan and the codes of all trials in their order knows
/// nothing of it.
struct Key {
  std::vector<std::string> codes;   ///< of each condition of the plan
  std::vector<std::size_t> square;  ///< which condition of the plan has each place of the square
  bool is_square_dealt = true;      ///< false: of an older folder, whose square follows the plan
};

/// Codes "A", "B", …, and apart from them the places of the square, each in an order that nothing
/// predicts: drawn from the system's source of randomness. Throws std::runtime_error if that fails.
[[nodiscard]] Key dealt_key(std::size_t conditions);

/// The text of a key file: code, condition and place of each, in the order of the codes.
[[nodiscard]] std::string key_text(const Plan& plan, const Key& key);

/// From a key file. Throws SetupError if it cannot be read or does not name each condition, each
/// code and each place once. Of an older one, without places, the square follows the plan.
[[nodiscard]] Key key_in(const std::filesystem::path& file, const Plan& plan);

}  // namespace palpate::study
