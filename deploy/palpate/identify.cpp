#include "deploy/palpate/identify.h"

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "common/core/check.h"
#include "common/core/clock.h"
#include "common/session/file/profile_file.h"
#include "device_node/friction_identification.h"
#include "device_node/drivers/open_device.h"

namespace palpate {

namespace {

using namespace palpate::device;

/// The hand lets go of a simulated device.
HandConfig no_hand() {
  HandConfig hand;
  hand.mass_kg = 0.0;
  hand.stiffness_newton_per_m = 0.0;
  hand.damping_newton_s_per_m = 0.0;
  return hand;
}

/// A bound is rounded down where it is shown.
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

void write_profile(const std::string& file, const DeviceProfile& profile,
                   const DeviceSpecification& specification, std::size_t lines) {
  std::ofstream out(file);
  out << profile_text(
      profile, {"Friction of device \"" + specification.model_name + "\": lower bounds over " +
                    std::to_string(lines) + " lines, by palpate identify.",
                "A session includes it: device { profile_file: \"FILE\" }"});
  out.close();
  if (!out) throw SetupError(file + ": cannot be written; choose another place for --output");
}

}  // namespace

void run_identify(const Session& session, const IdentifyOptions& options) {
  std::error_code ignored;  // of a file that does not exist
  if (std::filesystem::equivalent(session.file, options.profile_file, ignored)) {
    throw SetupError(options.profile_file + ": is the session; choose another place for --output");
  }

  ManualClock clock;  // the one driver is the simulated one
  const auto device = open_device(session.side().simulated, no_hand(), clock, session.seed);
  const DeviceSpecification& specification = device->specification();
  const SweepPlan plan = default_sweep_plan(specification);

  print_heading(specification, plan);
  const FrictionReport report =
      identify_friction(*device, clock, plan, options.may_move_hardware, print_line);
  std::printf("overall: f_d ≥ %.4f N·s/m, f_co ≥ %.4f N (%.0f s of the device's time)\n",
              rounded_down(report.viscous_bound_newton_s_per_m),
              rounded_down(report.coulomb_bound_newton), seconds_of(clock.now()));

  if (options.profile_file.empty()) return;
  write_profile(options.profile_file,
                {.viscous_newton_s_per_m = report.viscous_bound_newton_s_per_m,
                 .coulomb_newton = report.coulomb_bound_newton,
                 .position_resolution_m = specification.position_resolution_m},
                specification, report.lines.size());
  std::printf("wrote %s\n", options.profile_file.c_str());
}

}  // namespace palpate
