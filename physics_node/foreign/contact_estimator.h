// SPDX-License-Identifier: Apache-2.0
// contact_estimator.h — a contact model from what any engine can tell: where the tool is and what
// force acts on it.
//
// The intermediate representation of [Mark96] and [Adac95], identified recursively. With x and v
// the position and velocity of the tool, f the force, N = n·f and n its direction or the engine's
// normal:
//
//   depth       P = −∫ n·dx      along the path in contact: exact on planes and spheres
//   law         ΔN = k ΔP + b Δw,  w = −n·v      least squares over places 0.5 mm apart, which
//                                                forgets over 5 mm of depth, 50 mm along the
//                                                surface
//   surface     p = (N − b w) / k,  Δn = κ Δx along the surface, least squares over 20 mm
//   error       s² = mean of |f − model of the place before|² / |Δx|², the latest of weight 0.2
//
// The first touch guesses k = 2 N / d, d the last step into the tissue: the surface was half-way.
// Where the tool leaves the tissue, the last surface stays as the one expected. The trust radius is
// that where the expected error s r reaches 30 % of the force; 0.5 mm if s exceeds 0.7 k. Beyond it
// mofc_node holds the force of its edge, so far as the surface lets it. A force that pulls into the
// tissue follows no such law: it is held. An engine that can be asked elsewhere (look_ahead.h)
// gives k, b and the surface itself.
#pragma once

#include <cstdint>
#include <optional>

#include "common/core/messages.h"
#include "common/core/vector.h"

namespace palpate::physics {

/// Spring and damper along the normal, as an engine was asked for them; bounded by the estimator.
struct ContactLaw {
  double stiffness_newton_per_m = 0.0;
  double damping_newton_s_per_m = 0.0;
};

/// Tissue that the tool has not touched yet. W.
struct Foreseen {
  Vector3 surface_m = Vector3::Zero();  ///< where the tool will touch
  Vector3 normal = Vector3::UnitZ();    ///< unit, out of the tissue
  double stiffness_newton_per_m = 0.0;
  double slope_error_newton_per_m = 0.0;  ///< s
  double newton = 0.0;                    ///< a force at which that was found
};

/// What an engine tells of one tissue for one pose of the tool; W.
struct Observation {
  Vector3 position_m = Vector3::Zero();
  Vector3 velocity_m_per_s = Vector3::Zero();
  Vector3 force_on_tool_newton = Vector3::Zero();
  std::optional<Vector3> normal = {};        ///< unit, out of the tissue; none: that of the force
  std::optional<double> penetration_m = {};  ///< as the engine's contacts have it; < 0: distance
  std::optional<ContactLaw> law = {};        ///< at this place; none: estimated
};

/// Contact model of one tissue for one tool. No allocation, no throw; no assumption about the rate.
class ContactEstimator {
 public:
  /// The model at this observation: Contact::trust_radius_m follows from how well the models so far
  /// predicted. Where nothing is known, none; where the force follows no model, a contact that
  /// holds it. The force at the observation is exactly that observed.
  [[nodiscard]] std::optional<Contact> step(const Observation& seen) noexcept;

  /// The surface to expect until the tool touches; before step().
  void foresee(const Foreseen& tissue) noexcept;

  /// There is no tissue between here and that place, W: a surface that is expected there is not.
  void foresee_none(const Vector3& as_far_as_m) noexcept;

  /// Estimated so far [N/m], [N·s/m]; 0 before the first touch.
  [[nodiscard]] double stiffness_newton_per_m() const noexcept { return k_; }
  [[nodiscard]] double damping_newton_s_per_m() const noexcept { return b_; }
  /// s [N/m], how much the force departs from the model per metre.
  [[nodiscard]] double slope_error_newton_per_m() const noexcept;

 private:
  /// Where the law is compared with the one before.
  struct Place {
    Vector3 position_m = Vector3::Zero();
    Vector3 normal = Vector3::UnitZ();
    double depth_m = 0.0;           // P
    double approach_m_per_s = 0.0;  // w
    double newton = 0.0;            // N
    Contact model;
  };

  [[nodiscard]] std::optional<Contact> touch(const Observation& seen, const Vector3& normal,
                                             double newton) noexcept;
  [[nodiscard]] std::optional<Contact> expect(const Observation& seen) noexcept;
  void begin(const Observation& seen, const Vector3& normal, double newton) noexcept;
  void compare(const Observation& seen, const Place& here) noexcept;
  void solve() noexcept;
  void adopt(const ContactLaw& law) noexcept;
  [[nodiscard]] Contact model(const Vector3& normal, double penetration_m) const noexcept;
  [[nodiscard]] double trust_radius_m() const noexcept;

  bool is_touching_ = false;
  bool has_surface_ = false;          // one to expect: last_.model
  std::optional<Vector3> free_at_m_;  // the last place without force
  Place last_;                        // of the last step in contact
  Place place_;                       // the last one that was compared
  double k_ = 0.0;
  double b_ = 0.0;
  double first_k_ = 0.0;  // guess at the first touch
  // least squares for k [N/mm], b [N per 10 mm/s], with forgetting
  double pp_ = 0.0, pw_ = 0.0, ww_ = 0.0, pn_ = 0.0, wn_ = 0.0;
  double turn_ = 0.0, slid2_ = 0.0;  // ∑ Δn·Δx, ∑ |Δx|² along the surface
  double curvature_per_m_ = 0.0;
  double error2_ = 0.0;  // s²
  double mean_newton_ = 0.0;
  std::uint64_t compared_ = 0;
};

}  // namespace palpate::physics
