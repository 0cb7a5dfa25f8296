// SPDX-License-Identifier: Apache-2.0
// A plug-in with a wrist under the tick: what of a commanded torque its motors get.
#include <gtest/gtest.h>

#include <chrono>
#include <memory>

#include "device_node/drivers/plugin/plugin_driver.h"
#include "tests/support/device_node_bench.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

/// The example, which turns by 1 rad/s for 0.05 N·m.
class ExampleWithWrist final : public HapticDevice {
 public:
  explicit ExampleWithWrist(const Clock& clock, const std::string& options = "")
      : device_(
            open_plugin({.library = PALPATE_EXAMPLE_DEVICE, .options = options, .uses_wrist = true},
                        clock, {})) {}

  const DeviceSpecification& specification() const noexcept override {
    return device_->specification();
  }
  bool read(DeviceSample& sample) noexcept override { return device_->read(sample); }
  bool apply(const Vector3& force_newton, Duration lease, DeviceSample& at) noexcept override {
    return device_->apply(force_newton, lease, at);
  }
  void set_wrist_torque(const Vector3& newton_m) noexcept override {
    device_->set_wrist_torque(newton_m);
  }
  bool release() noexcept override { return device_->release(); }

 private:
  std::unique_ptr<HapticDevice> device_;
};

/// f_co 0.002 and peak 0.1 N·m; 0.05 N·m about y is commanded for 20 ticks.
struct WristRun {
  explicit WristRun(const std::string& options = "") : bench(config(), options) {
    bench.wrist_torque_newton_m = {0.0, 0.05, 0.0};
    bench.answer_with(Vector3::Zero());
    for (int i = 0; i < 5; ++i) bench.tick();
    bench.node.acknowledge();
    for (int i = 0; i < 20; ++i) bench.tick();
  }
  static DeviceConfig config() {
    DeviceConfig config = test::device_config();
    config.wrist = {.coulomb_newton_m = 0.002, .peak_torque_newton_m = 0.1};
    return config;
  }
  [[nodiscard]] double acting_newton_m() const {
    return bench.ticks.back().wrist_torque_newton_m.y();
  }
  [[nodiscard]] double angle_rad() const { return bench.states.back().wrist->pose.angle_rad.y(); }

  test::DeviceNodeBench<ExampleWithWrist> bench;
};

TEST(PluginWristInTheTick, GetsTheTorqueAndTellsTheClampWhatActed) {
  const WristRun run;
  EXPECT_DOUBLE_EQ(run.acting_newton_m(), 0.05);
  EXPECT_GT(run.angle_rad(), 0.015);
  const DeviceState& state = run.bench.states.back();
  ASSERT_GT(state.applied_count, 0U);
  EXPECT_DOUBLE_EQ(state.applied[state.applied_count - 1].wrist_torque_newton_m.y(), 0.05);
  EXPECT_DOUBLE_EQ(state.applied[state.applied_count - 1].wrist_angle_at_end_rad.y(),
                   state.wrist->pose.angle_rad.y());
}

// Nothing bounds how long they would push.
TEST(PluginWristInTheTick, WithoutAWatchdogGetsNoMoreThanFriction) {
  const WristRun run("no watchdog");
  EXPECT_DOUBLE_EQ(run.acting_newton_m(), 0.002);
  EXPECT_LE(run.angle_rad(), 0.002 / 0.05 * 0.021);
  EXPECT_GT(run.angle_rad(), 0.0);
}

TEST(PluginWristInTheTick, IsLimpUntilAPersonHasAcknowledgedIt) {
  test::DeviceNodeBench<ExampleWithWrist> bench(WristRun::config(), std::string());
  bench.wrist_torque_newton_m = {0.0, 0.05, 0.0};
  bench.answer_with(Vector3::Zero());
  for (int i = 0; i < 20; ++i) bench.tick();
  EXPECT_EQ(bench.states.back().wrist->pose.angle_rad, Vector3(0, 0, 0));
}

}  // namespace
}  // namespace palpate::device
