// SPDX-License-Identifier: Apache-2.0
// Two devices, each with its own clamp, one physics_node and one viewer: real programs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>

#include <algorithm>
#include <csignal>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>

#include "common/session/session_file.h"
#include "tests/support/machine/places.h"
#include "tests/support/port.h"
#include "tests/support/program.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"
#include "tests/support/watcher.h"
#include "tests/support/web_client.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using test::Outcome;
using test::Program;
using test::run_program;
using test::TempFolder;
using test::Watcher;
using test::WebClient;
using testing::AllOf;
using testing::ContainsRegex;
using testing::HasSubstr;

/// Both hands press into one block of 400 N/m with springs of 400 N/m, the left one 5 mm, the right
/// one 10 mm deep: hand and tissue are deflected by half each. The long period and lease outlast
/// the pauses of a busy machine.
constexpr const char* kBoth = R"(
name: "both"
realtime { priority: 0 cpu: -1 }
device {
  monitor: off
  rate_hz: 200
  lease_us: 12500
  simulated { position_resolution_m: 0 }
  profile { position_resolution_m: 0 }
}
hand { stiffness_newton_per_m: 400 damping_newton_s_per_m: 10 }
mofc { controller: none stale_after_ms: 200 }
side { name: "left" hand { hold { position_m { x: -0.03 z: -0.005 } } } }
side { name: "right" hand { hold { position_m { x: 0.03 z: -0.010 } } } }
scene {
  tissue {
    box { center_m { z: -0.02 } size_m { x: 0.2 y: 0.1 z: 0.04 } }
    kelvin_voigt { stiffness_newton_per_m: 400 }
  }
}
viewer { status_interval_ms: 50 web { port: 0 } }
)";
enum Side : std::size_t { kLeft, kRight };
// 2.5 mm and 5 mm · 400 N/m; stiction of 0.1 N moves them by half of it at most.
constexpr double kForceNewton[] = {1.0, 2.0};
constexpr double kStictionNewton = 0.06;
constexpr double kTissueNewtonPerM = 400.0;

class TwoHands : public testing::Test {
 protected:
  TwoHands() {
    file_ = files_.write("both.txtpb", kBoth);
    session_ = load_session(file_);
    watcher_.emplace(session_, links_);
  }

  [[nodiscard]] std::string file(const std::string& name) const {
    return (files_.path() / name).string();
  }
  [[nodiscard]] bool presses(Side side) const {
    const auto& rows = watcher_->rows(side);
    if (rows.empty() || !rows.back().mofc) return false;
    return rows.back().mofc->state == MofcState::kContact &&
           std::abs(rows.back().device.force_on_hand_newton.z() - kForceNewton[side]) <
               kStictionNewton;
  }
  [[nodiscard]] bool both_press() const { return presses(kLeft) && presses(kRight); }

  test::RunFolder run_folder_;
  TempFolder files_;
  std::string file_;
  Session session_;
  ProcessLinks links_{{.priority = 0, .cpu = -1}};
  std::optional<Watcher> watcher_;
};

TEST_F(TwoHands, TouchTheSameTissueEachWithItsOwnForce) {
  Program launch("palpate", {"launch", file_, "--json", file("run.json"), "--csv", file("run.csv"),
                             "--record", file("run.mcap"), "--no-viewer"});
  ASSERT_TRUE(watcher_->until([&] { return both_press(); })) << launch.err();
  ASSERT_TRUE(watcher_->until_rows(100));  // launch may have heard them later
  launch.send_signal(SIGTERM);
  ASSERT_EQ(launch.wait(), 0) << launch.err();

  std::ifstream in(file("run.json"));
  const json run = json::parse(in);
  for (const std::string side : {"left", "right"}) {
    EXPECT_GT(run["sides"][side]["in_contact_ticks"], 0);
    EXPECT_GT(std::filesystem::file_size(file("run." + side + ".csv")), 1000u);
    EXPECT_EQ(run["restarts"][side + ".device"], 0);
    EXPECT_EQ(run["restarts"][side + ".mofc"], 0);
    // the recording contains both; an export is of one
    EXPECT_EQ(run_program("palpate", {"export", file("run.mcap"), "--side", side, "--csv",
                                      file(side + ".csv")})
                  .status,
              0);
    EXPECT_GT(std::filesystem::file_size(file(side + ".csv")), 1000u);
  }
  EXPECT_THAT(run_program("palpate", {"export", file("run.mcap"), "--csv", file("x.csv")}).err,
              HasSubstr("give --side with one of left,right"));
  EXPECT_TRUE(std::filesystem::is_empty(run_folder_.path())) << "the launch left files";
}

// Each hand has a clamp of its own.
TEST_F(TwoHands, TheShippedSessionIsPassiveForBoth) {
  const std::string shipped = test::source_dir() + "/deploy/sessions/two_hands.txtpb";
  Program launch("palpate", {"launch", shipped, "--json", file("run.json"), "--no-viewer"});
  Watcher watcher(load_session(shipped), links_);
  const auto was_felt = [&](Side side) {
    return watcher.mirror(side).mofc_counters().contact_ticks > 0 &&
           watcher.mirror(side).device_counters().max_force_newton > 0.1;
  };
  EXPECT_TRUE(watcher.until([&] { return was_felt(kLeft) && was_felt(kRight); })) << launch.err();
  launch.send_signal(SIGTERM);
  ASSERT_EQ(launch.wait(), 0) << launch.err();

  std::ifstream in(file("run.json"));
  const json run = json::parse(in);
  for (const char* side : {"left", "right"}) {
    EXPECT_EQ(run["sides"][side]["controller"], "mofc guard");
    EXPECT_GT(run["sides"][side]["in_contact_ticks"], 0);
    EXPECT_GT(run["sides"][side]["max_force_n"], 0.1);
    EXPECT_GE(run["sides"][side]["min_true_energy_j"], -1e-6);
  }
}

TEST_F(TwoHands, WhenOneDeviceDiesTheOtherIsStillAnswered) {
  const test::QuietMachine machine;
  Program launch("palpate", {"launch", file_, "--no-viewer", "--json", file("run.json")});
  ASSERT_TRUE(watcher_->until([&] { return both_press(); })) << launch.err();
  const std::string pid = launch.await_err("event=node_started node=left.device pid=");
  ASSERT_FALSE(pid.empty());
  const std::uint64_t left_session = watcher_->rows(kLeft).back().device_session_id;
  const std::size_t before = watcher_->rows(kRight).size();

  kill(std::stoi(pid), SIGKILL);
  launch.await_err("event=node_died node=left.device");
  ASSERT_TRUE(watcher_->until([&] {
    return watcher_->rows(kLeft).back().device_session_id != left_session && presses(kLeft) &&
           watcher_->rows(kRight).size() > before + 20;
  }));

  // the right hand is not interrupted: same device and clamp, answered, no more force than the
  // tissue gives
  const auto& rows = watcher_->rows(kRight);
  double deepest_m = 0.0;
  for (const TickRow& row : rows) {
    deepest_m = std::max(deepest_m, -row.device.true_tool_position_world_m.z());
  }
  std::size_t answered = 0;
  for (std::size_t i = before; i < rows.size(); ++i) {
    EXPECT_EQ(rows[i].device_session_id, rows[before].device_session_id);
    EXPECT_LT(rows[i].device.force_on_hand_newton.norm(),
              kTissueNewtonPerM * deepest_m + kStictionNewton);
    if (rows[i].device.is_answered) ++answered;
  }
  EXPECT_GT(answered, 0u);
  if (machine.may_check("most ticks answered")) {
    EXPECT_GT(2 * answered, rows.size() - before);
  }
  EXPECT_TRUE(watcher_->until([&] { return presses(kRight); }));
  EXPECT_EQ(watcher_->mirror(kRight).device_link().sessions, 1u);
  EXPECT_EQ(watcher_->mirror(kRight).mofc_link().sessions, 1u);
  launch.send_signal(SIGTERM);
  EXPECT_EQ(launch.wait(), 0) << launch.err();
  std::ifstream in(file("run.json"));
  const json run = json::parse(in);
  EXPECT_EQ(run["restarts"]["left.device"], 1);
  EXPECT_EQ(run["restarts"]["right.device"], 0);
}

TEST_F(TwoHands, AViewerSeesBoth) {
  Program launch("palpate", {"launch", file_});
  ASSERT_TRUE(watcher_->until([&] { return both_press(); })) << launch.err();
  const std::string rest = launch.await_err("event=web url=http://127.0.0.1:");
  ASSERT_FALSE(rest.empty());
  const auto port = static_cast<std::uint16_t>(std::stoi(rest));

  // curves of each hand for tools, and its ticks for the page
  WebClient client(port);
  ASSERT_TRUE(client.open_web_socket());
  const std::string advertised = client.await_text(R"("op":"advertise")");
  for (const json& channel : json::parse(advertised)["channels"]) {
    const std::string topic = channel["topic"];
    if (topic.starts_with("/left/") || topic.starts_with("/right/")) {
      const std::string id = channel["id"].dump();
      std::string subscription = R"({"op":"subscribe","subscriptions":[{"id":)";
      client.send_text(subscription.append(id).append(R"(,"channelId":)").append(id).append("}]}"));
      EXPECT_TRUE(client.await_data(static_cast<std::uint8_t>(channel["id"]))) << topic;
    }
  }
  EXPECT_THAT(advertised, AllOf(HasSubstr("/left/telemetry"), HasSubstr("/right/telemetry"),
                                HasSubstr("/right/device"), HasSubstr("/mesh")));

  // figures of each hand for Prometheus
  EXPECT_TRUE(watcher_->until([&] {
    WebClient prometheus(port);
    prometheus.send_raw("GET /metrics HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
    const std::string page = prometheus.read_to_end();
    return page.find("palpate_node_up{side=\"left\",node=\"device\"} 1") != std::string::npos &&
           page.find("palpate_node_up{side=\"right\",node=\"physics\"} 1") != std::string::npos;
  }));

  launch.send_signal(SIGTERM);
  EXPECT_EQ(launch.wait(), 0);
  EXPECT_THAT(launch.out(), AllOf(HasSubstr("\nleft: "), HasSubstr("\nright: "),
                                  HasSubstr("both, left: none"), HasSubstr("both, right: none")));
}

// Stations of one session on two workstations: each physics serves its side, and is missed there
// only.
TEST_F(TwoHands, EachSideHasAPhysicsOfItsOwn) {
  Program left("physics_node", {"--session", file_, "--no-realtime", "--side", "left"});
  Program right("physics_node", {"--session", file_, "--no-realtime", "--side", "right", "--set",
                                 "links.physics_telemetry=ipc://" + file("physics_telemetry")});
  Program launch("palpate", {"launch", file_, "--nodes", "device,mofc"});
  ASSERT_TRUE(watcher_->until([&] { return both_press(); })) << launch.err() << right.err();

  right.send_signal(SIGKILL);
  EXPECT_TRUE(watcher_->until([&] {
    const auto& rows = watcher_->rows(kRight);
    return rows.back().mofc && rows.back().mofc->state == MofcState::kNoPhysics && presses(kLeft);
  }));
  launch.send_signal(SIGTERM);
  EXPECT_EQ(launch.wait(), 0);
}

TEST_F(TwoHands, OnOneProcessorAreAWarningOfLaunchAndDoctor) {
  cpu_set_t before;
  ASSERT_EQ(sched_getaffinity(0, sizeof(before), &before), 0);
  std::size_t first = 0;
  while (!CPU_ISSET(first, &before)) ++first;
  cpu_set_t one;
  CPU_ZERO(&one);
  CPU_SET(first, &one);
  ASSERT_EQ(sched_setaffinity(0, sizeof(one), &one), 0);  // of the programs, too
  const Outcome launch =
      run_program("palpate", {"launch", file_, "--seconds", "0.2", "--no-viewer"});
  const Outcome doctor = run_program("palpate", {"doctor", file_});
  sched_setaffinity(0, sizeof(before), &before);

  EXPECT_THAT(launch.err, HasSubstr("2 sides on 1 processor: their ticks may delay"));
  EXPECT_EQ(launch.status, 0) << launch.err;
  EXPECT_THAT(doctor.out, HasSubstr("2 sides on 1 processor"));
  EXPECT_THAT(doctor.out, HasSubstr("use fewer sides"));
}

TEST_F(TwoHands, DoctorLooksAtEverySide) {
  const test::HeldPort taken;
  const std::string session =
      files_.write("doctor.txtpb",
                   "name: \"doctor\" device { rate_hz: 100 } side { name: \"left\" } side { name: "
                   "\"right\" device { monitor: off } links { tool_motion: \"" +
                       taken.endpoint() + "\" } }");
  const Outcome doctor = run_program("palpate", {"doctor", session});

  EXPECT_EQ(doctor.status, 1);
  EXPECT_THAT(doctor.out, ContainsRegex("TO DO  right: links.tool_motion .*in use by another"));
  EXPECT_THAT(doctor.out, ContainsRegex("ok     left: links.tool_motion .* is free"));
  EXPECT_THAT(doctor.out, ContainsRegex("TO DO  right: monitor .*off"));
  EXPECT_THAT(doctor.out, ContainsRegex("ok     left: monitor .*on"));
  // their ticks are on processors of their own
  EXPECT_THAT(doctor.out, AllOf(HasSubstr("left: timer"), HasSubstr("right: timer")));
  // what is the same of both is given once, and so is the machine
  for (const char* once :
       {"  links.physics_telemetry ", "  friction ", "  memory ", "  real-time "}) {
    EXPECT_THAT(doctor.out, HasSubstr(once));
    EXPECT_EQ(doctor.out.find(once), doctor.out.rfind(once)) << once;
  }
}

TEST_F(TwoHands, SceneCheckGivesAWarningOnce) {
  const Outcome check =
      run_program("palpate", {"scene", "check", file_, "--set",
                              "device.profile={ coulomb_newton: 5 position_resolution_m: 0 }"});
  EXPECT_EQ(check.status, 0);
  EXPECT_THAT(check.err, HasSubstr("device.profile: claims"));
  EXPECT_EQ(check.err.find("claims"), check.err.rfind("claims"));
  EXPECT_THAT(check.out, HasSubstr("ok (2 warnings, 1 tissues, physics "));
  EXPECT_THAT(check.out, HasSubstr("; right: device 200 Hz, controller none"));
  EXPECT_EQ(check.out.find("warning"), check.out.rfind("warning"));
}

TEST_F(TwoHands, ANodeNeedsItsSide) {
  const Outcome unnamed = run_program("device_node", {"--session", file_});
  EXPECT_EQ(unnamed.status, 2);
  EXPECT_THAT(unnamed.err, HasSubstr("give --side with one of left, right"));
  const Outcome unknown = run_program("mofc_node", {"--session", file_, "--side", "up"});
  EXPECT_EQ(unknown.status, 2);
  EXPECT_THAT(unknown.err, AllOf(HasSubstr("--side up"), HasSubstr("left, right")));
  const Outcome elsewhere = run_program("physics_node", {"--session", file_, "--side", "up"});
  EXPECT_EQ(elsewhere.status, 2);
  EXPECT_THAT(elsewhere.err, AllOf(HasSubstr("--side up"), HasSubstr("left, right")));
  const Outcome recorded = run_program("palpate", {"loopback", file_, "--record", file("x.mcap")});
  EXPECT_EQ(recorded.status, 2);
  EXPECT_THAT(recorded.err, HasSubstr("give --side NAME"));
}

// 5 mm, half the depth, at 400 N/m as above; on virtual time.
TEST_F(TwoHands, OneSideAloneRunsOnVirtualTime) {
  const Outcome run = run_program(
      "palpate", {"loopback", file_, "--side", "right", "--seconds", "2", "--json", "-"});
  ASSERT_EQ(run.status, 0) << run.err;
  EXPECT_NEAR(json::parse(run.out)["max_force_n"], kForceNewton[kRight], 0.5);
  // beside the other one it gets the same forces
  const Outcome both = run_program(
      "palpate", {"loopback", file_, "--seconds", "2", "--json", "-", "--csv", file("v.csv")});
  ASSERT_EQ(both.status, 0) << both.err;
  const json sides = json::parse(both.out)["sides"];
  EXPECT_EQ(sides["right"]["max_force_n"], json::parse(run.out)["max_force_n"]);
  EXPECT_GT(sides["left"]["in_contact_ticks"], 0);
  EXPECT_GT(std::filesystem::file_size(file("v.left.csv")), 1000u);
}

}  // namespace
}  // namespace palpate
