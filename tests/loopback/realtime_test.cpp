// SPDX-License-Identifier: Apache-2.0
// The whole system on the real clock in one process: run_process of each node on a thread of its
// own, observed by viewers, over every transport.
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>

#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <sstream>
#include <thread>

#include "common/session/session_file.h"
#include "device_node/process.h"
#include "mofc_node/process.h"
#include "physics_node/process.h"
#include "tests/support/port.h"
#include "tests/support/resting_press.h"
#include "tests/support/temp_folder.h"
#include "tests/support/watcher.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;
using test::HeldPort;
using test::rests_in_tissue;
using test::TempFolder;
using test::Watcher;

const std::string kPressing = std::string(test::kRestingPress) + R"(
name: "realtime_test"
realtime { priority: 0 cpu: -1 }
)";
/// Overrides that give every link a free endpoint of the transport.
std::vector<std::string> endpoints(const std::string& transport, const TempFolder& folder) {
  std::vector<std::string> settings;
  std::vector<std::unique_ptr<HeldPort>> held;  // all at once, so that they differ
  for (const std::string link : {"exchange", "tool_motion", "interaction", "device_telemetry",
                                 "mofc_telemetry", "physics_telemetry"}) {
    std::string endpoint = "inproc://" + link;
    if (transport == "ipc") endpoint = "ipc://" + (folder.path() / link).string();
    if (transport == "tcp") {
      endpoint = held.emplace_back(std::make_unique<HeldPort>())->endpoint();
    }
    std::string setting = "links.";
    setting.append(link).append("=").append(endpoint);
    settings.push_back(setting);
  }
  return settings;
}

/// Runs device, mofc and physics until stop() or its destruction.
class RealTime : public testing::TestWithParam<const char*> {
 protected:
  ~RealTime() override { stop(); }

  void start() {
    start("physics", [](NodeContext& context, ProcessLinks& links) {
      physics::run_process(context, links, PhysicsRole::kFirst);
    });
    start("mofc", mofc::run_process);
    start("device", device::run_process);
  }

  /// Ends the nodes; a node that threw fails the test.
  void stop() {
    for (auto& [name, node] : nodes_) {
      node->stop.request_stop();
      node->thread.join();
      try {
        if (node->error) std::rethrow_exception(node->error);
      } catch (const std::exception& e) {
        ADD_FAILURE() << name << ": " << e.what();
      }
    }
    nodes_.clear();
  }

  const Session& session() const { return session_; }
  ProcessLinks& links() { return links_; }
  std::string log_lines() const { return log_text_.str(); }

 private:
  struct Node {
    std::stop_source stop;
    std::unique_ptr<Log> log;
    std::exception_ptr error;
    std::thread thread;
  };

  void start(const std::string& name,
             const std::function<void(NodeContext&, ProcessLinks&)>& run_process) {
    auto& node = nodes_.emplace_back(name, std::make_unique<Node>()).second;
    node->log = std::make_unique<Log>(name, log_sink_);
    node->thread = std::thread([this, run_process, node = node.get()] {
      try {
        SteadyClock clock;
        NodeContext context{.session = session_,
                            .session_id = random_session_id(),
                            .clock = clock,
                            .log = node->log->logger(),
                            .stop = node->stop.get_token()};
        run_process(context, links_);
      } catch (...) {
        node->error = std::current_exception();
      }
    });
  }

  TempFolder folder_;
  Session session_ =
      parse_session(kPressing, "realtime_test.txtpb", endpoints(GetParam(), folder_));
  ProcessLinks links_{session_.side().realtime};
  std::ostringstream log_text_;
  spdlog::sink_ptr log_sink_ = std::make_shared<spdlog::sinks::ostream_sink_mt>(log_text_);
  std::vector<std::pair<std::string, std::unique_ptr<Node>>> nodes_;
};

INSTANTIATE_TEST_SUITE_P(Over, RealTime, testing::Values("inproc", "ipc", "tcp"),
                         [](const auto& tested) { return std::string(tested.param); });

TEST_P(RealTime, ATouchIsRenderedAndShown) {
  Watcher watcher(session(), links());

  start();

  ASSERT_TRUE(watcher.until([&] { return rests_in_tissue(watcher); }));
  EXPECT_TRUE(watcher.sees_all_nodes());
  const TickRow& row = watcher.rows().back();
  EXPECT_TRUE(row.mofc->is_in_contact);
  EXPECT_NEAR(row.device.true_tool_position_world_m.z(), -0.0025, 0.0005);
  EXPECT_GT(watcher.mirror().physics_counters().contact_steps, 0u);
}

TEST_P(RealTime, NoNodeRefusesAFrameOfAnother) {
  Watcher watcher(session(), links());

  start();
  ASSERT_TRUE(watcher.until([&] { return rests_in_tissue(watcher); }));

  const viewer::TelemetryMirror& seen = watcher.mirror();
  EXPECT_EQ(seen.device_counters().force_command.rejected, 0u);
  EXPECT_EQ(seen.mofc_counters().device_state.rejected, 0u);
  EXPECT_EQ(seen.mofc_counters().interaction.rejected, 0u);
  EXPECT_EQ(seen.physics_counters().tool_motion.rejected, 0u);
  EXPECT_EQ(seen.device_counters().device_faults, 0u);
  stop();
  EXPECT_EQ(log_lines().find("rejected"), std::string::npos) << log_lines();
}

TEST_P(RealTime, AViewerThatComesLateSeesTheFiguresWithinASecond) {
  const test::QuietMachine machine;
  start();
  {
    Watcher early(session(), links());
    ASSERT_TRUE(early.until([&] { return rests_in_tissue(early); }));
  }

  Watcher late(session(), links());
  const SteadyClock clock;
  const TimePoint came_at = clock.now();

  EXPECT_TRUE(late.until([&] {
    const viewer::TelemetryFigures figures = late.mirror().figures();
    return late.sees_all_nodes() && figures.is_in_contact && figures.tick_rate_hz > 0.0 &&
           figures.physics_rate_hz > 0.0 &&
           figures.max_applied_newton > test::kRestingNewton - test::kStictionNewton;
  }));
  const Duration took = clock.now() - came_at;
  if (machine.may_check("a late viewer sees the figures within a second")) {
    EXPECT_LT(took, 1s);
  }
  EXPECT_GT(late.mirror().ticks().begin()->first, 0u) << "was not late";
}

TEST_P(RealTime, TwoViewersSeeTheSame) {
  Watcher one(session(), links());
  Watcher other(session(), links());
  start();
  // by turns: who does not receive for a second is forgotten
  while (one.rows().size() < 300 || other.rows().size() < 300) {
    ASSERT_TRUE(one.until_rows(1));
    ASSERT_TRUE(other.until_rows(1));
  }
  ASSERT_TRUE(other.until([&] {
    return !other.rows().empty() &&
           other.rows().back().device.sequence >= one.rows().back().device.sequence;
  }));

  std::map<std::uint64_t, Vector3> force_newton;
  for (const TickRow& row : other.rows()) {
    force_newton[row.device.sequence] = row.device.force_on_hand_newton;
  }
  int compared = 0;
  for (const TickRow& row : one.rows()) {
    const auto same = force_newton.find(row.device.sequence);
    if (same == force_newton.end()) continue;
    EXPECT_EQ(row.device.force_on_hand_newton, same->second);
    ++compared;
  }
  EXPECT_GE(compared, 200);
}

TEST_P(RealTime, TheLoopGoesOnWhenAViewerLeaves) {
  Watcher stays(session(), links());
  auto leaves = std::make_optional<Watcher>(session(), links());
  start();
  ASSERT_TRUE(leaves->until([&] { return rests_in_tissue(*leaves); }));
  ASSERT_TRUE(stays.until([&] { return rests_in_tissue(stays); }));

  leaves.reset();

  const std::uint64_t answered = stays.mirror().device_counters().answered_ticks;
  EXPECT_TRUE(stays.until(
      [&] { return stays.mirror().device_counters().answered_ticks > answered + 200; }));
  EXPECT_TRUE(stays.until([&] { return rests_in_tissue(stays); }));
}

}  // namespace
}  // namespace palpate
