// SPDX-License-Identifier: Apache-2.0
#include "deploy/palpate/study/trial_launch.h"

#include <fcntl.h>
#include <spdlog/fmt/fmt.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <stdexcept>
#include <system_error>
#include <thread>

#include "common/core/clock.h"
#include "common/core/time.h"
#include "common/core/user/files.h"
#include "common/process/run_node.h"
#include "common/process/terminal.h"

namespace palpate {
namespace {

constexpr std::chrono::milliseconds kPoll{20};
constexpr Duration kPatience = std::chrono::seconds(2);
constexpr std::size_t kProbe_bytes = 65'536;  // more than what is left of a full disk
constexpr std::uintmax_t kMostMessages = 1'000'000;

struct Sign {
  const char* words;  // of messages
  const char* cause;
};
constexpr std::array<Sign, 7> kSigns{{
    {"in use by", "a port or address is in use: end the other program that has it"},
    {"port is in use", "a port or address is in use: end the other program that has it"},
    {"is in use: session", "another session runs: end it first"},
    {"is already launched",
     "this session is already launched on this machine, as by another participant: wait for its "
     "end"},
    {"no device ", "a device was not found: is it connected and switched on?"},
    {"event=device_hangs", "the device does not answer: is it connected and switched on?"},
    {"No space left on device", "the disk is full: make room"},
}};

/// What keeps a file from being written there; "" if nothing does.
std::string why_not_writable(const std::filesystem::path& folder) {
  const std::string file = (folder / "probe.tmp").string();
  const int probe = open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  int error = probe < 0 ? errno : 0;
  if (probe >= 0) {
    const std::string bytes(kProbe_bytes, '.');
    for (std::size_t done = 0; error == 0 && done < bytes.size();) {
      const ssize_t count = write(probe, bytes.data() + done, bytes.size() - done);
      if (count < 0 && errno != EINTR) error = errno;
      if (count == 0) error = ENOSPC;
      if (count > 0) done += static_cast<std::size_t>(count);
    }
    if (close(probe) != 0 && error == 0) error = errno;
    unlink(file.c_str());
  }
  return error == 0 ? "" : std::generic_category().message(error);
}

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

std::vector<std::string> harmless_causes(const std::filesystem::path& folder,
                                         const std::filesystem::path& messages) {
  std::vector<std::string> causes;
  const std::string why = why_not_writable(folder);
  if (!why.empty()) causes.push_back(folder.string() + " cannot be written: " + why);
  const std::string said = read_text_file(messages, kMostMessages).bytes;
  for (const Sign& sign : kSigns) {
    const bool is_known = std::find(causes.begin(), causes.end(), sign.cause) != causes.end();
    if (!is_known && said.find(sign.words) != std::string::npos) causes.emplace_back(sign.cause);
  }
  return causes;
}

}  // namespace palpate
