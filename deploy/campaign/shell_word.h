// SPDX-License-Identifier: Apache-2.0
// shell_word.h — a text as one word of a POSIX shell.
#pragma once

#include <algorithm>
#include <cctype>
#include <string>
#include <string_view>

namespace palpate::campaign {

[[nodiscard]] inline std::string shell_word(std::string_view text) {
  const bool is_plain = std::all_of(text.begin(), text.end(), [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 ||
           std::string_view("/._-=:,+").find(c) != std::string_view::npos;
  });
  if (is_plain && !text.empty()) return std::string(text);
  std::string word(1, '\'');
  for (const char c : text) {
    if (c == '\'') {
      word += "'\\''";
    } else {
      word += c;
    }
  }
  word += '\'';
  return word;
}

}  // namespace palpate::campaign
