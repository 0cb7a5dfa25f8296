// SPDX-License-Identifier: Apache-2.0
#include "deploy/conform/apart.h"

#include <fcntl.h>
#include <poll.h>
#include <spdlog/fmt/fmt.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>

#include "common/core/check.h"
#include "common/core/user/utf8.h"
#include "deploy/conform/device_stop.h"

namespace palpate {
namespace {

// A record is a line of JSON, an object with one of these.
constexpr const char* kFound = "found";      // a ConformFinding
constexpr const char* kDone = "done";        // ""
constexpr const char* kRefused = "refused";  // what a SetupError says
constexpr const char* kBroken = "broken";    // what another exception says
constexpr int kPoll_ms = 50;

volatile std::sig_atomic_t child_of_this = 0;
volatile std::sig_atomic_t stop_of_this = 0;  // the first signal that asked for the end

void pass_on(int signal) {
  if (signal != SIGUSR2 && stop_of_this == 0) stop_of_this = signal;
  ::kill(static_cast<pid_t>(child_of_this), signal);
}

/// SIGUSR2 and the signals that ask for the end go on to the child while this exists; they wait
/// until there is one.
class Forwarding {
 public:
  Forwarding() {
    stop_of_this = 0;
    sigset_t signals;
    sigemptyset(&signals);
    for (std::size_t i = 0; i < kSignals.size(); ++i) sigaddset(&signals, kSignals[i]);
    pthread_sigmask(SIG_BLOCK, &signals, &mask_before_);
    struct sigaction action {};
    action.sa_handler = pass_on;
    action.sa_flags = SA_RESTART;
    for (std::size_t i = 0; i < kSignals.size(); ++i) {
      sigaction(kSignals[i], nullptr, &before_[i]);
      if (!is_kept_ignored(kSignals[i])) sigaction(kSignals[i], &action, nullptr);
    }
  }
  ~Forwarding() { end(); }
  Forwarding(const Forwarding&) = delete;
  Forwarding& operator=(const Forwarding&) = delete;

  void begin(pid_t child) {
    child_of_this = static_cast<std::sig_atomic_t>(child);
    pthread_sigmask(SIG_SETMASK, &mask_before_, nullptr);
  }
  void end() {
    for (std::size_t i = 0; i < kSignals.size(); ++i) sigaction(kSignals[i], &before_[i], nullptr);
    pthread_sigmask(SIG_SETMASK, &mask_before_, nullptr);
  }
  /// The first signal that asked for the end; 0: none.
  [[nodiscard]] static int stop() { return stop_of_this; }

 private:
  static constexpr auto kSignals = [] {
    std::array<int, kDeviceStopSignals.size() + 1> all{SIGUSR2};
    std::copy(kDeviceStopSignals.begin(), kDeviceStopSignals.end(), all.begin() + 1);
    return all;
  }();

  std::array<struct sigaction, kSignals.size()> before_{};
  sigset_t mask_before_{};
};

void send(int pipe, const nlohmann::json& record) {
  const std::string line = json_text(record) + "\n";
  for (std::size_t sent = 0; sent < line.size();) {
    const ssize_t size = ::write(pipe, line.data() + sent, line.size() - sent);
    if (size < 0 && errno != EINTR) return;  // nobody listens
    if (size > 0) sent += static_cast<std::size_t>(size);
  }
}

[[noreturn]] void end(int pipe, const char* how, const std::string& text = {}) {
  send(pipe, {{how, text}});
  std::fflush(nullptr);
  ::_exit(0);
}

[[noreturn]] void work(const ChecksApart& checks, int pipe) {
  try {
    checks(
        [pipe](const ConformFinding& found) {
          send(pipe, {{kFound, found}});
        },
        [pipe] { end(pipe, kDone); });
  } catch (const SetupError& error) {
    end(pipe, kRefused, error.what());
  } catch (const std::exception& error) {
    end(pipe, kBroken, error.what());
  }
  end(pipe, kDone);
}

/// The lines that the child writes.
class Lines {
 public:
  Lines(int pipe, pid_t child) : pipe_(pipe), child_(child) {}

  /// None: it has ended.
  std::optional<std::string> next() {
    for (;;) {
      const std::size_t end = text_.find('\n');
      if (end != std::string::npos) {
        std::string line = text_.substr(0, end);
        text_.erase(0, end + 1);
        return line;
      }
      if (is_at_end_) return std::nullopt;
      // a process that the child leaves may hold the pipe: all that it wrote is there when it ends
      if (!status_) {
        int status = 0;
        if (::waitpid(child_, &status, WNOHANG) == child_) status_ = status;
      }
      pollfd input{.fd = pipe_, .events = POLLIN, .revents = 0};
      if (::poll(&input, 1, status_ ? 0 : kPoll_ms) <= 0) {
        is_at_end_ = status_.has_value();
        continue;
      }
      std::array<char, 4096> bytes{};
      const ssize_t size = ::read(pipe_, bytes.data(), bytes.size());
      if (size > 0) text_.append(bytes.data(), static_cast<std::size_t>(size));
      is_at_end_ = size == 0;
    }
  }
  /// Waits for the end of the child.
  int status() {
    int status = 0;
    while (!status_ && ::waitpid(child_, &status, 0) < 0 && errno == EINTR) {
    }
    if (!status_) status_ = status;
    return *status_;
  }

 private:
  int pipe_;
  pid_t child_;
  std::string text_;
  std::optional<int> status_;
  bool is_at_end_ = false;
};

}  // namespace

bool find_apart(const ChecksApart& checks, const OnFinding& on_finding) {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) throw std::system_error(errno, std::generic_category());
  std::fflush(nullptr);
  Forwarding forwarding;
  const pid_t parent = ::getpid();
  const pid_t child = ::fork();
  if (child < 0) throw std::system_error(errno, std::generic_category(), "fork");
  if (child == 0) {
    // the child drives the motors: if this process is killed, it releases them
    forwarding.end();
    std::signal(SIGTERM, SIG_DFL);
    ::prctl(PR_SET_PDEATHSIG, SIGTERM);
    ::close(ends[0]);
    if (::getppid() != parent) ::_exit(0);
    work(checks, ends[1]);
  }
  ::close(ends[1]);
  forwarding.begin(child);
  Lines lines(ends[0], child);
  std::string last;
  nlohmann::json ended;  // null: nothing was said of an end
  while (const auto line = ended.is_null() ? lines.next() : std::nullopt) {
    nlohmann::json record = nlohmann::json::parse(*line, nullptr, false);
    if (record.contains(kFound)) {
      const auto found = record[kFound].get<ConformFinding>();
      last = found.check;
      on_finding(found);
    } else {
      ended = std::move(record);
    }
  }
  const int status = lines.status();
  ::close(ends[0]);
  if (Forwarding::stop() != 0 && !ended.contains(kDone)) {
    std::string how = "the checks were stopped";
    for (const auto& [kind, text] : ended.items()) how = text.get<std::string>();
    throw Interrupted(Forwarding::stop(), how);
  }
  if (ended.contains(kRefused)) throw SetupError(ended[kRefused].get<std::string>());
  if (ended.contains(kBroken)) throw std::runtime_error(ended[kBroken].get<std::string>());
  if (ended.contains(kDone)) return true;
  on_finding({.check = "program",
              .is_good = false,
              .text = fmt::format("the code under test ended its program, {} {}, {}",
                                  WIFSIGNALED(status) ? "by signal" : "with status",
                                  WIFSIGNALED(status) ? WTERMSIG(status) : WEXITSTATUS(status),
                                  last.empty() ? "before the first check had ended"
                                               : "in the check after \"" + last + "\""),
              .remedy = "report an error by the value that a call returns; do not call exit(), and "
                        "look for the crash with a debugger"});
  return false;
}

}  // namespace palpate
