// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstddef>

#include "common/core/user/nearest.h"
#include "deploy/palpate/screen/help.h"

extern "C" const char palpate_glossary[];
extern "C" const char palpate_glossary_end[];

namespace palpate {
namespace {

std::string trimmed(const std::string& text) {
  const std::size_t begin = text.find_first_not_of(" \t\r");
  return begin == std::string::npos
             ? std::string()
             : text.substr(begin, text.find_last_not_of(" \t\r") - begin + 1);
}

/// Markdown as plain text: the text of a link, no marks of code and emphasis.
std::string plain(std::string_view markdown) {
  std::string text;
  for (std::size_t i = 0; i < markdown.size(); ++i) {
    const char c = markdown[i];
    if (c == '\\' && i + 1 < markdown.size()) {
      text += markdown[++i];
    } else if (c == ']' && i + 1 < markdown.size() && markdown[i + 1] == '(') {
      i = std::min(markdown.find(')', i), markdown.size() - 1);
    } else if (c != '`' && c != '*' && c != '[') {
      text += c;
    }
  }
  return trimmed(text);
}

/// The cells of a row "| a | b |"; "\|" does not end one.
std::vector<std::string> cells_of(std::string_view row) {
  std::vector<std::string> cells;
  std::string cell;
  for (std::size_t i = 1; i < row.size(); ++i) {
    if (row[i] == '|' && row[i - 1] != '\\') {
      cells.push_back(cell);
      cell.clear();
    } else {
      cell += row[i];
    }
  }
  return cells;
}

void add_name(std::vector<std::string>& names, const std::string& name) {
  const std::string found = lower_case(plain(name));
  if (!found.empty() && std::find(names.begin(), names.end(), found) == names.end()) {
    names.push_back(found);
  }
}

/// "lease" of "lease"; "f_d" and "f_co" of "f_d, f_co"; "age" of "age (of the force)"; each of
/// "`x_m` `y_m`".
std::vector<std::string> names_of(const std::string& cell) {
  std::vector<std::string> names;
  add_name(names, cell);
  add_name(names, cell.substr(0, cell.find(" (")));
  std::string part;
  bool is_code = false;
  for (const char c : cell + ",") {
    if (c == '`') {
      if (is_code) add_name(names, part);
      is_code = !is_code;
      part.clear();
    } else if (!is_code && (c == ',' || c == '/')) {
      add_name(names, part);
      part.clear();
    } else {
      part += c;
    }
  }
  return names;
}

}  // namespace

std::string_view glossary() {
  return {palpate_glossary, static_cast<std::size_t>(palpate_glossary_end - palpate_glossary)};
}

std::vector<GlossaryEntry> glossary_entries(std::string_view markdown) {
  std::vector<GlossaryEntry> entries;
  std::string section;
  std::vector<std::string> heads;  // of the table, or of what may be one
  bool is_in_table = false;
  bool is_generated = false;
  while (!markdown.empty()) {
    const std::string_view line = markdown.substr(0, markdown.find('\n'));
    markdown.remove_prefix(std::min(line.size() + 1, markdown.size()));
    if (line.starts_with("## ")) section = plain(line.substr(3));
    if (line.starts_with("<!-- ")) is_generated = line.starts_with("<!-- figures: ");
    if (!line.starts_with('|') || is_generated) {
      is_in_table = false;
    } else if (line.starts_with("|---")) {
      is_in_table = true;
    } else if (!is_in_table) {
      heads = cells_of(line);
    } else {
      const std::vector<std::string> cells = cells_of(line);
      if (cells.size() < 2) continue;
      std::string meaning = plain(cells.back());
      std::string unit;
      for (std::size_t i = 0; i < std::min(heads.size(), cells.size()); ++i) {
        if (plain(heads[i]) == "definition") meaning = plain(cells[i]);
        if (plain(heads[i]) == "unit") unit = plain(cells[i]);
      }
      entries.push_back({.term = plain(cells.front()),
                         .names = names_of(cells.front()),
                         .section = section,
                         .meaning = meaning + (unit.empty() ? "" : " [" + unit + "]")});
    }
  }
  return entries;
}

std::vector<GlossaryEntry> explain(const std::vector<GlossaryEntry>& entries,
                                   const std::string& term) {
  const std::string wanted = lower_case(trimmed(term));
  std::vector<GlossaryEntry> found;
  const auto has_name = [&](const GlossaryEntry& entry) {
    return std::find(entry.names.begin(), entry.names.end(), wanted) != entry.names.end();
  };
  const auto contains_it = [&](const GlossaryEntry& entry) {
    return lower_case(entry.term).find(wanted) != std::string::npos;
  };
  std::copy_if(entries.begin(), entries.end(), std::back_inserter(found), has_name);
  if (found.empty() && !wanted.empty()) {
    std::copy_if(entries.begin(), entries.end(), std::back_inserter(found), contains_it);
  }
  return found;
}

}  // namespace palpate
