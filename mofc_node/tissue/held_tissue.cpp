// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/tissue/held_tissue.h"

#include <algorithm>
#include <cmath>

namespace palpate::mofc {
namespace {

// Of the passage from one law to the next: half a period of the full solutions, so that their
// steps are not felt.
constexpr double kPassage_s = 0.01;

}  // namespace

void HeldTissue::reset() noexcept {
  is_held_ = is_listed_ = false;
  if (state_ != State::kTorn && state_ != State::kSlipped) state_ = State::kNone;
}

void HeldTissue::lose(State why) noexcept {
  state_ = why;
  is_held_ = false;
  if (report_) report_->has_let_go = true;
}

/// The law of the newest message; the force goes on where it is.
void HeldTissue::take(const Contact& contact, const Interaction& newest, const Vector3& at_m,
                      const Vector3& velocity) noexcept {
  const Law law{.place_m = newest.tool_position_world_m - contact.grip.slip_m,
                .force_newton = contact.elastic_force_on_tool_newton,
                .stiffness_newton_per_m = -contact.d_force_d_position,
                .damping_newton_s_per_m = -contact.d_force_d_velocity,
                .stored_joule = contact.stored_energy_joule};
  const Vector3 before =
      is_held_ ? Vector3(law_.at(at_m, velocity) + offset_newton_) : Vector3::Zero();
  offset_newton_ = before - law.at(at_m, velocity);
  law_ = law;
  is_held_ = true;
}

/// Where the tissue has been held before, towards those of the message; else at once.
void HeldTissue::follow_yields(NeedleLaw& needle, double most_newton) noexcept {
  const Vector3 said(needle.cutting_newton, needle.spreading_newton, needle.friction_newton);
  const Vector3 change = said - yields_newton_;
  const double newton = change.lpNorm<1>();
  if (!is_held_ || newton <= most_newton) {
    yields_newton_ = said;
  } else {
    yields_newton_ += most_newton / newton * change;
  }
  needle.cutting_newton = yields_newton_.x();
  needle.spreading_newton = yields_newton_.y();
  needle.friction_newton = yields_newton_.z();
}

ModelForce HeldTissue::step(const Interaction& newest, std::uint32_t buttons,
                            const Vector3& tool_position_world_m,
                            const ToolVelocity& tool_velocity_world, double dt_s) noexcept {
  const Contact* const end = newest.contacts.data() + newest.listed_count;
  const Contact* const contact = std::find_if(
      newest.contacts.data(), end, [](const Contact& one) { return one.grip.number != 0; });
  is_listed_ = contact != end;
  if (!is_listed_) {
    // physics_node tore it, or is another one
    if (is_held_ && report_->physics_session_id == newest.header.session_id && buttons_ != 0) {
      lose(State::kTorn);
    }
    if (is_held_ || (buttons & buttons_) != buttons_) state_ = State::kNone;
    is_held_ = false;
    report_.reset();
    return {};
  }
  Grip grip = contact->grip;
  if (!report_ || report_->physics_session_id != newest.header.session_id ||
      report_->number != grip.number) {
    report_ = {.physics_session_id = newest.header.session_id,
               .number = grip.number,
               .slip_m = grip.slip_m};
    is_held_ = false;
    state_ = State::kNone;
    deepest_m_ = 0.0;
  }
  tissue_ = contact->tissue;
  buttons_ = grip.buttons;
  if ((buttons & buttons_) != buttons_) lose(State::kNone);
  if (report_->has_let_go) return {};

  const Vector3 at_m = tool_position_world_m - report_->slip_m;
  follow_yields(grip.needle, newton_per_s_ * dt_s);
  take(*contact, newest, at_m, tool_velocity_world.tip_m_per_s);
  const double offset = std::max(offset_newton_.norm(), 1e-12);
  offset_newton_ *= 1.0 - std::min({1.0, dt_s / kPassage_s, newton_per_s_ * dt_s / offset});
  const Vector3 wanted = law_.at(at_m, tool_velocity_world.tip_m_per_s) + offset_newton_;
  const bool is_needle = grip.needle.is_there();
  grip.needle.deepest_m = std::max(grip.needle.deepest_m, deepest_m_);
  Matrix3 stiffness = law_.stiffness_newton_per_m;
  // a needle slips all the time: what it slips, the tissue does not move
  if (is_needle) stiffness += law_.damping_newton_s_per_m / std::max(kLeastStep_s, dt_s);
  const GripSlip slip = slip_of(grip, report_->slip_m, wanted, stiffness);
  const Vector3& newton = slip.force_on_tool_newton;
  report_->slip_m += slip.slip_m;
  deepest_m_ = grip.needle.deepest_m;
  const bool is_still = slip.slip_m.isZero(0.0);
  const State moving = grip.needle.is_blade() ? State::kCuts
                       : is_needle            ? State::kPierces
                                              : State::kSlips;
  const State still = is_needle ? State::kPierced : State::kHolds;
  state_ = is_still ? still : moving;
  if (newton.norm() > grip.tear_newton) lose(State::kTorn);
  if (slip.is_out) lose(State::kNone);
  if (!(report_->slip_m.norm() <= grip.reach_m)) lose(State::kSlipped);
  const double joule = law_.stored_joule_at(tool_position_world_m - report_->slip_m);
  if (!is_held_ || !newton.allFinite() || !std::isfinite(joule)) return {};
  return {.force_on_tool_newton = newton, .stored_energy_joule = joule, .is_touching = true};
}

}  // namespace palpate::mofc
