// SPDX-License-Identifier: Apache-2.0
// MuJoCo and Bullet as the physics of `palpate launch`, in the sessions that the documents name:
// the force and the picture are there, and killed, suspended or attacked they end as physics_node
// does.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <nlohmann/json.hpp>
#include <optional>
#include <regex>

#include "common/session/session_file.h"
#include "tests/support/hostile/raw_zmtp.h"
#include "tests/support/machine/machine.h"
#include "tests/support/machine/places.h"
#include "tests/support/pressing_hand.h"
#include "tests/support/program.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"
#include "tests/support/text.h"
#include "tests/support/watcher.h"

namespace palpate {
namespace {

using test::hears_physics;
using test::is_fresh;
using test::newton;
using testing::HasSubstr;

constexpr double kFeltNewton = 0.15;

std::string session_file(const std::string& name) {
  return test::source_dir() + "/deploy/sessions/engines/" + name + ".txtpb";
}

bool is_felt(const TickRow& row) { return is_fresh(row) && newton(row) > kFeltNewton; }
/// mofc_node has lost physics, and the force has ended.
bool is_over(const TickRow& row) {
  return row.device.is_answered && row.mofc && !hears_physics(row) && newton(row) == 0.0;
}

class Engines : public testing::TestWithParam<const char*> {
 protected:
  void launch(const std::vector<std::string>& more) {
    const std::string file = session_file(GetParam());
    watcher_.emplace(load_session(file), links_);
    std::vector<std::string> arguments{"launch",         file,       "--no-viewer",   "--json",
                                       path("run.json"), "--record", path("run.mcap")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    launch_.emplace("palpate", arguments);
  }
  [[nodiscard]] std::string path(const std::string& name) const {
    return (files_.path() / name).string();
  }
  pid_t physics(int count = 1) {
    const std::string pid = launch_->await_err("event=node_started node=physics pid=", count);
    return pid.empty() ? 0 : std::stoi(pid);
  }
  /// Whether a tick that is yet to come is so.
  bool await_tick(bool (*is_so)(const TickRow&)) {
    const TimePoint from = SteadyClock().now();
    std::size_t next = watcher_->rows().size();
    return watcher_->until([&] {
      const std::vector<TickRow>& rows = watcher_->rows();
      const auto is_it = [&](const TickRow& row) {
        return row.device.sampled_at >= from && is_so(row);
      };
      while (next < rows.size() && !is_it(rows[next])) ++next;
      return next < rows.size();
    });
  }
  /// When launch has ended: what holds for every session.
  /// @param seen  topic of the viewers
  void expect_felt_seen_and_passive(int restarts, const std::string& seen) {
    const nlohmann::json run = nlohmann::json::parse(test::text_of(path("run.json")));
    EXPECT_GT(run["max_force_n"], kFeltNewton);
    EXPECT_GT(run["in_contact_ticks"], 0);
    EXPECT_GE(run["min_true_energy_j"], -test::kRoundingJoule);
    for (const auto& [node, count] : run["restarts"].items()) {
      EXPECT_EQ(count, node == "physics" ? restarts : 0) << node;
    }
    for (const TickRow& row : watcher_->rows()) {
      ASSERT_GE(row.device.minimum_true_energy_joule, -test::kRoundingJoule);
    }
    const std::string info = test::run_program("palpate", {"info", path("run.mcap")}).out;
    EXPECT_TRUE(std::regex_search(info, std::regex(seen + " +[1-9]"))) << info;
  }

  test::RunFolder run_folder_;
  test::TempFolder files_;
  ProcessLinks links_{{.priority = 0, .cpu = -1}};
  std::optional<test::Watcher> watcher_;
  std::optional<test::Program> launch_;
};

using Rendered = Engines;

TEST_P(Rendered, ByTheDocumentedCommand) {
  launch({});
  EXPECT_TRUE(await_tick(is_felt)) << launch_->err();
  EXPECT_TRUE(watcher_->until_rows(300));
  launch_->send_signal(SIGTERM);
  EXPECT_EQ(launch_->wait(), 0) << launch_->err();
  expect_felt_seen_and_passive(0, "/scene_state");
}
INSTANTIATE_TEST_SUITE_P(Engines, Rendered, testing::Values("mujoco_rigid"),
                         [](const auto& session) { return std::string(session.param); });

using Failing = Engines;

TEST_P(Failing, EndsTheForceAndRendersAgain) {
  launch({"--set", "hand.sinusoid.frequency_hz.z=1.4"});
  ASSERT_TRUE(await_tick(is_felt)) << launch_->err();

  // bytes of no protocol, endless messages, then a wrong one, where only mofc_node may connect
  const LinksConfig links = load_session(session_file(GetParam())).side().links;
  for (const std::string& endpoint : {links.tool_motion, links.interaction}) {
    test::RawStream(endpoint).write(std::string(300, '\0'));
    test::RawStream stream(endpoint);
    ASSERT_TRUE(stream.shake_hands(endpoint == links.tool_motion ? "PUSH" : "DEALER"));
    std::string parts;
    while (parts.size() < (256 << 10)) parts += test::zmtp_frame(test::kMoreParts, "0123456789");
    stream.write(parts + test::zmtp_frame(test::kLastPart, "\x02not protobuf"));
  }
  EXPECT_TRUE(await_tick(is_felt)) << launch_->err();

  kill(physics(), SIGKILL);
  EXPECT_TRUE(await_tick(is_over)) << "a force without physics";
  EXPECT_TRUE(await_tick(is_felt)) << launch_->err();

  const pid_t restarted = physics(2);
  ASSERT_GT(restarted, 1);
  kill(restarted, SIGSTOP);
  EXPECT_TRUE(await_tick(is_over)) << "a force of a suspended physics";
  kill(restarted, SIGCONT);
  EXPECT_TRUE(await_tick(is_felt)) << launch_->err();

  launch_->send_signal(SIGTERM);
  EXPECT_EQ(launch_->wait(), 0) << launch_->err();
  EXPECT_THAT(launch_->err(), HasSubstr("event=node_stopped node=physics how=\"exit status 0\""));
  expect_felt_seen_and_passive(1, "/mesh");
}
INSTANTIATE_TEST_SUITE_P(Engines, Failing, testing::Values("mujoco_needle", "bullet_block"),
                         [](const auto& session) { return std::string(session.param); });

struct Place {
  const char* session;
  std::vector<std::string> where;
};
// Three attempts: the limits of time are those of a machine with nothing else to do.
TEST(EnginesConform, ToWhatMofcNodeAndTheHandRelyOn) {
  const test::QuietMachine machine;
  const std::vector<Place> places{
      {"mujoco_needle", {}},
      {"bullet_block", {"--clear", "0", "0", "0.02", "--press", "0", "0", "0"}}};
  for (const Place& place : places) {
    std::vector<std::string> arguments{"conform", "physics", "--session",
                                       session_file(place.session)};
    arguments.insert(arguments.end(), place.where.begin(), place.where.end());
    test::Outcome ended;
    for (int attempt = 0; attempt < 3 && ended.status != 0; ++attempt) {
      ended = test::run_program("palpate", arguments);
    }
    if (ended.status != 0 && !machine.may_check(std::string("conformance of ") + place.session)) {
      continue;
    }
    EXPECT_EQ(ended.status, 0) << place.session << "\n" << ended.out << ended.err;
  }
}

struct Refusal {
  const char* program;
  const char* session;
  std::vector<std::string> arguments;
  const char* complaint;
};

TEST(EnginesRefuse, ASetUpThatIsWrongWithStatus2) {
  const test::RunFolder run_folder;
  const test::TempFolder files;
  const std::string no_tool = files.write("no_tool.xml", "<mujoco><worldbody/></mujoco>");
  const std::string no_geom = files.write(
      "no_geom.xml", "<mujoco><worldbody><body name='tool' mocap='true'/></worldbody></mujoco>");
  const std::vector<Refusal> refusals{
      {"mujoco_physics_node", "mujoco_needle", {}, "give an MJCF file"},
      {"mujoco_physics_node", "mujoco_needle", {"/no/scene.xml"}, "/no/scene.xml"},
      {"mujoco_physics_node", "mujoco_needle", {no_tool}, "no mocap body of the name tool"},
      {"mujoco_physics_node", "mujoco_needle", {no_geom}, "the tool touches nothing"},
      {"bullet_physics_node", "bullet_block", {"soft"}, "Young's modulus in Pa = soft"},
      {"bullet_physics_node", "bullet_block", {"1e4", "0.5"}, "Poisson's ratio = 0.5"},
      {"bullet_physics_node", "mujoco_needle", {}, "scene.tool.tip_radius_m = 0.0015"}};
  for (const Refusal& refusal : refusals) {
    std::vector<std::string> arguments{"--session", session_file(refusal.session), "--no-realtime"};
    arguments.insert(arguments.end(), refusal.arguments.begin(), refusal.arguments.end());
    const test::Outcome ended = test::run_program(refusal.program, arguments);
    EXPECT_EQ(ended.status, 2) << refusal.complaint;
    EXPECT_THAT(ended.err, HasSubstr(refusal.complaint));
  }
}

}  // namespace
}  // namespace palpate
