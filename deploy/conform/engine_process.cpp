// SPDX-License-Identifier: Apache-2.0
#include "deploy/conform/engine_process.h"

#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include "common/core/check.h"

namespace palpate {
namespace {

constexpr auto kPoll = std::chrono::milliseconds(2);
constexpr int kCannotStart = 127;

}  // namespace

EngineProcess::EngineProcess(const ChildSpec& program) {
  std::vector<std::string> words{program.program.string()};
  words.insert(words.end(), program.arguments.begin(), program.arguments.end());
  std::vector<std::string> variables;
  for (char** one = environ; *one != nullptr; ++one) variables.emplace_back(*one);
  for (const auto& [name, value] : program.environment) {
    variables.push_back(name);
    variables.back().append("=").append(value);
  }
  const auto pointers = [](std::vector<std::string>& texts) {
    std::vector<char*> all;
    all.reserve(texts.size() + 1);
    for (std::string& text : texts) all.push_back(text.data());
    all.push_back(nullptr);
    return all;
  };
  const std::vector<char*> arguments = pointers(words);
  const std::vector<char*> environment = pointers(variables);
  const std::string folder = program.folder.string();

  pid_ = fork();
  if (pid_ < 0) {
    throw SetupError(words.front() + ": " + std::generic_category().message(errno));
  }
  if (pid_ > 0) return;
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  setpgid(0, 0);  // Ctrl-C reaches the test only
  if (folder.empty() || chdir(folder.c_str()) == 0) {
    execve(arguments.front(), arguments.data(), environment.data());
  }
  _exit(kCannotStart);
}

EngineProcess::~EngineProcess() {
  if (!is_running()) return;
  send_signal(SIGKILL);
  static_cast<void>(wait(std::chrono::seconds(10)));
}

void EngineProcess::send_signal(int signal) const {
  if (!status_) kill(pid_, signal);
}

bool EngineProcess::is_running() {
  if (status_) return false;
  int status = 0;
  if (waitpid(pid_, &status, WNOHANG) != pid_) return true;
  status_ = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
  return false;
}

std::optional<int> EngineProcess::wait(std::chrono::milliseconds deadline) {
  const auto end = std::chrono::steady_clock::now() + deadline;
  while (is_running() && std::chrono::steady_clock::now() < end) std::this_thread::sleep_for(kPoll);
  return status_;
}

std::chrono::nanoseconds EngineProcess::waited() const {
  std::uint64_t longest_ns = 0;
  std::error_code error;
  const std::filesystem::path threads = "/proc/" + std::to_string(pid_) + "/task";
  for (std::filesystem::directory_iterator it(threads, error), end; !error && it != end;
       it.increment(error)) {
    std::uint64_t ran_ns = 0;
    std::uint64_t waited_ns = 0;
    if (std::ifstream(it->path() / "schedstat") >> ran_ns >> waited_ns) {
      longest_ns = std::max(longest_ns, waited_ns);
    }
  }
  return std::chrono::nanoseconds(longest_ns);
}

}  // namespace palpate
