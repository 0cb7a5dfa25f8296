// SPDX-License-Identifier: Apache-2.0
#include "deploy/campaign/hostile_design.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "common/core/random.h"
#include "common/session/session.h"

namespace palpate::campaign {

std::vector<std::string> hostile_overrides(std::uint64_t seed) {
  Random random(stream_seed(seed, "adverse run"));
  std::vector<std::string> overrides;
  const auto set = [&](const std::string& path, double value) {
    overrides.push_back(fmt::format("{}={}", path, value));
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
  overrides.push_back(
      fmt::format("mofc.velocity_estimator={{ {} }}", estimators[seed % std::size(estimators)]));
  if (seed % 3 == 1) overrides.emplace_back("mofc.motion_deadband={}");
  if (seed % 5 == 1) overrides.emplace_back("physics.interaction_deadband={}");
  if (random.chance(0.5)) set("mofc.guard_settings.credit_cap_joule", log_uniform(1e-4, 10.0));
  if (random.chance(0.5)) set("mofc.guard_settings.gate_joule", log_uniform(1e-4, 1e3));
  if (random.chance(0.3)) set("mofc.guard_settings.gate_recovery_ms", log_uniform(1.0, 5000.0));

  // hand-over: too fast to smooth anything, or the default
  overrides.push_back(fmt::format("mofc.interaction={}", random.chance(0.4) ? "held" : "local"));
  if (random.chance(0.7)) set("mofc.handover_newton_per_s", log_uniform(100.0, 1e6));

  // scene and physics
  const double physics_hz[] = {1000, 50, 50, 200, 3000};
  set("physics.rate_hz", physics_hz[random.below(std::size(physics_hz))]);
  set("scene.tissue[0].kelvin_voigt.stiffness_newton_per_m", log_uniform(30.0, 1e4));
  set("scene.tissue[0].kelvin_voigt.damping_newton_s_per_m",
      random.chance(0.3) ? 0.0 : log_uniform(1.0, 300.0));
  overrides.push_back(fmt::format("scene.tissue[0].kelvin_voigt.adhesive={}", random.chance(0.5)));
  const char* laws[] = {"honest",       "honest",        "square_wave", "push_along",
                        "new_sessions", "active_tissue", "everything",  "everything"};
  overrides.push_back(fmt::format("adversary.physics={}", laws[random.below(std::size(laws))]));

  // network: each hop independently
  const double period_ms = period_us / 1e3;
  const auto disturb = [&](const std::string& hop, double longest_ms, double most_lost) {
    const std::string at = "faults." + hop + ".";
    if (random.chance(0.4)) set(at + "delay_ms", random.uniform() * longest_ms);
    if (random.chance(0.4)) {
      set(at + "jitter_ms", random.uniform() * longest_ms);
      if (random.chance(0.5)) overrides.push_back(at + "jitter_reorders=true");
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
      overrides.push_back(fmt::format("{}{}={{from_s: {} until_s: {} every_s: {}}}", at, window,
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
  if (random.chance(0.3)) overrides.emplace_back("device.simulated.position_latch=true");
  if (random.chance(0.3)) {
    const double until_s = random.uniform(0.5, 20.0) * period_us / 1e6;
    overrides.push_back(fmt::format("faults.device.skip={{until_s: {} every_s: {}}}", until_s,
                                    until_s + log_uniform(0.01, 0.3)));
  }
  if (random.chance(0.3)) {
    set("faults.device.late_switch_ratio", random.uniform(0.0, 0.05));
    set("faults.device.late_switch_us", random.uniform(0.0, 3.0) * period_us);
  }
  if (random.chance(0.3)) set("adversary.tick_jitter_ratio", random.uniform(0.0, 0.5));
  if (random.chance(0.3)) set("adversary.late_tick_ratio", log_uniform(0.001, 0.05));

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
      overrides.push_back(fmt::format("{}={{ x: {} y: {} z: {} }}", path, v.x(), v.y(), v.z()));
    };
    set_axes("device.profile.viscous_per_axis_newton_s_per_m", profile_f_d);
    set_axes("device.profile.coulomb_per_axis_newton", profile_f_co);
    set_axes("device.simulated.viscous_per_axis_newton_s_per_m", profile_f_d.cwiseProduct(more));
    set_axes("device.simulated.coulomb_per_axis_newton", profile_f_co.cwiseProduct(more));
  }
  return overrides;
}

std::vector<std::string> hostile_wrist_overrides(std::uint64_t seed) {
  Random random(stream_seed(seed, "adverse wrist"));
  std::vector<std::string> overrides;
  const auto set = [&](const std::string& path, double value) {
    overrides.push_back(fmt::format("{}={}", path, value));
  };
  const auto log_uniform = [&](double low, double high) {
    return low * std::pow(high / low, random.uniform());
  };
  // friction, at or above the profile; encoders; motors
  const double f_d = random.chance(0.1) ? 0.0 : log_uniform(1e-5, 2e-3);
  const double f_co = random.chance(0.1) ? 0.0 : log_uniform(1e-4, 2e-2);
  const double q_rad = random.chance(0.2) ? 0.0 : log_uniform(1e-6, 2e-3);
  set("device.wrist.viscous_newton_m_s_per_rad", f_d);
  set("device.wrist.coulomb_newton_m", f_co);
  set("device.wrist.angle_resolution_rad", q_rad);
  set("device.wrist.peak_torque_newton_m", log_uniform(0.02, 0.3));
  const auto more = [&] { return random.chance(0.6) ? 1.0 : random.uniform(1.0, 2.0); };
  set("device.simulated.wrist.viscous_newton_m_s_per_rad", f_d * more());
  set("device.simulated.wrist.coulomb_newton_m", f_co * more());
  set("device.simulated.wrist.angle_resolution_rad", q_rad * (random.chance(0.8) ? 1.0 : 0.5));
  set("device.simulated.wrist.inertia_kg_m2", log_uniform(5e-6, 2e-4));
  // hand: firm, so that it stays below v_max whatever turns it
  set("hand.wrist.inertia_kg_m2", log_uniform(1e-5, 3e-4));
  set("hand.wrist.stiffness_newton_m_per_rad", log_uniform(1.0, 20.0));
  set("hand.wrist.damping_newton_m_s_per_rad", log_uniform(0.15, 0.5));
  set("hand.wrist.hostile.radius_rad", log_uniform(0.02, 1.0));
  set("hand.wrist.hostile.v_max_rad_per_s", random.chance(0.6) ? 3.0 : random.uniform(0.5, 3.0));
  return overrides;
}

std::string lying_clamp_override(std::uint64_t seed) {
  const char* laws[] = {
      "full_force", "wrong_lease",  "ahead",   "replay", "full_force_not_a_number",
      "drift",      "mostly_right", "rounding"};
  Random random(stream_seed(seed, "lying clamp"));
  return fmt::format("adversary.clamp={}", laws[random.below(std::size(laws))]);
}

}  // namespace palpate::campaign
