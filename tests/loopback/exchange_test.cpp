// SPDX-License-Identifier: Apache-2.0
// The exchange in real time: wait strategies, allocations, device and mofc in one process.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "common/core/random.h"
#include "common/link/exchange_client.h"
#include "common/link/exchange_server.h"
#include "common/session/session_file.h"
#include "tests/support/alloc_guard.h"
#include "tests/support/machine/places.h"
#include "tests/support/program.h"
#include "tests/support/random_messages.h"
#include "tests/support/resting_press.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"
#include "tests/support/watcher.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using test::AllocGuard;
using test::Outcome;
using test::Program;
using test::rests_in_tissue;
using test::run_program;
using test::TempFolder;
using test::Watcher;
using testing::HasSubstr;

const Duration kPatience = test::patience(5s);  // for events that must happen

// --- wait strategies -------------------------------------------------------------------------

/// A clamp on a thread of its own that answers every state with the position as the force.
class Answering {
 public:
  Answering(ZmqContext& context, const std::string& endpoint)
      : server_(context, clock_, bind_to(endpoint, "links.exchange")),
        thread_([this](const std::stop_token& stop) { answer(stop); }) {}

  /// Largest number of operator new calls in one answer after the first 100 answers.
  [[nodiscard]] std::uint64_t most_allocations() const { return most_allocations_; }
  /// The same of malloc.
  [[nodiscard]] std::uint64_t most_mallocs() const { return most_mallocs_; }

 private:
  void answer(const std::stop_token& stop) {
    DeviceState state;
    TimePoint received_at;
    ForceCommand command;
    command.valid_for = 2ms;
    while (!stop.stop_requested()) {
      server_.wait_until(clock_.now() + 20ms);
      const AllocGuard allocations;
      const std::uint64_t mallocs_before = test::mallocs_of_this_thread();
      if (!server_.receive(state, received_at)) continue;
      command.header = state.header;
      command.answers_session_id = state.header.session_id;
      command.answers_sequence = state.header.sequence;
      command.force_on_hand_newton = state.hand_position_m;
      server_.send(command);
      if (state.header.sequence > 100) {
        most_allocations_ = std::max(most_allocations_.load(), allocations.count());
        most_mallocs_ =
            std::max(most_mallocs_.load(), test::mallocs_of_this_thread() - mallocs_before);
      }
    }
  }

  SteadyClock clock_;
  ExchangeServer server_;
  std::atomic<std::uint64_t> most_allocations_{0};
  std::atomic<std::uint64_t> most_mallocs_{0};
  std::jthread thread_;
};

class Exchanging : public testing::TestWithParam<WaitStrategy> {
 protected:
  static DeviceState state_of(std::uint64_t sequence) {
    DeviceState state;
    state.header = {.session_id = 1, .sequence = sequence, .sampled_at = TimePoint(1s)};
    state.hand_position_m = Vector3(0.0, 0.0, 1e-6 * static_cast<double>(sequence));
    return state;
  }

  /// The next command; false if none comes.
  bool await(ExchangeClient& device, ForceCommand& command) {
    TimePoint received_at;
    const TimePoint deadline = clock_.now() + kPatience;
    while (!device.receive(command, received_at)) {
      if (clock_.now() >= deadline) return false;
      device.wait_until(deadline);
    }
    return true;
  }

  TempFolder folder_;
  std::string endpoint_ = "ipc://" + (folder_.path() / "exchange").string();
  SteadyClock clock_{GetParam()};
  ZmqContext context_{RealtimeConfig{.priority = 0, .cpu = -1, .wait = GetParam()}};
};

std::string name_of(const testing::TestParamInfo<WaitStrategy>& tested) {
  constexpr std::array kNames{"Hybrid", "Spin", "Block"};
  return kNames.at(static_cast<std::size_t>(tested.param));
}
INSTANTIATE_TEST_SUITE_P(Waiting, Exchanging,
                         testing::Values(WaitStrategy::kHybrid, WaitStrategy::kSpin,
                                         WaitStrategy::kBlock),
                         name_of);

TEST_P(Exchanging, EveryStateHasItsAnswer) {
  const Answering mofc(context_, endpoint_);
  ExchangeClient device(context_, clock_, connect_to(endpoint_, "links.exchange"));
  ASSERT_TRUE(device.wait_for_peer(kPatience));

  for (std::uint64_t n = 0; n < 300; ++n) {
    ASSERT_EQ(device.send(state_of(n)), SendResult::kSent);
    ForceCommand command;
    ASSERT_TRUE(await(device, command)) << "state " << n;
    EXPECT_EQ(command.answers_sequence, n);
    EXPECT_EQ(command.force_on_hand_newton, state_of(n).hand_position_m);
  }
}

TEST_P(Exchanging, WithoutAnAnswerTheWaitEndsAtItsDeadline) {
  const Answering mofc(context_, endpoint_);
  ExchangeClient device(context_, clock_, connect_to(endpoint_, "links.exchange"));
  ASSERT_TRUE(device.wait_for_peer(kPatience));
  ForceCommand command;
  TimePoint received_at;

  const TimePoint deadline = clock_.now() + 2ms;
  while (clock_.now() < deadline) device.wait_until(deadline);  // wait_until may return early
  const TimePoint returned_at = clock_.now();

  EXPECT_FALSE(device.receive(command, received_at));
  EXPECT_LT(returned_at - deadline, kPatience);
}

TEST_P(Exchanging, SleepUntilNeverReturnsEarly) {
  for (const Duration ahead : {-1ms, 0ms, 1ms, 3ms}) {
    const TimePoint due = clock_.now() + ahead;
    clock_.sleep_until(due);
    EXPECT_GE(clock_.now(), due);
  }
}

// libzmq mallocs the body of each frame that it sends, and now and then room for its queues;
// otherwise neither end allocates.
TEST_P(Exchanging, InSteadyStateNeitherEndUsesOperatorNewAndLibzmqMallocsWhatIsStated) {
  constexpr std::uint64_t kMostMallocs = 3;  // a body, room in the pipe, room in a mailbox
  constexpr std::uint64_t kCounted = 899;
  const Answering mofc(context_, endpoint_);
  ExchangeClient device(context_, clock_, connect_to(endpoint_, "links.exchange"));
  ASSERT_TRUE(device.wait_for_peer(kPatience));
  std::uint64_t most_allocations = 0;
  std::uint64_t most_mallocs = 0;
  std::uint64_t all_mallocs = 0;

  for (std::uint64_t n = 0; n < 1000; ++n) {
    const DeviceState state = state_of(n);
    ForceCommand command;
    const AllocGuard allocations;
    const std::uint64_t mallocs_before = test::mallocs_of_this_thread();
    ASSERT_EQ(device.send(state), SendResult::kSent);
    ASSERT_TRUE(await(device, command));
    if (n > 100) {
      const std::uint64_t mallocs = test::mallocs_of_this_thread() - mallocs_before;
      most_allocations = std::max(most_allocations, allocations.count());
      most_mallocs = std::max(most_mallocs, mallocs);
      all_mallocs += mallocs;
    }
  }

  RecordProperty("device_most_mallocs", std::to_string(most_mallocs));
  RecordProperty("device_all_mallocs", std::to_string(all_mallocs));
  RecordProperty("mofc_most_mallocs", std::to_string(mofc.most_mallocs()));
  EXPECT_EQ(most_allocations, 0u);
  EXPECT_EQ(mofc.most_allocations(), 0u);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  EXPECT_GE(all_mallocs, kCounted) << "the calls inside libzmq are not counted";
#endif
  EXPECT_LE(all_mallocs, kCounted + kCounted / 10);  // room: rarely
  EXPECT_LE(most_mallocs, kMostMallocs);
  EXPECT_LE(mofc.most_mallocs(), kMostMallocs);
}

// --- device and mofc in one process -----------------------------------------------------------

/// The hand at rest in tissue.
const std::string kPress = std::string(test::kRestingPress) + R"(
name: "together"
realtime { priority: 0 cpu: -1 wait: block }
)";

class Together : public testing::Test {
 protected:
  [[nodiscard]] json summary() const {
    return json::parse(std::ifstream(files_.path() / "run.json"));
  }
  [[nodiscard]] std::string json_file() const { return (files_.path() / "run.json").string(); }

  test::RunFolder run_folder_;
  TempFolder files_;
  std::string press_ = files_.write("press.txtpb", kPress);
};

TEST_F(Together, TheForceIsRenderedAndAllNodesAreSeen) {
  ProcessLinks links({.priority = 0, .cpu = -1});
  Watcher watcher(load_session(press_), links);
  Program launch("palpate", {"launch", press_, "--together", "device,mofc", "--no-viewer", "--json",
                             json_file()});

  EXPECT_TRUE(watcher.until([&] { return rests_in_tissue(watcher) && watcher.sees_all_nodes(); }));
  launch.send_signal(SIGTERM);

  EXPECT_EQ(launch.wait(), 0) << launch.err();
  EXPECT_EQ(summary()["restarts"], json({{"physics", 0}, {"device_mofc", 0}}));
  EXPECT_TRUE(std::filesystem::is_empty(run_folder_.path())) << "the launch left files";
}

TEST_F(Together, WhenItIsKilledItIsReportedAndRestarted) {
  ProcessLinks links({.priority = 0, .cpu = -1});
  Watcher watcher(load_session(press_), links);
  Program launch("palpate", {"launch", press_, "--together", "mofc,device", "--no-viewer", "--json",
                             json_file()});
  ASSERT_TRUE(watcher.until([&] { return rests_in_tissue(watcher); }));

  const std::string pid = launch.await_err("event=node_started node=device_mofc pid=");
  ASSERT_GT(std::stoi(pid), 1);
  kill(std::stoi(pid), SIGKILL);

  launch.await_err("event=node_died node=device_mofc how=\"killed by signal 9 (Killed)\"");
  EXPECT_TRUE(watcher.until([&] {
    return watcher.mirror().device_link().sessions == 2 &&
           watcher.mirror().mofc_link().sessions == 2 && rests_in_tissue(watcher);
  }));
  launch.send_signal(SIGTERM);
  EXPECT_EQ(launch.wait(), 0) << launch.err();
  EXPECT_EQ(summary()["restarts"], json({{"physics", 0}, {"device_mofc", 1}}));
}

// A state that the fault line delays by 1 ms is answered within the tick, 2 ms after the reading;
// one delayed by 4 ms is not.
TEST_F(Together, FaultsOfTheExchangeActAsBetweenProcesses) {
  const auto run = [&](const std::string& delay_ms, std::uint64_t least_answered) {
    ProcessLinks links({.priority = 0, .cpu = -1});
    Watcher watcher(load_session(press_), links);
    Program launch("palpate",
                   {"launch", press_, "--together", "device,mofc", "--no-viewer", "--set",
                    "device.reply_us=2000", "--set", "faults.device_state.delay_ms=" + delay_ms,
                    "--json", json_file(), "--overwrite"});
    const DeviceCounters& counters = watcher.mirror().device_counters();
    EXPECT_TRUE(watcher.until([&] {
      return counters.loop.ticks > 200 && counters.answered_ticks >= least_answered;
    })) << launch.err();
    launch.send_signal(SIGTERM);
    EXPECT_EQ(launch.wait(), 0) << launch.err();
    return summary()["answered_ratio"].get<double>();
  };

  const test::QuietMachine machine;
  const double answered = run("1", 1);
  EXPECT_GT(answered, 0.0);
  if (machine.may_check("most ticks answered")) {
    EXPECT_GT(answered, 0.5);
  }
  EXPECT_EQ(run("4", 0), 0.0);
}

TEST_F(Together, OtherNodesCannotShareAProcess) {
  for (const char* nodes : {"device", "mofc", "device,physics", "device,mofc,physics",
                            "device,mofc,mofc", "device,mofx", ""}) {
    SCOPED_TRACE(nodes);
    const Outcome launch =
        run_program("palpate", {"launch", press_, "--seconds", "1", "--together", nodes});
    EXPECT_EQ(launch.status, 2);
    EXPECT_THAT(launch.err, HasSubstr("--together"));
    EXPECT_THAT(launch.err, HasSubstr("give device,mofc"));
  }
}

TEST_F(Together, FourKilohertzAreAnswered) {
  const test::QuietMachine machine;
  const std::string session = test::source_dir() + "/deploy/sessions/default.txtpb";

  const Outcome launch = run_program(
      "palpate", {"launch", session, "--together", "device,mofc", "--no-viewer", "--seconds", "4",
                  "--set", "device.rate_hz=4000", "--json", json_file()});

  ASSERT_EQ(launch.status, 0) << launch.err;
  const double answered = summary()["answered_ratio"];
  EXPECT_GT(answered, 0.0);
  if (machine.may_check("95 % of the ticks answered")) {
    EXPECT_GT(answered, 0.95);
  }
}

}  // namespace
}  // namespace palpate
