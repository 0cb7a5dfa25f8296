// SPDX-License-Identifier: Apache-2.0
// The state of an elastic tissue: to continue from, to be shown, what mofc_node gets of it, what of
// it is not kept, and what jaws hold of it.
#include <algorithm>
#include <mutex>
#include <stdexcept>
#include <utility>

#include "common/contact/elastic/grip.h"
#include "physics_node/elastic_tissue/elastic_tissue.h"

namespace palpate::physics {
namespace {

// A solution is used from the next one on until the one after.
constexpr double kPeriodsAhead = 2.0;
// mofc_node may press on a point for so long after that was pressed here.
constexpr double kHeldAges = 1.25;
constexpr std::uint32_t kHeldPeriods = 3;
constexpr double kSamePlace_m = 2e-4;
// A patch has the compliance of a body that leans on nothing. Where leaning makes it less by more
// than this factor, the contact model is nearer to the solution.
constexpr double kMostLeaningRatio = 5.0;

}  // namespace

void ElasticTissue::continue_as(const ElasticTissue& other) {
  if (ablation_) {
    ablation_->continue_as(*other.ablation_);
    if (body_ != other.body_) {
      body_ = other.body_;
      shared_ = other.shared_;
      simulation_ = std::make_unique<ElasticSimulation>(*body_, tools_.size(), tip_radius_m_,
                                                        other.simulation_->step_s(), is_folded_);
    }
    is_body_new_ = other.is_body_new_;
  }
  simulation_->continue_as(*other.simulation_);
  for (std::size_t i = 0; i < tools_.size(); ++i) {
    Tool& own = *tools_[i];
    own = *other.tools_[i];
    own.stepped = own.prepared.place_of(other.tools_[i]->prepared, own.stepped);
    own.patch = {};
    makers_[i].reset();
  }
  tips_ = other.tips_;
  noted_s_ = other.noted_s_.load();
  solved_s_ = other.solved_s_;
  figures_ = other.figures_;
  without_compliance_ = other.without_compliance_;
  hasty_solves_ = other.hasty_solves_;
  figures_out_ = other.figures_out_;
  has_moved_ = true;
}

void ElasticTissue::publish() {
  for (auto& tool : tools_) {
    if (is_body_new_) tool->body.publish();
    if (std::exchange(tool->is_prepared, false)) tool->prepared.publish();
    if (std::exchange(tool->is_patched, false)) tool->patch.publish();
    if (std::exchange(tool->is_grip_new, false)) tool->grip.publish();
  }
  is_body_new_ = false;
}

// --- jaws ----------------------------------------------------------------------------------------

void ElasticTissue::set_jaw(std::size_t tool, std::uint32_t closing, const GripReport* report,
                            const Vector3& velocity_m_per_s) noexcept {
  Tool& own = *tools_[tool];
  own.jaw_m_per_s = velocity_m_per_s;
  own.jaw.set(closing);
  own.is_jaw_led = report != nullptr;
  if (report != nullptr) own.jaw.follow(report->slip_m, report->has_let_go);
  own.jaw_command.store(own.jaw.command());
}

/// The contact of what the jaws hold. False: they have lost it, or just opened, and the next
/// solution is the first without them. None: they hold nothing.
std::optional<bool> ElasticTissue::hold(Tool& own, Contact& contact) const noexcept {
  const GripModel* const model = own.grip.newest();
  own.is_holding = false;
  const bool is_needle = can_be_pierced();
  if (model != nullptr && is_needle && !stays_in(own, *model) && !model->is_holding()) return {};
  if (model == nullptr || !model->is_holding()) return std::nullopt;
  const Vector3 by_others_newton = pulled_by_others_newton(*model);
  Vector3 v_m_per_s = own.jaw_m_per_s;
  if (!own.is_jaw_led) {
    // a needle slips all the time: what it slips, the tissue does not move
    const double viscous_ratio =
        is_needle ? model->relaxation_s / std::max(kLeastStep_s, own.step_s) : 0.0;
    const Vector3 before_m = own.jaw.slip_m();
    static_cast<void>(
        own.jaw.act(*model, *gripper_, own.tip_m, v_m_per_s, viscous_ratio, by_others_newton));
    own.jaw_command.store(own.jaw.command());
    if (is_needle) {
      v_m_per_s -= (own.jaw.slip_m() - before_m) / std::max(kLeastStep_s, own.step_s);
    }
  } else if (is_needle) {
    const NeedleLaw& law = own.jaw.needle();
    v_m_per_s -= v_m_per_s.dot(law.inward_world) * law.inward_world;
    v_m_per_s -= v_m_per_s.dot(law.edge_world) * law.edge_world;
  }
  if (is_needle && !stays_in(own, *model)) return false;
  if (!own.jaw.holds(*model)) return false;
  own.is_holding = true;
  const Vector3 at_m = own.tip_m - own.jaw.slip_since_m();
  own.bound_newton = model->error.bound_newton((at_m - model->place_m).norm());
  contact = grip_contact(*model, *gripper_, body_->tissue, at_m, v_m_per_s, own.jaw.slip_m(),
                         by_others_newton, own.jaw.needle());
  if (gripper_->is_blade()) {
    const Vector3& newton = contact.force_on_tool_newton;
    own.jaw.note_work(own.is_jaw_led ? own.jaw.yielding_newton(newton) : newton, own.tip_m,
                      own.is_jaw_led || !own.is_felt_elsewhere);
    own.jaw_command.store(own.jaw.command());
  }
  return contact.force_on_tool_newton.allFinite();
}

/// Force on the tool of `model` by what the others have moved since the solution, while they hold.
Vector3 ElasticTissue::pulled_by_others_newton(const GripModel& model) const noexcept {
  Vector3 newton = Vector3::Zero();
  for (const GripModel::Other& one : model.others) {
    const Tool& other = *tools_[one.tool];
    if (!other.is_holding || other.jaw.number() != one.number) continue;
    newton += one.pull_newton(other.tip_m - other.jaw.slip_since_m(), other.jaw_m_per_s,
                              model.relaxation_s);
  }
  return newton;
}

void ElasticTissue::close_jaws() {
  for (std::size_t i = 0; i < tools_.size(); ++i) {
    const JawCommand command = tools_[i]->jaw_command.load();
    if (tips_[i]) tips_[i]->slip_m = command.slip_m();
    tools_[i]->held.prepare(*simulation_, i, compliance(), *gripper_, command, tips_[i]);
  }
}

void ElasticTissue::read_jaws(double step_s) {
  std::uint64_t changes = 0;
  for (const auto& tool : tools_) changes += tool->held.changes();
  figures_.points_held = 0;
  for (std::size_t i = 0; i < tools_.size(); ++i) {
    Tool& tool = *tools_[i];
    try {
      tool.held.read(*simulation_, i, compliance(), step_s, changes, is_alone(i));
    } catch (const std::runtime_error&) {  // it has let go
      ++without_compliance_;
    }
  }
  for (std::size_t i = 0; i < tools_.size(); ++i) {
    Tool& tool = *tools_[i];
    for (std::size_t j = 0; j < tools_.size(); ++j) {
      if (j != i) tool.held.note_other(j, tools_[j]->held.model());
    }
    if (const auto& measured = tool.held.measured()) {
      compare(tool.held.error(), measured->error_newton, measured->way_m);
    }
    figures_.points_held += tool.held.model().points;
    tool.grip.draft() = tool.held.model();
    tool.is_grip_new = true;
  }
}

/// What the next solution makes again.
void ElasticTissue::fold() {
  simulation_->fold();
  for (auto& tool : tools_) {
    if (tool->last) tool->last->fold();
    Prepared* const spare = tool->prepared.spare();
    if (spare == nullptr) continue;
    spare->contact.reset();
    spare->probe.reset();
  }
}

void ElasticTissue::show() {
  const std::unique_lock lock(shown_mutex_, std::try_to_lock);
  if (!lock || !is_wanted_ || !has_moved_) return;
  is_wanted_ = has_moved_ = false;
  shown_body_ = read_surface(vertices_m_, strain_);
  is_new_ = true;
}

std::shared_ptr<const ElasticBody> ElasticTissue::read_surface(std::vector<float>& vertices_m,
                                                               std::vector<float>& strain) const {
  const elastic::VectorXd& x = simulation_->x_m();
  vertices_m.clear();
  for (const std::uint32_t node : body_->shown_nodes) {
    for (Eigen::Index i = 0; i < 3; ++i) {
      vertices_m.push_back(static_cast<float>(x[3 * Eigen::Index{node} + i]));
    }
  }
  simulation_->shown_strain(strain);
  return body_;
}

std::shared_ptr<const ElasticBody> ElasticTissue::take_surface(std::vector<float>& vertices_m,
                                                               std::vector<float>& strain) {
  const std::scoped_lock lock(shown_mutex_);
  is_wanted_ = true;
  if (!std::exchange(is_new_, false)) return nullptr;
  vertices_m = vertices_m_;
  strain = strain_;
  return shown_body_;
}

/// What mofc_node needs to go on from this solution itself.
void ElasticTissue::describe_patch(std::size_t index, bool has_stepped) {
  Tool& tool = *tools_[index];
  std::optional<PatchMaker>& maker = makers_[index];
  const Ahead ahead = tool.ahead.load();
  const ElasticSimulation::Touch& touch = simulation_->touch(index);
  if (!ahead.is_wanted || !tips_[index] || touch.has_failed) return;
  const Vector3& tip_m = tips_[index]->tip_m;
  // a fast tip is there before all points are, unless they are sent while it is far away
  ElasticSimulation::Touch free;
  if (!touch.is_near) free.centre_m = tip_m;
  const bool is_elsewhere = (tip_m - tool.patch_tip_m).norm() > kSamePlace_m;
  if (!has_stepped && !is_elsewhere && maker && maker->is_complete()) return;
  if (!maker) maker.emplace(*body_, compliance(), tip_radius_m_);
  const double ahead_s = ahead.age_s + kPeriodsAhead / body_->solve_rate_hz;
  const bool is_void = touch.is_near && tool.last && tool.last->leaning_ratio() > kMostLeaningRatio;
  maker->update({.tip_m = tip_m,
                 .ahead_m = ahead_s * Vector3(ahead.x_m_per_s, ahead.y_m_per_s, ahead.z_m_per_s),
                 .normal = tool.slow_normal,
                 .held_solutions =
                     static_cast<std::uint32_t>(kHeldAges * ahead.age_s * body_->solve_rate_hz) +
                     kHeldPeriods,
                 .gap_m = tool.slow_distance_m,
                 .carried_m = tool.carried.at_m(solved_s_),
                 .carried_m_per_s = tool.carried.velocity_m_per_s(solved_s_),
                 .carried_at_s = solved_s_,
                 .is_void = is_void},
                touch.is_near ? touch : free, simulation_->x_m(), simulation_->v_m_per_s(),
                is_alone(index));
  tool.patch_tip_m = tip_m;
  tool.patch.draft() = maker->patch();
  tool.is_patched = true;
}

bool ElasticTissue::is_alone(std::size_t tool) const {
  for (std::size_t other = 0; other < tools_.size(); ++other) {
    if (other != tool && !simulation_->touch(other).force_on_tool_newton.isZero(0.0)) return false;
  }
  return true;
}

/// How far the forces of the other tools raise a point along the normal.
double ElasticTissue::surface_offset_by_other_tools_m(std::size_t tool, std::size_t nearest_point,
                                                      const Vector3& normal) {
  const elastic::SurfacePoint& at = body_->points[nearest_point];
  double raised = 0.0;
  for (std::size_t other = 0; other < tools_.size(); ++other) {
    const std::vector<elastic::Vector3d>& forces = simulation_->touch(other).forces_on_body_newton;
    if (other == tool || forces.empty()) continue;
    raised += normal.dot(compliance().moved_m(at, body_->points, forces));
  }
  return raised;
}

}  // namespace palpate::physics
