// SPDX-License-Identifier: Apache-2.0
/// @file
/// ports.h — joints, grips and axes through which a hand exchanges energy with motors: what the
/// clamp for any of them is told, and what it answers (docs/theory.md §2.8).
///
/// Standard library only. Efforts are *on the hand*: what the motors do to it. Every port has its
/// own unit of position, x, and of effort, F, and the power F·v is in watts for all: rad and N·m
/// for a joint or a grip that turns, m and N for one that slides.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <span>

namespace palpate::controllers {

/// More ports does no clamp have: seven joints and a grip.
inline constexpr std::size_t kMostPorts = 8;

/// One number per port, each in the unit of its port; those beyond the last port are not read, and
/// 0 in an answer.
using PortValues = std::array<double, kMostPorts>;

/// No position and no effort of an arm is larger, in whatever unit. Larger numbers are as good as
/// none: their products leave the range of a double.
inline constexpr double kMostPlausible = 1e9;
/// False for NaN.
[[nodiscard]] constexpr bool is_plausible(double value) noexcept {
  return value >= -kMostPlausible && value <= kMostPlausible;
}

/// One port: lower bounds of its friction f_d v + f_co sgn v, its encoder and the fastest hand. The
/// frictions of different ports add up, so three axes of an isotropic friction f_co v/|v| may count
/// f_co/√3 each. Lemma: three_pools.
struct Port {
  double f_d = 0.0;    ///< ≥ 0, viscous [N·m·s/rad or N·s/m]
  double f_co = 0.0;   ///< ≥ 0, Coulomb [N·m or N]
  double q = 0.0;      ///< ≥ 0: each reading is within ±q/2 of the true position [rad or m]
  double v_max = 1.0;  ///< > 0, finite: the hand is never faster here [rad/s or m/s]
  /// Ports of the lowest priority are reduced first, those of one priority by one factor.
  int priority = 0;
};

/// An interval during which one effort acted on each port, from the device's echo.
struct PortStretch {
  double duration_s = 0.0;          ///< ≥ 0, measured
  PortValues effort_on_hand{};      ///< that really acted, as the motors realised it
  PortValues position_at_end{};     ///< measured. Meaningless unless `has_position_at_end`
  bool has_position_at_end = true;  ///< false: it was not read
  /// ≥ 0: the displacement may differ from that between the readings by this, beyond what q
  /// explains, in the port's unit; for a torque on a body that turns (turn.h). 0 for joints.
  PortValues doubt{};
};

/// One control step at t_k.
struct PortInput {
  PortValues position{};  ///< x(k), measured
  /// What acted since the previous step, in time order, ending at x(k). Empty in the first step.
  std::span<const PortStretch> applied;
  bool has_gap = false;                ///< it is not known what acted since the previous step
  PortValues acting_effort_on_hand{};  ///< acts at t_k, until it is replaced
  /// ≥ 0: it ends by itself after this time at the latest; infinite where that is not known.
  double acting_lease_s = std::numeric_limits<double>::infinity();
  /// The device itself covers commands by no more than this energy at t_k; infinite: by any.
  double energy_limit_joule = std::numeric_limits<double>::infinity();
  PortValues requested_effort_on_hand{};  ///< F_e(k); one not plausible counts as none at all
  /// F_e(k) was evaluated since the previous step; false: it is held.
  bool is_request_fresh = true;
  /// Elastic energy in the environment that it may give back to the hand; 0 where unknown.
  double stored_energy_joule = 0.0;
};

/// What the clamp answers.
struct PortOutput {
  PortValues effort_on_hand{};  ///< F(k): per port between 0 and what is requested
  /// Per port the largest effort that all of the credit would cover there, with none on the others.
  PortValues most_effort{};
  double ledger_energy_joule = 0.0;   ///< E′; not more than the input's energy_limit_joule
  double counted_energy_joule = 0.0;  ///< a lower bound of what the hand has put in
  double lease_s = 0.0;               ///< longest time for which F may act
  double begins_within_s = 0.0;       ///< longest time from the reading until F begins to act
  bool is_clamped = false;            ///< F differs from the requested F_e
  bool is_too_fast = false;           ///< the hand moved faster than v_max on some port
};

}  // namespace palpate::controllers
