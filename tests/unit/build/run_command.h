// SPDX-License-Identifier: Apache-2.0
// run_command.h — commands run to their end: cmake on small trees, systemd-analyze on units.
#pragma once

#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>
#include <string>

namespace palpate::test {

struct CommandResult {
  int status = -1;
  std::string output;  ///< stdout and stderr, white space as single blanks (cmake wraps lines)
};

inline CommandResult run_command(const std::string& command) {
  CommandResult result;
  std::FILE* pipe = ::popen((command + " 2>&1").c_str(), "r");
  if (pipe == nullptr) return result;
  for (int c = std::fgetc(pipe); c != EOF; c = std::fgetc(pipe)) {
    const bool is_space = c == ' ' || c == '\n';
    if (is_space && result.output.ends_with(' ')) continue;
    result.output += is_space ? ' ' : static_cast<char>(c);
  }
  result.status = WEXITSTATUS(::pclose(pipe));
  return result;
}

inline CommandResult run_cmake(const std::string& arguments) {
  return run_command("'" PALPATE_CMAKE "' " + arguments);
}

}  // namespace palpate::test
