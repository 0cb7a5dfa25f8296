// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "common/session/file/convert.h"
#include "palpate/v1/session.pb.h"

namespace palpate {

namespace {

constexpr double kWaitMaxRateHz = 200.0;       // above it an answer of the physics comes too late
constexpr double kKeepAlivesUntilStale = 3.0;  // two lost in a row are not silence
constexpr double kHeldPeriodsUntilStale = 6.0;
constexpr double kLocalStaleMs = 150.0;  // hiccups of ordinary networks and machines

GuardConfig to_guard(const Fields& fields) {
  return {.v_max_m_per_s = fields.number("v_max_m_per_s"),
          .credit_cap_joule = fields.number("credit_cap_joule"),
          .gate_joule = fields.number("gate_joule"),
          .gate_recovery = fields.milliseconds("gate_recovery_ms")};
}

VelocityEstimatorConfig to_velocity_estimator(const Fields& fields) {
  const std::string kind = fields.given_member("estimator");
  if (kind == "adaptive_window") {
    const Fields window = fields.message("adaptive_window");
    return AdaptiveWindowVelocity{.max_window = window.milliseconds("max_window_ms"),
                                  .is_best_fit = !window.flag("end_fit"),
                                  .time_constant = window.milliseconds("time_constant_ms")};
  }
  if (kind == "difference") {
    return DifferenceVelocity{.time_constant =
                                  fields.message("difference").milliseconds("time_constant_ms")};
  }
  if (kind == "kalman_velocity") {
    const Fields kalman = fields.message("kalman_velocity");
    return KalmanVelocity{.model = KalmanVelocity::Model::kConstantVelocity,
                          .noise_density = kalman.number("acceleration_density_m2_per_s3"),
                          .moving_mass_kg = kalman.number("moving_mass_kg")};
  }
  const Fields kalman = fields.message("kalman_acceleration");
  return KalmanVelocity{.model = KalmanVelocity::Model::kConstantAcceleration,
                        .noise_density = kalman.number("jerk_density_m2_per_s5"),
                        .moving_mass_kg = kalman.number("moving_mass_kg"),
                        .hand_stiffness_newton_per_m = kalman.number("hand_stiffness_newton_per_m"),
                        .hand_damping_newton_s_per_m = kalman.number("hand_damping_newton_s_per_m"),
                        .intention_density = kalman.number("intention_density_m2_per_s3")};
}

std::optional<MotionDeadband> to_motion_deadband(const Fields& mofc, double wait_for_physics_ms) {
  if (!mofc.has("motion_deadband")) return std::nullopt;
  refuse_if_waiting(mofc, "motion_deadband", wait_for_physics_ms);
  const Fields fields = mofc.message("motion_deadband");
  return MotionDeadband{.ratio = fields.number("ratio"),
                        .floor_m_per_s = fields.number("floor_m_per_s"),
                        .floor_m = fields.number("floor_m"),
                        .floor_rad = fields.number("floor_rad"),
                        .keep_alive = fields.milliseconds("keep_alive_ms")};
}

PaperFriction to_paper_friction(const Fields& fields, const DeviceProfile& profile) {
  if (fields.enumerator("friction") != v1::Mofc::PaperSettings::isotropic) {
    return PaperFriction::kAsPublished;
  }
  if (profile.per_axis) {
    fields.problem("friction", "the profile gives friction per axis; leave one of the two out");
  }
  return PaperFriction::kIsotropic;
}

Duration to_stale_after(const Fields& mofc, const PhysicsConfig& physics, InteractionUse use,
                        const std::optional<MotionDeadband>& motion_deadband) {
  // silence that the deadbands allow is not staleness
  double allowed_silence_ms = 0.0;
  if (motion_deadband) allowed_silence_ms += 1e3 * to_seconds(motion_deadband->keep_alive);
  if (physics.interaction_deadband) {
    allowed_silence_ms += 1e3 * to_seconds(physics.interaction_deadband->keep_alive);
  }
  const double physics_period_ms = 1e3 / physics.rate_hz;
  // a local model stays right while the tissue does; a held force is wrong once the hand moves
  double unnoticed_ms = kHeldPeriodsUntilStale * physics_period_ms;
  if (use == InteractionUse::kLocal) unnoticed_ms = std::max(unnoticed_ms, kLocalStaleMs);
  const double stale_after_ms =
      mofc.number("stale_after_ms", unnoticed_ms + kKeepAlivesUntilStale * allowed_silence_ms);
  if (stale_after_ms < (1.0 - kPeriodTolerance) * physics_period_ms) {
    mofc.problem("stale_after_ms", "must be ≥ 1 period of physics.rate_hz, " +
                                       shown(physics_period_ms) + " ms; leave it out");
  }
  if (stale_after_ms <= allowed_silence_ms) {
    mofc.problem("stale_after_ms", "must be > the keep_alive_ms of the deadbands together, " +
                                       shown(allowed_silence_ms) +
                                       " ms, or the silence they allow fades the force; leave it "
                                       "out");
  }
  return to_milliseconds(stale_after_ms);
}

std::optional<Duration> to_standby_after(const Fields& mofc, const PhysicsConfig& physics,
                                         Duration stale_after, double wait_for_physics_ms) {
  if (!physics.standby) return std::nullopt;
  if (wait_for_physics_ms > 0.0) {
    mofc.problem("wait_for_physics_ms", "needs a session without physics.standby; give 0");
  }
  const Duration silence = physics.standby->silence.value_or(stale_after / 2);
  if (silence >= stale_after) {
    mofc.problem("stale_after_ms", "must be > physics.standby.silence_ms, " +
                                       shown(1e3 * to_seconds(silence)) +
                                       " ms, or the force fades before the standby speaks; leave "
                                       "silence_ms out");
  }
  return silence;
}

ControllerKind to_controller(const Fields& mofc) {
  switch (mofc.enumerator("controller")) {
    case v1::Mofc::none:
      return ControllerKind::kNone;
    case v1::Mofc::virtual_coupling:
      return ControllerKind::kVirtualCoupling;
    case v1::Mofc::energy_bounding:
      return ControllerKind::kEnergyBounding;
    case v1::Mofc::force_bounding:
      return ControllerKind::kForceBounding;
    case v1::Mofc::passivity_control:
      return ControllerKind::kPassivityControl;
    case v1::Mofc::memory_based:
      return ControllerKind::kMemoryBased;
    case v1::Mofc::input_to_state:
      return ControllerKind::kInputToState;
    case v1::Mofc::two_port:
      return ControllerKind::kTwoPort;
    case v1::Mofc::energy_tank:
      return ControllerKind::kEnergyTank;
    case v1::Mofc::lyapunov:
      return ControllerKind::kLyapunov;
    case v1::Mofc::wave_variables:
      return ControllerKind::kWaveVariables;
    default:
      return ControllerKind::kMofc;
  }
}

void refuse_contradictions(const Fields& mofc, const MofcConfig& config) {
  const bool is_guard =
      config.controller == ControllerKind::kMofc && config.mode == MofcMode::kGuard;
  if (config.has_safety_net && is_guard) {
    mofc.problem("safety_net",
                 "mode guard is the safety net itself; leave safety_net out, or give "
                 "another controller or mode");
  }
  const bool needs_model = config.controller == ControllerKind::kVirtualCoupling ||
                           config.controller == ControllerKind::kLyapunov ||
                           config.controller == ControllerKind::kWaveVariables;
  if (needs_model && config.interaction == InteractionUse::kHeld) {
    mofc.problem("interaction",
                 "controller " + controller_text(config) +
                     " evaluates the contact model; leave interaction out for local");
  }
}

}  // namespace

double to_wait_for_physics_ms(const Fields& mofc, double device_rate_hz, double physics_rate_hz) {
  const char* const name = "wait_for_physics_ms";
  const double wait_ms = mofc.number(name);
  if (!(wait_ms > 0.0)) return wait_ms;
  std::string rule;
  if (device_rate_hz > kWaitMaxRateHz) {
    rule = "needs device.rate_hz ≤ 200, here " + shown(device_rate_hz) + "; give 0 never to wait";
  } else if (wait_ms >= 1e3 / device_rate_hz) {
    rule = "must be < 1 period of device.rate_hz, " + shown(1e3 / device_rate_hz) + " ms";
  } else if (physics_rate_hz < device_rate_hz) {
    rule = "needs physics.rate_hz ≥ device.rate_hz, here " + shown(physics_rate_hz) + " < " +
           shown(device_rate_hz) + ", or some readings are never answered";
  }
  if (rule.empty()) return wait_ms;
  mofc.problem(name, rule);
  return kNaN;
}

void refuse_if_waiting(const Fields& fields, const char* deadband, double wait_for_physics_ms) {
  if (wait_for_physics_ms > 0.0) {
    fields.problem(deadband, "needs mofc.wait_for_physics_ms = 0, here " +
                                 shown(wait_for_physics_ms) + "; leave one of them out");
  }
}

MofcConfig to_mofc(const Fields& mofc, double wait_for_physics_ms, const PhysicsConfig& physics,
                   const DeviceConfig& device) {
  MofcConfig config;
  config.controller = to_controller(mofc);
  config.rivals = to_rivals(mofc);
  config.has_safety_net = mofc.flag("safety_net");
  config.accepts_rival = mofc.enumerator("accept") == v1::Mofc::RIVAL_CONTROLLER;
  const int mode = mofc.enumerator("mode");
  if (mode == v1::Mofc::paper) config.mode = MofcMode::kPaper;
  if (mode == v1::Mofc::vector) config.mode = MofcMode::kVector;
  config.guard = to_guard(mofc.message("guard_settings"));
  config.paper_friction = to_paper_friction(mofc.message("paper_settings"), device.profile);
  config.wait_for_physics = to_milliseconds(wait_for_physics_ms);
  config.motion_deadband = to_motion_deadband(mofc, wait_for_physics_ms);
  if (mofc.enumerator("interaction") == v1::Mofc::held) config.interaction = InteractionUse::kHeld;
  refuse_contradictions(mofc, config);
  config.stale_after = to_stale_after(mofc, physics, config.interaction, config.motion_deadband);
  config.still_after = mofc.milliseconds("still_after_ms");
  config.standby_after = to_standby_after(mofc, physics, config.stale_after, wait_for_physics_ms);
  config.fade = mofc.milliseconds("fade_ms");
  config.handover_newton_per_s = mofc.number("handover_newton_per_s");
  config.velocity_estimator = to_velocity_estimator(mofc.message("velocity_estimator"));
  return config;
}

}  // namespace palpate
