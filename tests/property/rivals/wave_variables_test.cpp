// SPDX-License-Identifier: Apache-2.0
// Wave variables: what the channel generates, and what the two ends make of it.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <optional>
#include <vector>

#include "common/core/clock.h"
#include "common/core/memory_link.h"
#include "common/core/random.h"
#include "common/core/time.h"
#include "mofc_node/controllers/rivals/wave_variables.h"
#include "mofc_node/mofc_node.h"
#include "physics_node/answer/wave_end.h"
#include "physics_node/physics_node.h"

namespace palpate::controllers {
namespace {

constexpr double kPeriod_s = 1e-3;
constexpr double kWaveRounding = 1e-9;

/// A link of which the newest message counts.
struct WaveLink {
  std::size_t least_delay = 0;
  std::size_t most_delay = 0;
  double loss = 0.0;

  template <class T>
  struct Sent {
    T message;
    std::size_t arrives;
  };
  /// The newest that has arrived by now, if any has; an older one never replaces it.
  template <class T>
  std::optional<T> pass(std::vector<Sent<T>>& sent, const T& message, Random& random) const {
    const std::size_t now = sent.size();
    const std::size_t delay = least_delay + random.below(most_delay - least_delay + 1);
    const std::size_t never = std::numeric_limits<std::size_t>::max();
    sent.push_back({message, random.chance(loss) ? never : now + delay});
    for (std::size_t k = sent.size(); k-- > 0;) {
      if (sent[k].arrives <= now) return sent[k].message;
    }
    return std::nullopt;
  }
};

constexpr WaveLink kConstantDelay{.least_delay = 20, .most_delay = 20};
constexpr WaveLink kVariableDelay{.least_delay = 5, .most_delay = 40};
constexpr WaveLink kLossy{.least_delay = 5, .most_delay = 40, .loss = 0.3};

/// The greatest energy that more came out than went in, of smooth waves; and what arrived.
struct ChannelEnergy {
  double generated_joule = -1.0;
  double sent_joule = 0.0;
  double arrived_joule = 0.0;
};

ChannelEnergy channel(const WaveLink& link, std::uint64_t seed, bool is_held) {
  Random random(seed);
  WaveSender sender;
  sender.begin(1, 2.0);
  WaveReceiver receiver;
  receiver.begin(sender.wave());
  std::vector<WaveLink::Sent<Wave>> waves;
  std::vector<WaveLink::Sent<Vector3>> parts;
  ChannelEnergy energy;
  const double hz = random.uniform(2.0, 20.0);
  const Vector3 direction = random.direction();
  for (int k = 0; k < 3000; ++k) {
    const Vector3 part =
        kPeriod_s * std::sin(2.0 * std::numbers::pi * hz * k * kPeriod_s) * direction;
    sender.send(part, kPeriod_s);
    Vector3 out = Vector3::Zero();
    if (is_held) {
      out = link.pass(parts, part, random).value_or(out);
    } else {
      if (const auto wave = link.pass(waves, sender.wave(), random)) receiver.receive(*wave);
      out = receiver.take(kPeriod_s);
    }
    energy.arrived_joule += out.squaredNorm() / (2.0 * kPeriod_s);
    energy.sent_joule = sender.wave().energy_joule;
    energy.generated_joule =
        std::max(energy.generated_joule, energy.arrived_joule - energy.sent_joule);
  }
  return energy;
}

TEST(WaveChannel, NeverMoreComesOutThanWentInWhateverTheDelayAndTheLoss) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    for (const WaveLink& link : {kConstantDelay, kVariableDelay, kLossy}) {
      EXPECT_LE(channel(link, seed, false).generated_joule, kWaveRounding) << "seed " << seed;
    }
    // and at a constant delay all of it comes
    const ChannelEnergy constant = channel(kConstantDelay, seed, false);
    EXPECT_GT(constant.arrived_joule, 0.98 * constant.sent_joule) << "seed " << seed;
  }
}

TEST(WaveChannel, AWaveThatIsHeldInsteadGeneratesEnergyWithLossButNoneAtAConstantDelay) {
  int generating = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    EXPECT_LE(channel(kConstantDelay, seed, true).generated_joule, kWaveRounding);
    if (channel(kVariableDelay, seed, true).generated_joule > 1e-6) ++generating;
  }
  EXPECT_GE(generating, 10);
}

TEST(WaveChannel, AfterASilenceTheMotionArrivesAsFarAsItsEnergyAllows) {
  WaveSender sender;
  sender.begin(1, 2.0);
  WaveReceiver receiver;
  receiver.begin(sender.wave());
  for (int k = 0; k < 4; ++k) sender.send(1e-3 * Vector3::UnitX(), kPeriod_s);
  receiver.receive(sender.wave());

  // four periods in one: twice the wave is all that their energy pays for
  EXPECT_NEAR(receiver.take(kPeriod_s).x(), 2e-3, 1e-12);
  EXPECT_NEAR(receiver.take(kPeriod_s).x(), 0.0, 1e-12) << "silence is a zero wave";
  // a message without motion brings the energy for none of what waits
  receiver.receive(sender.wave());
  EXPECT_NEAR(receiver.take(kPeriod_s).x(), 0.0, 1e-12);
}

/// A half-space of K below z = 0 as an engine describes it.
Interaction wall_at(const ToolMotion& motion, double K, TimePoint now) {
  Interaction answer;
  answer.header.sampled_at = now;
  answer.tool_position_world_m = motion.tool_position_world_m;
  Contact& contact = answer.contacts[0];
  contact.penetration_m = -motion.tool_position_world_m.z();
  contact.elastic_force_on_tool_newton = K * contact.penetration_m * Vector3::UnitZ();
  contact.d_force_d_position(2, 2) = -K;
  contact.trust_radius_m = 1000.0;
  answer.listed_count = 1;
  if (contact.penetration_m > 0.0) {
    contact.force_on_tool_newton = contact.elastic_force_on_tool_newton;
    answer.force_on_tool_newton = contact.force_on_tool_newton;
    answer.contact_count = 1;
  }
  return answer;
}

/// A hand that goes where it is told, both ends, and a wall behind the link.
class WaveRig {
 public:
  WaveRig(const WaveLink& link, double K, double f_d, std::uint64_t seed = 1)
      : link_(link), K_(K), f_d_(f_d), random_(seed) {}

  void step_to(double z_m) {
    const double v = (z_m - z_m_) / kPeriod_s;
    const double d = z_m - z_m_;
    energy_joule += f_d_ * d * d / kPeriod_s - acting_newton * d;
    least_joule = std::min(least_joule, energy_joule);
    z_m_ = z_m;

    const AppliedStretch stretch{kPeriod_s, {0, 0, acting_newton}, {0, 0, z_m}, true};
    ControlInput input;
    input.hand_position_m = {0, 0, z_m};
    input.applied = {&stretch, 1};
    input.hand_velocity_m_per_s = {0, 0, v};
    input.returned_wave = &returned_;
    const ControlOutput output = controller.step(input);
    acting_newton = output.force_on_hand_newton.z();

    now_ += from_seconds(kPeriod_s);
    ToolMotion motion;
    motion.header.session_id = motion.device_session_id = 1;
    motion.tool_position_world_m = {0, 0, z_m};
    motion.wave = output.sent_wave;
    const auto arrived = link_.pass(to_physics_, motion, random_);
    if (!arrived) return;
    const ToolMotion& moved = end_.advance(*arrived, last_, now_);
    last_ = wall_at(moved, K_, now_);
    tool_z_m = moved.tool_position_world_m.z();
    end_.answer(last_);
    const auto back = link_.pass(to_hand_, last_.wave, random_);
    if (!back) return;
    returned_ = *back;
    returned_.stream = 7;  // of that physics
  }
  void go_to(double z_m, int steps) {
    const double from = z_m_;
    for (int i = 1; i <= steps; ++i) step_to(from + (z_m - from) * i / steps);
  }

  WaveVariables controller{{.b = 2.0, .T = kPeriod_s}};
  double acting_newton = 0.0;
  double tool_z_m = 0.0;
  double energy_joule = 0.0;
  double least_joule = 0.0;

 private:
  WaveLink link_;
  double K_;
  double f_d_;
  Random random_;
  physics::WaveEnd end_;
  TimePoint now_{};
  double z_m_ = 0.0;
  Interaction last_;
  Wave returned_;
  std::vector<WaveLink::Sent<ToolMotion>> to_physics_;
  std::vector<WaveLink::Sent<Wave>> to_hand_;
};

TEST(WaveVariables, RenderAWallInSeriesWithTheImpedanceOverTheDelay) {
  for (const std::size_t delay : {0U, 5U, 20U, 50U}) {
    WaveRig rig({.least_delay = delay, .most_delay = delay}, 500.0, 2.0);
    rig.go_to(0.002, 100);
    rig.go_to(-0.004, 200);
    rig.go_to(-0.004, 8000);
    // what a held hand and a spring reflect between them decays slowly at long delays: the mean
    constexpr int kMean = 2000;
    double newton = 0.0;
    double tool_z_m = 0.0;
    for (int k = 0; k < kMean; ++k) {
      rig.step_to(-0.004);
      newton += rig.acting_newton / kMean;
      tool_z_m += rig.tool_z_m / kMean;
    }
    // each end samples its wave, half a period there and half a period back
    const double D = (static_cast<double>(delay) + 1.0) * kPeriod_s;
    const double expected_newton = 0.004 / (1.0 / 500.0 + D / 2.0);
    EXPECT_NEAR(newton, expected_newton, 0.02 * expected_newton) << delay;
    EXPECT_NEAR(tool_z_m, -expected_newton / 500.0, 1e-5) << delay;
  }
}

TEST(WaveVariables, NoHandDrawsEnergyAtAnyDelayFromADeviceThatCarriesTheTermBV) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    for (const WaveLink& link : {WaveLink{}, kConstantDelay, kVariableDelay, kLossy}) {
      WaveRig rig(link, 2000.0, 2.1, seed);
      Random random(seed);
      const double hz = random.uniform(0.5, 30.0);
      for (int k = 0; k < 1500; ++k) {
        rig.step_to(-0.004 * std::sin(2.0 * std::numbers::pi * hz * k * kPeriod_s));
      }
      EXPECT_GE(rig.least_joule, -1e-6) << "seed " << seed;
    }
  }
}

TEST(WaveVariables, ADeviceWithLessFrictionThanTheImpedanceGivesEnergyToAFastZigzag) {
  WaveRig rig({}, 0.0, 0.1);
  for (int k = 0; k < 200; ++k) rig.step_to(k % 2 == 0 ? 0.0005 : 0.0);
  EXPECT_LT(rig.least_joule, -1e-3);
}

TEST(WaveVariables, WithoutAChannelThereIsNoForceAndAfterwardsTheSumsBeginAnew) {
  WaveVariables controller({.b = 2.0, .T = kPeriod_s});
  ControlInput input;
  input.hand_velocity_m_per_s = {0, 0, 1};
  input.requested_force_on_hand_newton = {0, 0, 1};
  EXPECT_TRUE(controller.step(input).force_on_hand_newton.isZero(0.0));
  EXPECT_FALSE(controller.step(input).sent_wave.is_present());
  const Wave open;
  for (int round = 0; round < 2; ++round) {
    input.returned_wave = &open;
    for (int k = 0; k < 3; ++k) {
      const AppliedStretch stretch{kPeriod_s, Vector3::Zero(),
                                   input.hand_position_m + Vector3(0, 0, 1e-4), true};
      input.applied = {&stretch, 1};
      input.hand_position_m = stretch.hand_position_at_end_m;
      const Wave sent = controller.step(input).sent_wave;
      EXPECT_NEAR(sent.sum.z(), 2.0 * k * 1e-4, 1e-12) << "the first opens the channel";
    }
    input.returned_wave = nullptr;
    input.applied = {};
    EXPECT_FALSE(controller.step(input).sent_wave.is_present());
  }
}

TEST(WaveEnd, ANewStreamBeginsAtTheToolAndMotionWithoutWavesIsLeftAlone) {
  physics::WaveEnd end;
  ToolMotion motion;
  motion.header.session_id = motion.device_session_id = 1;
  motion.tool_position_world_m = {0.1, 0.2, 0.3};
  Interaction answer;
  EXPECT_EQ(end.advance(motion, answer, TimePoint{}).tool_position_world_m,
            motion.tool_position_world_m);
  end.answer(answer);
  EXPECT_FALSE(answer.wave.is_present());

  motion.wave = {.stream = 5, .sum = {1, 1, 1}, .energy_joule = 3, .impedance_newton_s_per_m = 2};
  TimePoint now{};
  const auto stepped = [&] {
    now += from_seconds(kPeriod_s);
    Vector3 at_m = end.advance(motion, answer, now).tool_position_world_m;
    end.answer(answer);
    return at_m;
  };
  EXPECT_EQ(stepped(), motion.tool_position_world_m) << "what was sent before it listened is past";
  EXPECT_EQ(answer.wave.stream, 5U);
  motion.wave.sum.x() += 1e-3;
  motion.wave.energy_joule += 1.0;
  // b v = √(2b) u in free space
  EXPECT_NEAR(stepped().x(), 0.101, 1e-9);
  motion.wave.stream = 6;
  motion.wave.sum.setZero();
  EXPECT_EQ(stepped(), motion.tool_position_world_m);
  motion.wave = {};
  EXPECT_EQ(stepped(), motion.tool_position_world_m);
  EXPECT_FALSE(answer.wave.is_present());
}

class WaveWallEngine final : public physics::Engine {
 public:
  bool step(const ToolMotion& motion, bool, TimePoint now, Interaction& answer) noexcept override {
    const Interaction wall = wall_at(motion, 500.0, now);
    answer.force_on_tool_newton = wall.force_on_tool_newton;
    answer.contacts = wall.contacts;
    answer.listed_count = wall.listed_count;
    answer.contact_count = wall.contact_count;
    return true;
  }
};

template <class Record>
class KeepNone final : public TickSink<Record> {
 public:
  void keep(const Record&) noexcept override {}
};

TEST(WaveVariables, CloseTheLoopThroughBothNodes) {
  ManualClock clock;
  MemoryLink<ToolMotion> motions(clock);
  MemoryLink<Interaction> interactions(clock);
  Inbox<ToolMotion> motion_in(motions, clock);
  Inbox<Interaction> interaction_in(interactions, clock);
  KeepNone<MofcTick> mofc_ticks;
  KeepNone<PhysicsTick> physics_ticks;
  MofcConfig config;
  config.controller = ControllerKind::kWaveVariables;
  config.stale_after = std::chrono::milliseconds(150);
  config.fade = std::chrono::milliseconds(50);
  config.velocity_estimator = DifferenceVelocity{};
  ClampedDevice device;
  device.lease = std::chrono::milliseconds(2);
  mofc::MofcNode mofc(config, device, clock, motions, interaction_in, mofc_ticks, 77);
  WaveWallEngine engine;
  physics::PhysicsNode physics(engine, PhysicsConfig{}, InteractionUse::kLocal, clock, motion_in,
                               interactions, physics_ticks, 9);

  Received<DeviceState> state;
  Vector3 force_newton = Vector3::Zero();
  double mean_newton = 0.0;
  constexpr std::uint64_t kSteps = 3000;
  constexpr std::uint64_t kMean = 1000;
  for (std::uint64_t k = 0; k < kSteps; ++k) {
    clock.advance(from_seconds(kPeriod_s));
    const double z_m = std::max(-0.004, 0.002 - 2e-5 * static_cast<double>(k));
    state.value.header = {1, k, clock.now()};
    state.value.hand_position_m = state.value.tool_position_world_m = {0, 0, z_m};
    state.value.applied[0] = {force_newton, clock.now() - from_seconds(kPeriod_s), clock.now(),
                              state.value.hand_position_m, true};
    state.value.applied_count = k > 0 ? 1 : 0;
    state.received_at = clock.now();
    force_newton = mofc.answer(state).force_on_hand_newton;
    mofc.finish_turn();
    physics.step({.index = k, .scheduled_at = clock.now(), .now = clock.now()});
    if (k + kMean >= kSteps) mean_newton += force_newton.z() / kMean;
  }
  // as in the rig: 1 / (1/500 + 1 ms / 2 N·s/m) = 400 N/m
  EXPECT_NEAR(mean_newton, 1.6, 0.05);
}

}  // namespace
}  // namespace palpate::controllers
