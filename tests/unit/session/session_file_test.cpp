// SPDX-License-Identifier: Apache-2.0
// The session file: defaults, places of problems, files that cannot be read, the shipped sessions.
#include "common/session/session_file.h"
#include "tests/support/temp_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <numbers>
#include <optional>

#include "tests/support/machine/places.h"
#include "tests/unit/session/session_support.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;
using ::testing::StartsWith;

/// Sets an environment variable for one test; nullptr removes it.
class Variable {
 public:
  Variable(const char* name, const char* value) : name_(name) {
    if (const char* old = std::getenv(name)) old_ = old;
    set(value);
  }
  Variable(const Variable&) = delete;
  Variable& operator=(const Variable&) = delete;
  ~Variable() { set(old_ ? old_->c_str() : nullptr); }

 private:
  void set(const char* value) {
    if (value == nullptr) {
      ::unsetenv(name_);
    } else {
      ::setenv(name_, value, 1);
    }
  }
  const char* name_;
  std::optional<std::string> old_;
};

std::string complaint_of_file(const std::filesystem::path& file) {
  try {
    static_cast<void>(load_session(file));
  } catch (const SetupError& error) {
    return error.what();
  }
  return {};
}

/// A folder that is gone after the test.
class SessionFolder : public ::testing::Test {
 protected:
  std::filesystem::path write(const char* name, const std::string& text) const {
    return temporary_.write(name, text);
  }

  const test::TempFolder temporary_;
  const std::filesystem::path& folder_ = temporary_.path();
};

// --- defaults ---------------------------------------------------------------------------------

TEST(SessionFile, AlmostEmptySessionHasEveryDefault) {
  const Variable run_dir("PALPATE_RUN_DIR", "/run/p");

  const Session session = parse_session("name: \"x\"", "x.txtpb");

  EXPECT_EQ(session.name, "x");
  EXPECT_EQ(session.file, "x.txtpb");
  EXPECT_EQ(session.duration_s, 10.0);
  EXPECT_EQ(session.seed, 1u);
  EXPECT_EQ(session.side().links.exchange, "ipc:///run/p/x/exchange.ipc");
  EXPECT_EQ(session.side().links.tool_motion, "ipc:///run/p/x/tool_motion.ipc");
  EXPECT_EQ(session.side().links.interaction, "ipc:///run/p/x/interaction.ipc");
  EXPECT_EQ(session.side().links.device_telemetry, "ipc:///run/p/x/device_telemetry.ipc");
  EXPECT_EQ(session.side().links.mofc_telemetry, "ipc:///run/p/x/mofc_telemetry.ipc");
  EXPECT_EQ(session.physics_telemetry, "ipc:///run/p/x/physics_telemetry.ipc");
  EXPECT_EQ(session.side().links.hand_target, "ipc:///run/p/x/hand_target.ipc");
  EXPECT_EQ(session.side().realtime.priority, 80);
  EXPECT_EQ(session.side().realtime.cpu, 0);
  EXPECT_EQ(session.side().realtime.wait, WaitStrategy::kHybrid);

  // 1 kHz: half a period and 0.3 ms, half a period, 2 periods, 20 periods
  const DeviceConfig& device = session.side().device;
  EXPECT_EQ(device.rate_hz, 1000.0);
  EXPECT_EQ(device.reply, 800us);
  EXPECT_EQ(device.prompt, 500us);
  EXPECT_EQ(device.lease, 2ms);
  EXPECT_EQ(device.longest_lease, 10ms);
  EXPECT_EQ(device.limp_after, 20ms);
  EXPECT_EQ(device.fade, 50ms);
  EXPECT_EQ(device.start_ramp, 100ms);
  EXPECT_EQ(device.peak_force_newton, 3.3);
  EXPECT_DOUBLE_EQ(device.slew_newton_per_s, 1650.0);  // 3.3 N in 2 ms
  EXPECT_EQ(device.v_fault_m_per_s, 10.0);
  EXPECT_TRUE(device.monitor.is_on);
  EXPECT_EQ(device.monitor.v_max_m_per_s, 0.5);
  EXPECT_FALSE(device.has_hands_off_check);
  EXPECT_EQ(device.workspace.scale_ratio, 1.0);
  EXPECT_EQ(device.workspace.force_ratio, 1.0);
  EXPECT_EQ(device.workspace.offset_m, Vector3(0, 0, 0));
  EXPECT_EQ(device.workspace.clutch_button, std::nullopt);
  EXPECT_EQ(device.profile.viscous_newton_s_per_m, 0.1);
  EXPECT_EQ(device.profile.coulomb_newton, 0.1);
  EXPECT_EQ(device.profile.position_resolution_m, 55e-6);
  EXPECT_EQ(session.side().simulated.mass_kg, 0.045);
  EXPECT_EQ(session.side().simulated.viscous_newton_s_per_m, 0.1);
  EXPECT_EQ(session.side().simulated.coulomb_newton, 0.1);
  EXPECT_EQ(session.side().simulated.position_resolution_m, 55e-6);
  EXPECT_EQ(session.side().simulated.peak_force_newton, 3.3);
  EXPECT_EQ(session.side().simulated.inner_step, 50us);

  EXPECT_EQ(session.side().hand.mass_kg, 0.255);
  EXPECT_EQ(session.side().hand.stiffness_newton_per_m, 150.0);
  EXPECT_EQ(session.side().hand.damping_newton_s_per_m, 6.0);
  EXPECT_EQ(std::get<HoldPath>(session.side().hand.path).position_m, Vector3(0, 0, 0));
  EXPECT_THAT(session.side().hand.presses, IsEmpty());
  EXPECT_FALSE(session.side().hand.pointer.has_value());

  // 6 physics periods of 1 ms are less than 150 ms
  EXPECT_EQ(session.side().mofc.controller, ControllerKind::kMofc);
  EXPECT_EQ(session.side().mofc.mode, MofcMode::kGuard);
  EXPECT_EQ(session.side().mofc.wait_for_physics, 0ms);
  EXPECT_EQ(session.side().mofc.stale_after, 150ms);
  EXPECT_EQ(session.side().mofc.still_after, 1500ms);
  EXPECT_EQ(session.side().mofc.fade, 50ms);
  const auto& velocity = std::get<KalmanVelocity>(session.side().mofc.velocity_estimator);
  EXPECT_EQ(velocity.model, KalmanVelocity::Model::kConstantAcceleration);
  EXPECT_EQ(velocity.noise_density, 0.1);
  EXPECT_EQ(velocity.moving_mass_kg, 0.3);
  EXPECT_EQ(velocity.hand_stiffness_newton_per_m, 150.0);
  EXPECT_EQ(velocity.hand_damping_newton_s_per_m, 6.0);
  EXPECT_EQ(velocity.intention_density, 0.002);

  EXPECT_EQ(session.physics.rate_hz, 1000.0);
  EXPECT_EQ(session.scene.tip_radius_m, 0.0);
  EXPECT_THAT(session.scene.tissues, IsEmpty());
  EXPECT_EQ(session.viewer.status_interval, 500ms);
  EXPECT_TRUE(session.viewer.web.is_on);
  EXPECT_EQ(session.viewer.web.port, 8765);
  EXPECT_FALSE(session.faults.device_state.any());
  EXPECT_FALSE(session.faults.force_command.any());
  EXPECT_FALSE(session.faults.tool_motion.any());
  EXPECT_FALSE(session.faults.interaction.any());
}

TEST(SessionFile, TheMonitorCanBeSwitchedOffAndAssumesOfTheHandWhatTheControllerDoes) {
  const auto device = [](const std::string& text) {
    return parse_session("name: \"x\" " + text, "x.txtpb").side().device;
  };
  EXPECT_FALSE(device("device { monitor: off }").monitor.is_on);
  EXPECT_TRUE(device("device { monitor: on }").monitor.is_on);
  EXPECT_TRUE(device("device { hands_off_check: true }").has_hands_off_check);
  EXPECT_EQ(device("mofc { guard_settings { v_max_m_per_s: 0.7 } }").monitor.v_max_m_per_s, 0.7);
  EXPECT_TRUE(std::isinf(device("mofc { mode: vector }").monitor.v_max_m_per_s));
}

TEST(SessionFile, DefaultsFollowTheRates) {
  const Session session =
      parse_session("name: \"x\" device { rate_hz: 50 } physics { rate_hz: 20 }", "x.txtpb");

  // device period 20 ms; 6 physics periods of 50 ms
  EXPECT_EQ(session.side().device.reply, 10300us);
  EXPECT_EQ(session.side().device.lease, 20ms);
  EXPECT_EQ(session.side().device.longest_lease, 40ms);
  EXPECT_EQ(session.side().device.limp_after, 400ms);
  EXPECT_EQ(session.side().device.fade, 50ms);
  EXPECT_EQ(session.side().mofc.stale_after, 300ms);
}

TEST(SessionFile, AHeldForceIsStaleEarlier) {
  EXPECT_EQ(parse_session("name: 'x' mofc { interaction: held }", "x").side().mofc.stale_after,
            6ms);
}

// A simulated fault must not change the product.
TEST(SessionFile, NoDefaultOfTheClampDependsOnTheFaults) {
  const Session calm = parse_session("name: 'x'", "x.txtpb");
  const Session rough = parse_session(
      "name: 'x' faults { interaction { jitter_ms: 70 delay_ms: 30 } tool_motion { jitter_ms: 70 } "
      "}",
      "x.txtpb");
  EXPECT_EQ(rough.side().mofc.stale_after, calm.side().mofc.stale_after);
}

TEST(SessionFile, DefaultFadeIsAtLeastOnePeriod) {
  EXPECT_EQ(parse_session("name: \"x\" device { rate_hz: 10 }", "x").side().device.fade, 100ms);
}

TEST(SessionFile, DefaultPeakForceIsThatOfTheSimulatedDevice) {
  const Session session =
      parse_session("name: \"x\" device { simulated { peak_force_newton: 12 } }", "x.txtpb");

  EXPECT_EQ(session.side().device.peak_force_newton, 12.0);
}

TEST(SessionFile, DefaultReplyLeavesRoomForTheWait) {
  const auto reply = [](const char* wait_ms) {
    return parse_session("name: \"x\" device { rate_hz: 50 } physics { rate_hz: 50 }", "x",
                         {std::string("mofc.wait_for_physics_ms=") + wait_ms})
        .side()
        .device.reply;
  };

  // period 20 ms: half of it and 0.3 ms; wait + 2 ms; the middle between wait and period
  EXPECT_EQ(reply("5"), 10300us);
  EXPECT_EQ(reply("15"), 17ms);
  EXPECT_EQ(reply("19"), 19500us);
}

// --- conversion -------------------------------------------------------------------------------

TEST(SessionFile, ReadsEveryKindOfTissue) {
  const Session session = parse_session(
      R"(name: "x" scene {
           tool { tip_radius_m: 0.003 shaft_length_m: 0.1 }
           tissue { half_space { point_m { z: 1 } normal { x: 3 z: 4 } }
                    kelvin_voigt { stiffness_newton_per_m: 6 damping_newton_s_per_m: 15
                                   isotropic_damping: true adhesive: true } }
           tissue { name: "ball" sphere { center_m { y: 2 } radius_m: 0.5 }
                    kelvin_voigt { stiffness_newton_per_m: 7 friction_coefficient: 0.3
                                   puncture_newton: 2 } }
           tissue { box { size_m { x: 1 y: 2 z: 3 } }
                    kelvin_voigt { stiffness_newton_per_m: 8 } } })",
      "x.txtpb");

  EXPECT_EQ(session.scene.tip_radius_m, 0.003);
  EXPECT_EQ(session.scene.shaft_length_m, 0.1);
  EXPECT_EQ(session.scene.shaft_radius_m, 0.003);
  ASSERT_THAT(session.scene.tissues, SizeIs(3));
  const auto& [plane, ball, box] =
      std::tie(session.scene.tissues[0], session.scene.tissues[1], session.scene.tissues[2]);
  EXPECT_EQ(plane.name, "tissue0");
  EXPECT_EQ(std::get<HalfSpaceGeometry>(plane.geometry).point_m, Vector3(0, 0, 1));
  // 3-4-5
  EXPECT_TRUE(std::get<HalfSpaceGeometry>(plane.geometry).normal.isApprox(Vector3(0.6, 0, 0.8)));
  const auto& material = std::get<KelvinVoigtMaterial>(plane.material);
  EXPECT_EQ(material.stiffness_newton_per_m, 6.0);
  EXPECT_EQ(material.damping_newton_s_per_m, 15.0);
  EXPECT_TRUE(material.is_damping_isotropic);
  EXPECT_TRUE(material.is_adhesive);
  EXPECT_EQ(ball.name, "ball");
  EXPECT_EQ(std::get<SphereGeometry>(ball.geometry).center_m, Vector3(0, 2, 0));
  EXPECT_EQ(std::get<SphereGeometry>(ball.geometry).radius_m, 0.5);
  EXPECT_FALSE(std::get<KelvinVoigtMaterial>(ball.material).is_damping_isotropic);
  EXPECT_FALSE(std::get<KelvinVoigtMaterial>(ball.material).is_adhesive);
  EXPECT_EQ(std::get<KelvinVoigtMaterial>(ball.material).damping_newton_s_per_m, 0.0);
  EXPECT_EQ(std::get<KelvinVoigtMaterial>(ball.material).friction_coefficient, 0.3);
  EXPECT_EQ(std::get<KelvinVoigtMaterial>(ball.material).friction_stiffness_newton_per_m, 7.0);
  EXPECT_EQ(std::get<KelvinVoigtMaterial>(ball.material).puncture_newton, 2.0);
  EXPECT_EQ(std::get<KelvinVoigtMaterial>(ball.material).cutting_newton, 0.5);
  EXPECT_EQ(material.friction_coefficient, 0.0);
  EXPECT_EQ(material.puncture_newton, 0.0);
  EXPECT_EQ(box.name, "tissue2");
  EXPECT_EQ(std::get<BoxGeometry>(box.geometry).size_m, Vector3(1, 2, 3));
}

// Only physics_node reads the files; none of these exists.
TEST(SessionFile, ReadsGeometriesFromFilesWithoutOpeningThem) {
  const Session session = parse_session(
      R"(name: "x" scene {
           tissue { point_cloud { file: "scan.ply" } unit_m: 0.001
                    position_m { x: 1 } rotation_rad { z: 1.5 }
                    kelvin_voigt { stiffness_newton_per_m: 6 stiffness_property: "k" } }
           tissue { triangle_surface { file: "../bone.stl" }
                    kelvin_voigt { stiffness_newton_per_m: 6 } }
           tissue { tetrahedral_mesh { file: "/data/liver.msh" }
                    kelvin_voigt { stiffness_newton_per_m: 6 } }
           tissue { capsule { to_m { y: 2 } radius_m: 0.5 }
                    kelvin_voigt { stiffness_newton_per_m: 6 } } })",
      "x.txtpb", {}, "folder");

  ASSERT_THAT(session.scene.tissues, SizeIs(4));
  const auto file = [&](std::size_t i) {
    return std::get<FileGeometry>(session.scene.tissues[i].geometry);
  };
  EXPECT_EQ(file(0).kind, FileGeometry::Kind::kPointCloud);
  EXPECT_EQ(file(0).file, "folder/scan.ply");
  EXPECT_EQ(file(0).unit_m, 0.001);
  EXPECT_EQ(file(0).stiffness_property, "k");
  EXPECT_EQ(file(0).position_m, Vector3(1, 0, 0));
  EXPECT_NEAR(file(0).rotation.angularDistance(Quaternion::Identity()), 1.5, 1e-12);
  EXPECT_EQ(file(1).kind, FileGeometry::Kind::kTriangleSurface);
  EXPECT_EQ(file(1).file, "folder/../bone.stl");
  EXPECT_EQ(file(1).unit_m, 1.0);
  EXPECT_EQ(file(2).kind, FileGeometry::Kind::kTetrahedralMesh);
  EXPECT_EQ(file(2).file, "/data/liver.msh");
  const auto& capsule = std::get<CapsuleGeometry>(session.scene.tissues[3].geometry);
  EXPECT_EQ(capsule.to_m, Vector3(0, 2, 0));
  EXPECT_EQ(capsule.radius_m, 0.5);
}

TEST(SessionFile, ReadsEveryKindOfHandPath) {
  const auto path = [](const std::string& text) {
    return parse_session("name: \"x\" hand { " + text + "}", "x.txtpb").side().hand.path;
  };

  const auto v = std::get<VPath>(path("v { free_motion_s: 14 }"));
  EXPECT_EQ(v.apex_m, Vector3(0, 0, -0.02));
  EXPECT_EQ(v.height_m, 0.05);
  EXPECT_EQ(v.half_width_m, 0.03);
  EXPECT_EQ(v.speed_m_per_s, 0.08);
  EXPECT_EQ(v.free_motion_s, 14.0);
  EXPECT_EQ(v.free_amplitude_m, 0.02);
  EXPECT_EQ(v.free_frequency_hz, 0.5);
  EXPECT_EQ(std::get<HoldPath>(path("hold { position_m { z: 1 } }")).position_m, Vector3(0, 0, 1));
  const auto sinusoid = std::get<SinusoidPath>(
      path("sinusoid { center_m {x: 1} amplitude_m {y: 2} frequency_hz {z: 3} phase_rad {x: 4} }"));
  EXPECT_EQ(sinusoid.center_m, Vector3(1, 0, 0));
  EXPECT_EQ(sinusoid.amplitude_m, Vector3(0, 2, 0));
  EXPECT_EQ(sinusoid.frequency_hz, Vector3(0, 0, 3));
  EXPECT_EQ(sinusoid.phase_rad, Vector3(4, 0, 0));
  const auto hostile = std::get<HostilePath>(path("hostile { center_m { z: 1 } }"));
  EXPECT_EQ(hostile.center_m, Vector3(0, 0, 1));
  EXPECT_EQ(hostile.radius_m, 0.02);
  EXPECT_EQ(hostile.v_max_m_per_s, 0.5);
}

TEST(SessionFile, AlmostPerpendicularTangentIsMadePerpendicular) {
  // 0.0009 rad off, the rule allows 0.001
  const Session session = parse_session(
      "name: \"x\" hand { v { normal { z: 5 } tangent { y: 2 z: 0.0018 } } }", "x.txtpb");

  const auto& v = std::get<VPath>(session.side().hand.path);
  EXPECT_TRUE(v.normal.isApprox(Vector3::UnitZ()));
  EXPECT_NEAR(v.tangent.dot(v.normal), 0.0, 1e-15);
  EXPECT_NEAR(v.tangent.norm(), 1.0, 1e-15);
}

TEST(SessionFile, ReadsFaultsOfALink) {
  const Session session = parse_session(
      R"(name: "x" faults { tool_motion {
           delay_ms: 50 jitter_ms: 0.5 loss_ratio: 0.1 burst_ratio: 0.2 burst_length: 3
           duplicate_ratio: 0.3 reorder_ratio: 0.4 reorder_delay_ms: 2 jitter_reorders: true
           freeze { from_s: 5 until_s: 6 }
           stall { from_s: 3 until_s: 4 every_s: 9 }
           outage { until_s: 2 } } })",
      "x.txtpb");

  const LinkFaults& faults = session.faults.tool_motion;
  EXPECT_EQ(faults.delay, 50ms);
  EXPECT_EQ(faults.jitter, 500us);
  EXPECT_EQ(faults.loss_ratio, 0.1);
  EXPECT_EQ(faults.burst_ratio, 0.2);
  EXPECT_EQ(faults.burst_length, 3u);
  EXPECT_EQ(faults.duplicate_ratio, 0.3);
  EXPECT_EQ(faults.reorder_ratio, 0.4);
  EXPECT_EQ(faults.reorder_delay, 2ms);
  EXPECT_TRUE(faults.jitter_reorders);
  ASSERT_THAT(faults.windows, SizeIs(3));
  EXPECT_EQ(faults.windows[0].kind, FaultWindow::Kind::kOutage);
  EXPECT_EQ(faults.windows[0].from, 0s);
  EXPECT_EQ(faults.windows[0].until, 2s);
  EXPECT_EQ(faults.windows[0].every, 0s);
  EXPECT_EQ(faults.windows[1].kind, FaultWindow::Kind::kStall);
  EXPECT_EQ(faults.windows[1].from, 3s);
  EXPECT_EQ(faults.windows[1].every, 9s);
  EXPECT_EQ(faults.windows[2].kind, FaultWindow::Kind::kFreeze);
  EXPECT_EQ(faults.windows[2].until, 6s);
}

TEST(SessionFile, TimeAboveZeroStaysAboveZero) {
  // less than a nanosecond is rounded up: a fade of 0 would be a division by 0
  EXPECT_EQ(parse_session("name: \"x\"", "x", {"mofc.fade_ms=1e-12"}).side().mofc.fade, 1ns);
  EXPECT_EQ(parse_session("name: \"x\"", "x", {"device.start_ramp_ms=0"}).side().device.start_ramp,
            0ns);
}

TEST(SessionFile, ReadsFieldsWithoutDefaults) {
  const Session session = parse_session(
      R"(name: "x" seed: 18446744073709551615 duration_s: 2.5
         links { exchange: "tcp://127.0.0.1:5551" tool_motion: "inproc://motion" }
         realtime { priority: 0 cpu: -1 wait: spin }
         device { workspace { scale_ratio: 2 force_ratio: 0 offset_m { x: 1 } clutch_button: 3 } }
         hand { press { button: 3 from_s: 1 until_s: 2 } }
         mofc { controller: none mode: paper fade_ms: 9 })",
      "x.txtpb");

  EXPECT_EQ(session.seed, 18446744073709551615u);
  EXPECT_EQ(session.duration_s, 2.5);
  EXPECT_EQ(session.side().links.exchange, "tcp://127.0.0.1:5551");
  EXPECT_EQ(session.side().links.tool_motion, "inproc://motion");
  EXPECT_EQ(session.side().realtime.priority, 0);
  EXPECT_EQ(session.side().realtime.cpu, -1);
  EXPECT_EQ(session.side().realtime.wait, WaitStrategy::kSpin);
  EXPECT_EQ(session.side().device.workspace.scale_ratio, 2.0);
  EXPECT_EQ(session.side().device.workspace.force_ratio, 0.0);
  EXPECT_EQ(session.side().device.workspace.offset_m, Vector3(1, 0, 0));
  EXPECT_EQ(session.side().device.workspace.clutch_button, 3u);
  ASSERT_THAT(session.side().hand.presses, SizeIs(1));
  EXPECT_EQ(session.side().hand.presses[0].button, 3u);
  EXPECT_EQ(session.side().hand.presses[0].from_s, 1.0);
  EXPECT_EQ(session.side().hand.presses[0].until_s, 2.0);
  EXPECT_EQ(session.side().mofc.controller, ControllerKind::kNone);
  EXPECT_EQ(session.side().mofc.mode, MofcMode::kPaper);
  EXPECT_EQ(session.side().mofc.fade, 9ms);
}

TEST(SessionFile, ControllersOfOthersHaveTheirSettings) {
  const auto mofc = [](const std::string& text) {
    return parse_session("name: 'x' mofc { " + text + " }", "x.txtpb").side().mofc;
  };
  const std::pair<const char*, ControllerKind> kinds[] = {
      {"virtual_coupling", ControllerKind::kVirtualCoupling},
      {"energy_bounding", ControllerKind::kEnergyBounding},
      {"force_bounding", ControllerKind::kForceBounding},
      {"passivity_control", ControllerKind::kPassivityControl},
      {"memory_based", ControllerKind::kMemoryBased},
      {"input_to_state", ControllerKind::kInputToState},
      {"two_port", ControllerKind::kTwoPort},
      {"energy_tank", ControllerKind::kEnergyTank},
      {"lyapunov", ControllerKind::kLyapunov},
      {"wave_variables", ControllerKind::kWaveVariables}};
  for (const auto& [name, kind] : kinds) {
    const MofcConfig config = mofc(std::string("controller: ") + name);
    EXPECT_EQ(config.controller, kind) << name;
    EXPECT_EQ(controller_text(config), name);
    EXPECT_FALSE(config.has_safety_net);
    EXPECT_EQ(controller_text(mofc(std::string("safety_net: true controller: ") + name)),
              std::string(name) + " behind guard");
  }
  const RivalsConfig defaults = mofc("").rivals;
  EXPECT_TRUE(defaults.force_bounding.is_more_conservative);
  EXPECT_EQ(defaults.passivity_control.observer, PassivityControlConfig::Observer::kSampled);
  EXPECT_EQ(defaults.passivity_control.most_damping_newton_s_per_m, 30.0);
  EXPECT_EQ(defaults.energy_tank.initial_joule, 0.02);
  EXPECT_EQ(defaults.lyapunov.slack_watt, 1e-3);
  const RivalsConfig given =
      mofc(
          "virtual_coupling_settings { criterion: sampled_data stiffness_newton_per_m: 200 "
          "damping_newton_s_per_m: 0.5 } force_bounding_settings { variant: less_conservative } "
          "passivity_control_settings { observer: reference most_damping_newton_s_per_m: 9 "
          "least_speed_m_per_s: 0.02 } input_to_state_settings { time_constant_ms: 4 } "
          "energy_tank_settings { initial_joule: 0 most_joule: 1 valve_joule: 0.5 "
          "damping_newton_s_per_m: 3 } lyapunov_settings { least_mass_kg: 0.2 most_mass_kg: 0.4 "
          "hand_force_newton: 7 slack_watt: 0 }")
          .rivals;
  EXPECT_EQ(given.virtual_coupling.criterion, VirtualCouplingConfig::Criterion::kSampledData);
  EXPECT_EQ(given.virtual_coupling.stiffness_newton_per_m, 200.0);
  EXPECT_EQ(given.virtual_coupling.damping_newton_s_per_m, 0.5);
  EXPECT_FALSE(given.force_bounding.is_more_conservative);
  EXPECT_EQ(given.passivity_control.observer, PassivityControlConfig::Observer::kReference);
  EXPECT_EQ(given.passivity_control.most_damping_newton_s_per_m, 9.0);
  EXPECT_EQ(given.passivity_control.least_speed_m_per_s, 0.02);
  EXPECT_EQ(given.input_to_state.time_constant, 4ms);
  EXPECT_EQ(given.energy_tank.initial_joule, 0.0);
  EXPECT_EQ(given.energy_tank.most_joule, 1.0);
  EXPECT_EQ(given.energy_tank.valve_joule, 0.5);
  EXPECT_EQ(given.energy_tank.damping_newton_s_per_m, 3.0);
  EXPECT_EQ(given.lyapunov.least_mass_kg, 0.2);
  EXPECT_EQ(given.lyapunov.most_mass_kg, 0.4);
  EXPECT_EQ(given.lyapunov.hand_force_newton, 7.0);
  EXPECT_EQ(given.lyapunov.slack_watt, 0.0);
}

// silence that the deadbands allow: 150 ms and 3 keep-alives of each deadband
TEST(SessionFile, DeadbandsAreOffUnlessGivenAndCountInStaleAfter) {
  const Session plain = parse_session("name: 'x'", "x.txtpb");
  EXPECT_FALSE(plain.side().mofc.motion_deadband.has_value());
  EXPECT_FALSE(plain.physics.interaction_deadband.has_value());

  const Session thinned = parse_session("name: 'x'", "x.txtpb", {"mofc.motion_deadband={}"});
  ASSERT_TRUE(thinned.side().mofc.motion_deadband.has_value());
  EXPECT_EQ(thinned.side().mofc.motion_deadband->ratio, 0.05);
  EXPECT_EQ(thinned.side().mofc.motion_deadband->floor_m_per_s, 2e-3);
  EXPECT_EQ(thinned.side().mofc.motion_deadband->floor_m, 1e-4);
  EXPECT_EQ(thinned.side().mofc.motion_deadband->floor_rad, 0.02);
  EXPECT_EQ(thinned.side().mofc.motion_deadband->keep_alive, 20ms);
  EXPECT_EQ(thinned.side().mofc.stale_after, 210ms);

  const Session both = parse_session(
      "name: 'x' mofc { motion_deadband {} } physics { interaction_deadband { ratio: 0.1 "
      "floor_newton: 0.2 keep_alive_ms: 5 } }",
      "x.txtpb");
  ASSERT_TRUE(both.physics.interaction_deadband.has_value());
  EXPECT_EQ(both.physics.interaction_deadband->ratio, 0.1);
  EXPECT_EQ(both.physics.interaction_deadband->floor_newton, 0.2);
  EXPECT_EQ(both.physics.interaction_deadband->keep_alive, 5ms);
  EXPECT_EQ(both.side().mofc.stale_after, 225ms);
}

TEST(SessionFile, ReadsEveryVelocityEstimator) {
  const auto estimator = [](const std::string& text) {
    return parse_session("name: 'x' mofc { velocity_estimator { " + text + " } }", "x.txtpb")
        .side()
        .mofc.velocity_estimator;
  };
  const auto difference =
      std::get<DifferenceVelocity>(estimator("difference { time_constant_ms: 4 }"));
  EXPECT_EQ(difference.time_constant, 4ms);

  const auto window = std::get<AdaptiveWindowVelocity>(
      estimator("adaptive_window { max_window_ms: 9 end_fit: true time_constant_ms: 2 }"));
  EXPECT_EQ(window.max_window, 9ms);
  EXPECT_FALSE(window.is_best_fit);
  EXPECT_EQ(window.time_constant, 2ms);
  const auto default_window = std::get<AdaptiveWindowVelocity>(estimator("adaptive_window {}"));
  EXPECT_EQ(default_window.max_window, 20ms);
  EXPECT_TRUE(default_window.is_best_fit);

  const auto second = std::get<KalmanVelocity>(
      estimator("kalman_velocity { acceleration_density_m2_per_s3: 0.5 moving_mass_kg: 0 }"));
  EXPECT_EQ(second.model, KalmanVelocity::Model::kConstantVelocity);
  EXPECT_EQ(second.noise_density, 0.5);
  EXPECT_EQ(second.moving_mass_kg, 0.0);
  EXPECT_EQ(std::get<KalmanVelocity>(estimator("kalman_velocity {}")).noise_density, 0.01);

  const auto third = std::get<KalmanVelocity>(
      estimator("kalman_acceleration { jerk_density_m2_per_s5: 70 moving_mass_kg: 0.1 }"));
  EXPECT_EQ(third.model, KalmanVelocity::Model::kConstantAcceleration);
  EXPECT_EQ(third.noise_density, 70.0);
  EXPECT_EQ(third.moving_mass_kg, 0.1);
}

TEST(SessionFile, ReadsHuntAndCrossley) {
  const Session session = parse_session(
      "name: 'a' scene { tissue { half_space {} hunt_crossley { stiffness_newton_per_m: 400 "
      "damping_newton_s_per_m: 3 exponent: 2 depth_m: 0.002 friction_coefficient: 0.3 } } "
      "tissue { half_space {} hunt_crossley { stiffness_newton_per_m: 500 } } }",
      "x.txtpb");
  const auto& given = std::get<KelvinVoigtMaterial>(session.scene.tissues[0].material);
  EXPECT_EQ(given.stiffness_newton_per_m, 400.0);
  EXPECT_EQ(given.damping_newton_s_per_m, 3.0);
  EXPECT_EQ(given.exponent, 2.0);
  EXPECT_EQ(given.exponent_depth_m, 0.002);
  EXPECT_EQ(given.friction_coefficient, 0.3);
  EXPECT_EQ(given.friction_stiffness_newton_per_m, 400.0);
  const auto& left_out = std::get<KelvinVoigtMaterial>(session.scene.tissues[1].material);
  EXPECT_EQ(left_out.exponent, 1.5);
  EXPECT_EQ(left_out.exponent_depth_m, 0.001);
  EXPECT_EQ(KelvinVoigtMaterial{}.exponent, 0.0) << "kelvin_voigt has none";
}

TEST(SessionFile, AnEmptyPointerMessageTurnsThePointerOn) {
  const auto pointer = parse_session("name: \"x\" hand { pointer {} }", "x").side().hand.pointer;
  ASSERT_TRUE(pointer.has_value());
  EXPECT_EQ(pointer->center_m, Vector3(0, 0, 0));
  EXPECT_EQ(pointer->reach_m, 0.1);
  EXPECT_EQ(pointer->speed_m_per_s, 0.25);
  EXPECT_EQ(pointer->holder_timeout, 2s);

  const auto other = parse_session(
      R"(name: "x" hand { v {} pointer { center_m { z: 1 } reach_m: 0.05 speed_m_per_s: 0.1
                                         holder_timeout_ms: 500 } })",
      "x");
  EXPECT_TRUE(std::holds_alternative<VPath>(other.side().hand.path));
  EXPECT_EQ(other.side().hand.pointer->center_m, Vector3(0, 0, 1));
  EXPECT_EQ(other.side().hand.pointer->reach_m, 0.05);
  EXPECT_EQ(other.side().hand.pointer->speed_m_per_s, 0.1);
  EXPECT_EQ(other.side().hand.pointer->holder_timeout, 500ms);
}

TEST(SessionFile, TheWebServerCanBeMovedAndTurnedOff) {
  const WebConfig web = parse_session("name: \"x\" viewer { web { port: 80 } }", "x").viewer.web;
  EXPECT_TRUE(web.is_on);
  EXPECT_EQ(web.port, 80);
  EXPECT_FALSE(parse_session("name: \"x\"", "x", {"viewer.web.disabled=true"}).viewer.web.is_on);
}

TEST(SessionFile, ItsTextIsTheSessionWithOverridesApplied) {
  const std::vector<std::string> overrides = {"seed=5", "mofc.controller=none"};
  const Session session = parse_session("name: \"x\"  # comment\nseed: 4", "x", overrides);

  EXPECT_EQ(session.text, "name: \"x\"\nseed: 5\nmofc {\n  controller: none\n}\n");
  EXPECT_EQ(parse_session(session.text, "x").text, session.text);
}

// --- places -----------------------------------------------------------------------------------

TEST(SessionFile, AllProblemsAreReportedTogetherWithTheirPlaces) {
  const std::vector<std::string> lines = complaints(
      "# a comment\n"
      "name: \"x y\"\n"
      "device {\n"
      "  simulated {\n"
      "\tmass_kg: -1   coulomb: 2\n"  // a tab is one column
      "  }\n"
      "}\n"
      "scene { tissue {\n"
      "    sphere { radius_m: nan }\n"
      "} }\n");

  EXPECT_THAT(
      lines,
      ElementsAre(
          "x.txtpb: 5 problems",
          "x.txtpb:2:1: name = \"x y\": must be 1 … 64 letters, digits, '_' and '-'; it names "
          "files",
          "x.txtpb:5:2: device.simulated.mass_kg = -1: must be > 0; give the mass of the moving "
          "parts in kg",
          "x.txtpb:5:16: device.simulated.coulomb: no such field; did you mean 'coulomb_newton'?",
          "x.txtpb:8:9: scene.tissue[0]: a material is required; give kelvin_voigt { "
          "stiffness_newton_per_m: … }",
          "x.txtpb:9:14: scene.tissue[0].sphere.radius_m = nan: must be a finite number"));
}

TEST(SessionFile, SyntaxErrorIsReportedWithItsPlace) {
  const std::vector<std::string> lines = complaints("name: \"x\"\ndevice {\n  rate_hz 50\n}\n");

  ASSERT_THAT(lines, SizeIs(2));
  EXPECT_THAT(lines[1], AllOf(StartsWith("x.txtpb:3:11: cannot be read: Expected"),
                              EndsWith("write 'name: value' or 'name { … }'")));
}

// each with its remedy, and nothing of what the parser makes of the rest
TEST(SessionFile, NotationOfOtherFormatsIsNamed) {
  const std::pair<const char*, const char*> cases[] = {
      {"name: 'x'\ndevice { rate_hz: 1kHz start_ramp_ms: 3 }",
       "x.txtpb:2:19: cannot be read: 1 kHz: units are not written; give the number alone, in the "
       "unit that the name of the field ends with"},
      {"name: 'x'\ndevice { start_ramp_ms: 10 ms\n rate_hz: 50 }",
       "x.txtpb:2:25: cannot be read: 10 ms: units are not written; give the number alone, in the "
       "unit that the name of the field ends with"},
      {"name: 'x'\n// of the desk\ndevice {}",
       "x.txtpb:2:1: cannot be read: // begins no comment here; comments begin with #"},
      {"name: 'x'\nhand { hold { position_m { z: −0.01 } } }",
       "x.txtpb:2:31: cannot be read: − can stand only in quotes and comments; write letters, "
       "digits and signs of ASCII, such as - for a minus"},
      {"/* of the desk */\nname: 'x'",
       "x.txtpb:1:1: cannot be read: /* begins no comment here; comments begin with #"},
      {"{ \"name\": \"x\", \"seed\": 1 }",
       "x.txtpb:1:1: cannot be read: a session has no braces around it, unlike JSON; remove this "
       "one and the last, and write names without quotes"},
      {"name: 'x'\nmofc { \"mode\": guard }",
       "x.txtpb:2:8: cannot be read: \"mode\": names of fields have no quotes, unlike in JSON; "
       "leave them out"},
      {"name: “x”\nseed: 1",
       "x.txtpb:1:7: cannot be read: “ is no quotation mark here; write \" or ' instead"},
      {"name: 'x'\nmofc { mode: 'guard' }",
       "x.txtpb:2:14: cannot be read: 'guard': numbers and names have no quotes; write guard"},
      {"name: \"x\nseed: 1",
       "x.txtpb:1:7: cannot be read: \"x: the text does not end; end it with \""}};
  for (const auto& [text, complaint] : cases) {
    SCOPED_TRACE(text);
    EXPECT_THAT(complaints(text), ElementsAre("x.txtpb: 1 problem", complaint));
  }
  EXPECT_THAT(complaints("name: 'x'\nmofc { controller: MOFC }").at(1),
              EndsWith("did you mean 'mofc'?"));
}

TEST(SessionFile, WrongEnumeratorIsReportedWithTheRightOnes) {
  const std::vector<std::string> lines = complaints("name: \"x\"\nmofc { mode: fast }\n");

  ASSERT_THAT(lines, SizeIs(2));
  EXPECT_THAT(lines[1], AllOf(StartsWith("x.txtpb:2:"),
                              EndsWith("mofc.mode = fast: must be paper, vector or guard")));
  EXPECT_THAT(complaints("name: 'x'\nmofc { mode: gaurd }").at(1),
              EndsWith("mofc.mode = gaurd: must be paper, vector or guard; did you mean 'guard'?"));
  EXPECT_THAT(complaints("name: 'x' side { realtime { wait: never } }").at(1),
              HasSubstr("side[0].realtime.wait = never: must be hybrid, spin or block"));
}

TEST(SessionFile, WrongEnumeratorIsReportedWhereItStands) {
  EXPECT_THAT(complaints("name: 'x'\nmofc {\n  mode: gaurd\n}\n").at(1),
              StartsWith("x.txtpb:3:9: mofc.mode = gaurd"));
  EXPECT_THAT(complaints("name: 'x'\nmofc {\n  mode: true\n\n\n}\n").at(1),
              StartsWith("x.txtpb:3:9: mofc.mode = true"));
}

// what follows a number is a unit only if it is no name, though nothing is known about it
TEST(SessionFile, NumbersInAnUnknownFieldHaveNoUnits) {
  for (const char* text :
       {"name: 'x'\nscene { tissue { kelvin_voight { stiffness_newton_per_m: 250 "
        "damping_newton_s_per_m: 1 } } }",
        "name: 'x'\nhand { sinusiod { center_m { x: 0 y: 1 } amplitude_m { z: 1 } } }",
        "name: 'x'\nhnd { a: 1 b { c: 2 } }"}) {
    EXPECT_THAT(complaints(text), Contains(HasSubstr("no such field"))) << text;
    EXPECT_THAT(complaints(text), Each(Not(HasSubstr("units")))) << text;
  }
}

TEST(SessionFile, AllUnknownFieldsAreReportedBeforeASyntaxError) {
  const std::vector<std::string> lines = complaints("nam: \"x\"\nseeed: 1\nmofc {");

  ASSERT_THAT(lines, SizeIs(4));
  EXPECT_THAT(lines[1], StartsWith("x.txtpb:1:1: nam: no such field; did you mean 'name'?"));
  EXPECT_THAT(lines[2], StartsWith("x.txtpb:2:1: seeed: no such field; did you mean 'seed'?"));
  EXPECT_EQ(lines[3],
            "x.txtpb:3:7: cannot be read: the brace of mofc (line 3) is never closed; add the "
            "missing one");
}

TEST(SessionFile, UnknownFieldUnlikeAnyOtherIsAnsweredWithAllFields) {
  EXPECT_THAT(complaints("name: \"x\" physics { quality: 3 }").at(1),
              EndsWith("physics.quality: no such field; it has rate_hz, interaction_deadband, "
                       "reach_m, standby, command"));
}

// The places follow from the tokens: comments, tabs, text with braces and lists stand between.
TEST(SessionFile, UnknownFieldsAreFoundInAnyText) {
  const std::vector<std::string> lines = complaints(
      "name: 'x' # { \"\n"
      "scene {\n"
      "  tissue [ { sphere { radius_m: 1 } kelvin_voigt { stiffness_newton_per_m: 5 }\tspere {} "
      "},\n"
      "           { name: '} spere {' sphre < > } ]\n"
      "  tissue { bx: 3 }\n"
      "}\n"
      "mofc { mode: guard; contrller: none }\n");

  EXPECT_THAT(lines,
              ::testing::IsSupersetOf(
                  {"x.txtpb:3:80: scene.tissue[0].spere: no such field; did you mean 'sphere'?",
                   "x.txtpb:4:32: scene.tissue[1].sphre: no such field; did you mean 'sphere'?",
                   "x.txtpb:5:12: scene.tissue[2].bx: no such field; did you mean 'box'?",
                   "x.txtpb:7:21: mofc.contrller: no such field; did you mean "
                   "'controller'?"}));
}

TEST(SessionFile, FieldGivenTwiceIsRefused) {
  EXPECT_THAT(complaints("name: \"x\"\nname: \"y\"").at(1),
              EndsWith("x.txtpb:2:1: name: is given twice, first in line 1; leave one out"));
  EXPECT_THAT(complaints("name: \"x\"\ndevice {\n  rate_hz: 1000\n}\ndevice { rate_hz: 50 }"),
              ElementsAre("x.txtpb: 1 problem",
                          "x.txtpb:5:1: device: is given twice, first in line 2; leave one out"));
  // lists and the messages in them repeat
  EXPECT_THAT(complaints("name: 'x' scene { tissue { half_space {} kelvin_voigt { "
                         "stiffness_newton_per_m: 500 } } tissue { half_space {} kelvin_voigt { "
                         "stiffness_newton_per_m: 500 } } }"),
              SizeIs(0));
}

TEST(SessionFile, TwoMembersOfAOneofAreRefusedByName) {
  EXPECT_THAT(complaints("name: \"x\"\nhand {\n  hold { position_m { z: 0.1 } }\n  v { }\n}"),
              ElementsAre("x.txtpb: 1 problem",
                          "x.txtpb:4:3: hand.v: excludes hold in line 3; leave one out"));
}

TEST(SessionFile, AMissingBraceIsOneProblemWhereItIsMissing) {
  EXPECT_THAT(
      complaints("name: \"x\"\ndevice {\n  rate_hz: 1000\nmofc { mode: guard }\nphysics { "
                 "rate_hz: 500 }\nhand { hold { } }\nscene { tissue { half_space {} } }\n"),
      ElementsAre("x.txtpb: 1 problem",
                  "x.txtpb:4:1: cannot be read: the brace of device (line 2) is still open; close "
                  "it before 'mofc'"));
  EXPECT_THAT(complaints("name: 'x' scene {\n tissue {\n  sphere { radius_m: 0.1\n"
                         "  kelvin_voigt { stiffness_newton_per_m: 5 } }\n}\n"),
              ElementsAre("x.txtpb: 1 problem",
                          "x.txtpb:4:3: cannot be read: the brace of scene.tissue[0].sphere (line "
                          "3) is still open; close it before 'kelvin_voigt'"));
  EXPECT_THAT(complaints("name: \"x\"\ndevice {\n rate_hz: 1000 } }\nmofc { mode: guard }\n"),
              ElementsAre("x.txtpb: 1 problem",
                          "x.txtpb:3:18: cannot be read: a brace too many: nothing is open here; "
                          "remove it, or one before it"));
}

TEST(SessionFile, ADecimalCommaIsNamed) {
  EXPECT_THAT(complaints("name: \"x\"\nscene { tool { tip_radius_m: 0,003 } }"),
              ElementsAre("x.txtpb: 1 problem",
                          "x.txtpb:2:30: cannot be read: 0,003: decimals have a point; write "
                          "0.003"));
  EXPECT_THAT(complaints("name: 'x'", {"scene.tool.tip_radius_m=0,003"}).at(1),
              HasSubstr("decimals have a point; write 0.003"));
  // a comma between fields is not one
  EXPECT_THAT(complaints("name: 'x', seed: 3, duration_s: 5"), SizeIs(0));
}

// An acceptance is to be named, so that whoever reads the session sees what it accepts.
TEST(SessionFile, ANumberWhereANameBelongsIsRefused) {
  EXPECT_THAT(complaints("name: \"x\"\ndevice { accept: 1 }"),
              ElementsAre("x.txtpb: 1 problem",
                          "x.txtpb:2:18: device.accept = 1: must be NO_MOTOR_WATCHDOG"));
  EXPECT_THAT(complaints("name: 'x'\nmofc { mode: -1 }").at(1), HasSubstr("mofc.mode = -1: must"));
  EXPECT_THAT(complaints("name: 'x'", {"device.accept=1"}).at(1),
              HasSubstr("accept = 1: must be NO_MOTOR_WATCHDOG"));
  EXPECT_THAT(complaints("name: 'x'", {"device={ accept: 1 }"}).at(1),
              HasSubstr("must be NO_MOTOR_WATCHDOG"));
  EXPECT_THAT(complaints("name: 'x'\ndevice { accept: NO_MOTOR_WATCHDOG }"), SizeIs(0));
}

TEST(SessionFile, AProblemOfABlockDoesNotQuoteIt) {
  const std::string text =
      complaints(
          "name: 'x'\nscene { tissue { sphere { radius_m: 0.1 center_m { x: 0.1 y: 0.2 z: 0.3 } }\n"
          "elastic { young_pa: 3000 poisson_ratio: 0.45 density_kg_per_m3: 1000 viscosity_ms: 20 "
          "fixed { box { size_m { x: 1 y: 1 z: 1 } } } } } }")
          .at(1);
  EXPECT_EQ(text.substr(0, 80),
            std::string("x.txtpb:3:1: scene.tissue[0].elastic: needs the inside "
                        "of the body; give tetrahedral_mesh")
                .substr(0, 80));
}

// what a node says of a file that it cannot use
TEST(SessionFile, AComplaintAboutAFileGetsThePlaceThatNamesIt) {
  const test::TempFolder folder;
  const std::string file =
      folder.write("s.txtpb",
                   "name: 'x'\nscene { tissue {\n  point_cloud { file: 'missing.ply' }\n"
                   "  kelvin_voigt { stiffness_newton_per_m: 500 } } }\n");
  const Session session = load_session(file);
  const std::string missing = (folder.path() / "missing.ply").string();
  EXPECT_EQ(with_place(session, missing + ": no such file"),
            file + ":3:17: scene.tissue[0].point_cloud.file = \"missing.ply\": " + missing +
                ": no such file (relative to the folder of the session)");
  EXPECT_EQ(with_place(session, "another.ply: no such file"), "another.ply: no such file");
}

TEST(SessionFile, OtherSchemaVersionIsRefused) {
  EXPECT_THAT(complaints("name: \"x\"\nschema_version: 2").at(1),
              StartsWith("x.txtpb:2:1: schema_version = 2: this program reads version 1 only"));
}

TEST(SessionFile, OneMistakeIsOneProblem) {
  // the lease is valid for 50 Hz; without a valid rate it is not judged
  EXPECT_THAT(complaints("name: \"x\" device { rate_hz: nan lease_us: 20000 limp_after_ms: 30"
                         " reply_us: 9000 fade_ms: 30 } mofc { wait_for_physics_ms: 5 }"),
              SizeIs(2));
  EXPECT_THAT(complaints("name: \"x\" hand { v { normal { z: inf } } }"), SizeIs(2));
}

TEST(SessionFile, OnlyTheFirstHundredProblemsAreReported) {
  std::string text = "name: \"x\"\n";
  for (int i = 0; i < 300; ++i) text += "nonsense: 1\n";

  const std::vector<std::string> lines = complaints(text);

  ASSERT_THAT(lines, SizeIs(101));
  EXPECT_EQ(lines[0], "x.txtpb: more than 100 problems");
}

TEST(SessionFile, EachProblemIsOneLine) {
  EXPECT_THAT(complaints("name: \"a\\nb\\x07\""), SizeIs(2));
  EXPECT_THAT(complaints("name: \"x\"", {"scene.tissue={\nbox{} }"}), SizeIs(3));
}

TEST(SessionFile, EndlessBracesAreRefused) {
  std::string text = "name: \"x\" ";
  for (int i = 0; i < 200'000; ++i) text += "a {";

  EXPECT_THAT(complaints(text).at(1), HasSubstr("braces nested more than 32 deep"));
}

TEST(SessionFile, AdversaryIsHonestByDefaultAndReadByName) {
  const Session honest = parse_session("name: \"x\" adversary { physics: honest }", "x", {});
  EXPECT_FALSE(honest.adversary.is_any());
  const Session hostile =
      parse_session("name: \"x\"", "x",
                    {"adversary.physics=everything", "adversary.clamp=mostly_right",
                     "adversary.tick_jitter_ratio=0.5"});
  EXPECT_EQ(hostile.adversary.physics, HostilePhysics::kEverything);
  EXPECT_EQ(hostile.adversary.clamp, LyingClamp::kMostlyRight);
  EXPECT_EQ(hostile.adversary.tick_jitter_ratio, 0.5);
  EXPECT_THAT(complaints("name: \"x\" adversary { tick_jitter_ratio: 0.6 }").at(1),
              HasSubstr("adversary.tick_jitter_ratio = 0.6: must be 0 … 0.5"));
}

TEST(SessionFile, WritesNothingToStandardError) {
  ::testing::internal::CaptureStderr();

  static_cast<void>(complaints("name: 3 { \x01 \"", {"name='", "device.rate_hz={}"}));
  static_cast<void>(complaints("nme: 3", {"name='", "device.rate_hz={}", "hand.press[9]={}"}));

  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
}

// --- files ------------------------------------------------------------------------------------

TEST_F(SessionFolder, SessionIsReadFromAFile) {
  const Session session = load_session(write("s.txtpb", "name: \"x\""), {"seed=7"});

  EXPECT_EQ(session.file, (folder_ / "s.txtpb").string());
  EXPECT_EQ(session.seed, 7u);
}

TEST_F(SessionFolder, AByteOrderMarkIsNoText) {
  const Session session = load_session(write("s.txtpb", "\xEF\xBB\xBFname: \"x\""));
  EXPECT_EQ(session.name, "x");
  EXPECT_THAT(complaint_of_file(write("wrong.txtpb", "\xEF\xBB\xBFname: \"x\" seet: 1")),
              HasSubstr("wrong.txtpb:1:11"));
}

TEST_F(SessionFolder, TenThousandTissuesAreAnOrdinaryFile) {
  std::string text = "name: \"many\"\nscene {\n";
  for (int i = 0; i < 10'000; ++i) {
    text += "  tissue {\n    name: \"tissue_of_the_abdomen_" + std::to_string(i) +
            "\"\n    sphere { center_m { x: " + std::to_string(1e-3 * i) +
            " y: 0.0125 z: -0.0375 } radius_m: 0.0125 }\n    kelvin_voigt {\n"
            "      stiffness_newton_per_m: 300.0\n      damping_newton_s_per_m: 1.5\n    }\n  }\n";
  }
  text += "}\n";
  EXPECT_GT(text.size(), 1'000'000u);
  EXPECT_THAT(load_session(write("many.txtpb", text)).scene.tissues, SizeIs(10'000));
}

TEST_F(SessionFolder, TheKeyFolderIsRelativeToTheSession) {
  const auto file = write("s.txtpb", "name: \"x\" security { key_folder: \"keys\" }");

  EXPECT_EQ(load_session(file).security.key_folder, (folder_ / "keys").string());
  EXPECT_FALSE(load_session(file).security.may_be_plain);
  EXPECT_EQ(load_session(write("p.txtpb", "name: \"x\"")).security.key_folder, "");
}

TEST(SessionFile, SecurityWithoutAFolderIsAProblem) {
  EXPECT_THAT(complaints("name: \"x\" security {}").at(1),
              AllOf(HasSubstr("security.key_folder: required"), HasSubstr("palpate keygen")));
}

TEST_F(SessionFolder, UnreadableFilesAreReportedWithTheReason) {
  ASSERT_EQ(::mkfifo((folder_ / "pipe").c_str(), 0600), 0);

  EXPECT_THAT(complaint_of_file(folder_ / "none.txtpb"), HasSubstr("none.txtpb: no such file"));
  EXPECT_THAT(complaint_of_file(folder_), HasSubstr("is a folder"));
  EXPECT_THAT(complaint_of_file(folder_ / "pipe"), HasSubstr("is not a regular file"));
  std::string big;
  big.resize(16'000'001, ' ');
  EXPECT_THAT(complaint_of_file(write("big", big)), HasSubstr("has more than 16000000 bytes"));
}

TEST_F(SessionFolder, FileWithoutPermissionIsReported) {
  if (::geteuid() == 0) GTEST_SKIP() << "root may read everything";
  const std::filesystem::path file = write("closed.txtpb", "name: \"x\"");
  std::filesystem::permissions(file, std::filesystem::perms::none);

  EXPECT_THAT(complaint_of_file(file), HasSubstr("cannot be read; check its permissions"));
}

TEST(SessionFile, EveryShippedSessionLoads) {
  std::vector<std::string> names;
  for (const auto& entry :
       std::filesystem::directory_iterator(test::source_dir() + "/deploy/sessions")) {
    if (entry.path().extension() != ".txtpb") continue;
    EXPECT_EQ(complaint_of_file(entry.path()), "");
    EXPECT_EQ(load_session(entry.path()).name, entry.path().stem());
    names.push_back(entry.path().stem());
  }

  EXPECT_THAT(names, ::testing::IsSupersetOf({"default", "cloud", "liver", "paper_soft",
                                              "paper_rigid", "paper_mixed", "two_machines"}));
}

TEST(SessionFile, PaperSessionsAreThoseOfThePaper) {
  for (const char* name : {"paper_soft", "paper_rigid", "paper_mixed"}) {
    SCOPED_TRACE(name);
    const Session session =
        load_session(test::source_dir() + "/deploy/sessions/" + name + ".txtpb");

    EXPECT_EQ(session.side().device.rate_hz, 50.0);
    EXPECT_EQ(session.physics.rate_hz, 50.0);
    EXPECT_EQ(session.side().device.lease, 20ms);
    EXPECT_EQ(session.side().device.reply, 17ms);
    EXPECT_EQ(session.side().mofc.wait_for_physics, 15ms);
    EXPECT_EQ(session.side().mofc.mode, MofcMode::kPaper);
    EXPECT_EQ(session.side().simulated.mass_kg + session.side().hand.mass_kg, 0.3);
    EXPECT_EQ(std::get<VPath>(session.side().hand.path).free_motion_s, 14.0);
    for (const TissueConfig& tissue : session.scene.tissues) {
      const auto& material = std::get<KelvinVoigtMaterial>(tissue.material);
      const bool is_soft = tissue.name == "soft";
      EXPECT_EQ(material.stiffness_newton_per_m, is_soft ? 6.0 : 45.0);
      EXPECT_EQ(material.damping_newton_s_per_m, is_soft ? 15.0 : 150.0);
      EXPECT_TRUE(material.is_adhesive);
      EXPECT_TRUE(material.is_damping_isotropic);
    }
  }
}

// --- run folder -------------------------------------------------------------------------------

TEST(RunFolder, IsTheConfiguredOneElseTheUsersElseInTmp) {
  const Variable xdg("XDG_RUNTIME_DIR", "/run/user/7");
  {
    const Variable run_dir("PALPATE_RUN_DIR", "/run/p");
    EXPECT_EQ(run_folder("s"), "/run/p/s");
  }
  const Variable run_dir("PALPATE_RUN_DIR", nullptr);
  EXPECT_EQ(run_folder("s"), "/run/user/7/palpate/s");
  const Variable no_xdg("XDG_RUNTIME_DIR", "");
  EXPECT_EQ(run_folder("s"), "/tmp/palpate-" + std::to_string(::getuid()) + "/s");
}

TEST(RunFolder, TooLongForASocketIsAProblem) {
  // 87 bytes of folder and "/x/exchange.ipc" (15) fit; "/x/physics_telemetry.ipc" (24) does not
  const std::string folder = "/" + std::string(86, 'f');
  const Variable run_dir("PALPATE_RUN_DIR", folder.c_str());

  const std::vector<std::string> lines = complaints("name: \"x\"");

  ASSERT_THAT(lines, ::testing::Not(IsEmpty()));
  EXPECT_THAT(lines.back(), AllOf(HasSubstr("links.physics_telemetry"), HasSubstr("111 bytes"),
                                  HasSubstr("PALPATE_RUN_DIR")));
  EXPECT_THAT(lines, ::testing::Not(::testing::Contains(HasSubstr("links.exchange"))));
}

TEST(FilesOf, AreTheSessionAndEveryFileAndFolderItNames) {
  const test::TempFolder folder;
  const auto path = [&](const char* name) { return (folder.path() / name).string(); };
  folder.write("omni.txtpb",
               "device { profile { viscous_newton_s_per_m: 0.1 coulomb_newton: 0.1 "
               "position_resolution_m: 5e-5 } }\n");
  folder.write("path.csv", "t,x,y,z\n0,0,0,0.01\n2,0,0,0\n");
  const std::string file = folder.write("session.txtpb", R"(
      name: "files"
      security { key_folder: "keys" }
      device { profile_file: "omni.txtpb" simulated {} }
      hand { recorded { file: "path.csv" } }
      scene { tissue { tetrahedral_mesh { file: "organ.msh" }
                       kelvin_voigt { stiffness_newton_per_m: 300 } } })");

  EXPECT_THAT(files_of(load_session(file)),
              ::testing::UnorderedElementsAre(file, path("keys"), path("omni.txtpb"),
                                              path("path.csv"), path("organ.msh")));
}

}  // namespace
}  // namespace palpate
