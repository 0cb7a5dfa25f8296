// SPDX-License-Identifier: Apache-2.0
// The rules of the session schema, each violated and each kept at its limit.
#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "palpate/v1/session.pb.h"
#include "tests/support/machine/places.h"
#include "tests/support/parameter_words.h"
#include "tests/unit/session/session_support.h"

namespace palpate {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::SizeIs;
using ::testing::StartsWith;

// One element of each list, so that every field has a path.
constexpr const char* kSession = R"(
  name: "x"
  hand { press { until_s: 1 } }
  scene {
    tissue {
      sphere { radius_m: 1 }
      kelvin_voigt { stiffness_newton_per_m: 5 inclusion { radius_m: 1 stiffness_newton_per_m: 5 } }
      motion { frequency_hz: 1 }
    }
  }
  faults {
    device        { skip { until_s: 1 } }
    device_state  { outage { until_s: 1 } stall { until_s: 1 } freeze { until_s: 1 } }
    force_command { outage { until_s: 1 } stall { until_s: 1 } freeze { until_s: 1 } }
    tool_motion   { outage { until_s: 1 } stall { until_s: 1 } freeze { until_s: 1 } }
    interaction   { outage { until_s: 1 } stall { until_s: 1 } freeze { until_s: 1 } }
  })";

/// With sides, so that their fields have a path too.
const std::string kTwoSides = std::string(kSession) +
                              "side { name: \"left\" hand { press { until_s: 1 } } }"
                              "side { name: \"right\" }";

// --- every number -----------------------------------------------------------------------------

/// Paths of all double fields below `type`.
void collect_numbers(const google::protobuf::Descriptor& type, const std::string& path,
                     std::vector<std::string>& numbers) {
  for (int i = 0; i < type.field_count(); ++i) {
    const google::protobuf::FieldDescriptor& field = *type.field(i);
    const std::string child =
        path + (path.empty() ? "" : ".") + field.name() + (field.is_repeated() ? "[0]" : "");
    if (field.message_type() != nullptr) {
      collect_numbers(*field.message_type(), child, numbers);
    } else if (field.cpp_type() == google::protobuf::FieldDescriptor::CPPTYPE_DOUBLE) {
      numbers.push_back(child);
    }
  }
}

std::vector<std::string> all_numbers() {
  std::vector<std::string> numbers;
  collect_numbers(*v1::Session::descriptor(), "", numbers);
  return numbers;
}

/// The assignment, after what makes the lists that the session below does not have.
std::vector<std::string> assigned(const std::string& assignment) {
  if (assignment.find(".elastic.") != std::string::npos) {
    return {
        "scene.tissue[0].elastic={ fixed {} attached {} part {} touches {} "
        "viscoelastic { branch {} } }",
        assignment};
  }
  if (assignment.starts_with("faults.standby_")) {
    const std::string link = assignment.substr(0, assignment.find('.', 7));
    return {link + "={ outage { until_s: 1 } stall { until_s: 1 } freeze { until_s: 1 } }",
            assignment};
  }
  for (const std::string list : {"task.palpation.target", "task.tissue_limit"}) {
    if (assignment.starts_with(list)) return {list + "={}", assignment};
  }
  return {assignment};
}

TEST(SessionRules, EveryNumberOfTheSchemaMustBeFinite) {
  const std::vector<std::string> numbers = all_numbers();
  ASSERT_GT(numbers.size(), 150u);  // 4 links of 17 alone are 68

  for (const std::string& path : numbers) {
    for (const std::string value : {"nan", "-nan", "inf", "-inf", "1e999"}) {
      std::string assignment = path;
      assignment.append("=").append(value);
      std::string begin = "--set ";
      begin.append(assignment).append(": ").append(path).append(" = ");
      EXPECT_THAT(
          complaints(kTwoSides, assigned(assignment)),
          ::testing::Contains(AllOf(StartsWith(begin), HasSubstr("must be a finite number"))));
    }
  }
}

TEST(SessionRules, EveryNumberOfTheSchemaIsBounded) {
  for (const std::string& path : all_numbers()) {
    EXPECT_THAT(complaints(kTwoSides, assigned(path + "=1e300")),
                ::testing::Contains(HasSubstr(path + " = 1e+300: must be within")));
  }
}

TEST(SessionRules, TimesAreBoundedInTheirUnit) {
  EXPECT_THAT(complaints(kSession, {"duration_s=1.1e6"}).at(1), HasSubstr("within ±1e6 s"));
  EXPECT_THAT(complaints(kSession, {"duration_s=1e6"}), SizeIs(0));
  EXPECT_THAT(complaints(kSession, {"faults.tool_motion.delay_ms=1.1e9"}).at(1),
              HasSubstr("must be within"));
  EXPECT_THAT(complaints(kSession, {"faults.tool_motion.delay_ms=1e9"}), SizeIs(0));
  // speed and slew rate are not times
  EXPECT_THAT(complaints(kSession, {"device.slew_newton_per_s=1e7"}), SizeIs(0));
  EXPECT_THAT(complaints(kSession, {"hand.v.speed_m_per_s=1e7"}), SizeIs(0));
}

// Beyond them hop 1 or hop 3 would refuse the message.
TEST(SessionRules, LengthsForcesAndCoefficientsOfTissueAreBounded) {
  const auto bounded = [](const std::string& path, const std::string& good,
                          const std::string& bad) {
    EXPECT_THAT(complaints(kSession, {path + "=" + good}), SizeIs(0)) << path;
    EXPECT_THAT(complaints(kSession, {path + "=" + bad}),
                ::testing::ElementsAre(testing::_, HasSubstr("must be within")))
        << path;
  };
  bounded("hand.hold.position_m.z", "-10", "-10.1");
  bounded("device.workspace.offset_m.x", "10", "10.1");
  bounded("device.peak_force_newton", "1000", "1001");
  bounded("scene.tissue[0].kelvin_voigt.stiffness_newton_per_m", "1e6", "1.1e6");
  bounded("scene.tissue[0].kelvin_voigt.damping_newton_s_per_m", "1e4", "1.1e4");
  bounded("scene.tissue[0].kelvin_voigt.stiffening_newton_per_m3", "1e9", "1.1e9");
  bounded("scene.tissue[0].kelvin_voigt.puncture_newton", "1000", "1001");
}

// --- ranges -----------------------------------------------------------------------------------

struct Rule {
  const char* path;
  std::vector<const char*> bad;
  std::vector<const char*> good;
  const char* words;                   ///< expected of each bad value
  std::vector<std::string> context{};  ///< overrides before it
};

void PrintTo(const Rule& rule, std::ostream* stream) { *stream << rule.path; }

class SessionRule : public ::testing::TestWithParam<Rule> {};

TEST_P(SessionRule, HoldsAtItsLimitAndNotBeyond) {
  const Rule& rule = GetParam();
  for (const char* value : rule.bad) {
    std::vector<std::string> overrides = rule.context;
    overrides.push_back(std::string(rule.path) + "=" + value);
    SCOPED_TRACE(overrides.back());

    const std::vector<std::string> lines = complaints(kSession, overrides);

    ASSERT_THAT(lines, SizeIs(2));
    EXPECT_THAT(lines[1], AllOf(StartsWith("--set " + overrides.back() + ": " + rule.path),
                                HasSubstr(rule.words)));
  }
  for (const char* value : rule.good) {
    std::vector<std::string> overrides = rule.context;
    overrides.push_back(std::string(rule.path) + "=" + value);
    SCOPED_TRACE(overrides.back());

    EXPECT_THAT(complaints(kSession, overrides), SizeIs(0));
  }
}

const std::vector<std::string> k50Hz = {"device.rate_hz=50", "physics.rate_hz=50"};
const char* const kPerAxis =
    "device.profile={ viscous_per_axis_newton_s_per_m { x: 1 y: 1 z: 1 } "
    "coulomb_per_axis_newton { x: 1 y: 1 z: 1 } }";
const char* const kBox = "scene.tissue[0].box={ size_m { x: 1 y: 1 z: 1 } }";

const Rule kRules[] = {
    {"name",
     {"", "a b", "a/b", "..", "ä",
      "aaaaaaaaaabbbbbbbbbbccccccccccddddddddddeeeeeeeeeeffffffffffggggg"},
     {"a", "A-b_9"},
     "letters, digits"},
    {"schema_version", {"0", "2"}, {"1"}, "version 1 only"},
    {"duration_s", {"0", "-1"}, {"1e-3"}, "must be > 0"},

    {"links.exchange",
     {"x", "udp://a:1", "ipc:/x", "IPC:///x"},
     {"ipc:///x", "ipc://@x"},
     "must be ipc://PATH, tcp://HOST:PORT or inproc://NAME"},
    {"links.exchange", {"ipc://", "ipc://*"}, {}, "must name a file"},
    // at most 107 bytes of path
    {"links.exchange",
     {"ipc:///"
      "aaaaaaaaabbbbbbbbbbccccccccccddddddddddeeeeeeeeeeffffffffffgggggggggghhhhhhhhhhiiiiiiii"
      "iijjjjjjjjjj12345678"},
     {"ipc:///"
      "aaaaaaaaabbbbbbbbbbccccccccccddddddddddeeeeeeeeeeffffffffffgggggggggghhhhhhhhhhiiiiiiii"
      "iijjjjjjjjjj1234567"},
     "108 bytes"},
    {"links.tool_motion",
     {"tcp://", "tcp://a", "tcp://:1", "tcp://*:1"},
     {"tcp://a:1"},
     "host and port"},
    {"links.tool_motion",
     {"tcp://a:", "tcp://a:*", "tcp://a:0", "tcp://a:65536", "tcp://a:1x"},
     {"tcp://a:65535", "tcp://[::1]:5551"},
     "port of 1 … 65535"},
    {"links.interaction", {"inproc://"}, {"inproc://a"}, "must have a name"},
    {"links.interaction", {"inproc://a b", "inproc:// "}, {}, "spaces or control characters"},
    {"links.interaction",
     {"inproc://same"},
     {"inproc://other"},
     "is that of links.exchange too; give each link its own",
     {"links.exchange=inproc://same"}},

    {"realtime.priority", {"-1", "100"}, {"0", "99"}, "must be 0 … 99"},
    {"realtime.cpu", {"-2", "1024"}, {"-1", "1023"}, "must be -1 … 1023"},

    {"device.rate_hz", {"9.9", "10001", "0", "-1"}, {"10", "10000"}, "must be 10 … 10000"},
    // 1 kHz: the period is 1000 µs
    {"device.reply_us", {"0", "-1"}, {"1"}, "must be > 0"},
    {"device.reply_us", {"1000"}, {"999"}, "must be < 1 period of device.rate_hz, 1000 us"},
    {"device.reply_us",
     {"15000"},
     {"15001"},
     "must be > mofc.wait_for_physics_ms, 15000 us",
     {"device.rate_hz=50", "mofc.wait_for_physics_ms=15"}},
    {"device.lease_us",
     {"999", "2501"},
     {"1000", "2500"},
     "must be 1 … 3 periods of device.rate_hz less device.reply_us, 1000 … 2500 us"},
    {"device.lease_us", {"333"}, {"333.3333"}, "333.333333 … 833.333333", {"device.rate_hz=3000"}},
    {"device.lease_us", {"2101"}, {"2100"}, "1000 … 2100 us", {"device.reply_us=900"}},
    {"device.lease_us", {"0"}, {}, "must be > 0"},
    {"device.longest_lease_us",
     {"1999", "20001"},
     {"2000", "20000"},
     "must be ≥ device.lease_us, 2000 us, and ≤ device.limp_after_ms, 20 ms"},
    {"device.longest_lease_us", {"1000001"}, {"1000000"}, "must be", {"device.limp_after_ms=2000"}},
    {"device.limp_after_ms", {"1.9"}, {"2"}, "must be ≥ device.lease_us, 2 ms"},
    {"device.limp_after_ms", {"0"}, {}, "must be > 0"},
    {"device.fade_ms", {"0.9"}, {"1"}, "must be ≥ 1 period of device.rate_hz, 1 ms"},
    {"device.fade_ms", {"0"}, {}, "must be > 0"},
    {"device.start_ramp_ms", {"-1"}, {"0"}, "must be ≥ 0"},
    {"device.peak_force_newton", {"0", "-1"}, {"0.1"}, "must be > 0"},
    {"device.slew_newton_per_s", {"-1"}, {"0"}, "must be ≥ 0"},
    {"device.v_fault_m_per_s", {"4.9", "0"}, {"5"}, "must be ≥ 5"},
    {"device.workspace.scale_ratio", {"0", "-1", "50.1"}, {"0.1", "50"}, "must be > 0, ≤ 50"},
    {"device.workspace.force_ratio", {"-0.1"}, {"0"}, "must be ≥ 0"},
    {"device.workspace.clutch_button", {"32"}, {"0", "31"}, "must be 0 … 31"},
    {"device.dead_man_button", {"32"}, {"0", "31"}, "must be 0 … 31"},
    {"device.dead_man_button",
     {"3"},
     {"2"},
     "must be another button than device.workspace.clutch_button",
     {"device.workspace.clutch_button=3"}},
    {"device.profile.viscous_newton_s_per_m", {"-1"}, {"0"}, "must be ≥ 0"},
    {"device.profile.coulomb_newton", {"-1"}, {"0"}, "must be ≥ 0"},
    {"device.profile.coulomb_newton",
     {"0.051"},
     {"0.05"},
     "must be ≤ each of coulomb_per_axis_newton, here 0.05",
     {kPerAxis, "device.profile.coulomb_per_axis_newton={ x: 0.2 y: 0.05 z: 0.1 }"}},
    {"device.profile.viscous_per_axis_newton_s_per_m.y", {"-1"}, {"0"}, "must be ≥ 0", {kPerAxis}},
    {"device.profile.coulomb_per_axis_newton.z", {"-1"}, {"0"}, "must be ≥ 0", {kPerAxis}},
    {"device.profile.position_resolution_m", {"-1"}, {"0"}, "must be ≥ 0"},
    {"device.simulated.mass_kg", {"0", "-1"}, {"0.01"}, "must be > 0"},
    {"device.simulated.viscous_newton_s_per_m", {"-1"}, {"0"}, "must be ≥ 0"},
    {"device.simulated.coulomb_newton", {"-1"}, {"0"}, "must be ≥ 0"},
    {"device.simulated.coulomb_per_axis_newton.x",
     {"-1"},
     {"0"},
     "must be ≥ 0",
     {"device.simulated.viscous_per_axis_newton_s_per_m={}"}},
    {"device.simulated.position_resolution_m", {"-1"}, {"0"}, "must be ≥ 0"},
    {"device.simulated.peak_force_newton", {"0"}, {"0.1"}, "must be > 0"},
    {"device.simulated.inner_step_us", {"0.9", "51"}, {"1", "50"}, "must be 1 … 50"},

    {"hand.mass_kg", {"-1"}, {"0"}, "must be ≥ 0"},
    {"hand.stiffness_newton_per_m", {"-1"}, {"0"}, "must be ≥ 0"},
    {"hand.damping_newton_s_per_m", {"-1"}, {"0"}, "must be ≥ 0"},
    {"hand.press[0].button", {"32"}, {"31"}, "must be 0 … 31"},
    {"hand.press[0].from_s", {"-1"}, {"0"}, "must be ≥ 0"},
    {"hand.press[0].until_s",
     {"2", "1"},
     {"2.1"},
     "must be > from_s, 2",
     {"hand.press[0].from_s=2"}},
    {"hand.pointer.reach_m", {"0"}, {"0.01"}, "must be > 0"},
    {"hand.pointer.speed_m_per_s", {"0"}, {"0.01"}, "must be > 0"},
    {"hand.pointer.holder_timeout_ms", {"99"}, {"100"}, "must be ≥ 100"},
    {"hand.v.normal", {"{}", "{ x: 0 }", "{ z: 1e-200 }"}, {"{ z: 0.01 }"}, "has no direction"},
    {"hand.v.tangent", {"{}"}, {"{ y: -3 }"}, "has no direction"},
    {"hand.v.tangent",
     {"{ x: 1 z: 0.0011 }", "{ z: 1 }"},
     {"{ x: 1 z: 0.0009 }"},
     "must be perpendicular to normal"},
    {"hand.v.normal", {"{ x: 1 }"}, {"{ y: 1 }"}, "must be perpendicular to normal"},
    {"hand.v.height_m", {"0"}, {"0.1"}, "must be > 0"},
    {"hand.v.half_width_m", {"-1"}, {"0"}, "must be ≥ 0"},
    {"hand.v.speed_m_per_s", {"0"}, {"0.1"}, "must be > 0"},
    {"hand.v.free_motion_s", {"-1"}, {"0"}, "must be ≥ 0"},
    {"hand.v.free_amplitude_m", {"-1"}, {"0"}, "must be ≥ 0"},
    {"hand.v.free_frequency_hz", {"0"}, {"0.1"}, "must be > 0"},
    {"hand.sinusoid.frequency_hz.y", {"-1"}, {"0"}, "must be ≥ 0"},
    {"hand.recorded.file", {""}, {}, "required; give a CSV file"},
    {"hand.hostile.radius_m", {"0"}, {"0.1"}, "must be > 0"},
    {"hand.hostile.v_max_m_per_s", {"0"}, {"0.1"}, "must be > 0"},

    {"mofc.wait_for_physics_ms", {"-1"}, {"0"}, "must be ≥ 0"},
    {"mofc.safety_net", {"true"}, {"false"}, "mode guard is the safety net itself"},
    {"mofc.safety_net", {}, {"true"}, "", {"mofc.mode=vector"}},
    {"mofc.safety_net", {}, {"true"}, "", {"mofc.controller=none"}},
    {"mofc.interaction",
     {"held"},
     {"local"},
     "controller virtual_coupling evaluates the contact model",
     {"mofc.controller=virtual_coupling"}},
    {"mofc.interaction",
     {"held"},
     {"local"},
     "controller lyapunov evaluates the contact model",
     {"mofc.controller=lyapunov"}},
    {"mofc.virtual_coupling_settings.stiffness_newton_per_m", {"-1"}, {"0"}, "must be ≥ 0"},
    {"mofc.virtual_coupling_settings.damping_newton_s_per_m",
     {"1"},
     {"0"},
     "needs stiffness_newton_per_m > 0"},
    {"mofc.passivity_control_settings.most_damping_newton_s_per_m",
     {"0", "-1"},
     {"0.1"},
     "must be > 0"},
    {"mofc.passivity_control_settings.least_speed_m_per_s", {"0"}, {"0.01"}, "must be > 0"},
    {"mofc.input_to_state_settings.time_constant_ms", {"0"}, {"0.1"}, "must be > 0"},
    {"mofc.energy_tank_settings.initial_joule", {"0.11"}, {"0.1"}, "must be ≤ most_joule, 0.1 J"},
    {"mofc.energy_tank_settings.valve_joule", {"0.11"}, {"0.1"}, "must be ≤ most_joule, 0.1 J"},
    {"mofc.lyapunov_settings.most_mass_kg", {"0.09"}, {"0.1"}, "must be ≥ least_mass_kg, 0.1 kg"},
    {"mofc.lyapunov_settings.slack_watt", {"-1"}, {"0"}, "must be ≥ 0"},
    {"mofc.wait_for_physics_ms", {"20", "30"}, {"19.9"}, "must be < 1 period", k50Hz},
    {"mofc.wait_for_physics_ms",
     {"1"},
     {"0"},
     "needs device.rate_hz ≤ 200, here 201",
     {"device.rate_hz=201"}},
    {"mofc.wait_for_physics_ms",
     {"1"},
     {},
     "needs physics.rate_hz ≥ device.rate_hz, here 49 < 50",
     {"device.rate_hz=50", "physics.rate_hz=49"}},
    {"mofc.stale_after_ms", {"0"}, {}, "must be > 0"},
    {"mofc.still_after_ms", {"-1", "10001"}, {"0", "10000"}, "must be 0 … 10000"},
    {"mofc.stale_after_ms", {"0.9"}, {"1"}, "must be ≥ 1 period of physics.rate_hz, 1 ms"},
    {"mofc.fade_ms", {"0"}, {"0.1"}, "must be > 0"},
    {"mofc.velocity_estimator.difference.time_constant_ms", {"-1"}, {"0"}, "must be ≥ 0"},
    {"mofc.velocity_estimator.adaptive_window.max_window_ms", {"0"}, {"0.1"}, "must be > 0"},
    {"mofc.velocity_estimator.adaptive_window.time_constant_ms", {"-1"}, {"0"}, "must be ≥ 0"},
    {"mofc.velocity_estimator.kalman_velocity.acceleration_density_m2_per_s3",
     {"0"},
     {"0.1"},
     "must be > 0"},
    {"mofc.velocity_estimator.kalman_velocity.moving_mass_kg", {"-1"}, {"0"}, "must be ≥ 0"},
    {"mofc.velocity_estimator.kalman_acceleration.jerk_density_m2_per_s5",
     {"0"},
     {"0.1"},
     "must be > 0"},
    {"mofc.velocity_estimator.kalman_acceleration.moving_mass_kg", {"-1"}, {"0"}, "must be ≥ 0"},
    {"mofc.velocity_estimator.kalman_acceleration.hand_stiffness_newton_per_m",
     {"-1"},
     {"0"},
     "must be ≥ 0"},
    {"mofc.velocity_estimator.kalman_acceleration.hand_damping_newton_s_per_m",
     {"-1"},
     {"0"},
     "must be ≥ 0"},
    {"mofc.velocity_estimator.kalman_acceleration.intention_density_m2_per_s3",
     {"-1"},
     {"0"},
     "must be ≥ 0"},
    {"mofc.motion_deadband.ratio", {"-0.1", "1.1"}, {"0", "1"}, "must be 0 … 1"},
    {"mofc.motion_deadband.floor_m", {"-1"}, {"0"}, "must be ≥ 0"},
    {"mofc.motion_deadband.floor_m_per_s", {"-1"}, {"0"}, "must be ≥ 0"},
    {"mofc.motion_deadband.floor_rad", {"-1"}, {"0"}, "must be ≥ 0"},
    {"mofc.motion_deadband.keep_alive_ms", {"0"}, {"0.1"}, "must be > 0"},
    {"mofc.motion_deadband",
     {"{}"},
     {},
     "needs mofc.wait_for_physics_ms = 0, here 1",
     {"device.rate_hz=50", "physics.rate_hz=50", "mofc.wait_for_physics_ms=1"}},
    {"physics.interaction_deadband.ratio", {"-0.1", "1.1"}, {"0", "1"}, "must be 0 … 1"},
    {"physics.interaction_deadband.floor_newton", {"-1"}, {"0"}, "must be ≥ 0"},
    {"physics.interaction_deadband.keep_alive_ms", {"0"}, {"0.1"}, "must be > 0"},
    {"physics.interaction_deadband",
     {"{}"},
     {},
     "needs mofc.wait_for_physics_ms = 0, here 1",
     {"device.rate_hz=50", "physics.rate_hz=50", "mofc.wait_for_physics_ms=1"}},
    {"mofc.stale_after_ms",
     {"25"},
     {"25.1"},
     "must be > the keep_alive_ms of the deadbands together, 25 ms",
     {"mofc.motion_deadband={keep_alive_ms: 10}",
      "physics.interaction_deadband={keep_alive_ms: 15}"}},
    {"mofc.paper_settings.friction",
     {"isotropic"},
     {"as_published"},
     "the profile gives friction per axis",
     {kPerAxis}},
    {"physics.rate_hz", {"0.9", "10001"}, {"1", "10000"}, "must be 1 … 10000"},

    {"scene.tool.tip_radius_m", {"-1"}, {"0"}, "must be ≥ 0"},
    {"scene.tool.shaft_length_m", {"-1"}, {"0"}, "must be ≥ 0"},
    {"scene.tool", {"{ shaft_radius_m: 0.001 }"}, {"{}"}, "needs shaft_length_m > 0"},
    {"scene.tool",
     {"{ shaft_length_m: 0.1 }"},
     {"{ shaft_length_m: 0.1 shaft_radius_m: 0.001 }", "{ shaft_length_m: 0.1 tip_radius_m: 1 }"},
     "required with a point as tip"},
    {"scene.tissue",
     {"{ name: 'tissue0' sphere { radius_m: 1 } kelvin_voigt { stiffness_newton_per_m: 5 } }"},
     {"{ name: 'other' sphere { radius_m: 1 } kelvin_voigt { stiffness_newton_per_m: 5 } }"},
     "scene.tissue[1].name = \"tissue0\": another tissue is called tissue0 too"},
    {"scene.tissue",
     {"{ name: 'a' kelvin_voigt { stiffness_newton_per_m: 5 } }"},
     {},
     "a geometry is required"},
    {"scene.tissue", {"{ name: 'a' half_space {} }"}, {}, "a material is required"},
    {"scene.tissue[0].half_space.normal", {"{}"}, {"{ x: 2 }"}, "has no direction"},
    {"scene.tissue[0].sphere", {"{}"}, {"{ radius_m: 2 }"}, "radius_m: required"},
    {"scene.tissue[0].sphere.radius_m", {"0", "-1"}, {"0.1"}, "must be > 0"},
    {"scene.tissue[0].box", {"{}"}, {"{ size_m { x: 1 y: 1 z: 1 } }"}, "size_m: required"},
    {"scene.tissue[0].box.size_m", {"{ x: 1 y: 1 }"}, {}, "size_m.z: required"},
    {"scene.tissue[0].box.size_m.y", {"0", "-1"}, {"0.1"}, "must be > 0", {kBox}},
    {"scene.tissue[0].capsule", {"{}"}, {"{ radius_m: 1 }"}, "radius_m: required"},
    {"scene.tissue[0].capsule.radius_m", {"0", "-1"}, {"0.1"}, "must be > 0"},
    {"scene.tissue[0].point_cloud", {"{}"}, {}, "file: required"},
    {"scene.tissue[0].triangle_surface", {"{}"}, {}, "file: required"},
    {"scene.tissue[0].tetrahedral_mesh", {"{}"}, {}, "file: required"},
    {"scene.tissue[0].point_cloud.file", {"'a.ply'"}, {}, "this session has no folder"},
    {"scene.tissue[0].unit_m", {"1"}, {}, "is for a geometry from a file only"},
    {"scene.tissue[0].position_m", {"{ x: 1 }"}, {}, "is for a geometry from a file only"},
    {"scene.tissue[0].rotation_rad", {"{ x: 1 }"}, {}, "is for a geometry from a file only"},
    {"scene.tissue[0].kelvin_voigt.stiffness_property", {"'k'"}, {}, "only a point_cloud has one"},
    {"scene.tissue[0].hunt_crossley", {"{}"}, {}, "stiffness_newton_per_m: required"},
    {"scene.tissue[0].hunt_crossley",
     {"{ stiffness_newton_per_m: 5 exponent: 0.9 }", "{ stiffness_newton_per_m: 5 exponent: 5.1 }"},
     {"{ stiffness_newton_per_m: 5 exponent: 1 }", "{ stiffness_newton_per_m: 5 exponent: 5 }"},
     "must be 1 … 5"},
    {"scene.tissue[0].hunt_crossley",
     {"{ stiffness_newton_per_m: 5 depth_m: 9e-5 }"},
     {"{ stiffness_newton_per_m: 5 depth_m: 1e-4 }"},
     "must be 0.0001 … 0.1"},
    {"scene.tissue[0].kelvin_voigt", {"{}"}, {}, "stiffness_newton_per_m: required"},
    {"scene.tissue[0].kelvin_voigt.stiffness_newton_per_m", {"-1"}, {"0"}, "must be ≥ 0"},
    {"scene.tissue[0].kelvin_voigt.damping_newton_s_per_m", {"-1"}, {"0"}, "must be ≥ 0"},
    {"scene.tissue[0].kelvin_voigt.friction_coefficient",
     {"-0.1", "10.1"},
     {"0", "10"},
     "must be 0 … 10"},
    {"scene.tissue[0].kelvin_voigt.friction_stiffness_newton_per_m",
     {"0"},
     {"1e-9"},
     "must be > 0"},
    {"scene.tissue[0].kelvin_voigt",
     {"{ friction_coefficient: 1 stiffness_newton_per_m: 0 }",
      "{ puncture_newton: 1 stiffness_newton_per_m: 0 }"},
     {"{ friction_coefficient: 1 stiffness_newton_per_m: 0 friction_stiffness_newton_per_m: 9 }"},
     "friction_stiffness_newton_per_m: required with friction or a puncture"},
    {"scene.tissue[0].kelvin_voigt.relaxation_time_ms",
     {"0.9", "1000001"},
     {"1", "1000000"},
     "must be 1 … 1000000"},
    {"scene.tissue[0].motion.frequency_hz", {"0", "20.1"}, {"20"}, "must be > 0, ≤ 20"},
    {"scene.tissue[0].motion.amplitude_m",
     {"{ y: -0.54 }"},  // 10.2 m/s
     {"{ y: -0.53 }"},
     "must be ≤ 10 m/s",
     {"scene.tissue[0].motion.frequency_hz=3"}},
    {"scene.tissue[0].kelvin_voigt.puncture_newton", {"-1"}, {"0", "2"}, "must be ≥ 0"},
    {"scene.tissue[0].kelvin_voigt.cutting_newton",
     {"-0.1", "2.1"},
     {"0", "2"},
     "must be 0 … 2",
     {"scene.tissue[0].kelvin_voigt.puncture_newton=2"}},

    {"viewer.status_interval_ms", {"49"}, {"50"}, "must be ≥ 50"},
    {"viewer.web.port", {"65536"}, {"0", "65535"}, "must be 0 … 65535"},

    {"faults.device_state.delay_ms", {"-1"}, {"0"}, "must be ≥ 0"},
    {"faults.device_state.jitter_ms", {"-1"}, {"0"}, "must be ≥ 0"},
    {"faults.force_command.loss_ratio", {"-0.1", "1.1"}, {"0", "1"}, "must be 0 … 1"},
    {"faults.force_command.burst_ratio", {"-0.1", "1.1"}, {"0", "1"}, "must be 0 … 1"},
    {"faults.tool_motion.burst_length", {"0", "1000001"}, {"1", "1000000"}, "must be 1 … 1000000"},
    {"faults.tool_motion.duplicate_ratio", {"-0.1", "1.1"}, {"0", "1"}, "must be 0 … 1"},
    {"faults.interaction.reorder_ratio",
     {"-0.1", "1.1"},
     {"0", "1"},
     "must be 0 … 1",
     {"faults.interaction.reorder_delay_ms=1"}},
    {"faults.interaction.reorder_ratio", {"0.1"}, {"0"}, "needs reorder_delay_ms > 0"},
    {"faults.interaction.reorder_delay_ms", {"-1"}, {"0"}, "must be ≥ 0"},
    {"faults.device.skip[0]", {"{ from_s: 1 }"}, {}, "until_s: required"},
    {"faults.device.late_ratio", {"-0.1", "1.1"}, {"0", "1"}, "must be 0 … 1"},
    {"faults.device.late_periods", {"0.9", "1001"}, {"1", "1000"}, "must be 1 … 1000"},
    {"faults.device.late_switch_ratio", {"-0.1", "1.1"}, {"0", "1"}, "must be 0 … 1"},
    {"faults.device.late_switch_us", {"-1", "1000001"}, {"0", "1000000"}, "must be 0 … 1"},
    {"faults.interaction.outage[0].from_s", {"-1"}, {"0"}, "must be ≥ 0"},
    {"faults.interaction.stall[0].until_s", {"-1"}, {}, "must be ≥ 0"},
    {"faults.interaction.stall[0].until_s",
     {"3", "2"},
     {"3.1"},
     "must be > from_s, 3",
     {"faults.interaction.stall[0].from_s=3"}},
    {"faults.interaction.freeze[0]", {"{ from_s: 1 }"}, {}, "until_s: required"},
    {"faults.interaction.freeze[0].every_s", {"-1"}, {"0"}, "must be ≥ 0"},
    {"faults.interaction.freeze[0].every_s", {"0.9"}, {"1"}, "must be ≥ until_s, 1"},
};

INSTANTIATE_TEST_SUITE_P(Schema, SessionRule, ::testing::ValuesIn(kRules),
                         test::parameter_words<Rule>);

TEST(SessionRules, SceneWithoutTissueIsAllowed) {
  EXPECT_THAT(complaints("name: \"x\" scene {}"), SizeIs(0));
}

// --- the program of the physics ---------------------------------------------------------------

std::vector<std::string> command_of(const std::string& list, const std::string& folder = "") {
  return parse_session("name: \"x\" physics { command: " + list + " }", "x.txtpb", {}, folder)
      .physics_command;
}

TEST(SessionRules, AProgramWithASlashIsRelativeToTheSessionAndAnyOtherIsANameInPath) {
  EXPECT_EQ(command_of(R"(["./p.py", "./a"])", "/srv/lab"),
            (std::vector<std::string>{"/srv/lab/p.py", "./a"}));
  EXPECT_EQ(command_of(R"("/usr/bin/env")", "/srv/lab"), std::vector<std::string>{"/usr/bin/env"});
  EXPECT_EQ(command_of(R"(["python3", ""])"), (std::vector<std::string>{"python3", ""}));
  EXPECT_EQ(parse_session("name: \"x\"", "x.txtpb").physics_command, std::vector<std::string>{});
}

TEST(SessionRules, AProgramThatCannotBeStartedIsRefusedWithItsPlace) {
  const auto complaint = [](const std::string& list) {
    const auto lines = complaints("name: \"x\"\nphysics { command: " + list + " }");
    return lines.empty() ? "" : lines.back();
  };
  EXPECT_THAT(complaint(R"([""])"),
              AllOf(HasSubstr("x.txtpb:2"), HasSubstr("physics.command[0]: must name a program")));
  EXPECT_THAT(complaint(R"(["./p"])"), HasSubstr("this session has no folder"));
  EXPECT_THAT(complaint(R"(["p", "a\000b"])"),
              HasSubstr("physics.command[1]: must be at most 4096 bytes, none of them zero"));
  EXPECT_THAT(complaint("[\"p\", \"" + std::string(4097, 'a') + "\"]"), HasSubstr("command[1]"));
  EXPECT_EQ(complaint("[\"p\", \"" + std::string(4096, 'a') + "\"]"), "");
  std::string many = "\"p\"";
  for (int i = 1; i < 64; ++i) many += ", \"a\"";
  EXPECT_EQ(complaint("[" + many + "]"), "");
  EXPECT_THAT(complaint("[" + many + ", \"a\"]"), HasSubstr("must be at most 64 words"));
}

TEST(SessionRules, OnlyThePhysicsOfPalpateTakesChangesOfTissues) {
  EXPECT_TRUE(parse_session("name: \"x\" viewer { control: true }", "x.txtpb").viewer.has_control);
  EXPECT_FALSE(parse_session("name: \"x\"", "x.txtpb").viewer.has_control);
  const auto lines =
      complaints("name: \"x\"\nviewer { control: true }\nphysics { command: \"other\" }");
  ASSERT_FALSE(lines.empty());
  EXPECT_THAT(lines.back(), AllOf(HasSubstr("x.txtpb:2"), HasSubstr("viewer.control"),
                                  HasSubstr("needs physics_node")));
}

TEST(SessionRules, WithARealDeviceControlChangesNoTissueSoThatAnyPhysicsWillDo) {
  const std::string real = "device { plugin { library: \"/x.so\" } }\n";
  const std::string control = "name: \"x\" viewer { control: true }\n";
  EXPECT_TRUE(may_change_tissue(parse_session(control, "x.txtpb")));
  EXPECT_FALSE(may_change_tissue(parse_session("name: \"x\"", "x.txtpb")));
  EXPECT_FALSE(may_change_tissue(parse_session(control + real, "x.txtpb")));
  for (const char* physics : {"physics { standby {} }", "physics { command: \"mine\" }"}) {
    EXPECT_FALSE(may_change_tissue(parse_session(control + real + physics, "x.txtpb")));
  }
}

TEST(SessionRules, NameIsRequired) {
  EXPECT_THAT(complaints("").at(1), StartsWith("x.txtpb:1:1: name: required"));
}

/// The complaints about a shipped session after one change.
std::vector<std::string> complaints_of(const std::string& name, const std::string& change) {
  std::ifstream stream(test::source_dir() + "/deploy/sessions/" + name + ".txtpb");
  const std::string text{std::istreambuf_iterator<char>(stream), {}};
  return complaints(text, {change});
}

TEST(SessionDrivers, AControllerOfOthersMovesARealDeviceOnlyByNameOrBehindGuard) {
  for (const char* const others : {"none", "energy_tank", "two_port"}) {
    const std::string mofc = std::string("mofc={ controller: ") + others;
    EXPECT_THAT(complaints_of("haply", mofc + " }").at(1),
                AllOf(HasSubstr("controller = " + std::string(others)),
                      HasSubstr("give safety_net: true, or accept: RIVAL_CONTROLLER")));
    EXPECT_THAT(complaints_of("haply", mofc + " accept: RIVAL_CONTROLLER }"), SizeIs(0));
    EXPECT_THAT(complaints_of("haply", mofc + " safety_net: true }"), SizeIs(0));
    EXPECT_THAT(complaints_of("default", mofc + " }"), SizeIs(0)) << "nobody holds it";
  }
}

TEST(SessionDrivers, NumbersWithoutASourceAreRequiredAndHaveToMakeSense) {
  EXPECT_THAT(complaints_of("falcon", "device.falcon.largest_torque=100"), SizeIs(0));
  EXPECT_THAT(complaints_of("falcon", "device.falcon.torque_gain=0").at(1),
              HasSubstr("device.falcon.torque_gain = 0: must not be 0; measure it"));
  EXPECT_THAT(complaints("name: \"x\" device { falcon {} }"),
              testing::Contains(AllOf(HasSubstr("falcon.torque_gain"), HasSubstr("known weight"))));
  EXPECT_THAT(complaints_of("hapi", "device.hapi.torque_step_newton_m=0.2").at(1),
              HasSubstr("device.hapi.torque_step_newton_m = 0.2: must not be larger than"));
  EXPECT_THAT(complaints_of("hapi", "device.hapi.largest_torque_newton_m=0").at(1),
              HasSubstr("MAX_TORQUE of the board's firmware"));
  EXPECT_THAT(complaints_of("wooden", "device.wooden.a.calibration_count=0.5").at(1),
              HasSubstr("calibration_count = 0.5: must be a whole number"));
  EXPECT_THAT(complaints("name: \"x\" device { wooden {} }"),
              testing::Contains(AllOf(HasSubstr("largest_current_a"), HasSubstr("3 or 6 A"))));
}

}  // namespace
}  // namespace palpate
