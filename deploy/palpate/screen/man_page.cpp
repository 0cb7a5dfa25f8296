// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cctype>

#include "common/core/user/nearest.h"
#include "common/core/version.h"
#include "deploy/palpate/screen/help.h"

namespace palpate {
namespace {

/// Text of roff: no request at the beginning of a line, no escape.
std::string roff(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '\\') {
      out += "\\e";
    } else if (c == '-') {
      out += "\\-";
    } else if ((c == '.' || c == '\'') && (out.empty() || out.back() == '\n')) {
      out += std::string("\\&") + c;
    } else {
      out += c;
    }
  }
  return out;
}

std::string upper(std::string text) {
  for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return text;
}

/// "palpate-scene-check"
std::string page_name(const CLI::App& command) {
  const std::string& name = command.get_name();
  return command.get_parent() == nullptr ? name : page_name(*command.get_parent()) + "-" + name;
}

std::string spoken_name(const CLI::App& command) {
  std::string name = page_name(command);
  std::replace(name.begin(), name.end(), '-', ' ');
  return name;
}

std::string options_of(const CLI::App& command, bool is_positional) {
  std::string text;
  for (const CLI::Option* option : command.get_options(kAll)) {
    if (option->nonpositional() == is_positional) continue;
    const std::string value = option->get_type_name();
    text += ".TP\n\\fB" + roff(option->get_name(is_positional, !is_positional)) + "\\fR";
    if (!is_positional && option->get_items_expected_max() > 0 && !value.empty()) {
      text += " \\fI" + roff(value) + "\\fR";
    }
    text += "\n" + roff(option->get_description()) + "\n";
  }
  return text;
}

}  // namespace

std::string man_page(const CLI::App& app, const CLI::App& command) {
  std::string text = ".TH " + upper(page_name(command)) + " 1 \"\" \"palpate " +
                     std::string(version()) + "\" \"Palpate\"\n.SH NAME\n" +
                     roff(page_name(command)) + " \\- " + roff(command.get_description()) +
                     "\n.SH SYNOPSIS\n\\fB" + roff(spoken_name(command)) + "\\fR";
  for (const CLI::Option* option : command.get_options(kAll)) {
    if (option->nonpositional()) continue;
    const std::string name = roff(option->get_name(true));
    text += option->get_required() ? " \\fI" + name + "\\fR" : " [\\fI" + name + "\\fR]";
  }
  const auto commands = command.get_subcommands(kAll);
  text += std::string(commands.empty() ? "" : " \\fICOMMAND\\fR") + " [\\fIOPTIONS\\fR]\n";
  if (!commands.empty()) {
    text += ".SH COMMANDS\n";
    for (const CLI::App* sub : commands) {
      text += ".TP\n\\fB" + roff(sub->get_name()) + "\\fR\n" + roff(sub->get_description()) + "\n";
    }
  }
  if (const std::string arguments = options_of(command, true); !arguments.empty()) {
    text += ".SH ARGUMENTS\n" + arguments;
  }
  text += ".SH OPTIONS\n" + options_of(command, false);
  if (&command != &app) text += options_of(app, false);
  text +=
      ".SH EXIT STATUS\n0: done. 1: failed, or something could not be written. 2: a mistake in the "
      "command line or in a file; the message says what to change. 128 + a signal: it ended "
      "identify or conform device; the message says how the motors were left.\n";
  text += ".SH SEE ALSO\n";
  if (&command != &app) {
    text += "\\fB" + roff(app.get_name()) + "\\fR(1)\n";
  } else {
    for (const CLI::App* sub : commands) {
      text += "\\fB" + roff(page_name(*sub)) + "\\fR(1)" + (sub == commands.back() ? "\n" : ",\n");
    }
  }
  return text;
}

}  // namespace palpate
