// SPDX-License-Identifier: Apache-2.0
// key.h — which code stands for which condition: dealt out once, kept in a file, read from there.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "deploy/study/plan.h"

namespace palpate::study {

/// "A", "B", … in an order that nothing predicts: drawn from the system's source of randomness.
/// Throws std::runtime_error if that fails.
[[nodiscard]] std::vector<std::string> dealt_codes(std::size_t conditions);

/// The text of a key file. @param codes  of each condition of the plan
[[nodiscard]] std::string key_text(const Plan& plan, const std::vector<std::string>& codes);

/// Of each condition of the plan, from a key file. Throws SetupError if it cannot be read or does
/// not name each condition and each code once.
[[nodiscard]] std::vector<std::string> codes_in(const std::filesystem::path& key, const Plan& plan);

}  // namespace palpate::study
