// run_cmake.h — cmake run on small trees.
#pragma once

#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>
#include <string>

namespace palpate::test {

struct CmakeResult {
  int status = -1;
  std::string output;  ///< stdout and stderr, white space as single blanks (cmake wraps lines)
};

inline CmakeResult run_cmake(const std::string& arguments) {
  const std::string command = std::string("'" PALPATE_CMAKE "' ") + arguments + " 2>&1";
  CmakeResult result;
  std::FILE* pipe = ::popen(command.c_str(), "r");
  if (pipe == nullptr) return result;
  for (int c = std::fgetc(pipe); c != EOF; c = std::fgetc(pipe)) {
    const bool is_space = c == ' ' || c == '\n';
    if (is_space && result.output.ends_with(' ')) continue;
    result.output += is_space ? ' ' : static_cast<char>(c);
  }
  result.status = WEXITSTATUS(::pclose(pipe));
  return result;
}

}  // namespace palpate::test
