// SPDX-License-Identifier: Apache-2.0
#include "deploy/launch/lifeline.h"

#include <poll.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <system_error>

namespace palpate {
namespace {

/// From SIGTERM to SIGKILL: devices release their motors meanwhile.
constexpr int kGrace_ms = 2000;

/// After fork, beside other threads' state: system calls only.
[[noreturn]] void keep_watch(int from) {
  constexpr std::size_t kMostGroups = 1024;
  std::array<pid_t, kMostGroups> groups{};
  // it outlives a terminal and its keys, and holds no socket, file or folder of the supervisor
  setsid();
  if (chdir("/") != 0) _exit(1);
  if (dup2(from, STDIN_FILENO) < 0) _exit(1);
  close_range(STDIN_FILENO + 1, ~0U, 0);
  prctl(PR_SET_NAME, "lifeline");

  pid_t change = 0;  // negative: ended
  for (;;) {
    const ssize_t size = ::recv(STDIN_FILENO, &change, sizeof(change), 0);
    if (size < 0 && errno == EINTR) continue;
    if (size != sizeof(change)) break;
    const pid_t wanted = change > 0 ? 0 : -change;
    auto* const place = std::find(groups.begin(), groups.end(), wanted);
    if (place != groups.end()) *place = std::max(change, 0);
  }
  const auto each_runs = [&groups](int signal) {
    bool is_there = false;
    for (const pid_t group : groups) is_there |= group > 0 && ::kill(-group, signal) == 0;
    return is_there;
  };
  each_runs(SIGTERM);
  constexpr int kLook_ms = 10;
  for (int waited_ms = 0; waited_ms < kGrace_ms && each_runs(0); waited_ms += kLook_ms) {
    ::poll(nullptr, 0, kLook_ms);
  }
  each_runs(SIGKILL);
  _exit(0);
}

}  // namespace

Lifeline::Lifeline() {
  std::array<int, 2> ends{};
  if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()) != 0) {
    throw std::system_error(errno, std::generic_category());
  }
  sigset_t all;
  sigset_t before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);  // no handler runs in the copy
  process_ = fork();
  const int why = errno;
  if (process_ == 0) keep_watch(ends[0]);
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  ::close(ends[0]);
  socket_ = ends[1];
  if (process_ < 0) {
    ::close(socket_);
    throw std::system_error(why, std::generic_category());
  }
}

Lifeline::~Lifeline() {
  ::close(socket_);
  waitpid(process_, nullptr, 0);
}

void Lifeline::add(pid_t group) const {
  static_cast<void>(::send(socket_, &group, sizeof(group), MSG_NOSIGNAL));
}

void Lifeline::remove(pid_t group) const { add(-group); }

}  // namespace palpate
