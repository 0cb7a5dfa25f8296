// SPDX-License-Identifier: Apache-2.0
// How a node is stopped: signals and --seconds.
#include <gtest/gtest.h>
#include <sched.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <condition_variable>
#include <csignal>
#include <filesystem>
#include <mutex>
#include <thread>

#include "common/process/realtime.h"
#include "common/process/run_node.h"
#include "tests/support/machine/machine.h"
#include "tests/support/temp_folder.h"

namespace palpate {
namespace {

class RunNodeStop : public testing::Test {
 protected:
  /// Exit status of a node that waits for its stop.
  int run(std::vector<std::string> extra, const std::function<void()>& when_running) {
    std::vector<std::string> arguments = {"fake_node", "--session", session_};
    arguments.insert(arguments.end(), extra.begin(), extra.end());
    std::vector<char*> argv;
    argv.reserve(arguments.size());
    for (std::string& argument : arguments) argv.push_back(argument.data());
    return run_node(static_cast<int>(argv.size()), argv.data(),
                    {.name = "fake", .description = "A node of this test"},
                    [&](NodeContext& context) {
                      when_running();
                      std::mutex mutex;
                      std::unique_lock lock(mutex);
                      std::condition_variable_any stopped;
                      stopped.wait_for(lock, context.stop, test::patience(std::chrono::seconds(20)),
                                       [] { return false; });
                      was_stopped_ = context.stop.stop_requested();
                    });
  }

  void wait_for(const std::atomic<std::uint32_t>& requests, std::uint32_t count) {
    const auto end = std::chrono::steady_clock::now() + test::patience(std::chrono::seconds(20));
    while (requests < count && std::chrono::steady_clock::now() < end) std::this_thread::yield();
    EXPECT_EQ(requests, count);
  }

  test::TempFolder files_;
  std::string session_ = files_.write("session.txtpb", "name: \"run_node_stop_test\"\n");
  bool was_stopped_ = false;
};

TEST_F(RunNodeStop, SigtermEndsTheNodeWithStatusZero) {
  EXPECT_EQ(run({}, [] { kill(getpid(), SIGTERM); }), 0);
  EXPECT_TRUE(was_stopped_);
}

TEST_F(RunNodeStop, CtrlCEndsTheNodeWithStatusZero) {
  EXPECT_EQ(run({}, [] { kill(getpid(), SIGINT); }), 0);
  EXPECT_TRUE(was_stopped_);
}

TEST_F(RunNodeStop, UserSignalsAreRequestsEachTimeAndDoNotEndTheNode) {
  std::string program = "fake_node";
  std::string option = "--session";
  std::array<char*, 3> argv{program.data(), option.data(), session_.data()};
  const int status =
      run_node(3, argv.data(), {.name = "fake", .description = "A node of this test"},
               [&](NodeContext& context) {
                 kill(getpid(), SIGUSR1);
                 wait_for(context.requests.recordings, 1);
                 kill(getpid(), SIGUSR1);
                 wait_for(context.requests.recordings, 2);
                 kill(getpid(), SIGUSR2);
                 wait_for(context.requests.fault_resets, 1);
                 EXPECT_EQ(context.requests.recordings, 2u);
                 EXPECT_FALSE(context.stop.stop_requested());
               });

  EXPECT_EQ(status, 0);
}

// A tick that saturates its processor must not delay the stop.
TEST_F(RunNodeStop, TheThreadOfTheSignalsRunsAheadOfTheTick) {
  constexpr int kPriority = 5;
  if (!may_use_fifo(kPriority + 1)) GTEST_SKIP() << "SCHED_FIFO is not permitted";
  const auto ahead = [] {
    int count = 0;
    for (const auto& thread : std::filesystem::directory_iterator("/proc/self/task")) {
      sched_param parameters{};
      sched_getparam(std::stoi(thread.path().filename()), &parameters);
      if (parameters.sched_priority == kPriority + 1) ++count;
    }
    return count;
  };
  const auto end = std::chrono::steady_clock::now() + test::patience(std::chrono::seconds(20));
  EXPECT_EQ(run({"--set", "realtime.priority=" + std::to_string(kPriority)},
                [&] {
                  while (ahead() != 1 && std::chrono::steady_clock::now() < end) {
                    std::this_thread::yield();
                  }
                  EXPECT_EQ(ahead(), 1);
                  kill(getpid(), SIGTERM);
                }),
            0);
}

// systemd sets it; it outlives a reboot.
TEST_F(RunNodeStop, FlightRecordingsGoToTheFolderOfTheService) {
  const std::string folder = files_.path() / "state";
  setenv("STATE_DIRECTORY", folder.c_str(), 1);
  std::string program = "fake_node";
  std::string option = "--session";
  std::array<char*, 3> argv{program.data(), option.data(), session_.data()};
  EXPECT_EQ(run_node(3, argv.data(), {.name = "fake", .description = "A node of this test"},
                     [&](NodeContext& context) {
                       EXPECT_EQ(flight_files(context, "fake").folder, folder);
                     }),
            0);
  unsetenv("STATE_DIRECTORY");
}

TEST_F(RunNodeStop, TheNodeEndsWhenItsTimeIsUp) {
  EXPECT_EQ(run({"--seconds", "0.01"}, [] {}), 0);
  EXPECT_TRUE(was_stopped_);
}

}  // namespace
}  // namespace palpate
