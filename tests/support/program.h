// program.h — one of the project's programs, run for real by a test.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/support/temp_folder.h"

namespace palpate::test {

/// Started by the constructor; what it prints goes to files, so that it never waits for its reader.
/// The destructor kills it if it still runs, and the kernel does if the test dies.
class Program {
 public:
  static constexpr auto kDeadline = std::chrono::seconds(30);

  /// @param name     of the program in the build's bin folder, or a path
  /// @param network  descriptor of the network namespace it runs in; −1: the test's
  Program(const std::string& name, const std::vector<std::string>& arguments, int network = -1);
  ~Program();
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  [[nodiscard]] pid_t pid() const { return pid_; }
  void send_signal(int signal) const;

  /// Waits for its end. Exit status, or 128 + the signal that killed it; at the deadline it is
  /// killed and the test has failed.
  int wait(std::chrono::milliseconds deadline = kDeadline);

  /// What it has printed so far.
  [[nodiscard]] std::string out() const;
  [[nodiscard]] std::string err() const;

  /// The rest of the line of stderr after the `count`-th `text`, once it is there; a failure of the
  /// test, and "", if it is not there by the deadline or the program ends without it.
  std::string await_err(const std::string& text, int count = 1);

 private:
  bool has_ended(int wait_options);

  TempFolder folder_;
  std::string name_;
  pid_t pid_ = 0;
  int status_ = -1;
  bool has_ended_ = false;
};

struct Outcome {
  int status = -1;
  std::string out;
  std::string err;
};
/// Runs it to its end.
Outcome run_program(const std::string& name, const std::vector<std::string>& arguments);

/// From now on, processes whose parent ends become children of this one instead of init's: so a
/// test can see the orphans that a program leaves behind.
void adopt_orphans();
/// Waits until no child of this process is left, orphans included; false at the deadline.
bool all_children_end(std::chrono::milliseconds deadline = Program::kDeadline);

}  // namespace palpate::test
