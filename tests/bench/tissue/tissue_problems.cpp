// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/tissue/tissue_problems.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate::bench {

using elastic::BodyDescription;
using elastic::Law;
using elastic::Mesh;
using elastic::Vector3d;

namespace {

constexpr double kOnPlane_m = 1e-9;

BodyDescription body_of(Mesh mesh, Law law) {
  BodyDescription description;
  description.mesh = std::move(mesh);
  description.materials = {{.young_modulus_pa = kYoung_pa,
                            .poisson_ratio = kPoissonRatio,
                            .density_kg_per_m3 = kDensity_kg_per_m3}};
  description.law = law;
  return description;
}

double top_of(const Mesh& mesh) {
  double top_m = 0.0;
  for (const Vector3d& x : mesh.nodes_m) top_m = std::max(top_m, x.z());
  return top_m;
}

/// From 0 to `side_m`, `cells` equal ones over `fine_m` around the middle.
std::vector<double> planes_around(double middle_m, double side_m, int cells, int outer,
                                  double fine_m) {
  const double cell_m = fine_m / cells;
  const double from_m = middle_m - 0.5 * fine_m;
  const double to_m = middle_m + 0.5 * fine_m;
  std::vector<double> planes;
  const std::vector<double> before = elastic::graded_planes(from_m, outer, cell_m);
  for (auto plane = before.rbegin(); plane != before.rend(); ++plane) {
    planes.push_back(from_m - *plane);
  }
  for (int i = 1; i <= cells; ++i) planes.push_back(from_m + cell_m * i);
  const std::vector<double> after = elastic::graded_planes(side_m - to_m, outer, cell_m);
  for (std::size_t i = 1; i < after.size(); ++i) planes.push_back(to_m + after[i]);
  planes.front() = 0.0;
  planes.back() = side_m;
  return planes;
}

}  // namespace

Mesh bar_mesh(int across, int along, double length_m) {
  const std::vector<double> side = elastic::equal_planes(0.0, kBarSide_m, across);
  return elastic::box_mesh(side, side, elastic::equal_planes(0.0, length_m, along));
}

Mesh slab_mesh(int across, int deep) {
  const std::vector<double> side = elastic::equal_planes(0.0, kSlabSide_m, across);
  return elastic::box_mesh(side, side, elastic::equal_planes(0.0, kSlabHeight_m, deep));
}

Mesh graded_slab_mesh(int cells, int outer, int deep, double fine_m, double along_m) {
  const double middle_m = 0.5 * kSlabSide_m;
  std::vector<double> up = elastic::graded_planes(kSlabHeight_m, deep, fine_m / cells);
  for (double& plane : up) plane = kSlabHeight_m - plane;
  std::reverse(up.begin(), up.end());
  up.front() = 0.0;
  return elastic::box_mesh(planes_around(middle_m + along_m, kSlabSide_m, cells, outer, fine_m),
                           planes_around(middle_m, kSlabSide_m, cells, outer, fine_m), up);
}

std::vector<std::uint32_t> upper_end(const Mesh& mesh) {
  const double top_m = top_of(mesh);
  return elastic::nodes_where(mesh, [&](const Vector3d& x) { return x.z() > top_m - kOnPlane_m; });
}

std::vector<std::uint32_t> lower_end(const Mesh& mesh) {
  return elastic::nodes_where(mesh, [](const Vector3d& x) { return x.z() < kOnPlane_m; });
}

BodyDescription hanging_bar(Mesh mesh, Law law) {
  BodyDescription description = body_of(std::move(mesh), law);
  description.fixed_nodes = upper_end(description.mesh);
  description.gravity_m_per_s2 = {0.0, 0.0, -kGravity_m_per_s2};
  return description;
}

BodyDescription twisted_bar(Mesh mesh, Law law) {
  BodyDescription description = body_of(std::move(mesh), law);
  description.fixed_nodes = upper_end(description.mesh);
  const std::vector<std::uint32_t> lower = lower_end(description.mesh);
  description.fixed_nodes.insert(description.fixed_nodes.end(), lower.begin(), lower.end());
  return description;
}

BodyDescription held_slab(Mesh mesh, Law law) {
  BodyDescription description = body_of(std::move(mesh), law);
  description.fixed_nodes = lower_end(description.mesh);
  return description;
}

Vector3d turned(const Vector3d& at_m, double angle_rad) {
  const double x = at_m.x() - 0.5 * kBarSide_m;
  const double y = at_m.y() - 0.5 * kBarSide_m;
  const double c = std::cos(angle_rad);
  const double s = std::sin(angle_rad);
  return {0.5 * kBarSide_m + c * x - s * y, 0.5 * kBarSide_m + s * x + c * y, at_m.z()};
}

std::vector<elastic::SurfacePoint> top_of_slab(const Mesh& mesh, int per_edge) {
  constexpr double kReach_m = 0.25;  // twice the radius of the contact
  std::vector<elastic::Face> faces;
  for (const elastic::Face& face : elastic::surface_of(mesh)) {
    bool is_top = true;
    double nearest_m = INFINITY;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vector3d& x = mesh.nodes_m[face.nodes[k]];
      is_top = is_top && x.z() > kSlabHeight_m - kOnPlane_m;
      const double along_m = x.x() - 0.5 * kSlabSide_m;
      nearest_m = std::min(nearest_m, std::hypot(along_m - std::clamp(along_m, 0.0, kSlide_m),
                                                 x.y() - 0.5 * kSlabSide_m));
    }
    if (is_top && nearest_m < kReach_m) faces.push_back(face);
  }
  return elastic::surface_points(mesh, faces, per_edge);
}

double slender_sag_m(double gravity_m_per_s2) {
  return kDensity_kg_per_m3 * gravity_m_per_s2 * kBarLength_m * kBarLength_m / (2.0 * kYoung_pa);
}

double hertz_newton(double depth_m) {
  return 4.0 / 3.0 * kYoung_pa / (1.0 - kPoissonRatio * kPoissonRatio) *
         std::sqrt(kSphereRadius_m) * std::pow(depth_m, 1.5);
}

double layer_newton(double depth_m) {
  constexpr double kPi = std::numbers::pi;
  const double nu = kPoissonRatio;
  const double alpha = -(1.2876 - 1.4678 * nu + 1.3442 * nu * nu) / (1.0 - nu);
  const double beta = (0.6387 - 1.0277 * nu + 1.5164 * nu * nu) / (1.0 - nu);
  const double chi = std::sqrt(kSphereRadius_m * depth_m) / kSlabHeight_m;
  const double cube = alpha * alpha * alpha;
  const double factor =
      1.0 - 2.0 * alpha / kPi * chi + 4.0 * alpha * alpha / (kPi * kPi) * chi * chi -
      8.0 / std::pow(kPi, 3) * (cube + 4.0 * kPi * kPi / 15.0 * beta) * std::pow(chi, 3) +
      16.0 * alpha / std::pow(kPi, 4) * (cube + 3.0 * kPi * kPi / 5.0 * beta) * std::pow(chi, 4);
  return factor * hertz_newton(depth_m);
}

double torsion_stiffness_newton_m2() { return 0.140577 * kMu_pa * std::pow(kBarSide_m, 4); }

}  // namespace palpate::bench
