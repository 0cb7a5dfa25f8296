// SPDX-License-Identifier: Apache-2.0
// wired_driver.h — what the tests of every driver with an emulator do: how a failed transfer ends,
// and the driver as the conformance suite wants it.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <stop_token>
#include <thread>
#include <vector>

#include "common/core/clock.h"
#include "common/core/random.h"
#include "device_node/device.h"
#include "device_node/drivers/start_up.h"
#include "device_node/emulators/emulated_device.h"
#include "tests/support/alloc_guard.h"
#include "tests/support/device_conformance.h"
#include "tests/support/machine/machine.h"
#include "tests/support/wired/shared_clock.h"

namespace palpate::device {

/// Limits of a transfer: one that a fault lets pass, and one that only a failing test waits for.
inline const Duration kPassingLimit = test::patience(std::chrono::milliseconds(100));
inline const Duration kAmpleLimit = test::patience(std::chrono::seconds(5));
inline const Duration kReopenLimit = test::patience(std::chrono::milliseconds(500));

/// The error of a transfer in a fault from 1 s to 2 s of `time`; after it the device opens again.
/// @param config  connects with the emulator
/// @param limit   of every transfer, good ones too
template <class Config, class Open>
DeviceError error_in_fault(Config config, test::SharedClock& time, const Open& open,
                           Duration limit = kPassingLimit) {
  using namespace std::chrono_literals;
  const SteadyClock clock;
  config.transfer_limit = limit;
  const auto device = open(config, clock, StartUp{.limit = test::patience(20s)});
  EXPECT_TRUE(device->calibrate());
  DeviceSample sample;
  EXPECT_TRUE(device->read(sample));

  time.set(1500ms);
  EXPECT_FALSE(device->read(sample));
  const DeviceError error = device->last_error();

  time.set(3s);
  const TimePoint until = clock.now() + test::patience(20s);
  while (!device->reopen(kReopenLimit) && clock.now() < until) {
  }
  EXPECT_TRUE(device->calibrate());
  EXPECT_TRUE(device->read(sample));
  return error;
}

/// Reads once a millisecond until a reading fails, or for as long as a slow machine may need to let
/// the second answer of a pair come before the next message.
inline void read_until_it_fails(HapticDevice& device, const SteadyClock& clock) {
  using namespace std::chrono_literals;
  const TimePoint until = clock.now() + test::patience(20s);
  DeviceSample sample;
  while (device.read(sample) && clock.now() < until) std::this_thread::sleep_for(1ms);
}

/// Expects that answers which come twice, from 1 s on, are a fault: the message after the second of
/// a pair notices it.
template <class Config, class Open>
void expect_doubled_answers_noticed(Config config, test::SharedClock& time, const Open& open) {
  using namespace std::chrono_literals;
  const SteadyClock clock;
  const auto device = open(config, clock, StartUp{.limit = test::patience(20s)});
  EXPECT_TRUE(device->calibrate());
  time.set(1500ms);
  read_until_it_fails(*device, clock);
  EXPECT_EQ(device->last_error(), DeviceError::kCorrupt);
}

/// A force under which the messages fail for a second, while the motors end nothing by themselves:
/// no release is confirmed in it, and afterwards one is, with the motors limp.
template <class Emulated, class Open>
void expect_release_confirmed_after(const std::vector<WireFault>& kinds, const Open& open) {
  using namespace std::chrono_literals;
  const SteadyClock clock;
  for (const WireFault kind : kinds) {
    SCOPED_TRACE(static_cast<int>(kind));
    test::SharedClock time;
    Emulated emulated(time, Vector3::Zero(),
                      {{.kind = WireFault::kNoWatchdog, .from_s = 0.0, .length_s = 1e6},
                       {.kind = kind, .from_s = 1.0, .length_s = 1.0}});
    auto config = emulated.config();
    config.transfer_limit = kPassingLimit;
    const auto device = open(config, clock, StartUp{.limit = test::patience(20s)});
    ASSERT_TRUE(device->calibrate());
    DeviceSample sample;
    ASSERT_TRUE(device->apply(device->specification().force_axes * Vector3(1, 0, 1), 1h, sample));
    ASSERT_GT(emulated.motor_force_newton().norm(), 0.9);

    time.set(1500ms);
    EXPECT_FALSE(device->release()) << "nothing confirmed it";
    EXPECT_NE(device->last_error(), DeviceError::kNone) << "of the release";
    EXPECT_FALSE(device->read(sample));
    EXPECT_FALSE(device->release());

    time.set(3s);
    const TimePoint until = clock.now() + test::patience(20s);
    while (!device->release() && clock.now() < until) {
      if (device->phase() == DevicePhase::kClosed) {
        static_cast<void>(device->reopen(kReopenLimit));
      }
    }
    EXPECT_TRUE(device->release());
    EXPECT_EQ(emulated.motor_force_newton(), Vector3(0, 0, 0));
  }
}

/// Pushes with more than the limit in random directions: the motors make no more than the limit,
/// and what they make is reported.
template <class Emulated, auto open>
void expect_force_limit_kept(const Vector3& hand_m, Random& random) {
  constexpr double kLimitNewton = 1.7;
  const ManualClock clock;
  Emulated emulated(clock, hand_m);
  auto config = emulated.config();
  config.limits = {.peak_force_newton = kLimitNewton, .continuous_force_newton = kLimitNewton};
  const auto device = open(config, clock, StartUp{});
  ASSERT_TRUE(device->calibrate());
  for (int i = 0; i < 100; ++i) {
    DeviceSample sample;
    ASSERT_TRUE(device->apply(random.uniform(1.7, 3.0) * random.direction(),
                              std::chrono::seconds(1), sample));
    EXPECT_LE(sample.applied_force_newton.norm(), kLimitNewton + 1e-12);
    EXPECT_GT(sample.applied_force_newton.norm(), 0.95 * kLimitNewton);
    EXPECT_LT((emulated.motor_force_newton() - sample.applied_force_newton).norm(), 1e-9);
  }
}

/// Steps of 60 ms of a hand that moves on: the force of held currents times the way is wrong by
/// much more than with what the driver says of their turning. The work itself is the energy of an
/// emulated device without friction.
/// @param make_emulator  of an EmulatedDevice, serves until destroyed
template <class Config, class MakeEmulator, class Open>
void expect_turning_reported(const Config& config, double amplitude_m,
                             const MakeEmulator& make_emulator, const Open& open) {
  using namespace std::chrono_literals;
  test::SharedClock time;
  const HandConfig hand{.stiffness_newton_per_m = 2000.0,
                        .damping_newton_s_per_m = 40.0,
                        .path = SinusoidPath{.amplitude_m = Vector3::Constant(amplitude_m),
                                             .frequency_hz = Vector3(1.0, 1.3, 0.7)}};
  EmulatedDevice emulated(
      {.viscous_newton_s_per_m = 0.0, .coulomb_newton = 0.0, .position_resolution_m = 0.0}, hand,
      time, 1, 10s, {{.kind = WireFault::kTurning, .from_s = 0.0, .length_s = 1e6}});
  const auto emulator = make_emulator(emulated);
  const std::jthread server([&](const std::stop_token& stop) { emulator->run(stop); });
  const auto device = open(config, time, StartUp{.limit = test::patience(20s)});
  ASSERT_TRUE(device->calibrate());
  double worst_joule = 0.0;
  double worst_of_held_joule = 0.0;
  DeviceSample last;
  double last_joule = 0.0;
  for (int step = 1; step <= 40; ++step) {
    time.set(step * 60ms);
    DeviceSample sample;
    ASSERT_TRUE(device->apply(Vector3(1.0, 0.5, -1.0), 100ms, sample));
    const double joule = emulated.true_state().energy_joule;
    if (step > 1) {
      const double held_joule =
          last.applied_force_newton.dot(sample.hand_position_m - last.hand_position_m);
      const double work_joule = last_joule - joule;
      worst_of_held_joule = std::max(worst_of_held_joule, std::abs(held_joule - work_joule));
      worst_joule = std::max(worst_joule, std::abs(held_joule + sample.turning_joule - work_joule));
    }
    last = sample;
    last_joule = joule;
  }
  // the encoders' steps: 1.5 N · 0.1 mm
  EXPECT_LT(worst_joule, 3e-4);
  EXPECT_GT(worst_of_held_joule, 6e-4);
}

/// Torques that make f_co at one place of the workspace are at no other one more force than `ratio`
/// times that, and almost so much at some: by the differences of the joints' angles.
/// @param angles_rad  of a place in the frame of the device: an optional
template <class Config, class AnglesOf>
void expect_held_force_ratio(const Config& config, double ratio, const AnglesOf& angles_rad) {
  Random random(1);
  const auto place = [&] {
    // half of them at corners, where it is most
    const bool is_corner = random.chance(0.5);
    Vector3 share;
    for (double& s : share) {
      s = is_corner ? (random.chance(0.5) ? 1.0 : -1.0) : random.uniform(-1.0, 1.0);
    }
    return Vector3(share.cwiseProduct(config.workspace_half_extent_m));
  };
  /// ∂angles/∂position, D
  const auto by_position = [&](const Vector3& position_m) {
    constexpr double kStep_m = 1e-6;
    Matrix3 by;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const Vector3 step_m = kStep_m * Vector3::Unit(axis);
      const auto angles_at = [&](const Vector3& at_m) {
        return angles_rad(Vector3(config.rotation.conjugate() * at_m + config.origin_m)).value();
      };
      by.col(axis) =
          (angles_at(position_m + step_m) - angles_at(position_m - step_m)) / (2.0 * kStep_m);
    }
    return by;
  };
  double most = 0.0;
  for (int pair = 0; pair < 20000; ++pair) {
    const Matrix3 commanded_at = by_position(place());
    const Vector3 force_newton = random.direction();
    const Vector3 torque = commanded_at.transpose().inverse() * force_newton;
    most = std::max(most, (by_position(place()).transpose() * torque).norm());
  }
  EXPECT_LE(most, ratio);
  EXPECT_GE(most, 0.9 * ratio) << "nor is the limit lower than it has to be";
}

/// What the driver under test is made of. Time stands between the messages.
template <class Emulated, auto open>
struct DriverParts {
  ManualClock time;
  Emulated emulated{time};
  std::unique_ptr<HapticDevice> driver = open(emulated.config(), time, {});
};

template <class Emulated, auto open>
class DriverUnderTest : private DriverParts<Emulated, open>, public OpenedDevice {
 public:
  // the emulator is a thread of a busy machine: its pace is not that of the driver
  DriverUnderTest() : OpenedDevice(*this->driver, this->time, std::chrono::seconds(1), {}) {
    EXPECT_TRUE(this->driver->calibrate());
  }
  [[nodiscard]] std::optional<Vector3> motor_force_newton() override {
    DeviceSample sample;
    EXPECT_TRUE(this->driver->read(sample));
    return this->emulated.motor_force_newton();
  }
  [[nodiscard]] std::optional<std::uint64_t> allocations() const override {
    return test::allocations_of_this_thread();
  }
};

}  // namespace palpate::device
