// SPDX-License-Identifier: Apache-2.0
#include "common/session/file/recorded_path.h"
#include "common/core/user/files.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

namespace palpate {

namespace {

constexpr std::uintmax_t kMaxPathFileBytes = 64'000'000;
constexpr int kMaxProblems = 5;
constexpr double kMaxPathSeconds = 1e6;
constexpr double kMaxPathM = 10.0;  // as any length of a session

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(" \t\r");
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(" \t\r") - begin + 1);
}

/// The next part up to `separator`, taken off the front of `rest`.
std::string_view take(std::string_view& rest, char separator) {
  const std::size_t end = std::min(rest.find(separator), rest.size());
  const std::string_view part = rest.substr(0, end);
  rest.remove_prefix(std::min(end + 1, rest.size()));
  return part;
}

/// The four numbers of a line, or what is wrong with it.
std::string read_row(std::string_view line, std::array<double, 4>& row) {
  const auto columns = std::count(line.begin(), line.end(), ',') + 1;
  if (columns != 4) {
    return std::to_string(columns) + (columns == 1 ? " column" : " columns") +
           ": must be 4, t,x,y,z";
  }
  for (std::size_t i = 0; i < row.size(); ++i) {
    double& number = row[i];
    const bool is_time = i == 0;
    const std::string_view text = trimmed(take(line, ','));
    const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (error != std::errc() || stop != text.data() + text.size()) {
      return "'" + one_line(text) + "': must be a number, e.g. -0.0125";
    }
    if (!(std::abs(number) <= (is_time ? kMaxPathSeconds : kMaxPathM))) {
      return "'" + one_line(text) + "': must be a finite number within " +
             (is_time ? "±1e6; t is in seconds" : "±10; x, y, z are in metres");
    }
  }
  return {};
}

}  // namespace

std::vector<RecordedPath::Sample> parse_recorded_path(std::string_view text,
                                                      const std::string& file_name,
                                                      const Place& place, Problems& problems) {
  std::vector<RecordedPath::Sample> samples;
  int line_number = 1;
  int complaints = 0;
  const auto complain = [&](const std::string& what) {
    problems.add_elsewhere(place, file_name + ":" + std::to_string(line_number), what);
    ++complaints;
  };

  std::string header;
  for (const char c : take(text, '\n')) {
    if (trimmed({&c, 1}) != "") header += c;
  }
  if (header != "t,x,y,z") {
    complain("'" + one_line(header) + "': the first line must be t,x,y,z");
    return {};
  }
  for (; !text.empty() && complaints < kMaxProblems;) {
    ++line_number;
    const std::string_view line = trimmed(take(text, '\n'));
    if (line.empty()) continue;
    std::array<double, 4> row{};
    if (const std::string complaint = read_row(line, row); !complaint.empty()) {
      complain(complaint);
      continue;
    }
    if (!samples.empty() && row[0] <= samples.back().t_s) {
      complain("t = " + std::string(trimmed(line.substr(0, line.find(',')))) +
               ": must be later than the line before");
      continue;
    }
    samples.push_back({.t_s = row[0], .position_m = {row[1], row[2], row[3]}});
  }
  if (samples.empty() && complaints == 0) complain("no positions; give at least one line t,x,y,z");
  return samples;
}

std::vector<RecordedPath::Sample> load_recorded_path(const std::filesystem::path& file,
                                                     const Place& place, Problems& problems) {
  const FileContent content = read_text_file(file, kMaxPathFileBytes);
  if (!content.complaint.empty()) {
    problems.add(place, "hand.recorded.file: " + one_line(file.string()) + ": " +
                            content.complaint + " (a path is relative to the session's folder)");
    return {};
  }
  return parse_recorded_path(content.bytes, file.string(), place, problems);
}

}  // namespace palpate
