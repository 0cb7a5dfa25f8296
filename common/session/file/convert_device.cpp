// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <optional>

#include "common/session/file/convert.h"
#include "common/session/file/profile_file.h"

namespace palpate {

namespace {

/// A killed process leaves the last force for so long; longer leases render little better.
constexpr double kDefaultLongestLeaseUs = 10e3;
/// A tick that begins so late still finds its force acting. It is a delay of the machine, whatever
/// the rate; a longer lease of every command takes from the force that the credit pays for.
constexpr double kLateTickUs = 1e3;
/// From this period on no lease is reserved for a late tick: the reserve would take a share of the
/// force all the time, a late tick takes a smaller one now and then. Where credit pays for it, the
/// lease is longer anyhow.
constexpr double kSlowPeriodUs = 2.5e3;
/// Of a period: answers within it have the first claim to the credit, later ones to what it has
/// left.
constexpr double kPromptRatio = 0.5;
/// Later answers would make the next tick wait,
constexpr double kReplyRatio = 0.8;
/// and a machine is not more than that late because its periods are long.
constexpr double kLaterUs = 300.0;
/// From no force to the peak by default. Longer takes the edge off the contact with viscous tissue;
/// shorter bounds little at 1 kHz.
constexpr double kDefaultRiseS = 2e-3;

WorkspaceConfig to_workspace(const Fields& fields) {
  WorkspaceConfig config;
  config.scale_ratio = fields.number("scale_ratio");
  config.force_ratio = fields.number("force_ratio");
  config.offset_m = fields.vector("offset_m");
  if (fields.has("clutch_button")) {
    config.clutch_button = static_cast<std::uint32_t>(fields.integer("clutch_button"));
  }
  return config;
}

/// @param file    what profile_file says; replaces the defaults
/// @param step_m  of the positions, as the driver declares it
DeviceProfile to_profile(const Fields& fields, const std::optional<DeviceProfile>& file,
                         double step_m) {
  const auto fallback = [&](const char* name, double DeviceProfile::*value) {
    return file ? (*file).*value : fields.default_number(name);
  };
  DeviceProfile profile;
  profile.viscous_newton_s_per_m =
      fields.number("viscous_newton_s_per_m",
                    fallback("viscous_newton_s_per_m", &DeviceProfile::viscous_newton_s_per_m));
  profile.per_axis =
      read_friction_per_axis(fields, file ? file->per_axis : std::optional<FrictionPerAxis>());
  double coulomb_newton = fallback("coulomb_newton", &DeviceProfile::coulomb_newton);
  if (profile.per_axis) {
    coulomb_newton = std::min(coulomb_newton, profile.per_axis->coulomb_newton.minCoeff());
  }
  profile.coulomb_newton = fields.number("coulomb_newton", coulomb_newton);
  check_isotropic_bound(fields, profile);
  profile.position_resolution_m =
      fields.number("position_resolution_m",
                    file ? file->position_resolution_m
                         : std::max(fields.default_number("position_resolution_m"), step_m));
  return profile;
}

/// An answer that has waited for physics takes a tenth of a period more, or what the period leaves.
double after_wait_us(double usual_us, double period_us, double wait_us) {
  if (!(wait_us > 0.0)) return usual_us;
  return std::max(usual_us, std::min(wait_us + 0.1 * period_us, 0.5 * (wait_us + period_us)));
}

double to_reply_us(const Fields& device, double period_us, double wait_us) {
  // a command may act until 3 periods after its reading
  const double left_us = 3.0 * period_us - device.number("lease_us", 2.0 * period_us);
  const double usual_us =
      std::clamp(left_us, kPromptRatio * period_us,
                 std::min(kReplyRatio * period_us, kPromptRatio * period_us + kLaterUs));
  const double reply_us = device.number("reply_us", after_wait_us(usual_us, period_us, wait_us));
  if (device.has("reply_us") && reply_us >= period_us) {
    device.problem("reply_us", "must be < 1 period of device.rate_hz, " + shown(period_us) +
                                   " us; leave it out");
  }
  if (device.has("reply_us") && wait_us >= reply_us) {
    device.problem("reply_us", "must be > mofc.wait_for_physics_ms, " + shown(wait_us) +
                                   " us, or no answer is ever in time; leave it out");
  }
  return reply_us;
}

/// @param least_reply_us  of an answer whose deadline the session leaves open
double to_lease_us(const Fields& device, double period_us, double reply_us, double least_reply_us) {
  const double late_us = period_us < kSlowPeriodUs ? std::min(period_us, kLateTickUs) : 0.0;
  const double lease_us = device.number("lease_us", period_us + late_us);
  const double longest_us =
      3.0 * period_us - std::min(device.has("reply_us") ? reply_us : least_reply_us, period_us);
  if (lease_us < (1.0 - kPeriodTolerance) * period_us ||
      lease_us > longest_us + kPeriodTolerance * period_us) {
    device.problem("lease_us", "must be 1 … 3 periods of device.rate_hz less device.reply_us, " +
                                   shown(period_us) + " … " + shown(longest_us) +
                                   " us; leave it out");
  }
  return lease_us;
}

double to_longest_lease_us(const Fields& device, double period_us, double lease_us,
                           double limp_after_us) {
  const char* const name = "longest_lease_us";
  const double longest_us = device.number(
      name, std::max(lease_us,
                     std::min({10.0 * period_us, std::max(2.0 * period_us, kDefaultLongestLeaseUs),
                               limp_after_us})));
  if (longest_us < lease_us - kPeriodTolerance * period_us ||
      longest_us > limp_after_us + kPeriodTolerance * period_us) {
    if (device.has(name)) {
      device.problem(name, "must be ≥ device.lease_us, " + shown(lease_us) +
                               " us, and ≤ device.limp_after_ms, " + shown(limp_after_us / 1e3) +
                               " ms; leave it out for 10 ms");
    }
  }
  return longest_us;
}

}  // namespace

SimulatedDeviceConfig to_simulated_device(const Fields& simulated) {
  SimulatedDeviceConfig config;
  config.mass_kg = simulated.number("mass_kg");
  config.viscous_newton_s_per_m = simulated.number("viscous_newton_s_per_m");
  config.coulomb_newton = simulated.number("coulomb_newton");
  config.per_axis = read_friction_per_axis(simulated, {});
  config.position_resolution_m = simulated.number("position_resolution_m");
  config.peak_force_newton = simulated.number("peak_force_newton");
  config.has_position_latch = simulated.flag("position_latch");
  config.inner_step = simulated.microseconds("inner_step_us");
  return config;
}

DeviceConfig to_device(const Fields& device, double rate_hz, double wait_for_physics_ms,
                       const DriverFigures& driver, const std::filesystem::path& base_dir,
                       Problems& problems) {
  DeviceConfig config;
  config.rate_hz = rate_hz;
  config.workspace = to_workspace(device.message("workspace"));
  std::optional<DeviceProfile> profile;
  if (device.has("profile_file")) {
    if (const auto file = device.file("profile_file", base_dir); !file.empty()) {
      profile = load_profile(file, device.place("profile_file"), problems);
    }
  }
  config.profile = to_profile(device.message("profile"), profile, driver.position_resolution_m);

  const double period_us = 1e6 / rate_hz;
  const double period_ms = 1e3 / rate_hz;
  const double reply_us = to_reply_us(device, period_us, 1e3 * wait_for_physics_ms);
  config.reply = to_microseconds(reply_us);
  const double prompt_us =
      after_wait_us(kPromptRatio * period_us, period_us, 1e3 * wait_for_physics_ms);
  config.prompt = to_microseconds(std::min(reply_us, prompt_us));
  const double lease_us = to_lease_us(device, period_us, reply_us, prompt_us);
  config.lease = to_microseconds(lease_us);

  const double limp_after_ms = device.number("limp_after_ms", 20.0 * period_ms);
  if (1e3 * limp_after_ms < (1.0 - kPeriodTolerance) * lease_us) {
    device.problem("limp_after_ms", "must be ≥ device.lease_us, " + shown(lease_us / 1e3) +
                                        " ms; leave it out for 20 periods");
  }
  config.limp_after = to_milliseconds(limp_after_ms);
  config.longest_lease =
      to_microseconds(to_longest_lease_us(device, period_us, lease_us, 1e3 * limp_after_ms));

  const double fade_ms = device.number("fade_ms", std::max(50.0, period_ms));
  if (fade_ms < (1.0 - kPeriodTolerance) * period_ms) {
    device.problem("fade_ms", "must be ≥ 1 period of device.rate_hz, " + shown(period_ms) +
                                  " ms, or the force drops in one step; leave it out for 50 ms");
  }
  config.fade = to_milliseconds(fade_ms);
  config.start_ramp = device.milliseconds("start_ramp_ms");
  config.peak_force_newton = device.number("peak_force_newton", driver.peak_force_newton);
  config.slew_newton_per_s =
      device.number("slew_newton_per_s",
                    std::min(config.peak_force_newton, driver.peak_force_newton) / kDefaultRiseS);
  config.v_fault_m_per_s = device.number("v_fault_m_per_s");
  config.monitor.is_on = device.enumerator("monitor") != v1::Device::off;
  config.accepts_no_motor_watchdog = device.enumerator("accept") == v1::Device::NO_MOTOR_WATCHDOG;
  config.latency = device.microseconds("latency_us");
  config.skips_motor_check = device.flag("skip_motor_check");
  config.has_hands_off_check = device.flag("hands_off_check");
  if (device.has("dead_man_button")) {
    config.dead_man_button = static_cast<std::uint32_t>(device.integer("dead_man_button"));
    if (config.dead_man_button == config.workspace.clutch_button) {
      device.problem(
          "dead_man_button",
          "must be another button than device.workspace.clutch_button, or no force acts; "
          "leave one of them out");
    }
  }
  return config;
}

}  // namespace palpate
