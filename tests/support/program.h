// SPDX-License-Identifier: Apache-2.0
// program.h — runs a program of the project as a process.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "tests/support/temp_folder.h"

namespace palpate::test {

/// The constructor starts the program. Its output goes to files, so that it never waits for a
/// reader. The destructor kills it if it still runs; so does the kernel if the test dies.
class Program {
 public:
  /// More than an idle machine needs for anything; every wait here has test::patience() for it.
  static constexpr auto kAmple = std::chrono::seconds(30);

  /// @param name     of the program in the build's bin folder, or a path
  /// @param network  descriptor of its network namespace; −1: that of the test
  Program(const std::string& name, const std::vector<std::string>& arguments, int network = -1);
  ~Program();
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  [[nodiscard]] pid_t pid() const { return pid_; }
  void send_signal(int signal) const;

  /// Waits for its end. After test::patience(ample) it is killed and the test fails.
  /// @return exit status, or 128 + the signal that killed it
  int wait(std::chrono::milliseconds ample = kAmple);

  /// What it has printed so far.
  [[nodiscard]] std::string out() const;
  [[nodiscard]] std::string err() const;

  /// Waits until stderr contains `text` for the `count`-th time. The test fails if that does not
  /// happen or the program ends before.
  /// @return the rest of that line; "" on failure
  std::string await_err(const std::string& text, int count = 1);

 private:
  bool has_ended(int wait_options);

  TempFolder folder_;
  std::string name_;
  pid_t pid_ = 0;
  int status_ = -1;
  bool has_ended_ = false;
};

/// Waits until `is_so()`; false after test::patience(ample).
bool await(const std::function<bool()>& is_so, std::chrono::milliseconds ample = Program::kAmple);

struct Outcome {
  int status = -1;
  std::string out;
  std::string err;
};
/// Runs a program to its end.
Outcome run_program(const std::string& name, const std::vector<std::string>& arguments);

/// From now on, processes whose parent ends become children of this process instead of init's, so
/// that a test sees orphans that a program leaves behind.
void adopt_orphans();
/// Waits until no child of this process is left, including orphans; false after
/// test::patience(ample).
bool all_children_end(std::chrono::milliseconds ample = Program::kAmple);

}  // namespace palpate::test
