// SPDX-License-Identifier: Apache-2.0
// threaded_link.h — the ends of a link on threads of their own, for a tick that must not call
// libzmq, which allocates the body of each message and locks its mailboxes.
#pragma once

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <stop_token>
#include <system_error>
#include <thread>

#include "common/core/clock.h"
#include "common/core/messages.h"
#include "common/core/ports.h"
#include "common/core/spsc_ring.h"
#include "common/process/realtime.h"

namespace palpate {

/// Wakes one thread from another. No lock in this process.
class Wake {
 public:
  Wake() : file_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
    if (file_ < 0) throw std::system_error(errno, std::generic_category(), "eventfd");
  }
  ~Wake() { ::close(file_); }
  Wake(const Wake&) = delete;
  Wake& operator=(const Wake&) = delete;

  void set() noexcept {
    const std::uint64_t one = 1;
    static_cast<void>(!::write(file_, &one, sizeof(one)));  // full: it is set already
  }
  /// Returns once it is set, at once if it was since the last call, or after `within`.
  void wait(Duration within) noexcept {
    const auto left = std::max(within, Duration::zero());
    const timespec timeout{.tv_sec = left / std::chrono::seconds(1),
                           .tv_nsec = (left % std::chrono::seconds(1)).count()};
    pollfd entry{.fd = file_, .events = POLLIN, .revents = 0};
    std::uint64_t count = 0;
    if (::ppoll(&entry, 1, &timeout, nullptr) > 0) {
      static_cast<void>(!::read(file_, &count, sizeof(count)));
    }
  }

 private:
  int file_;
};

struct CopyOfMessage {
  template <class T>
  void operator()(const T& from, T& to) const noexcept {
    copy_message(from, to);
  }
};

namespace threaded_link {
inline constexpr std::size_t kWaiting = 8;
inline constexpr Duration kIdle = std::chrono::milliseconds(50);  // how soon a stop is noticed

/// One below the tick, on any processor.
inline void run_below(const RealtimeConfig& tick) {
  enter_realtime({.priority = std::max(tick.priority - 1, 0), .cpu = -1});
}
}  // namespace threaded_link

/// send() only hands the message over: no allocation, no lock, one system call that wakes the
/// thread which sends it.
template <class T>
class ThreadedSender final : public Sender<T> {
 public:
  /// @param out   used by the thread alone from now on; must outlive this
  /// @param tick  the thread runs below it
  ThreadedSender(Sender<T>& out, const RealtimeConfig& tick)
      : thread_([this, &out, tick](const std::stop_token& stop) {
          threaded_link::run_below(tick);
          T message;
          while (!stop.stop_requested()) {
            wake_.wait(threaded_link::kIdle);
            while (waiting_.pop(message)) result_ = out.send(message);
          }
        }) {}

  /// What became of the last message that was sent; kDropped also if too many wait.
  SendResult send(const T& message) noexcept override {
    if (!waiting_.push(message)) return SendResult::kDropped;
    wake_.set();
    return result_;
  }

 private:
  SpscRing<T, CopyOfMessage> waiting_{threaded_link::kWaiting};
  Wake wake_;
  std::atomic<SendResult> result_{SendResult::kSent};
  std::jthread thread_;
};

/// receive() only takes what a thread has received: no allocation, no lock.
template <class T>
class ThreadedSource final : public Source<T> {
 public:
  /// @param in    used by the thread alone from now on; must outlive this
  /// @param tick  the thread runs below it
  ThreadedSource(Source<T>& in, const Clock& clock, const RealtimeConfig& tick)
      : clock_(clock), thread_([this, &in, tick](const std::stop_token& stop) {
          threaded_link::run_below(tick);
          Arrived arrived;
          while (!stop.stop_requested()) {
            in.wait_until(clock_.now() + threaded_link::kIdle);
            while (in.receive(arrived.message, arrived.at)) {
              waiting_.push(arrived);  // one too many: the sequence numbers show it
              wake_.set();
            }
            rejected_ = in.rejected();
            has_lost_peer_ = in.has_lost_peer();
          }
        }) {}

  bool receive(T& message, TimePoint& received_at) noexcept override {
    if (!waiting_.pop(taken_)) return false;
    copy_message(taken_.message, message);
    received_at = taken_.at;
    return true;
  }
  void wait_until(TimePoint deadline) noexcept override {
    if (waiting_.is_empty()) wake_.wait(deadline - clock_.now());
  }
  [[nodiscard]] bool has_lost_peer() const noexcept override { return has_lost_peer_; }
  [[nodiscard]] std::uint64_t rejected() const noexcept override { return rejected_; }

 private:
  struct Arrived {
    T message;
    TimePoint at;
  };
  struct CopyOfArrived {
    void operator()(const Arrived& from, Arrived& to) const noexcept {
      copy_message(from.message, to.message);
      to.at = from.at;
    }
  };

  const Clock& clock_;
  SpscRing<Arrived, CopyOfArrived> waiting_{threaded_link::kWaiting};
  Arrived taken_;
  Wake wake_;
  std::atomic<bool> has_lost_peer_{false};
  std::atomic<std::uint64_t> rejected_{0};
  std::jthread thread_;
};

}  // namespace palpate
