// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic_tissue/blade/blade_sweep.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>

namespace palpate::physics {
namespace {

// What the edge will cut next is that of the tissue so far ahead of it.
constexpr double kAhead_m = 2e-4;
// What it sweeps is summed up in steps of this length.
constexpr double kSweepStep_m = 5e-4;
constexpr double kMostSweepSteps = 64.0;
// The edge may lie in faces of the mesh, which belong to two elements: it is looked for beside
// them.
const Vector3 kBeside_m(0.61e-7, 0.37e-7, 0.43e-7);
constexpr double kNearPlane_m = 1e-6;  // and in those elements that come so near to its plane
// A surface that is not at a right angle to the blade is met by parts of the edge before its tip
// is.
constexpr double kBehind_m = 2e-3;

Vector3 node_m(const ElasticBody& body, std::uint32_t node) {
  return body.start_m.segment<3>(3 * Eigen::Index{node});
}

}  // namespace

EdgeInTissue edge_in_tissue(const ElasticBody& whole, std::span<const std::uint32_t> elements,
                            const ElasticMaterial::Pierced& tissue, const Vector3& from_m,
                            const Vector3& to_m) {
  const elastic::Mesh& mesh = whole.body->mesh();
  const Vector3 from = from_m + kBeside_m;
  const Vector3 way = to_m - from_m;
  const Vector3 low = from.cwiseMin(Vector3(from + way));
  const Vector3 high = from.cwiseMax(Vector3(from + way));
  EdgeInTissue sum;
  for (const std::uint32_t e : elements) {
    const auto nodes = mesh.element(e).first(4);
    const std::array<Vector3, 4> at_m{node_m(whole, nodes[0]), node_m(whole, nodes[1]),
                                      node_m(whole, nodes[2]), node_m(whole, nodes[3])};
    const Vector3 least = at_m[0].cwiseMin(at_m[1]).cwiseMin(at_m[2]).cwiseMin(at_m[3]);
    const Vector3 most = at_m[0].cwiseMax(at_m[1]).cwiseMax(at_m[2]).cwiseMax(at_m[3]);
    if ((least.array() > high.array()).any() || (most.array() < low.array()).any()) continue;
    // where all four barycentric coordinates, linear along the edge, are positive
    Matrix3 edges;
    edges << at_m[1] - at_m[0], at_m[2] - at_m[0], at_m[3] - at_m[0];
    const Matrix3 inverse = edges.inverse();
    const Vector3 begin = inverse * (from - at_m[0]);
    const Vector3 slope = inverse * way;
    double first = 0.0;
    double last = 1.0;
    const auto clip = [&](double value, double change) {
      if (change > 0.0) {
        first = std::max(first, -value / change);
      } else if (change < 0.0) {
        last = std::min(last, -value / change);
      } else if (value < 0.0) {
        last = -1.0;
      }
    };
    for (int i = 0; i < 3; ++i) clip(begin[i], slope[i]);
    clip(1.0 - begin.sum(), -slope.sum());
    if (!(last > first)) continue;
    const double length_m = (last - first) * way.norm();
    sum.length_m += length_m;
    sum.newton += length_m * tissue.toughness_at(from + 0.5 * (first + last) * way);
  }
  return sum;
}

void BladeSweep::begin(std::uint32_t number, const BladePlace& place, const ElasticBody& whole,
                       const std::vector<std::int32_t>& opposite, double deepest_m) {
  number_ = number;
  place_ = place;
  faces_.clear();
  elements_.clear();
  next_ = 0;
  slip_m_.setZero();
  deepest_m_ = deepest_m;
  const elastic::Mesh& mesh = whole.body->mesh();
  const Vector3 normal = place.normal();
  std::vector<char> is_left(mesh.element_count(), 0);
  for (std::size_t e = 0; e < is_left.size(); ++e) {
    double centroid_m = 0.0;  // from the plane
    double least_m = std::numeric_limits<double>::infinity();
    double most_m = -least_m;
    for (const std::uint32_t node : mesh.element(e).first(4)) {
      const double away_m = normal.dot(node_m(whole, node) - place.from_m);
      centroid_m += 0.25 * away_m;
      least_m = std::min(least_m, away_m);
      most_m = std::max(most_m, away_m);
    }
    is_left[e] = centroid_m > 0.0 ? 1 : 0;
    if (least_m <= kNearPlane_m && most_m >= -kNearPlane_m) {
      elements_.push_back(static_cast<std::uint32_t>(e));
    }
  }
  for (elastic::FaceSide side = 0; side < opposite.size(); ++side) {
    const std::int32_t other = opposite[side];
    if (other == elastic::kNoSide || static_cast<elastic::FaceSide>(other) < side) continue;
    if (is_left[side / 4] == is_left[static_cast<std::size_t>(other) / 4]) continue;
    std::array<Vector3, 3> at_m;
    for (std::size_t i = 0; i < 3; ++i) {
      const auto corner = static_cast<std::size_t>(elastic::kFaces[side % 4][i]);
      at_m[i] = node_m(whole, mesh.element(side / 4)[corner]);
    }
    const Vector3 from = (at_m[0] + at_m[1] + at_m[2]) / 3.0 - place.from_m;
    if (from.dot(place.facing) < -kBehind_m) continue;
    const Vector3 twice_area_m2 = (at_m[1] - at_m[0]).cross(at_m[2] - at_m[0]);
    faces_.push_back({.ahead_m = from.dot(place.facing),
                      .along_m = from.dot(place.along),
                      .projected_m2 = 0.5 * std::abs(normal.dot(twice_area_m2)),
                      .side = side});
  }
  std::sort(faces_.begin(), faces_.end(), [](const Crossed& a, const Crossed& b) {
    return a.ahead_m != b.ahead_m ? a.ahead_m < b.ahead_m : a.side < b.side;
  });
}

BladeSweep::Step BladeSweep::advance(const Vector3& slip_of_blade_m, const ElasticBody& whole,
                                     const AblatedBody& present,
                                     const ElasticMaterial::Pierced& tissue) {
  Step step;
  const Vector3 normal = place_.normal();
  const Vector3 slip_m = slip_of_blade_m - slip_of_blade_m.dot(normal) * normal;
  const double depth_m = slip_m.dot(place_.facing);
  const double before_m = slip_m_.dot(place_.facing);
  const double along_before_m = slip_m_.dot(place_.along);
  const double along_m = slip_m.dot(place_.along);
  for (; next_ < faces_.size() && faces_[next_].ahead_m <= depth_m; ++next_) {
    // where the end of the edge was when it passed
    const double share =
        depth_m > before_m
            ? std::clamp((faces_[next_].ahead_m - before_m) / (depth_m - before_m), 0.0, 1.0)
            : 1.0;
    const double from_along_m = along_before_m + share * (along_m - along_before_m);
    const double in_m = faces_[next_].along_m - from_along_m;
    if (in_m < 0.0 || in_m > place_.length_m) continue;
    step.sweep.cut.push_back(faces_[next_].side);
    step.sweep.cut_m2 += faces_[next_].projected_m2;
  }
  std::vector<std::uint32_t> there;
  std::set_intersection(elements_.begin(), elements_.end(), present.elements.begin(),
                        present.elements.end(), std::back_inserter(there));
  const auto edge_at = [&](const Vector3& at_m) {
    const Vector3 from = place_.from_m + at_m + kAhead_m * place_.facing;
    return edge_in_tissue(whole, there, tissue, from, from + place_.length_m * place_.along);
  };
  step.ahead = edge_at(slip_m);
  const double further_m = std::max(0.0, depth_m - deepest_m_);
  if (further_m > 0.0) {
    // the part of the way that is beyond what was cut, from its end backward
    const Vector3 way_m = further_m < depth_m - before_m
                              ? Vector3(further_m / (depth_m - before_m) * (slip_m - slip_m_))
                              : Vector3(slip_m - slip_m_);
    const double steps = std::clamp(std::ceil(further_m / kSweepStep_m), 1.0, kMostSweepSteps);
    for (double i = 0.5; i < steps; ++i) {
      const EdgeInTissue edge = steps > 1.0 ? edge_at(slip_m - i / steps * way_m) : step.ahead;
      step.sweep.swept_m2 += further_m / steps * edge.length_m;
      step.sweep.joule += further_m / steps * edge.newton;
    }
  }
  slip_m_ = slip_m;
  deepest_m_ += further_m;
  step.ahead.deepest_m = deepest_m_;
  step.sweep.from_m = from_m();
  step.sweep.to_m = to_m();
  return step;
}

void sweep_with(const Jaw& held, const Vector3& slip_m, const GripperConfig& blade,
                const ElasticBody& whole, std::size_t tool, Ablation& ablation, BladeSweep& sweep,
                EdgeInTissue& edge) {
  const GripModel& model = held.model();
  if (!model.is_holding()) return sweep.end();
  if (sweep.number() != model.number) {
    sweep.begin(model.number, held.blade(), whole, ablation.opposite_sides(), held.deepest_m());
  }
  const Vector3 in_tissue_m = held.slip_in_tissue_m(slip_m);
  const BladeSweep::Step step =
      sweep.advance(in_tissue_m, whole, ablation.present(), *whole.pierced);
  ablation.cut(tool, step.sweep, blade.reach_m);
  edge = step.ahead;
  edge.cut_joule = step.sweep.joule;
  // at the surface, where it has come in, less of the edge may be in than the tip has pressed in
  if (in_tissue_m.dot(held.blade().facing) < blade.needle_width_m) {
    edge.length_m = std::max(edge.length_m, blade.needle_width_m);
    edge.newton =
        std::max(edge.newton, blade.needle_width_m * whole.pierced->toughness_at(sweep.from_m()));
  }
}

void fit_blade(const ElasticMaterial::Pierced& tissue, const EdgeInTissue& edge,
               const Vector3& along, NeedleLaw& law) noexcept {
  law.edge_world = along;
  law.cutting_newton = std::min(edge.newton, kMaxTissueForceNewton);
  law.spreading_newton =
      std::min(tissue.spreading_ratio * law.cutting_newton, kMaxTissueForceNewton);
  law.friction_newton_per_m = 0.0;
  law.friction_newton =
      std::min(tissue.friction_newton_per_m * edge.length_m, kMaxTissueForceNewton);
}

}  // namespace palpate::physics
