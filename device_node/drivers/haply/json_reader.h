// SPDX-License-Identifier: Apache-2.0
// json_reader.h — reads one JSON text in place: no tree, no allocation, no exception. For the tick;
// everything else uses nlohmann/json.
#pragma once

#include <charconv>
#include <cmath>
#include <cstddef>
#include <string_view>

namespace palpate::device {

/// A place in a JSON text. Every reader returns false, and the place is then meaningless, if the
/// text is not what was asked for. Nesting is bounded. Strings are given as they stand: escapes are
/// passed over, not decoded.
class JsonReader {
 public:
  static constexpr int kDeepest = 32;

  explicit JsonReader(std::string_view text) noexcept : text_(text) {}

  /// `on_member(key, reader)` for each member of an object; it reads or skips the value and returns
  /// whether that went well.
  template <class OnMember>
  [[nodiscard]] bool object(OnMember&& on_member) noexcept {
    if (!opens('{')) return false;
    if (closes('}')) return true;
    do {
      std::string_view key;
      if (!string(key) || !takes(':') || !on_member(key, *this)) return false;
    } while (takes(','));
    return closes('}');
  }

  /// `on_element(reader)` for each element of an array, likewise.
  template <class OnElement>
  [[nodiscard]] bool array(OnElement&& on_element) noexcept {
    if (!opens('[')) return false;
    if (closes(']')) return true;
    do {
      if (!on_element(*this)) return false;
    } while (takes(','));
    return closes(']');
  }

  [[nodiscard]] bool string(std::string_view& value) noexcept {
    if (!takes('"')) return false;
    const std::size_t from = at_;
    for (; at_ < text_.size(); ++at_) {
      if (text_[at_] == '"') {
        value = text_.substr(from, at_ - from);
        ++at_;
        return true;
      }
      if (static_cast<unsigned char>(text_[at_]) < 0x20) return false;
      if (text_[at_] == '\\') ++at_;
    }
    return false;
  }

  /// A finite number.
  [[nodiscard]] bool number(double& value) noexcept {
    pass_space();
    const char* begin = text_.data() + at_;
    const char* end = text_.data() + text_.size();
    if (begin == end || (*begin != '-' && (*begin < '0' || *begin > '9'))) return false;
    const std::from_chars_result result = std::from_chars(begin, end, value);
    if (result.ec != std::errc() || !std::isfinite(value)) return false;
    at_ += static_cast<std::size_t>(result.ptr - begin);
    return true;
  }

  [[nodiscard]] bool boolean(bool& value) noexcept {
    pass_space();
    value = word("true");
    return value || word("false");
  }

  /// Passes over a value of any kind.
  [[nodiscard]] bool skip() noexcept {
    pass_space();
    if (at_ >= text_.size()) return false;
    switch (text_[at_]) {
      case '{':
        return object([](std::string_view, JsonReader& value) noexcept { return value.skip(); });
      case '[':
        return array([](JsonReader& value) noexcept { return value.skip(); });
      case '"': {
        std::string_view passed;
        return string(passed);
      }
      case 't':
        return word("true");
      case 'f':
        return word("false");
      case 'n':
        return word("null");
      default: {
        double passed = 0.0;
        return number(passed);
      }
    }
  }

  /// Nothing but space follows.
  [[nodiscard]] bool ends() noexcept {
    pass_space();
    return at_ == text_.size();
  }

 private:
  void pass_space() noexcept {
    while (at_ < text_.size() &&
           (text_[at_] == ' ' || text_[at_] == '\t' || text_[at_] == '\n' || text_[at_] == '\r')) {
      ++at_;
    }
  }
  [[nodiscard]] bool takes(char c) noexcept {
    pass_space();
    if (at_ >= text_.size() || text_[at_] != c) return false;
    ++at_;
    return true;
  }
  [[nodiscard]] bool opens(char c) noexcept { return ++depth_ <= kDeepest && takes(c); }
  [[nodiscard]] bool closes(char c) noexcept {
    if (!takes(c)) return false;
    --depth_;
    return true;
  }
  [[nodiscard]] bool word(std::string_view expected) noexcept {
    if (text_.substr(at_, expected.size()) != expected) return false;
    at_ += expected.size();
    return true;
  }

  std::string_view text_;
  std::size_t at_ = 0;
  int depth_ = 0;
};

}  // namespace palpate::device
