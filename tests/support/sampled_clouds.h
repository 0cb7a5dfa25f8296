// SPDX-License-Identifier: Apache-2.0
// sampled_clouds.h — clouds sampled from shapes whose distance has a closed form.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "common/contact/analytic_surfaces.h"
#include "common/core/random.h"
#include "physics_node/surfaces/cloud_surface.h"

namespace palpate::test {

/// A shape that knows its distance, and how to put a point on itself.
struct Shape {
  std::string name;
  double area_m2 = 0.0;
  std::function<SurfaceView(const Vector3&)> view;
  /// A point of the surface for (s, t) in [0, 1)², spread evenly over its area.
  std::function<Vector3(double, double)> point;
  /// Is the point far enough from the border of an open shape to be judged?
  std::function<bool(const Vector3&)> is_inside_border = [](const Vector3&) { return true; };
};

inline Shape sphere_shape(double radius_m) {
  return {
      .name = "sphere",
      .area_m2 = 4 * std::numbers::pi * radius_m * radius_m,
      .view =
          [=](const Vector3& p) { return palpate::view(SphereGeometry{.radius_m = radius_m}, p); },
      .point = [=](double s, double t) -> Vector3 {
        const double z = 1.0 - 2.0 * s;
        const double r = std::sqrt(std::max(0.0, 1.0 - z * z));
        const double phi = 2 * std::numbers::pi * t;
        return radius_m * Vector3(r * std::cos(phi), r * std::sin(phi), z);
      }};
}

/// A square of the plane z = 0.
inline Shape plane_shape(double half_edge_m) {
  return {
      .name = "plane",
      .area_m2 = 4 * half_edge_m * half_edge_m,
      .view = [](const Vector3& p) { return palpate::view(HalfSpaceGeometry{}, p); },
      .point = [=](double s, double t) -> Vector3 {
        return {half_edge_m * (2 * s - 1), half_edge_m * (2 * t - 1), 0.0};
      },
      .is_inside_border =
          [=](const Vector3& p) { return p.head<2>().cwiseAbs().maxCoeff() < 0.7 * half_edge_m; }};
}

/// Round z, `tube_m` thick about a circle of `ring_m`.
inline Shape torus_shape(double ring_m, double tube_m) {
  // s is spread by rejection-free inversion: the area grows with ring + tube·cos
  const auto tube_angle = [=](double s) {
    double angle = 2 * std::numbers::pi * s;
    for (int i = 0; i < 20; ++i) {
      const double area = angle + tube_m / ring_m * std::sin(angle) - 2 * std::numbers::pi * s;
      angle -= area / (1.0 + tube_m / ring_m * std::cos(angle));
    }
    return angle;
  };
  return {.name = "torus",
          .area_m2 = 4 * std::numbers::pi * std::numbers::pi * ring_m * tube_m,
          .view =
              [=](const Vector3& p) {
                SurfaceView view;
                const double rho = std::hypot(p.x(), p.y());
                const Vector3 outwards(p.x() / rho, p.y() / rho, 0);
                const Vector3 from_ring = p - ring_m * outwards;
                const double distance = from_ring.norm();
                view.distance_m = distance - tube_m;
                view.normal = from_ring / distance;
                // along the tube's circle 1/distance, round z the curvature of the parallel
                const Vector3 parallel(-outwards.y(), outwards.x(), 0);
                const Vector3 meridian = parallel.cross(view.normal);
                view.curvature_per_m =
                    meridian * meridian.transpose() / distance +
                    view.normal.dot(outwards) / rho * parallel * parallel.transpose();
                return view;
              },
          .point = [=](double s, double t) -> Vector3 {
            const double angle = tube_angle(s);
            const double phi = 2 * std::numbers::pi * t;
            const double rho = ring_m + tube_m * std::cos(angle);
            return {rho * std::cos(phi), rho * std::sin(phi), tube_m * std::sin(angle)};
          }};
}

/// z = (x² − y²)/(2 R) over a square; the distance by Newton's iteration.
inline Shape saddle_shape(double radius_m, double half_edge_m) {
  return {
      .name = "saddle",
      .area_m2 = 4 * half_edge_m * half_edge_m,  // to 1 % for half_edge ≤ R/5
      .view =
          [=](const Vector3& p) {
            const auto height = [=](double x, double y) {
              return (x * x - y * y) / (2 * radius_m);
            };
            double x = p.x();
            double y = p.y();
            for (int i = 0; i < 50; ++i) {
              const double dz = p.z() - height(x, y);
              // the foot is where (p − foot) is along the normal (−x/R, y/R, 1)
              x = p.x() + dz * x / radius_m;
              y = p.y() - dz * y / radius_m;
            }
            SurfaceView view;
            const Vector3 foot(x, y, height(x, y));
            const double slope2 = 1.0 + (x * x + y * y) / (radius_m * radius_m);
            const Vector3 n = Vector3(-x / radius_m, y / radius_m, 1.0) / std::sqrt(slope2);
            view.distance_m = n.dot(p - foot);
            view.normal = n;
            // shape operator of the foot, then moved out by the distance: S (1 + d S)⁻¹
            const Matrix3 P = Matrix3::Identity() - n * n.transpose();
            const Matrix3 S = P * Matrix3(Vector3(-1 / radius_m, 1 / radius_m, 0).asDiagonal()) *
                              P / std::sqrt(slope2);
            view.curvature_per_m = S * Matrix3(Matrix3::Identity() + view.distance_m * S).inverse();
            return view;
          },
      .point = [=](double s, double t) -> Vector3 {
        const double x = half_edge_m * (2 * s - 1);
        const double y = half_edge_m * (2 * t - 1);
        return {x, y, (x * x - y * y) / (2 * radius_m)};
      },
      .is_inside_border =
          [=](const Vector3& p) { return p.head<2>().cwiseAbs().maxCoeff() < 0.7 * half_edge_m; }};
}

enum class Sampling {
  kEven,    ///< a spiral or lattice with one point per spacing²
  kRandom,  ///< as many points, each anywhere: gaps of several spacings, and clumps
};

/// As many points as one per spacing² of the area; noise is normal, in each coordinate.
inline physics::PointCloud sampled(const Shape& shape, double spacing_m, double noise_m,
                                   bool has_normals, Sampling sampling, Random& random) {
  physics::PointCloud cloud;
  const auto count = static_cast<std::size_t>(shape.area_m2 / (spacing_m * spacing_m));
  // the plastic-number sequence covers a square evenly without lattice lines
  constexpr double kFirst = 0.7548776662466927;
  constexpr double kSecond = 0.5698402909980532;
  for (std::size_t i = 0; i < count; ++i) {
    const double k = static_cast<double>(i) + 0.5;
    const bool is_even = sampling == Sampling::kEven;
    const double s = is_even ? std::fmod(k * kFirst, 1.0) : random.uniform();
    const double t = is_even ? std::fmod(k * kSecond, 1.0) : random.uniform();
    const Vector3 point = shape.point(s, t);
    if (has_normals) cloud.normals.push_back(shape.view(point).normal);
    cloud.points_m.push_back(point +
                             noise_m * Vector3(random.normal(), random.normal(), random.normal()));
  }
  return cloud;
}

}  // namespace palpate::test
