// SPDX-License-Identifier: Apache-2.0
// file_text.h — reads words, numbers and bytes of a geometry file; errors name the position.
#pragma once

#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "common/core/check.h"

namespace palpate::physics {

/// The word for an error message: at most 40 characters, others than printable ASCII replaced.
[[nodiscard]] std::string shown_word(std::string_view word);

/// Reads from the front. Invalid text or a premature end throws SetupError as
/// "file:line: what: rule; remedy" (bytes: "file: byte N: …").
class FileText {
 public:
  /// @param bytes  must outlive this
  FileText(std::string_view bytes, std::string file_name)
      : bytes_(bytes), file_name_(std::move(file_name)) {}

  [[nodiscard]] bool is_at_end() const noexcept { return at_ >= bytes_.size(); }
  [[nodiscard]] std::size_t left() const noexcept { return bytes_.size() - at_; }
  [[nodiscard]] int line() const noexcept { return line_; }

  /// The rest of this line without its end; continues at the next line.
  std::string_view rest_of_line() noexcept;

  /// The next word, across lines; "" at the end of the file.
  std::string_view word() noexcept;
  /// The next word of this line; "" at its end.
  std::string_view word_of_line() noexcept;

  /// The next word as a finite number.
  double number(const char* what);
  /// The next word as a whole number within [min, max].
  std::int64_t integer(const char* what, std::int64_t min, std::int64_t max);

  /// The next bytes as a T.
  template <class T>
  T binary(const char* what, std::endian endian) {
    static_assert(std::is_arithmetic_v<T>);
    std::array<char, sizeof(T)> raw;
    const std::size_t at = at_;
    skip_bytes(raw.size(), what);
    std::memcpy(raw.data(), bytes_.data() + at, raw.size());
    if (endian != std::endian::native) {
      for (std::size_t i = 0; i < raw.size() / 2; ++i) std::swap(raw[i], raw[raw.size() - 1 - i]);
    }
    return std::bit_cast<T>(raw);
  }
  void skip_bytes(std::size_t count, const char* what);

  /// At the current line.
  [[noreturn]] void fail(const std::string& what) const { fail_at_line(line_, what); }
  [[noreturn]] void fail_at_line(int line, const std::string& what) const;
  [[noreturn]] void fail_at_byte(const std::string& what) const;

 private:
  void skip_blanks(bool across_lines) noexcept;

  std::string_view bytes_;
  std::string file_name_;
  std::size_t at_ = 0;
  int line_ = 1;
};

/// Parses a finite number; false if the word is anything else.
[[nodiscard]] bool read_number(std::string_view word, double& number) noexcept;

}  // namespace palpate::physics
