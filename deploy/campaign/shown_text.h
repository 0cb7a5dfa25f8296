// SPDX-License-Identifier: Apache-2.0
// shown_text.h — a text of somebody else for the terminal, which must not obey it.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <string_view>

namespace palpate::campaign {

/// The text with '?' for control characters but ends of lines and tabs, those above 0x7F among
/// them, and for bytes that are not UTF-8.
[[nodiscard]] inline std::string shown_text(std::string_view text) {
  std::string shown;
  const auto byte = [&](std::size_t at) {
    return at < text.size() ? static_cast<unsigned char>(text[at]) : 0U;
  };
  for (std::size_t at = 0; at < text.size();) {
    const unsigned first = byte(at);
    const std::size_t size = first < 0x80U    ? 1
                             : first < 0xC2U  ? 0
                             : first < 0xE0U  ? 2
                             : first < 0xF0U  ? 3
                             : first <= 0xF4U ? 4
                                              : 0;
    std::size_t good = std::min<std::size_t>(size, 1);
    while (good < size && (byte(at + good) & 0xC0U) == 0x80U) ++good;
    const bool is_control = (first < 0x20U && first != '\n' && first != '\t') || first == 0x7FU ||
                            (first == 0xC2U && byte(at + 1) < 0xA0U);
    const bool is_shown = size > 0 && good == size && !is_control;
    shown += is_shown ? std::string(text.substr(at, size)) : "?";
    at += good == size && size > 0 ? size : 1;
  }
  return shown;
}

}  // namespace palpate::campaign
