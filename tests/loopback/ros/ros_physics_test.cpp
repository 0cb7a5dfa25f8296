// SPDX-License-Identifier: Apache-2.0
// `palpate ros physics`: a node of another vendor's DDS as the tissue, and all that it may do
// wrong.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "common/session/session_file.h"
#include "tests/loopback/ros/ros_support.h"
#include "tests/support/machine/machine.h"
#include "tests/support/pressing_hand.h"
#include "tests/support/program.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"
#include "tests/support/text.h"
#include "tests/support/watcher.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;
using test::newton;
using testing::HasSubstr;

/// A hand that presses every 0.7 s, 10 mm deep if nothing pushes back.
std::string session_text(const std::string& domain) {
  return R"(
name: "ros_physics"
device { rate_hz: 1000 simulated {} }
hand {
  sinusoid { center_m { z: 0 } amplitude_m { z: 0.01 } frequency_hz { z: 1.4 } phase_rad { z: 1.57 } }
}
mofc { controller: mofc mode: guard }
scene { tool { tip_radius_m: 0.003 } }
physics {
  rate_hz: 1000
  command: ["palpate_ros", "physics", "--domain", ")" +
         domain + "\"]\n}\n";
}

constexpr double kFeltNewton = 0.15;
bool is_felt(const TickRow& row) { return test::is_fresh(row) && newton(row) > kFeltNewton; }
/// The hand is in the tissue, mofc_node has lost physics, and there is no force.
bool is_over(const TickRow& row) {
  return row.device.is_answered && row.mofc && !test::hears_physics(row) && newton(row) == 0.0 &&
         row.device.true_tool_position_world_m.z() < -0.002;
}

class RosPhysics : public testing::Test {
 protected:
  void launch() {
    watcher_.emplace(load_session(file_), links_);
    launch_.emplace("palpate", std::vector<std::string>{"launch", file_, "--no-viewer", "--json",
                                                        path("run.json")});
    ASSERT_FALSE(launch_->await_err("event=ros domain=").empty()) << launch_->err();
  }
  std::unique_ptr<test::Program> source(const std::string& fault) {
    return std::make_unique<test::Program>(
        "fast_dds_peer", std::vector<std::string>{domain_, "palpate", "source", fault});
  }
  [[nodiscard]] std::string path(const std::string& name) const {
    return (files_.path() / name).string();
  }
  /// The first tick from now on that is so; null: none.
  const TickRow* await_tick(bool (*is_so)(const TickRow&)) {
    const TimePoint from = SteadyClock().now();
    std::size_t next = watcher_->rows().size();
    const auto is_it = [&](const TickRow& row) {
      return row.device.sampled_at >= from && is_so(row);
    };
    const bool is_found = watcher_->until([&] {
      const std::vector<TickRow>& rows = watcher_->rows();
      while (next < rows.size() && !is_it(rows[next])) ++next;
      return next < rows.size();
    });
    return is_found ? &watcher_->rows()[next] : nullptr;
  }
  void end(test::Program& peer) {
    peer.send_signal(SIGTERM);
    EXPECT_EQ(peer.wait(), 0) << peer.err();
  }
  /// What holds whatever the source does.
  void stop() {
    launch_->send_signal(SIGTERM);
    EXPECT_EQ(launch_->wait(), 0) << launch_->err();
    const nlohmann::json run = nlohmann::json::parse(test::text_of(path("run.json")));
    EXPECT_GE(run["min_true_energy_j"], -test::kRoundingJoule);
    for (const auto& [node, count] : run["restarts"].items()) EXPECT_EQ(count, 0) << node;
    for (const TickRow& row : watcher_->rows()) {
      ASSERT_GE(row.device.minimum_true_energy_joule, -test::kRoundingJoule);
    }
  }

  test::RunFolder run_folder_;
  test::TempFolder files_;
  std::string domain_ = test::ros_domain();
  std::string file_ = files_.write("ros_physics.txtpb", session_text(domain_));
  ProcessLinks links_{{.priority = 0, .cpu = -1}};
  std::optional<test::Watcher> watcher_;
  std::optional<test::Program> launch_;
};

TEST_F(RosPhysics, ANodeOfAnotherVendorIsFelt) {
  launch();
  const auto peer = source("");
  EXPECT_NE(await_tick(is_felt), nullptr) << launch_->err() << peer->err();
  EXPECT_TRUE(watcher_->until_rows(1000));
  end(*peer);
  EXPECT_NE(await_tick(is_over), nullptr) << launch_->err();
  stop();
  EXPECT_THAT(launch_->err(), HasSubstr("event=force_source topic=palpate/measured_cf"));
  EXPECT_THAT(launch_->err(), HasSubstr("event=ros_physics topics=palpate"));
}

/// What it may do, whether a force is left, and what is said of it.
struct Fault {
  const char* name;
  bool is_felt_on;
  const char* line;
};
class RosFaults : public RosPhysics, public testing::WithParamInterface<Fault> {};

// A force that no longer counts is gone mofc.stale_after_ms (150) and mofc.fade_ms (50) after the
// last one that did.
TEST_P(RosFaults, GivesNoEnergyAndNoForceThatDoesNotCount) {
  const Fault& fault = GetParam();
  launch();
  const auto peer = source(fault.name);
  ASSERT_NE(await_tick(is_felt), nullptr) << launch_->err() << peer->err();

  const test::QuietMachine machine;
  peer->send_signal(SIGUSR1);
  if (fault.is_felt_on) {
    ASSERT_TRUE(watcher_->until_rows(1500));
    EXPECT_NE(await_tick(is_felt), nullptr) << launch_->err();
  } else {
    const TickRow* over = await_tick(is_over);
    ASSERT_NE(over, nullptr) << launch_->err();
    ASSERT_TRUE(watcher_->until_rows(1500));
    // the last tick with a force
    const std::vector<TickRow>& rows = watcher_->rows();
    const auto last = std::find_if(rows.rbegin(), rows.rend(),
                                   [](const TickRow& row) { return newton(row) > 0.0; });
    ASSERT_NE(last, rows.rend());
    EXPECT_LT(last->device.sampled_at, rows.back().device.sampled_at - 1s);
    ASSERT_TRUE(last->mofc);
    if (machine.may_check("how long a force lasts that no longer counts")) {
      // since the state that it answers; the answer came a few ms later, and a lease is 10 ms
      EXPECT_LT(last->mofc->force_age, 150ms + 50ms + 20ms);
    }
  }
  EXPECT_THAT(launch_->err(), HasSubstr(fault.line));
  end(*peer);
  stop();
}

INSTANTIATE_TEST_SUITE_P(
    Each, RosFaults,
    testing::Values(Fault{"stop", false, "event=force_source_silent topic=palpate/measured_cf"},
                    Fault{"repeat", false, "or not later than that of the last one"},
                    Fault{"nan", false, "a component is missing, NaN or infinite"},
                    Fault{"huge", false, "it is above --max-force; is it in newton?"},
                    Fault{"late", true, ""}, Fault{"too_late", false, ""}, Fault{"lose", true, ""},
                    Fault{"reorder", true, "or not later than that of the last one"}),
    [](const auto& fault) { return std::string(fault.param.name); });

/// What is wrong from the begin on: no force, and a line that says why.
struct Misfit {
  const char* name;
  const char* line;
};
class RosMisfits : public RosPhysics, public testing::WithParamInterface<Misfit> {};

TEST_P(RosMisfits, AreNamedAndNotFelt) {
  launch();
  const auto peer = source(GetParam().name);
  EXPECT_FALSE(launch_->await_err(GetParam().line).empty()) << launch_->err();
  ASSERT_TRUE(watcher_->until_rows(1000));
  // forces of up to 0.25 N per mm of depth, which mN make 1000 times as large
  for (const TickRow& row : watcher_->rows()) ASSERT_LE(newton(row), kFeltNewton);
  end(*peer);
  stop();
}

INSTANTIATE_TEST_SUITE_P(
    Each, RosMisfits,
    testing::Values(Misfit{"wrong_hash", "is RIHS01_0000000000000000000000000000000000000000"},
                    Misfit{"wrong_type", "its type is geometry_msgs::msg::dds_::PoseStamped_, "},
                    Misfit{"other_frame",
                           "reason=\"its frame_id is neither that of the world nor "}),
    [](const auto& misfit) { return std::string(misfit.param.name); });

// Forces in mN: those of more than 0.1 N are above 100 "N".
TEST_F(RosPhysics, ForcesInAnotherUnitAreRefusedOrClamped) {
  launch();
  const auto peer = source("milli");
  EXPECT_FALSE(launch_->await_err("it is above --max-force; is it in newton?").empty());
  ASSERT_TRUE(watcher_->until_rows(2000));
  end(*peer);
  stop();
}

// Of stamps of its own clock only the order is known.
TEST_F(RosPhysics, ASourceWithAClockOfItsOwnIsFelt) {
  launch();
  const auto peer = source("own_clock");
  EXPECT_NE(await_tick(is_felt), nullptr) << launch_->err() << peer->err();
  end(*peer);
  stop();
}

TEST_F(RosPhysics, ASecondPublisherIsRefusedWhileTheFirstIsHeard) {
  launch();
  const auto first = source("");
  ASSERT_NE(await_tick(is_felt), nullptr) << launch_->err();
  const auto second = source("");
  EXPECT_FALSE(launch_->await_err("another publisher is heard; end one of the two").empty());
  EXPECT_NE(await_tick(is_felt), nullptr) << launch_->err();
  end(*first);
  // the second one is heard a second later
  EXPECT_FALSE(launch_->await_err("event=force_source topic=", 2).empty());
  EXPECT_NE(await_tick(is_felt), nullptr) << launch_->err();
  end(*second);
  stop();
}

// As many messages as a program can send: the ticks go on.
TEST_F(RosPhysics, AFloodChangesNothingInTheTick) {
  launch();
  const auto peer = source("flood");
  ASSERT_NE(await_tick(is_felt), nullptr) << launch_->err();
  const test::QuietMachine machine;
  peer->send_signal(SIGUSR1);
  const std::size_t first = watcher_->rows().size();
  ASSERT_TRUE(watcher_->until_rows(3000));
  const auto begin = watcher_->rows().begin() + static_cast<std::ptrdiff_t>(first);
  const auto answered = std::count_if(begin, watcher_->rows().end(),
                                      [](const TickRow& row) { return row.device.is_answered; });
  const double share =
      static_cast<double>(answered) / static_cast<double>(watcher_->rows().end() - begin);
  RecordProperty("answered_ratio", std::to_string(share));
  if (machine.may_check("99 % of the ticks answered beside a flood")) {
    EXPECT_GT(share, 0.99);
  }
  EXPECT_EQ(watcher_->mirror().device_link().sessions, 1U);
  EXPECT_EQ(watcher_->mirror().mofc_link().sessions, 1U);
  end(*peer);
  stop();
}

}  // namespace
}  // namespace palpate
