// SPDX-License-Identifier: Apache-2.0
#include "physics_node/files/file_text.h"

#include <algorithm>

namespace palpate::physics {
namespace {

bool is_blank(char c) noexcept { return c == ' ' || c == '\t' || c == '\r'; }

}  // namespace

std::string shown_word(std::string_view word) {
  constexpr std::size_t kMost = 40;
  std::string shown(word.substr(0, kMost));
  for (char& c : shown) {
    if (c < ' ' || c > '~') c = '?';
  }
  return word.size() > kMost ? shown + "…" : shown;
}

bool read_number(std::string_view word, double& number) noexcept {
  if (word.starts_with('+')) word.remove_prefix(1);
  const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), number);
  return error == std::errc() && stop == word.data() + word.size() && std::isfinite(number);
}

void FileText::skip_blanks(bool across_lines) noexcept {
  for (; at_ < bytes_.size(); ++at_) {
    const char c = bytes_[at_];
    if (c == '\n' && across_lines) {
      ++line_;
    } else if (!is_blank(c)) {
      return;
    }
  }
}

std::string_view FileText::rest_of_line() noexcept {
  const std::size_t end = std::min(bytes_.find('\n', at_), bytes_.size());
  std::string_view rest = bytes_.substr(at_, end - at_);
  at_ = std::min(end + 1, bytes_.size());
  if (end < bytes_.size()) ++line_;
  while (!rest.empty() && is_blank(rest.back())) rest.remove_suffix(1);
  return rest;
}

std::string_view FileText::word_of_line() noexcept {
  skip_blanks(false);
  const std::size_t begin = at_;
  while (at_ < bytes_.size() && !is_blank(bytes_[at_]) && bytes_[at_] != '\n') ++at_;
  return bytes_.substr(begin, at_ - begin);
}

std::string_view FileText::word() noexcept {
  skip_blanks(true);
  return word_of_line();
}

double FileText::number(const char* what) {
  const std::string_view text = word();
  double value = 0.0;
  if (text.empty()) fail(std::string(what) + ": the file ends here");
  if (!read_number(text, value)) {
    fail(std::string(what) + " = " + shown_word(text) + ": must be a finite number");
  }
  return value;
}

std::int64_t FileText::integer(const char* what, std::int64_t min, std::int64_t max) {
  const std::string_view text = word();
  std::int64_t value = 0;
  if (text.empty()) fail(std::string(what) + ": the file ends here");
  const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || stop != text.data() + text.size() || value < min || value > max) {
    fail(std::string(what) + " = " + shown_word(text) + ": must be a whole number of " +
         std::to_string(min) + " … " + std::to_string(max));
  }
  return value;
}

void FileText::skip_bytes(std::size_t count, const char* what) {
  if (left() < count) fail_at_byte(std::string(what) + ": the file ends here");
  at_ += count;
}

void FileText::fail_at_line(int line, const std::string& what) const {
  throw SetupError(file_name_ + ":" + std::to_string(line) + ": " + what);
}

void FileText::fail_at_byte(const std::string& what) const {
  throw SetupError(file_name_ + ": byte " + std::to_string(at_) + ": " + what);
}

}  // namespace palpate::physics
