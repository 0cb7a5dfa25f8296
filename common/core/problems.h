// SPDX-License-Identifier: Apache-2.0
// problems.h — the problems of a file of the user: collected, sorted by place, reported together.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace palpate {

/// Where something was written: in the file or in an override of the command line.
struct Place {
  int override_number = 0;  ///< 0: the file; else which override, from 1
  int line = 1;             ///< of the file, from 1; 0: the file as a whole
  int column = 1;           ///< in bytes, from 1; 0: the line as a whole
};

/// The text in one line: control characters, also those of direction, replaced, the middle of a
/// long text left out.
[[nodiscard]] std::string one_line(std::string_view text);

class Problems {
 public:
  static constexpr std::size_t kMostProblems = 100;

  /// @param most  only so many problems are kept
  explicit Problems(std::string file_name, std::vector<std::string> overrides = {},
                    std::size_t most = kMostProblems)
      : file_name_(std::move(file_name)), overrides_(std::move(overrides)), most_(most) {}

  /// `text`: "field = value: rule; remedy". A problem is kept once, although fields that several
  /// sides share are checked for each side.
  void add(const Place& place, const std::string& text);

  /// A problem of another file ("hand.csv:12"), which the session names at `place`.
  void add_elsewhere(const Place& place, const std::string& where, const std::string& text);

  /// All problems of another file, which the session names at `place`.
  void add_file(const Place& place, const Problems& file);

  [[nodiscard]] bool empty() const { return list_.empty(); }

  /// Throws SetupError with all problems, sorted by place, one line each below a count.
  void throw_if_any() const;

 private:
  struct Problem {
    Place place;
    std::string line;
  };
  [[nodiscard]] std::vector<Problem> sorted() const;
  void keep(Problem problem);

  std::string file_name_;
  std::vector<std::string> overrides_;
  std::size_t most_;
  std::vector<Problem> list_;
  bool is_cut_ = false;
};

}  // namespace palpate
