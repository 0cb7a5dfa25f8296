// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/condensed/contact_check.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

namespace palpate::elastic {
namespace {

// Of the equilibrium: a thousandth of the depths at which the condensed contact is accurate.
constexpr double kTolerance_m = 1e-7;
constexpr int kMostIterations = 20;
// Of a fictitious indentation: sweeps of a step, and steps until it starts from where it ends.
constexpr int kSweeps = 400;
constexpr int kSettling = 3;
// Relative error beyond which the known equilibria are not of this place.
constexpr double kElsewhere = 0.05;
// Equilibria whose forces differ by less, relative, are the same.
constexpr double kSame = 0.1;
constexpr std::size_t kMostKept = 6;

// Given forces on points of a surface: the potential −Σ f·x.
class PointLoads : public Obstacle {
 public:
  PointLoads(const std::vector<SurfacePoint>& points, const std::vector<Vector3d>& forces_newton)
      : points_(points), forces_newton_(forces_newton) {}

  double add_gradient(const double* x_m, double* gradient) const override {
    double energy = 0.0;
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const SurfacePoint& point = points_[i];
      const Vector3d& force = forces_newton_[i];
      if (force.isZero(0.0)) continue;
      energy -= force.dot(point.position_m(x_m));
      for (std::size_t a = 0; a < static_cast<std::size_t>(point.count); ++a) {
        Eigen::Map<Vector3d>(gradient + 3 * std::size_t{point.nodes[a]}) -=
            point.weights[a] * force;
      }
    }
    return energy;
  }
  void add_stiffness(const double* /*x_m*/, const BlockPattern& /*pattern*/,
                     BlockValues& /*values*/) const override {}

 private:
  const std::vector<SurfacePoint>& points_;
  const std::vector<Vector3d>& forces_newton_;
};

// a b̄ per node
std::vector<double> turned_since(const std::vector<double>& now,
                                 const std::vector<double>& reference) {
  std::vector<double> turns(now.size());
  for (std::size_t i = 0; i < now.size(); i += 4) {
    const double* a = now.data() + i;
    const double* b = reference.data() + i;
    turns[i] = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
    turns[i + 1] = a[1] * b[0] - a[0] * b[1] - a[2] * b[3] + a[3] * b[2];
    turns[i + 2] = a[2] * b[0] - a[0] * b[2] - a[3] * b[1] + a[1] * b[3];
    turns[i + 3] = a[3] * b[0] - a[0] * b[3] - a[1] * b[2] + a[2] * b[1];
  }
  return turns;
}

}  // namespace

ContactCheck::ContactCheck(const Body& body, WarpedFactor& factor, SurfaceCompliance& compliance,
                           const std::vector<SurfacePoint>& points)
    : factor_(factor),
      compliance_(compliance),
      points_(points),
      search_(body),
      x_(body.rest_m()),
      factor_rotations_(no_rotations(body.node_count())) {
  if (!factor_.is_ready() && !factor_.factor(body.rest_m(), factor_rotations_, {}, nullptr)) {
    throw std::runtime_error("elastic body: the stiffness at rest is not positive definite");
  }
  equilibria_.emplace_back();
  balance({}, equilibria_.front());
}

SearchReport ContactCheck::balance(const CondensedContact::Snapshot& snapshot, Equilibrium& found) {
  found.forces_newton.assign(points_.size(), Vector3d::Zero());
  found.sum_newton = 0.0;
  for (std::size_t i = 0; i < snapshot.points.size(); ++i) {
    found.forces_newton[snapshot.points[i]] = snapshot.forces_on_body_newton[i];
    found.sum_newton += snapshot.forces_on_body_newton[i].norm();
  }
  const PointLoads loads(points_, found.forces_newton);
  search_.update_rotations(x_);
  factor_.turn_to(turned_since(search_.rotations(), factor_rotations_));
  const SearchReport report = search_.search(
      {.obstacle = &loads}, {.tolerance_m = kTolerance_m, .most_iterations = kMostIterations},
      factor_, x_, [](const VectorXd&) { return false; });
  search_.update_rotations(x_);
  found.x_m = x_;
  return report;
}

double ContactCheck::error_ratio(const CondensedContact::Snapshot& snapshot) const {
  double wrong = 0.0;
  double whole = 0.0;
  for (std::size_t i = 0; i < snapshot.points.size(); ++i) {
    const SurfacePoint& point = points_[snapshot.points[i]];
    const Vector3d& force = snapshot.forces_on_body_newton[i];
    const Vector3d found = point.position_m(x_.data());
    wrong += force.dot(found - snapshot.positions_m[i]);
    whole += force.dot(found - point.position_m(equilibria_.front().x_m.data()));
  }
  return whole > 0.0 ? wrong / whole : std::numeric_limits<double>::quiet_NaN();
}

void ContactCheck::prepare(const Equilibrium& first, const Vector3d& centre_m, int most_points,
                           CondensedContact& next) {
  compliance_.turn_to(turned_since(search_.rotations(), factor_rotations_));
  next.prepare(points_, first.x_m, first.forces_newton, centre_m, most_points);
  for (const Equilibrium& one : equilibria_) {
    next.add_equilibrium(points_, one.x_m, one.forces_newton);
  }
}

ContactCheckReport ContactCheck::begin(const Vector3d& centre_m, double radius_m, int most_points,
                                       CondensedContact& next) {
  equilibria_.resize(1);
  x_ = equilibria_.front().x_m;
  search_.update_rotations(x_);
  prepare(equilibria_.front(), centre_m, most_points, next);
  // pressed towards the nearest point of the surface
  const Vector3d nearest = points_.at(next.chosen().at(0)).position_m(x_.data());
  const Vector3d inwards = (nearest - centre_m).normalized();
  ContactCheckReport report;
  CondensedContact::Snapshot snapshot;
  const auto press = [&](double depth_ratio, Equilibrium& found) {
    for (int again = 0; again < kSettling; ++again) {
      next.step(nearest - (1.0 - depth_ratio) * radius_m * inwards, radius_m, kSweeps,
                1e-3 * kTolerance_m);
    }
    next.read(snapshot);
    report.search = balance(snapshot, found);
  };
  for (int i = 1; i <= kFictitious; ++i) {
    Equilibrium found;
    press(kFictitiousDepth * i / kFictitious, found);
    next.add_equilibrium(points_, found.x_m, found.forces_newton);
    equilibria_.push_back(std::move(found));
  }
  // the error in the middle of the last interval
  Equilibrium between;
  press(kFictitiousDepth * (kFictitious - 0.5) / kFictitious, between);
  report.error_ratio = error_ratio(snapshot);
  x_ = equilibria_.front().x_m;
  search_.update_rotations(x_);
  prepare(equilibria_.front(), centre_m, most_points, next);
  next.bound_by(report.error_ratio);
  return report;
}

ContactCheckReport ContactCheck::check(const CondensedContact::Snapshot& snapshot,
                                       const Vector3d& centre_m, int most_points,
                                       CondensedContact& next) {
  ContactCheckReport report;
  Equilibrium found;
  report.search = balance(snapshot, found);
  report.error_ratio = error_ratio(snapshot);
  // what says the same, or belongs to another place, goes
  const bool is_elsewhere = std::abs(report.error_ratio) > kElsewhere;
  equilibria_.erase(std::remove_if(equilibria_.begin() + 1, equilibria_.end(),
                                   [&](const Equilibrium& one) {
                                     return is_elsewhere ||
                                            std::abs(one.sum_newton - found.sum_newton) <
                                                kSame * found.sum_newton;
                                   }),
                    equilibria_.end());
  if (equilibria_.size() > kMostKept) equilibria_.erase(equilibria_.begin() + 1);
  const bool is_pressed = found.sum_newton > 0.0;
  if (is_pressed) equilibria_.push_back(found);
  prepare(is_pressed ? found : equilibria_.front(), centre_m, most_points, next);
  if (is_pressed) next.bound_by(report.error_ratio);
  return report;
}

bool ContactCheck::renew_factor() {
  search_.update_rotations(x_);
  static_cast<void>(factor_.factor(x_, search_.rotations(), {}, nullptr));
  factor_rotations_ = search_.rotations();
  compliance_.clear();
  return factor_.is_exact();
}

}  // namespace palpate::elastic
