// SPDX-License-Identifier: Apache-2.0
// Several devices in one session: own fields of a side, shared fields, and problems.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <set>
#include <string>

#include "tests/unit/session/session_support.h"

namespace palpate {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

// Begins in line 2; places below are counted from there.
constexpr const char* kTwoHands = R"(name: "hands"
seed: 7
device { rate_hz: 500 start_ramp_ms: 20 }
hand { mass_kg: 0.3 hold { position_m { z: 0.01 } } press { until_s: 1 } press { until_s: 2 } }
mofc { mode: vector }
side { name: "left" }
side {
  name: "right"
  device { rate_hz: 2000 }
  hand { hold { position_m { x: 0.05 } } press { button: 3 until_s: 4 } }
  mofc { controller: none }
  realtime { cpu: 1 }
}
)";

Session two_hands(const std::vector<std::string>& overrides = {}) {
  return parse_session(kTwoHands, "x.txtpb", overrides);
}

TEST(SessionSides, ASideHasItsOwnFieldsAndSharesTheRest) {
  const Session session = two_hands();

  ASSERT_THAT(session.sides, SizeIs(2));
  const Side& left = session.sides[0];
  EXPECT_EQ(left.name, "left");
  EXPECT_EQ(left.device.rate_hz, 500.0);
  EXPECT_EQ(std::get<HoldPath>(left.hand.path).position_m, Vector3(0, 0, 0.01));
  EXPECT_EQ(left.mofc.controller, ControllerKind::kMofc);
  EXPECT_EQ(left.realtime.cpu, 0);
  const Side& right = session.sides[1];
  EXPECT_EQ(right.name, "right");
  EXPECT_EQ(right.device.rate_hz, 2000.0);
  EXPECT_EQ(right.device.start_ramp, std::chrono::milliseconds(20));
  EXPECT_EQ(right.hand.mass_kg, 0.3);
  EXPECT_EQ(std::get<HoldPath>(right.hand.path).position_m, Vector3(0.05, 0, 0.01));
  EXPECT_EQ(right.mofc.controller, ControllerKind::kNone);
  EXPECT_EQ(right.mofc.mode, MofcMode::kVector);
  EXPECT_EQ(right.realtime.cpu, 1);
}

TEST(SessionSides, TickThreadsOfManySidesSpreadOverTheProcessors) {
  std::string text = "name: 'many' device { simulated {} } scene {}\n";
  for (int i = 0; i < 64; ++i) text += "side { name: 's" + std::to_string(i) + "' }\n";
  const int processors = static_cast<int>(std::max(1L, ::sysconf(_SC_NPROCESSORS_ONLN)));

  const Session session = parse_session(text, "x.txtpb");

  for (int i = 0; i < 64; ++i) {
    EXPECT_EQ(session.sides[static_cast<std::size_t>(i)].realtime.cpu, i % processors) << i;
  }
  EXPECT_EQ(parse_session(text, "x.txtpb", {"realtime.cpu=0"}).sides[5].realtime.cpu, 0);
}

// Half a period of 500 Hz and 0.3 ms, 0.8 periods of 2 kHz.
TEST(SessionSides, DefaultsFollowFromTheFieldsOfTheSide) {
  const Session session = two_hands();

  EXPECT_EQ(session.sides[0].device.reply, std::chrono::microseconds(1300));
  EXPECT_EQ(session.sides[1].device.reply, std::chrono::microseconds(400));
  EXPECT_EQ(session.sides[0].device.prompt, std::chrono::microseconds(1000));
}

TEST(SessionSides, AListOfASideReplacesTheSharedOne) {
  const Session session = two_hands();

  EXPECT_THAT(session.sides[0].hand.presses, SizeIs(2));
  ASSERT_THAT(session.sides[1].hand.presses, SizeIs(1));
  EXPECT_EQ(session.sides[1].hand.presses[0].button, 3u);
}

TEST(SessionSides, ASessionCanBeReducedToOneOfThem) {
  const Session right = with_only_side(two_hands(), "right");

  ASSERT_THAT(right.sides, SizeIs(1));
  EXPECT_EQ(right.side().name, "right");
  EXPECT_EQ(right.side().device.rate_hz, 2000.0);
  EXPECT_EQ(right.seed, 7u);
  EXPECT_EQ(right.text, two_hands().text);
}

TEST(SessionSides, EachHasItsOwnFilesAndRandomStreams) {
  const Session session = two_hands();

  const std::string folder = "ipc://" + run_folder("hands").string() + "/";
  std::set<std::string> endpoints;
  for (const Side& side : session.sides) {
    const LinksConfig& links = side.links;
    EXPECT_EQ(links.exchange, folder + side.name + ".exchange.ipc");
    endpoints.insert({links.exchange, links.tool_motion, links.interaction, links.device_telemetry,
                      links.mofc_telemetry, links.hand_target, session.physics_telemetry});
  }
  EXPECT_THAT(endpoints, SizeIs(2 * 6 + 1));
  EXPECT_EQ(session.physics_telemetry, folder + "physics_telemetry.ipc");
  EXPECT_NE(stream_seed(session, session.sides[0], "hand"),
            stream_seed(session, session.sides[1], "hand"));
}

TEST(SessionSides, ASessionWithOneDeviceHasOneUnnamedSide) {
  const Session session = parse_session("name: \"x\"", "x.txtpb");

  ASSERT_THAT(session.sides, SizeIs(1));
  EXPECT_EQ(session.side().name, "");
  EXPECT_EQ(with_only_side(session, "").side().name, "");
  EXPECT_EQ(stream_seed(session, session.side(), "hand"), stream_seed(session.seed, "hand"));
  EXPECT_THAT(session.side().links.exchange, EndsWith("/x/exchange.ipc"));
}

TEST(SessionSides, AnyFieldOfASideCanBeOverridden) {
  EXPECT_EQ(two_hands({"side[1].device.rate_hz=1000"}).sides[1].device.rate_hz, 1000.0);
  // fields of the side win over shared ones
  const Session session = two_hands({"device.rate_hz=250"});
  EXPECT_EQ(session.sides[0].device.rate_hz, 250.0);
  EXPECT_EQ(session.sides[1].device.rate_hz, 2000.0);
}

TEST(SessionSides, TheSideMustBeNamed) {
  const Session session = two_hands();

  const auto complaint = [](const Session& of, const char* side) -> std::string {
    try {
      static_cast<void>(with_only_side(of, side));
    } catch (const SetupError& error) {
      return error.what();
    }
    return {};
  };

  EXPECT_THAT(complaint(session, ""), EndsWith("give --side with one of left, right"));
  EXPECT_THAT(complaint(session, "up"), AllOf(HasSubstr("--side up"), HasSubstr("left, right")));
  EXPECT_THAT(complaint(session, "left"), IsEmpty());
  EXPECT_THAT(complaint(parse_session("name: \"x\"", "x.txtpb"), "left"),
              HasSubstr("has one device; leave --side out"));
}

TEST(SessionSides, AProblemIsReportedOnceWhereItsFieldIsGiven) {
  EXPECT_THAT(complaints(kTwoHands, {"device.rate_hz=1", "side[1].mofc.fade_ms=-1"}),
              ElementsAre("x.txtpb: 2 problems",
                          HasSubstr("--set device.rate_hz=1: device.rate_hz = 1: must be 10"),
                          HasSubstr("side[1].mofc.fade_ms = -1: must be > 0")));
  // of the file: line 9, column 12
  EXPECT_THAT(complaints("name: \"x\"\nside { name: \"a\" }\nside {\n  name: \"b\"\n"
                         "  device { rate_hz: 1 }\n}\n"),
              ElementsAre("x.txtpb: 1 problem",
                          HasSubstr("x.txtpb:5:12: side[1].device.rate_hz = 1: must be")));
  // shared by both sides, and left out by both
  EXPECT_THAT(complaints(kTwoHands, {"hand.recorded={}"}), SizeIs(2));
}

TEST(SessionSides, HaveNamesThatDiffer) {
  const auto named = [](const std::string& a, const std::string& b) {
    return complaints("name: \"x\" side { name: \"" + a + "\" } side { name: \"" + b + "\" }");
  };
  EXPECT_THAT(named("a", "b-_9"), IsEmpty());
  EXPECT_THAT(named("a", "a"), ElementsAre("x.txtpb: 1 problem", HasSubstr("another side")));
  EXPECT_THAT(named("a", ""),
              ElementsAre("x.txtpb: 1 problem", HasSubstr("side[1].name: required")));
  EXPECT_THAT(named("a", "b/c").at(1), HasSubstr("must be 1 … 16 letters"));
  EXPECT_THAT(named("a", std::string(17, 'b')).at(1), HasSubstr("must be 1 … 16 letters"));
  EXPECT_THAT(named("a", std::string(16, 'b')), IsEmpty());
}

TEST(SessionSides, AreTwoToSixtyFour) {
  std::string text = "name: \"x\"";
  for (int count = 1; count <= 65; ++count) {
    text += " side { name: \"s" + std::to_string(count) + "\" }";
    if (count == 1 || count == 65) {
      EXPECT_THAT(complaints(text), ElementsAre("x.txtpb: 1 problem", HasSubstr("2 … 64 sides")));
    } else {
      EXPECT_THAT(complaints(text), IsEmpty());
    }
  }
}

TEST(SessionSides, ShareOnlyTheEndpointOfPhysicsTelemetry) {
  EXPECT_THAT(complaints(kTwoHands, {"links.exchange=tcp://127.0.0.1:1"}),
              ElementsAre("x.txtpb: 1 problem", HasSubstr("is that of another side too")));
  EXPECT_THAT(
      complaints(kTwoHands, {"side[0].links.exchange=tcp://127.0.0.1:1",
                             "side[1].links.tool_motion=tcp://127.0.0.1:1"}),
      ElementsAre("x.txtpb: 1 problem", HasSubstr("is that of side[0].links.exchange too")));
  EXPECT_THAT(complaints(kTwoHands, {"links.physics_telemetry=tcp://127.0.0.1:1"}), IsEmpty());
  EXPECT_THAT(complaints(kTwoHands, {"side[1].links.physics_telemetry=tcp://127.0.0.1:1"}),
              ElementsAre("x.txtpb: 1 problem", HasSubstr("is one for all sides")));
}

TEST(SessionSides, NeverWaitForPhysics) {
  EXPECT_THAT(complaints(kTwoHands, {"device.rate_hz=50", "side[1].device.rate_hz=50",
                                     "mofc.wait_for_physics_ms=5"}),
              ElementsAre("x.txtpb: 1 problem", HasSubstr("needs a session without sides")));
}

TEST(SessionSides, HaveLinksOfTheirOwnToTheStandby) {
  const Session session = two_hands({"physics.standby={}"});
  EXPECT_THAT(session.sides[0].links.standby_tool_motion, EndsWith("left.standby_tool_motion.ipc"));
  EXPECT_THAT(session.sides[1].links.standby_interaction,
              EndsWith("right.standby_interaction.ipc"));
  EXPECT_THAT(session.standby_telemetry, EndsWith("/standby_telemetry.ipc"));
  // half of stale_after, 150 ms
  EXPECT_EQ(session.sides[0].mofc.standby_after,
            std::optional<Duration>(session.sides[0].mofc.stale_after / 2));
  EXPECT_EQ(two_hands({"physics.standby={silence_ms: 30}"}).sides[0].mofc.standby_after,
            std::optional<Duration>(std::chrono::milliseconds(30)));
  const Session none = two_hands();
  EXPECT_EQ(none.sides[0].links.standby_tool_motion, "");
  EXPECT_FALSE(none.sides[0].mofc.standby_after);
}

TEST(SessionSides, AStandbyThatComesTooLateOrCannotFollowIsRefused) {
  EXPECT_THAT(complaints("name: \"x\" physics { standby { silence_ms: 5000 } }").at(1),
              HasSubstr("must be > physics.standby.silence_ms"));
  EXPECT_THAT(complaints("name: \"x\" physics { standby {} command: \"mine\" }").at(1),
              HasSubstr("needs physics_node"));
  EXPECT_THAT(complaints("name: \"x\" physics { standby {} } viewer { control: true }").at(1),
              HasSubstr("reaches one physics_node only"));
  EXPECT_THAT(complaints("name: \"x\" physics { standby {} } device { rate_hz: 50 } mofc { "
                         "wait_for_physics_ms: 5 }")
                  .at(1),
              HasSubstr("needs a session without physics.standby"));
}

}  // namespace
}  // namespace palpate
