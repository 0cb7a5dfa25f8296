// SPDX-License-Identifier: Apache-2.0
#include "deploy/study/key.h"

#include <sys/random.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "common/core/check.h"
#include "common/core/problems.h"
#include "common/core/user/files.h"
#include "common/telemetry/csv_writer.h"

namespace palpate::study {
namespace {

constexpr std::uintmax_t kMostKeyBytes = 1'000'000;
constexpr const char* kHeader = "code,condition\n";

/// In [0, n), each as likely. @pre  1 ≤ n ≤ 256
std::size_t drawn_below(std::size_t n) {
  const std::size_t most = 256 - 256 % n;  // of the bytes that are taken
  for (;;) {
    std::uint8_t byte = 0;
    const ssize_t count = getrandom(&byte, 1, 0);
    if (count < 0 && errno != EINTR) {
      throw std::runtime_error("no random numbers for the key of the study: " +
                               std::generic_category().message(errno));
    }
    if (count == 1 && byte < most) return byte % n;
  }
}

std::vector<std::string> letters(std::size_t count) {
  std::vector<std::string> all;
  for (std::size_t i = 0; i < count; ++i) all.emplace_back(1, static_cast<char>('A' + i));
  return all;
}

/// Rows of cells; a cell in quotes may have commas, lines and doubled quotes.
std::vector<std::vector<std::string>> rows_of(const std::string& text) {
  std::vector<std::vector<std::string>> rows;
  std::vector<std::string> row(1);
  bool is_quoted = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '"') {
      const bool is_doubled = is_quoted && i + 1 < text.size() && text[i + 1] == '"';
      if (is_doubled) row.back() += text[++i];
      if (!is_doubled) is_quoted = !is_quoted;
    } else if (is_quoted) {
      row.back() += c;
    } else if (c == ',') {
      row.emplace_back();
    } else if (c == '\n') {
      rows.push_back(std::exchange(row, std::vector<std::string>(1)));
    } else if (c != '\r') {
      row.back() += c;
    }
  }
  if (row.size() > 1 || !row.front().empty()) rows.push_back(std::move(row));
  return rows;
}

}  // namespace

std::vector<std::string> dealt_codes(std::size_t conditions) {
  std::vector<std::string> codes = letters(conditions);
  for (std::size_t i = codes.size(); i > 1; --i) std::swap(codes[i - 1], codes[drawn_below(i)]);
  return codes;
}

std::string key_text(const Plan& plan, const std::vector<std::string>& codes) {
  std::string text = kHeader;
  for (std::size_t i = 0; i < codes.size(); ++i) {
    text += codes[i] + "," + csv_cell(plan.conditions[i].name) + "\n";
  }
  return text;
}

std::vector<std::string> codes_in(const std::filesystem::path& key, const Plan& plan) {
  const auto refuse = [&](const std::string& what) {
    throw SetupError(key.string() + ": " + what +
                     "; put back the key that was made with this folder, or give another folder "
                     "with --folder");
  };
  const FileContent content = read_text_file(key, kMostKeyBytes);
  if (!content.complaint.empty()) refuse(content.complaint);
  auto rows = rows_of(content.bytes);
  const std::vector<std::string> header{"code", "condition"};
  if (rows.empty() || rows.front() != header) refuse("does not begin with code,condition");
  rows.erase(rows.begin());
  const std::vector<std::string> known = letters(plan.conditions.size());
  std::vector<std::string> codes(plan.conditions.size());
  for (const std::vector<std::string>& row : rows) {
    if (row.size() != 2) refuse("has a row that is not code,condition");
    const std::string& code = row[0];
    if (std::find(known.begin(), known.end(), code) == known.end()) {
      refuse("\"" + one_line(code) + "\" is no code of this study, which has A … " + known.back());
    }
    if (std::find(codes.begin(), codes.end(), code) != codes.end()) {
      refuse("code " + code + " is given twice");
    }
    const auto condition = std::find_if(plan.conditions.begin(), plan.conditions.end(),
                                        [&](const Condition& one) { return one.name == row[1]; });
    if (condition == plan.conditions.end()) {
      refuse("\"" + one_line(row[1]) + "\" is no condition of the plan");
    }
    std::string& place = codes[static_cast<std::size_t>(condition - plan.conditions.begin())];
    if (!place.empty()) refuse("condition \"" + one_line(row[1]) + "\" is given twice");
    place = code;
  }
  for (std::size_t i = 0; i < codes.size(); ++i) {
    if (codes[i].empty()) refuse("has no code of \"" + one_line(plan.conditions[i].name) + "\"");
  }
  return codes;
}

}  // namespace palpate::study
