// SPDX-License-Identifier: Apache-2.0
// nearest.h — the word that somebody meant who wrote another one.
#pragma once

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <string>
#include <string_view>
#include <vector>

namespace palpate {

/// Fewest insertions, deletions, replacements and swaps of neighbours from one word to the other.
[[nodiscard]] inline std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::vector<std::size_t>> rows(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  std::iota(rows[0].begin(), rows[0].end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    rows[i][0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = rows[i - 1][j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      rows[i][j] = std::min({replaced, rows[i - 1][j] + 1, rows[i][j - 1] + 1});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        rows[i][j] = std::min(rows[i][j], rows[i - 2][j - 2] + 1);
      }
    }
  }
  return rows.back().back();
}

/// "MOFC" → "mofc"; letters of ASCII.
[[nodiscard]] inline std::string lower_case(std::string_view text) {
  std::string lower(text);
  for (char& c : lower) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return lower;
}

/// The candidate that is most like the word, whatever the case of letters; "" if none is like it. A
/// beginning counts most, as "mass" of "mass_kg".
[[nodiscard]] inline std::string nearest(std::string_view written,
                                         const std::vector<std::string>& candidates) {
  const std::string word = lower_case(written);
  constexpr std::size_t kMaxBytes = 64;  // longer words are not compared
  if (word.empty() || word.size() > kMaxBytes) return {};
  std::string best;
  std::size_t best_distance = std::max<std::size_t>(2, word.size() / 3) + 1;
  for (const std::string& one : candidates) {
    const std::string candidate = lower_case(one);
    std::size_t distance = edit_distance(word, candidate);
    if (candidate.starts_with(word)) distance = 0;
    if (word.starts_with(candidate) && 2 * candidate.size() >= word.size()) {
      distance = std::min<std::size_t>(distance, 2);
    }
    if (distance >= best_distance) continue;
    best_distance = distance;
    best = one;
  }
  return best;
}

}  // namespace palpate
