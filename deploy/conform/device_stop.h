// SPDX-License-Identifier: Apache-2.0
// device_stop.h — a program that moves a device by itself ends on a signal only after it released
// the motors, or says that it could not.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <thread>

namespace palpate {

/// What asks such a program to end. Ctrl-Z is among them: a program that stands still releases
/// nothing.
inline constexpr std::array kDeviceStopSignals{SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGTSTP};

/// nohup stays; a shell that starts a program in the background lets it ignore other signals, too.
[[nodiscard]] bool is_kept_ignored(int signal);

/// A signal has ended a command; what() says how it left the motors.
class Interrupted : public std::runtime_error {
 public:
  Interrupted(int signal, const std::string& text) : std::runtime_error(text), signal_(signal) {}
  /// As shells have it.
  [[nodiscard]] int exit_status() const noexcept { return 128 + signal_; }

 private:
  int signal_;
};

/// While it exists, kDeviceStopSignals request a stop, but for those that is_kept_ignored();
/// further ones change nothing. If it still exists kLongestEnd after the first, a call of the
/// driver does not return: it says so and ends the process. Construct it before other threads,
/// whose masks it sets; at most one at a time.
class DeviceStop {
 public:
  static constexpr auto kLongestEnd = std::chrono::seconds(3);

  /// @param priority  of the thread that drives the device; the signals come ahead of it
  explicit DeviceStop(int priority);
  ~DeviceStop();
  DeviceStop(const DeviceStop&) = delete;
  DeviceStop& operator=(const DeviceStop&) = delete;

  [[nodiscard]] std::stop_token token() const { return source_.get_token(); }
  /// The first that came; 0: none.
  [[nodiscard]] int signal() const noexcept { return signal_; }

 private:
  void wait(int priority);

  sigset_t signals_{};
  sigset_t before_{};
  std::stop_source source_;
  std::atomic<int> signal_ = 0;
  std::atomic<bool> is_over_ = false;
  std::thread thread_;
};

}  // namespace palpate
