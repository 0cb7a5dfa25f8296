// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic_tissue/patch/patch_maker.h"

#include <algorithm>
#include <cmath>

#include "common/core/tissue.h"

namespace palpate::physics {
namespace {

// Faces turned farther away from the tip's side than this do not touch it: cos 84°.
constexpr double kLeastTowardsTip = 0.1;
// The longest way ahead for which there are points enough beside it.
constexpr double kLongestWayRadii = 3.0;
constexpr double kFarthestRadii = 8.0;
// A point that is there is given up for one that is nearer by this share.
constexpr double kKeepShare = 0.85;
// New columns of the compliance in a solution, three solutions of the factor each.
constexpr int kMostColumns = 24;
// So much more than rounding takes off the diagonal.
constexpr int kRounding = 2;
// The way of a viscous point that is still to go.
constexpr double kFarthestRest_m = 0.5;

std::int16_t integer_of(double value) {
  return static_cast<std::int16_t>(std::lround(std::clamp(value, -kElasticScale, kElasticScale)));
}

}  // namespace

PatchMaker::PatchMaker(const ElasticBody& body, elastic::SurfaceCompliance& compliance,
                       double tip_radius_m)
    : body_(body), compliance_(compliance), tip_radius_m_(tip_radius_m) {
  slot_of_.assign(body.points.size(), -1);
  patch_.slots.resize(kElasticSlots);
  patch_.state.tissue = body.tissue;
  patch_.state.tip_radius_m = tip_radius_m;
  patch_.state.friction_coefficient = body.friction_coefficient;
  patch_.state.relaxation_s =
      std::min(body.prompt_ratio * body.viscosity_s, kMaxElasticRelaxationS);
  patch_.state.friction_stiffness_newton_per_m = body.shear_newton_per_m;
}

/// The points that the tip may touch, in order.
void PatchMaker::gather(const ElasticSimulation::Touch& touch, const elastic::VectorXd& x_m) {
  const ElasticState& state = patch_.state;
  candidates_.clear();
  double facing = 1.0;
  const double farthest_m = kFarthestRadii * tip_radius_m_;
  for (std::uint32_t p = 0; p < body_.points.size(); ++p) {
    const elastic::SurfacePoint& point = body_.points[p];
    const bool is_pressed =
        !touch.forces_on_body_newton.empty() && !touch.forces_on_body_newton[p].isZero(0.0);
    if (p == 0 || point.nodes != body_.points[p - 1].nodes) {  // a face's points are together
      facing = point.outward(x_m.data()).dot(state.normal);
    }
    if (facing < kLeastTowardsTip && !is_pressed) continue;
    const Vector3 at_m = place_m(p, x_m);
    const double distance_m = elastic_distance_m(state.normal, state.from_m, state.to_m, at_m);
    if (distance_m > farthest_m && !is_pressed) continue;
    const double order_m = is_pressed ? -1.0 : (slot_of_[p] >= 0 ? kKeepShare : 1.0) * distance_m;
    candidates_.push_back({.order_m = order_m, .distance_m = distance_m, .point = p});
  }
  std::sort(candidates_.begin(), candidates_.end(), [](const Candidate& a, const Candidate& b) {
    return a.order_m < b.order_m || (a.order_m == b.order_m && a.point < b.point);
  });
}

/// Its columns are there, or are to be made.
bool PatchMaker::is_ready(std::uint32_t point, int& most_columns) {
  const elastic::SurfacePoint& at = body_.points[point];
  for (std::size_t a = 0; a < static_cast<std::size_t>(at.count); ++a) {
    if (std::find(nodes_.begin(), nodes_.end(), at.nodes[a]) != nodes_.end()) continue;
    if (!compliance_.has_columns(at.nodes[a])) {
      if (most_columns <= 0) return false;
      --most_columns;
    }
    nodes_.push_back(at.nodes[a]);
  }
  return true;
}

/// Makes the columns of nodes_, and keeps those of the points that are there.
void PatchMaker::require() {
  for (const std::optional<std::uint32_t>& point : point_in_) {
    if (point) body_.points[*point].add_nodes_to(nodes_);
  }
  columns_ = compliance_.require(nodes_);
  nodes_.clear();
}

/// Displacement of a point under a force at another one, within a period of full solutions.
Eigen::Matrix3d PatchMaker::give(std::uint32_t at, std::uint32_t under) const {
  return body_.prompt_ratio * compliance_.give(body_.points[at], body_.points[under], columns_);
}

void PatchMaker::assign(std::uint32_t slot, std::uint32_t index) {
  if (point_in_[slot]) slot_of_[*point_in_[slot]] = -1;
  point_in_[slot] = index;
  slot_of_[index] = static_cast<std::int16_t>(slot);
  pressed_at_[slot] = 0;
  ElasticPoint& point = patch_.slots[slot].point;
  point = {.slot = slot, .version = next_version_++};
  const elastic::SurfacePoint& at = body_.points[index];
  point.rest_m = at.position_m(body_.start_m.data());
  constexpr double kLeastArea_m2 = 1e-12;
  point.rigid_give_m_per_newton = static_cast<float>(
      std::clamp(1.0 / (body_.contact_stiffness_pa_per_m * std::max(at.area_m2, kLeastArea_m2)),
                 kMinComplianceMPerNewton, kMaxComplianceMPerNewton));
  // the blocks, then their step
  std::array<Eigen::Matrix3d, kElasticSlots> blocks;
  const Eigen::Matrix3d computed = give(index, index);
  Eigen::Matrix3d own = 0.5 * (computed + computed.transpose());
  point.is_held = at.is_held(body_.body->pattern());
  double largest = own.cwiseAbs().maxCoeff();
  for (std::size_t other = 0; other < kElasticSlots; ++other) {
    if (other == slot || !point_in_[other]) continue;
    point.has_other.set(other);
    blocks[other] = give(*point_in_[other], index);
    largest = std::max(largest, blocks[other].cwiseAbs().maxCoeff());
  }
  const double step =
      std::clamp(largest, 2.0 * kMinComplianceMPerNewton, kMaxComplianceMPerNewton) *
      kElasticScale / (kElasticScale - kRounding);
  point.step_m_per_newton = static_cast<float>(std::min(step, kMaxComplianceMPerNewton));
  const double scale = kElasticScale / static_cast<double>(point.step_m_per_newton);
  constexpr std::array<std::array<Eigen::Index, 2>, 6> kPlaces{
      {{0, 0}, {0, 1}, {0, 2}, {1, 1}, {1, 2}, {2, 2}}};
  for (std::size_t k = 0; k < kPlaces.size(); ++k) {
    const auto [row, column] = kPlaces[k];
    point.own[k] = integer_of(scale * own(row, column) + (row == column ? kRounding : 0));
  }
  for (std::size_t other = 0; other < kElasticSlots; ++other) {
    if (!point.has_other[other]) continue;
    for (std::size_t k = 0; k < 9; ++k) {
      point.others[other][k] = integer_of(scale * blocks[other](static_cast<Eigen::Index>(k / 3),
                                                                static_cast<Eigen::Index>(k % 3)));
    }
  }
}

void PatchMaker::update(const Tip& tip, const ElasticSimulation::Touch& touch,
                        const elastic::VectorXd& x_m, const elastic::VectorXd& v_m_per_s,
                        bool is_alone) {
  ElasticState& state = patch_.state;
  state.normal = tip.normal.normalized();
  // the end of the way ahead, from the feet of the tip
  Vector3 along_m = tip.ahead_m - state.normal * state.normal.dot(tip.ahead_m);
  state.carried_m = tip.carried_m;
  state.carried_m_per_s = tip.carried_m_per_s;
  state.carried_at_s = tip.carried_at_s;
  state.from_m = tip.tip_m - state.carried_m - std::max(tip.gap_m, tip_radius_m_) * state.normal;
  state.to_m = state.from_m + along_m;
  along_m = limited_to_norm(along_m, kLongestWayRadii * tip_radius_m_);
  state.from_m = state.to_m - along_m;
  gather(touch, x_m);

  // the wanted ones, and how far all are there
  int most_columns = kMostColumns;
  is_complete_ = true;
  std::vector<std::uint32_t> missing;
  std::bitset<kElasticSlots> is_wanted;
  state.radius_m = kFarthestRadii * tip_radius_m_;
  // mofc_node may still press on a point that was pressed a loop ago
  const auto is_held = [&](std::uint32_t one) {
    return pressed_at_[one] > 0 && state.number < pressed_at_[one] + tip.held_solutions;
  };
  std::size_t room = 0;
  for (std::uint32_t slot = 0; slot < kElasticSlots; ++slot) room += is_held(slot) ? 0U : 1U;
  std::size_t count = 0;
  for (const Candidate& one : candidates_) {
    const std::int16_t slot = slot_of_[one.point];
    if (slot >= 0 && is_held(static_cast<std::uint32_t>(slot))) continue;
    // no point is nearer than its place in the order
    if (count == room && one.order_m >= state.radius_m) break;
    if (count == room || (slot < 0 && !is_ready(one.point, most_columns))) {
      state.radius_m = std::min(state.radius_m, one.distance_m);
      is_complete_ = is_complete_ && count == room;
      continue;
    }
    ++count;
    if (slot >= 0) {
      is_wanted.set(static_cast<std::size_t>(slot));
    } else {
      missing.push_back(one.point);
    }
  }
  require();
  // first the slots that were never used
  std::uint32_t slot = 0;
  const auto next_slot = [&](bool is_used) {
    while (slot < kElasticSlots &&
           (is_wanted[slot] || is_held(slot) || (point_in_[slot].has_value() && !is_used))) {
      ++slot;
    }
    return slot < kElasticSlots;
  };
  bool is_used = false;
  for (const std::uint32_t point : missing) {
    if (!next_slot(is_used)) {
      is_used = true;
      slot = 0;
      if (!next_slot(is_used)) break;
    }
    is_wanted.set(slot);
    assign(slot, point);
  }
  describe(touch, x_m, v_m_per_s, is_alone);
  if (!tip.is_void) return;
  state.radius_m = 0.0;
  state.places.fill({});
}

/// The compliance between the untouched body and a state of it, so that it does the work of the
/// elastic part of the forces there, as a multiple of that at rest; 0: it is none.
/// @see CondensedContact::scale_compliance
double PatchMaker::ratio_of(const std::array<Vector3, kElasticSlots>& forces,
                            const std::array<Vector3, kElasticSlots>& ways_m,
                            const std::array<Vector3, kElasticSlots>& rates_m) const {
  double found = 0.0;
  double expected = 0.0;
  for (std::size_t j = 0; j < kElasticSlots; ++j) {
    if (!point_in_[j] || forces[j].isZero(0.0)) continue;
    found += forces[j].dot(ways_m[j]);
    expected -= forces[j].dot(rates_m[j]);
    for (std::size_t i = 0; i < kElasticSlots; ++i) {
      if (!point_in_[i] || forces[i].isZero(0.0)) continue;
      expected += forces[i].dot(give(*point_in_[i], *point_in_[j]) * forces[j]);
    }
  }
  const double ratio = found / expected;
  return ratio >= kMinComplianceRatio && ratio <= kMaxComplianceRatio ? ratio : 0.0;
}

/// The state at the points, and what the others press.
void PatchMaker::describe(const ElasticSimulation::Touch& touch, const elastic::VectorXd& x_m,
                          const elastic::VectorXd& v_m_per_s, bool is_alone) {
  ElasticState& state = patch_.state;
  ++state.number;
  state.center_m = touch.centre_m - state.carried_m;
  state.force_outside_patch_newton = touch.force_on_tool_newton;
  state.places.fill({});
  const bool has_forces = !touch.forces_on_body_newton.empty();
  std::array<Vector3, kElasticSlots> away;
  std::array<Vector3, kElasticSlots> ways_m;   // from the untouched body
  std::array<Vector3, kElasticSlots> rates_m;  // in a relaxation time
  std::array<Vector3, kElasticSlots> forces;
  double largest_newton = 1e-12;
  for (std::size_t slot = 0; slot < kElasticSlots; ++slot) {
    if (!point_in_[slot]) continue;
    const elastic::SurfacePoint& point = body_.points[*point_in_[slot]];
    forces[slot] =
        has_forces ? touch.forces_on_body_newton[*point_in_[slot]] : Vector3(Vector3::Zero());
    const Vector3 at_m = place_m(*point_in_[slot], x_m);
    patch_.slots[slot].distance_m =
        elastic_distance_m(state.normal, state.from_m, state.to_m, at_m);
    away[slot] = at_m - state.from_m;
    ways_m[slot] = at_m - patch_.slots[slot].point.rest_m;
    rates_m[slot] =
        state.relaxation_s * (point.position_m(v_m_per_s.data()) - state.carried_m_per_s);
    if (!forces[slot].isZero(0.0)) {
      patch_.slots[slot].distance_m = -1.0;
      pressed_at_[slot] = state.number;
    }
    state.force_outside_patch_newton += forces[slot];
    largest_newton = std::max(largest_newton, forces[slot].cwiseAbs().maxCoeff());
  }
  if (state.force_outside_patch_newton.norm() < 1e-9) state.force_outside_patch_newton.setZero();
  // what has relaxed is on no way between the untouched body and this state
  const bool is_on_way =
      is_alone && body_.prompt_ratio == 1.0 && !touch.force_on_tool_newton.isZero(0.0);
  const double ratio = is_on_way ? ratio_of(forces, ways_m, rates_m) : 0.0;
  state.has_rest = ratio > 0.0;
  state.compliance_ratio = state.has_rest ? ratio : 1.0;

  double farthest_m = 1e-9;
  std::array<Vector3, kElasticSlots> rests;
  for (std::size_t slot = 0; slot < kElasticSlots; ++slot) {
    if (!point_in_[slot]) continue;
    rests[slot] =
        away[slot] + limited_to_norm(state.compliance_ratio * rates_m[slot], kFarthestRest_m);
    farthest_m =
        std::max({farthest_m, away[slot].cwiseAbs().maxCoeff(), rests[slot].cwiseAbs().maxCoeff()});
  }
  // rounding up, so that no integer exceeds the scale
  constexpr double kUp = 1.000001;
  state.away_step_m = static_cast<float>(farthest_m * kUp);
  state.force_step_newton =
      static_cast<float>(std::min(largest_newton * kUp, kMaxTissueForceNewton));
  const auto put = [](const Vector3& value, float step, std::array<std::int16_t, 3>& to) {
    for (std::size_t k = 0; k < 3; ++k) {
      to[k] = integer_of(value[static_cast<Eigen::Index>(k)] * kElasticScale /
                         static_cast<double>(step));
    }
  };
  for (std::size_t slot = 0; slot < kElasticSlots; ++slot) {
    if (!point_in_[slot]) continue;
    ElasticPlace& place = state.places[slot];
    place.version = patch_.slots[slot].point.version;
    put(away[slot], state.away_step_m, place.away);
    put(rests[slot], state.away_step_m, place.rest);
    put(forces[slot], state.force_step_newton, place.force);
  }
}

}  // namespace palpate::physics
