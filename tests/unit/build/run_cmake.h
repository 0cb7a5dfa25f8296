// run_cmake.h — small trees in a temporary folder, and cmake run on them.
#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

namespace palpate::test {

/// A new folder that goes when this does.
class TemporaryTree {
 public:
  TemporaryTree() {
    std::string path = (std::filesystem::temp_directory_path() / "palpate_build_XXXXXX").string();
    if (::mkdtemp(path.data()) == nullptr) throw std::runtime_error("no temporary folder");
    root_ = path;
  }
  ~TemporaryTree() {
    std::error_code ignored;  // a folder left over in /tmp fails no test
    std::filesystem::remove_all(root_, ignored);
  }
  TemporaryTree(const TemporaryTree&) = delete;
  TemporaryTree& operator=(const TemporaryTree&) = delete;

  [[nodiscard]] const std::filesystem::path& root() const { return root_; }
  void write(const std::string& file, const std::string& text) const {
    std::filesystem::create_directories((root_ / file).parent_path());
    std::ofstream(root_ / file) << text;
  }

 private:
  std::filesystem::path root_;
};

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
