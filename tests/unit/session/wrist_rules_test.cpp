// SPDX-License-Identifier: Apache-2.0
// A wrist in a session: defaults, and what is refused.
#include <gtest/gtest.h>

#include <string>
#include <variant>

#include "tests/unit/session/session_support.h"

namespace palpate {
namespace {

constexpr const char* kWrist = "name: \"w\" device { wrist {} }";

bool is_told(const std::string& text, const std::string& path, const std::string& words) {
  for (const std::string& line : complaints(text)) {
    if (line.find(path) != std::string::npos && line.find(words) != std::string::npos) return true;
  }
  return false;
}

TEST(WristRules, TheSimulatedWristIsThatOfTheProfileUnlessItIsGiven) {
  const Session session = parse_session(
      "name: \"w\" device { wrist { coulomb_newton_m: 0.004 peak_torque_newton_m: 0.3 } simulated "
      "{ "
      "wrist { viscous_newton_m_s_per_rad: 0.001 } } }",
      "x.txtpb");
  const Side& side = session.side();
  ASSERT_TRUE(side.device.wrist && side.simulated.wrist);
  EXPECT_EQ(side.simulated.wrist->coulomb_newton_m, 0.004);
  EXPECT_EQ(side.simulated.wrist->viscous_newton_m_s_per_rad, 0.001);
  EXPECT_EQ(side.device.wrist->viscous_newton_m_s_per_rad, 2e-4);
  EXPECT_EQ(side.simulated.wrist->angle_resolution_rad, side.device.wrist->angle_resolution_rad);
  EXPECT_EQ(side.simulated.wrist->peak_torque_newton_m, 0.3);
}

TEST(WristRules, TheHandTurnsItOnAPath) {
  const auto path_of = [](const std::string& path) {
    return parse_session("name: \"w\" device { wrist {} } hand { wrist { " + path + " } }",
                         "x.txtpb")
        .side()
        .hand.wrist.path;
  };
  EXPECT_TRUE(std::holds_alternative<HoldPath>(path_of("")));
  EXPECT_EQ(std::get<HoldPath>(path_of("hold { angle_rad { y: 0.1 } }")).position_m.y(), 0.1);
  EXPECT_EQ(
      std::get<SinusoidPath>(path_of("sinusoid { amplitude_rad { y: 0.2 } }")).amplitude_m.y(),
      0.2);
  EXPECT_EQ(std::get<HostilePath>(path_of("hostile { v_max_rad_per_s: 2 }")).v_max_m_per_s, 2.0);
}

TEST(WristRules, ItsPartsNeedTheWristOfTheDevice) {
  EXPECT_TRUE(is_told("name: \"w\" device { simulated { wrist {} } }", "device.simulated.wrist",
                      "needs device.wrist"));
  EXPECT_TRUE(is_told("name: \"w\" hand { wrist {} }", "hand.wrist", "needs device.wrist"));
}

TEST(WristRules, OnlyTheSimulatedDeviceAndAPluginHaveOne) {
  EXPECT_TRUE(is_told("name: \"w\" device { wrist {} haply_inverse {} }", "device.wrist",
                      "only the simulated device and that of a plug-in"));
  const auto device_of = [](const std::string& wrist) {
    return parse_session(
        "name: \"w\" device { wrist { " + wrist + " } plugin { library: \"arm.so\" } }", {});
  };
  const Side plain = device_of("").side();
  EXPECT_TRUE(std::get<PluginConfig>(plain.driver).uses_wrist);
  EXPECT_EQ(plain.device.wrist->peak_torque_newton_m, plain.device.wrist->coulomb_newton_m)
      << "nobody has pushed its motors";
  EXPECT_TRUE(plain.simulated.wrist) << "what stands in for it in palpate loopback";
  EXPECT_EQ(device_of("accept: UNCHECKED_MOTORS").side().device.wrist->peak_torque_newton_m, 0.2);
  EXPECT_TRUE(is_told("name: \"w\" device { wrist { accept: ANYTHING } }", "accept", ""));
}

TEST(WristRules, OnlyModeGuardClampsTorque) {
  EXPECT_TRUE(complaints(kWrist).empty());
  EXPECT_TRUE(complaints(std::string(kWrist) + " mofc { controller: none }").empty());
  EXPECT_TRUE(is_told(std::string(kWrist) + " mofc { mode: vector }", "mofc.mode", "mode guard"));
  EXPECT_TRUE(is_told(std::string(kWrist) + " mofc { controller: energy_bounding }",
                      "mofc.controller", "mode guard"));
}

TEST(WristRules, NumbersHaveRanges) {
  EXPECT_TRUE(is_told("name: \"w\" device { wrist { peak_torque_newton_m: 0 } }",
                      "device.wrist.peak_torque_newton_m", "> 0"));
  EXPECT_TRUE(is_told("name: \"w\" device { wrist { coulomb_newton_m: -1 } }",
                      "device.wrist.coulomb_newton_m", ""));
  EXPECT_TRUE(
      is_told("name: \"w\" device { wrist {} } hand { wrist { sinusoid { frequency_hz { x: "
              "-1 } } } }",
              "hand.wrist.sinusoid.frequency_hz.x", ""));
}

}  // namespace
}  // namespace palpate
