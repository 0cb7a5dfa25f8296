// SPDX-License-Identifier: Apache-2.0
#include "deploy/palpate/identify.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <optional>
#include <stdexcept>

#include "common/core/check.h"
#include "common/core/clock.h"
#include "common/core/user/output_file.h"
#include "common/process/acknowledgement.h"
#include "common/process/realtime.h"
#include "common/session/file/profile_file.h"
#include "common/session/session_file.h"
#include "device_node/drivers/driver_registry.h"
#include "device_node/identification/friction_identification.h"

namespace palpate {

namespace {

using namespace palpate::device;

/// A lower bound is printed rounded down.
double rounded_down(double bound) { return std::floor(1e4 * bound) / 1e4; }

void print_heading(const DeviceSpecification& specification, const SweepPlan& plan) {
  std::printf("%s: %zu lines, box ±(%.0f, %.0f, %.0f) mm; lower bounds in brackets\n",
              specification.model_name.c_str(), plan.lines.size(), 1e3 * plan.box_half_extent_m.x(),
              1e3 * plan.box_half_extent_m.y(), 1e3 * plan.box_half_extent_m.z());
  std::printf("%-22s %-20s %-21s %s\n", "middle [mm]", "direction", "f_d [N·s/m]", "f_co [N]");
}

void print_line(const LineFriction& friction) {
  const Vector3 middle_mm = 1e3 * friction.line.middle_m;
  const Vector3& along = friction.line.direction;
  const FrictionFit& fit = friction.fit;
  std::printf("%6.1f %6.1f %6.1f   %5.2f %5.2f %5.2f    %7.4f [%.4f]     %7.4f [%.4f]\n",
              middle_mm.x(), middle_mm.y(), middle_mm.z(), along.x(), along.y(), along.z(),
              fit.viscous_newton_s_per_m, rounded_down(fit.viscous_bound_newton_s_per_m),
              fit.coulomb_newton, rounded_down(fit.coulomb_bound_newton));
  std::fflush(stdout);
}

std::string profile_text_of(const DeviceProfile& profile, const DeviceSpecification& specification,
                            std::size_t lines) {
  return profile_text(
      profile, {"Friction of device \"" + specification.model_name + "\": lower bounds over " +
                    std::to_string(lines) + " lines, by palpate identify.",
                "A session includes it: device { profile_file: \"FILE\" }"});
}

constexpr Duration kAtRestFor = std::chrono::seconds(2);
constexpr double kAtRest_m = 1e-3;
constexpr Duration kPatience = std::chrono::minutes(2);

void print_prompt(const std::string& text) {
  std::printf("%s\n", text.c_str());
  std::fflush(stdout);
}

/// Until a person has acknowledged, and nobody moves the device, in the box.
void wait_until_let_go(HapticDevice& device, Clock& clock, const StartUp& start_up,
                       const SweepPlan& plan) {
  const Vector3& box_half_extent_m = plan.box_half_extent_m;
  await_acknowledgement(
      start_up,
      "Move the device to the middle of its workspace, take the hand off and clear its way" +
          std::string(plan.dead_man_button ? ", hold the dead-man button until all has ended"
                                           : "") +
          "; then press Enter, or send SIGUSR2: it moves by itself once it was at rest for 2 s.");
  const TimePoint until = clock.now() + kPatience;
  DeviceSample rest;
  DeviceSample now;
  for (bool is_at_rest = false;;) {
    if (start_up.stop.stop_requested()) {
      throw SetupError("stopped before the device moved; its motors are released");
    }
    if (!device.read(now)) throw IdentificationError("the device cannot be read");
    const bool is_inside = (now.hand_position_m.array().abs() <= box_half_extent_m.array()).all();
    if (!is_inside || (now.hand_position_m - rest.hand_position_m).norm() > kAtRest_m) {
      is_at_rest = false;
    }
    if (is_inside && !is_at_rest) rest = now;
    is_at_rest = is_inside;
    if (is_at_rest && now.sampled_at - rest.sampled_at >= kAtRestFor) return;
    if (clock.now() >= until) {
      throw SetupError(
          "the device did not come to rest in the box in which friction is measured; move it "
          "inside and let go, balance its weight if it sinks");
    }
    clock.sleep_until(clock.now() + std::chrono::milliseconds(5));
  }
}

}  // namespace

void run_identify(const Session& session, const IdentifyOptions& options) {
  const DriverRegistry drivers = all_drivers(
      {.simulated = {.device = session.side().simulated, .hand = nobody(), .seed = session.seed},
       .driver = session.side().driver});
  SteadyClock steady(session.side().realtime.wait);
  run_identify(session, options, drivers.at(driver_name(session.side().driver)), steady);
}

void run_identify(const Session& session, const IdentifyOptions& options, const Driver& driver,
                  Clock& steady) {
  check_outputs({{"--output", options.profile_file}}, files_of(session), options.may_overwrite);
  std::optional<OutputFile> profile;
  if (!options.profile_file.empty()) {
    profile.emplace("profile", options.profile_file, OutputFile::Kind::kWhole,
                    options.may_overwrite);
  }

  // virtual time for a simulation; hardware has to be waited for
  ManualClock virtual_time;
  Clock& clock = driver.is_simulated ? virtual_time : steady;
  const TimePoint start = clock.now();
  std::optional<TerminalAcknowledgement> terminal;
  StartUp start_up{
      .prompt = print_prompt, .stop = options.stop, .is_acknowledged = options.is_acknowledged};
  if (!driver.is_simulated && !start_up.is_acknowledged) {
    terminal.emplace();
    start_up.is_acknowledged = [&] { return terminal->take(); };
  }
  const auto device = driver.open(clock, start_up);
  const DeviceSpecification& specification = device->specification();
  SweepPlan plan = default_sweep_plan(specification);
  plan.stop = options.stop;
  if (!driver.is_simulated) plan.dead_man_button = session.side().device.dead_man_button;

  print_heading(specification, plan);
  check_consent(specification, options.consent);
  if (!driver.is_simulated) {
    // a sweep is lost if its ticks have to wait for other programs until a lease runs out
    print_prompt("event=realtime " + enter_realtime(session.side().realtime).text);
    await_calibration(*device, start_up);
    wait_until_let_go(*device, clock, start_up, plan);
  }
  const FrictionReport report =
      identify_friction(*device, clock, plan, options.consent, print_line);
  std::printf("overall: f_d ≥ %.4f N·s/m, f_co ≥ %.4f N (%.0f s of the device's time)\n",
              rounded_down(report.viscous_bound_newton_s_per_m),
              rounded_down(report.coulomb_bound_newton), to_seconds(clock.now() - start));

  DeviceProfile found{.viscous_newton_s_per_m = report.viscous_bound_newton_s_per_m,
                      .coulomb_newton = report.coulomb_bound_newton,
                      .position_resolution_m = specification.position_resolution_m};
  if (options.is_per_axis) {
    found.per_axis = friction_per_axis(report);
    const Vector3& viscous = found.per_axis->viscous_newton_s_per_m;
    const Vector3& coulomb = found.per_axis->coulomb_newton;
    // the fallback relies on |F| ≤ f_co
    found.coulomb_newton = std::min(found.coulomb_newton, coulomb.minCoeff());
    std::printf("per axis: f_d ≥ %.4f %.4f %.4f N·s/m, f_co ≥ %.4f %.4f %.4f N\n",
                rounded_down(viscous.x()), rounded_down(viscous.y()), rounded_down(viscous.z()),
                rounded_down(coulomb.x()), rounded_down(coulomb.y()), rounded_down(coulomb.z()));
  }
  if (!profile) return;
  const std::string text = profile_text_of(found, specification, report.lines.size());
  if (!profile->write(text) || !profile->close()) throw std::runtime_error(profile->complaint());
}

}  // namespace palpate
