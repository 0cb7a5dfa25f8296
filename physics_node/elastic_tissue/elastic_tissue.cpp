// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic_tissue/elastic_tissue.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "common/contact/elastic/grip.h"
#include "physics_node/elastic_tissue/elastic_contact.h"

namespace palpate::physics {
namespace {

constexpr int kMostPoints = elastic::CondensedContact::kMostPoints;
constexpr double kPointsWithin = 1.15;  // of the tip's centre, in radii
constexpr int kMostSweeps = 40;
constexpr double kSweepTolerance_m = 1e-7;
// A new full solution is behind the tip, and a fast tip is ahead of its last place: it is followed
// in this many steps, each of at most this share of the radius while that is enough. A new one then
// makes so many steps of the tool's length.
constexpr std::size_t kSettlingSteps = 3;
constexpr int kLeastCatchUpSteps = 2;
constexpr int kMostCatchUpSteps = 8;
constexpr double kStepRadii = 0.25;
// The points of a condensed contact cover about so much to each side of the place where they were
// chosen, in radii of the tip.
constexpr double kPatchRadii = 1.0;
// They are chosen where the tip will be while they are used, after so many steps of the solution.
constexpr double kAhead = 1.5;
constexpr double kMostInwardRadii = 0.5;
// A solution is that of where the tip will be when it is used, as far as this.
constexpr double kMostAheadRadii = 0.5;
// Another one is due before the period is over when a tip has moved so far.
constexpr double kFastRadii = 1.0 / 12.0;
// So many follow as fast as they can after a tip was so fast that it moved as far in the shortest
// step: what it left dies down.
constexpr int kHastySolves = 4;
// The compliance is that between the last two solutions if their forces differ by more than this
// and most of the way between them was along the normal.
constexpr double kOtherForce = 0.05;
constexpr double kAlongNormal = 0.7;
// The velocity of a tip is that over at least so long, and unknown where it was not seen for
// longer.
constexpr double kShortestVelocity_s = 3.9e-3;
constexpr double kLongestVelocity_s = 25e-3;

/// Of the law, where nothing is known but the material.
double stiffness_untouched(const ElasticBody& body) {
  return elastic_stiffness(body.hertz_newton / body.prompt_ratio, kHertzDepth_m);
}

}  // namespace

ElasticTissue::ElasticTissue(std::shared_ptr<BodyCompliance> shared, std::size_t tools,
                             double tip_radius_m, bool is_folded,
                             const std::optional<GripperConfig>& gripper,
                             const std::optional<ElectrodeConfig>& electrode, bool is_in_background)
    : whole_(shared->body()),
      shared_(std::move(shared)),
      body_(whole_),
      tip_radius_m_(tip_radius_m),
      is_folded_(is_folded),
      gripper_(gripper),
      simulation_(std::make_unique<ElasticSimulation>(*body_, tools, tip_radius_m,
                                                      1.0 / body_->solve_rate_hz, is_folded)),
      makers_(tools),
      tips_(tools) {
  for (std::size_t i = 0; i < tools; ++i) {
    tools_.push_back(std::make_unique<Tool>());
    tools_.back()->stiffness_newton_per_m = stiffness_untouched(*body_);
    tools_.back()->surface_of = whole_.get();
  }
  if (electrode || whole_->can_tear() || can_be_cut()) {
    ablation_ = std::make_unique<Ablation>(shared_, electrode, tip_radius_m, tools,
                                           is_in_background, can_be_cut());
  }
  if (is_folded_) fold();
}

ElasticTissue::Columns ElasticTissue::columns() const noexcept {
  return {.all = compliance().all_columns().size(), .computed = compliance().columns_made()};
}

// --- the steps of a tool -------------------------------------------------------------------------

void ElasticTissue::note(std::size_t tool, const Vector3& tip_m, double reach_m, double time_s,
                         bool is_energised) noexcept {
  Tool& own = *tools_[tool];
  if (ablation_) follow_body(own);
  if (is_energised && own.side.is_known()) own.energised_s += std::max(0.0, time_s - own.time_s);
  own.tip_m = tip_m;
  own.step_s = time_s - own.time_s;
  own.time_s = time_s;
  own.last_passed = (own.last_passed + 1) % own.passed.size();
  own.passed[own.last_passed] = {.tip_m = tip_m, .time_s = time_s};
  own.reach_m = reach_m;
  if (whole_->can_be_carried()) {
    noted_s_.store(time_s, std::memory_order_relaxed);
    const Prepared* const prepared = own.prepared.newest();
    if (prepared != nullptr) own.carried_m = prepared->carried.at_m(time_s);
  }
  const bool is_near = own.side.follow(own.surface_of->shape, own.surface_of->bounds, tip_radius_m_,
                                       reach_m, tip_m - own.carried_m, time_s) &&
                       !is_leaving(own);
  if (!is_near) own.rubbing = {};
  if (!is_near && !own.is_holding) return own.tip.store({});
  // what the jaws hold comes along, however far
  const SurfaceView view =
      is_near ? own.side.view() : SurfaceView{.distance_m = tip_radius_m_ + reach_m};
  const Vector3 place_m = is_near ? own.side.place_m() + own.carried_m : tip_m;
  const Vector3& friction = own.rubbing.force_on_tool_newton();
  const Vector3 velocity = own.recent_velocity_m_per_s();
  own.tip.store({.x_m = tip_m.x(),
                 .y_m = tip_m.y(),
                 .z_m = tip_m.z(),
                 .place_x_m = place_m.x(),
                 .place_y_m = place_m.y(),
                 .place_z_m = place_m.z(),
                 .normal_x = view.normal.x(),
                 .normal_y = view.normal.y(),
                 .normal_z = view.normal.z(),
                 .distance_m = view.distance_m,
                 .friction_x_newton = friction.x(),
                 .friction_y_newton = friction.y(),
                 .friction_z_newton = friction.z(),
                 .x_m_per_s = velocity.x(),
                 .y_m_per_s = velocity.y(),
                 .z_m_per_s = velocity.z(),
                 .time_s = time_s,
                 .energised_s = own.energised_s,
                 .is_known = true});
}

/// Over a few of the last steps, of which a device's position may be coarse.
Vector3 ElasticTissue::Tool::recent_velocity_m_per_s() const noexcept {
  const Passed& now = passed[last_passed];
  for (std::size_t i = 1; i < passed.size(); ++i) {
    const Passed& then = passed[(last_passed + passed.size() - i) % passed.size()];
    const double since_s = now.time_s - then.time_s;
    if (!(since_s >= 0.0) || since_s > kLongestVelocity_s) break;
    if (since_s >= kShortestVelocity_s) return (now.tip_m - then.tip_m) / since_s;
  }
  return Vector3::Zero();
}

/// The force of the condensed contact on the tip, which follows its way since the last call, or
/// since the full solution that is new.
Vector3 ElasticTissue::press(Tool& own, Prepared& prepared) const noexcept {
  const bool is_new = std::exchange(own.stepped, &prepared) != &prepared;
  const Vector3 from_m = is_new ? prepared.centre_m : own.stepped_m;
  // one that looks ahead is never later than the last step
  const double from_s = is_new ? std::min(prepared.time_s, own.time_s - own.step_s) : own.stepped_s;
  // as the sphere would be if nothing had carried the surface since the solution
  const auto there_m = [&](const Vector3& tip_m, double at_s) {
    return prepared.reachable_m(tip_m - prepared.carried.since_m(at_s));
  };
  const Vector3 tip_m = there_m(own.tip_m, own.time_s);
  const double parts = (tip_m - from_m).norm() / (kStepRadii * tip_radius_m_);
  const int least = is_new ? kLeastCatchUpSteps : 1;
  const int steps = parts < kMostCatchUpSteps ? std::max(least, static_cast<int>(std::ceil(parts)))
                                              : kMostCatchUpSteps;
  // the first of the last places that is later, or the present one
  std::size_t later = own.last_passed;
  const auto before = [&](std::size_t i) {
    return (i + own.passed.size() - 1) % own.passed.size();
  };
  for (std::size_t i = 1; i < own.passed.size() && own.passed[before(later)].time_s > from_s &&
                          own.passed[before(later)].time_s < own.passed[later].time_s;
       ++i) {
    later = before(later);
  }
  Vector3 force = Vector3::Zero();
  Vector3 earlier_m = from_m;
  double earlier_s = from_s;
  double here_s = from_s;
  const auto go = [&](double to_s, int in_steps) {
    const double step_s = std::max(kLeastStep_s, (to_s - here_s) / in_steps);
    for (int i = 1; i <= in_steps; ++i) {
      const double at_s = i == in_steps ? to_s : here_s + i * step_s;
      while (own.passed[later].time_s < at_s && later != own.last_passed) {
        earlier_m = own.passed[later].tip_m;
        earlier_s = own.passed[later].time_s;
        later = (later + 1) % own.passed.size();
      }
      const double gap_s = own.passed[later].time_s - earlier_s;
      const double share = gap_s > 0.0 ? std::clamp((at_s - earlier_s) / gap_s, 0.0, 1.0) : 1.0;
      const Vector3 at_m = earlier_m + share * (own.passed[later].tip_m - earlier_m);
      force = prepared.contact
                  ->step(there_m(at_m, at_s), tip_radius_m_, kMostSweeps, kSweepTolerance_m, step_s)
                  .force_on_sphere_newton;
    }
    here_s = to_s;
  };
  if (is_new) {
    // the force settles in the last ones, before it is used
    std::array<double, kSettlingSteps> last_s{};
    std::size_t place = own.last_passed;
    for (std::size_t i = kSettlingSteps; i > 0; --i, place = before(place)) {
      last_s[i - 1] = own.passed[place].time_s;
    }
    if (own.passed[place].time_s > from_s) go(own.passed[place].time_s, steps);
    for (const double at_s : last_s) {
      if (at_s > here_s) go(at_s, 1);
    }
  }
  if (!is_new || here_s == from_s) go(own.time_s, steps);
  own.stepped_m = own.tip_m;
  own.stepped_s = own.time_s;
  return force + prepared.force_outside_patch_newton;
}

/// The contact of a tip there is within the points of the condensed model.
bool ElasticTissue::is_among(const Prepared& prepared, const Vector3& tip_m,
                             const Vector3& normal) const noexcept {
  const Vector3 way = tip_m - prepared.patch_m;
  return (way - way.dot(normal) * normal).norm() < kPatchRadii * tip_radius_m_;
}

void ElasticTissue::describe_ahead(std::size_t tool, const Vector3& velocity_m_per_s,
                                   double age_s) noexcept {
  tools_[tool]->ahead.store({.x_m_per_s = velocity_m_per_s.x(),
                             .y_m_per_s = velocity_m_per_s.y(),
                             .z_m_per_s = velocity_m_per_s.z(),
                             .age_s = age_s,
                             .is_wanted = true});
}

bool ElasticTissue::touch(std::size_t tool, Contact& contact) noexcept {
  Tool& own = *tools_[tool];
  Rubbing rubbing = std::exchange(own.rubbing, {});  // none out of reach
  if (gripper_) {
    if (const std::optional<bool> held = hold(own, contact)) return *held;
  }
  if (!own.side.is_known()) return false;
  Prepared* const prepared = own.prepared.newest();
  const bool is_carried = prepared != nullptr && !prepared->carried.motions.empty();
  // as it would be if nothing had carried the surface since the solution
  const Vector3 tip_m =
      is_carried ? Vector3(own.tip_m - prepared->carried.since_m(own.time_s)) : own.tip_m;
  const SurfaceView& view = own.side.view();
  const double penetration_m =
      tip_radius_m_ - view.distance_m +
      (prepared != nullptr ? prepared->surface_offset_by_other_tools_m : 0.0);
  if (!(penetration_m > -own.reach_m)) return false;

  own.normal = view.normal;
  own.bound_newton = kUnknownNewton;
  double depth_m = penetration_m;  // of the law
  if (prepared == nullptr || !is_among(*prepared, tip_m, view.normal)) {
    own.stiffness_newton_per_m = stiffness_untouched(*whole_);
  } else if (penetration_m > -tip_radius_m_) {
    const Vector3 force = press(own, *prepared);
    // in doubt there is no force
    own.stiffness_newton_per_m = 0.0;
    if (force.allFinite()) {
      own.bound_newton = prepared->error.bound_newton((tip_m - prepared->centre_m).norm());
      own.normal = contact_normal(force, view.normal);
      const double newton = std::max(0.0, force.dot(own.normal));
      if (penetration_m < kLeastDepth_m) {
        // the law is that of a depth at which it can be known, and the tip as deep as the surface
        // now presses on it
        const Vector3 deeper_m = tip_m - (kLeastDepth_m - penetration_m) * view.normal;
        const Vector3 probed =
            prepared->probe->step(deeper_m, tip_radius_m_, kMostSweeps, kSweepTolerance_m)
                .force_on_sphere_newton +
            prepared->force_outside_patch_newton;
        const double probed_newton = probed.allFinite() ? probed.norm() : 0.0;
        own.stiffness_newton_per_m =
            elastic_stiffness(std::max(newton, probed_newton), kLeastDepth_m);
        depth_m = newton > 0.0 ? elastic_depth_m(newton, own.stiffness_newton_per_m)
                               : std::min(0.0, penetration_m);
      } else {
        own.stiffness_newton_per_m = elastic_stiffness(newton, penetration_m);
      }
    }
  }
  contact = elastic_contact(whole_->tissue, view, depth_m, own.normal, own.stiffness_newton_per_m,
                            tip_radius_m_);
  if (is_carried) {
    contact.surface_velocity_world_m_per_s = prepared->carried.velocity_m_per_s(own.time_s);
  }
  rubbing.settle(own.tip_m - own.carried_m, whole_->friction_coefficient,
                 whole_->shear_newton_per_m, contact);
  own.rubbing = rubbing;
  pierce(own, contact);
  return contact.force_on_tool_newton.allFinite();
}

// --- the slow thread -----------------------------------------------------------------------------

void ElasticTissue::note_late() { ++figures_.late; }

bool ElasticTissue::is_close(const Tip& tip) const { return tip.distance_m < 2.0 * tip_radius_m_; }

bool ElasticTissue::is_fast(const Tool& tool) const {
  const Tip tip = tool.tip.load();
  const Vector3 tip_m(tip.x_m, tip.y_m, tip.z_m);
  return tip.is_known && is_close(tip) &&
         (tip_m - tool.slow_tip_m).norm() > kFastRadii * tip_radius_m_;
}

bool ElasticTissue::is_hasty(const Tool& tool) const {
  return tool.velocity_m_per_s.norm() * least_step_s() > kFastRadii * tip_radius_m_;
}

bool ElasticTissue::is_fast() const {
  return hasty_solves_ > 0 || std::any_of(tools_.begin(), tools_.end(),
                                          [&](const auto& tool) { return is_fast(*tool); });
}

void ElasticTissue::solve(double step_s, double ahead_s) {
  begin_solve(step_s, ahead_s);
  end_solve(step_s, simulation_->step(tips_, step_s));
}

void ElasticTissue::begin_solve(double step_s, double ahead_s) {
  hasty_solves_ = std::max(0, hasty_solves_ - 1);
  for (std::size_t i = 0; i < tools_.size(); ++i) {
    const Tip tip = tools_[i]->tip.load();
    const bool was_there = tips_[i].has_value();
    tips_[i].reset();
    if (!tip.is_known) continue;
    Tool& tool = *tools_[i];
    tool.slow_normal = {tip.normal_x, tip.normal_y, tip.normal_z};
    const Vector3 tip_m(tip.x_m, tip.y_m, tip.z_m);
    tool.velocity_m_per_s =
        was_there && tip.time_s > tool.slow_time_s
            ? Vector3((tip_m - tool.slow_tip_m) / (tip.time_s - tool.slow_time_s))
            : Vector3::Zero();
    tool.slow_tip_m = tip_m;
    tool.slow_time_s = tip.time_s;
    if (is_close(tip) && is_hasty(tool)) hasty_solves_ = kHastySolves;
    tool.slow_distance_m = tip.distance_m;
    Vector3 ahead_m = Vector3::Zero();
    tool.ahead_s = 0.0;
    if (simulation_->touch(i).is_near && !gripper_) {
      const Vector3 velocity(tip.x_m_per_s, tip.y_m_per_s, tip.z_m_per_s);
      const double radii = least_step_s() * velocity.norm() / tip_radius_m_;
      // all of it for a tip that is twice as fast as a fast one
      tool.ahead_s = std::clamp(radii / kFastRadii - 1.0, 0.0, 1.0) * ahead_s;
      ahead_m = limited_to_norm(tool.ahead_s * velocity, kMostAheadRadii * tip_radius_m_);
    }
    tips_[i] = {.tip_m = tip_m + ahead_m,
                .place_m = {tip.place_x_m, tip.place_y_m, tip.place_z_m},
                .friction_on_tool_newton = {tip.friction_x_newton, tip.friction_y_newton,
                                            tip.friction_z_newton}};
  }
  if (ablation_) change_body(step_s);
  if (gripper_) close_jaws();
  sweep_blades();
  if (!whole_->can_be_carried()) return;
  solved_s_ = noted_s_.load(std::memory_order_relaxed);
  simulation_->set_time(solved_s_);
}

void ElasticTissue::end_solve(double step_s, bool has_stepped) {
  has_moved_ = has_moved_ || has_stepped;
  if (has_stepped) {
    ++figures_.solves;
    figures_.residual_ratio = simulation_->report().search.residual_ratio;
    for (auto& tool : tools_) {
      measure(*tool, simulation_->touch(static_cast<std::size_t>(&tool - tools_.data())), step_s);
    }
  } else {
    ++figures_.skipped;
  }
  if (gripper_) read_jaws(step_s);
  if (ablation_) wear();
  figures_.failed = simulation_->failed_steps() + without_compliance_;
  figures_.repaired = simulation_->repaired_steps();
  figures_.appeared = simulation_->appeared();
  for (std::size_t i = 0; i < tools_.size(); ++i) {
    const ElasticSimulation::Touch& touch = simulation_->touch(i);
    const bool is_held = !touch.is_near && !touch.forces_on_body_newton.empty();
    if (!tips_[i] || is_held) continue;
    try {  // an untouched body at rest is prepared once; what has failed, never
      if (touch.is_near && (has_stepped || !tools_[i]->last)) prepare(i, step_s);
      describe_patch(i, has_stepped);
    } catch (const std::runtime_error&) {  // the steps keep what they have
      ++without_compliance_;
      ++figures_.failed;
    }
  }
  figures_out_.store(figures_);
  show();
  if (is_folded_) fold();
}

/// Of a full solution, with the bound that was stated for it.
void ElasticTissue::compare(elastic::StatedError& stated, double error_newton, double way_m) {
  figures_.error_newton = error_newton;
  const double bound_newton = stated.bound_newton(way_m);
  if (!std::isnan(bound_newton)) {
    ++figures_.bounds_checked;
    figures_.bound_violations += error_newton > bound_newton ? 1U : 0U;
  }
  stated.note(error_newton, way_m);
}

/// Compares the full solution with what the model prepared before it says for the same place.
void ElasticTissue::measure(Tool& tool, const ElasticSimulation::Touch& touch, double step_s) {
  const double newton = touch.force_on_tool_newton.norm();
  const Vector3 centre_m = touch.centre_m - tool.carried.since_m(solved_s_);
  const double way_m = (centre_m - tool.last_centre_m).norm();
  if (!touch.is_near) {
    tool.error = {};
  }
  if (!touch.is_near || !tool.last || !(newton > 0.0) || way_m > tip_radius_m_) return;
  const Vector3 expected =
      tool.last->step(centre_m, tip_radius_m_, kMostSweeps, kSweepTolerance_m, step_s)
          .force_on_sphere_newton +
      tool.last_force_outside_patch_newton;
  compare(tool.error, (expected - touch.force_on_tool_newton).norm(), way_m);
}

void ElasticTissue::prepare(std::size_t index, double step_s) {
  Tool& tool = *tools_[index];
  const ElasticSimulation::Touch& touch = simulation_->touch(index);
  Prepared& draft = tool.prepared.draft();
  draft.contact.reset();  // before what it refers to
  draft.probe.reset();
  draft.of = shared_;
  draft.contact.emplace(compliance(), 0.0, body_->contact_stiffness_pa_per_m);
  // not all the way into the body: a fast tip would be behind a thin one
  Vector3 ahead_m = std::max(0.0, kAhead * step_s - tool.ahead_s) * tool.velocity_m_per_s;
  const double inward_m = -ahead_m.dot(tool.slow_normal);
  ahead_m += std::max(0.0, inward_m - kMostInwardRadii * tip_radius_m_) * tool.slow_normal;
  draft.patch_m = touch.centre_m + ahead_m;
  draft.contact->prepare(body_->points, simulation_->x_m(), touch.forces_on_body_newton,
                         draft.patch_m, kMostPoints, kPointsWithin * body_->tip_radius_m,
                         tool.slow_normal);
  lean_or_swing(*draft.contact, touch.centre_m);
  tool.carried_since_last_m = tool.carried.since_m(solved_s_);
  tool.carried = carried_now(index, *draft.contact, tool.carried);
  draft.carried = tool.carried;
  draft.contact->relax(body_->points, simulation_->v_m_per_s(), body_->viscosity_s,
                       &simulation_->relaxation());
  if (is_alone(index) && !touch.force_on_tool_newton.isZero(0.0)) {
    add_equilibria(tool, touch, *draft.contact);
  }
  tool.last_newton = touch.force_on_tool_newton.norm();
  tool.last_forces_newton.clear();
  for (std::size_t p = 0; p < touch.forces_on_body_newton.size(); ++p) {
    const elastic::Vector3d& force = touch.forces_on_body_newton[p];
    if (!force.isZero(0.0)) tool.last_forces_newton.emplace_back(p, force);
  }
  tool.last_m = simulation_->x_m();
  tool.last_m_per_s = simulation_->v_m_per_s();
  tool.last_creep_m = simulation_->relaxation().creep_m();
  draft.surface_offset_by_other_tools_m =
      surface_offset_by_other_tools_m(index, draft.contact->chosen().front(), tool.slow_normal);
  draft.force_outside_patch_newton = touch.force_on_tool_newton;
  for (const std::size_t point : draft.contact->chosen()) {
    if (!touch.forces_on_body_newton.empty()) {
      draft.force_outside_patch_newton += touch.forces_on_body_newton[point];
    }
  }
  draft.centre_m = touch.centre_m;
  draft.time_s = tool.slow_time_s + tool.ahead_s;
  draft.waiting.setZero();
  if (touch.blocked_steps > 0) draft.waiting = touch.blocked_m.stableNormalized();
  draft.error = tool.error;
  if (is_folded_) draft.contact->fold();
  draft.probe.emplace(*draft.contact);
  tool.last.emplace(*draft.contact);
  tool.last_force_outside_patch_newton = draft.force_outside_patch_newton;
  tool.last_centre_m = touch.centre_m;
  tool.is_prepared = true;
}

/// The compliance shall do the work from the untouched body to this solution or, if that was at
/// another depth, from the last one. Behind a tip that moves fast the body has no time to come back
/// to the untouched one.
void ElasticTissue::add_equilibria(Tool& tool, const ElasticSimulation::Touch& touch,
                                   elastic::CondensedContact& contact) {
  const double newton = touch.force_on_tool_newton.norm();
  const Vector3 way = touch.centre_m - tool.last_centre_m - tool.carried_since_last_m;
  const auto moved_by = [&](elastic::VectorXd x_m, const Vector3& by_m) {
    if (body_->can_be_carried()) x_m.reshaped(3, x_m.size() / 3).colwise() += by_m;
    return x_m;
  };
  const auto add_last = [&] {
    if (!(tool.last_newton > 0.0 && std::abs(newton - tool.last_newton) > kOtherForce * newton &&
          std::abs(way.dot(tool.slow_normal)) > kAlongNormal * way.norm())) {
      return false;
    }
    std::vector<elastic::Vector3d> forces(body_->points.size(), elastic::Vector3d::Zero());
    for (const auto& [point, force] : tool.last_forces_newton) forces[point] = force;
    return contact.add_equilibrium(body_->points, moved_by(tool.last_m, tool.carried_since_last_m),
                                   forces, &tool.last_m_per_s, &tool.last_creep_m);
  };
  if (is_hasty(tool) && add_last()) return;
  contact.add_equilibrium(body_->points, moved_by(body_->start_m, tool.carried.way_m), {});
  if (!is_hasty(tool)) add_last();
}

}  // namespace palpate::physics
