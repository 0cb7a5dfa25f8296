// SPDX-License-Identifier: Apache-2.0
// friction_identification.h — f_d and f_co of a device, measured with its own motors: slow sweeps
// at constant speed, there and back, on lines at several poses and in several directions. It uses
// only the device's interface, so simulated and real devices are measured alike.
//
// Nobody may hold the device. No friction is known yet that a clamp could use, so the sweeps have
// bounds of their own: |F| ≤ 1 N and ≤ 2× the force that last set the device moving, measured speed
// ≤ 0.1 m/s, inside a box.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <stdexcept>
#include <stop_token>
#include <vector>

#include "common/core/clock.h"
#include "common/core/vector.h"
#include "common/session/device_profile.h"
#include "device_node/device.h"

namespace palpate::device {

/// The sweeps were aborted: a bound was reached, the device failed or a stop was requested. The
/// motors are limp, or did not confirm it. The text states that, what happened, where, and what to
/// do.
class IdentificationError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// One pair of sweeps, there and back: mean speed, and mean motor force along it. Forces that do
/// not reverse with the motion (gravity) cancel.
struct FrictionPoint {
  double speed_m_per_s = 0.0;
  double force_newton = 0.0;
};

/// F = f_co + f_d v, with lower bounds.
struct FrictionFit {
  double viscous_newton_s_per_m = 0.0;        ///< f_d, most likely value
  double coulomb_newton = 0.0;                ///< f_co, most likely value
  double viscous_bound_newton_s_per_m = 0.0;  ///< ≥ 0
  double coulomb_bound_newton = 0.0;          ///< ≥ 0
};

/// Least squares over all points, and once more over the faster two thirds; needs four points and
/// two different speeds among those.
///
///   D = Σ (v − v̄)² ,   f_d = Σ (v − v̄) F / D ,   f_co = F̄ − f_d v̄
///   s² = Σ (F − f_co − f_d v)²/(n − 2) ,   σ_d = s/√D ,   σ_co = s √(1/n + v̄²/D)
///
///   bound of f_d  = 0.98 (least f_d − 3σ_d of both − 0.0015 F̄/(v_max − v_min)) , ≥ 0
///   bound of f_co = 0.98 · least of f_co − 3σ_co and, for every point, F − (bound of f_d) v , ≥ 0
///
/// 3σ covers noise, 0.98 the motors, whose force is known to 2 %. The rest covers systematic
/// errors: where the encoder makes the device wobble, mostly at low speed, part of f_co acts across
/// the motion and is not measured (0.0015: a wobble of 5.5 % of the speed), which would appear as
/// viscous friction; and a friction that falls with speed must stay above the bounds at every
/// speed. Differs: the usual bound is mean − 3σ alone.
[[nodiscard]] FrictionFit fit_friction(std::span<const FrictionPoint> points);

/// A line that is swept, `SweepPlan::half_length_m` to both sides of its middle. D.
struct SweepLine {
  Vector3 middle_m = Vector3::Zero();
  Vector3 direction = Vector3::UnitX();  ///< unit
};

struct SweepPlan {
  double rate_hz = 1000.0;
  Vector3 box_half_extent_m = Vector3::Zero();  ///< D, around the origin; leaving it aborts
  std::vector<SweepLine> lines;                 ///< ≥ 1, inside the box
  double half_length_m = 0.0;                   ///< ≥ 10 mm
  std::vector<double> speeds_m_per_s;           ///< ≥ 2 different ones, ≤ 0.08
  int repeats = 2;                              ///< pairs of sweeps per line and speed; ≥ 2
  /// A person beside the device holds it; released, it aborts. Not one on the handle, which nobody
  /// may hold. None: there is none.
  std::optional<std::uint32_t> dead_man_button = {};
  /// Aborts.
  std::stop_token stop = {};
};

/// The axes of D as far as there are motors along them; unit.
[[nodiscard]] std::vector<Vector3> axes_with_motors(const DeviceSpecification& specification);

/// Four poses (the corners of a tetrahedron) with up to four directions each: the axes of D that
/// have motors and a diagonal. All within 0.9 of the device's workspace.
[[nodiscard]] SweepPlan default_sweep_plan(const DeviceSpecification& specification);

struct LineFriction {
  SweepLine line;
  FrictionFit fit;
};

struct FrictionReport {
  std::vector<LineFriction> lines;
  /// Smallest of all lines.
  double viscous_bound_newton_s_per_m = 0.0;
  double coulomb_bound_newton = 0.0;
};

/// Lower bounds per axis of D, from the smallest of the lines along each. They are lowered together
/// until the model with friction per axis claims no more on any other line than was found there: on
/// a device with isotropic friction, to 1/√3 of what the axes have. 0 for axes without a line.
[[nodiscard]] FrictionPerAxis friction_per_axis(const FrictionReport& report);

/// What the user agreed to; nothing of it is needed for a simulation.
struct SweepConsent {
  bool may_move = false;           ///< the device moves by itself
  bool may_lack_watchdog = false;  ///< and goes on pushing if this program stops
};

/// @throws SetupError  the device needs an agreement that the user did not give
void check_consent(const DeviceSpecification& specification, const SweepConsent& consent);

/// Sweeps every line of the plan; returns with the motors limp. Takes minutes of `clock`'s time,
/// which must be the clock that the device was opened with; in real time, use a thread with
/// real-time scheduling. A sweep in which a lease ran out before the force was averaged is
/// repeated; each is tried five times at most.
/// @param on_line  called after each line, motors limp
/// @throws SetupError           before anything moved: not agreed, outside the box, the dead-man
///     button not held
/// @throws IdentificationError  motors released; also where they did not confirm it at the end
[[nodiscard]] FrictionReport identify_friction(
    HapticDevice& device, Clock& clock, const SweepPlan& plan, const SweepConsent& consent,
    const std::function<void(const LineFriction&)>& on_line = {});

}  // namespace palpate::device
