// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/condensed/condensed_contact.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "common/contact/elastic/sphere_sweep.h"
#include "physics_node/elastic/linear/dense_kernels.h"

namespace palpate::elastic {
namespace {

// Of the compliance: an equilibrium that asks for more is none, the body moves.
constexpr double kMostScale = 2.0;
constexpr double kLeastScale = 1.0 / 3.0;

constexpr double kLeastArea_m2 = 1e-12;
// On the other side of the body.
constexpr double kHidden = std::numeric_limits<double>::infinity();

using RowMajor3f = Eigen::Matrix<float, 3, 3, Eigen::RowMajor>;

}  // namespace

CondensedContact::CondensedContact(SurfaceCompliance& compliance, double friction_coefficient,
                                   double stiffness_pa_per_m, bool moves_surface)
    : compliance_(&compliance),
      friction_coefficient_(friction_coefficient),
      stiffness_pa_per_m_(stiffness_pa_per_m),
      moves_surface_(moves_surface) {}

/// To be changed.
std::vector<float>& CondensedContact::own_among() {
  if (among_.use_count() > 1) among_ = std::make_shared<std::vector<float>>(*among_);
  return *among_;
}

void CondensedContact::prepare(const std::vector<SurfacePoint>& points, const VectorXd& x_m,
                               const std::vector<Vector3d>& forces_on_body_newton,
                               const Vector3d& centre_m, int most_points, double within_m,
                               const Vector3d& along) {
  std::vector<std::size_t> order(points.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::vector<double> distances;
  const bool knows_sides = !along.isZero(0.0);
  for (std::size_t i = 0; i < points.size(); ++i) {
    // a force that is there must be able to go
    const bool is_pressed = !forces_on_body_newton.empty() && !forces_on_body_newton[i].isZero(0.0);
    const Vector3d way = points[i].position_m(x_m.data()) - centre_m;
    const double distance_m = way.norm();
    double key = distance_m;
    if (is_pressed) {
      key = -1.0 / std::max(distance_m, 1e-9);
    } else if (knows_sides && points[i].outward(x_m.data()).dot(way) > 0.0) {
      key = kHidden;
    }
    distances.push_back(key);
  }
  const std::size_t most = std::min({points.size(), static_cast<std::size_t>(most_points),
                                     static_cast<std::size_t>(kMostPoints)});
  std::partial_sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(most), order.end(),
                    [&](std::size_t a, std::size_t b) { return distances[a] < distances[b]; });
  std::size_t count = std::min(most, static_cast<std::size_t>(kUsualPoints));
  while (count < most && distances[order[count]] < within_m) ++count;
  while (count > 1 && distances[order[count - 1]] == kHidden) --count;
  order.resize(count);
  chosen_ = order;
  count_ = static_cast<int>(count);
  stride_ = static_cast<std::size_t>(padded(3 * count_));
  const std::size_t surface = compliance_->surface_nodes().size();
  surface_stride_ = static_cast<std::size_t>(padded(static_cast<int>(3 * surface)));
  among_ = std::make_shared<std::vector<float>>(stride_ * 3 * count, 0.0F);
  // of the whole surface, or of one point after the other
  onto_surface_.assign(surface_stride_ * 3 * (moves_surface_ ? count : 1), 0.0F);
  displacements_m_.assign(stride_, 0.0F);
  positions_m_.clear();
  rigid_give_.clear();
  is_held_.clear();
  forces_newton_.clear();
  axes_.clear();
  std::vector<std::uint32_t> nodes;
  for (const std::size_t point : chosen_) points[point].add_nodes_to(nodes);
  const SurfaceCompliance::Required columns = compliance_->require(nodes);
  std::vector<std::size_t> rows(moves_surface_ ? surface : 0);
  std::iota(rows.begin(), rows.end(), std::size_t{0});
  if (!moves_surface_) {
    std::sort(nodes.begin(), nodes.end());
    nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
    for (const std::uint32_t node : nodes) {
      rows.push_back(static_cast<std::size_t>(compliance_->row_of(node)));
    }
  }
  for (std::size_t j = 0; j < count; ++j) {
    const SurfacePoint& at = points[chosen_[j]];
    positions_m_.push_back(at.position_m(x_m.data()));
    is_held_.push_back(at.is_held(compliance_->body().pattern()) ? 1 : 0);
    rigid_give_.push_back(1.0 / (stiffness_pa_per_m_ * std::max(at.area_m2, kLeastArea_m2)));
    forces_newton_.push_back(forces_on_body_newton.empty() ? Vector3d::Zero()
                                                           : forces_on_body_newton[chosen_[j]]);
    axes_.push_back(is_held_.back() != 0 ? Vector3d(-at.outward(x_m.data()))
                                         : forces_newton_.back().stableNormalized());
    float* onto = onto_surface_.data() + (moves_surface_ ? 3 * j * surface_stride_ : 0);
    if (!moves_surface_) std::fill(onto_surface_.begin(), onto_surface_.end(), 0.0F);
    for (std::size_t b = 0; b < static_cast<std::size_t>(at.count); ++b) {
      const float* under = columns.of(at.nodes[b]);
      const auto weight = static_cast<float>(at.weights[b]);
      for (const std::size_t row : rows) {
        const RowMajor3f block = weight * Eigen::Map<const RowMajor3f>(under + 9 * row);
        for (std::size_t axis = 0; axis < 3; ++axis) {
          float* to = onto + axis * surface_stride_ + 3 * row;
          for (std::size_t i = 0; i < 3; ++i) {
            to[i] += block(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(axis));
          }
        }
      }
    }
    for (std::size_t i = 0; i < count; ++i) {
      const SurfacePoint& on = points[chosen_[i]];
      for (std::size_t a = 0; a < static_cast<std::size_t>(on.count); ++a) {
        const auto row = static_cast<std::size_t>(compliance_->row_of(on.nodes[a]));
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const float* from = onto + axis * surface_stride_ + 3 * row;
          float* to = among_->data() + (3 * j + axis) * stride_ + 3 * i;
          for (std::size_t k = 0; k < 3; ++k) to[k] += static_cast<float>(on.weights[a]) * from[k];
        }
      }
    }
  }
  if (!moves_surface_) give_back(onto_surface_);
  reached_m_ = positions_m_;
  still_m_ = positions_m_;
  along_ = along;
  base_forces_newton_ = forces_newton_;
  if (moves_surface_) first_m_ = x_m;
  equilibria_.assign(1,
                     {.sum_newton = sum_of_forces_newton(),
                      .positions_m = positions_m_,
                      .rates_m = {},
                      .forces_newton = forces_newton_,
                      .surface_m = std::vector<float>(moves_surface_ ? surface_stride_ : 0, 0.0F)});
  modal_ = {};
  lower_ = 0;
  share_ = 0.0;
  has_centre_ = false;
  relaxation_s_ = 0.0;
  branches_.clear();
  ways_m_.clear();
  held_m_.clear();
  scale_ = 1.0;
  carried_.clear();
  leaning_ratio_ = 1.0;
}

void CondensedContact::swing(const SlowModes& modes, const std::vector<SurfacePoint>& points,
                             const VectorXd& from_m, const VectorXd& x_m, const VectorXd& v_m_per_s,
                             const VectorXd& a_m_per_s2) {
  if (modes.count() == 0) return;
  modal_ = ModalMotion(modes, points, chosen_, from_m, x_m, v_m_per_s, a_m_per_s2, forces_newton_);
  modal_.take_from(own_among(), stride_);
  stepped_ = *among_;
  stepped_pace_ = 0.0;
  bases_m_ = positions_m_;
  for (std::size_t i = 0; i < chosen_.size(); ++i) {
    positions_m_[i] -= modal_.at(i, modal_.amount());
  }
  equilibria_.front().positions_m = positions_m_;
}

void CondensedContact::relax(const std::vector<SurfacePoint>& points, const VectorXd& v_m_per_s,
                             double relaxation_s, const Relaxation* memory) {
  relaxation_s_ = relaxation_s;
  const bool has_branches = memory != nullptr && memory->is_there();
  if (!(relaxation_s > 0.0) && !has_branches) return;
  if (has_branches) {
    branches_ = compliance_->body().description().branches;
    ways_m_.resize(branches_.size());
    held_m_ = positions_m_;
  }
  Equilibrium& own = equilibria_.front();
  if (relaxation_s > 0.0) own.rates_m = rates_of(points, v_m_per_s);
  for (std::size_t i = 0; i < chosen_.size(); ++i) {
    if (has_branches)
      own.creeps_m.push_back(points[chosen_[i]].position_m(memory->creep_m().data()));
    for (std::size_t b = 0; b < branches_.size(); ++b) {
      ways_m_[b].push_back(points[chosen_[i]].position_m(memory->ways_m()[b].data()));
    }
    positions_m_[i] = rest_of(own, i);
  }
}

// Of the points, but for the modes that move by themselves.
std::vector<Vector3d> CondensedContact::rates_of(const std::vector<SurfacePoint>& points,
                                                 const VectorXd& v_m_per_s) const {
  std::vector<Vector3d> rates_m;
  Eigen::VectorXd slow;
  if (!modal_.is_empty()) slow = modal_.rate_in(v_m_per_s);
  for (std::size_t i = 0; i < chosen_.size(); ++i) {
    Vector3d rate = points[chosen_[i]].position_m(v_m_per_s.data());
    if (!modal_.is_empty()) rate -= modal_.at(i, slow);
    rates_m.emplace_back(relaxation_s_ * rate);
  }
  return rates_m;
}

double CondensedContact::sum_of_forces_newton() const noexcept {
  double sum = 0.0;
  for (const Vector3d& force : forces_newton_) sum += force.norm();
  return sum;
}

bool CondensedContact::is_usable(const std::vector<Vector3d>& forces_on_body_newton) const {
  if (forces_on_body_newton.empty()) return true;
  const auto is_pressed = [](const Vector3d& force) { return !force.isZero(0.0); };
  const auto all =
      std::count_if(forces_on_body_newton.begin(), forces_on_body_newton.end(), is_pressed);
  return all == std::count_if(chosen_.begin(), chosen_.end(), [&](std::size_t point) {
           return is_pressed(forces_on_body_newton[point]);
         });
}

bool CondensedContact::add_equilibrium(const std::vector<SurfacePoint>& points, const VectorXd& x_m,
                                       const std::vector<Vector3d>& forces_on_body_newton,
                                       const VectorXd* v_m_per_s, const VectorXd* creep_m) {
  if (!is_usable(forces_on_body_newton)) return false;
  Equilibrium more;
  Eigen::VectorXd slow;
  if (!modal_.is_empty()) slow = modal_.amount_in(x_m);
  for (std::size_t i = 0; i < chosen_.size(); ++i) {
    const std::size_t point = chosen_[i];
    more.positions_m.push_back(points[point].position_m(x_m.data()));
    if (!modal_.is_empty()) more.positions_m.back() -= modal_.at(i, slow);
    more.forces_newton.push_back(forces_on_body_newton.empty() ? Vector3d::Zero()
                                                               : forces_on_body_newton[point]);
    more.sum_newton += more.forces_newton.back().norm();
    if (creep_m != nullptr && creep_m->size() > 0) {
      more.creeps_m.push_back(points[point].position_m(creep_m->data()));
    }
  }
  if (v_m_per_s != nullptr && relaxation_s_ > 0.0) more.rates_m = rates_of(points, *v_m_per_s);
  const auto place = std::lower_bound(
      equilibria_.begin(), equilibria_.end(), more.sum_newton,
      [](const Equilibrium& one, double sum_newton) { return one.sum_newton < sum_newton; });
  constexpr double kSame = 1e-3;  // relative
  const auto is_same = [&](const Equilibrium& one) {
    return std::abs(one.sum_newton - more.sum_newton) <= kSame * more.sum_newton;
  };
  if ((place != equilibria_.end() && is_same(*place)) ||
      (place != equilibria_.begin() && is_same(*std::prev(place)))) {
    return false;
  }
  if (moves_surface_) more.surface_m.assign(surface_stride_, 0.0F);
  const auto& nodes = compliance_->surface_nodes();
  for (std::size_t row = 0; moves_surface_ && row < nodes.size(); ++row) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto from = static_cast<Eigen::Index>(3 * std::size_t{nodes[row]} + k);
      more.surface_m[3 * row + k] = static_cast<float>(x_m[from] - first_m_[from]);
    }
  }
  const auto added = equilibria_.insert(place, std::move(more));
  if (!scale_compliance()) {
    equilibria_.erase(added);
    return false;
  }
  start_between(sum_of_forces_newton());
  return true;
}

// Between the last two equilibria C shall do the work that the elastic part of the forces did: if
// it did less than half of it, the force would alternate from step to step. With C = s C₀, x + s β
// ẋ = C f: s = Δf·Δx / (Δf·C₀ Δf − β Δf·Δẋ).
bool CondensedContact::scale_compliance() {
  const Equilibrium& last = equilibria_.back();
  const Equilibrium& other = equilibria_[equilibria_.size() - 2];
  const Eigen::Index size = 3 * Eigen::Index{count_};
  Eigen::VectorXd force(size);
  Eigen::VectorXd way(size);
  Eigen::VectorXd rate = Eigen::VectorXd::Zero(size);
  for (Eigen::Index i = 0; i < count_; ++i) {
    const auto point = static_cast<std::size_t>(i);
    force.segment<3>(3 * i) = last.forces_newton[point] - other.forces_newton[point];
    way.segment<3>(3 * i) = last.positions_m[point] - other.positions_m[point];
    if (!last.rates_m.empty()) rate.segment<3>(3 * i) += last.rates_m[point];
    if (!other.rates_m.empty()) rate.segment<3>(3 * i) -= other.rates_m[point];
    // where they would have crept to
    if (!last.creeps_m.empty()) way.segment<3>(3 * i) += last.creeps_m[point];
    if (!other.creeps_m.empty()) way.segment<3>(3 * i) -= other.creeps_m[point];
  }
  const Eigen::Map<const Eigen::MatrixXf, 0, Eigen::OuterStride<>> among(
      among_->data(), size, size, Eigen::OuterStride<>(static_cast<Eigen::Index>(stride_)));
  const double expected = force.dot(among.cast<double>() * force);
  const double found = force.dot(way);
  const double scale = found / (expected / scale_ - force.dot(rate));
  if (!(scale >= kLeastScale && scale <= kMostScale)) return false;
  const auto change = static_cast<float>(scale / scale_);
  for (float& value : own_among()) value *= change;
  for (float& value : onto_surface_) value *= change;
  scale_ = scale;
  stepped_pace_ = 0.0;
  return true;
}

void CondensedContact::start_between(double sum_newton) noexcept {
  if (equilibria_.size() < 2) return;
  std::size_t upper = 1;
  while (upper + 1 < equilibria_.size() && equilibria_[upper].sum_newton < sum_newton) ++upper;
  lower_ = upper - 1;
  const Equilibrium& a = equilibria_[lower_];
  const Equilibrium& b = equilibria_[upper];
  share_ = std::clamp((sum_newton - a.sum_newton) / (b.sum_newton - a.sum_newton), 0.0, 1.0);
  std::array<float, std::size_t{3} * kMostPoints> change{};
  for (std::size_t i = 0; i < static_cast<std::size_t>(count_); ++i) {
    positions_m_[i] = (1.0 - share_) * rest_of(a, i) + share_ * rest_of(b, i);
    base_forces_newton_[i] = (1.0 - share_) * a.forces_newton[i] + share_ * b.forces_newton[i];
    Eigen::Map<Eigen::Vector3f>(change.data() + 3 * i) =
        (forces_newton_[i] - base_forces_newton_[i]).cast<float>();
  }
  multiply(in_step().data(), 3 * count_, 3 * count_, change.data(), displacements_m_.data());
}

void CondensedContact::fold() {
  give_back(stepped_);
  stepped_pace_ = 0.0;
}

void CondensedContact::begin_swing(double step_s, double pace) noexcept {
  if (modal_.is_empty()) return;
  const bool is_other = modal_.set_step(step_s);
  if (!is_other && pace == stepped_pace_) return;
  stepped_.resize(among_->size());
  modal_.add_to(*among_, stride_, pace, stepped_);
  stepped_pace_ = pace;
}

// Where the points would be under the base forces. The modes are not slowed down by the viscosity
// of the rest: x + pace (base − x) shall go all their way.
void CondensedContact::add_swing(double pace) noexcept {
  if (modal_.is_empty()) return;
  const Eigen::VectorXd& after = modal_.amount_after(base_forces_newton_);
  for (std::size_t i = 0; i < static_cast<std::size_t>(count_); ++i) {
    const Vector3d moved_m = modal_.at(i, after);
    bases_m_[i] = positions_m_[i] + (moved_m - (1.0 - pace) * modal_.at(i, modal_.amount())) / pace;
    still_m_[i] += moved_m;
  }
}

/// The points between the equilibria, without the modes that move by themselves.
void CondensedContact::stand_still() noexcept {
  const bool has_two = equilibria_.size() > 1;
  for (std::size_t i = 0; i < still_m_.size(); ++i) {
    still_m_[i] = equilibria_[lower_].positions_m[i];
    if (has_two) still_m_[i] += share_ * (equilibria_[lower_ + 1].positions_m[i] - still_m_[i]);
  }
}

CondensedReport CondensedContact::step(const Vector3d& centre_m, double radius_m, int most_sweeps,
                                       double tolerance_m, double step_s) noexcept {
  CondensedReport report;
  // x + β (x − x_before)/h = what the compliance gives: x goes so far of the way there
  // with branches x + β … + Σ γ (a h + b (x − x_before)) is that, h the way that each remembers
  double hindered = 0.0;  // by the branches, over what the springs alone let go
  std::array<BranchStep, kMostBranches> steps{};
  if (step_s > 0.0) {
    for (std::size_t b = 0; b < branches_.size(); ++b) {
      steps[b] = branch_step(branches_, b, step_s);
      hindered += steps[b].stiffness * steps[b].gained;
    }
  }
  const double pace = pace_of(scale_ * relaxation_s_ + hindered * step_s, step_s);
  const std::vector<Vector3d>& bases_m = modal_.is_empty() ? positions_m_ : bases_m_;
  const Vector3d way = has_centre_ ? Vector3d(centre_m - centre_m_) : Vector3d(Vector3d::Zero());
  centre_m_ = centre_m;
  has_centre_ = true;
  begin_swing(step_s, pace);
  start_between(sum_of_forces_newton());
  if (!along_.isZero(0.0)) stand_still();
  add_swing(pace);
  for (std::size_t i = 0; i < held_m_.size(); ++i) {
    held_m_[i] = bases_m[i];
    for (std::size_t b = 0; b < branches_.size(); ++b) {
      held_m_[i] -= steps[b].stiffness * steps[b].kept * ways_m_[b][i];
    }
  }
  const SphereSweep sphere{.count = static_cast<std::size_t>(count_),
                           .compliance_m_per_newton = in_step().data(),
                           .stride = stride_,
                           .base_m = branches_.empty() ? bases_m.data() : held_m_.data(),
                           .rigid_give_m_per_newton = rigid_give_.data(),
                           .is_held = is_held_.data(),
                           .normals = normals_.data(),
                           .forces_newton = forces_newton_.data(),
                           .moved_m = displacements_m_.data(),
                           .center_m = centre_m,
                           .radius_m = radius_m,
                           .still_m = along_.isZero(0.0) ? nullptr : still_m_.data(),
                           .along = along_,
                           .axes = axes_.data(),
                           .friction_coefficient = friction_coefficient_,
                           .way_m = way,
                           .reached_m = reached_m_.data(),
                           .pace = pace};
  report.sweeps = sweep(sphere, most_sweeps, std::numeric_limits<int>::max(), tolerance_m).sweeps;
  for (std::size_t i = 0; i < static_cast<std::size_t>(count_); ++i) {
    const Vector3d before_m = reached_m_[i];
    reached_m_[i] = place_of(sphere, i);
    for (std::size_t b = 0; b < branches_.size(); ++b) {
      ways_m_[b][i] = steps[b].kept * ways_m_[b][i] + steps[b].gained * (reached_m_[i] - before_m);
    }
    report.deepest_m = std::max(report.deepest_m, radius_m - (reached_m_[i] - centre_m).norm());
    report.touching += forces_newton_[i].isZero(0.0) ? 0 : 1;
    report.force_on_sphere_newton -= forces_newton_[i];
  }
  if (!modal_.is_empty()) modal_.move(forces_newton_);
  return report;
}

void CondensedContact::move_surface(float* displacements_m) const noexcept {
  // the columns of the points whose force changed
  const auto rows = static_cast<int>(3 * compliance_->surface_nodes().size());
  std::fill_n(displacements_m, surface_stride_, 0.0F);
  for (std::size_t i = 0; i < static_cast<std::size_t>(count_); ++i) {
    const Eigen::Vector3f change = (forces_newton_[i] - base_forces_newton_[i]).cast<float>();
    if (change.isZero(0.0F)) continue;
    add_three(onto_surface_.data() + 3 * i * surface_stride_, rows, change.data(), displacements_m);
  }
  if (equilibria_.size() < 2) return;
  const float* a = equilibria_[lower_].surface_m.data();
  const float* b = equilibria_[lower_ + 1].surface_m.data();
  const auto share = static_cast<float>(share_);
  for (std::size_t i = 0; i < surface_stride_; ++i) {
    displacements_m[i] += (1.0F - share) * a[i] + share * b[i];
  }
}

}  // namespace palpate::elastic
