// SPDX-License-Identifier: Apache-2.0
#include "common/core/problems.h"

#include <algorithm>
#include <tuple>
#include <utility>

#include "common/core/check.h"

namespace palpate {

namespace {

constexpr std::size_t kMaxShownBytes = 200;

}  // namespace

std::string one_line(std::string_view text) {
  std::string line(text);
  if (line.size() > kMaxShownBytes) {
    line.replace(kMaxShownBytes / 2, line.size() - kMaxShownBytes, "…");
  }
  for (char& c : line) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  }
  // U+200E, U+200F, U+202A … U+202E, U+2066 … U+2069 turn the order of what is shown
  for (std::size_t at = 0; (at = line.find('\xE2', at)) != std::string::npos; ++at) {
    const std::string_view end = std::string_view(line).substr(at + 1, 2);
    const bool is_mark = end >= "\x80\x8E" && end <= "\x80\x8F";
    const bool is_embedding = end >= "\x80\xAA" && end <= "\x80\xAE";
    const bool is_isolate = end >= "\x81\xA6" && end <= "\x81\xA9";
    if (is_mark || is_embedding || is_isolate) line.replace(at, 3, "?");
  }
  return line;
}

void Problems::add(const Place& place, const std::string& text) {
  if (place.override_number > 0) {
    const auto index = static_cast<std::size_t>(place.override_number) - 1;
    return add_elsewhere(place, "--set " + overrides_.at(index), text);
  }
  std::string where = file_name_;
  if (place.line > 0) where += ":" + std::to_string(place.line);
  if (place.line > 0 && place.column > 0) where += ":" + std::to_string(place.column);
  add_elsewhere(place, where, text);
}

void Problems::add_elsewhere(const Place& place, const std::string& where,
                             const std::string& text) {
  keep({place, one_line(where) + ": " + text});
}

void Problems::keep(Problem problem) {
  const auto is_same = [&](const Problem& known) { return known.line == problem.line; };
  if (std::any_of(list_.begin(), list_.end(), is_same)) return;
  if (list_.size() == most_) {
    is_cut_ = true;
    return;
  }
  list_.push_back(std::move(problem));
}

void Problems::add_file(const Place& place, const Problems& file) {
  for (const Problem& problem : file.sorted()) keep({place, problem.line});
}

std::vector<Problems::Problem> Problems::sorted() const {
  std::vector<Problem> sorted = list_;
  std::stable_sort(sorted.begin(), sorted.end(), [](const Problem& a, const Problem& b) {
    return std::tie(a.place.override_number, a.place.line, a.place.column) <
           std::tie(b.place.override_number, b.place.line, b.place.column);
  });
  return sorted;
}

void Problems::throw_if_any() const {
  if (list_.empty()) return;
  std::string text = one_line(file_name_) + ": " + (is_cut_ ? "more than " : "") +
                     std::to_string(list_.size()) + (list_.size() == 1 ? " problem" : " problems");
  for (const Problem& problem : sorted()) text += "\n" + problem.line;
  throw SetupError(text);
}

}  // namespace palpate
