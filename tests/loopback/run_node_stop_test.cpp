// A node's way to its end: signals and --seconds.
#include <gtest/gtest.h>
#include <unistd.h>

#include <condition_variable>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <mutex>

#include "common/runtime/run_node.h"

namespace palpate {
namespace {

class RunNodeStop : public testing::Test {
 protected:
  RunNodeStop() { std::ofstream(session_) << "name: \"run_node_stop_test\"\n"; }
  ~RunNodeStop() override { std::filesystem::remove(session_); }

  /// Exit status of a node that waits for its stop.
  int run(std::vector<std::string> extra, const std::function<void()>& when_running) {
    std::vector<std::string> arguments = {"fake_node", "--session", session_};
    arguments.insert(arguments.end(), extra.begin(), extra.end());
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    return run_node(
        static_cast<int>(argv.size()), argv.data(),
        {.name = "fake", .description = "A node of this test"}, [&](NodeContext& context) {
          when_running();
          std::mutex mutex;
          std::unique_lock lock(mutex);
          std::condition_variable_any stopped;
          stopped.wait_for(lock, context.stop, std::chrono::seconds(20), [] { return false; });
          was_stopped_ = context.stop.stop_requested();
        });
  }

  std::string session_ =
      testing::TempDir() + "run_node_stop_test_" + std::to_string(getpid()) + ".txtpb";
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

TEST_F(RunNodeStop, TheNodeEndsWhenItsTimeIsUp) {
  EXPECT_EQ(run({"--seconds", "0.01"}, [] {}), 0);
  EXPECT_TRUE(was_stopped_);
}

}  // namespace
}  // namespace palpate
