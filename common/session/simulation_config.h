// SPDX-License-Identifier: Apache-2.0
// simulation_config.h — the simulated device and the simulated hand that holds it.
#pragma once

#include <cstdint>
#include <optional>
#include <variant>
#include <vector>

#include "common/core/pointer_config.h"
#include "common/core/time.h"
#include "common/core/vector.h"
#include "common/session/device_profile.h"

namespace palpate {

/// Half the workspace of the simulated device, D.
inline const Vector3 kSimulatedHalfExtent_m{0.08, 0.06, 0.035};

/// The true values of each joint of a simulated wrist.
struct SimulatedWristConfig {
  double inertia_kg_m2 = 2e-5;
  double viscous_newton_m_s_per_rad = 2e-4;
  double coulomb_newton_m = 2e-3;
  double angle_resolution_rad = 1e-4;  ///< 0: exact
  double peak_torque_newton_m = 0.2;
};

/// True values of a simulated device; the controller sees only the profile.
struct SimulatedDeviceConfig {
  double mass_kg = 0.045;
  double viscous_newton_s_per_m = 0.1;
  double coulomb_newton = 0.1;
  std::optional<FrictionPerAxis> per_axis = {};  ///< replaces the two above, which are isotropic
  double position_resolution_m = 55e-6;          ///< 0: exact
  double peak_force_newton = 3.3;
  bool has_position_latch = false;                      ///< of the motors' watchdog
  Duration inner_step = std::chrono::microseconds(50);  ///< longest integration step
  std::optional<SimulatedWristConfig> wrist = {};
};

/// The V of the paper: free motion above the tissue, down one leg, up the other.
struct VPath {
  Vector3 apex_m = Vector3(0, 0, -0.02);  ///< lowest point, in D
  Vector3 normal =
      Vector3::UnitZ();  ///< unit vector out of the tissue; the legs end `height_m` along it
  Vector3 tangent = Vector3::UnitX();  ///< unit vector ⟂ normal, from the first leg to the second
  double height_m = 0.05;              ///< of the ends above the apex
  double half_width_m = 0.03;          ///< of the V between its ends
  double speed_m_per_s = 0.08;         ///< along the legs
  double free_motion_s = 0.0;          ///< t_free
  double free_amplitude_m = 0.02;      ///< radius of the circle before the V, in the plane of the V
  double free_frequency_hz = 0.5;
};
struct HoldPath {
  Vector3 position_m = Vector3::Zero();
};
/// position = center + amplitude ∘ sin(2π frequency t + phase), per axis.
struct SinusoidPath {
  Vector3 center_m = Vector3::Zero();
  Vector3 amplitude_m = Vector3::Zero();
  Vector3 frequency_hz = Vector3::Zero();
  Vector3 phase_rad = Vector3::Zero();
};
/// Columns t,x,y,z of a CSV file, SI units, t increasing; linear in between, first and last held.
struct RecordedPath {
  struct Sample {
    double t_s = 0.0;
    Vector3 position_m = Vector3::Zero();
  };
  std::vector<Sample> samples;  ///< already checked
  bool loops = false;
};
/// A hand that tries to extract energy from the force rendered to it.
struct HostilePath {
  Vector3 center_m = Vector3::Zero();  ///< stays within `radius_m` of it
  double radius_m = 0.02;
  double v_max_m_per_s = 0.5;  ///< of the intended point
};
using PathConfig = std::variant<VPath, HoldPath, SinusoidPath, RecordedPath, HostilePath>;

struct ButtonPress {
  std::uint32_t button = 0;
  double from_s = 0.0;
  double until_s = 0.0;
};

/// On each joint of a wrist an inertia, coupled to the intended angle by spring and damper.
struct HandWristConfig {
  double inertia_kg_m2 = 1e-4;
  double stiffness_newton_m_per_rad = 0.6;
  double damping_newton_m_s_per_rad = 0.008;
  PathConfig path = HoldPath{};  ///< of the angles: rad for m
};

/// A mass coupled to the intended path by spring and damper, docs/theory.md §6.
struct HandConfig {
  double mass_kg = 0.255;
  double stiffness_newton_per_m = 150.0;
  double damping_newton_s_per_m = 6.0;
  PathConfig path = HoldPath{};
  std::vector<ButtonPress> presses{};
  std::optional<PointerConfig> pointer{};  ///< none: the hand follows its path only
  HandWristConfig wrist{};                 ///< used where the device has one
};

}  // namespace palpate
