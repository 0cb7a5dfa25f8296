#include "tests/support/adversity.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <memory>
#include <optional>

#include "common/core/random.h"
#include "common/session/session_file.h"
#include "tests/support/random_messages.h"

namespace palpate::test {
namespace {

// More than any motor gives, and more stored energy than any cap.
constexpr double kHostileNewton = 20.0;
constexpr double kHostileStoreJoule = 1e3;
constexpr std::uint32_t kHostileTissue = 1000;  // not the wall, which mofc_node steps itself

/// The physics of one run: changes what the honest physics sends.
class Tamperer {
 public:
  Tamperer(Physics physics, std::uint64_t seed) : physics_(physics), law_(physics), random_(seed) {}

  void tamper(Interaction& interaction) {
    if (physics_ == Physics::kNewSessions) return restart(interaction);
    if (physics_ == Physics::kHonest) return;
    const double t_s = seconds_of(interaction.header.sampled_at);
    if (physics_ == Physics::kEverything && t_s >= until_s_) change_law(t_s);
    if (law_ == Physics::kHonest) return;

    const Vector3 moved = interaction.tool_position_world_m - position_m_;
    position_m_ = interaction.tool_position_world_m;
    if (moved.norm() > 0.0) along_ = moved.normalized();
    Vector3 force = kHostileNewton * along_;
    if (law_ == Physics::kSquareWave) force = square_wave(t_s);
    if (law_ == Physics::kNotANumber && ++count_ % 3 == 0) {
      force.setConstant(std::numeric_limits<double>::quiet_NaN());
    }
    interaction.force_on_tool_newton = force;
    interaction.stored_energy_joule = kHostileStoreJoule;
    interaction.contact_count = interaction.listed_count = 1;
    interaction.contacts[0] =
        law_ == Physics::kActiveTissue ? active_tissue() : force_everywhere(force);
    interaction.contacts[0].tissue = kHostileTissue;
    lie_about_the_surface(interaction.surface);
  }

 private:
  /// Valid descriptions, tiles and coverage of a tissue that does not exist.
  void lie_about_the_surface(SurfaceNews& news) {
    if (news.store_id == 0 || !random_.chance(0.1)) return;
    const std::uint64_t store_id = news.store_id;
    test::randomise(news, random_);
    news.store_id = store_id;
  }

  void restart(Interaction& interaction) {
    const double t_s = seconds_of(interaction.header.sampled_at);
    interaction.header.session_id += static_cast<std::uint64_t>(t_s / 0.9);
  }

  static Contact force_everywhere(const Vector3& force_newton) {
    return {.penetration_m = 1.0,
            .elastic_force_on_tool_newton = force_newton,
            .stored_energy_joule = kHostileStoreJoule,
            .is_adhesive = true,
            .trust_radius_m = 1.0,
            .force_on_tool_newton = force_newton};
  }

  static Contact active_tissue() {
    return {.penetration_m = 1.0,
            .d_force_d_position = 2000.0 * Matrix3::Identity(),
            .d_force_d_velocity = 100.0 * Matrix3::Identity(),
            .stored_energy_joule = kHostileStoreJoule,
            .is_adhesive = true,
            .trust_radius_m = 1.0};
  }

  void change_law(double t_s) {
    constexpr Physics kLaws[] = {Physics::kHonest, Physics::kSquareWave, Physics::kPushAlong,
                                 Physics::kActiveTissue};
    law_ = kLaws[random_.below(std::size(kLaws))];
    until_s_ = t_s + random_.uniform(0.005, 0.5);
  }

  Vector3 square_wave(double t_s) {
    if (t_s >= turn_s_) {
      turn_s_ = t_s + random_.uniform(0.001, 0.05);
      sign_ = -sign_;
      if (random_.chance(0.2)) axis_ = random_.direction();
    }
    return sign_ * kHostileNewton * axis_;
  }

  Physics physics_;
  Physics law_;
  Random random_;
  Vector3 position_m_ = Vector3::Zero();
  Vector3 along_ = Vector3::UnitZ();
  Vector3 axis_ = Vector3::UnitZ();
  double sign_ = 1.0;
  double turn_s_ = 0.0;
  double until_s_ = 0.0;
  std::uint64_t count_ = 0;
};

/// The clamp of one run: changes what mofc_node answers.
class Liar {
 public:
  explicit Liar(Clamp law) : law_(law) {}

  void tamper(const DeviceState& state, ForceCommand& command) {
    const Vector3 moved = state.hand_position_m - position_m_;
    position_m_ = state.hand_position_m;
    if (moved.norm() > 0.0) along_ = moved.normalized();
    const double t_s = seconds_of(state.header.sampled_at);
    switch (law_) {
      case Clamp::kHonest:
        return;
      case Clamp::kFullForce:
        return push(command);
      case Clamp::kWrongLease:
        command.valid_for = kForever;
        return;
      case Clamp::kAhead:
        push(command);
        ++command.answers_sequence;
        return;
      case Clamp::kReplay:
        history_.push_back(command);
        command.force_on_hand_newton = history_.front().force_on_hand_newton;
        command.valid_for = history_.front().valid_for;
        if (history_.size() > kReplayed) history_.pop_front();
        return;
      case Clamp::kNotANumber:
        push(command);
        if (++count_ % 3 == 0) {
          command.force_on_hand_newton.setConstant(std::numeric_limits<double>::quiet_NaN());
        }
        return;
      case Clamp::kDrift: {
        const double honest = command.force_on_hand_newton.norm();
        if (honest == 0.0) return;
        command.force_on_hand_newton *= (honest + t_s) / honest;
        command.valid_for += from_seconds(1e-3 * t_s);
        return;
      }
      case Clamp::kMostlyRight:
        if (std::fmod(t_s, 0.5) < 0.2) push(command);
        return;
    }
  }

 private:
  static constexpr Duration kForever = std::chrono::hours(1);
  static constexpr std::size_t kReplayed = 100;

  void push(ForceCommand& command) const {
    command.force_on_hand_newton = kHostileNewton * along_;
    command.valid_for = kForever;
  }

  Clamp law_;
  Vector3 position_m_ = Vector3::Zero();
  Vector3 along_ = Vector3::UnitZ();
  std::deque<ForceCommand> history_;
  std::uint64_t count_ = 0;
};

/// Figures of one run.
class Observer {
 public:
  void add(const DeviceTick& tick, AdverseResult& result) {
    result.top_speed_m_per_s =
        std::max(result.top_speed_m_per_s, tick.true_tool_velocity_world_m_per_s.norm());
    const bool has_force = tick.guard == GuardState::kAnswered || tick.guard == GuardState::kLeased;
    if (tick.guard == GuardState::kAnswered) was_answered_ = true;
    if (has_force) {
      fallback_from_.reset();
      return;
    }
    if (!was_answered_) return;
    if (!fallback_from_) fallback_from_ = tick.switched_at;
    result.longest_fallback_s =
        std::max(result.longest_fallback_s, to_seconds(tick.switched_at - *fallback_from_));
  }

 private:
  bool was_answered_ = false;
  std::optional<TimePoint> fallback_from_;
};

}  // namespace

const char* hostile_session() {
  return R"(
name: "hostile"
device { simulated {} }
hand {
  stiffness_newton_per_m: 2000
  damping_newton_s_per_m: 40
  hostile { radius_m: 0.02 v_max_m_per_s: 0.3 }
}
mofc { velocity_estimator { difference { time_constant_ms: 5 } } }
scene {
  tissue {
    name: "wall"
    half_space {}
    kelvin_voigt {
      stiffness_newton_per_m: 1500
      damping_newton_s_per_m: 60
      isotropic_damping: true
      adhesive: true
    }
  }
}
)";
}

AdverseResult run_adverse(const AdverseRun& run, std::uint64_t seed) {
  Session session = parse_session(hostile_session(), "hostile", run.overrides);
  session.seed = seed;
  const auto tamperer =
      std::make_shared<Tamperer>(run.physics, stream_seed(seed, "hostile physics"));
  const auto random = std::make_shared<Random>(stream_seed(seed, "tick jitter"));
  const double period_s = 1.0 / session.side().device.rate_hz;

  LockstepOptions options{.links = run.links};
  if (run.told) {
    options.make_engine = [told = *run.told, tamperer](const Session& of) {
      return black_box(of, told, [tamperer](Interaction& i) { tamperer->tamper(i); });
    };
  } else if (run.physics != Physics::kHonest) {
    options.tamper_with_interaction = [tamperer](Interaction& i) { tamperer->tamper(i); };
  }
  if (run.clamp != Clamp::kHonest) {
    options.tamper_with_command = [liar = Liar(run.clamp)](const DeviceState& state,
                                                           ForceCommand& command) mutable {
      liar.tamper(state, command);
    };
  }
  if (run.tick_jitter > 0.0 || run.late_tick_ratio > 0.0) {
    options.device_lateness = [&run, random, period_s] {
      if (random->chance(run.late_tick_ratio)) {
        return from_seconds(random->uniform(1.0, 5.0) * period_s);
      }
      return from_seconds(random->uniform(0.0, run.tick_jitter) * period_s);
    };
  }

  AdverseResult result;
  result.v_max_m_per_s = session.side().mofc.guard.v_max_m_per_s;
  Observer observer;
  const double scale = session.side().device.workspace.scale_ratio;
  Lockstep lockstep(session, options, [&](const TickRow& row, const IdealState& ideal) {
    result.statistics.add(row, ideal);
    observer.add(row.device, result);
  });
  lockstep.run_until(from_seconds(run.seconds));
  result.top_speed_m_per_s /= scale;
  result.device = lockstep.device_counters();
  result.mofc = lockstep.mofc_counters();
  return result;
}

AdverseRun random_adverse_run(std::uint64_t seed) {
  Random random(stream_seed(seed, "adverse run"));
  AdverseRun run;
  const auto set = [&](const std::string& path, double value) {
    run.overrides.push_back(fmt::format("{}={}", path, value));
  };
  const auto log_uniform = [&](double low, double high) {
    return low * std::pow(high / low, random.uniform());
  };

  // device: rate, deadline, lease, limits
  const double rates_hz[] = {1000, 1000, 1000, 2000, 500, 100};
  const double rate_hz = rates_hz[random.below(std::size(rates_hz))];
  const double period_us = 1e6 / rate_hz;
  const double reply_us = random.uniform(0.2, 0.9) * period_us;
  const double lease_us = random.uniform(1.0, 3.0 - reply_us / period_us) * period_us;
  set("device.rate_hz", rate_hz);
  set("device.reply_us", reply_us);
  set("device.lease_us", lease_us);
  if (random.chance(0.5)) set("device.start_ramp_ms", 0.0);
  // none, the default, or another
  if (random.chance(0.3)) {
    set("device.slew_newton_per_s", log_uniform(10.0, 1e4));
  } else if (seed % 2 == 0) {
    set("device.slew_newton_per_s", 0.0);
  }
  if (random.chance(0.3)) set("device.peak_force_newton", random.uniform(0.5, 3.0));
  if (random.chance(0.3)) set("device.simulated.peak_force_newton", random.uniform(1.0, 12.0));
  if (random.chance(0.3)) {
    set("device.limp_after_ms", random.uniform(1.0, 20.0) * lease_us / 1e3);
    set("device.fade_ms", random.uniform(1.0, 50.0) * period_us / 1e3);
  }

  // friction, at or above the profile; encoder
  const double f_d = random.chance(0.1) ? 0.0 : random.uniform(0.02, 0.3);
  const double f_co = random.chance(0.1) ? 0.0 : random.uniform(0.02, 0.26);
  const double q_m = random.chance(0.2) ? 0.0 : log_uniform(5e-6, 5e-4);
  set("device.profile.viscous_newton_s_per_m", f_d);
  set("device.profile.coulomb_newton", f_co);
  set("device.profile.position_resolution_m", q_m);
  set("device.simulated.viscous_newton_s_per_m",
      f_d * (random.chance(0.6) ? 1.0 : random.uniform(1.0, 2.0)));
  set("device.simulated.coulomb_newton",
      f_co * (random.chance(0.6) ? 1.0 : random.uniform(1.0, 2.0)));
  set("device.simulated.position_resolution_m", q_m * (random.chance(0.8) ? 1.0 : 0.5));
  set("device.simulated.mass_kg", log_uniform(0.02, 0.3));

  // workspace
  if (random.chance(0.3)) {
    set("device.workspace.scale_ratio", log_uniform(0.3, 3.0));
    set("device.workspace.force_ratio", log_uniform(0.3, 3.0));
  }

  // hand: firm, so that it stays below v_max whatever pushes it
  set("hand.mass_kg", log_uniform(0.02, 0.3));
  set("hand.stiffness_newton_per_m", log_uniform(800.0, 4000.0));
  set("hand.damping_newton_s_per_m", log_uniform(30.0, 80.0));
  set("hand.hostile.radius_m", log_uniform(0.002, 0.05));
  set("hand.hostile.v_max_m_per_s", random.chance(0.6) ? 0.3 : random.uniform(0.05, 0.3));

  // controller: how tight the bound is
  const double smoothing_ms = random.chance(0.5) ? 0.0 : random.uniform(0.0, 20.0);
  const std::string estimators[] = {
      fmt::format("difference {{ time_constant_ms: {} }}", smoothing_ms),
      fmt::format("adaptive_window {{ max_window_ms: 20 time_constant_ms: {} }}", smoothing_ms),
      "kalman_velocity {}", "kalman_acceleration {}"};
  run.overrides.push_back(
      fmt::format("mofc.velocity_estimator={{ {} }}", estimators[seed % std::size(estimators)]));
  if (seed % 3 == 1) run.overrides.emplace_back("mofc.motion_deadband={}");
  if (seed % 5 == 1) run.overrides.emplace_back("physics.interaction_deadband={}");
  if (random.chance(0.5)) set("mofc.guard_settings.credit_cap_joule", log_uniform(1e-4, 10.0));
  if (random.chance(0.5)) set("mofc.guard_settings.gate_joule", log_uniform(1e-4, 1e3));
  if (random.chance(0.3)) set("mofc.guard_settings.gate_recovery_ms", log_uniform(1.0, 5000.0));

  // hand-over: too fast to smooth anything, or the default
  run.overrides.push_back(
      fmt::format("mofc.interaction={}", random.chance(0.4) ? "held" : "local"));
  if (random.chance(0.7)) set("mofc.handover_newton_per_s", log_uniform(100.0, 1e6));

  // scene and physics
  const double physics_hz[] = {1000, 50, 50, 200, 3000};
  set("physics.rate_hz", physics_hz[random.below(std::size(physics_hz))]);
  set("scene.tissue[0].kelvin_voigt.stiffness_newton_per_m", log_uniform(30.0, 1e4));
  set("scene.tissue[0].kelvin_voigt.damping_newton_s_per_m",
      random.chance(0.3) ? 0.0 : log_uniform(1.0, 300.0));
  run.overrides.push_back(
      fmt::format("scene.tissue[0].kelvin_voigt.adhesive={}", random.chance(0.5)));
  const Physics laws[] = {Physics::kHonest,     Physics::kHonest,      Physics::kSquareWave,
                          Physics::kPushAlong,  Physics::kNewSessions, Physics::kActiveTissue,
                          Physics::kEverything, Physics::kEverything};
  run.physics = laws[random.below(std::size(laws))];

  // network: each hop independently
  const double period_ms = period_us / 1e3;
  const auto disturb = [&](const std::string& hop, double longest_ms, double most_lost) {
    const std::string at = "faults." + hop + ".";
    if (random.chance(0.4)) set(at + "delay_ms", random.uniform() * longest_ms);
    if (random.chance(0.4)) {
      set(at + "jitter_ms", random.uniform() * longest_ms);
      if (random.chance(0.5)) run.overrides.push_back(at + "jitter_reorders=true");
    }
    if (random.chance(0.3)) set(at + "loss_ratio", random.uniform() * most_lost);
    if (random.chance(0.3)) {
      set(at + "burst_ratio", random.uniform(0.0, 0.02));
      set(at + "burst_length", static_cast<double>(1 + random.below(30)));
    }
    if (random.chance(0.3)) set(at + "duplicate_ratio", random.uniform(0.0, 0.5));
    if (random.chance(0.3)) {
      set(at + "reorder_ratio", random.uniform(0.0, 0.3));
      set(at + "reorder_delay_ms", random.uniform(0.1, 2.0) * longest_ms);
    }
    for (const char* window : {"outage", "stall", "freeze"}) {
      if (!random.chance(0.15)) continue;
      const double from_s = random.uniform(0.1, 1.0);
      const double until_s = from_s + log_uniform(0.002, 0.4);
      run.overrides.push_back(fmt::format("{}{}={{from_s: {} until_s: {} every_s: {}}}", at, window,
                                          from_s, until_s, until_s + random.uniform(0.01, 0.5)));
    }
  };
  if (random.chance(0.7)) disturb("tool_motion", 100.0, 0.5);
  if (random.chance(0.7)) disturb("interaction", 100.0, 0.5);
  if (random.chance(0.5)) disturb("device_state", 0.6 * period_ms, 0.3);
  if (random.chance(0.5)) disturb("force_command", 0.6 * period_ms, 0.5);

  // scheduler, and the leases that outlast it
  if (random.chance(0.5)) {
    set("device.longest_lease_us", std::max(lease_us, random.uniform(0.0, 30.0) * 1e3));
    set("device.limp_after_ms", std::max(30.0, random.uniform(1.0, 20.0) * lease_us / 1e3));
  }
  if (random.chance(0.3)) run.overrides.emplace_back("device.simulated.position_latch=true");
  if (random.chance(0.3)) {
    const double until_s = random.uniform(0.5, 20.0) * period_us / 1e6;
    run.overrides.push_back(fmt::format("faults.device.skip={{until_s: {} every_s: {}}}", until_s,
                                        until_s + log_uniform(0.01, 0.3)));
  }
  if (random.chance(0.3)) {
    set("faults.device.late_switch_ratio", random.uniform(0.0, 0.05));
    set("faults.device.late_switch_us", random.uniform(0.0, 3.0) * period_us);
  }
  if (random.chance(0.3)) run.tick_jitter = random.uniform(0.0, 0.5);
  if (random.chance(0.3)) run.late_tick_ratio = log_uniform(0.001, 0.05);
  run.seconds = 2.0;

  // friction per axis, the profile at most the true one
  if (random.chance(0.3)) {
    Vector3 profile_f_d;
    Vector3 profile_f_co;
    Vector3 more;
    for (int i = 0; i < 3; ++i) {
      profile_f_d[i] = f_d * random.uniform(0.2, 3.0);
      profile_f_co[i] = f_co * random.uniform(1.0, 4.0);
      more[i] = random.chance(0.6) ? 1.0 : random.uniform(1.0, 2.0);
    }
    const auto set_axes = [&](const char* path, const Vector3& v) {
      run.overrides.push_back(fmt::format("{}={{ x: {} y: {} z: {} }}", path, v.x(), v.y(), v.z()));
    };
    set_axes("device.profile.viscous_per_axis_newton_s_per_m", profile_f_d);
    set_axes("device.profile.coulomb_per_axis_newton", profile_f_co);
    set_axes("device.simulated.viscous_per_axis_newton_s_per_m", profile_f_d.cwiseProduct(more));
    set_axes("device.simulated.coulomb_per_axis_newton", profile_f_co.cwiseProduct(more));
  }
  return run;
}

AdverseRun random_black_box_run(std::uint64_t seed) {
  AdverseRun run = random_adverse_run(seed);
  run.told = seed % 2 == 0 ? Told::kForce : Told::kPoints;
  run.overrides.emplace_back("mofc.interaction=local");
  return run;
}

AdverseRun random_lying_run(std::uint64_t seed) {
  AdverseRun run = random_adverse_run(seed);
  Random random(stream_seed(seed, "lying clamp"));
  run.clamp = static_cast<Clamp>(1 + random.below(static_cast<std::uint64_t>(Clamp::kMostlyRight)));
  return run;
}

}  // namespace palpate::test
