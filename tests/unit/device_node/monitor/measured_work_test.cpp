// SPDX-License-Identifier: Apache-2.0
// The two judges of the accounts beside the clamp: what motors measure, and the bound from above.
#include "device_node/monitor/measured_work.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstring>
#include <numbers>
#include <string>

#include "common/telemetry/verdict/fault_remedy.h"
#include "tests/support/device_node_bench.h"
#include "tests/support/scripted_device.h"

namespace palpate::device {
namespace {

using test::device_config;
using test::ScriptedDevice;
using Bench = test::DeviceNodeBench<ScriptedDevice>;

/// The hand presses 10 mm into a spring of 200 N/m along x and comes back, ten times, while motors
/// measure `measured(force)`. @return  the way until that was a finding [m]; NaN: it was none
template <class Measured>
double way_to_a_finding(const Measured& measured) {
  MeasuredWork work(device_config());  // f_co 0.1 N
  for (int i = 0; i < 10'000; ++i) {
    const double x = 0.005 * (1.0 - std::cos(2e-3 * std::numbers::pi * i));
    const Vector3 force(-200.0 * x, 0, 0);
    if (!work.message(Vector3(x, 0, 0), force, measured(force, i))) return x;
  }
  return std::nan("");
}

TEST(MeasuredWork, MotorsThatDoWhatTheyAreToldAreNoFinding) {
  EXPECT_TRUE(std::isnan(way_to_a_finding([](const Vector3& force, int) { return force; })));
  EXPECT_TRUE(std::isnan(way_to_a_finding([](const Vector3& force, int) {
    return Vector3(1.2 * force + Vector3(0.08, 0.05, 0.02));
  }))) << "wrong by a fifth and less than f_co";
  EXPECT_TRUE(std::isnan(way_to_a_finding([](const Vector3& force, int i) {
    return Vector3(force + Vector3(i % 2 == 0 ? 0.5 : -0.5, 0, 0));
  }))) << "noise";
  EXPECT_TRUE(std::isnan(way_to_a_finding([](const Vector3&, int) {
    return Vector3(Vector3::Zero());
  }))) << "nothing was ever measured: taken for a device that does not";
}

// The hand presses unresisted, and the accounts count it as work.
TEST(MeasuredWork, ASupplyThatIsLostIsFoundWithinOnePress) {
  const double way_m = way_to_a_finding(
      [](const Vector3& force, int i) { return i < 1000 ? force : Vector3(Vector3::Zero()); });
  EXPECT_GT(way_m, 0.003);
  EXPECT_LE(way_m, 0.010);
}

TEST(MeasuredWork, MotorsThatReverseInTheRunAreFoundWithinOnePress) {
  EXPECT_LE(way_to_a_finding(
                [](const Vector3& force, int i) { return i < 1000 ? force : Vector3(-force); }),
            0.010);
}

// Only the way out draws: twice the force that is counted.
TEST(MeasuredWork, MotorsTwiceAsStrongAreFound) {
  EXPECT_LE(way_to_a_finding([](const Vector3& force, int) { return Vector3(2.0 * force); }),
            0.010);
}

class Measuring final : public ScriptedDevice {
 public:
  using ScriptedDevice::ScriptedDevice;
  [[nodiscard]] bool read(DeviceSample& sample) noexcept override {
    const bool is_read = ScriptedDevice::read(sample);
    sample.measured_newton = writes.empty() ? Vector3(Vector3::Zero())
                                            : Vector3(gain * writes.back().force_on_hand_newton);
    return is_read;
  }
  double gain = 1.0;
};

TEST(DeviceNode, MeasuredForcesThatAreNotTheCommandedOnesAreAFault) {
  test::DeviceNodeBench<Measuring> bench(device_config());
  bench.answer_with(Vector3(-1, 0, 0));  // against the hand, which moves along x at 1 m/s
  for (int i = 0; i < 100; ++i) bench.tick();
  ASSERT_FALSE(bench.node.has_fault());
  bench.device.gain = 0.0;
  for (int i = 0; i < 10; ++i) bench.tick();
  EXPECT_EQ(bench.node.counters().last_fault, FaultReason::kMotorsDiffer);
  EXPECT_TRUE(bench.device.motor_force_newton(bench.clock.now()).isZero(0.0));
  EXPECT_NE(std::string(remedy_of(FaultReason::kMotorsDiffer)).find("supply"), std::string::npos);
}

/// Every double in `node` that is `account` becomes more by 0.1 J, as memory that fails.
/// @return  how many
int damage(DeviceNode& node, double account) {
  auto* const bytes = reinterpret_cast<std::byte*>(&node);
  int damaged = 0;
  for (std::size_t at = 0; at + sizeof(double) <= sizeof(node); at += alignof(double)) {
    double value = 0.0;
    std::memcpy(&value, bytes + at, sizeof(value));
    if (value != account) continue;
    value += 0.1;
    std::memcpy(bytes + at, &value, sizeof(value));
    ++damaged;
  }
  return damaged;
}

TEST(DeviceNode, AnAccountThatSaysMoreThanTheHandCanHavePutInIsAFault) {
  DeviceConfig config = device_config();
  config.monitor = {.is_on = true, .v_max_m_per_s = 1.5};
  Bench bench(config);
  bench.answer_with(Vector3(-0.05, 0, 0));
  for (int i = 0; i < 100; ++i) bench.tick();
  ASSERT_FALSE(bench.node.has_fault());
  ASSERT_GT(bench.node.monitor_joule(), 1e-3);
  // M's floor is what M was at the last reading
  const double floor_joule = bench.node.monitor_joule();
  bench.tick();
  ASSERT_FALSE(bench.node.has_fault());
  ASSERT_GT(damage(bench.node, floor_joule), 0);

  bench.tick();

  EXPECT_EQ(bench.node.phase(), DevicePhase::kFaulted);
  EXPECT_EQ(bench.node.counters().last_fault, FaultReason::kAccountWrong);
  EXPECT_EQ(bench.node.counters().device_faults, 1U);
  EXPECT_EQ(bench.ticks.back().guard, GuardState::kFault);
  EXPECT_TRUE(bench.device.motor_force_newton(bench.clock.now()).isZero(0.0));
  EXPECT_STREQ(name(bench.node.counters().last_fault), "account of the energy is wrong");
  EXPECT_NE(std::string(remedy_of(FaultReason::kAccountWrong)).find("palpate report"),
            std::string::npos);
}

}  // namespace
}  // namespace palpate::device
