// SPDX-License-Identifier: Apache-2.0
#include "deploy/lockstep/adversary.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>
#include <utility>

#include "deploy/lockstep/random_elastic.h"
#include "deploy/lockstep/random_surface.h"
#include "mofc_node/controllers/one_pool_clamp.h"

namespace palpate {
namespace {

// More than any motor gives, and more stored energy than any cap.
constexpr double kHostileNewton = 20.0;
constexpr double kHostileNewtonM = 2.0;
constexpr double kHostileStoreJoule = 1e3;
constexpr std::uint32_t kHostileTissue = 1000;  // not the wall, which mofc_node steps itself
constexpr double kRestartPeriod_s = 0.9;

constexpr Duration kForever = std::chrono::hours(1);
constexpr std::size_t kReplayedTicks = 100;
constexpr double kRoundingJoule = 0.97e-9;  // of the nanojoule that the monitor lets pass

Contact force_everywhere(const Vector3& force_newton) {
  return {.penetration_m = 1.0,
          .elastic_force_on_tool_newton = force_newton,
          .stored_energy_joule = kHostileStoreJoule,
          .is_adhesive = true,
          .trust_radius_m = 1.0,
          .force_on_tool_newton = force_newton};
}

Contact active_tissue() {
  return {.penetration_m = 1.0,
          .d_force_d_position = 2000.0 * Matrix3::Identity(),
          .d_force_d_velocity = 100.0 * Matrix3::Identity(),
          .stored_energy_joule = kHostileStoreJoule,
          .is_adhesive = true,
          .trust_radius_m = 1.0};
}

}  // namespace

// --- physics ------------------------------------------------------------------------------------

void PhysicsTamperer::tamper(Interaction& interaction) {
  if (physics_ == HostilePhysics::kHonest) return;
  const double t_s = seconds_of(interaction.header.sampled_at);
  if (physics_ == HostilePhysics::kNewSessions) {
    interaction.header.session_id += static_cast<std::uint64_t>(t_s / kRestartPeriod_s);
    return;
  }
  if (physics_ == HostilePhysics::kLyingCompliance) {
    lie_about_compliance(interaction.elastic, t_s);
    return;
  }
  if (physics_ == HostilePhysics::kLyingGrip) {
    lie_about_grip(interaction, t_s);
    return;
  }
  if (physics_ == HostilePhysics::kEverything && t_s >= until_s_) change_law(t_s);
  if (law_ == HostilePhysics::kHonest) return;

  const Vector3 moved = interaction.tool_position_world_m - position_m_;
  position_m_ = interaction.tool_position_world_m;
  if (moved.norm() > 0.0) along_ = moved.normalized();
  Vector3 force = kHostileNewton * along_;
  if (law_ == HostilePhysics::kSquareWave) force = square_wave(t_s);
  if (law_ == HostilePhysics::kNotANumber && ++count_ % 3 == 0) {
    force.setConstant(std::numeric_limits<double>::quiet_NaN());
  }
  interaction.force_on_tool_newton = force;
  interaction.stored_energy_joule = kHostileStoreJoule;
  interaction.contact_count = interaction.listed_count = 1;
  interaction.contacts[0] =
      law_ == HostilePhysics::kActiveTissue ? active_tissue() : force_everywhere(force);
  interaction.contacts[0].tissue = kHostileTissue;
  turn_along(interaction);
  lie_about_the_surface(interaction.surface);
  lie_about_elastic_bodies(interaction);
}

/// Torque that turns the tool the way that it turns, as far as the force can have it.
void PhysicsTamperer::turn_along(Interaction& interaction) {
  const Vector3 turned = (interaction.tool_orientation_world * orientation_.conjugate()).vec();
  orientation_ = interaction.tool_orientation_world;
  if (turned.norm() > 0.0) turns_ = turned.normalized();
  if (turns_.isZero(0.0)) return;
  const Vector3 torque =
      kHostileNewtonM * (law_ == HostilePhysics::kSquareWave ? sign_ : 1.0) * turns_;
  interaction.torque_on_tool_newton_m = torque;
  const Vector3& force = interaction.force_on_tool_newton;
  if (force.allFinite()) interaction.contacts[0].arm_m = force.cross(torque) / force.squaredNorm();
}

/// Valid descriptions, tiles and coverage of a tissue that does not exist.
void PhysicsTamperer::lie_about_the_surface(SurfaceNews& news) {
  if (news.store_id == 0 || !random_.chance(0.1)) return;
  const std::uint64_t store_id = news.store_id;
  randomise(news, random_);
  news.store_id = store_id;
}

/// Valid points and states of an elastic body that does not exist, where the tool is.
void PhysicsTamperer::lie_about_elastic_bodies(Interaction& interaction) {
  ElasticNews& news = interaction.elastic;
  news.store_id = news.number = 0;
  const SurfaceNews& surface = interaction.surface;
  if (surface.store_id == 0 || surface.has_description || surface.tile_count > 0) return;
  randomise(news, elastic_random_);
  news.store_id = interaction.surface.store_id;
  news.number = ++elastic_number_;
  // few slots, so that they soon fill; versions that the states list
  constexpr std::uint64_t kSlots = 24;
  if (news.has_point) {
    ElasticPoint& point = news.point;
    point.patch = 0;
    point.slot = static_cast<std::uint32_t>(elastic_random_.below(kSlots));
    point.has_other.reset(point.slot);
    point.version = static_cast<std::uint32_t>(elastic_number_);
    point.rest_m = interaction.tool_position_world_m + random_vector(elastic_random_, 0.02);
    point.step_m_per_newton = static_cast<float>(random_magnitude(elastic_random_, -6.0, 0.0));
    elastic_versions_[point.slot] = point.version;
    return;
  }
  ElasticState& state = news.state;
  state.patch = 0;
  state.tissue = kHostileTissue;
  state.number = static_cast<std::uint32_t>(elastic_number_);
  state.tip_radius_m = elastic_random_.uniform(1e-3, 2e-2);
  state.center_m = interaction.tool_position_world_m + random_vector(elastic_random_, 0.01);
  state.force_outside_patch_newton = random_vector(elastic_random_, kHostileNewton);
  state.from_m = state.to_m = interaction.tool_position_world_m;
  state.radius_m = 1.0;
  state.away_step_m = static_cast<float>(elastic_random_.uniform(0.0, 0.05));
  state.force_step_newton = static_cast<float>(elastic_random_.uniform(0.0, kHostileNewton));
  for (std::size_t slot = 0; slot < kElasticSlots; ++slot) {
    state.places[slot].version = elastic_versions_[slot];
    if (elastic_versions_[slot] == 0) state.places[slot] = {};
  }
}

/// What the codec lets pass, of a grip that the honest physics sends or of none.
void PhysicsTamperer::lie_about_grip(Interaction& interaction, double t_s) {
  Random& random = elastic_random_;
  const Vector3 moved = interaction.tool_position_world_m - position_m_;
  position_m_ = interaction.tool_position_world_m;
  if (moved.norm() > 0.0) along_ = moved.normalized();
  if (t_s >= grip_lie_.until_s) {
    grip_lie_ = {
        .until_s = t_s + random_magnitude(random, -3.0, -0.7),
        .stiffness = random.chance(0.5) ? 1.0 : random_magnitude(random, -3.0, 3.0),
        .push_newton = random.chance(0.5) ? 0.0 : random.uniform(-1.0, 1.0) * kHostileNewton,
        .slip_m = random.chance(0.5) ? Vector3::Zero() : random_vector(random, 0.03),
        .number = random.chance(0.8) ? 0U : 1U + static_cast<std::uint32_t>(random.below(4)),
        .is_invented = random.chance(0.5),
        .is_strong = random.chance(0.5),
        .axis = random_vector(random, 1.0),
        .is_needle = random.chance(0.4)};
    grip_lie_.needle = {
        .inward_world = random_vector(random, 1.0),
        .cutting_newton = random.uniform(0.0, 2.0),
        .spreading_newton = random.uniform(0.0, 1.0),
        .friction_newton_per_m = random.chance(0.5) ? 0.0 : random_magnitude(random, -1.0, 6.0),
        .deepest_m = random.chance(0.5) ? 0.0 : random.uniform(0.0, 0.1)};
    grip_lie_.needle.inward_world += 2.0 * Vector3::UnitX();
    if (random.chance(0.5)) grip_lie_.needle.inward_world *= -1.0;
    grip_lie_.needle.inward_world.normalize();
    if (grip_lie_.needle.cutting_newton > 1.0) {  // a blade
      grip_lie_.needle.edge_world =
          grip_lie_.needle.inward_world.cross(Vector3::UnitY()).normalized();
      grip_lie_.needle.friction_newton = grip_lie_.needle.spreading_newton;
    }
  }
  Contact& contact = interaction.contacts[0];
  if (interaction.listed_count == 0 || contact.grip.number == 0) {
    if (!grip_lie_.is_invented) return;
    contact = force_everywhere(Vector3::Zero());
    contact.tissue = kHostileTissue;
    contact.d_force_d_position = -200.0 * Matrix3::Identity();
    contact.grip = {
        .number = 1, .buttons = 1, .slip_newton = 5.0, .tear_newton = 8.0, .reach_m = 0.01};
    interaction.listed_count = interaction.contact_count = 1;
  }
  // softer or harder along some axis
  const Matrix3 along = grip_lie_.axis * grip_lie_.axis.transpose();
  contact.d_force_d_position = grip_lie_.stiffness * contact.d_force_d_position - 100.0 * along;
  contact.elastic_force_on_tool_newton += grip_lie_.push_newton * along_;
  contact.stored_energy_joule = kHostileStoreJoule;
  contact.grip.slip_m += grip_lie_.slip_m;
  contact.grip.number += grip_lie_.number;
  if (grip_lie_.is_strong) {
    contact.grip.slip_newton = contact.grip.tear_newton = kMaxTissueForceNewton;
    contact.grip.reach_m = 1.0;
  }
  if (grip_lie_.is_needle) {
    contact.grip.needle = grip_lie_.needle;
    contact.grip.buttons = 0;
  }
}

/// What the codec lets pass, of points that the honest physics sends.
void PhysicsTamperer::lie_about_compliance(ElasticNews& news, double t_s) {
  Random& random = elastic_random_;
  if (t_s >= lie_.until_s) {
    lie_ = {.until_s = t_s + random_magnitude(random, -3.0, -0.7),
            .stiffness = random.chance(0.5) ? 1.0 : random_magnitude(random, -4.0, 2.0),
            .others = random.chance(0.5) ? 1.0 : random.uniform(-4.0, 4.0),
            .force = random.chance(0.5) ? 1.0 : random.uniform(-10.0, 10.0),
            .way = random.chance(0.5) ? 1.0 : random.uniform(-3.0, 3.0),
            .relaxation = random.chance(0.5) ? 1.0 : random_magnitude(random, -3.0, 2.0),
            .is_exchanged = random.chance(0.3),
            .is_still = random.chance(0.2),
            .away_m = random.chance(0.7) ? Vector3::Zero() : random_vector(random, 0.005)};
  }
  if (news.store_id == 0) return;
  const auto scaled = [](std::int16_t& x, double ratio) {
    x = static_cast<std::int16_t>(
        std::lround(std::clamp(ratio * x, -kElasticScale, kElasticScale)));
  };
  if (news.has_point) {
    ElasticPoint& point = news.point;
    point.step_m_per_newton =
        static_cast<float>(std::clamp(static_cast<double>(point.step_m_per_newton) / lie_.stiffness,
                                      kMinComplianceMPerNewton, kMaxComplianceMPerNewton));
    point.rest_m += lie_.away_m;
    for (auto& other : point.others) {
      for (std::int16_t& x : other) scaled(x, lie_.others);
    }
    if (lie_.is_exchanged) {
      std::swap(point.others[random.below(kElasticSlots)],
                point.others[random.below(kElasticSlots)]);
    }
    return;
  }
  ElasticState& state = news.state;
  if (lie_.is_still && old_state_.number > 0) {
    const std::uint32_t number = state.number;
    state = old_state_;
    state.number = number;
  } else {
    old_state_ = state;
  }
  state.relaxation_s =
      std::clamp(lie_.relaxation * (state.relaxation_s + 1e-3), 0.0, kMaxElasticRelaxationS);
  state.force_step_newton = static_cast<float>(
      std::clamp(std::abs(lie_.force) * static_cast<double>(state.force_step_newton), 0.0, 1e4));
  state.center_m += lie_.away_m;
  for (ElasticPlace& place : state.places) {
    for (std::size_t k = 0; k < 3; ++k) {
      scaled(place.force[k], lie_.force < 0.0 ? -1.0 : 1.0);
      scaled(place.away[k], lie_.way);
      scaled(place.rest[k], lie_.is_exchanged ? -lie_.way : lie_.way);
    }
  }
  if (lie_.is_exchanged) {
    std::swap(state.places[random.below(kElasticSlots)].force,
              state.places[random.below(kElasticSlots)].force);
  }
}

void PhysicsTamperer::change_law(double t_s) {
  constexpr HostilePhysics kLaws[] = {HostilePhysics::kHonest, HostilePhysics::kSquareWave,
                                      HostilePhysics::kPushAlong, HostilePhysics::kActiveTissue};
  law_ = kLaws[random_.below(std::size(kLaws))];
  until_s_ = t_s + random_.uniform(0.005, 0.5);
}

Vector3 PhysicsTamperer::square_wave(double t_s) {
  if (t_s >= turn_s_) {
    turn_s_ = t_s + random_.uniform(0.001, 0.05);
    sign_ = -sign_;
    if (random_.chance(0.2)) axis_ = random_.direction();
  }
  return sign_ * kHostileNewton * axis_;
}

// --- clamp --------------------------------------------------------------------------------------

void ClampTamperer::tamper(const DeviceState& state, ForceCommand& command) {
  const Vector3 moved = state.hand_position_m - position_m_;
  position_m_ = state.hand_position_m;
  if (moved.norm() > 0.0) along_ = moved.normalized();
  if (state.wrist) {
    const Vector3 turned = state.wrist->pose.angle_rad - angle_rad_;
    angle_rad_ = state.wrist->pose.angle_rad;
    for (int i = 0; i < 3; ++i) {
      if (turned[i] != 0.0) turns_[i] = turned[i] > 0.0 ? 1.0 : -1.0;
    }
  }
  const double t_s = seconds_of(state.header.sampled_at);
  switch (law_) {
    case LyingClamp::kTruthful:
      return;
    case LyingClamp::kFullForce:
      return push(command);
    case LyingClamp::kWrongLease:
      command.valid_for = kForever;
      return;
    case LyingClamp::kAhead:
      push(command);
      ++command.answers_sequence;
      return;
    case LyingClamp::kReplay:
      history_.push_back(command);
      command.force_on_hand_newton = history_.front().force_on_hand_newton;
      command.wrist_torque_newton_m = history_.front().wrist_torque_newton_m;
      command.valid_for = history_.front().valid_for;
      if (history_.size() > kReplayedTicks) history_.pop_front();
      return;
    case LyingClamp::kNotANumber:
      push(command);
      if (++count_ % 3 == 0) {
        command.force_on_hand_newton.setConstant(std::numeric_limits<double>::quiet_NaN());
      }
      return;
    case LyingClamp::kDrift: {
      const double honest = command.force_on_hand_newton.norm();
      if (honest == 0.0) return;
      command.force_on_hand_newton *= (honest + t_s) / honest;
      command.wrist_torque_newton_m *= (honest + t_s) / honest;
      command.valid_for += from_seconds(1e-3 * t_s);
      return;
    }
    case LyingClamp::kMostlyRight:
      if (std::fmod(t_s, 0.5) < 0.2) push(command);
      return;
    case LyingClamp::kRounding:
      return spend_all(state, command);
    case LyingClamp::kLedger:
      command.counted_energy_joule += 1.0;
      return;
  }
}

void ClampTamperer::push(ForceCommand& command) const {
  command.force_on_hand_newton = kHostileNewton * along_;
  command.wrist_torque_newton_m = kHostileNewtonM * turns_;
  command.valid_for = kForever;
}

/// As an honest clamp without cap and gate, but for the rounding.
void ClampTamperer::spend_all(const DeviceState& state, ForceCommand& command) const {
  const DeviceProfile& profile = device_.profile;
  std::optional<controllers::AxisFriction> per_axis;
  if (profile.per_axis) {
    per_axis = {.f_d = profile.per_axis->viscous_newton_s_per_m,
                .f_co = profile.per_axis->coulomb_newton};
  }
  const controllers::OnePoolClamp clamp({.f_d = profile.viscous_newton_s_per_m,
                                         .f_co = profile.coulomb_newton,
                                         .T = to_seconds(device_.lease)},
                                        per_axis, device_.monitor.v_max_m_per_s);
  double joule = kRoundingJoule;
  if (std::isfinite(state.monitor_energy_joule)) {
    const double acts_s = to_seconds(
        std::clamp(state.acting_until - state.header.sampled_at, Duration{}, device_.reply));
    joule += std::max(
        0.0,
        state.monitor_energy_joule -
            (acts_s > 0.0 ? acts_s * clamp.drain_watt(state.acting_force_on_hand_newton) : 0.0));
  }
  command.force_on_hand_newton = clamp.clamp(kHostileNewton * along_, joule).force_on_hand_newton;
  command.wrist_torque_newton_m.setZero();
  command.valid_for = device_.lease;
}

// --- scheduler ----------------------------------------------------------------------------------

Duration LateTicks::next() {
  if (jitter_ratio_ == 0.0 && late_ratio_ == 0.0) return {};
  if (random_.chance(late_ratio_)) return from_seconds(random_.uniform(1.0, 5.0) * period_s_);
  return from_seconds(random_.uniform(0.0, jitter_ratio_) * period_s_);
}

}  // namespace palpate
