#include "physics_node/elastic_tissue/elastic_tissue.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <stdexcept>
#include <utility>

#include "physics_node/elastic/condensed/compliance_file.h"
#include "physics_node/elastic_tissue/elastic_contact.h"

namespace palpate::physics {
namespace {

constexpr int kMostPoints = elastic::CondensedContact::kMostPoints;
constexpr int kMostSweeps = 40;
constexpr double kSweepTolerance_m = 1e-7;
// So many, before the first step with a new full solution, which is behind the tip.
constexpr int kCatchUpSteps = 2;
// A motion since the last full solution that is too short to tell an error per metre.
constexpr double kShortWay_m = 2e-5;
// The measured error is forgotten by this factor per solution in contact.
constexpr double kErrorMemory = 0.95;
// A solution is used from the next one on until the one after.
constexpr double kPeriodsAhead = 2.0;
// mofc_node may press on a point for so long after that was pressed here.
constexpr double kHeldAges = 1.25;
constexpr std::uint32_t kHeldPeriods = 3;
constexpr double kSamePlace_m = 2e-4;
constexpr std::size_t kMostKeptFloats = 64UL << 20U;  // of the columns of a body: 256 MiB

}  // namespace

ElasticTissue::ElasticTissue(std::shared_ptr<const ElasticBody> body, std::size_t tools,
                             double tip_radius_m, const std::filesystem::path& columns_folder)
    : body_(std::move(body)),
      tip_radius_m_(tip_radius_m),
      simulation_(*body_, tools, tip_radius_m, 1.0 / body_->solve_rate_hz),
      factor_(*body_->body, elastic::Precision::kFloat),
      compliance_(*body_->body, factor_, body_->surface_nodes),
      tips_(tools) {
  for (std::size_t i = 0; i < tools; ++i) {
    tools_.push_back(std::make_unique<Tool>());
    tools_.back()->stiffness_newton_per_m = elastic_stiffness(body_->hertz_newton, kHertzDepth_m);
  }
  if (columns_folder.empty()) return;
  columns_file_ = elastic::compliance_file(columns_folder, compliance_);
  static_cast<void>(elastic::load_columns(columns_file_, compliance_));
}

ElasticTissue::~ElasticTissue() {
  const std::size_t floats = compliance_.all_columns().size() * 9 * body_->surface_nodes.size();
  if (columns_file_.empty() || compliance_.columns_made() == 0 || floats > kMostKeptFloats) return;
  try {
    std::filesystem::create_directories(columns_file_.parent_path());
    elastic::save_columns(compliance_, columns_file_);
  } catch (const std::exception&) {  // NOLINT(bugprone-empty-catch): the next run makes them anew
  }
}

ElasticTissue::Columns ElasticTissue::columns() const noexcept {
  return {.all = compliance_.all_columns().size(), .computed = compliance_.columns_made()};
}

// --- the steps of a tool -------------------------------------------------------------------------

void ElasticTissue::note(std::size_t tool, const Vector3& tip_m, double reach_m,
                         double time_s) noexcept {
  Tool& own = *tools_[tool];
  own.tip_m = tip_m;
  own.reach_m = reach_m;
  if (!own.side.follow(body_->shape, body_->bounds, tip_radius_m_, reach_m, tip_m, time_s)) {
    own.rubbing = {};
    own.tip.store({});
    return;
  }
  const Vector3& friction = own.rubbing.force_on_tool_newton();
  const Vector3& place_m = own.side.place_m();
  own.tip.store({.x_m = tip_m.x(),
                 .y_m = tip_m.y(),
                 .z_m = tip_m.z(),
                 .place_x_m = place_m.x(),
                 .place_y_m = place_m.y(),
                 .place_z_m = place_m.z(),
                 .normal_x = own.side.view().normal.x(),
                 .normal_y = own.side.view().normal.y(),
                 .normal_z = own.side.view().normal.z(),
                 .distance_m = own.side.view().distance_m,
                 .friction_x_newton = friction.x(),
                 .friction_y_newton = friction.y(),
                 .friction_z_newton = friction.z(),
                 .is_known = true});
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
  if (!own.side.is_known()) return false;
  const Vector3& tip_m = own.tip_m;
  Prepared* const prepared = own.prepared.newest();
  const SurfaceView& view = own.side.view();
  const double penetration_m =
      tip_radius_m_ - view.distance_m + (prepared != nullptr ? prepared->raised_m : 0.0);
  if (!(penetration_m > -own.reach_m)) return false;

  const double way_m =
      prepared != nullptr ? (tip_m - prepared->centre_m).norm() : 2.0 * tip_radius_m_;
  own.normal = view.normal;
  if (way_m < tip_radius_m_ && penetration_m > -tip_radius_m_) {
    // as deep as the law needs to be known, if the tip is not
    const double depth_m = std::max(penetration_m, kLeastDepth_m);
    const Vector3 centre_m = tip_m - (depth_m - penetration_m) * view.normal;
    const bool is_new = std::exchange(own.stepped, prepared) != prepared;
    for (int i = is_new ? kCatchUpSteps : 0; i > 0; --i) {
      prepared->contact->step(centre_m, tip_radius_m_, kMostSweeps, kSweepTolerance_m);
    }
    const Vector3 force =
        prepared->contact->step(centre_m, tip_radius_m_, kMostSweeps, kSweepTolerance_m)
            .force_on_sphere_newton +
        prepared->other_newton;
    // in doubt there is no force
    own.stiffness_newton_per_m = 0.0;
    if (force.allFinite()) {
      own.normal = contact_normal(force, view.normal);
      own.stiffness_newton_per_m = elastic_stiffness(std::max(0.0, force.dot(own.normal)), depth_m);
    }
  }
  if (prepared != nullptr) {
    own.bound_newton = prepared->error_newton + prepared->error_newton_per_m * way_m;
  }
  contact = elastic_contact(body_->tissue, view, penetration_m, own.normal,
                            own.stiffness_newton_per_m, tip_radius_m_);
  rubbing.settle(tip_m, body_->friction_coefficient, body_->shear_newton_per_m, contact);
  own.rubbing = rubbing;
  return contact.force_on_tool_newton.allFinite();
}

// --- the slow thread -----------------------------------------------------------------------------

void ElasticTissue::note_late() { ++figures_.late; }

void ElasticTissue::solve() {
  for (std::size_t i = 0; i < tools_.size(); ++i) {
    const Tip tip = tools_[i]->tip.load();
    tips_[i].reset();
    if (!tip.is_known) continue;
    tools_[i]->slow_distance_m = tip.distance_m;
    tools_[i]->slow_normal = {tip.normal_x, tip.normal_y, tip.normal_z};
    tips_[i] = {.tip_m = {tip.x_m, tip.y_m, tip.z_m},
                .place_m = {tip.place_x_m, tip.place_y_m, tip.place_z_m},
                .friction_on_tool_newton = {tip.friction_x_newton, tip.friction_y_newton,
                                            tip.friction_z_newton}};
  }
  const bool has_stepped = simulation_.step(tips_);
  has_moved_ = has_moved_ || has_stepped;
  if (has_stepped) {
    ++figures_.solves;
    figures_.residual_ratio = simulation_.report().search.residual_ratio;
    for (auto& tool : tools_) {
      measure(*tool, simulation_.touch(static_cast<std::size_t>(&tool - tools_.data())));
    }
  } else {
    ++figures_.skipped;
  }
  figures_.failed = simulation_.failed_steps() + without_compliance_;
  for (std::size_t i = 0; i < tools_.size(); ++i) {
    // an untouched body at rest is prepared once; what has failed, never
    if (!simulation_.touch(i).is_near) continue;
    try {
      if (has_stepped || !tools_[i]->last) prepare(i);
      describe_patch(i, has_stepped);
    } catch (const std::runtime_error&) {
      // the steps keep what they have
      ++without_compliance_;
      ++figures_.failed;
    }
  }
  figures_out_.store(figures_);
  show();
}

/// Compares the full solution with what the model prepared before it says for the same place.
void ElasticTissue::measure(Tool& tool, const ElasticSimulation::Touch& touch) {
  const double newton = touch.force_on_tool_newton.norm();
  const double way_m = (touch.centre_m - tool.last_centre_m).norm();
  if (!touch.is_near || !tool.last || !(newton > 0.0) || way_m > tip_radius_m_) return;
  const Vector3 expected =
      tool.last->step(touch.centre_m, tip_radius_m_, kMostSweeps, kSweepTolerance_m)
          .force_on_sphere_newton +
      tool.last_other_newton;
  const double error_newton = (expected - touch.force_on_tool_newton).norm();
  figures_.error_newton = error_newton;
  tool.error_newton = std::max(error_newton, kErrorMemory * tool.error_newton);
  tool.error_newton_per_m *= kErrorMemory;
  if (way_m > kShortWay_m) {
    tool.error_newton_per_m = std::max(tool.error_newton_per_m, error_newton / way_m);
  }
}

void ElasticTissue::prepare(std::size_t index) {
  Tool& tool = *tools_[index];
  const ElasticSimulation::Touch& touch = simulation_.touch(index);
  Prepared& draft = tool.prepared.draft();
  draft.contact.emplace(compliance_, 0.0, body_->contact_stiffness_pa_per_m);
  draft.contact->prepare(body_->points, simulation_.x_m(), touch.forces_on_body_newton,
                         touch.centre_m, kMostPoints);
  if (is_alone(index) && !touch.force_on_tool_newton.isZero(0.0)) {
    // the compliance shall do the work from the untouched body to this solution
    draft.contact->add_equilibrium(body_->points, body_->start_m, {});
  }
  draft.raised_m = raised_m(index, draft.contact->chosen().front(), tool.slow_normal);
  draft.other_newton = touch.force_on_tool_newton;
  for (const std::size_t point : draft.contact->chosen()) {
    if (!touch.forces_on_body_newton.empty()) {
      draft.other_newton += touch.forces_on_body_newton[point];
    }
  }
  draft.centre_m = touch.centre_m;
  draft.error_newton_per_m = tool.error_newton_per_m;
  draft.error_newton = tool.error_newton;
  tool.last.emplace(*draft.contact);
  tool.last_other_newton = draft.other_newton;
  tool.last_centre_m = touch.centre_m;
  tool.is_prepared = true;
}

/// What mofc_node needs to go on from this solution itself.
void ElasticTissue::describe_patch(std::size_t index, bool has_stepped) {
  Tool& tool = *tools_[index];
  const Ahead ahead = tool.ahead.load();
  const ElasticSimulation::Touch& touch = simulation_.touch(index);
  if (!ahead.is_wanted || !tips_[index] || touch.has_failed) return;
  const Vector3& tip_m = tips_[index]->tip_m;
  const bool is_elsewhere = (tip_m - tool.patch_tip_m).norm() > kSamePlace_m;
  if (!has_stepped && !is_elsewhere && tool.maker && tool.maker->is_complete()) return;
  if (!tool.maker) tool.maker.emplace(*body_, compliance_, tip_radius_m_);
  const double ahead_s = ahead.age_s + kPeriodsAhead / body_->solve_rate_hz;
  tool.maker->update(
      {.tip_m = tip_m,
       .ahead_m = ahead_s * Vector3(ahead.x_m_per_s, ahead.y_m_per_s, ahead.z_m_per_s),
       .normal = tool.slow_normal,
       .held_solutions =
           static_cast<std::uint32_t>(kHeldAges * ahead.age_s * body_->solve_rate_hz) +
           kHeldPeriods,
       .gap_m = tool.slow_distance_m},
      touch, simulation_.x_m(), is_alone(index));
  tool.patch_tip_m = tip_m;
  tool.patch.draft() = tool.maker->patch();
  tool.is_patched = true;
}

bool ElasticTissue::is_alone(std::size_t tool) const {
  for (std::size_t other = 0; other < tools_.size(); ++other) {
    if (other != tool && !simulation_.touch(other).force_on_tool_newton.isZero(0.0)) return false;
  }
  return true;
}

/// How far the forces of the other tools raise a point along the normal.
double ElasticTissue::raised_m(std::size_t tool, std::size_t nearest_point, const Vector3& normal) {
  const elastic::SurfacePoint& at = body_->points[nearest_point];
  double raised = 0.0;
  for (std::size_t other = 0; other < tools_.size(); ++other) {
    const std::vector<elastic::Vector3d>& forces = simulation_.touch(other).forces_on_body_newton;
    if (other == tool || forces.empty()) continue;
    for (std::size_t p = 0; p < forces.size(); ++p) {
      if (forces[p].isZero(0.0)) continue;
      const elastic::SurfacePoint& from = body_->points[p];
      for (std::size_t b = 0; b < static_cast<std::size_t>(from.count); ++b) {
        compliance_.require(from.nodes[b]);
        const float* columns = compliance_.columns(from.nodes[b]);
        for (std::size_t a = 0; a < static_cast<std::size_t>(at.count); ++a) {
          const auto row = static_cast<std::size_t>(compliance_.row_of(at.nodes[a]));
          const Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>> give(columns +
                                                                                   9 * row);
          raised += at.weights[a] * from.weights[b] * normal.dot(give.cast<double>() * forces[p]);
        }
      }
    }
  }
  return raised;
}

void ElasticTissue::publish() {
  for (auto& tool : tools_) {
    if (std::exchange(tool->is_prepared, false)) tool->prepared.publish();
    if (std::exchange(tool->is_patched, false)) tool->patch.publish();
  }
}

void ElasticTissue::show() {
  const std::unique_lock lock(shown_mutex_, std::try_to_lock);
  if (!lock || !is_wanted_ || !has_moved_) return;
  is_wanted_ = has_moved_ = false;
  const elastic::VectorXd& x = simulation_.x_m();
  vertices_m_.clear();
  for (const std::uint32_t node : body_->surface_nodes) {
    for (Eigen::Index i = 0; i < 3; ++i) {
      vertices_m_.push_back(static_cast<float>(x[3 * Eigen::Index{node} + i]));
    }
  }
  simulation_.surface_strain(strain_);
  is_new_ = true;
}

bool ElasticTissue::take_surface(std::vector<float>& vertices_m, std::vector<float>& strain) {
  const std::scoped_lock lock(shown_mutex_);
  is_wanted_ = true;
  if (!std::exchange(is_new_, false)) return false;
  vertices_m = vertices_m_;
  strain = strain_;
  return true;
}

}  // namespace palpate::physics
