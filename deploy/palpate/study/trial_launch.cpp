// SPDX-License-Identifier: Apache-2.0
#include "deploy/palpate/study/trial_launch.h"

#include <fcntl.h>
#include <spdlog/fmt/fmt.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <stdexcept>
#include <system_error>
#include <thread>

#include "common/core/clock.h"
#include "common/core/time.h"
#include "common/process/run_node.h"
#include "common/process/terminal.h"

namespace palpate {
namespace {

constexpr std::chrono::milliseconds kPoll{20};
constexpr Duration kPatience = std::chrono::seconds(2);

}  // namespace

bool launch_trial(const TrialLaunch& trial) {
  std::vector<std::string> words{"palpate", "launch",   trial.session_file, "--until-task-ends",
                                 "--blind", "--record", trial.recording};
  for (const std::string& one : trial.overrides) words.push_back("--set=" + one);
  if (trial.seconds) words.push_back(fmt::format("--seconds={}", *trial.seconds));
  if (trial.is_quiet) words.emplace_back("--quiet");
  std::vector<char*> arguments;
  arguments.reserve(words.size() + 1);
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  const int messages = open(trial.messages.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (messages < 0) {
    throw std::runtime_error(trial.messages + ": " + std::generic_category().message(errno));
  }
  const pid_t child = fork();
  if (child < 0) {
    const int error = errno;
    close(messages);
    throw std::runtime_error("palpate launch cannot be started: " +
                             std::generic_category().message(error));
  }
  if (child == 0) {
    // a study that is killed leaves no trial behind
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    dup2(messages, STDERR_FILENO);
    execv("/proc/self/exe", arguments.data());
    _exit(kExitFailure);
  }
  close(messages);
  const SteadyClock clock;
  std::optional<TimePoint> stopped_at;
  bool is_passed_on = false;
  int status = 0;
  while (waitpid(child, &status, WNOHANG) == 0) {
    std::this_thread::sleep_for(kPoll);
    if (!StopSignal::is_requested()) continue;
    // Ctrl-C reaches both, and a second signal would not let it end in order
    if (!stopped_at) stopped_at = clock.now();
    if (!is_passed_on && clock.now() - *stopped_at > kPatience) {
      kill(child, SIGTERM);
      is_passed_on = true;
    }
  }
  return WIFEXITED(status) && WEXITSTATUS(status) == 0 && !StopSignal::is_requested();
}

}  // namespace palpate
