#include "deploy/palpate/identify.h"

#include <cmath>
#include <cstdio>
#include <optional>
#include <stdexcept>

#include "common/core/clock.h"
#include "common/core/user/output_file.h"
#include "common/session/file/profile_file.h"
#include "common/session/session_file.h"
#include "device_node/drivers/driver_registry.h"
#include "device_node/friction_identification.h"

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

std::string text_of(const DeviceProfile& profile, const DeviceSpecification& specification,
                    std::size_t lines) {
  return profile_text(
      profile, {"Friction of device \"" + specification.model_name + "\": lower bounds over " +
                    std::to_string(lines) + " lines, by palpate identify.",
                "A session includes it: device { profile_file: \"FILE\" }"});
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
  const auto device = driver.open(clock, {});
  const DeviceSpecification& specification = device->specification();
  const SweepPlan plan = default_sweep_plan(specification);

  print_heading(specification, plan);
  const FrictionReport report =
      identify_friction(*device, clock, plan, options.may_move_hardware, print_line);
  std::printf("overall: f_d ≥ %.4f N·s/m, f_co ≥ %.4f N (%.0f s of the device's time)\n",
              rounded_down(report.viscous_bound_newton_s_per_m),
              rounded_down(report.coulomb_bound_newton), to_seconds(clock.now() - start));

  if (!profile) return;
  const std::string text = text_of({.viscous_newton_s_per_m = report.viscous_bound_newton_s_per_m,
                                    .coulomb_newton = report.coulomb_bound_newton,
                                    .position_resolution_m = specification.position_resolution_m},
                                   specification, report.lines.size());
  if (!profile->write(text) || !profile->close()) throw std::runtime_error(profile->complaint());
  std::printf("wrote %s\n", options.profile_file.c_str());
}

}  // namespace palpate
