// SPDX-License-Identifier: Apache-2.0
// adversary.h — the attacks of `adversary { … }` in a session, simulated in lockstep.
#pragma once

#include <cstdint>
#include <deque>

#include "common/core/messages.h"
#include "common/core/random.h"
#include "common/session/adversary_config.h"
#include "common/session/device_config.h"

namespace palpate {

/// A hostile physics: changes what physics_node sends.
class PhysicsTamperer {
 public:
  PhysicsTamperer(HostilePhysics physics, std::uint64_t seed)
      : physics_(physics), law_(physics), random_(seed), elastic_random_(seed + 1) {}

  void tamper(Interaction& interaction);

 private:
  void lie_about_the_surface(SurfaceNews& news);
  void lie_about_elastic_bodies(Interaction& interaction);
  void lie_about_compliance(ElasticNews& news, double t_s);
  void lie_about_grip(Interaction& interaction, double t_s);
  void turn_along(Interaction& interaction);
  void change_law(double t_s);
  [[nodiscard]] Vector3 square_wave(double t_s);

  HostilePhysics physics_;
  HostilePhysics law_;
  Random random_;
  Random elastic_random_;
  std::uint64_t elastic_number_ = 0;
  std::array<std::uint32_t, kElasticSlots> elastic_versions_{};  // sent last, by slot
  Vector3 position_m_ = Vector3::Zero();
  Vector3 along_ = Vector3::UnitZ();
  Vector3 axis_ = Vector3::UnitZ();
  Quaternion orientation_ = Quaternion::Identity();
  Vector3 turns_ = Vector3::Zero();  // unit, about which the tool turned last; zero: it never did
  double sign_ = 1.0;
  double turn_s_ = 0.0;
  double until_s_ = 0.0;
  // lies about elastic bodies, until then
  struct Lie {
    double until_s = 0.0;
    double stiffness = 1.0;
    double others = 1.0;
    double force = 1.0;
    double way = 1.0;
    double relaxation = 1.0;
    bool is_exchanged = false;
    bool is_still = false;
    Vector3 away_m = Vector3::Zero();
  } lie_;
  struct GripLie {
    double until_s = 0.0;
    double stiffness = 1.0;
    double push_newton = 0.0;
    Vector3 slip_m = Vector3::Zero();
    std::uint32_t number = 0;
    bool is_invented = false;
    bool is_strong = false;
    Vector3 axis = Vector3::Zero();
    bool is_needle = false;
    NeedleLaw needle{};
  } grip_lie_;
  ElasticState old_state_;
  std::uint64_t count_ = 0;
};

/// A clamp that lies: changes what mofc_node answers.
class ClampTamperer {
 public:
  ClampTamperer(LyingClamp law, const DeviceConfig& device) : law_(law), device_(device) {}

  void tamper(const DeviceState& state, ForceCommand& command);

 private:
  void push(ForceCommand& command) const;
  void spend_all(const DeviceState& state, ForceCommand& command) const;

  LyingClamp law_;
  DeviceConfig device_;
  Vector3 position_m_ = Vector3::Zero();
  Vector3 along_ = Vector3::UnitZ();
  Vector3 angle_rad_ = Vector3::Zero();  // of a wrist
  Vector3 turns_ = Vector3::Zero();      // each joint by ±1, or never did: 0
  std::deque<ForceCommand> history_;
  std::uint64_t count_ = 0;
};

/// A scheduler that begins ticks of the device late.
class LateTicks {
 public:
  LateTicks(const AdversaryConfig& config, double rate_hz, std::uint64_t seed)
      : period_s_(1.0 / rate_hz),
        jitter_ratio_(config.tick_jitter_ratio),
        late_ratio_(config.late_tick_ratio),
        random_(seed) {}

  /// How late the next tick begins.
  [[nodiscard]] Duration next();

 private:
  double period_s_;
  double jitter_ratio_;
  double late_ratio_;
  Random random_;
};

}  // namespace palpate
