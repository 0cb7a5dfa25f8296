// SPDX-License-Identifier: Apache-2.0
// tick_soak — what the tick allocates and how long it waits for locks, over a long session.
//
//   tick_soak [MINUTES]               0.1 minutes each way by default
//   tick_soak MINUTES --together      device and clamp in one thread only
//   tick_soak MINUTES --apart         each in a thread of its own, over libzmq, only
//
// The default session at 1 kHz with physics in a process of its own. The loops of device_node and
// mofc_node run in this program, which replaces malloc and pthread_mutex_lock by ones that count.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "common/core/memory_link.h"
#include "common/link/exchange_client.h"
#include "common/link/exchange_server.h"
#include "common/process/process_links.h"
#include "device_node/process.h"
#include "mofc_node/process.h"
#include "tests/support/alloc_guard.h"
#include "tests/support/machine/lock_watch.h"
#include "tests/support/machine/places.h"
#include "tests/support/program.h"
#include "tests/support/run_folder.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;

double asked_minutes = 0.1;
constexpr std::uint64_t kWarmUpTurns = 2000;  // until queues and buffers have their size

/// One stretch of a loop, on the loop's thread: what it allocates and waits for.
class Stretch {
 public:
  void begin() noexcept {
    mallocs_before_ = test::mallocs_of_this_thread();
    locks_before_ = test::locks_of_this_thread();
    static_cast<void>(test::take_longest_wait());
    has_begun_ = true;
  }
  void end() noexcept {
    if (!has_begun_ || ++turns_ <= kWarmUpTurns) return;
    has_begun_ = false;
    const std::uint64_t mallocs = test::mallocs_of_this_thread() - mallocs_before_;
    mallocs_ += mallocs;
    most_mallocs_ = std::max(most_mallocs_, mallocs);
    const test::LockUse now = test::locks_of_this_thread();
    locks_ += now.locks - locks_before_.locks;
    most_locks_ = std::max(most_locks_, now.locks - locks_before_.locks);
    waits_ += now.waits - locks_before_.waits;
    longest_wait_ = std::max(longest_wait_, test::take_longest_wait());
  }
  void print(const char* what) const {
    const auto turns = static_cast<double>(std::max<std::uint64_t>(counted(), 1));
    std::printf("| %s | %llu | %.3f | %llu | %.3f | %llu | %llu | %.1f |\n", what,
                static_cast<unsigned long long>(counted()), static_cast<double>(mallocs_) / turns,
                static_cast<unsigned long long>(most_mallocs_), static_cast<double>(locks_) / turns,
                static_cast<unsigned long long>(most_locks_),
                static_cast<unsigned long long>(waits_), 1e6 * to_seconds(longest_wait_));
  }
  [[nodiscard]] std::uint64_t counted() const noexcept {
    return turns_ > kWarmUpTurns ? turns_ - kWarmUpTurns : 0;
  }
  [[nodiscard]] std::uint64_t mallocs() const noexcept { return mallocs_; }
  [[nodiscard]] std::uint64_t locks() const noexcept { return locks_; }

 private:
  bool has_begun_ = false;
  std::uint64_t mallocs_before_ = 0;
  test::LockUse locks_before_;
  std::uint64_t turns_ = 0;
  std::uint64_t mallocs_ = 0;
  std::uint64_t most_mallocs_ = 0;
  std::uint64_t locks_ = 0;
  std::uint64_t most_locks_ = 0;
  std::uint64_t waits_ = 0;
  Duration longest_wait_{};
};

/// The loop of device_node, from the state that it sends to the end of its tick, and the rest: its
/// sleep, the reading.
struct DeviceLoop {
  Stretch tick;
  Stretch after;  ///< what is called between both, and counted apart
  Stretch rest;
};

class CountedStates final : public Sender<DeviceState> {
 public:
  CountedStates(Sender<DeviceState>& states, DeviceLoop& loop) : states_(states), loop_(loop) {}
  SendResult send(const DeviceState& state) noexcept override {
    loop_.rest.end();
    loop_.tick.begin();
    return states_.send(state);
  }

 private:
  Sender<DeviceState>& states_;
  DeviceLoop& loop_;
};

void end_tick(DeviceLoop& loop, const std::function<void()>& after) {
  loop.tick.end();
  loop.after.begin();
  after();
  loop.after.end();
  loop.rest.begin();
}

NodeContext mofc_context(NodeContext& context, spdlog::logger& log) {
  return {.session = context.session,
          .session_id = random_session_id(),
          .clock = context.clock,
          .log = log,
          .stop = context.stop,
          .requests = context.requests};
}

class TickSoak : public testing::Test {
 protected:
  TickSoak() {
    std::printf(
        "| stretch | turns | malloc a turn | most | locks a turn | most | waits | longest wait, µs "
        "|\n|---|---|---|---|---|---|---|---|\n");
  }

  /// As device_node would be started.
  void run(const char* name, const std::function<void(NodeContext&)>& body) const {
    const std::string session = test::source_dir() + "/deploy/sessions/default.txtpb";
    std::vector<std::string> arguments{"tick_soak",
                                       "--session",
                                       session,
                                       "--set",
                                       name,
                                       "--seconds",
                                       std::to_string(60.0 * asked_minutes),
                                       "--log-level",
                                       "warn"};
    test::Program physics("physics_node", {arguments.begin() + 1, arguments.begin() + 5});
    std::vector<char*> argv;
    argv.reserve(arguments.size());
    for (std::string& argument : arguments) argv.push_back(argument.data());
    EXPECT_EQ(run_node(static_cast<int>(argv.size()), argv.data(),
                       {.name = "device", .description = "Counts.", .moves_device = true}, body),
              0);
    physics.send_signal(SIGTERM);
    EXPECT_EQ(physics.wait(), 0) << physics.err();
  }

  test::RunFolder run_folder_;
};

TEST_F(TickSoak, TogetherTheTickNeitherAllocatesNorLocks) {
  DeviceLoop loop;
  run("name=soak_together", [&](NodeContext& context) {
    const Log log("mofc");
    NodeContext of_mofc = mofc_context(context, log.logger());
    ZmqContext side(tcp_rules(context.session.security, {KeyRole::kDevice}));
    MemoryLink<DeviceState> states(context.clock);
    MemoryLink<ForceCommand> commands(context.clock);
    const Rejections none;
    mofc::Clamp clamp(of_mofc, side, states, commands, none, mofc::ClampThreads::kOfPhysics);
    commands.on_wait = [&](TimePoint deadline) {
      if (!clamp.answer_next()) context.clock.sleep_until(std::min(deadline, clamp.next_due()));
    };
    CountedStates counted(states, loop);
    device::run_with({.states = counted,
                      .commands = commands,
                      .refused = none,
                      .after_switch = [&] { end_tick(loop, [&] { clamp.finish_turn(); }); }},
                     context, side);
  });

  loop.tick.print("together: from the reading to the end of the tick");
  loop.after.print("together: what can wait until after the switch");
  loop.rest.print("together: sleep and reading");
  ASSERT_GT(loop.tick.counted(), 1000U);
  EXPECT_EQ(loop.tick.mallocs() + loop.after.mallocs() + loop.rest.mallocs(), 0U);
  EXPECT_EQ(loop.tick.locks() + loop.after.locks() + loop.rest.locks(), 0U);
}

TEST_F(TickSoak, ApartLibzmqAllocatesWhatIsStated) {
  DeviceLoop loop;
  Stretch answers;
  Stretch turns;
  run("name=soak_apart", [&](NodeContext& context) {
    const Log log("mofc");
    NodeContext of_mofc = mofc_context(context, log.logger());
    const Session& session = context.session;
    ProcessLinks links(session.side().realtime);
    std::exception_ptr failed;
    const std::jthread mofc([&](const std::stop_token& stop) {
      try {
        ProcessLinks own(session.side().realtime);
        ExchangeServer exchange(own.exchange, context.clock,
                                bind_to(session.side().links.exchange, "links.exchange"));
        mofc::Clamp clamp(of_mofc, own.side, exchange, exchange, exchange.rejections());
        while (!stop.stop_requested()) {
          clamp.wait_until(context.clock.now() + 50ms);
          for (bool is_answered = true; is_answered;) {
            answers.begin();
            is_answered = clamp.answer_next();
            if (is_answered) answers.end();
            turns.begin();
            clamp.finish_turn();
            if (is_answered) turns.end();
          }
        }
      } catch (...) {
        failed = std::current_exception();
      }
    });
    ExchangeClient exchange(links.exchange, context.clock,
                            connect_to(session.side().links.exchange, "links.exchange"));
    CountedStates counted(exchange, loop);
    device::run_with({.states = counted,
                      .commands = exchange,
                      .refused = exchange.rejections(),
                      .after_switch = [&] { end_tick(loop, [] {}); }},
                     context, links.side);
    EXPECT_EQ(failed, nullptr);
  });

  loop.tick.print("device_node: from the reading to the end of the tick");
  loop.rest.print("device_node: sleep and reading");
  answers.print("mofc_node: the answer");
  turns.print("mofc_node: hop 2 and telemetry, after the answer");
  ASSERT_GT(loop.tick.counted(), 1000U);
  // a body each; now and then room in a pipe or a mailbox
  EXPECT_LE(loop.tick.mallocs(), loop.tick.counted() + loop.tick.counted() / 10);
  EXPECT_LE(answers.mallocs(), answers.counted() + answers.counted() / 10);
  EXPECT_EQ(loop.rest.mallocs(), 0U);
  // the mailbox of libzmq, and now and then a turn of its own
  EXPECT_LE(loop.tick.locks(), loop.tick.counted() + loop.tick.counted() / 10);
  EXPECT_LE(answers.locks(), answers.counted() + answers.counted() / 10);
}

}  // namespace
}  // namespace palpate

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  if (argc > 1) palpate::asked_minutes = std::atof(argv[1]);
  const std::string_view which = argc > 2 ? argv[2] : "";
  if (!(palpate::asked_minutes >= 0.1) || argc > 3 ||
      (!which.empty() && which != "--together" && which != "--apart")) {
    std::fprintf(stderr, "tick_soak [MINUTES [--together | --apart]]: at least 0.1 minutes\n");
    return 2;
  }
  if (which == "--together") GTEST_FLAG_SET(filter, "*Together*");
  if (which == "--apart") GTEST_FLAG_SET(filter, "*Apart*");
  return RUN_ALL_TESTS();
}
