// SPDX-License-Identifier: Apache-2.0
#include "tests/support/program.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <thread>

#include "tests/support/machine/machine.h"
#include "tests/support/machine/places.h"

namespace palpate::test {
namespace {

namespace fs = std::filesystem;
using std::chrono::steady_clock;

constexpr auto kPollInterval = std::chrono::milliseconds(2);

}  // namespace

Program::Program(const std::string& name, const std::vector<std::string>& arguments, int network)
    : name_(name) {
  const std::string path = (fs::path(test::binary_dir()) / name).string();
  const std::string out = (folder_.path() / "out").string();
  const std::string err = (folder_.path() / "err").string();
  std::vector<char*> argv{const_cast<char*>(path.c_str())};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);

  const pid_t test = getpid();
  pid_ = fork();
  if (pid_ != 0) return;

  // between fork and exec: system calls only
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != test) _exit(127);
  if (network >= 0 && setns(network, CLONE_NEWNET) != 0) _exit(127);
  const int nothing = open("/dev/null", O_RDONLY);
  const int out_file = open(out.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_APPEND, 0600);
  const int err_file = open(err.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_APPEND, 0600);
  dup2(nothing, STDIN_FILENO);
  dup2(out_file, STDOUT_FILENO);
  dup2(err_file, STDERR_FILENO);
  execv(argv[0], argv.data());
  _exit(127);
}

Program::~Program() {
  if (has_ended_ || pid_ <= 0) return;
  kill(pid_, SIGKILL);
  has_ended(0);
}

void Program::send_signal(int signal) const {
  if (!has_ended_) kill(pid_, signal);
}

bool Program::has_ended(int wait_options) {
  if (has_ended_) return true;
  int status = 0;
  if (waitpid(pid_, &status, wait_options) != pid_) return false;
  has_ended_ = true;
  status_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return true;
}

int Program::wait(std::chrono::milliseconds ample) {
  const auto begin = steady_clock::now();
  const auto end = begin + patience(ample);
  while (!has_ended(WNOHANG)) {
    if (steady_clock::now() > end) {
      const std::chrono::duration<double> waited = steady_clock::now() - begin;
      ADD_FAILURE() << name_ << " still runs after " << waited.count() << " s\n" << err();
      kill(pid_, SIGKILL);
      has_ended(0);
      break;
    }
    std::this_thread::sleep_for(kPollInterval);
  }
  return status_;
}

std::string Program::out() const { return text_of(folder_.path() / "out"); }
std::string Program::err() const { return text_of(folder_.path() / "err"); }

std::string Program::await_err(const std::string& text, int count) {
  const auto end = steady_clock::now() + patience(kAmple);
  for (;;) {
    const bool is_last_try = has_ended(WNOHANG) || steady_clock::now() > end;
    const std::string printed = err();
    std::size_t at = 0;
    for (int seen = 0; (at = printed.find(text, at)) != std::string::npos;) {
      at += text.size();
      const std::size_t line_end = printed.find('\n', at);
      if (++seen == count && line_end != std::string::npos)
        return printed.substr(at, line_end - at);
    }
    if (is_last_try) {
      ADD_FAILURE() << name_ << " did not print \"" << text << "\" (" << count << ")\n" << printed;
      return "";
    }
    std::this_thread::sleep_for(kPollInterval);
  }
}

bool await(const std::function<bool()>& is_so, std::chrono::milliseconds ample) {
  const auto end = steady_clock::now() + patience(ample);
  while (!is_so()) {
    if (steady_clock::now() > end) return false;
    std::this_thread::sleep_for(kPollInterval);
  }
  return true;
}

Outcome run_program(const std::string& name, const std::vector<std::string>& arguments) {
  Program program(name, arguments);
  Outcome outcome;
  outcome.status = program.wait();
  outcome.out = program.out();
  outcome.err = program.err();
  return outcome;
}

void adopt_orphans() { prctl(PR_SET_CHILD_SUBREAPER, 1); }

bool all_children_end(std::chrono::milliseconds ample) {
  const auto end = steady_clock::now() + patience(ample);
  for (;;) {
    const pid_t ended = waitpid(-1, nullptr, WNOHANG);
    if (ended == -1) return errno == ECHILD;
    if (ended > 0) continue;
    if (steady_clock::now() > end) return false;
    std::this_thread::sleep_for(kPollInterval);
  }
}

}  // namespace palpate::test
