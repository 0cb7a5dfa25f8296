// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <memory>
#include <set>
#include <sstream>

#include "common/core/check.h"
#include "common/core/user/nearest.h"
#include "common/process/terminal.h"
#include "common/session/file/session_paths.h"
#include "common/session/materials.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/screen/help.h"

namespace palpate {
namespace {

constexpr std::size_t kTextColumns = 80;  ///< without a terminal

void print(const std::string& text) { std::fputs(text.c_str(), stdout); }

/// Breaks a text at spaces into lines of so many columns, indented.
std::string wrapped(const std::string& text, std::size_t columns) {
  std::string out;
  std::string line = "   ";
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find(' ', begin), text.size());
    const std::string word = text.substr(begin, end - begin);
    if (columns_of(line) + 1 + columns_of(word) > columns && line != "   ") {
      out += line + "\n";
      line = "   ";
    }
    line += " " + word;
    begin = end + 1;
  }
  return out + line + "\n";
}

/// Every name by which explain_term() finds something.
std::vector<std::string> explained_names() {
  std::vector<std::string> names = {"materials"};
  for (const TissueMaterial& material : tissue_materials()) names.emplace_back(material.name);
  for (const GlossaryEntry& entry : glossary_entries(glossary())) {
    names.insert(names.end(), entry.names.begin(), entry.names.end());
  }
  return names;
}

int explain_term(const std::string& term) {
  const std::vector<GlossaryEntry> entries = glossary_entries(glossary());
  if (term.empty()) {
    std::string section;
    for (const GlossaryEntry& entry : entries) {
      if (entry.section != section) print(entry.section + "\n");
      section = entry.section;
      print("    " + entry.term + "\n");
    }
    return 0;
  }
  const std::size_t terminal = terminal_columns(STDOUT_FILENO);
  const std::size_t columns = terminal > 0 ? terminal : kTextColumns;
  const auto print_material = [&](const TissueMaterial& material) {
    char value[40];  // NOLINT: for snprintf
    std::snprintf(value, sizeof value, "E = %.3g kPa; ", 1e-3 * material.young_pa);
    print(std::string(material.name) + "  (material of a session)\n" +
          wrapped(value + source_of(material), columns));
  };
  if (term == "materials") {
    if (terminal == 0) {  // a table for documents is too wide for people
      print(materials_table());
    } else {
      for (const TissueMaterial& material : tissue_materials()) print_material(material);
    }
    return 0;
  }
  if (const TissueMaterial* material = material_named(term)) {
    print_material(*material);
    return 0;
  }
  const std::vector<GlossaryEntry> found = explain(entries, term);
  if (found.empty()) {
    const std::string meant = nearest(term, explained_names());
    throw SetupError(
        "explain: \"" + term + "\" is not in the glossary; " +
        (meant.empty() ? "`palpate explain` lists all terms" : "did you mean \"" + meant + "\"?"));
  }
  for (const GlossaryEntry& entry : found) {
    print(entry.term + "  (" + entry.section + ")\n" + wrapped(entry.meaning, columns));
  }
  return 0;
}

/// The command that the words name, e.g. scene check. Throws SetupError.
const CLI::App& command_of(const CLI::App& app, const std::vector<std::string>& words) {
  const CLI::App* command = &app;
  for (const std::string& word : words) {
    std::vector<std::string> names;
    const CLI::App* named = nullptr;
    for (const CLI::App* sub : command->get_subcommands([](const CLI::App*) { return true; })) {
      names.push_back(sub->get_name());
      if (sub->get_name() == word) named = sub;
    }
    if (named == nullptr) {
      const std::string meant = nearest(word, names);
      throw SetupError(
          "\"" + word + "\" is no command; " +
          (meant.empty() ? "`palpate help` lists all" : "did you mean " + meant + "?"));
    }
    command = named;
  }
  return *command;
}

ArgumentWords argument_words(const CLI::App& app) {
  std::vector<std::string> commands;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    commands.push_back(command->get_name());
  }
  // a term of several words is completed word by word
  std::set<std::string> words;
  for (const std::string& name : explained_names()) {
    std::istringstream rest(name);
    for (std::string word; rest >> word;) words.insert(word);
  }
  return {{"completion", {"bash", "zsh", "fish"}},
          {"explain", {words.begin(), words.end()}},
          {"help", commands},
          {"man", commands}};
}

}  // namespace

Command add_explain_command(CLI::App& app) {
  CLI::App& command = *app.add_subcommand("explain",
                                          "explain a term, column, key, metric or material "
                                          "(\"materials\": all); without one, list all");
  auto words = std::make_shared<std::vector<std::string>>();
  command.add_option("TERM", *words, "e.g. transparency, clamp share, f_max_x")->type_name("");
  return {&command, [words](const Verbosity&) {
            std::string term;
            for (const std::string& word : *words) term += (term.empty() ? "" : " ") + word;
            return explain_term(term);
          }};
}

Command add_help_command(CLI::App& app) {
  CLI::App& command = *app.add_subcommand("help", "print the help of a command, like its --help");
  auto words = std::make_shared<std::vector<std::string>>();
  command.add_option("COMMAND", *words, "e.g. launch, scene check")->type_name("");
  return {&command, [&app, words](const Verbosity&) {
            const CLI::App& named = command_of(app, *words);
            std::string name = app.get_name();
            for (const std::string& word : *words) name += " " + word;
            // App::help() of palpate would be that of this command, which was parsed
            print(named.get_formatter()->make_help(&named, name, CLI::AppFormatMode::Normal));
            return 0;
          }};
}

Command add_man_command(CLI::App& app) {
  CLI::App& command =
      *app.add_subcommand("man", "print a manual page: palpate man launch | man -l -");
  auto words = std::make_shared<std::vector<std::string>>();
  command.add_option("COMMAND", *words, "default: palpate itself")->type_name("");
  return {&command, [&app, words](const Verbosity&) {
            print(man_page(app, command_of(app, *words)));
            return 0;
          }};
}

Command add_completion_command(CLI::App& app) {
  CLI::App& command = *app.add_subcommand(
      "completion", "print the completion for a shell: source <(palpate completion bash)");
  auto shell = std::make_shared<std::string>();
  command.add_option("SHELL", *shell, "bash, zsh or fish")->required()->type_name("");
  return {&command, [&app, shell](const Verbosity&) {
            print(completion(app, *shell, session_paths(), argument_words(app)));
            return 0;
          }};
}

}  // namespace palpate
