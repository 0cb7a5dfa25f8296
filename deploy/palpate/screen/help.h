// SPDX-License-Identifier: Apache-2.0
// help.h — help that is made from the definitions of the commands and from docs/glossary.md: man
// pages, completion for shells, explanations of terms.
#pragma once

#include <CLI/CLI.hpp>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace palpate {

/// For CLI11: every option, every command.
inline constexpr auto kAll = [](const auto*) { return true; };

/// The page of one command, or of all of it, in the format of man(1).
/// @param app      palpate itself
/// @param command  app or a subcommand of it
[[nodiscard]] std::string man_page(const CLI::App& app, const CLI::App& command);

/// Completions after a command, of its arguments without a name, by command.
using ArgumentWords = std::map<std::string, std::vector<std::string>>;

/// The completion of every command and option, and of the values of an option whose type or
/// description ends with a list of them: "NODE:{device,mofc}".
/// @param shell      bash, zsh or fish
/// @param settings   completions after --set: "mofc.mode=", "mofc.mode=guard"
/// @param arguments  instead of files; words with other characters than a-z A-Z 0-9 _ - are left
///                   out
[[nodiscard]] std::string completion(const CLI::App& app, const std::string& shell,
                                     const std::vector<std::string>& settings = {},
                                     const ArgumentWords& arguments = {});

/// An entry of docs/glossary.md, or of the tables of docs/tasks.md and docs/tasks/studies.md,
/// without its marks.
struct GlossaryEntry {
  std::string term;                ///< as written: "f_d, f_co"
  std::vector<std::string> names;  ///< by which it is found, in lower case: "f_d", "f_co"
  std::string section;             ///< "Terms", "CSV columns"
  std::string meaning;
};
/// Its tables in order, but for those of measured figures. A meaning is the cell of the column
/// `definition`, with that of `unit`, else the last one.
[[nodiscard]] std::vector<GlossaryEntry> glossary_entries(std::string_view markdown);
/// The glossary as it was when this program was built.
[[nodiscard]] std::string_view glossary();
/// The entries with that name, else those whose term contains it.
[[nodiscard]] std::vector<GlossaryEntry> explain(const std::vector<GlossaryEntry>& entries,
                                                 const std::string& term);

}  // namespace palpate
