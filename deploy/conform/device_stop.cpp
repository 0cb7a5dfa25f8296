// SPDX-License-Identifier: Apache-2.0
#include "deploy/conform/device_stop.h"

#include <unistd.h>

#include <cstdio>
#include <ctime>

#include "common/process/realtime.h"

namespace palpate {
namespace {

constexpr timespec kLook{.tv_sec = 0, .tv_nsec = 20'000'000};

}  // namespace

bool is_kept_ignored(int signal) {
  struct sigaction now {};
  return signal == SIGHUP && sigaction(signal, nullptr, &now) == 0 && now.sa_handler == SIG_IGN;
}

DeviceStop::DeviceStop(int priority) {
  sigemptyset(&signals_);
  for (const int signal : kDeviceStopSignals) {
    if (!is_kept_ignored(signal)) sigaddset(&signals_, signal);
  }
  pthread_sigmask(SIG_BLOCK, &signals_, &before_);
  thread_ = std::thread([this, priority] { wait(priority); });
}

DeviceStop::~DeviceStop() {
  is_over_ = true;
  thread_.join();
  // one that came since then finds the motors limp
  pthread_sigmask(SIG_SETMASK, &before_, nullptr);
}

void DeviceStop::wait(int priority) {
  run_ahead_of(priority);
  while (signal_ == 0) {
    const int signal = sigtimedwait(&signals_, nullptr, &kLook);
    if (signal > 0) signal_ = signal;
    if (is_over_) return;
  }
  source_.request_stop();
  const auto until = std::chrono::steady_clock::now() + kLongestEnd;
  while (!is_over_ && std::chrono::steady_clock::now() < until) nanosleep(&kLook, nullptr);
  if (is_over_) return;
  std::fputs(
      "palpate: stopped, but a call of the driver does not return; the motors may still push: cut "
      "their supply\n",
      stderr);
  std::fflush(nullptr);
  ::_exit(128 + signal_);
}

}  // namespace palpate
