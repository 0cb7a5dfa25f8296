// SPDX-License-Identifier: Apache-2.0
// import_text.h — text as printf() makes it.
#pragma once

#include <cstdarg>
#include <cstdio>
#include <string>

#include "common/core/user/utf8.h"

namespace palpate {

[[gnu::format(printf, 1, 2)]] inline std::string text_of(const char* format, ...) {
  va_list arguments;
  va_list again;
  va_start(arguments, format);
  va_copy(again, arguments);
  std::string text(static_cast<std::size_t>(std::vsnprintf(nullptr, 0, format, arguments)), ' ');
  std::vsnprintf(text.data(), text.size() + 1, format, again);
  va_end(again);
  va_end(arguments);
  return text;
}

/// The first characters of a name (UTF-8), filled with spaces to as many.
inline std::string column(const std::string& name, std::size_t characters) {
  std::string text;
  std::size_t count = 0;
  for (const char c : name) {
    if (begins_character(c) && count++ == characters) return text;
    text += c;
  }
  return text.append(characters - count, ' ');
}

}  // namespace palpate
