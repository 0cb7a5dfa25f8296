// SPDX-License-Identifier: Apache-2.0
#include "deploy/study/key.h"

#include <spdlog/fmt/fmt.h>
#include <sys/random.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstdint>
#include <numeric>
#include <optional>
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
constexpr const char* kHeader = "code,condition,place\n";

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

/// As in the plan.
std::vector<std::size_t> plan_order(std::size_t count) {
  std::vector<std::size_t> order(count);
  std::iota(order.begin(), order.end(), std::size_t{0});
  return order;
}

/// Each order as likely [Fisher and Yates].
template <class T>
void shuffle(std::vector<T>& all) {
  for (std::size_t i = all.size(); i > 1; --i) std::swap(all[i - 1], all[drawn_below(i)]);
}

std::optional<std::size_t> number_in(const std::string& text) {
  std::size_t number = 0;
  const auto end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, number);
  if (error != std::errc() || rest != end) return std::nullopt;
  return number;
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

Key dealt_key(std::size_t conditions) {
  Key key{.codes = letters(conditions), .square = plan_order(conditions)};
  shuffle(key.codes);
  shuffle(key.square);
  return key;
}

std::string key_text(const Plan& plan, const Key& key) {
  std::vector<std::string> lines;
  for (std::size_t place = 0; place < key.square.size(); ++place) {
    const std::size_t condition = key.square[place];
    lines.push_back(fmt::format("{},{},{}\n", key.codes[condition],
                                csv_cell(plan.conditions[condition].name), place + 1));
  }
  std::sort(lines.begin(), lines.end());
  std::string text = kHeader;
  for (const std::string& line : lines) text += line;
  return text;
}

Key key_in(const std::filesystem::path& file, const Plan& plan) {
  const auto refuse = [&](const std::string& what) {
    throw SetupError(file.string() + ": " + what +
                     "; put back the key that was made with this folder, or give another folder "
                     "with --folder");
  };
  const FileContent content = read_text_file(file, kMostKeyBytes);
  if (!content.complaint.empty()) refuse(content.complaint);
  auto rows = rows_of(content.bytes);
  const std::vector<std::string> header{"code", "condition", "place"};
  const std::vector<std::string> older_header{"code", "condition"};
  const bool is_older = !rows.empty() && rows.front() == older_header;
  if (!is_older && (rows.empty() || rows.front() != header)) {
    refuse("does not begin with code,condition,place");
  }
  rows.erase(rows.begin());
  const std::size_t count = plan.conditions.size();
  const std::vector<std::string> known = letters(count);
  Key key{.codes = std::vector<std::string>(count),
          .square = is_older ? plan_order(count) : std::vector<std::size_t>(count, count),
          .is_square_dealt = !is_older};
  for (const std::vector<std::string>& row : rows) {
    if (row.size() != (is_older ? 2 : 3)) refuse("has a row that is not code,condition,place");
    const std::string& code = row[0];
    if (std::find(known.begin(), known.end(), code) == known.end()) {
      refuse("\"" + one_line(code) + "\" is no code of this study, which has A … " + known.back());
    }
    if (std::find(key.codes.begin(), key.codes.end(), code) != key.codes.end()) {
      refuse("code " + code + " is given twice");
    }
    const auto found = std::find_if(
        plan.conditions.begin(), plan.conditions.end(),
        [&](const Condition& one) { return one.name == row[1] || csv_text(one.name) == row[1]; });
    if (found == plan.conditions.end()) {
      refuse("\"" + one_line(row[1]) + "\" is no condition of the plan");
    }
    const auto condition = static_cast<std::size_t>(found - plan.conditions.begin());
    if (!key.codes[condition].empty()) {
      refuse("condition \"" + one_line(row[1]) + "\" is given twice");
    }
    key.codes[condition] = code;
    if (is_older) continue;
    const auto place = number_in(row[2]);
    if (!place || *place < 1 || *place > count) {
      refuse("\"" + one_line(row[2]) + "\" is no place of the order, which has 1 … " +
             std::to_string(count));
    }
    if (key.square[*place - 1] != count) refuse("place " + row[2] + " is given twice");
    key.square[*place - 1] = condition;
  }
  for (std::size_t i = 0; i < count; ++i) {
    if (key.codes[i].empty()) {
      refuse("has no code of \"" + one_line(plan.conditions[i].name) + "\"");
    }
  }
  return key;
}

}  // namespace palpate::study
