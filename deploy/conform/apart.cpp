// SPDX-License-Identifier: Apache-2.0
#include "deploy/conform/apart.h"

#include <fcntl.h>
#include <poll.h>
#include <spdlog/fmt/fmt.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include "common/core/check.h"

namespace palpate {
namespace {

// A record: its kind, its fields behind kField each, kEnd.
constexpr char kField = '\x1f';
constexpr char kEnd = '\x1e';
constexpr char kFound = 'f';    // check, text, remedy, is_good, is_checked
constexpr char kDone = 'd';     // no fields
constexpr char kRefused = 'r';  // what a SetupError says
constexpr char kBroken = 'b';   // what another exception says
constexpr int kPoll_ms = 50;

volatile std::sig_atomic_t child_of_this = 0;

/// SIGUSR2 goes on to the child while this exists; it waits until there is one.
class Forwarding {
 public:
  Forwarding() {
    sigset_t signals;
    sigemptyset(&signals);
    sigaddset(&signals, SIGUSR2);
    pthread_sigmask(SIG_BLOCK, &signals, &mask_before_);
    struct sigaction action {};
    action.sa_handler = [](int signal) { ::kill(child_of_this, signal); };
    action.sa_flags = SA_RESTART;
    sigaction(SIGUSR2, &action, &before_);
  }
  ~Forwarding() { end(); }
  Forwarding(const Forwarding&) = delete;
  Forwarding& operator=(const Forwarding&) = delete;

  void begin(pid_t child) {
    child_of_this = static_cast<std::sig_atomic_t>(child);
    pthread_sigmask(SIG_SETMASK, &mask_before_, nullptr);
  }
  void end() {
    sigaction(SIGUSR2, &before_, nullptr);
    pthread_sigmask(SIG_SETMASK, &mask_before_, nullptr);
  }

 private:
  struct sigaction before_ {};
  sigset_t mask_before_{};
};

void send(int pipe, char kind, const std::vector<std::string>& fields) {
  std::string record(1, kind);
  for (const std::string& field : fields) record.append(1, kField).append(field);
  record += kEnd;
  for (std::size_t sent = 0; sent < record.size();) {
    const ssize_t size = ::write(pipe, record.data() + sent, record.size() - sent);
    if (size < 0 && errno != EINTR) return;  // nobody listens
    if (size > 0) sent += static_cast<std::size_t>(size);
  }
}

[[noreturn]] void end(int pipe, char kind, const std::vector<std::string>& fields) {
  send(pipe, kind, fields);
  std::fflush(nullptr);
  ::_exit(0);
}

[[noreturn]] void work(const ChecksApart& checks, int pipe) {
  const auto on_finding = [pipe](const ConformFinding& found) {
    send(pipe, kFound,
         {found.check, found.text, found.remedy, found.is_good ? "1" : "",
          found.is_checked ? "1" : ""});
  };
  try {
    checks(on_finding, [pipe] { end(pipe, kDone, {}); });
  } catch (const SetupError& error) {
    end(pipe, kRefused, {error.what()});
  } catch (const std::exception& error) {
    end(pipe, kBroken, {error.what()});
  }
  end(pipe, kDone, {});
}

std::vector<std::string> fields_of(const std::string& record) {
  std::vector<std::string> fields;
  for (std::size_t at = record.find(kField); at != std::string::npos;) {
    const std::size_t next = record.find(kField, at + 1);
    fields.push_back(record.substr(at + 1, next == std::string::npos ? next : next - at - 1));
    at = next;
  }
  return fields;
}

/// What the child says, record by record.
class Records {
 public:
  Records(int pipe, pid_t child) : pipe_(pipe), child_(child) {}

  /// None: it has ended.
  std::optional<std::string> next() {
    for (;;) {
      const std::size_t end = text_.find(kEnd);
      if (end != std::string::npos) {
        std::string record = text_.substr(0, end);
        text_.erase(0, end + 1);
        return record;
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
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    forwarding.end();
    ::close(ends[0]);
    if (::getppid() != parent) ::_exit(0);
    work(checks, ends[1]);
  }
  ::close(ends[1]);
  forwarding.begin(child);
  Records records(ends[0], child);
  std::string last;
  std::string problem;
  char ended = 0;
  while (const std::optional<std::string> record = ended == 0 ? records.next() : std::nullopt) {
    const std::vector<std::string> fields = fields_of(*record);
    const char kind = record->empty() ? '\0' : record->front();
    if (kind == kFound && fields.size() == 5) {
      last = fields[0];
      on_finding({.check = fields[0],
                  .is_good = !fields[3].empty(),
                  .text = fields[1],
                  .remedy = fields[2],
                  .is_checked = !fields[4].empty()});
    } else {
      ended = kind;
      if (!fields.empty()) problem = fields[0];
    }
  }
  const int status = records.status();
  ::close(ends[0]);
  if (ended == kRefused) throw SetupError(problem);
  if (ended == kBroken) throw std::runtime_error(problem);
  if (ended == kDone) return true;
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
