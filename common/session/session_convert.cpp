#include "common/session/session_convert.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <set>

#include "common/session/profile_file.h"
#include "common/session/recorded_path.h"
#include "common/session/session_fields.h"
#include "common/session/session_file.h"

namespace palpate {

namespace {

constexpr std::uint32_t kSchemaVersion = 1;
constexpr std::size_t kMaxNameBytes = 64;
constexpr std::size_t kMaxSideNameBytes = 16;
constexpr std::size_t kMaxSides = 4;
constexpr std::size_t kMaxIpcPathBytes = 107;     // sockaddr_un::sun_path without its zero
constexpr std::size_t kMaxInprocNameBytes = 246;  // libzmq: 255 with "inproc://"
constexpr double kWaitMaxRateHz = 200.0;          // above it physics is too far away to wait for
constexpr double kKeepAlivesUntilStale = 3.0;     // two in a row may be lost
constexpr double kPeriodTolerance = 1e-6;         // 333.3333 µs is a period of 3 kHz
constexpr double kPerpendicularTolerance_rad = 1e-3;

/// A byte of at most `last`, or DEL.
bool has_byte_up_to(unsigned char last, const std::string& text) {
  return std::any_of(text.begin(), text.end(), [&](char c) {
    const auto byte = static_cast<unsigned char>(c);
    return byte <= last || byte == 0x7f;
  });
}

/// The file that the field names; empty, with a problem, if it cannot be one.
std::filesystem::path to_file(const Fields& fields, const char* name,
                              const std::filesystem::path& base_dir) {
  const std::string file = fields.text(name);
  if (base_dir.empty()) {
    fields.problem(name, "this session has no folder; give it as a file of its own");
  } else if (has_byte_up_to(0x1f, file)) {
    fields.problem(name, "must not contain control characters; rename the file");
  } else {
    return base_dir / file;
  }
  return {};
}

// --- links ------------------------------------------------------------------------------------

/// What is wrong with an endpoint, or nothing.
std::string endpoint_complaint(const std::string& endpoint) {
  const auto after = [&](const char* scheme) {
    return endpoint.substr(std::char_traits<char>::length(scheme));
  };
  if (has_byte_up_to(0x20, endpoint)) {
    return "must not contain spaces or control characters";
  }
  if (endpoint.starts_with("ipc://")) {
    const std::string path = after("ipc://");
    if (path.empty() || path == "*") return "must name a file: ipc:///run/user/1000/palpate/x.ipc";
    if (path.size() > kMaxIpcPathBytes) {
      return "its path has " + std::to_string(path.size()) + " bytes, the system takes " +
             std::to_string(kMaxIpcPathBytes) + "; give a shorter one, or set PALPATE_RUN_DIR";
    }
    return {};
  }
  if (endpoint.starts_with("inproc://")) {
    const std::string name = after("inproc://");
    if (name.empty() || name.size() > kMaxInprocNameBytes) {
      return "must have a name of 1 … " + std::to_string(kMaxInprocNameBytes) + " bytes";
    }
    return {};
  }
  if (endpoint.starts_with("tcp://")) {
    const std::string address = after("tcp://");
    const std::size_t colon = address.rfind(':');
    const std::string host = address.substr(0, colon);
    if (colon == std::string::npos || host.empty() || host == "*") {
      return "must name host and port for both ends: tcp://192.168.1.5:5551";
    }
    int port = 0;
    const char* const last = address.data() + address.size();
    const auto [stop, error] = std::from_chars(address.data() + colon + 1, last, port);
    if (error != std::errc() || stop != last || port < 1 || port > 65535) {
      return "must end with a port of 1 … 65535: tcp://192.168.1.5:5551";
    }
    return {};
  }
  return "must be ipc://PATH, tcp://HOST:PORT or inproc://NAME";
}

/// Endpoint → path of the link that uses it, over all sides.
using Endpoints = std::map<std::string, std::string>;

/// Links of one session: defaults are files of its run folder, and no two links share an endpoint.
class LinkRules {
 public:
  LinkRules(const Fields& fields, const std::string& session_name, Endpoints& owner_of)
      : fields_(fields), folder_(run_folder(session_name)), owner_of_(owner_of) {}

  /// @param side  whose link; "" in a session with one device
  [[nodiscard]] std::string of_side(const char* name, const std::string& side) const {
    const std::string path = fields_.written_path(name);
    const Endpoint endpoint = read(name, with_side(side, name));
    std::string complaint = endpoint_complaint(endpoint.text);
    const auto [other, is_new] = owner_of_.emplace(endpoint.text, path);
    if (complaint.empty() && !is_new) {
      complaint = other->second == path
                      ? "is that of another side too; give each side its own"
                      : "is that of " + other->second + " too; give each link its own";
    }
    if (!complaint.empty()) fields_.problem(name, endpoint.shown_default + complaint);
    return endpoint.text;
  }

  [[nodiscard]] std::string of_all_sides(const char* name) const {
    const std::string path = fields_.path(name);
    const Endpoint endpoint = read(name, name);
    std::string complaint = endpoint_complaint(endpoint.text);
    const auto [other, is_new] = owner_of_.emplace(endpoint.text, path);
    if (fields_.has(name) && fields_.written_path(name) != path) {
      complaint = "is one for all sides; give it in links { … } of the session";
    } else if (complaint.empty() && !is_new && other->second != path) {
      complaint = "is that of " + other->second + " too; give each link its own";
    }
    if (!complaint.empty()) fields_.problem(name, endpoint.shown_default + complaint);
    return endpoint.text;
  }

 private:
  struct Endpoint {
    std::string text;
    std::string shown_default;  // for a problem: the field itself is left out
  };

  [[nodiscard]] Endpoint read(const char* name, const std::string& default_file) const {
    std::string text = fields_.text(name);
    if (!text.empty()) return {std::move(text), ""};
    text = "ipc://" + (folder_ / (default_file + ".ipc")).string();
    return {text, one_line(text) + ": "};
  }

  const Fields& fields_;
  std::filesystem::path folder_;
  Endpoints& owner_of_;
};

LinksConfig to_links(const LinkRules& rules, const std::string& side) {
  return {.exchange = rules.of_side("exchange", side),
          .tool_motion = rules.of_side("tool_motion", side),
          .interaction = rules.of_side("interaction", side),
          .device_telemetry = rules.of_side("device_telemetry", side),
          .mofc_telemetry = rules.of_side("mofc_telemetry", side),
          .hand_target = rules.of_side("hand_target", side)};
}

// --- device -----------------------------------------------------------------------------------

RealtimeConfig to_realtime(const Fields& fields, const v1::Realtime& written) {
  constexpr int kMaxCpu = 1023;  // CPU_SETSIZE − 1
  RealtimeConfig config;
  config.priority = static_cast<int>(
      fields.integer("priority", config.priority, 0, 99, "give 0 for ordinary scheduling"));
  config.cpu = static_cast<int>(
      fields.integer("cpu", config.cpu, -1, kMaxCpu, "give -1 for no processor of its own"));
  if (written.wait() == v1::Realtime::spin) config.wait = WaitStrategy::kSpin;
  if (written.wait() == v1::Realtime::block) config.wait = WaitStrategy::kBlock;
  return config;
}

WorkspaceConfig to_workspace(const Fields& fields) {
  WorkspaceConfig config;
  config.scale_ratio = fields.number("scale_ratio", config.scale_ratio, above(0),
                                     "give the tool's displacement per displacement of the hand");
  config.force_ratio = fields.number("force_ratio", config.force_ratio, at_least(0),
                                     "give the force on the hand per force on the tool");
  config.offset_m = fields.vector("offset_m", config.offset_m);
  if (fields.has("clutch_button")) {
    config.clutch_button = static_cast<std::uint32_t>(
        fields.integer("clutch_button", 0, 0, 31, "leave it out for no clutch"));
  }
  return config;
}

/// `profile` is what a field has that is left out.
DeviceProfile to_profile(const Fields& fields, DeviceProfile profile) {
  profile.viscous_newton_s_per_m =
      fields.number("viscous_newton_s_per_m", profile.viscous_newton_s_per_m, at_least(0),
                    "give a lower bound of the viscous friction, 0 if unknown");
  profile.per_axis = read_friction_per_axis(fields, profile.per_axis);
  if (profile.per_axis) {
    profile.coulomb_newton =
        std::min(profile.coulomb_newton, profile.per_axis->coulomb_newton.minCoeff());
  }
  profile.coulomb_newton = fields.number("coulomb_newton", profile.coulomb_newton, at_least(0),
                                         "give a lower bound of the dry friction, 0 if unknown");
  check_isotropic_bound(fields, profile);
  profile.position_resolution_m =
      fields.number("position_resolution_m", profile.position_resolution_m, at_least(0),
                    "give the step of the position sensor");
  return profile;
}

SimulatedDeviceConfig to_simulated_device(const Fields& fields) {
  SimulatedDeviceConfig config;
  config.mass_kg =
      fields.number("mass_kg", config.mass_kg, above(0), "give the mass of the moving parts in kg");
  config.viscous_newton_s_per_m =
      fields.number("viscous_newton_s_per_m", config.viscous_newton_s_per_m, at_least(0),
                    "give the true viscous friction, 0 for none");
  config.coulomb_newton = fields.number("coulomb_newton", config.coulomb_newton, at_least(0),
                                        "give the true dry friction, 0 for none");
  config.per_axis = read_friction_per_axis(fields, {});
  config.position_resolution_m =
      fields.number("position_resolution_m", config.position_resolution_m, at_least(0),
                    "give the step of the encoder, 0 for an exact one");
  config.peak_force_newton = fields.number("peak_force_newton", config.peak_force_newton, above(0),
                                           "give the largest force of the motors");
  config.inner_step = microseconds(fields.number("inner_step_us", 50.0, between(1, 50),
                                                 "leave it out for 50, the coarsest that is exact"
                                                 " enough"));
  return config;
}

/// `rate_hz` and the wait are NaN if they have a problem of their own.
DeviceConfig to_device(const Fields& fields, double rate_hz, double wait_for_physics_ms,
                       double own_peak_force_newton, const std::filesystem::path& base_dir,
                       Problems& problems) {
  DeviceConfig config;
  config.rate_hz = rate_hz;
  config.workspace = to_workspace(fields.message("workspace"));
  if (fields.has("profile_file")) {
    if (const auto file = to_file(fields, "profile_file", base_dir); !file.empty()) {
      config.profile = load_profile(file, fields.place("profile_file"), problems);
    }
  }
  config.profile = to_profile(fields.message("profile"), config.profile);
  const double period_us = 1e6 / rate_hz;
  const double period_ms = 1e3 / rate_hz;

  // in time for the answer, also if mofc waits for physics
  const double wait_us = 1e3 * wait_for_physics_ms;
  double default_reply_us = 0.5 * period_us;
  if (wait_us > 0.0) {
    default_reply_us = std::min(std::max(default_reply_us, wait_us + 0.1 * period_us),
                                0.5 * (wait_us + period_us));
  }
  const double reply_us =
      fields.number("reply_us", default_reply_us, above(0), "leave it out for half a period");
  if (fields.has("reply_us") && reply_us >= period_us) {
    fields.problem("reply_us", "must be < 1 period of device.rate_hz, " + shown(period_us) +
                                   " us; leave it out for half a period");
  }
  if (fields.has("reply_us") && wait_us >= reply_us) {
    fields.problem("reply_us", "must be > mofc.wait_for_physics_ms, " + shown(wait_us) +
                                   " us, or no answer is ever in time; leave it out");
  }
  config.reply = microseconds(reply_us);

  const double lease_us =
      fields.number("lease_us", 2.0 * period_us, above(0), "leave it out for 2 periods");
  const double longest_lease_us = 3.0 * period_us - std::min(reply_us, period_us);
  if (lease_us < (1.0 - kPeriodTolerance) * period_us ||
      lease_us > longest_lease_us + kPeriodTolerance * period_us) {
    fields.problem("lease_us", "must be 1 … 3 periods of device.rate_hz less device.reply_us, " +
                                   shown(period_us) + " … " + shown(longest_lease_us) +
                                   " us; leave it out for 2 periods");
  }
  config.lease = microseconds(lease_us);

  const double limp_after_ms =
      fields.number("limp_after_ms", 20.0 * period_ms, above(0), "leave it out for 20 periods");
  if (1e3 * limp_after_ms < (1.0 - kPeriodTolerance) * lease_us) {
    fields.problem("limp_after_ms", "must be ≥ device.lease_us, " + shown(lease_us / 1e3) +
                                        " ms; leave it out for 20 periods");
  }
  config.limp_after = milliseconds(limp_after_ms);

  const double fade_ms =
      fields.number("fade_ms", std::max(50.0, period_ms), above(0), "leave it out for 50 ms");
  if (fade_ms < (1.0 - kPeriodTolerance) * period_ms) {
    fields.problem("fade_ms", "must be ≥ 1 period of device.rate_hz, " + shown(period_ms) +
                                  " ms, or the force drops in one step; leave it out for 50 ms");
  }
  config.fade = milliseconds(fade_ms);
  config.start_ramp = milliseconds(
      fields.number("start_ramp_ms", 100.0, at_least(0), "give 0 for full force at once"));
  config.peak_force_newton = fields.number("peak_force_newton", own_peak_force_newton, above(0),
                                           "leave it out for the device's own limit");
  config.slew_newton_per_s =
      fields.number("slew_newton_per_s", 0.0, at_least(0), "give 0 for no limit");
  config.v_fault_m_per_s = fields.number("v_fault_m_per_s", config.v_fault_m_per_s, at_least(5),
                                         "leave it out for 10; no hand is faster");
  return config;
}

// --- hand -------------------------------------------------------------------------------------

VPath to_v(const Fields& fields) {
  VPath path;
  path.apex_m = fields.vector("apex_m", path.apex_m);
  path.normal = fields.direction("normal", path.normal);
  path.tangent = fields.direction("tangent", path.tangent);
  const double along = path.normal.dot(path.tangent);
  if (std::abs(along) > std::sin(kPerpendicularTolerance_rad)) {
    fields.problem(fields.has("tangent") ? "tangent" : "normal",
                   "tangent must be perpendicular to normal within 0.001 rad; give both, e.g. "
                   "normal { z: 1 } tangent { x: 1 }");
  }
  path.tangent = (path.tangent - along * path.normal).normalized();
  path.height_m = fields.number("height_m", path.height_m, above(0), "give the height of the legs");
  path.half_width_m = fields.number("half_width_m", path.half_width_m, at_least(0),
                                    "give half the distance of the ends");
  path.speed_m_per_s =
      fields.number("speed_m_per_s", path.speed_m_per_s, above(0), "give the speed along the legs");
  path.free_motion_s =
      fields.number("free_motion_s", path.free_motion_s, at_least(0), "give 0 for none");
  path.free_amplitude_m =
      fields.number("free_amplitude_m", path.free_amplitude_m, at_least(0), "give 0 for rest");
  path.free_frequency_hz = fields.number("free_frequency_hz", path.free_frequency_hz, above(0),
                                         "give free_amplitude_m: 0 for rest");
  return path;
}

SinusoidPath to_sinusoid(const Fields& fields) {
  SinusoidPath path;
  path.center_m = fields.vector("center_m", path.center_m);
  path.amplitude_m = fields.vector("amplitude_m", path.amplitude_m);
  path.frequency_hz =
      fields.vector("frequency_hz", path.frequency_hz, at_least(0), "give 0 for an axis at rest");
  path.phase_rad = fields.vector("phase_rad", path.phase_rad);
  return path;
}

RecordedPath to_recorded(const Fields& fields, const std::filesystem::path& base_dir,
                         Problems& problems) {
  RecordedPath path;
  path.loops = fields.flag("loop");
  if (!fields.has("file")) {
    fields.problem("file", "required; give a CSV file with the columns t,x,y,z");
  } else if (const auto file = to_file(fields, "file", base_dir); !file.empty()) {
    path.samples = load_recorded_path(file, fields.place("file"), problems);
  }
  return path;
}

HostilePath to_hostile(const Fields& fields) {
  HostilePath path;
  path.center_m = fields.vector("center_m", path.center_m);
  path.radius_m = fields.number("radius_m", path.radius_m, above(0), "give how far it may stray");
  path.v_max_m_per_s =
      fields.number("v_max_m_per_s", path.v_max_m_per_s, above(0), "give its largest speed");
  return path;
}

PathConfig to_path(const Fields& hand, const std::filesystem::path& base_dir, Problems& problems) {
  const std::string kind = hand.given_member("path");
  if (kind == "v") return to_v(hand.message("v"));
  if (kind == "sinusoid") return to_sinusoid(hand.message("sinusoid"));
  if (kind == "recorded") return to_recorded(hand.message("recorded"), base_dir, problems);
  if (kind == "hostile") return to_hostile(hand.message("hostile"));
  return HoldPath{hand.message("hold").vector("position_m", Vector3::Zero())};
}

/// `until_s` of a stretch of time that begins at `from_s`.
double to_until_s(const Fields& fields, double from_s) {
  const double until_s =
      fields.required_number("until_s", at_least(0), "give the second at which it ends");
  if (until_s <= from_s) {
    fields.problem("until_s", "must be > from_s, " + shown(from_s));
  }
  return until_s;
}

PointerConfig to_pointer(const Fields& fields) {
  PointerConfig config;
  config.center_m = fields.vector("center_m", config.center_m);
  config.reach_m =
      fields.number("reach_m", config.reach_m, above(0), "give how far from center_m it may go");
  config.speed_m_per_s = fields.number("speed_m_per_s", config.speed_m_per_s, above(0),
                                       "give its largest speed, 0.25 for a calm hand");
  config.holder_timeout = milliseconds(
      fields.number("holder_timeout_ms", 2000.0, at_least(100), "leave it out for 2000"));
  return config;
}

HandConfig to_hand(const Fields& fields, const std::filesystem::path& base_dir,
                   Problems& problems) {
  HandConfig config;
  config.mass_kg = fields.number("mass_kg", config.mass_kg, at_least(0),
                                 "give the mass that moves with the device, 0 for none");
  config.stiffness_newton_per_m =
      fields.number("stiffness_newton_per_m", config.stiffness_newton_per_m, at_least(0),
                    "give the stiffness towards the intended path, 0 for none");
  config.damping_newton_s_per_m =
      fields.number("damping_newton_s_per_m", config.damping_newton_s_per_m, at_least(0),
                    "give the damping towards the intended path, 0 for none");
  config.path = to_path(fields, base_dir, problems);
  if (fields.has("pointer")) config.pointer = to_pointer(fields.message("pointer"));
  for (const Fields& press : fields.messages("press")) {
    ButtonPress config_press;
    config_press.button = static_cast<std::uint32_t>(
        press.integer("button", 0, 0, 31, "a device has at most 32 buttons"));
    config_press.from_s =
        press.number("from_s", 0.0, at_least(0), "give the second at which it begins");
    config_press.until_s = to_until_s(press, config_press.from_s);
    config.presses.push_back(config_press);
  }
  return config;
}

// --- mofc, physics, viewer --------------------------------------------------------------------

/// The rates are NaN if they have a problem of their own.
double to_wait_for_physics_ms(const Fields& mofc, double device_rate_hz, double physics_rate_hz) {
  const char* const name = "wait_for_physics_ms";
  const double wait_ms = mofc.number(name, 0.0, at_least(0), "give 0 never to wait");
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

GuardConfig to_guard(const Fields& fields) {
  GuardConfig config;
  config.v_max_m_per_s = fields.number("v_max_m_per_s", config.v_max_m_per_s, above(0),
                                       "give the fastest the hand can be, 0.5 for a stylus");
  config.credit_cap_joule = fields.number("credit_cap_joule", config.credit_cap_joule, above(0),
                                          "leave it out for 0.005");
  config.gate_joule =
      fields.number("gate_joule", config.gate_joule, above(0), "leave it out for 0.01");
  config.gate_recovery =
      milliseconds(fields.number("gate_recovery_ms", 500.0, above(0), "leave it out for 500"));
  return config;
}

VelocityEstimatorConfig to_velocity_estimator(const Fields& fields) {
  const auto time_constant = [](const Fields& estimator) {
    return milliseconds(
        estimator.number("time_constant_ms", 0.0, at_least(0), "give 0 for no low-pass"));
  };
  const auto kalman = [](const Fields& estimator, KalmanVelocity config, const char* density) {
    config.noise_density = estimator.number(density, config.noise_density, above(0),
                                            "more answers faster, less is smoother");
    config.moving_mass_kg =
        estimator.number("moving_mass_kg", config.moving_mass_kg, at_least(0),
                         "give the mass of device and hand, 0 not to use the motors' force");
    return config;
  };
  const std::string kind = fields.given_member("estimator");
  if (kind == "adaptive_window") {
    const Fields window = fields.message("adaptive_window");
    AdaptiveWindowVelocity config;
    config.max_window = milliseconds(window.number(
        "max_window_ms", 1e3 * to_seconds(config.max_window), above(0), "leave it out for 20"));
    config.is_best_fit = !window.flag("end_fit");
    config.time_constant = time_constant(window);
    return config;
  }
  if (kind == "kalman_velocity") {
    return kalman(fields.message("kalman_velocity"),
                  {.model = KalmanVelocity::Model::kConstantVelocity, .noise_density = 0.01},
                  "acceleration_density_m2_per_s3");
  }
  if (kind == "difference") {
    return DifferenceVelocity{.time_constant = time_constant(fields.message("difference"))};
  }
  return kalman(fields.message("kalman_acceleration"), {}, "jerk_density_m2_per_s5");
}

Duration to_keep_alive(const Fields& deadband, Duration fallback) {
  return milliseconds(deadband.number("keep_alive_ms", 1e3 * to_seconds(fallback), above(0),
                                      "leave it out for 20"));
}

/// A deadband may be silent in the very tick that waits.
void refuse_if_waiting(const Fields& fields, const char* deadband, double wait_for_physics_ms) {
  if (wait_for_physics_ms > 0.0) {
    fields.problem(deadband, "needs mofc.wait_for_physics_ms = 0, here " +
                                 shown(wait_for_physics_ms) + "; leave one of them out");
  }
}

std::optional<MotionDeadband> to_motion_deadband(const Fields& mofc, double wait_for_physics_ms) {
  if (!mofc.has("motion_deadband")) return std::nullopt;
  refuse_if_waiting(mofc, "motion_deadband", wait_for_physics_ms);
  const Fields fields = mofc.message("motion_deadband");
  MotionDeadband config;
  config.ratio = fields.number("ratio", config.ratio, between(0, 1), "a share of the velocity");
  const auto floor = [&](const char* name, double fallback) {
    return fields.number(name, fallback, at_least(0), "give the least change that counts");
  };
  config.floor_m_per_s = floor("floor_m_per_s", config.floor_m_per_s);
  config.floor_m = floor("floor_m", config.floor_m);
  config.floor_rad = floor("floor_rad", config.floor_rad);
  config.keep_alive = to_keep_alive(fields, config.keep_alive);
  return config;
}

std::optional<InteractionDeadband> to_interaction_deadband(const Fields& physics) {
  if (!physics.has("interaction_deadband")) return std::nullopt;
  const Fields fields = physics.message("interaction_deadband");
  InteractionDeadband config;
  config.ratio = fields.number("ratio", config.ratio, between(0, 1), "a share of the force");
  config.floor_newton = fields.number("floor_newton", config.floor_newton, at_least(0),
                                      "give the least error that counts");
  config.keep_alive = to_keep_alive(fields, config.keep_alive);
  return config;
}

PhysicsConfig to_physics(const Fields& fields) {
  PhysicsConfig config;
  config.rate_hz = fields.number("rate_hz", config.rate_hz, between(1, 10000),
                                 "give the physics steps per second");
  config.reach_m =
      fields.number("reach_m", config.reach_m, between(0, 1), "leave it out for 0.05 m");
  config.interaction_deadband = to_interaction_deadband(fields);
  return config;
}

/// From the reading to the switch: an answer may act as late as its deadline. Then the force may
/// last for its lease; it is never older than 3 periods.
Duration to_delta_max(const Fields& fields, const DeviceConfig& device) {
  const double reply_ms = 1e3 * to_seconds(device.reply);
  const double lease_ms = 1e3 * to_seconds(device.lease);
  const double period_ms = 1e3 / device.rate_hz;
  const double delta_max_ms =
      fields.number("delta_max_ms", reply_ms, above(0), "leave it out for device.reply_us");
  if (delta_max_ms < reply_ms - kPeriodTolerance * period_ms) {
    fields.problem("delta_max_ms", "must be ≥ device.reply_us, " + shown(reply_ms) +
                                       " ms, for answers may act as late as that; leave it out, or "
                                       "give a smaller device.reply_us");
  } else if (fields.has("delta_max_ms") &&
             delta_max_ms + lease_ms > (3.0 + kPeriodTolerance) * period_ms) {
    fields.problem("delta_max_ms", "must be ≤ 3 periods of device.rate_hz less device.lease_us, " +
                                       shown(3.0 * period_ms - lease_ms) +
                                       " ms; leave it out, or give a shorter lease");
  }
  return milliseconds(delta_max_ms);
}

PaperFriction to_paper_friction(const Fields& fields, const v1::Mofc::PaperSettings& written,
                                const DeviceProfile& profile) {
  if (!v1::Mofc::PaperSettings::Friction_IsValid(written.friction())) {
    fields.problem("friction", "must be as_published or isotropic");
  }
  if (written.friction() != v1::Mofc::PaperSettings::isotropic) return PaperFriction::kAsPublished;
  if (profile.per_axis) {
    fields.problem("friction", "the profile gives friction per axis; leave one of the two out");
  }
  return PaperFriction::kIsotropic;
}

MofcConfig to_mofc(const Fields& fields, const v1::Mofc& written, double wait_for_physics_ms,
                   const PhysicsConfig& physics, Duration interaction_jitter,
                   const DeviceConfig& device) {
  MofcConfig config;
  if (!v1::Mofc::Controller_IsValid(written.controller())) {
    fields.problem("controller", "must be none or mofc");
  }
  if (!v1::Mofc::Mode_IsValid(written.mode()))
    fields.problem("mode", "must be paper, vector or guard");
  config.controller =
      written.controller() == v1::Mofc::none ? ControllerKind::kNone : ControllerKind::kMofc;
  if (written.mode() == v1::Mofc::paper) config.mode = MofcMode::kPaper;
  if (written.mode() == v1::Mofc::vector) config.mode = MofcMode::kVector;
  config.guard = to_guard(fields.message("guard_settings"));
  config.paper_friction =
      to_paper_friction(fields.message("paper_settings"), written.paper_settings(), device.profile);
  config.wait_for_physics = milliseconds(wait_for_physics_ms);

  // silence that is agreed upon is not staleness
  config.motion_deadband = to_motion_deadband(fields, wait_for_physics_ms);
  double agreed_silence_ms = 0.0;
  if (config.motion_deadband) {
    agreed_silence_ms += 1e3 * to_seconds(config.motion_deadband->keep_alive);
  }
  if (physics.interaction_deadband) {
    agreed_silence_ms += 1e3 * to_seconds(physics.interaction_deadband->keep_alive);
  }
  const double physics_period_ms = 1e3 / physics.rate_hz;
  const double stale_after_ms =
      fields.number("stale_after_ms",
                    6.0 * physics_period_ms + 1e3 * to_seconds(interaction_jitter) +
                        kKeepAlivesUntilStale * agreed_silence_ms,
                    above(0), "leave it out for 6 physics periods");
  if (stale_after_ms < (1.0 - kPeriodTolerance) * physics_period_ms) {
    fields.problem("stale_after_ms", "must be ≥ 1 period of physics.rate_hz, " +
                                         shown(physics_period_ms) +
                                         " ms; leave it out for 6 physics periods");
  }
  if (stale_after_ms <= agreed_silence_ms) {
    fields.problem("stale_after_ms", "must be > the keep_alive_ms of the deadbands together, " +
                                         shown(agreed_silence_ms) +
                                         " ms, or agreed silence fades the force; leave it out");
  }
  config.stale_after = milliseconds(stale_after_ms);
  config.fade = milliseconds(fields.number("fade_ms", 50.0, above(0), "leave it out for 50 ms"));
  if (!v1::Mofc::Interaction_IsValid(written.interaction())) {
    fields.problem("interaction", "must be local or held");
  }
  if (written.interaction() == v1::Mofc::held) config.interaction = InteractionUse::kHeld;
  config.handover_newton_per_s =
      fields.number("handover_newton_per_s", 100.0, above(0), "leave it out for 100 N/s");
  config.velocity_estimator = to_velocity_estimator(fields.message("velocity_estimator"));
  config.delta_max = to_delta_max(fields, device);
  return config;
}

ViewerConfig to_viewer(const Fields& fields) {
  ViewerConfig config;
  config.status_interval = milliseconds(
      fields.number("status_interval_ms", 500.0, at_least(50), "leave it out for 500"));
  const Fields web = fields.message("web");
  config.web.is_on = !web.flag("disabled");
  config.web.port = static_cast<std::uint16_t>(
      web.integer("port", config.web.port, 0, 65535, "give 0 for any free one"));
  return config;
}

// --- scene ------------------------------------------------------------------------------------

/// The geometry that `message` of the tissue takes from a file, which is not opened here.
FileGeometry to_file_geometry(const Fields& tissue, const char* message, FileGeometry::Kind kind,
                              const std::filesystem::path& base_dir) {
  FileGeometry geometry;
  geometry.kind = kind;
  const Fields fields = tissue.message(message);
  if (!fields.has("file")) {
    fields.problem("file", "required; give the path of the file, from the folder of the session");
  } else {
    geometry.file = to_file(fields, "file", base_dir).string();
  }
  geometry.stiffness_property = tissue.message("kelvin_voigt").text("stiffness_property");
  geometry.unit_m = tissue.number("unit_m", geometry.unit_m, above(0),
                                  "give the length of 1 in the file: 0.001 for mm");
  geometry.position_m = tissue.vector("position_m", geometry.position_m);
  const Vector3 turn = tissue.vector("rotation_rad", Vector3::Zero());
  if (turn.norm() > 0.0) {
    geometry.rotation = Quaternion(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
  }
  return geometry;
}

Geometry to_geometry(const Fields& tissue, const std::filesystem::path& base_dir) {
  const std::string kind = tissue.given_member("geometry");
  if (kind == "point_cloud") {
    return to_file_geometry(tissue, "point_cloud", FileGeometry::Kind::kPointCloud, base_dir);
  }
  if (kind == "triangle_surface") {
    return to_file_geometry(tissue, "triangle_surface", FileGeometry::Kind::kTriangleSurface,
                            base_dir);
  }
  if (kind == "tetrahedral_mesh") {
    return to_file_geometry(tissue, "tetrahedral_mesh", FileGeometry::Kind::kTetrahedralMesh,
                            base_dir);
  }
  for (const char* name : {"position_m", "rotation_rad", "unit_m"}) {
    if (tissue.has(name)) {
      tissue.problem(name, "is for a geometry from a file only; place this one by its own fields");
    }
  }
  if (kind == "half_space") {
    const Fields fields = tissue.message("half_space");
    return HalfSpaceGeometry{.point_m = fields.vector("point_m", Vector3::Zero()),
                             .normal = fields.direction("normal", Vector3::UnitZ())};
  }
  if (kind == "sphere") {
    const Fields fields = tissue.message("sphere");
    return SphereGeometry{
        .center_m = fields.vector("center_m", Vector3::Zero()),
        .radius_m = fields.required_number("radius_m", above(0), "give the radius in m")};
  }
  if (kind == "box") {
    const Fields fields = tissue.message("box");
    BoxGeometry box;
    box.center_m = fields.vector("center_m", Vector3::Zero());
    const char* const remedy = "give the three edge lengths in m";
    const Fields size = fields.message("size_m");
    if (!fields.has("size_m")) {
      fields.problem("size_m", std::string("required; ") + remedy);
    } else {
      box.size_m = {size.required_number("x", above(0), remedy),
                    size.required_number("y", above(0), remedy),
                    size.required_number("z", above(0), remedy)};
    }
    return box;
  }
  if (kind == "capsule") {
    const Fields fields = tissue.message("capsule");
    return CapsuleGeometry{
        .from_m = fields.vector("from_m", Vector3::Zero()),
        .to_m = fields.vector("to_m", Vector3::Zero()),
        .radius_m = fields.required_number("radius_m", above(0), "give the radius in m")};
  }
  tissue.problem(
      "a geometry is required; give half_space { … }, sphere { … }, box { … }, capsule { … }, "
      "point_cloud { … }, triangle_surface { … } or tetrahedral_mesh { … }");
  return {};
}

Material to_material(const Fields& tissue) {
  if (tissue.given_member("material").empty()) {
    tissue.problem("a material is required; give kelvin_voigt { stiffness_newton_per_m: … }");
    return {};
  }
  const Fields fields = tissue.message("kelvin_voigt");
  if (fields.has("stiffness_property") && tissue.given_member("geometry") != "point_cloud") {
    fields.problem("stiffness_property", "only a point_cloud has one; leave it out");
  }
  KelvinVoigtMaterial material{
      .stiffness_newton_per_m = fields.required_number("stiffness_newton_per_m", at_least(0),
                                                       "give k, e.g. 500 for firm tissue"),
      .damping_newton_s_per_m =
          fields.number("damping_newton_s_per_m", 0.0, at_least(0), "give b, 0 for none"),
      .is_damping_isotropic = fields.flag("isotropic_damping"),
      .is_adhesive = fields.flag("adhesive"),
      .stiffening_newton_per_m3 =
          fields.number("stiffening_newton_per_m3", 0.0, at_least(0), "give 0 for a linear law"),
      .relaxing_stiffness_newton_per_m =
          fields.number("relaxing_stiffness_newton_per_m", 0.0, at_least(0), "give 0 for none"),
      .relaxation_time_s =
          1e-3 * fields.number("relaxation_time_ms", 200.0, above(0), "leave it out for 200 ms")};
  material.friction_coefficient =
      fields.number("friction_coefficient", 0.0, between(0, 10), "give 0 for a slippery surface");
  material.friction_stiffness_newton_per_m =
      fields.number("friction_stiffness_newton_per_m", material.stiffness_newton_per_m, above(0),
                    "leave it out for the tissue's own stiffness");
  material.puncture_newton =
      fields.number("puncture_newton", 0.0, at_least(0), "give 0 for tissue that never breaks");
  material.cutting_newton =
      fields.number("cutting_newton", 0.25 * material.puncture_newton,
                    between(0, material.puncture_newton), "leave it out for a quarter of it");
  for (const Fields& ball : fields.messages("inclusion")) {
    material.inclusions.push_back(
        {.center_m = ball.vector("center_m", Vector3::Zero()),
         .radius_m = ball.required_number("radius_m", above(0), "give the radius in m"),
         .transition_m = ball.number("transition_m", 0.002, above(0), "leave it out for 2 mm"),
         .stiffness_newton_per_m = ball.required_number("stiffness_newton_per_m", at_least(0),
                                                        "give k, e.g. 1500 for a hard lump"),
         .damping_newton_s_per_m =
             ball.number("damping_newton_s_per_m", material.damping_newton_s_per_m, at_least(0),
                         "leave it out for the tissue's own")});
  }
  return material;
}

TissueMotionConfig to_motion(const Fields& tissue) {
  if (!tissue.has("motion")) return {};
  const Fields fields = tissue.message("motion");
  return {.amplitude_m = fields.vector("amplitude_m", Vector3::Zero()),
          .frequency_hz = fields.required_number("frequency_hz", above(0), "e.g. 0.25 for breath"),
          .phase_rad = fields.number("phase_rad", 0.0, anything(), "give 0")};
}

SceneConfig to_scene(const Fields& fields, const std::filesystem::path& base_dir) {
  SceneConfig config;
  const Fields tool = fields.message("tool");
  config.tip_radius_m =
      tool.number("tip_radius_m", config.tip_radius_m, at_least(0), "give 0 for a point");
  config.shaft_length_m =
      tool.number("shaft_length_m", config.shaft_length_m, at_least(0), "give 0 for none");
  if (config.shaft_length_m > 0.0) {
    config.shaft_radius_m =
        tool.number("shaft_radius_m", config.tip_radius_m, above(0), "give the shaft's radius");
    if (config.shaft_radius_m == 0.0) {
      tool.problem("shaft_radius_m", "required with a point as tip; give the shaft's radius");
    }
  } else if (tool.has("shaft_radius_m")) {
    tool.problem("shaft_radius_m", "needs shaft_length_m > 0; give it, or leave this out");
  }
  std::set<std::string> names;
  for (const Fields& tissue : fields.messages("tissue")) {
    std::string name = tissue.text("name");
    if (name.empty()) name = "tissue" + std::to_string(config.tissues.size());
    if (!names.insert(name).second) {
      tissue.problem("name",
                     "another tissue is called " + one_line(name) + " too; give each its own name");
    }
    config.tissues.push_back({.name = std::move(name),
                              .geometry = to_geometry(tissue, base_dir),
                              .material = to_material(tissue),
                              .motion = to_motion(tissue)});
  }
  return config;
}

// --- faults -----------------------------------------------------------------------------------

void add_windows(const Fields& link, const char* name, FaultWindow::Kind kind,
                 std::vector<FaultWindow>& windows) {
  for (const Fields& fields : link.messages(name)) {
    const double from_s =
        fields.number("from_s", 0.0, at_least(0), "give the second at which it begins");
    const double until_s = to_until_s(fields, from_s);
    const double every_s = fields.number("every_s", 0.0, at_least(0), "give 0 for once");
    if (every_s > 0.0 && every_s < until_s) {
      fields.problem("every_s", "must be ≥ until_s, " + shown(until_s) + ", or 0 for once");
    }
    windows.push_back({.kind = kind,
                       .from = seconds(from_s),
                       .until = seconds(until_s),
                       .every = seconds(every_s)});
  }
}

LinkFaults to_link_faults(const Fields& fields) {
  const auto ratio = [&](const char* name) {
    return fields.number(name, 0.0, between(0, 1), "a share of messages; 0 for none");
  };
  const auto delay = [&](const char* name) {
    return milliseconds(fields.number(name, 0.0, at_least(0), "give 0 for none"));
  };
  LinkFaults faults;
  faults.delay = delay("delay_ms");
  faults.jitter = delay("jitter_ms");
  faults.loss_ratio = ratio("loss_ratio");
  faults.burst_ratio = ratio("burst_ratio");
  faults.burst_length = static_cast<std::uint32_t>(
      fields.integer("burst_length", 1, 1, 1'000'000, "give the messages lost in one burst"));
  faults.duplicate_ratio = ratio("duplicate_ratio");
  faults.reorder_ratio = ratio("reorder_ratio");
  faults.reorder_delay = delay("reorder_delay_ms");
  if (faults.reorder_ratio > 0.0 && faults.reorder_delay <= Duration::zero()) {
    fields.problem("reorder_ratio", "needs reorder_delay_ms > 0; give the time held back");
  }
  faults.jitter_reorders = fields.flag("jitter_reorders");
  add_windows(fields, "outage", FaultWindow::Kind::kOutage, faults.windows);
  add_windows(fields, "stall", FaultWindow::Kind::kStall, faults.windows);
  add_windows(fields, "freeze", FaultWindow::Kind::kFreeze, faults.windows);
  return faults;
}

FaultsConfig to_faults(const Fields& fields) {
  return {.device_state = to_link_faults(fields.message("device_state")),
          .force_command = to_link_faults(fields.message("force_command")),
          .tool_motion = to_link_faults(fields.message("tool_motion")),
          .interaction = to_link_faults(fields.message("interaction"))};
}

SecurityConfig to_security(const Fields& fields, const std::filesystem::path& base_dir) {
  if (!fields.has("key_folder")) {
    fields.problem("key_folder", "required; make one with `palpate keygen FOLDER`");
    return {};
  }
  return {.key_folder = to_file(fields, "key_folder", base_dir).string()};
}

/// "" with a problem, if the name is not fit for files; `max_bytes` ≥ 1.
std::string to_name(const Fields& fields, std::size_t max_bytes) {
  std::string name = fields.text("name");
  const bool is_plain = std::all_of(name.begin(), name.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-';
  });
  if (name.empty()) {
    fields.problem("name", "required; give letters, digits, '_' and '-'");
  } else if (!is_plain || name.size() > max_bytes) {
    fields.problem("name", "must be 1 … " + std::to_string(max_bytes) +
                               " letters, digits, '_' and '-'; it names files");
    return "";
  }
  return name;
}

/// What all sides share.
Session to_shared(const SessionText& text, const std::filesystem::path& base_dir,
                  Problems& problems) {
  const Fields fields(text, problems);
  const v1::Session& written = text.message();
  Session session;
  session.name = to_name(fields, kMaxNameBytes);
  if (written.has_schema_version() && written.schema_version() != kSchemaVersion) {
    fields.problem("schema_version",
                   "this program reads version 1 only; use the program the session was written for,"
                   " or write the session anew");
  }
  session.duration_s =
      fields.number("duration_s", session.duration_s, above(0), "give the seconds of a run");
  if (written.has_seed()) session.seed = written.seed();
  session.faults = to_faults(fields.message("faults"));
  if (fields.has("security")) session.security = to_security(fields.message("security"), base_dir);
  session.physics = to_physics(fields.message("physics"));
  session.viewer = to_viewer(fields.message("viewer"));
  session.scene = to_scene(fields.message("scene"), base_dir);
  session.sides.clear();
  return session;
}

/// Adds the side that `text` describes.
/// @param name  "" if the session has one device
void add_side(const SessionText& text, const std::string& name,
              const std::filesystem::path& base_dir, Endpoints& endpoints, Problems& problems,
              Session& session) {
  const Fields fields(text, problems);
  Side side;
  side.name = name;
  const Fields links = fields.message("links");
  // a name that is not fit would only show again in its files' names
  const LinkRules rules(links, session.name.empty() ? "session" : session.name, endpoints);
  side.links = to_links(rules, name);
  session.physics_telemetry = rules.of_all_sides("physics_telemetry");
  side.realtime = to_realtime(fields.message("realtime"), text.message().realtime());
  side.hand = to_hand(fields.message("hand"), base_dir, problems);

  // whether mofc may wait depends on both rates, the device's deadline depends on the wait
  const Fields device = fields.message("device");
  const Fields mofc = fields.message("mofc");
  const double rate_hz = device.number("rate_hz", side.device.rate_hz, between(10, 10000),
                                       "give the ticks per second of the haptic loop");
  const double wait_ms = to_wait_for_physics_ms(mofc, rate_hz, session.physics.rate_hz);
  if (!name.empty() && wait_ms > 0.0) {
    mofc.problem("wait_for_physics_ms", "needs a session without sides; give 0 never to wait");
  }
  if (session.physics.interaction_deadband) {
    refuse_if_waiting(fields.message("physics"), "interaction_deadband", wait_ms);
  }
  side.simulated = to_simulated_device(device.message("simulated"));
  side.device =
      to_device(device, rate_hz, wait_ms, side.simulated.peak_force_newton, base_dir, problems);
  side.mofc = to_mofc(mofc, text.message().mofc(), wait_ms, session.physics,
                      session.faults.interaction.jitter, side.device);
  session.sides.push_back(std::move(side));
}

std::vector<std::string> to_side_names(const std::vector<Fields>& sides) {
  if (sides.size() == 1 || sides.size() > kMaxSides) {
    sides.back().problem("must be 2 … 4 sides; for one device leave side out");
  }
  std::vector<std::string> names;
  for (const Fields& side : sides) {
    std::string name = to_name(side, kMaxSideNameBytes);
    if (!name.empty() && std::find(names.begin(), names.end(), name) != names.end()) {
      side.problem("name", "another side is called so too; give each its own name");
      name.clear();
    }
    // what has no good name needs no more problems from its files' names
    names.push_back(name.empty() ? "side." + std::to_string(names.size()) : name);
  }
  return names;
}

}  // namespace

Session to_session(const SessionText& text, const std::filesystem::path& base_dir,
                   Problems& problems) {
  Session session = to_shared(text, base_dir, problems);
  Endpoints endpoints;
  const std::vector<Fields> sides = Fields(text, problems).messages("side");
  if (sides.empty()) {
    add_side(text, "", base_dir, endpoints, problems, session);
    return session;
  }
  int index = 0;
  for (const std::string& name : to_side_names(sides)) {
    add_side(text.for_side(index++), name, base_dir, endpoints, problems, session);
  }
  return session;
}

}  // namespace palpate
