#include "physics_node/elastic/sphere_contact.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace palpate::elastic {

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

SphereContact::SphereContact(std::vector<SurfacePoint> points, double stiffness_pa_per_m)
    : points_(std::move(points)),
      multipliers_pa_(points_.size(), 0.0),
      near_(points_.size()),
      stiffness_pa_per_m_(stiffness_pa_per_m) {
  std::iota(near_.begin(), near_.end(), 0U);
}

void SphereContact::choose_near(const double* x_m, double margin_m) {
  near_.clear();
  const double reach_m = radius_m_ + margin_m;
  const auto corner = [&](std::uint32_t i, std::size_t k) {
    return Eigen::Map<const Vector3d>(x_m + 3 * std::size_t{points_[i].nodes[k]});
  };
  bool is_face_near = false;
  for (std::uint32_t i = 0; i < points_.size(); ++i) {
    if (i == 0 || points_[i].nodes != points_[i - 1].nodes) {  // a face's points are together
      const double longest_m =
          std::max({(corner(i, 1) - corner(i, 0)).norm(), (corner(i, 2) - corner(i, 1)).norm(),
                    (corner(i, 0) - corner(i, 2)).norm()});
      is_face_near = (corner(i, 0) - centre_m_).norm() < reach_m + 1.5 * longest_m;
    }
    if (is_face_near &&
        (points_[i].position_m(x_m) - centre_m_).squaredNorm() < reach_m * reach_m) {
      near_.push_back(i);
    } else {
      multipliers_pa_[i] = 0.0;
    }
  }
}

SphereContact::Touch SphereContact::touch(std::size_t point, const double* x_m) const noexcept {
  const Vector3d away = points_[point].position_m(x_m) - centre_m_;
  const double distance = away.norm();
  Touch touch{.normal = distance > 0.0 ? Vector3d(away / distance) : Vector3d(Vector3d::UnitZ()),
              .gap_m = distance - radius_m_,
              .distance_m = distance,
              .pressure_pa = 0.0};
  touch.pressure_pa = std::max(0.0, multipliers_pa_[point] - stiffness_pa_per_m_ * touch.gap_m);
  return touch;
}

double SphereContact::add_gradient(const double* x_m, double* gradient) const {
  double energy = 0.0;
  for (const std::uint32_t i : near_) {
    const Touch at = touch(i, x_m);
    const SurfacePoint& point = points_[i];
    const double multiplier = multipliers_pa_[i];
    energy += point.area_m2 * (at.pressure_pa * at.pressure_pa - multiplier * multiplier) /
              (2.0 * stiffness_pa_per_m_);
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
    const SurfacePoint& point = points_[i];
    Eigen::Matrix3d stiffness =
        point.area_m2 * stiffness_pa_per_m_ * at.normal * at.normal.transpose();
    // the normal turns when the point slides: that part is negative
    if (is_exact && at.distance_m > 0.0) {
      stiffness -= point.area_m2 * at.pressure_pa / at.distance_m *
                   (Eigen::Matrix3d::Identity() - at.normal * at.normal.transpose());
    }
    for (std::size_t a = 0; a < static_cast<std::size_t>(point.count); ++a) {
      const std::int32_t row = pattern.row_of[point.nodes[a]];
      for (std::size_t b = 0; b < static_cast<std::size_t>(point.count) && row >= 0; ++b) {
        const std::int32_t column = pattern.row_of[point.nodes[b]];
        if (column < 0 || column > row) continue;
        double* block =
            values.data() + 9 * std::size_t{pattern.slot(static_cast<std::uint32_t>(row),
                                                         static_cast<std::uint32_t>(column))};
        Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(block) +=
            point.weights[a] * point.weights[b] * stiffness;
      }
    }
  }
}

double SphereContact::update_multipliers(const double* x_m) {
  double deepest_m = 0.0;
  for (const std::uint32_t i : near_) {
    const Touch at = touch(i, x_m);
    deepest_m = std::max(deepest_m, -at.gap_m);
    multipliers_pa_[i] = at.pressure_pa;
  }
  return deepest_m;
}

Vector3d SphereContact::force_on_sphere_newton(const double* x_m) const {
  Vector3d force = Vector3d::Zero();
  for (const std::uint32_t i : near_) {
    const Touch at = touch(i, x_m);
    force -= points_[i].area_m2 * at.pressure_pa * at.normal;
  }
  return force;
}

std::vector<Vector3d> SphereContact::forces_on_body_newton(const double* x_m) const {
  std::vector<Vector3d> forces(points_.size(), Vector3d::Zero());
  for (const std::uint32_t i : near_) {
    const Touch at = touch(i, x_m);
    forces[i] = points_[i].area_m2 * at.pressure_pa * at.normal;
  }
  return forces;
}

std::size_t SphereContact::touching(const double* x_m) const {
  std::size_t count = 0;
  for (const std::uint32_t i : near_)
    count += static_cast<std::size_t>(touch(i, x_m).pressure_pa > 0.0);
  return count;
}

}  // namespace palpate::elastic
