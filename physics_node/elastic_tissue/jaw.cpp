// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic_tissue/jaw.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "common/contact/elastic/grip.h"

namespace palpate::physics {
namespace {

constexpr double kHeldPenetration_m = 1.0;  // a contact that the tool does not leave
constexpr double kHeldTrust_m = 1.0;
constexpr double kLongestNeedle_m = 1.0;
constexpr double kAcross_s = 0.02;  // time constant with which tissue slides onto a needle
// What a slower tool feels change is creep, not stiffness.
constexpr double kStill_m_per_s = 2e-3;
// Of what was dissipated in the steps before, in a step.
constexpr double kRemembered = 0.8;
constexpr double kLongestRelaxation = 50.0;  // of the viscosity of the body

}  // namespace

Grip grip_of(const GripperConfig& gripper, std::uint32_t number, const Vector3& slip_m,
             const NeedleLaw& needle) noexcept {
  const bool is_needle = needle.is_there();
  return {.number = number,
          .buttons = is_needle ? 0U : 1U << gripper.button,
          .slip_newton = is_needle ? kMaxTissueForceNewton : gripper.slip_newton(),
          .tear_newton = is_needle ? kMaxTissueForceNewton : gripper.tear_newton,
          .reach_m = is_needle ? kLongestNeedle_m : gripper.reach_m,
          .slip_m = slip_m,
          .needle = needle};
}

Contact grip_contact(const GripModel& model, const GripperConfig& gripper, std::uint32_t tissue,
                     const Vector3& at_m, const Vector3& v_m_per_s, const Vector3& slip_m,
                     const Vector3& by_others_newton, const NeedleLaw& needle) noexcept {
  const Matrix3& K = model.stiffness_newton_per_m;
  Contact contact{
      .tissue = tissue,
      .penetration_m = kHeldPenetration_m,
      .elastic_force_on_tool_newton = model.force_at(at_m, Vector3::Zero(), by_others_newton),
      .d_force_d_position = -K,
      .d_force_d_velocity = -model.relaxation_s * K,
      .is_adhesive = true,
      .trust_radius_m = kHeldTrust_m,
      .grip = grip_of(gripper, model.number, slip_m, needle)};
  contact.force_on_tool_newton = model.force_at(at_m, v_m_per_s, by_others_newton);
  contact.stored_energy_joule =
      stored_joule_after(at_m - model.place_m, model.stored_energy_joule,
                         model.elastic_force_on_tool_newton + by_others_newton, K);
  return contact;
}

std::vector<std::size_t> points_in_reach(const ElasticBody& body, const GripperConfig& gripper,
                                         double tip_radius_m) {
  constexpr std::size_t kPlaces = 2000;
  const std::vector<std::array<std::uint32_t, 3>> triangles = triangles_of(body);
  const auto node = [&](std::uint32_t i) -> Vector3 { return body.start_m.segment<3>(3 * i); };
  std::vector<std::size_t> counts;
  for (std::size_t i = 0; i < triangles.size(); i += 1 + triangles.size() / kPlaces) {
    const auto& [a, b, c] = triangles[i];
    const Vector3 normal = (node(b) - node(a)).cross(node(c) - node(a)).normalized();
    elastic::HeldPoints held;
    held.take(body.points, body.start_m.data(),
              (node(a) + node(b) + node(c)) / 3.0 + tip_radius_m * normal, gripper.reach_m,
              gripper.most_points, gripper.stiffness_newton_per_m);
    counts.push_back(held.size());
  }
  std::sort(counts.begin(), counts.end());
  return counts;
}

void Jaw::let_go(ElasticSimulation& simulation, std::size_t tool) {
  simulation.let_go(tool);
  model_ = {.number = model_.number};
  ++changes_;
}

void Jaw::prepare(ElasticSimulation& simulation, std::size_t tool,
                  elastic::SurfaceCompliance& compliance, const GripperConfig& gripper,
                  const JawCommand& command, const std::optional<TipState>& tip) {
  const bool is_this = command.is_closed && command.number == model_.number && tip.has_value();
  if (model_.is_holding() && !is_this) let_go(simulation, tool);
  if (model_.is_holding() && gripper.is_blade()) follow_slip(simulation, tool, command, *tip);
  if (model_.is_holding() && !across_m_.isZero(0.0)) {
    const Vector3 by_m = across_m_ * simulation.step_s() / (simulation.step_s() + kAcross_s);
    simulation.shift(tool, by_m);
    across_m_ -= by_m;
  }
  if (!command.is_closed || command.number == model_.number) return;
  across_m_.setZero();
  model_ = {.number = command.number};
  if (!tip) return;
  model_.place_m = tip->tip_m - tip->slip_m;
  if (gripper.is_blade()) {
    try {
      begin_blade(simulation, tool, compliance, gripper, command, *tip);
    } catch (const std::runtime_error&) {  // without a compliance nothing can be held
      let_go(simulation, tool);
    }
  } else {
    hold_around(simulation, tool, gripper, command, *tip);
  }
  changes_ += model_.points > 0 ? 1U : 0U;
  closed_joule_ = simulation.stored_joule();
  lost_joule_ = expected_joule_ = 0.0;
}

/// The points around the tip.
void Jaw::hold_around(ElasticSimulation& simulation, std::size_t tool, const GripperConfig& gripper,
                      const JawCommand& command, const TipState& tip) {
  const std::size_t points =
      simulation.hold(tool, tip.tip_m - tip.slip_m, gripper.reach_m, gripper.most_points,
                      gripper.stiffness_newton_per_m, gripper.is_needle());
  model_.points = static_cast<std::uint32_t>(points);
  if (gripper.is_needle() && points > 0) {
    const Vector3 way_m = tip.tip_m - tip.place_m - simulation.moved_m(tool);
    const double deeper_m = way_m.dot(command.inward());
    model_.start_m = std::max(0.0, deeper_m);
    // across it goes in where it would touch the untouched surface, in the next solutions
    across_m_ = way_m - deeper_m * command.inward();
  }
}

void Jaw::change_body(ElasticSimulation& simulation, std::size_t tool,
                      elastic::SurfaceCompliance& compliance, const GripperConfig* gripper) {
  if (!model_.is_holding()) return;
  if (gripper != nullptr && gripper->is_blade()) {
    try {
      move_beside(simulation, tool, compliance, *gripper);
    } catch (const std::runtime_error&) {  // without a compliance nothing can be held
      return let_go(simulation, tool);
    }
  }
  model_.points = static_cast<std::uint32_t>(simulation.held()[tool].size());
  ++changes_;
  is_body_new_ = true;
}

/// The work of the tool in a step, less what the body has stored: K at rest does not know how fast
/// tissue is stretched that is stretched far already.
void Jaw::watch_losses(const Seen& now, double beta_s, double step_s) {
  const Vector3& v = now.velocity_m_per_s;
  const Vector3 newton = 0.5 * (last_.force_on_tool_newton + now.force_on_tool_newton);
  const double lost_joule = -newton.dot(now.place_m - last_.place_m) -
                            (now.stored_joule - last_.stored_joule) -
                            (now.kinetic_joule - last_.kinetic_joule);
  lost_joule_ = kRemembered * lost_joule_ + lost_joule;
  expected_joule_ =
      kRemembered * expected_joule_ + beta_s * step_s * v.dot(model_.stiffness_newton_per_m * v);
  if (!(expected_joule_ > 0.0)) return;
  model_.relaxation_s = beta_s * std::clamp(lost_joule_ / expected_joule_, 1.0, kLongestRelaxation);
}

Jaw::Measured Jaw::measure(const ElasticSimulation& simulation, const Seen& now,
                           double step_s) const {
  Vector3 by_others_newton = Vector3::Zero();
  for (const GripModel::Other& other : model_.others) {
    const Vector3& at_m = simulation.held()[other.tool].place_m();
    by_others_newton +=
        other.pull_newton(at_m, (at_m - other.place_m) / step_s, model_.relaxation_s);
  }
  const Vector3 expected = model_.force_at(now.place_m, now.velocity_m_per_s, by_others_newton);
  return {.error_newton = (expected - now.force_on_tool_newton).norm(),
          .way_m = (now.place_m - model_.place_m).norm()};
}

void Jaw::read(ElasticSimulation& simulation, std::size_t tool,
               elastic::SurfaceCompliance& compliance, double step_s, std::uint64_t changes,
               bool is_alone) {
  measured_.reset();
  if (!model_.is_holding()) return;
  const elastic::HeldPoints& held = simulation.held()[tool];
  Matrix3& K = model_.stiffness_newton_per_m;
  const double beta_s = simulation.body().viscosity_s;
  const Seen now{.place_m = held.place_m(),
                 .velocity_m_per_s = (held.place_m() - model_.place_m) / step_s,
                 .force_on_tool_newton = simulation.touch(tool).force_on_tool_newton,
                 .stored_joule = simulation.stored_joule(),
                 .kinetic_joule = simulation.report().kinetic_joule};
  // what has vanished took its energy and its weight with it
  if (std::exchange(is_body_new_, false)) {
    closed_joule_ = now.stored_joule - model_.stored_energy_joule;
  }
  if (is_blade()) keep_books(now, step_s, is_alone);
  const bool is_still = now.velocity_m_per_s.norm() <= kStill_m_per_s;
  // a next body that comes to rest changes the force, too
  const bool is_changing = is_blade() && is_coming_to_rest();
  bool is_explained = !is_alone || is_still || is_changing;
  if (known_ == changes) measured_ = measure(simulation, now, step_s);
  model_.others.clear();
  if (known_ != changes) {
    try {
      stiffness_with_ = elastic::grip_stiffness_newton_per_m(compliance, simulation.held(), tool);
    } catch (const std::runtime_error&) {
      let_go(simulation, tool);
      throw;
    }
    K = stiffness_with_[tool];
    known_ = changes;
    model_.relaxation_s = beta_s;
    is_explained = true;
  } else if (is_alone && !is_still && !is_changing) {
    watch_losses(now, beta_s, step_s);
    const Vector3 way_m = now.way_m(explained_, model_.relaxation_s);
    if (way_m.norm() > elastic::kShortestWay_m) {
      const Matrix3 updated = elastic::updated_stiffness(
          K, way_m, explained_.force_on_tool_newton - now.force_on_tool_newton);
      if (!is_blade() || is_like_at_rest(updated, stiffness_with_[tool])) K = updated;
      is_explained = true;
    }
  }
  if (is_explained) explained_ = now;
  last_ = now;
  model_.place_m = now.place_m;
  model_.velocity_m_per_s = now.velocity_m_per_s;
  model_.elastic_force_on_tool_newton =
      now.force_on_tool_newton + model_.relaxation_s * K * now.velocity_m_per_s;
  model_.stored_energy_joule = std::max(0.0, now.stored_joule - closed_joule_);
  if (!now.force_on_tool_newton.allFinite() || !K.allFinite()) let_go(simulation, tool);
}

void Jaw::note_other(std::size_t tool, const GripModel& other) {
  if (!model_.is_holding() || !other.is_holding()) return;
  model_.others.push_back({.tool = tool,
                           .number = other.number,
                           .stiffness_newton_per_m = stiffness_with_[tool],
                           .place_m = other.place_m,
                           .velocity_m_per_s = other.velocity_m_per_s});
}

void SlippingJaw::set(std::uint32_t closing) noexcept {
  is_closed_ = closing != 0;
  if (!is_closed_ || closing == number_) return;
  number_ = closing;
  is_lost_ = false;
  slip_m_.setZero();
  paid_joule_ = 0.0;
  is_felt_ = false;
}

Vector3 SlippingJaw::act(const GripModel& model, const GripperConfig& gripper, const Vector3& tip_m,
                         const Vector3& v_m_per_s, double viscous_ratio,
                         const Vector3& by_others_newton) noexcept {
  if (!holds(model)) return Vector3::Zero();
  Grip grip = grip_of(gripper, number_, slip_m_, needle_);
  const GripSlip slip =
      slip_of(grip, slip_m_, model.force_at(tip_m - slip_since_m(), v_m_per_s, by_others_newton),
              (1.0 + viscous_ratio) * model.stiffness_newton_per_m);
  needle_ = grip.needle;
  slip_m_ += slip.slip_m;
  is_lost_ = slip.is_out || slip.force_on_tool_newton.norm() > grip.tear_newton ||
             !(slip_m_.norm() <= grip.reach_m);
  return is_lost_ ? Vector3::Zero() : slip.force_on_tool_newton;
}

void SlippingJaw::follow(const Vector3& slip_m, bool has_let_go) noexcept {
  slip_m_ = slip_m;
  is_lost_ = is_lost_ || has_let_go;
  if (needle_.is_there()) needle_.deepest_m = std::max(needle_.deepest_m, depth_m());
}

void SlippingJaw::note_work(const Vector3& force_on_tool_newton, const Vector3& tip_m,
                            bool is_felt) noexcept {
  if (is_felt && is_felt_) {
    paid_joule_ -= 0.5 * (force_on_tool_newton + felt_newton_).dot(tip_m - felt_at_m_);
  }
  is_felt_ = is_felt;
  felt_newton_ = force_on_tool_newton;
  felt_at_m_ = tip_m;
}

Vector3 SlippingJaw::yielding_newton(const Vector3& force_on_tool_newton) const noexcept {
  const Vector3& d = needle_.inward_world;
  const double most_newton =
      needle_.cutting_newton + needle_.spreading_newton + needle_.friction_newton;
  return force_on_tool_newton + std::max(0.0, -force_on_tool_newton.dot(d) - most_newton) * d;
}

JawCommand SlippingJaw::command() const noexcept {
  const Vector3 slip = slip_since_m();
  return {.number = number_,
          .is_closed = is_closed_ && !is_lost_,
          .inward_x = needle_.inward_world.x(),
          .inward_y = needle_.inward_world.y(),
          .inward_z = needle_.inward_world.z(),
          .edge_x = needle_.edge_world.x(),
          .edge_y = needle_.edge_world.y(),
          .edge_z = needle_.edge_world.z(),
          .deepest_m = needle_.deepest_m,
          .paid_joule = paid_joule_,
          .is_felt = is_felt_,
          .slip_x_m = slip.x(),
          .slip_y_m = slip.y(),
          .slip_z_m = slip.z()};
}

}  // namespace palpate::physics
