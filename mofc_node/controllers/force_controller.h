// SPDX-License-Identifier: Apache-2.0
/// @file
/// force_controller.h — input and output of every force controller (hop 4, inside mofc_node).
///
/// Standard library and Eigen only, so that a controller can be used in other programs. One frame
/// (the device's), SI units, forces are *on the hand*. The paper's f_s is the opposite, the force
/// the user exerts on the virtual environment: f_s = −F.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <span>

#include "wave_channel.h"

/// Force controllers: they limit what a hand feels so that it cannot draw energy from a simulation.
namespace palpate::controllers {

using Vector3 = Eigen::Vector3d;  ///< x, y, z in the device's frame

/// An interval during which one force acted, from the device's echo.
struct AppliedStretch {
  double duration_s = 0.0;                         ///< ≥ 0, measured
  Vector3 force_on_hand_newton = Vector3::Zero();  ///< that really acted, as the motors realised it
  /// Measured position of the hand at the end. Meaningless unless `has_position_at_end`.
  Vector3 hand_position_at_end_m = Vector3::Zero();
  bool has_position_at_end = true;  ///< false: it was not read
};

/// The tissue near the tool as the contact model of hop 3 describes it, at places where the tool is
/// not: for controllers that couple the hand to a proxy or predict the next step. No allocation, no
/// throw.
class TissueProbe {
 public:
  /// What the tissue does to a hand at one place.
  struct Force {
    Vector3 force_on_hand_newton = Vector3::Zero();  ///< of the tissue
    double stored_energy_joule = 0.0;                ///< ≥ 0, as the hand would get it
  };
  virtual ~TissueProbe() = default;
  /// For a hand at this place, moving at this velocity, now.
  [[nodiscard]] virtual Force at(const Vector3& hand_position_m,
                                 const Vector3& hand_velocity_m_per_s) const noexcept = 0;
};

/// One control step at t_k.
struct ControlInput {
  Vector3 hand_position_m = Vector3::Zero();  ///< x(k), measured
  /// What acted since the previous step, in time order, ending at x(k). Empty in the first step,
  /// and where no time has passed.
  std::span<const AppliedStretch> applied;
  /// It is not known what acted since the previous step.
  bool has_gap = false;
  Vector3 acting_force_on_hand_newton = Vector3::Zero();  ///< acts at t_k, until it is replaced
  /// ≥ 0: it ends by itself after this time at the latest; infinite where that is not known.
  double acting_lease_s = std::numeric_limits<double>::infinity();
  /// The device itself covers commands by no more than this energy at t_k; infinite: by any.
  double energy_limit_joule = std::numeric_limits<double>::infinity();
  Vector3 requested_force_on_hand_newton = Vector3::Zero();  ///< F_e(k)
  /// F_e(k) was evaluated since the previous step; false: it is held.
  bool is_request_fresh = true;
  /// Elastic energy in the environment that it may give back to the hand; 0 where unknown.
  double stored_energy_joule = 0.0;

  // used by the published methods only
  Vector3 hand_velocity_m_per_s = Vector3::Zero();  ///< v(k), estimated
  Vector3 evaluated_at_m = Vector3::Zero();  ///< where the hand was for the physics at F_e(k)
  /// Unit, of the deepest contact, out of the tissue; or 0.
  Vector3 surface_normal = Vector3::Zero();
  const TissueProbe* tissue = nullptr;  ///< nullptr: there is no contact model
  /// What the other end of wave variables sends, in the hand's frame; nullptr: no channel. Not
  /// present: the channel is open, nothing has come yet.
  const Wave* returned_wave = nullptr;
};

/// What a controller answers.
struct ControlOutput {
  /// F(k). Not larger than requested, except by published methods that inject damping.
  Vector3 force_on_hand_newton = Vector3::Zero();
  /// Bound per axis: |F_i| ≤ f_max,i. All equal if one bound serves all axes; with one pool and
  /// friction per axis, the bound of a force along that axis alone.
  Vector3 f_max_newton = Vector3::Zero();
  /// E′, the sum of all pools; not more than the input's energy_limit_joule.
  double ledger_energy_joule = 0.0;
  /// A lower bound of what the hand has put in, whatever energy_limit_joule says; NaN: none is
  /// kept.
  double counted_energy_joule = std::numeric_limits<double>::quiet_NaN();
  /// Longest time for which F may act; 0: the controller leaves it to the caller.
  double lease_s = 0.0;
  /// Longest time from the reading until F begins to act; 0: the controller leaves it to the
  /// caller.
  double begins_within_s = 0.0;
  bool is_clamped = false;   ///< F differs from the requested F_e
  bool is_too_fast = false;  ///< the hand moved faster than the controller assumes
  Wave sent_wave{};          ///< wave variables: for the other end, in the hand's frame; else none
};

/// One bound for all directions: F = F_e min(1, f_max / |F_e|), direction kept. The caller sets
/// the ledger's energy. No allocation, no throw. Lemma: reduction.
/// @param requested_force_on_hand_newton  F_e   @param f_max_newton  ≥ 0
[[nodiscard]] ControlOutput output_within(const Vector3& requested_force_on_hand_newton,
                                          double f_max_newton) noexcept;

/// Limits the requested force so that the hand cannot extract energy; `PassThrough` does not limit
/// it. step() once per reading of the device: no allocation, no lock, no throw. One thread.
class ForceController {
 public:
  virtual ~ForceController() = default;
  /// Returns to the initial state, for a new device session.
  virtual void reset() noexcept = 0;
  /// The force from t_k on. Every number of the input must be finite, except acting_lease_s and
  /// energy_limit_joule, which may be infinite.
  [[nodiscard]] virtual ControlOutput step(const ControlInput& input) noexcept = 0;
};

/// Force as requested. Bound and energy are NaN: there are none.
class PassThrough final : public ForceController {
 public:
  /// Has no state.
  void reset() noexcept override {}
  /// F(k) = F_e(k).
  [[nodiscard]] ControlOutput step(const ControlInput& input) noexcept override;
};

}  // namespace palpate::controllers
