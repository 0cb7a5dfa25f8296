// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/sphere_contact.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <utility>

namespace palpate::elastic {
namespace {

// Half the angle of the cone of a point's normals in a step: 60°.
constexpr double kConeCosine = 0.5;
constexpr double kConeSine = 0.8660254037844386;
// A round that leaves more than this of what the one before left makes the points that are too far
// so many times as stiff, and none more than kMostStiffer times, while the sphere moves by less
// than so much in a step: a stiffer one crumples a body that is pressed on rather than let it fail.
constexpr double kStillRadii = 0.02;
constexpr double kStuck = 0.5;
constexpr double kStiffer = 4.0;
constexpr double kMostStiffer = 64.0;

struct FaceCorners {
  Vector3d a;
  Vector3d b;
  Vector3d c;
};

FaceCorners corners_of(const SurfacePoint& point, const double* x_m) {
  const auto corner = [&](std::size_t k) {
    return Vector3d(Eigen::Map<const Vector3d>(x_m + 3 * std::size_t{point.nodes[k]}));
  };
  return {corner(0), corner(1), corner(2)};
}

}  // namespace

std::vector<SurfacePoint> surface_points(const Mesh& mesh, const std::vector<Face>& faces,
                                         int per_edge) {
  std::vector<SurfacePoint> points;
  const double n = per_edge;
  for (const Face& face : faces) {
    const Vector3d& a = mesh.nodes_m[face.nodes[0]];
    const double area =
        0.5 * (mesh.nodes_m[face.nodes[1]] - a).cross(mesh.nodes_m[face.nodes[2]] - a).norm() /
        (n * n);
    const auto add = [&](double l1, double l2) {
      const double l0 = 1.0 - l1 - l2;
      SurfacePoint point{.nodes = face.nodes, .count = 3, .area_m2 = area};
      point.weights = {l0, l1, l2};
      if (mesh.nodes_per_element == 10) {
        point.count = 6;
        point.weights = {l0 * (2 * l0 - 1), l1 * (2 * l1 - 1), l2 * (2 * l2 - 1),
                         4 * l0 * l1,       4 * l1 * l2,       4 * l2 * l0};
      }
      points.push_back(point);
    };
    for (int i = 0; i < per_edge; ++i) {
      for (int j = 0; i + j < per_edge; ++j) {
        add((i + 1.0 / 3.0) / n, (j + 1.0 / 3.0) / n);
        if (i + j + 2 <= per_edge) add((i + 2.0 / 3.0) / n, (j + 2.0 / 3.0) / n);
      }
    }
  }
  return points;
}

void SurfacePoint::add_stiffness(const Eigen::Matrix3d& stiffness, const BlockPattern& pattern,
                                 BlockValues& values) const {
  for (std::size_t a = 0; a < static_cast<std::size_t>(count); ++a) {
    const std::int32_t row = pattern.row_of[nodes[a]];
    for (std::size_t b = 0; b < static_cast<std::size_t>(count) && row >= 0; ++b) {
      const std::int32_t column = pattern.row_of[nodes[b]];
      if (column < 0 || column > row) continue;
      double* block =
          values.data() + 9 * std::size_t{pattern.slot(static_cast<std::uint32_t>(row),
                                                       static_cast<std::uint32_t>(column))};
      Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(block) +=
          weights[a] * weights[b] * stiffness;
    }
  }
}

SphereContact::SphereContact(std::vector<SurfacePoint> points, double stiffness_pa_per_m,
                             const BlockPattern* pattern)
    : points_(std::make_shared<const std::vector<SurfacePoint>>(std::move(points))),
      multipliers_pa_(points_->size(), 0.0),
      stiffnesses_pa_per_m_(points_->size(), stiffness_pa_per_m),
      near_(points_->size()),
      sides_(points_->size(), Side::kUnknown),
      cones_(points_->size(), Vector3d::Zero()),
      stiffness_pa_per_m_(stiffness_pa_per_m) {
  std::vector<char> is_held(points_->size(), 0);
  for (std::size_t i = 0; pattern != nullptr && i < is_held.size(); ++i) {
    is_held[i] = (*points_)[i].is_held(*pattern) ? 1 : 0;
  }
  is_held_ = std::make_shared<const std::vector<char>>(std::move(is_held));
  std::iota(near_.begin(), near_.end(), 0U);
}

void SphereContact::forget() noexcept {
  std::fill(multipliers_pa_.begin(), multipliers_pa_.end(), 0.0);
  std::fill(stiffnesses_pa_per_m_.begin(), stiffnesses_pa_per_m_.end(), stiffness_pa_per_m_);
  std::fill(sides_.begin(), sides_.end(), Side::kUnknown);
  seen_from_m_.reset();
  settled_from_m_.reset();
  near_.clear();
  settled_.clear();
}

void SphereContact::continue_as(const SphereContact& other,
                                const std::vector<std::int32_t>& old_points) {
  forget();
  set_sphere(other.centre_m_, other.radius_m_);
  seen_from_m_ = other.seen_from_m_;
  settled_from_m_ = other.settled_from_m_;
  nearest_m_ = other.nearest_m_;
  for (std::uint32_t i = 0; i < old_points.size(); ++i) {
    if (old_points[i] < 0) continue;
    const auto old = static_cast<std::size_t>(old_points[i]);
    multipliers_pa_[i] = other.multipliers_pa_[old];
    stiffnesses_pa_per_m_[i] = other.stiffnesses_pa_per_m_[old];
    sides_[i] = other.sides_[old];
    cones_[i] = other.cones_[old];
  }
}

/// Since the last step.
bool SphereContact::is_still() const noexcept {
  return settled_from_m_ && (centre_m_ - *settled_from_m_).norm() <= kStillRadii * radius_m_;
}

void SphereContact::choose_near(const double* x_m, double margin_m) {
  near_.clear();
  if (!is_still()) {
    std::fill(stiffnesses_pa_per_m_.begin(), stiffnesses_pa_per_m_.end(), stiffness_pa_per_m_);
  }
  const double reach_m = radius_m_ + margin_m;
  nearest_m_ = std::numeric_limits<double>::infinity();
  bool is_face_near = false;
  Vector3d face_normal;
  for (std::uint32_t i = 0; i < points_->size(); ++i) {
    if (i == 0 || (*points_)[i].nodes != (*points_)[i - 1].nodes) {  // a face's points are together
      const FaceCorners corners = corners_of((*points_)[i], x_m);
      const double longest_m =
          std::max({(corners.b - corners.a).norm(), (corners.c - corners.b).norm(),
                    (corners.a - corners.c).norm()});
      const double from_m = (corners.a - centre_m_).norm();
      is_face_near = from_m < reach_m + 1.5 * longest_m;
      if (is_face_near) {
        face_normal = (*points_)[i].outward(x_m);
      } else {
        nearest_m_ = std::min(nearest_m_, from_m - longest_m);
      }
    }
    const Vector3d at_m = is_face_near ? (*points_)[i].position_m(x_m) : Vector3d::Zero();
    const double distance_m = is_face_near ? (at_m - centre_m_).norm() : reach_m;
    if (is_face_near) nearest_m_ = std::min(nearest_m_, distance_m);
    if (distance_m < reach_m) {
      if (look_at(i, at_m, face_normal)) {
        near_.push_back(i);
      } else {
        multipliers_pa_[i] = 0.0;
      }
    } else {
      sides_[i] = Side::kUnknown;
      multipliers_pa_[i] = 0.0;
      stiffnesses_pa_per_m_[i] = stiffness_pa_per_m_;
    }
  }
  seen_from_m_ = centre_m_;
}

// Whether the point may touch the sphere, and the axis of its cone.
bool SphereContact::look_at(std::size_t point, const Vector3d& at_m,
                            const Vector3d& face_normal) noexcept {
  const Vector3d away = at_m - centre_m_;
  const double distance_m = away.norm();
  if (sides_[point] == Side::kUnknown) {
    // from where the sphere was before
    cones_[point] = (at_m - seen_from_m_.value_or(centre_m_)).normalized();
    sides_[point] = cones_[point].dot(face_normal) < 0.0 ? Side::kFacing : Side::kHidden;
  }
  // what is outside may be seen from another side than before
  if (distance_m > radius_m_) {
    cones_[point] = away / distance_m;
    sides_[point] = cones_[point].dot(face_normal) < 0.0 ? Side::kFacing : Side::kHidden;
  } else if (distance_m > 0.5 * radius_m_ && cones_[point].dot(away) > 0.0) {
    cones_[point] = away / distance_m;
  }
  // what is fixed does not turn away from a sphere that is pressed into it
  if ((*is_held_)[point] != 0 && distance_m <= radius_m_ && sides_[point] == Side::kFacing) {
    cones_[point] = -face_normal;
  }
  return sides_[point] == Side::kFacing;
}

SphereContact::Touch SphereContact::touch(std::size_t point, const double* x_m) const noexcept {
  const Vector3d away = (*points_)[point].position_m(x_m) - centre_m_;
  const Vector3d& axis = cones_[point];
  const double distance = away.norm();
  Touch touch{.normal = distance > 0.0 ? Vector3d(away / distance) : Vector3d(Vector3d::UnitZ()),
              .gap_m = distance - radius_m_,
              .distance_m = distance,
              .pressure_pa = 0.0};
  const double along = axis.dot(away);
  if (sides_[point] == Side::kFacing && along <= kConeCosine * distance) {
    const Vector3d sideways = away - along * axis;
    const double width = sideways.norm();
    touch.normal = width > 0.0 ? Vector3d(kConeCosine * axis + kConeSine / width * sideways) : axis;
    touch.gap_m = touch.normal.dot(away) - radius_m_;
    touch.distance_m = 0.0;
  }
  touch.pressure_pa =
      std::max(0.0, multipliers_pa_[point] - stiffnesses_pa_per_m_[point] * touch.gap_m);
  return touch;
}

double SphereContact::add_gradient(const double* x_m, double* gradient) const {
  double energy = 0.0;
  for (const std::uint32_t i : near_) {
    const Touch at = touch(i, x_m);
    const SurfacePoint& point = (*points_)[i];
    const double multiplier = multipliers_pa_[i];
    energy += point.area_m2 * (at.pressure_pa * at.pressure_pa - multiplier * multiplier) /
              (2.0 * stiffnesses_pa_per_m_[i]);
    if (at.pressure_pa == 0.0) continue;
    const Vector3d force = -point.area_m2 * at.pressure_pa * at.normal;
    for (std::size_t a = 0; a < static_cast<std::size_t>(point.count); ++a) {
      Eigen::Map<Vector3d>(gradient + 3 * std::size_t{point.nodes[a]}) += point.weights[a] * force;
    }
  }
  return energy;
}

void SphereContact::add_stiffness(const double* x_m, const BlockPattern& pattern,
                                  BlockValues& values) const {
  add_blocks(x_m, pattern, false, values);
}

void SphereContact::add_exact_stiffness(const double* x_m, const BlockPattern& pattern,
                                        BlockValues& values) const {
  add_blocks(x_m, pattern, true, values);
}

void SphereContact::add_blocks(const double* x_m, const BlockPattern& pattern, bool is_exact,
                               BlockValues& values) const {
  for (const std::uint32_t i : near_) {
    const Touch at = touch(i, x_m);
    if (at.pressure_pa == 0.0) continue;
    const SurfacePoint& point = (*points_)[i];
    Eigen::Matrix3d stiffness =
        point.area_m2 * stiffnesses_pa_per_m_[i] * at.normal * at.normal.transpose();
    // the normal turns when the point slides: that part is negative
    if (is_exact && at.distance_m > 0.0) {
      stiffness -= point.area_m2 * at.pressure_pa / at.distance_m *
                   (Eigen::Matrix3d::Identity() - at.normal * at.normal.transpose());
    }
    point.add_stiffness(stiffness, pattern, values);
  }
}

double SphereContact::multiplier_after(const Touch& at, std::uint32_t point,
                                       const BlockPattern& pattern) const {
  return (*points_)[point].is_held(pattern)
             ? 0.0
             : std::min(at.pressure_pa, 2.0 * radius_m_ * stiffness_pa_per_m_);
}

bool SphereContact::begin_round(const double* x_m, const BlockPattern& pattern) {
  double worst_m = 0.0;
  std::vector<std::uint32_t> far;
  for (const std::uint32_t i : near_) {
    const Touch at = touch(i, x_m);
    if (at.pressure_pa == 0.0 || (*points_)[i].is_held(pattern)) continue;
    worst_m = std::max(worst_m, std::abs(at.gap_m));
    if (std::abs(at.gap_m) > kClose * radius_m_) far.push_back(i);
  }
  if (far.empty()) return false;
  for (const std::uint32_t i : near_) {
    multipliers_pa_[i] = multiplier_after(touch(i, x_m), i, pattern);
  }
  if (worst_m > kStuck * last_worst_m_ && is_still()) {
    const double most_pa_per_m = kMostStiffer * stiffness_pa_per_m_;
    for (const std::uint32_t i : far) {
      stiffnesses_pa_per_m_[i] = std::min(kStiffer * stiffnesses_pa_per_m_[i], most_pa_per_m);
    }
  }
  last_worst_m_ = worst_m;
  return true;
}

double SphereContact::update_multipliers(const double* x_m, const BlockPattern& pattern) {
  double deepest_m = 0.0;
  last_worst_m_ = kNoRound;
  settled_from_m_ = centre_m_;
  settled_.clear();
  for (const std::uint32_t i : near_) {
    const Touch at = touch(i, x_m);
    const SurfacePoint& point = (*points_)[i];
    deepest_m = std::max(deepest_m, -at.gap_m);
    multipliers_pa_[i] = multiplier_after(at, i, pattern);
    if (at.pressure_pa == 0.0) continue;
    settled_.push_back({.point = i,
                        .force_on_body_newton = point.area_m2 * at.pressure_pa * at.normal,
                        .facing = -at.normal.dot(point.outward(x_m))});
  }
  return deepest_m;
}

Vector3d SphereContact::force_on_sphere_newton() const {
  Vector3d force = Vector3d::Zero();
  for (const Settled& one : settled_) force -= one.force_on_body_newton;
  return force;
}

std::vector<Vector3d> SphereContact::forces_on_body_newton() const {
  std::vector<Vector3d> forces(points_->size(), Vector3d::Zero());
  for (const Settled& one : settled_) forces[one.point] = one.force_on_body_newton;
  return forces;
}

std::size_t SphereContact::touching() const { return settled_.size(); }

double SphereContact::facing() const {
  double sum = 0.0;
  double weight = 0.0;
  for (const Settled& one : settled_) {
    const double newton = one.force_on_body_newton.norm();
    sum += newton * one.facing;
    weight += newton;
  }
  return weight > 0.0 ? sum / weight : 1.0;
}

}  // namespace palpate::elastic
