// mofc_config.h — the controller, and what mofc_node makes of the interactions.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>

#include "common/core/messages.h"
#include "common/core/time.h"
#include "common/core/vector.h"

namespace palpate {

enum class ControllerKind : std::uint8_t { kNone, kMofc };
enum class MofcMode : std::uint8_t { kPaper, kVector, kGuard };
/// Mode paper: the Coulomb friction that each axis counts.
enum class PaperFriction : std::uint8_t {
  kAsPublished,  ///< f_co
  kIsotropic,    ///< f_co/√3
};

/// Mode guard: what is assumed of the hand, and how far credit may grow.
struct GuardConfig {
  double v_max_m_per_s = 0.5;      ///< fastest the hand can be
  double credit_cap_joule = 5e-3;  ///< S_cap: E′ above the energy stored in the tissue
  double gate_joule = 10e-3;       ///< S_g: leak that closes the gate
  Duration gate_recovery = std::chrono::milliseconds(500);  ///< t_rec
};

/// Backward difference, then a low-pass.
struct DifferenceVelocity {
  Duration time_constant{};  ///< 0: none
};
/// First-order adaptive windowing, then a low-pass.
struct AdaptiveWindowVelocity {
  Duration max_window = std::chrono::milliseconds(20);
  bool is_best_fit = true;   ///< else the line through the window's ends
  Duration time_constant{};  ///< 0: none
};
struct KalmanVelocity {
  enum class Model : std::uint8_t { kConstantVelocity, kConstantAcceleration };
  Model model = Model::kConstantAcceleration;
  double noise_density =
      10.0;  ///< of the jerk, m²/s⁵; of the acceleration, m²/s³, if constant velocity
  double moving_mass_kg = 0.3;  ///< that the motors' force moves; 0: their force is not used
};
/// How the tool's velocity is estimated: mofc_node/velocity_estimator.h.
using VelocityEstimatorConfig =
    std::variant<DifferenceVelocity, AdaptiveWindowVelocity, KalmanVelocity>;

/// Hop 2 thinned: a motion is sent when the tool has moved on, or after `keep_alive`.
struct MotionDeadband {
  double ratio = 0.05;          ///< k of the velocity
  double floor_m_per_s = 2e-3;  ///< least change of velocity that counts
  double floor_m = 1e-4;        ///< change of position that counts
  double floor_rad = 0.02;      ///< change of orientation that counts
  Duration keep_alive = std::chrono::milliseconds(20);
};
struct MofcConfig {
  ControllerKind controller = ControllerKind::kMofc;
  MofcMode mode = MofcMode::kGuard;
  GuardConfig guard;
  PaperFriction paper_friction = PaperFriction::kAsPublished;
  Duration wait_for_physics{};  ///< 0: never wait; else answer from the Interaction of this tick
  Duration delta_max{};         ///< longest time from the reading to the switch; not in mode paper
  InteractionUse interaction = InteractionUse::kLocal;
  double handover_newton_per_s = 100.0;  ///< fastest change that a new contact model alone may make
  Duration stale_after{};                ///< silence on hop 3 after which the force fades
  Duration fade{};
  VelocityEstimatorConfig velocity_estimator = KalmanVelocity{};
  std::optional<MotionDeadband> motion_deadband{};  ///< none: every motion is sent
};

/// "none", "mofc paper", "mofc vector", "mofc guard".
[[nodiscard]] std::string controller_text(const MofcConfig& config);

}  // namespace palpate
