// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/contact/plane_contact.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace palpate::elastic {

Vector3d ContactPlane::force_on_body_newton(const double* x_m) const noexcept {
  if (!(multiplier_newton > 0.0)) return Vector3d::Zero();
  const Vector3d holding = stiffness_newton_per_m * slid_m(x_m);
  const double newton = holding.norm();
  return multiplier_newton * normal -
         (newton > limit_newton ? limit_newton / newton : 1.0) * holding;
}

double ContactPlane::add_gradient(const double* x_m, double* gradient) const noexcept {
  const double k = stiffness_newton_per_m;
  const double pressing = pressing_newton(x_m);
  double joule = (pressing * pressing - multiplier_newton * multiplier_newton) / (2.0 * k);
  Vector3d slope = -pressing * normal;
  if (limit_newton > 0.0) {
    const Vector3d slid = slid_m(x_m);
    const double way_m = slid.norm();
    if (k * way_m > limit_newton) {
      slope += limit_newton / way_m * slid;
      joule += limit_newton * way_m - 0.5 * limit_newton * limit_newton / k;
    } else {
      slope += k * slid;
      joule += 0.5 * k * way_m * way_m;
    }
  }
  for (std::size_t a = 0; a < static_cast<std::size_t>(point.count); ++a) {
    Eigen::Map<Vector3d>(gradient + 3 * std::size_t{point.nodes[a]}) += point.weights[a] * slope;
  }
  return joule;
}

void ContactPlane::add_stiffness(const double* x_m, const BlockPattern& pattern,
                                 BlockValues& values) const {
  Eigen::Matrix3d more = Eigen::Matrix3d::Zero();
  const Eigen::Matrix3d across = normal * normal.transpose();
  if (pressing_newton(x_m) > 0.0) more += stiffness_newton_per_m * across;
  if (limit_newton > 0.0) {
    const Vector3d slid = slid_m(x_m);
    const double way_m = slid.norm();
    const Eigen::Matrix3d along = Eigen::Matrix3d::Identity() - across;
    if (stiffness_newton_per_m * way_m > limit_newton) {
      const Vector3d u = slid / way_m;
      more += limit_newton / way_m * (along - u * u.transpose());
    } else {
      more += stiffness_newton_per_m * along;
    }
  }
  if (more.isZero(0.0)) return;
  point.add_stiffness(more, pattern, values);
}

void ContactPlane::update_multiplier(const double* x_m, double deepest_m) noexcept {
  multiplier_newton = std::min(pressing_newton(x_m), stiffness_newton_per_m * deepest_m);
  limit_newton = friction_coefficient * multiplier_newton;
}

void ContactPlane::slip(const double* x_m) noexcept {
  const Vector3d slid = slid_m(x_m);
  const double held = stiffness_newton_per_m * slid.norm();
  const double left = held > limit_newton ? limit_newton / held : 1.0;
  anchor_m = point.position_m(x_m) - (multiplier_newton > 0.0 ? left : 0.0) * slid;
}

void add_across(std::vector<Support>& supports) {
  const Vector3d normal = supports.back().direction;
  const Vector3d first = normal.unitOrthogonal();
  for (const Vector3d& direction : {first, Vector3d(normal.cross(first))}) {
    supports.push_back(supports.back());
    supports.back().direction = direction;
  }
}

std::vector<Support> supports_of(const std::vector<ContactPlane>& planes, const double* x_m) {
  std::vector<Support> supports;
  for (const ContactPlane& plane : planes) {
    supports.push_back({.point = plane.point, .direction = plane.normal, .motion = plane.motion});
    if (plane.is_stuck(x_m)) add_across(supports);
  }
  return supports;
}

std::vector<double> areas_of_nodes_m2(const Mesh& mesh, const std::vector<Face>& faces) {
  std::vector<double> areas(mesh.nodes_m.size(), 0.0);
  const bool is_linear = mesh.nodes_per_element == 4;
  for (const Face& face : faces) {
    const Vector3d& corner = mesh.nodes_m[face.nodes[0]];
    const double area =
        0.5 *
        (mesh.nodes_m[face.nodes[1]] - corner).cross(mesh.nodes_m[face.nodes[2]] - corner).norm();
    for (std::size_t k = 0; k < (is_linear ? 3U : 6U); ++k) {
      areas[face.nodes[k]] += area / (is_linear ? 3.0 : (k < 3 ? 12.0 : 4.0));
    }
  }
  return areas;
}

double contact_stiffness_newton_per_m(double young_pa, double area_m2, double moduli) noexcept {
  constexpr double kLeastArea_m2 = 1e-10;
  return moduli * young_pa * std::sqrt(std::max(area_m2, kLeastArea_m2));
}

}  // namespace palpate::elastic
