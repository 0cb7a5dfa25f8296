// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic_tissue/touching/body_ties.h"

#include <Eigen/Geometry>
#include <Eigen/QR>
#include <algorithm>
#include <limits>

#include "physics_node/elastic/contact/plane_contact.h"

namespace palpate::physics {
namespace {

constexpr std::size_t kMostRemembered = 5;  // that the next expectation is made of
// Passes after which the error has grown by this factor say nothing of the next one.
constexpr double kGrown = 1.5;
// As the penalty of a contact @see BodyPair
constexpr double kTieModuli = 2.0;

elastic::SurfacePoint point_of(std::uint32_t node) {
  elastic::SurfacePoint point{.count = 1};
  point.nodes[0] = node;
  point.weights[0] = 1.0;
  return point;
}

double young_pa_of(const ElasticSimulation& body) {
  return body.body().body->description().materials.front().young_modulus_pa;
}

Vector3 at(const elastic::SurfacePoint& point, const ElasticSimulation& body) {
  return point.position_m(body.x_m().data());
}

}  // namespace

void BodyTies::look(const ElasticSimulation& attached, const ElasticSimulation& other) {
  all_.clear();
  expectations_m_.clear();
  errors_m_.clear();
  const std::vector<elastic::Tearing::One>& tearing = attached.tearing().attachments();
  const double softer_pa = std::min(young_pa_of(attached), young_pa_of(other));
  std::size_t place = 0;
  for (const elastic::Attachment& one : attached.body().body->description().attachments) {
    const std::size_t own = one.tears() ? place++ : 0;
    if (!one.is_tie()) continue;
    const TiedPlace& to = attached.body().ties[static_cast<std::size_t>(one.tie)];
    if (to.tissue != other.body().tissue) continue;
    One tie{.node = point_of(one.node),
            .corner = {.count = 3},
            .in_body_newton_per_m = one.stiffness_newton_per_m,
            .rest_m = attached.body().body->rest_m().segment<3>(3 * Eigen::Index{one.node}),
            .contact_newton_per_m =
                elastic::contact_stiffness_newton_per_m(softer_pa, to.area_m2, kTieModuli),
            .place = own,
            .tears = one.tears()};
    for (std::size_t i = 0; i < 3; ++i) {
      tie.corner.nodes[i] = to.triangle[i];
      tie.corner.weights[i] = to.weights[static_cast<Eigen::Index>(i)];
    }
    // they turn with the triangle
    const auto turned =
        Eigen::Quaterniond::FromTwoVectors(to.normal, tie.corner.outward(other.x_m().data()));
    tie.offset_m = turned * to.offset_m;
    const Vector3 outward = turned * one.outward;
    tie.spring =
        one.tears() ? elastic::CohesiveSpring{.newton_per_m = one.intact_newton_per_m,
                                              .law = {one.softens_at_m},
                                              .farthest_m = tearing[own].farthest_m,
                                              .outward = outward}
                    : elastic::CohesiveSpring{.newton_per_m = one.stiffness_newton_per_m,
                                              .law = {std::numeric_limits<double>::infinity()},
                                              .farthest_m = std::numeric_limits<double>::infinity(),
                                              .outward = outward};
    all_.push_back(tie);
  }
  const std::vector<Vector3> found = ends(attached, other);
  expected_m_.resize(3 * static_cast<Eigen::Index>(all_.size()));
  for (std::size_t i = 0; i < all_.size(); ++i) {
    expected_m_.segment<3>(3 * static_cast<Eigen::Index>(i)) = found[i];
  }
}

std::vector<Vector3> BodyTies::ends(const ElasticSimulation& attached,
                                    const ElasticSimulation& other) const {
  std::vector<Vector3> found;
  for (const One& one : all_) {
    found.push_back(is_first_attached() ? at(one.corner, other) : at(one.node, attached));
  }
  return found;
}

void BodyTies::add_ties(const ElasticSimulation& attached, const ElasticSimulation& other,
                        bool is_other, std::vector<elastic::Tie>& ties) const {
  const bool is_first = is_first_attached() != is_other;
  for (std::size_t i = 0; i < all_.size(); ++i) {
    const One& one = all_[i];
    if (is_other && !(one.holds())) continue;
    elastic::Tie tie{.point = is_other ? one.corner : one.node, .spring = one.spring};
    if (is_first) {
      tie.place_m = expected_m_.segment<3>(3 * static_cast<Eigen::Index>(i));
    } else {
      tie.place_m = is_other ? at(one.node, attached) : at(one.corner, other);
    }
    if (is_other) {
      tie.place_m -= one.offset_m;
      tie.spring.outward = -one.spring.outward;
    } else {
      tie.place_m += one.offset_m;
      tie.in_body_newton_per_m = one.in_body_newton_per_m;
      tie.in_body_m = one.rest_m;
    }
    ties.push_back(tie);
  }
}

double BodyTies::update(const ElasticSimulation& attached, const ElasticSimulation& other) {
  const std::vector<Vector3> found = ends(attached, other);
  double farthest_m = 0.0;
  Eigen::VectorXd error_m = Eigen::VectorXd::Zero(expected_m_.size());
  for (std::size_t i = 0; i < all_.size(); ++i) {
    const auto place = 3 * static_cast<Eigen::Index>(i);
    if (all_[i].holds()) {
      error_m.segment<3>(place) = found[i] - expected_m_.segment<3>(place);
      farthest_m =
          std::max(farthest_m, error_m.segment<3>(place).norm() * all_[i].spring.newton_per_m /
                                   all_[i].contact_newton_per_m);
    } else {
      expected_m_.segment<3>(place) = found[i];
    }
  }
  if (!error_m.allFinite()) return 0.0;
  expect(error_m);
  return farthest_m;
}

/// The next expectation, in which the errors of the passes would be the least if they were linear.
void BodyTies::expect(const Eigen::VectorXd& error_m) {
  if (!errors_m_.empty() && error_m.norm() > kGrown * errors_m_.back().norm()) {
    expectations_m_.clear();
    errors_m_.clear();
  }
  expectations_m_.push_back(expected_m_);
  errors_m_.push_back(error_m);
  if (errors_m_.size() > kMostRemembered) {
    expectations_m_.erase(expectations_m_.begin());
    errors_m_.erase(errors_m_.begin());
  }
  expected_m_ += error_m;
  const auto count = static_cast<Eigen::Index>(errors_m_.size()) - 1;
  if (count == 0) return;
  Eigen::MatrixXd changes(error_m.size(), count);
  Eigen::MatrixXd ways(error_m.size(), count);
  for (Eigen::Index k = 0; k < count; ++k) {
    const auto i = static_cast<std::size_t>(k);
    changes.col(k) = errors_m_[i + 1] - errors_m_[i];
    ways.col(k) = expectations_m_[i + 1] - expectations_m_[i];
  }
  const Eigen::VectorXd shares = changes.colPivHouseholderQr().solve(error_m);
  if (shares.allFinite()) expected_m_ -= (ways + changes) * shares;
}

void BodyTies::tear(ElasticSimulation& attached, const ElasticSimulation& other) const {
  for (const One& one : all_) {
    if (one.tears) attached.note_tie(one.place, one.separation(attached, other).apart_m.norm());
  }
}

bool BodyTies::is_tearing(const ElasticSimulation& attached, const ElasticSimulation& other) const {
  return std::any_of(all_.begin(), all_.end(), [&](const One& one) {
    return one.tears && one.separation(attached, other).apart_m.norm() > one.spring.farthest_m;
  });
}

Vector3 BodyTies::force_on_attached_newton(const ElasticSimulation& attached,
                                           const ElasticSimulation& other) const {
  Vector3 newton = Vector3::Zero();
  for (const One& one : all_) {
    newton -= one.spring.pull(one.separation(attached, other)).slope_newton;
  }
  return newton;
}

elastic::Separation BodyTies::One::separation(const ElasticSimulation& attached,
                                              const ElasticSimulation& other) const {
  return elastic::separation_of(at(node, attached) - at(corner, other) - offset_m, spring.outward);
}

double BodyTies::stored_joule(const ElasticSimulation& attached,
                              const ElasticSimulation& other) const {
  double joule = 0.0;
  for (const One& one : all_) {
    const double k = one.spring.newton_per_m * one.spring.law.ratio(one.spring.farthest_m);
    joule += 0.5 * k * one.separation(attached, other).away_m.squaredNorm() -
             0.5 * one.in_body_newton_per_m * (at(one.node, attached) - one.rest_m).squaredNorm();
  }
  return joule;
}

void BodyTies::add_tie_points(bool is_other, elastic::SurfaceCompliance& compliance_of_other,
                              std::vector<elastic::TiePoint>& points) const {
  for (const One& one : all_) {
    if (!(one.in_body_newton_per_m > 0.0)) continue;
    points.push_back({.point = is_other ? one.corner : one.node,
                      .other = &compliance_of_other,
                      .other_point = is_other ? one.node : one.corner,
                      .newton_per_m = one.in_body_newton_per_m,
                      .is_in_body = !is_other});
  }
}

}  // namespace palpate::physics
