#include "physics_node/elastic_tissue/elastic_simulation.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace palpate::physics {
namespace {

// A tip this far from the body may touch it within two steps of the full solution.
constexpr double kNear_m = 0.02;

elastic::DynamicsSettings settings() {
  // backward Euler: one factor serves steps with and without contact
  return {.theta = 1.0,
          .tolerance_m = 2e-6,
          .is_exact = true,
          .most_exact_iterations = 100,
          .most_factors = 4,
          .slow_ratio = 0.9,
          .slow_iterations = 4};
}

}  // namespace

double ElasticSimulation::Tips::add_gradient(const double* x_m, double* gradient) const {
  double sum = 0.0;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    if (is_near[i] != 0) sum += contacts[i].add_gradient(x_m, gradient);
  }
  for (const auto& [node, newton] : rubbed_newton) {
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t at = 3 * std::size_t{node} + i;
      sum -= newton[static_cast<int>(i)] * x_m[at];
      gradient[at] -= newton[static_cast<int>(i)];
    }
  }
  return sum;
}

void ElasticSimulation::Tips::add_stiffness(const double* x_m, const elastic::BlockPattern& pattern,
                                            elastic::BlockValues& values) const {
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    if (is_near[i] != 0) contacts[i].add_stiffness(x_m, pattern, values);
  }
}

ElasticSimulation::ElasticSimulation(const ElasticBody& body, std::size_t tools,
                                     double tip_radius_m, double step_s)
    : body_(body),
      tip_radius_m_(tip_radius_m),
      step_s_(step_s),
      dynamics_(*body.body, settings()),
      touches_(tools),
      hints_(tools) {
  for (std::size_t i = 0; i < tools; ++i) {
    tips_.contacts.emplace_back(body.points, body.contact_stiffness_pa_per_m);
    tips_.is_near.push_back(0);
  }
  dynamics_.set_state(body.start_m, elastic::VectorXd::Zero(body.start_m.size()));
}

/// Where the sphere goes in this step.
Vector3 ElasticSimulation::follow(std::size_t tool, const Vector3& tip_m) {
  const double r = tip_radius_m_;
  const SurfaceView there = body_.shape.view(tip_m, hints_[tool]);
  const Touch& touch = touches_[tool];
  if (!touch.is_near) {
    // a tool that appears inside comes from the nearest place of the surface
    const double least_m = 0.5 * r;
    return there.distance_m >= least_m
               ? tip_m
               : Vector3(tip_m + (least_m - there.distance_m) * there.normal);
  }
  const double before_m = body_.shape.view(touch.centre_m, hints_[tool]).distance_m;
  const double least_m = std::min(before_m, r) - 0.5 * r;
  double share = 1.0;
  if (there.distance_m < least_m) share = (before_m - least_m) / (before_m - there.distance_m);
  const Vector3 way = tip_m - touch.centre_m;
  if (std::min(before_m, there.distance_m) < r)
    share = std::min(share, r / std::max(r, way.norm()));
  return touch.centre_m + share * way;
}

/// Spreads the reaction over the pressed points.
void ElasticSimulation::rub(const Touch& touch, const Vector3& friction_on_tool_newton) {
  double pressed_newton = 0.0;
  for (const auto& force : touch.forces_on_body_newton) pressed_newton += force.norm();
  if (!(pressed_newton > 0.0) || friction_on_tool_newton.isZero(0.0)) return;
  for (std::size_t p = 0; p < touch.forces_on_body_newton.size(); ++p) {
    const double share = touch.forces_on_body_newton[p].norm() / pressed_newton;
    if (!(share > 0.0)) continue;
    const elastic::SurfacePoint& point = body_.points[p];
    for (std::size_t i = 0; i < static_cast<std::size_t>(point.count); ++i) {
      tips_.rubbed_newton.emplace_back(point.nodes[i],
                                       -share * point.weights[i] * friction_on_tool_newton);
    }
  }
}

bool ElasticSimulation::step(std::span<const std::optional<TipState>> tips) {
  const elastic::VectorXd& x = dynamics_.x_m();
  bool is_any_near = false;
  tips_.rubbed_newton.clear();
  for (std::size_t i = 0; i < touches_.size(); ++i) {
    Touch& touch = touches_[i];
    const double near_m = tip_radius_m_ + kNear_m;
    const bool is_there = i < tips.size() && tips[i] && tips[i]->tip_m.allFinite() &&
                          body_.bounds.squared_distance(tips[i]->tip_m) < near_m * near_m;
    elastic::SphereContact& contact = tips_.contacts[i];
    if (is_there) {
      const Vector3 centre_m = follow(i, tips[i]->tip_m);
      rub(touch, tips[i]->friction_on_tool_newton);
      touch.centre_m = centre_m;
      contact.set_sphere(centre_m, tip_radius_m_);
      contact.choose_near(x.data(), tip_radius_m_);
    }
    touch.is_near = is_there;
    tips_.is_near[i] = is_there && contact.near_count() > 0 ? 1 : 0;
    is_any_near = is_any_near || tips_.is_near[i] != 0;
    touch.force_on_tool_newton.setZero();
    touch.forces_on_body_newton.clear();
  }
  if (!is_any_near && dynamics_.is_asleep()) {
    static_cast<void>(dynamics_.step(step_s_));
    return false;
  }
  report_ = dynamics_.step(step_s_, is_any_near ? &tips_ : nullptr);
  for (std::size_t i = 0; i < touches_.size(); ++i) {
    if (tips_.is_near[i] == 0) continue;
    elastic::SphereContact& contact = tips_.contacts[i];
    touches_[i].force_on_tool_newton = contact.force_on_sphere_newton(x.data());
    touches_[i].forces_on_body_newton = contact.forces_on_body_newton(x.data());
    contact.update_multipliers(x.data());
  }
  return true;
}

void ElasticSimulation::surface_strain(std::vector<float>& strain) const {
  const elastic::Mesh& mesh = body_.body->mesh();
  const elastic::VectorXd& x = dynamics_.x_m();
  std::vector<double> sum(mesh.nodes_m.size(), 0.0);
  std::vector<double> weight(mesh.nodes_m.size(), 0.0);
  for (std::size_t e = 0; e < mesh.element_count(); ++e) {
    const auto nodes = mesh.element(e);
    Eigen::Matrix3d rest;
    Eigen::Matrix3d now;
    for (Eigen::Index k = 0; k < 3; ++k) {
      const std::uint32_t corner = nodes[static_cast<std::size_t>(k) + 1];
      rest.col(k) = mesh.nodes_m[corner] - mesh.nodes_m[nodes[0]];
      now.col(k) =
          x.segment<3>(3 * Eigen::Index{corner}) - x.segment<3>(3 * Eigen::Index{nodes[0]});
    }
    const Eigen::Matrix3d F = now * rest.inverse();
    Eigen::Matrix3d E = 0.5 * (F.transpose() * F - Eigen::Matrix3d::Identity());
    E.diagonal().array() -= E.trace() / 3.0;
    const double equivalent = std::sqrt(2.0 / 3.0 * E.squaredNorm());
    const double volume = rest.determinant();
    for (const std::uint32_t node : nodes) {
      sum[node] += volume * equivalent;
      weight[node] += volume;
    }
  }
  strain.clear();
  for (const std::uint32_t node : body_.surface_nodes) {
    const double mean = sum[node] / weight[node];
    strain.push_back(std::isfinite(mean) ? static_cast<float>(std::min(mean, 1e6)) : 0.0F);
  }
}

}  // namespace palpate::physics
