// SPDX-License-Identifier: Apache-2.0
// Clamp, monitor, guard and the watch on frozen readings are values: a copy of
// them, fed with the same readings, does the same to the bit. So what led to a fault can be
// computed again from any state before it.
#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/core/random.h"
#include "device_node/force_guard.h"
#include "device_node/monitor/force_monitor.h"
#include "device_node/monitor/frozen_watch.h"
#include "mofc_node/controllers/guard_mofc.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

DeviceConfig config_of() {
  DeviceConfig config;
  config.reply = 500us;
  config.lease = 2ms;
  config.longest_lease = 10ms;
  config.limp_after = 20ms;
  config.fade = 50ms;
  config.start_ramp = 20ms;
  config.slew_newton_per_s = 1650.0;
  return config;
}

controllers::GuardMofc clamp_of(const DeviceConfig& config) {
  return controllers::GuardMofc({.mofc = {.f_d = config.profile.viscous_newton_s_per_m,
                                          .f_co = config.profile.coulomb_newton,
                                          .T = 0.002},
                                 .resolution_m = config.profile.position_resolution_m,
                                 .delta_max_s = 5e-4,
                                 .longest_lease_s = 0.01});
}

/// What reached the loop in one tick.
struct Heard {
  Vector3 position_m = Vector3::Zero();
  Vector3 requested_newton = Vector3::Zero();
  Duration skew{};
  bool is_answered = true;
};

/// What it did.
struct Done {
  Vector3 force_newton = Vector3::Zero();
  Duration lease{};
  double monitor_joule = 0.0;
  double ledger_joule = 0.0;
  bool is_frozen = false;
  bool operator==(const Done&) const = default;
};

/// Everything that remembers something from tick to tick.
struct Loop {
  explicit Loop(const DeviceConfig& config)
      : clamp(clamp_of(config)), monitor(config), guard(config, 3.3), frozen(config) {}

  Done step(const Heard& heard) {
    const TimePoint at = TimePoint(1ms * ticks++);
    static_cast<void>(frozen.read(at, heard.position_m, acting_newton));
    monitor.read(at, heard.position_m, {.skew = heard.skew});
    std::optional<controllers::AppliedStretch> acted;
    if (ticks > 1) {
      acted = {.duration_s = 1e-3,
               .force_on_hand_newton = acting_newton,
               .hand_position_at_end_m = heard.position_m};
    }
    controllers::ControlInput input;
    input.hand_position_m = heard.position_m;
    if (acted) input.applied = std::span(&*acted, 1);
    input.acting_force_on_hand_newton = acting_newton;
    input.acting_lease_s = to_seconds(acting_until - at);
    input.energy_limit_joule = monitor.coverable_joule();
    input.requested_force_on_hand_newton = heard.requested_newton;
    const controllers::ControlOutput clamped = clamp.step(input);
    GuardedForce out = guard.missed(at, at + 1ms);
    if (heard.is_answered) {
      ForceCommand command;
      command.force_on_hand_newton = clamped.force_on_hand_newton;
      command.valid_for = from_seconds(clamped.lease_s);
      out = guard.answered(command, at, at < acting_until ? acting_newton : Vector3(0, 0, 0));
    }
    const auto covered = monitor.cover(out.force_on_hand_newton, out.lease);
    monitor.switched(at, heard.position_m, covered.force_on_hand_newton, covered.lease,
                     {.skew = heard.skew});
    acting_newton = covered.force_on_hand_newton;
    acting_until = at + covered.lease;
    return {acting_newton, covered.lease, monitor.joule(), clamped.ledger_energy_joule,
            frozen.is_frozen()};
  }

  controllers::GuardMofc clamp;
  ForceMonitor monitor;
  ForceGuard guard;
  FrozenWatch frozen;
  Vector3 acting_newton = Vector3::Zero();
  TimePoint acting_until{};
  int ticks = 0;
};

std::vector<Heard> heard_by(std::uint64_t seed) {
  Random random(seed);
  std::vector<Heard> all(2000);
  Vector3 hand = Vector3::Zero();
  Vector3 velocity = Vector3::Zero();
  const double q = 55e-6;
  for (Heard& heard : all) {
    if (random.chance(0.05)) velocity = random.uniform(0.0, 0.3) * random.direction();
    hand += 1e-3 * velocity;
    heard = {.position_m = (hand / q).array().round() * q,
             .requested_newton = random.uniform(0.0, 3.3) * random.direction(),
             .skew = random.chance(0.5) ? Duration{} : Duration(200us),
             .is_answered = random.chance(0.9)};
  }
  return all;
}

TEST(Replay, ACopyOfTheStateDoesTheSameToTheBit) {
  std::size_t with_force = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    const std::vector<Heard> heard = heard_by(seed);
    Loop loop(config_of());
    std::optional<Loop> kept;
    std::vector<Done> done;
    for (std::size_t k = 0; k < heard.size(); ++k) {
      if (k == 700) kept = loop;
      done.push_back(loop.step(heard[k]));
      if (done.back().force_newton.norm() > 0.15) ++with_force;
    }
    for (std::size_t k = 700; k < heard.size(); ++k) {
      ASSERT_EQ(kept->step(heard[k]), done[k]) << k;
    }
  }
  EXPECT_GT(with_force, 1000U) << "ticks above f_co: there is something to repeat";
}

/// The twin: a loop that begins anew instead does something else.
TEST(Replay, ANewStateDoesNot) {
  const std::vector<Heard> heard = heard_by(1);
  Loop loop(config_of());
  std::vector<Done> done;
  done.reserve(heard.size());
  for (const Heard& one : heard) done.push_back(loop.step(one));
  Loop anew(config_of());
  std::size_t different = 0;
  for (std::size_t k = 700; k < heard.size(); ++k) {
    if (!(anew.step(heard[k]).force_newton == done[k].force_newton)) ++different;
  }
  EXPECT_GT(different, 100U);
}

}  // namespace
}  // namespace palpate::device
