// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cctype>

#include "common/core/check.h"
#include "deploy/palpate/screen/help.h"

namespace palpate {
namespace {

/// The value of an option, as far as a shell can complete it.
enum class Value { kNone, kFile, kSetting, kWord, kOther };

/// Of an option whose type or description ends with "{device,mofc}": "device mofc"; empty: no list.
std::string words_of(const CLI::Option& option) {
  for (const std::string& text : {option.get_type_name(), option.get_description()}) {
    const std::size_t begin = text.find('{');
    if (begin == std::string::npos || text.back() != '}') continue;
    std::string words = text.substr(begin + 1, text.size() - begin - 2);
    std::erase(words, ' ');
    std::replace(words.begin(), words.end(), ',', ' ');
    return words;
  }
  return {};
}

Value value_of(const CLI::Option& option) {
  if (option.get_items_expected_max() == 0) return Value::kNone;
  if (option.check_lname("set")) return Value::kSetting;
  if (!words_of(option).empty()) return Value::kWord;
  const std::string type = option.get_type_name();
  return type.starts_with("FILE") ? Value::kFile : Value::kOther;
}

/// "a, b" in the quotes of a shell: without what ends them or is expanded inside.
std::string quoted(const std::string& text, const std::string& forbidden = "'") {
  std::string out;
  for (const char c : text) {
    if (forbidden.find(c) == std::string::npos) out += c;
  }
  return out;
}

std::vector<std::string> names_of(const CLI::Option& option) {
  std::vector<std::string> names;
  for (const std::string& name : option.get_snames()) names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) names.push_back("--" + name);
  return names;
}

/// Options of a command and those of palpate that may follow it.
std::vector<const CLI::Option*> options_of(const CLI::App& app, const CLI::App& command) {
  std::vector<const CLI::Option*> options = command.get_options(kAll);
  if (&command == &app) return options;
  for (const CLI::Option* option : app.get_options(kAll)) {
    const auto has_it = [&](const CLI::Option* own) {
      return own->get_lnames() == option->get_lnames();
    };
    if (std::none_of(options.begin(), options.end(), has_it)) options.push_back(option);
  }
  return options;
}

/// The words of a command's arguments that need no quotes in a shell; empty: it takes files.
std::string words_of(const ArgumentWords& arguments, const CLI::App& command) {
  std::string words;
  const auto found = arguments.find(command.get_name());
  if (found == arguments.end()) return words;
  for (const std::string& word : found->second) {
    const bool is_plain = std::all_of(word.begin(), word.end(), [](unsigned char c) {
      return c < 0x80 && (std::isalnum(c) != 0 || c == '_' || c == '-');
    });
    if (is_plain) words += (words.empty() ? "" : " ") + word;
  }
  return words;
}

std::string words_of(const CLI::App& app, const CLI::App& command) {
  std::string words;
  for (const CLI::App* sub : command.get_subcommands(kAll)) words += sub->get_name() + " ";
  for (const CLI::Option* option : options_of(app, command)) {
    for (const std::string& name : names_of(*option)) words += name + " ";
  }
  if (!words.empty()) words.pop_back();
  return words;
}

/// @param settings  of --set: "mofc.mode= mofc.mode=guard …"
std::string bash(const CLI::App& app, const std::string& settings, const ArgumentWords& arguments) {
  std::string commands;
  std::string cases = "    '') words='" + words_of(app, app) + "' ;;\n";
  std::string files;
  std::string others;
  std::map<std::string, std::string> values;  // of the options with a list
  std::string no_files;                       // commands whose arguments are words
  const auto note_values = [&](const CLI::App& command) {
    for (const CLI::Option* option : command.get_options(kAll)) {
      const Value value = value_of(*option);
      if (value == Value::kNone) continue;
      for (const std::string& name : names_of(*option)) {
        if (value == Value::kWord) {
          values.try_emplace(name, words_of(*option));
          continue;
        }
        std::string& list = value == Value::kFile ? files : others;
        if (("|" + list + "|").find("|" + name + "|") == std::string::npos) {
          list += (list.empty() ? "" : "|") + name;
        }
      }
    }
  };
  for (const CLI::App* command : app.get_subcommands(kAll)) {
    commands += (commands.empty() ? "" : "|") + command->get_name();
    const std::string own = words_of(arguments, *command);
    if (!own.empty()) no_files += " && $command != " + command->get_name();
    cases += "    " + command->get_name() + ") words='" + own + (own.empty() ? "" : " ") +
             words_of(app, *command) + "' ;;\n";
    note_values(*command);
    for (const CLI::App* sub : command->get_subcommands(kAll)) note_values(*sub);
  }
  std::string lists;
  for (const auto& [name, words] : values) {
    lists.append("    ").append(name).append(") words='").append(words).append("' ;;\n");
  }
  return "# Completion of palpate for bash, made by `palpate completion bash`.\n"
         "_palpate() {\n"
         "  local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD-1]}\n"
         "  local command='' words='' word head=''\n"
         "  COMPREPLY=()\n"
         "  # --set FIELD=VALUE; bash takes the = as a word\n"
         "  local at=$COMP_CWORD key='' settings='" +
         settings +
         "'\n"
         "  if [[ $at -ge 3 && $current == '=' && ${COMP_WORDS[at-2]} == --set ]]; then\n"
         "    key=$previous current=''\n"
         "  elif [[ $at -ge 4 && $previous == '=' && ${COMP_WORDS[at-3]} == --set ]]; then\n"
         "    key=${COMP_WORDS[at-2]}\n"
         "  fi\n"
         "  if [[ -n $key ]]; then\n"
         "    for word in $settings; do\n"
         "      [[ $word == \"$key=$current\"?* || ( -n $current && $word == \"$key=$current\" ) "
         "]] && "
         "COMPREPLY+=(\"${word#*=}\")\n"
         "    done\n"
         "    return\n"
         "  fi\n"
         "  if [[ $previous == --set ]]; then\n"
         "    compopt +o filenames -o nospace 2>/dev/null\n"
         "    for word in $settings; do\n"
         "      # the values once the field is given\n"
         "      [[ $word == \"$current\"* && ( $word == *= || $current == *=* ) ]] && "
         "COMPREPLY+=(\"$word\")\n"
         "    done\n"
         "    return\n"
         "  fi\n"
         "  for word in \"${COMP_WORDS[@]:1:COMP_CWORD-1}\"; do\n"
         "    case $word in " +
         commands +
         ") command=$word; break ;; esac\n"
         "  done\n"
         "  case $previous in\n"
         "    " +
         files +
         ") mapfile -t COMPREPLY < <(compgen -f -- \"$current\"); return ;;\n"
         "    " +
         others + ") return ;;\n" + lists +
         "  esac\n"
         "  if [[ -n $words ]]; then  # one of them, or several with commas\n"
         "    [[ $current == *,* ]] && head=${current%,*},\n"
         "    compopt -o nospace 2>/dev/null\n"
         "    mapfile -t COMPREPLY < <(compgen -P \"$head\" -W \"$words\" -- "
         "\"${current##*,}\")\n"
         "    return\n"
         "  fi\n"
         "  case $command in\n" +
         cases +
         "  esac\n"
         "  mapfile -t COMPREPLY < <(compgen -W \"$words\" -- \"$current\")\n"
         "  if [[ -n $command && $current != -*" +
         no_files +
         " ]]; then\n"
         "    mapfile -t -O ${#COMPREPLY[@]} COMPREPLY < <(compgen -f -- \"$current\")\n"
         "  fi\n"
         "}\n"
         "complete -o filenames -F _palpate palpate\n";
}

std::string zsh(const CLI::App& app, const std::string& settings, const ArgumentWords& arguments) {
  constexpr const char* kForbidden = "'[]:";
  const auto options = [&](const CLI::App& command) {
    std::string text;
    for (const CLI::Option* option : options_of(app, command)) {
      for (const std::string& name : names_of(*option)) {
        text += " \\\n        '" + name + "[" + quoted(option->get_description(), kForbidden) + "]";
        const Value value = value_of(*option);
        if (value != Value::kNone) {
          const std::string type = option->get_type_name();
          text += ":" + quoted(type.substr(0, type.find(":{")), kForbidden) + ":";
          const bool is_list = option->get_delimiter() != '\0';
          if (value == Value::kWord && is_list) text += "_values -s , value " + words_of(*option);
          if (value == Value::kWord && !is_list) text += "(" + words_of(*option) + ")";
          if (value == Value::kFile) text += "_files";
          if (value == Value::kSetting) text += "_palpate_settings";
        }
        text += "'";
      }
    }
    return text;
  };
  std::string commands;
  std::string cases;
  for (const CLI::App* command : app.get_subcommands(kAll)) {
    commands += "    '" + command->get_name() + ":" +
                quoted(command->get_description(), kForbidden) + "'\n";
    std::string subcommands;
    for (const CLI::App* sub : command->get_subcommands(kAll)) {
      subcommands += (subcommands.empty() ? "" : " ") + sub->get_name();
    }
    const std::string own = words_of(arguments, *command);
    cases += "      " + command->get_name() + ")\n        _arguments" + options(*command) +
             (subcommands.empty() ? "" : " \\\n        '1:command:(" + subcommands + ")'") +
             " \\\n        '*:" + (own.empty() ? "file:_files" : "word:(" + own + ")") + "' ;;\n";
  }
  return "#compdef palpate\n# Completion of palpate for zsh, made by `palpate completion zsh`.\n"
         "# --set FIELD=VALUE: the fields, then the values of the one that is given\n"
         "_palpate_settings() {\n"
         "  local key\n"
         "  local -a settings=(" +
         settings +
         ")\n"
         "  if compset -P 1 '*='; then\n"
         "    key=${${IPREFIX#--set=}%=}=\n"
         "    compadd -- ${${(M)settings:#$key?*}#$key}\n"
         "  else\n"
         "    compadd -S '' -- ${(M)settings:#*=}\n"
         "  fi\n"
         "}\n"
         "_palpate() {\n"
         "  local context state state_descr line\n"
         "  typeset -A opt_args\n"
         "  local -a commands=(\n" +
         commands +
         "  )\n"
         "  _arguments -C" +
         options(app) +
         " \\\n        '1:command:->command' \\\n        '*::argument:->argument'\n"
         "  case $state in\n"
         "    command) _describe command commands ;;\n"
         "    argument) case $words[1] in\n" +
         cases +
         "      esac ;;\n"
         "  esac\n"
         "}\n"
         "_palpate \"$@\"\n";
}

std::string fish(const CLI::App& app, const std::string& settings, const ArgumentWords& arguments) {
  std::string text =
      "# Completion of palpate for fish, made by `palpate completion fish`.\n"
      "# --set FIELD=VALUE: the fields, then the values of the one that is given\n"
      "function __palpate_settings\n"
      "  set -l settings " +
      settings +
      "\n"
      "  if string match -q -- '*=*' (commandline -ct)\n"
      "    string match -r -- '^.+=.+$' $settings\n"
      "  else\n"
      "    string match -r -- '^.+=$' $settings\n"
      "  end\n"
      "end\n";
  const auto add = [&](const CLI::Option& option, const std::string& when) {
    text += "complete -c palpate";
    if (!when.empty()) text += " -n '" + when + "'";
    for (const std::string& name : option.get_snames()) text += " -s " + name;
    for (const std::string& name : option.get_lnames()) text += " -l " + name;
    const Value value = value_of(option);
    if (value == Value::kFile) text += " -r -F";
    if (value == Value::kOther) text += " -x";
    if (value == Value::kWord) {
      text += option.get_delimiter() == '\0'
                  ? " -x -a '" + words_of(option) + "'"
                  : " -x -a '(__fish_append , " + words_of(option) + ")'";
    }
    if (value == Value::kSetting) text += " -x -a '(__palpate_settings)'";
    text += " -d '" + quoted(option.get_description()) + "'\n";
  };
  text += "complete -c palpate -n __fish_use_subcommand -f\n";
  for (const CLI::Option* option : app.get_options(kAll)) add(*option, "");
  for (const CLI::App* command : app.get_subcommands(kAll)) {
    text += "complete -c palpate -n __fish_use_subcommand -a " + command->get_name() + " -d '" +
            quoted(command->get_description()) + "'\n";
    const std::string when = "__fish_seen_subcommand_from " + command->get_name();
    if (const std::string own = words_of(arguments, *command); !own.empty()) {
      text.append("complete -c palpate -n '").append(when).append("' -f -a '");
      text.append(own).append("'\n");
    }
    for (const CLI::App* sub : command->get_subcommands(kAll)) {
      text += "complete -c palpate -n '" + when + "' -a " + sub->get_name() + " -d '" +
              quoted(sub->get_description()) + "'\n";
    }
    for (const CLI::Option* option : command->get_options(kAll)) {
      if (option->nonpositional()) add(*option, when);
    }
  }
  return text;
}

}  // namespace

std::string completion(const CLI::App& app, const std::string& shell,
                       const std::vector<std::string>& fields, const ArgumentWords& arguments) {
  std::string settings;
  for (const std::string& field : fields) settings += (settings.empty() ? "" : " ") + field;
  if (shell == "bash") return bash(app, settings, arguments);
  if (shell == "zsh") return zsh(app, settings, arguments);
  if (shell == "fish") return fish(app, settings, arguments);
  throw SetupError("completion: \"" + shell + "\": must be one of bash, zsh, fish");
}

}  // namespace palpate
