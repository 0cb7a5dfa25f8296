// SPDX-License-Identifier: Apache-2.0
// supervisor.h — starts child processes, restarts those that die and ends all of them in order.
#pragma once

#include <sys/types.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <list>
#include <map>
#include <string>
#include <vector>

#include "deploy/launch/lifeline.h"

namespace palpate {

/// A program to keep running.
struct ChildSpec {
  std::string name;               ///< for reports: "device"
  std::filesystem::path program;  ///< absolute, or relative to the working directory
  std::vector<std::string> arguments;
  std::vector<std::string> restart_arguments = {};      ///< appended from the second start on
  std::map<std::string, std::string> environment = {};  ///< added to that of the supervisor
  std::filesystem::path folder = {};  ///< its working directory; empty: that of the supervisor
  int descriptor = -1;                ///< a file of the supervisor that it inherits; −1: none
  /// Called before it is started again; a SetupError puts that off until the next try.
  std::function<void()> before_restart = {};
};

struct SupervisorTiming {
  std::chrono::milliseconds stop_grace{2000};     ///< from SIGTERM to SIGKILL, for each child
  std::chrono::milliseconds first_back_off{100};  ///< before a restart; doubles with each …
  std::chrono::milliseconds longest_back_off{2000};
  std::chrono::milliseconds healthy_after{5000};  ///< … until a child has run for so long
};

struct ChildEvent {
  enum class Kind : std::uint8_t {
    kStarted,
    kDied,     ///< unexpectedly, or failed to restart; the next start follows after `restart_in`
    kRefused,  ///< exit status 2: its set-up is wrong; all children are stopped
    kStopped,  ///< on request
    kKilled,   ///< did not stop within the grace, or kill() was called
  };
  Kind kind = Kind::kStarted;
  std::string name = {};
  pid_t pid = 0;
  std::string how = {};  ///< how it ended: "exit status 1", "killed by signal 11 (…)"
  std::chrono::milliseconds restart_in{};
};

/// Starts the children in the given order and restarts those that die. stop() ends them in the
/// stages of `stop_order`, the children of one stage together: SIGTERM, the grace, SIGKILL. The
/// next stage begins when all of the one before have ended or were killed.
///
/// Every child has a process group of its own, so Ctrl-C in a terminal reaches the supervisor only.
/// What a dead child has left in its group is killed before it is started again.
/// The kernel sends the children SIGTERM when the thread that runs the io_context ends for any
/// reason, so that a device can release its motors, and a Lifeline kills what then runs on after
/// its grace. All functions and callbacks run on that thread.
class Supervisor {
 public:
  /// @param stop_order  stages of names of children; children that are missing here are the last
  /// @param on_event    called for every event
  /// @param on_end      called once, when no child is left after stop() or kill()
  Supervisor(boost::asio::io_context& io, std::vector<ChildSpec> children,
             const std::vector<std::vector<std::string>>& stop_order,
             const SupervisorTiming& timing, std::function<void(const ChildEvent&)> on_event,
             std::function<void()> on_end);

  /// Starts all. Throws SetupError if a program cannot be started.
  void start();
  /// Begins to end all children; further calls have no effect.
  void stop();
  /// Kills all children at once with SIGKILL.
  void kill();

  struct Restarts {
    std::string name;
    std::uint64_t count = 0;
    /// It was running when the stop began, or had run for kCameUpAfter at some time.
    bool came_up = false;
  };
  static constexpr std::chrono::milliseconds kCameUpAfter{500};
  /// Of each child, in the order of the constructor's `children`.
  [[nodiscard]] std::vector<Restarts> restarts() const;
  /// True if a child ended with exit status 2: its set-up is wrong.
  [[nodiscard]] bool was_refused() const { return was_refused_; }

 private:
  struct Child {
    Child(boost::asio::io_context& io, ChildSpec spec_) : spec(std::move(spec_)), timer(io) {}
    ChildSpec spec;
    boost::asio::steady_timer timer;  // back-off while it is dead, grace while it is stopping
    pid_t pid = 0;                    // 0: not running
    std::uint64_t restarts = 0;
    std::chrono::milliseconds back_off{};
    std::chrono::steady_clock::time_point started_at;
    bool came_up = false;
    bool was_terminated = false;  // SIGTERM or SIGKILL was sent
    bool was_killed = false;
  };

  void spawn(Child& child);
  void await_deaths();
  void reap();
  void on_death(Child& child, int status);
  void restart_later(Child& child, ChildEvent event);
  void stop_next();
  static void kill(Child& child);

  boost::asio::io_context& io_;
  std::list<Child> children_;
  std::vector<std::vector<Child*>> stages_;  // of the stop
  SupervisorTiming timing_;
  std::function<void(const ChildEvent&)> on_event_;
  std::function<void()> on_end_;
  boost::asio::signal_set deaths_;
  Lifeline lifeline_;
  bool is_stopping_ = false;
  bool has_ended_ = false;
  bool was_refused_ = false;
};

}  // namespace palpate
