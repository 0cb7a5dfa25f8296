// SPDX-License-Identifier: Apache-2.0
#include "device_node/simulation/simulated_device.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <complex>
#include <functional>
#include <numbers>
#include <vector>

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

/// No friction, no encoder.
SimulatedDeviceConfig frictionless() {
  return {.viscous_newton_s_per_m = 0.0, .coulomb_newton = 0.0, .position_resolution_m = 0.0};
}
/// 0.045 + 0.255 = 0.3 kg held by nobody: only motors and friction act.
HandConfig free_hand() { return {.stiffness_newton_per_m = 0.0, .damping_newton_s_per_m = 0.0}; }

/// A simulated device on a clock that the test moves.
struct SimulatedBench {
  explicit SimulatedBench(const SimulatedDeviceConfig& config = {}, const HandConfig& hand = {},
                          std::uint64_t seed = 1)
      : device(config, hand, clock, seed) {}

  void apply(const Vector3& force_newton, Duration lease) {
    DeviceSample at_switch;
    ASSERT_TRUE(device.apply(force_newton, lease, at_switch));
  }
  DeviceSample read() {
    DeviceSample sample;
    EXPECT_TRUE(device.read(sample));
    return sample;
  }
  DeviceSample read_after(Duration d) {
    clock.advance(d);
    return read();
  }
  [[nodiscard]] TrueState truth() const { return device.true_state(); }

  ManualClock clock;
  SimulatedDevice device;
};

// From rest, 1 N on 0.3 kg for 9 ms: v = F·t/m = 0.03 m/s, x = v·t/2.
TEST(SimulatedDevice, ReachesTheHandComputedSpeedUnderConstantForce) {
  SimulatedBench bench(frictionless(), free_hand());
  bench.apply(Vector3(1, 0, 0), 20ms);

  bench.read_after(9ms);

  EXPECT_NEAR(bench.truth().hand_velocity_m_per_s.x(), 0.03, 1e-14);
  EXPECT_NEAR(bench.truth().hand_position_m.x(), 0.03 * 0.009 / 2, 1e-16);
}

// 1.2 N on 0.3 kg for 2.513 ms (no multiple of the 50 µs step), then coasting: v = a·τ = 10.052
// mm/s and x(10 ms) = v·(10 ms − τ/2), whether the encoder was read meanwhile or the process slept.
TEST(SimulatedDevice, TheWatchdogEndsTheForceAtTheExactInstant) {
  const double tau = 2.513e-3;
  for (const Duration poll : {Duration(10ms), Duration(1ms), Duration(70us)}) {
    SimulatedBench bench(frictionless(), free_hand());
    bench.apply(Vector3(1.2, 0, 0), 2513us);

    for (Duration t{}; t < 10ms; t += poll) bench.read_after(std::min(poll, Duration(10ms) - t));

    EXPECT_NEAR(bench.truth().hand_velocity_m_per_s.x(), 4.0 * tau, 1e-14);
    EXPECT_NEAR(bench.truth().hand_position_m.x(), 4.0 * tau * (10e-3 - tau / 2), 1e-15);
  }
}

// 1.2 N on 0.3 kg for 2.513 ms: ½·4·τ² = 12.6312 µm, whenever it is read.
TEST(SimulatedDevice, TheLatchStoresThePositionAtWhichTheWatchdogEndedTheForce) {
  SimulatedDeviceConfig config = frictionless();
  config.has_position_latch = true;
  SimulatedBench bench(config, free_hand());
  bench.apply(Vector3(1.2, 0, 0), 2513us);
  bench.read_after(5s);

  DeviceSample latched;
  ASSERT_TRUE(bench.device.take_latched(latched));
  EXPECT_NEAR(latched.hand_position_m.x(), 12.6312e-6, 1e-9);
  EXPECT_EQ(latched.sampled_at, TimePoint(2513us));
  EXPECT_FALSE(bench.device.take_latched(latched));
}

// Stopped for 5 s with 1 N and a lease of 3 ms: the hand coasts at 10 mm/s, no faster.
TEST(SimulatedDevice, TheWatchdogEndsTheForceAlsoWhenTheProcessWasStopped) {
  SimulatedBench bench(frictionless(), free_hand());
  bench.apply(Vector3(1, 0, 0), 3ms);

  bench.read_after(5s);

  EXPECT_NEAR(bench.truth().hand_velocity_m_per_s.x(), 0.01, 1e-12);
  EXPECT_NEAR(bench.truth().hand_position_m.x(), 0.01 * (5.0 - 1.5e-3), 1e-11);
}

TEST(SimulatedDevice, AForceBelowStictionDoesNotMoveItAtAll) {
  SimulatedBench bench({.position_resolution_m = 0.0}, free_hand());
  bench.apply(Vector3(0.05, 0.05, 0.05), 10s);  // 0.087 N < 0.1 N

  bench.read_after(1s);

  EXPECT_EQ(bench.truth().hand_position_m, Vector3::Zero().eval());
}

// The hand follows A·sin(ωt): x = A·H(iω), H = (K + iωB)/(K − mω² + iω(B + f_d)). Projected on
// sine and cosine over 5 periods once the transient, e^(−t(B+f_d)/(2m)) = e^(−10 t), is gone.
TEST(SimulatedDevice, FollowsAnOscillatingHandWithTheComputedAmplitudeAndPhase) {
  const double A = 0.01, f = 3.0, K = 150, B = 5.9, m = 0.3, f_d = 0.1;
  const double omega = 2 * std::numbers::pi * f;
  SimulatedDeviceConfig device = frictionless();
  device.viscous_newton_s_per_m = f_d;
  SimulatedBench bench(device, {.stiffness_newton_per_m = K,
                                .damping_newton_s_per_m = B,
                                .path = SinusoidPath{.amplitude_m = Vector3(A, 0, 0),
                                                     .frequency_hz = Vector3(f, 0, 0)}});

  bench.read_after(3s);
  const int n = 5'000;
  const Duration interval = from_seconds(5.0 / f / n);
  std::complex<double> sum = 0.0;  // of x·e^(−iωt)
  for (int i = 0; i < n; ++i) {
    const DeviceSample sample = bench.read_after(interval);
    const double t = seconds_of(sample.sampled_at);
    sum += sample.hand_position_m.x() * std::exp(std::complex<double>(0, -omega * t));
  }

  using namespace std::complex_literals;
  const std::complex<double> H =
      (K + 1i * omega * B) / (K - m * omega * omega + 1i * omega * (B + f_d));
  // A·sin(ωt) projects on −iA/2
  const std::complex<double> measured = sum / static_cast<double>(n) / (-0.5i * A);
  EXPECT_NEAR(std::abs(measured), std::abs(H), 1e-5);
  EXPECT_NEAR(std::arg(measured), std::arg(H), 1e-5);
}

TEST(SimulatedDevice, TheEncoderRoundsEachAxisToTheNearestMultiple) {
  const double q = 55e-6;
  SimulatedBench bench({}, {.path = SinusoidPath{.amplitude_m = Vector3(0.01, 0.02, 0.005),
                                                 .frequency_hz = Vector3(1, 0.7, 1.3)}});
  double worst_m = 0.0;
  for (int i = 0; i < 1'000; ++i) {
    const Vector3 measured_m = bench.read_after(1ms).hand_position_m;
    const Vector3 counts = measured_m / q;
    ASSERT_LT((counts - counts.array().round().matrix()).norm(), 1e-9);
    worst_m = std::max(worst_m, (measured_m - bench.truth().hand_position_m).cwiseAbs().maxCoeff());
  }

  EXPECT_LE(worst_m, q / 2 * (1 + 1e-9));
  EXPECT_GT(worst_m, 0.45 * q);
}

TEST(SimulatedDevice, WithoutResolutionTheEncoderIsExact) {
  SimulatedBench bench(
      {.position_resolution_m = 0.0},
      {.path = SinusoidPath{.amplitude_m = Vector3(0.01, 0, 0), .frequency_hz = Vector3(1, 0, 0)}});

  const DeviceSample sample = bench.read_after(123ms);

  EXPECT_EQ(sample.hand_position_m, bench.truth().hand_position_m);
}

TEST(SimulatedDevice, ButtonsFollowTheHandsPresses) {
  SimulatedBench bench({}, {.presses = {{.button = 3, .from_s = 0.01, .until_s = 0.02}}});

  EXPECT_EQ(bench.read_after(9ms).buttons, 0u);
  EXPECT_EQ(bench.read_after(2ms).buttons, 8u);
  EXPECT_EQ(bench.read_after(10ms).buttons, 0u);
}

/// A hand of 0.3 kg in all that palpates an unclamped wall at z < 0, held for `period`.
struct WallRun {
  double stiffness_newton_per_m = 1000.0;
  Duration period = 20ms;
  Duration length = 10s;

  void operator()(
      SimulatedBench& bench, const std::function<void()>& after_each_period = [] {}) const {
    for (Duration t{}; t < length; t += period) {
      const double z_m = bench.read().hand_position_m.z();
      bench.apply(Vector3(0, 0, std::max(0.0, -stiffness_newton_per_m * z_m)), period);
      bench.clock.advance(period);
      bench.read();
      after_each_period();
    }
  }
};

// Second account of the energy, from the other side: the hand's spring and damper give
// K(x_d − x) + B(v_d − x') times the displacement. Taken by the trapezoidal rule over reads 10 µs
// apart, with one inner step between reads, E = hand's work − kinetic energy.
TEST(SimulatedDevice, EnergyIsTheWorkOfTheHandLessTheKineticEnergy) {
  const double K = 150, B = 6, m = 0.3;
  const SinusoidPath path{.center_m = Vector3(0, 0, 0.002),
                          .amplitude_m = Vector3(0.01, 0, 0.012),
                          .frequency_hz = Vector3(0.8, 0, 1.7)};
  SimulatedBench bench({}, {.path = path});
  double work_joule = 0.0;
  double worst_joule = 0.0;

  for (int k = 0; k < 100; ++k) {
    const double z_m = bench.read().hand_position_m.z();
    bench.apply(Vector3(0, 0, std::max(0.0, -800.0 * z_m)), 20ms);
    for (int i = 0; i < 2'000; ++i) {
      const TrueState before = bench.truth();
      const double middle_s = seconds_of(bench.clock.now()) + 5e-6;
      bench.read_after(10us);
      const TrueState after = bench.truth();
      const Vector3 moved_m = after.hand_position_m - before.hand_position_m;
      const Target target = target_on(path, middle_s);
      const Vector3 hand_newton =
          K * (target.position_m - 0.5 * (before.hand_position_m + after.hand_position_m)) +
          B * (target.velocity_m_per_s - moved_m / 10e-6);
      work_joule += hand_newton.dot(moved_m);
      const double kinetic_joule = 0.5 * m * after.hand_velocity_m_per_s.squaredNorm();
      worst_joule =
          std::max(worst_joule, std::abs(work_joule - kinetic_joule - after.energy_joule));
    }
  }

  EXPECT_GT(std::abs(work_joule), 5e-3);  // the slow wall pays, the hand receives
  EXPECT_LT(worst_joule, 1e-8);
}

// A wall of 1 kN/m held for 20 ms gives back more than it takes: moving in at v it lags by v·10 ms.
TEST(SimulatedDevice, AHostileHandDrawsEnergyOutOfAnUnclampedSlowWall) {
  for (const std::uint64_t seed : {1u, 2u, 3u, 4u, 5u}) {
    SimulatedBench bench({}, {.path = HostilePath{}}, seed);

    WallRun{}(bench);

    EXPECT_LT(bench.truth().minimum_energy_joule, -1e-3) << "seed " << seed;
  }
}

TEST(SimulatedDevice, AHostileHandDrawsNothingWhereNothingIsRendered) {
  SimulatedBench bench({}, {.path = HostilePath{}});

  bench.read_after(10s);

  EXPECT_EQ(bench.truth().minimum_energy_joule, 0.0);
  EXPECT_GT(bench.truth().energy_joule, 0.0);
}

TEST(SimulatedDevice, TheMinimumEnergyIsThatOfTheInnerStepsNotOfTheReadings) {
  // Push 5 ms along the rendered force, then brake: the dip lies between the two readings.
  SimulatedBench bench(frictionless(), free_hand());
  bench.apply(Vector3(1, 0, 0), 5ms);
  bench.clock.advance(5ms);
  bench.apply(Vector3(-1, 0, 0), 5ms);

  bench.read_after(5ms);

  // dip: −F·x = −F²t²/(2m) = −41.7 µJ; after braking to rest the same again is taken back
  EXPECT_NEAR(bench.truth().minimum_energy_joule, -25e-6 / 0.6, 1e-15);
  EXPECT_NEAR(bench.truth().energy_joule, 0.0, 1e-15);
}

std::vector<double> trace(std::uint64_t seed) {
  SimulatedBench bench({}, {.path = HostilePath{}}, seed);
  std::vector<double> numbers;
  WallRun{.length = 2s}(bench, [&] {
    const TrueState s = bench.truth();
    for (const double x : s.hand_position_m) numbers.push_back(x);
    numbers.push_back(s.energy_joule);
  });
  return numbers;
}

TEST(SimulatedDevice, RepeatsItselfToTheBitForASeed) {
  EXPECT_EQ(trace(7), trace(7));
  EXPECT_NE(trace(7), trace(8));
}

}  // namespace
}  // namespace palpate::device
