// SPDX-License-Identifier: Apache-2.0
// held_tissue.h — the force of the tissue in the jaws of the tool, around a needle or a blade, at
// the device's rate.
#pragma once

#include <cstdint>
#include <optional>

#include "common/contact/contact_model.h"
#include "common/contact/elastic/grip.h"
#include "common/core/messages.h"

namespace palpate::mofc {

/// Evaluates the Grip that hop 3 lists: F = f₀ + K (a − a_ref) + B v at a = tool − slip. The slip
/// is kept here, and reported on hop 2: the tool slips where F is more than the jaws hold
/// (slip_in_jaws), loses the tissue where F tears it or it has slipped out, and lets go in the tick
/// in which the button is released. What was lost is not held again until the jaws close anew,
/// whatever hop 3 still says. So delay and loss of messages change the force as little as the
/// stiffness changes meanwhile.
///
/// A needle or a blade has no button: physics_node decides when it goes in. It slips along itself
/// (slip_of_needle) until it is out. The forces at which it yields follow those of hop 3 by at most
/// newton_per_s · dt per step, all together: so much does the force change with them.
///
/// F begins at zero, and where a new message has another law the force passes to it with a time
/// constant of 10 ms, by at most newton_per_s · dt per step; where it ends, it ends at once. No
/// allocation, no throw.
class HeldTissue {
 public:
  /// As GripState of the record.
  enum class State : std::uint8_t {
    kNone,
    kHolds,
    kSlips,
    kTorn,
    kSlipped,
    kPierced,
    kPierces,
    kCuts
  };

  /// @param newton_per_s  > 0
  explicit HeldTissue(double newton_per_s) : newton_per_s_(newton_per_s) {}

  /// The force starts again from zero.
  void reset() noexcept;

  /// @param buttons  that are held now   @param dt_s  ≥ 0, since the step before
  [[nodiscard]] ModelForce step(const Interaction& newest, std::uint32_t buttons,
                                const Vector3& tool_position_world_m,
                                const ToolVelocity& tool_velocity_world, double dt_s) noexcept;

  /// The jaws are around this tissue, as hop 3 says; whatever else is known of it does not count.
  [[nodiscard]] bool is_about(std::uint32_t tissue) const noexcept {
    return is_listed_ && tissue == tissue_;
  }
  [[nodiscard]] State state() const noexcept { return state_; }
  /// For hop 2; none: hop 3 lists no grip.
  [[nodiscard]] const std::optional<GripReport>& report() const noexcept { return report_; }

 private:
  struct Law {
    Vector3 place_m = Vector3::Zero();  // where it has this force
    Vector3 force_newton = Vector3::Zero();
    Matrix3 stiffness_newton_per_m = Matrix3::Identity();
    Matrix3 damping_newton_s_per_m = Matrix3::Zero();
    double stored_joule = 0.0;  // there

    [[nodiscard]] Vector3 at(const Vector3& place, const Vector3& velocity) const noexcept {
      return force_newton - stiffness_newton_per_m * (place - place_m) -
             damping_newton_s_per_m * velocity;
    }
    [[nodiscard]] double stored_joule_at(const Vector3& place) const noexcept {
      return stored_joule_after(place - place_m, stored_joule, force_newton,
                                stiffness_newton_per_m);
    }
  };
  void take(const Contact& contact, const Interaction& newest, const Vector3& at_m,
            const Vector3& velocity) noexcept;
  void follow_yields(NeedleLaw& needle, double most_newton) noexcept;
  void lose(State why) noexcept;

  double newton_per_s_;
  State state_ = State::kNone;
  bool is_listed_ = false;
  bool is_held_ = false;
  std::uint32_t tissue_ = 0;
  std::uint32_t buttons_ = 0;         // that close the jaws
  std::optional<GripReport> report_;  // of the grip that is listed
  double deepest_m_ = 0.0;            // of a hole or a cut
  /// Of a needle or a blade: forces that cut, spread, and of friction; they follow hop 3.
  Vector3 yields_newton_ = Vector3::Zero();
  Law law_;
  Vector3 offset_newton_ = Vector3::Zero();  // of the force from the law, still to be undone
};

}  // namespace palpate::mofc
