// SPDX-License-Identifier: Apache-2.0
// state_text.h — the members of a value as text and back, to the bit: a type lists them once, in
// list(archive), and both directions follow. For the post-mortem of a fault; not for the tick.
#pragma once

#include <concepts>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <sstream>
#include <string>
#include <type_traits>

#include "common/core/time.h"
#include "common/core/vector.h"

namespace palpate::device {

/// Words separated by blanks: hexadecimal floating point, integers, 0 or 1, nanoseconds.
class StateWriter {
 public:
  static constexpr bool kIsReading = false;

  template <std::integral T>
  void operator()(const T& value) {
    add(std::to_string(value));
  }
  template <class T>
  requires std::is_enum_v<T>
  void operator()(const T& value) { (*this)(static_cast<int>(value)); }
  void operator()(const double& value) {
    char text[40];
    std::snprintf(text, sizeof(text), "%a", value);
    add(text);
  }
  void operator()(const Duration& value) { (*this)(value.count()); }
  void operator()(const TimePoint& value) { (*this)(value.time_since_epoch()); }
  void operator()(const Vector3& value) {
    for (const double x : value) (*this)(x);
  }
  void operator()(const std::optional<Vector3>& value) {
    (*this)(value.has_value());
    (*this)(value.value_or(Vector3::Zero()));
  }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  void add(const std::string& word) {
    if (!text_.empty()) text_ += ' ';
    text_ += word;
  }
  std::string text_;
};

/// What StateWriter wrote. A word that is missing or of another kind makes is_good() false; the
/// values are then meaningless.
class StateReader {
 public:
  static constexpr bool kIsReading = true;

  explicit StateReader(const std::string& text) : words_(text) {}

  template <std::integral T>
  void operator()(T& value) {
    const std::string word = next();
    char* end = nullptr;
    if constexpr (std::same_as<T, std::uint64_t>) {
      value = std::strtoull(word.c_str(), &end, 10);
    } else {
      const long long number = std::strtoll(word.c_str(), &end, 10);
      value = static_cast<T>(number);
      if (static_cast<long long>(value) != number) is_good_ = false;
    }
    check(word, end);
  }
  template <class T>
  requires std::is_enum_v<T>
  void operator()(T& value) {
    int number = 0;
    (*this)(number);
    value = static_cast<T>(number);
    if (static_cast<int>(value) != number) is_good_ = false;
  }
  void operator()(double& value) {
    const std::string word = next();
    char* end = nullptr;
    value = std::strtod(word.c_str(), &end);
    check(word, end);
  }
  void operator()(Duration& value) {
    std::int64_t ns = 0;
    (*this)(ns);
    value = Duration(ns);
  }
  void operator()(TimePoint& value) {
    Duration since{};
    (*this)(since);
    value = TimePoint(since);
  }
  void operator()(Vector3& value) {
    for (double& x : value) (*this)(x);
  }
  void operator()(std::optional<Vector3>& value) {
    bool has_value = false;
    Vector3 read = Vector3::Zero();
    (*this)(has_value);
    (*this)(read);
    value = has_value ? std::optional<Vector3>(read) : std::nullopt;
  }
  /// Of a type's own rule on what was read.
  void require(bool is_kept) {
    if (!is_kept) is_good_ = false;
  }
  [[nodiscard]] bool is_good() const { return is_good_; }
  /// Good, and nothing is left.
  [[nodiscard]] bool is_done() {
    std::string rest;
    return is_good_ && !(words_ >> rest);
  }

 private:
  std::string next() {
    std::string word;
    words_ >> word;
    return word;
  }
  void check(const std::string& word, const char* end) {
    if (word.empty() || *end != '\0') is_good_ = false;
  }

  std::istringstream words_;
  bool is_good_ = true;
};

}  // namespace palpate::device
