// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic_tissue/jaw.h"

#include <Eigen/LU>
#include <algorithm>
#include <stdexcept>

#include "common/contact/elastic/grip.h"

namespace palpate::physics {
namespace {

constexpr double kHeldPenetration_m = 1.0;  // a contact that the tool does not leave
constexpr double kHeldTrust_m = 1.0;
// What a slower tool feels change is creep, not stiffness.
constexpr double kStill_m_per_s = 2e-3;

}  // namespace

Contact grip_contact(const GripModel& model, const GripperConfig& gripper, std::uint32_t tissue,
                     const Vector3& at_m, const Vector3& v_m_per_s,
                     const Vector3& slip_m) noexcept {
  const Matrix3& K = model.stiffness_newton_per_m;
  Contact contact{.tissue = tissue,
                  .penetration_m = kHeldPenetration_m,
                  .elastic_force_on_tool_newton = model.force_at(at_m, Vector3::Zero()),
                  .d_force_d_position = -K,
                  .d_force_d_velocity = -model.relaxation_s * K,
                  .is_adhesive = true,
                  .trust_radius_m = kHeldTrust_m,
                  .grip = {.number = model.number,
                           .buttons = 1U << gripper.button,
                           .slip_newton = gripper.slip_newton(),
                           .tear_newton = gripper.tear_newton,
                           .reach_m = gripper.reach_m,
                           .slip_m = slip_m}};
  contact.force_on_tool_newton = model.force_at(at_m, v_m_per_s);
  const Vector3 way_m = at_m - model.place_m;
  contact.stored_energy_joule =
      std::max(0.0, model.stored_energy_joule - way_m.dot(model.elastic_force_on_tool_newton) +
                        0.5 * way_m.dot(K * way_m));
  return contact;
}

void Jaw::let_go(ElasticSimulation& simulation, std::size_t tool) {
  simulation.let_go(tool);
  model_ = {.number = model_.number};
  ++changes_;
}

void Jaw::prepare(ElasticSimulation& simulation, std::size_t tool, const GripperConfig& gripper,
                  const JawCommand& command, const std::optional<TipState>& tip) {
  const bool is_this = command.is_closed && command.number == model_.number && tip.has_value();
  if (model_.is_holding() && !is_this) let_go(simulation, tool);
  if (!command.is_closed || command.number == model_.number) return;
  model_ = {.number = command.number};
  if (!tip) return;
  model_.place_m = tip->tip_m - tip->slip_m;
  const std::size_t points = simulation.hold(tool, tip->tip_m - tip->slip_m, gripper.reach_m,
                                             gripper.most_points, gripper.stiffness_newton_per_m);
  model_.points = static_cast<std::uint32_t>(points);
  changes_ += points > 0 ? 1U : 0U;
}

void Jaw::read(ElasticSimulation& simulation, std::size_t tool,
               elastic::SurfaceCompliance& compliance, double step_s, std::uint64_t changes,
               bool is_alone) {
  if (!model_.is_holding()) return;
  const elastic::HeldPoints& held = simulation.held()[tool];
  const Vector3 newton = simulation.touch(tool).force_on_tool_newton;
  Matrix3& K = model_.stiffness_newton_per_m;
  const double beta_s = simulation.body().viscosity_s;
  const Vector3 velocity = (held.place_m() - model_.place_m) / step_s;
  const Vector3 at_m = held.place_m() + beta_s * velocity;
  bool is_seen = true;
  if (known_ != changes) {
    try {
      K = elastic::grip_stiffness_newton_per_m(compliance, held, simulation.held());
    } catch (const std::runtime_error&) {
      let_go(simulation, tool);
      throw;
    }
    known_ = changes;
  } else if (is_alone && velocity.norm() > kStill_m_per_s &&
             (at_m - seen_m_).norm() > elastic::kShortestWay_m) {
    K = elastic::updated_stiffness(K, at_m - seen_m_, seen_newton_ - newton);
  } else {
    is_seen = !is_alone || velocity.norm() <= kStill_m_per_s;
  }
  if (is_seen) {
    seen_m_ = at_m;
    seen_newton_ = newton;
  }
  model_.place_m = held.place_m();
  model_.velocity_m_per_s = velocity;
  model_.relaxation_s = beta_s;
  Vector3& elastic_newton = model_.elastic_force_on_tool_newton;
  elastic_newton = newton + beta_s * K * velocity;
  model_.stored_energy_joule = 0.5 * elastic_newton.dot(K.inverse() * elastic_newton);
  if (!newton.allFinite() || !K.allFinite()) let_go(simulation, tool);
}

void SlippingJaw::set(std::uint32_t closing) noexcept {
  is_closed_ = closing != 0;
  if (!is_closed_ || closing == number_) return;
  number_ = closing;
  is_lost_ = false;
  slip_m_.setZero();
}

Vector3 SlippingJaw::act(const GripModel& model, const GripperConfig& gripper, const Vector3& tip_m,
                         const Vector3& v_m_per_s, double viscous_ratio) noexcept {
  if (!holds(model)) return Vector3::Zero();
  const GripSlip slip =
      slip_in_jaws(model.force_at(tip_m - slip_m_, v_m_per_s),
                   (1.0 + viscous_ratio) * model.stiffness_newton_per_m, gripper.slip_newton());
  slip_m_ += slip.slip_m;
  is_lost_ = slip.force_on_tool_newton.norm() > gripper.tear_newton ||
             !(slip_m_.norm() <= gripper.reach_m);
  return is_lost_ ? Vector3::Zero() : slip.force_on_tool_newton;
}

void SlippingJaw::follow(const Vector3& slip_m, bool has_let_go) noexcept {
  slip_m_ = slip_m;
  is_lost_ = is_lost_ || has_let_go;
}

JawCommand SlippingJaw::command() const noexcept {
  return {.number = number_,
          .is_closed = is_closed_ && !is_lost_,
          .slip_x_m = slip_m_.x(),
          .slip_y_m = slip_m_.y(),
          .slip_z_m = slip_m_.z()};
}

}  // namespace palpate::physics
