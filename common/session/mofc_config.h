// SPDX-License-Identifier: Apache-2.0
// mofc_config.h — the controller, and how mofc_node uses the interactions.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>

#include "common/core/messages.h"
#include "common/core/time.h"
#include "common/core/vector.h"
#include "common/session/rivals_config.h"

namespace palpate {

enum class ControllerKind : std::uint8_t {
  kNone,
  kMofc,
  // published by others: mofc_node/controllers/rivals
  kVirtualCoupling,
  kEnergyBounding,
  kForceBounding,
  kPassivityControl,
  kMemoryBased,
  kInputToState,
  kTwoPort,
  kEnergyTank,
  kLyapunov,
  kWaveVariables,
};
enum class MofcMode : std::uint8_t { kPaper, kVector, kGuard };
/// Mode paper: the Coulomb friction credited to each axis.
enum class PaperFriction : std::uint8_t {
  kAsPublished,  ///< f_co
  kIsotropic,    ///< f_co/√3
};

/// Mode guard: the assumed hand speed and the bounds on the credit.
struct GuardConfig {
  double v_max_m_per_s = 0.5;      ///< highest possible speed of the hand
  double credit_cap_joule = 5e-3;  ///< S_cap: E′ above the energy stored in the tissue
  double gate_joule = 10e-3;       ///< S_g: the leak at which the gate is closed
  Duration gate_recovery = std::chrono::milliseconds(500);  ///< t_rec
};

/// Backward difference with a low-pass filter.
struct DifferenceVelocity {
  Duration time_constant{};  ///< 0: none
};
/// First-order adaptive windowing with a low-pass filter.
struct AdaptiveWindowVelocity {
  Duration max_window = std::chrono::milliseconds(20);
  bool is_best_fit = true;   ///< false: the line through the ends of the window
  Duration time_constant{};  ///< 0: none
};
struct KalmanVelocity {
  enum class Model : std::uint8_t { kConstantVelocity, kConstantAcceleration };
  Model model = Model::kConstantAcceleration;
  double noise_density =
      0.1;  ///< of the jerk [m²/s⁵], or of the acceleration [m²/s³] with constant velocity
  double moving_mass_kg = 0.3;  ///< moved by the motor force; 0: the motor force is not used
  // The hand with constant acceleration: a spring and a damper towards where it wants to be.
  double hand_stiffness_newton_per_m = 150.0;
  double hand_damping_newton_s_per_m = 6.0;
  double intention_density = 0.002;  ///< of the acceleration that the hand intends [m²/s³]
};
/// How the tool's velocity is estimated: mofc_node/velocity_estimator.h.
using VelocityEstimatorConfig =
    std::variant<DifferenceVelocity, AdaptiveWindowVelocity, KalmanVelocity>;

/// Thins hop 2: a motion is sent when it differs enough from the last, or after `keep_alive`.
struct MotionDeadband {
  double ratio = 0.05;          ///< k of the velocity
  double floor_m_per_s = 2e-3;  ///< smallest change of velocity that is sent
  double floor_m = 1e-4;        ///< smallest change of position that is sent
  double floor_rad = 0.02;      ///< smallest change of orientation that is sent
  Duration keep_alive = std::chrono::milliseconds(20);
};
struct MofcConfig {
  ControllerKind controller = ControllerKind::kMofc;
  MofcMode mode = MofcMode::kGuard;
  GuardConfig guard;
  PaperFriction paper_friction = PaperFriction::kAsPublished;
  RivalsConfig rivals{};
  bool has_safety_net = false;  ///< mode guard limits what the controller requests
  bool accepts_rival = false;   ///< on a real device too
  Duration
      wait_for_physics{};  ///< 0: never wait; else answer from the Interaction of the same tick
  InteractionUse interaction = InteractionUse::kLocal;
  double handover_newton_per_s =
      100.0;               ///< fastest change of force caused by a new contact model alone
  Duration stale_after{};  ///< silence on hop 3 before the force fades
  /// The same for described tissue that does not move by itself; no effect below stale_after.
  Duration still_after{};
  Duration fade{};
  VelocityEstimatorConfig velocity_estimator = KalmanVelocity{};
  std::optional<MotionDeadband> motion_deadband{};  ///< none: every motion is sent
  /// Silence of the physics in use before the other takes over; none: there is no standby.
  std::optional<Duration> standby_after{};
};

/// "none", "mofc guard", "force_bounding", …; with the safety net "none behind guard".
[[nodiscard]] std::string controller_text(const MofcConfig& config);

}  // namespace palpate
