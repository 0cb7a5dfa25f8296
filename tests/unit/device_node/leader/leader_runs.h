// SPDX-License-Identifier: Apache-2.0
// leader_runs.h — an emulated arm in a hand, through driver and wire, on virtual time: with the
// clamp of joints and without it, whatever the bus.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <deque>
#include <string>

#include "common/core/random.h"
#include "device_node/drivers/leader/leader_arm.h"
#include "device_node/emulators/emulated_arm.h"
#include "mofc_node/controllers/ports/port_guard.h"

namespace palpate::test {

/// Holds the arm where it is.
inline double holding_hand(std::size_t /*joint*/, double rad, double rad_per_s, double /*time_s*/) {
  return -20.0 * rad - 0.4 * rad_per_s;
}

/// A hand that leads every joint somewhere else each half second, loose enough to be driven.
inline device::JointHand restless_hand() {
  return [](std::size_t joint, double rad, double rad_per_s, double time_s) {
    const auto at = static_cast<std::uint64_t>(2.0 * time_s) * 16 + joint;
    const double target = 0.8 * std::sin(static_cast<double>(at * at % 1009));
    return std::clamp(2.5 * (target - rad), -0.5, 0.5) - 0.15 * rad_per_s;
  };
}

/// What a far arm, a network or a wrong program may ask for.
class Requests {
 public:
  explicit Requests(std::uint64_t seed) : random_(seed) {}
  device::LeaderValues next(const device::LeaderReading& reading) {
    past_.push_back(reading.position_rad);
    if (past_.size() > 20) past_.pop_front();
    if (random_.chance(0.01)) kind_ = random_.below(4);
    device::LeaderValues torque{};
    for (std::size_t i = 0; i < 7; ++i) {
      const double moved = reading.position_rad[i] - past_.front()[i];
      switch (kind_) {
        case 0:  // an arm 40 ms away that pulls
          torque[i] = 4.0 * (past_.front()[i] - reading.position_rad[i]);
          break;
        case 1:  // along the motion: it drives the hand
          torque[i] = moved == 0.0 ? 0.0 : std::copysign(0.3, moved);
          break;
        case 2:
          torque[i] = 0.35 * random_.uniform(-1.0, 1.0);
          break;
        default:
          torque[i] = i % 2 == 0 ? 0.25 : -0.25;
      }
    }
    return torque;
  }

 private:
  Random random_;
  std::uint64_t kind_ = 1;
  std::deque<device::LeaderValues> past_;
};

struct ArmRun {
  double least_energy_joule = 0.0;
  double fastest_rad_per_s = 0.0;
  double made_ratio = 0.0;  // of the torque that was asked for
  std::string fault;
};

/// Ten thousand cycles of 2 ms, or of up to 9 ms where one comes late.
/// @param bench  of seven joints in restless_hand(), whose friction is that of GearedJoint
template <class Bench>
ArmRun run_arm(Bench& bench, bool is_clamped, std::uint64_t seed, int cycles) {
  bench.settings.longest_delay_s = 0.005;
  bench.settings.longest_cycle_s = 0.012;
  device::LeaderArm& arm = bench.enabled();

  controllers::PortGuardParameters parameters{
      .count = 7, .times = {.hold_s = arm.lease_s(), .longest_lease_s = arm.lease_s()}};
  controllers::PortValues peak{};
  for (std::size_t i = 0; i < 7; ++i) {
    parameters.ports[i] = {.f_d = 0.8 * 0.015,
                           .f_co = 0.8 * 0.09,
                           .q = arm.resolution_rad(i),
                           .v_max = bench.joints[i].fastest_rad_per_s};
    peak[i] = 0.35;
  }
  controllers::PortGuard guard(raised_for_one_hold(parameters, peak));
  Requests requests(seed);
  Random random(seed + 1);
  controllers::PortStretch last;
  bool has_stretch = false;
  double asked = 0.0;
  double got = 0.0;
  for (int k = 0; k < cycles; ++k) {
    if (!arm.read(bench.reading)) break;
    const device::LeaderValues torque = requests.next(bench.reading);
    device::LeaderValues sent = torque;
    last.duration_s = bench.reading.elapsed_s;
    last.position_at_end = bench.reading.position_rad;
    if (is_clamped) {
      const controllers::PortOutput output =
          guard.step({.position = bench.reading.position_rad,
                      .applied = {&last, has_stretch ? 1U : 0U},
                      .has_gap = !bench.reading.is_known || bench.reading.elapsed_s > arm.lease_s(),
                      .acting_effort_on_hand = last.effort_on_hand,
                      .requested_effort_on_hand = torque});
      sent = output.effort_on_hand;
    }
    bench.pass(from_seconds(random.uniform(0.0, 1.9e-3)));
    if (!bench.write(sent)) break;
    last.effort_on_hand = bench.made;
    has_stretch = true;
    for (std::size_t i = 0; i < 7; ++i) {
      asked += std::abs(torque[i]);
      got += std::abs(bench.made[i]);
    }
    bench.pass(from_seconds(random.chance(0.05) ? random.uniform(1e-3, 7e-3) : 1e-3));
  }
  bench.emulator().catch_up();
  return {.least_energy_joule = bench.emulator().least_energy_joule(),
          .fastest_rad_per_s = bench.emulator().fastest_rad_per_s(),
          .made_ratio = got / asked,
          .fault = arm.fault_text()};
}

/// The loop of docs/operations/leader_arms.md: a follower that meets a stop at 0.25 rad, 2 N·m/rad,
/// for 20 s at 250 Hz.
template <class Bench>
ArmRun push_against_a_stop(Bench& bench, bool is_clamped) {
  for (auto& joint : bench.joints) joint.fastest_rad_per_s = 3.0;
  device::LeaderArm& arm = bench.enabled();
  controllers::PortGuardParameters parameters{
      .count = 7, .times = {.hold_s = arm.lease_s(), .longest_lease_s = arm.lease_s()}};
  controllers::PortValues peak{};
  for (std::size_t i = 0; i < 7; ++i) {
    parameters.ports[i] = {
        .f_d = 0.8 * 0.015, .f_co = 0.8 * 0.09, .q = arm.resolution_rad(i), .v_max = 3.0};
    peak[i] = 0.25;
  }
  controllers::PortGuard guard(raised_for_one_hold(parameters, peak));
  controllers::PortStretch last;
  double asked = 0.0;
  double got = 0.0;
  for (int k = 0; k < 5000 && arm.read(bench.reading); ++k) {
    const controllers::PortValues& q = bench.reading.position_rad;
    controllers::PortValues torque{};
    for (std::size_t i = 0; i < 7; ++i) torque[i] = 2.0 * (std::clamp(q[i], -0.25, 0.25) - q[i]);
    last.duration_s = bench.reading.elapsed_s;
    last.position_at_end = q;
    const controllers::PortOutput output = guard.step({.position = q,
                                                       .applied = {&last, k > 0 ? 1U : 0U},
                                                       .has_gap = !bench.reading.is_known,
                                                       .acting_effort_on_hand = last.effort_on_hand,
                                                       .requested_effort_on_hand = torque});
    bench.pass(std::chrono::microseconds(500));
    if (!bench.write(is_clamped ? output.effort_on_hand : torque)) break;
    last.effort_on_hand = bench.made;
    for (std::size_t i = 0; i < 7; ++i) {
      asked += std::abs(torque[i]);
      got += std::abs(bench.made[i]);
    }
    bench.pass(std::chrono::microseconds(3500));
  }
  bench.emulator().catch_up();
  return {.least_energy_joule = bench.emulator().least_energy_joule(),
          .fastest_rad_per_s = bench.emulator().fastest_rad_per_s(),
          .made_ratio = got / asked,
          .fault = arm.fault_text()};
}

}  // namespace palpate::test
