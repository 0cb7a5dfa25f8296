// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/attached/tearing.h"

#include <algorithm>
#include <cmath>

namespace palpate::elastic {
namespace {

// A spring of the body that is so near, relative to the whole one, counts as the same.
constexpr double kSame = 0.01;

Eigen::Map<const Vector3d> position_m(const double* x_m, std::uint32_t node) {
  return Eigen::Map<const Vector3d>(x_m + 3 * std::size_t{node});
}

}  // namespace

double CohesiveLaw::ratio(double farthest_m) const noexcept {
  if (!(farthest_m > softens_at_m)) return 1.0;
  return std::max(0.0, 2.0 * softens_at_m - farthest_m) / farthest_m;
}

double CohesiveLaw::area_m2(double separation_m) const noexcept {
  if (separation_m <= softens_at_m) return 0.5 * separation_m * separation_m;
  const double left_m = std::max(0.0, 2.0 * softens_at_m - separation_m);
  return softens_at_m * softens_at_m - 0.5 * left_m * left_m;
}

Separation separation_of(const Vector3d& away_m, const Vector3d& outward) noexcept {
  const double pressed_m = std::max(0.0, away_m.dot(outward));
  return {.away_m = away_m, .apart_m = away_m - pressed_m * outward, .pressed_m = pressed_m};
}

CohesiveSpring::Pull CohesiveSpring::pull(const Separation& at) const noexcept {
  const double separation_m = at.apart_m.norm();
  const double ratio = law.ratio(farthest_m);
  const bool is_further = separation_m > farthest_m;
  const double secant = is_further ? law.ratio(separation_m) : ratio;
  const double held_m = std::min(separation_m, farthest_m);
  const double area_m2 = 0.5 * ratio * held_m * held_m +
                         (is_further ? law.area_m2(separation_m) - law.area_m2(farthest_m) : 0.0);
  return {.joule = newton_per_m * (0.5 * ratio * at.pressed_m * at.pressed_m + area_m2),
          .slope_newton = newton_per_m * (ratio * at.pressed_m * outward + secant * at.apart_m)};
}

Eigen::Matrix3d CohesiveSpring::stiffness(const Separation& at,
                                          double less_newton_per_m) const noexcept {
  const double secant = law.ratio(std::max(at.apart_m.norm(), farthest_m));
  Eigen::Matrix3d more = (secant * newton_per_m - less_newton_per_m) * Eigen::Matrix3d::Identity();
  if (at.pressed_m > 0.0) {
    more += (law.ratio(farthest_m) - secant) * newton_per_m * outward * outward.transpose();
  }
  return more;
}

Separation Tearing::One::way(const double* x_m) const noexcept {
  return separation_of(position_m(x_m, attachment.node) - rest_m, attachment.outward);
}

bool Tearing::One::is_as_in_body(double apart_m) const noexcept {
  return apart_m <= farthest_m &&
         attachment.stiffness_newton_per_m == ratio() * attachment.intact_newton_per_m;
}

Tearing::Tearing(const Body& body) {
  for (const Attachment& one : body.description().attachments) {
    if (!one.tears()) continue;
    all_.push_back({.attachment = one,
                    .rest_m = position_m(body.rest_m().data(), one.node),
                    .farthest_m = one.softens_at_m});
  }
}

void Tearing::continue_as(const Tearing& other) {
  torn_ = other.torn_;
  torn_joule_ = other.torn_joule_;
  auto own = all_.begin();
  for (const One& was : other.all_) {  // both in ascending order
    while (own != all_.end() && own->attachment.index < was.attachment.index) ++own;
    if (own != all_.end() && own->attachment.index == was.attachment.index) {
      own->farthest_m = was.farthest_m;
    } else {
      ++torn_;
      torn_joule_ += was.attachment.intact_newton_per_m * was.law().area_m2(was.farthest_m);
    }
  }
}

void Tearing::count_on(const Tearing& other) noexcept {
  torn_ = other.torn();
  torn_joule_ = other.taken_joule();
}

bool Tearing::is_idle() const noexcept {
  return std::all_of(all_.begin(), all_.end(), [](const One& one) {
    return std::abs(one.ratio() * one.attachment.intact_newton_per_m -
                    one.attachment.stiffness_newton_per_m) <=
           kSame * one.attachment.intact_newton_per_m;
  });
}

bool Tearing::note(const double* x_m) noexcept {
  bool has_torn = false;
  for (std::size_t i = 0; i < all_.size(); ++i) {
    if (all_[i].attachment.is_tie()) continue;
    has_torn = note(i, all_[i].way(x_m).apart_m.norm()) || has_torn;
  }
  return has_torn;
}

bool Tearing::note(std::size_t place, double apart_m) noexcept {
  One& one = all_[place];
  if (!(apart_m > one.farthest_m)) return false;
  const bool has_torn = one.ratio() > 0.0;
  one.farthest_m = apart_m;
  return has_torn;
}

std::size_t Tearing::torn() const noexcept {
  return torn_ +
         static_cast<std::size_t>(std::count_if(
             all_.begin(), all_.end(), [](const One& one) { return !(one.ratio() > 0.0); }));
}

double Tearing::taken_joule() const noexcept {
  double joule = torn_joule_;
  for (const One& one : all_) {
    joule +=
        one.attachment.intact_newton_per_m *
        (one.law().area_m2(one.farthest_m) - 0.5 * one.ratio() * one.farthest_m * one.farthest_m);
  }
  return joule;
}

double Tearing::stored_joule(const double* x_m) const noexcept {
  double joule = 0.0;
  for (const One& one : all_) {
    if (one.attachment.is_tie()) continue;
    joule +=
        0.5 *
        (one.ratio() * one.attachment.intact_newton_per_m - one.attachment.stiffness_newton_per_m) *
        one.way(x_m).away_m.squaredNorm();
  }
  return joule;
}

double Tearing::add_gradient(const double* x_m, double* gradient) const noexcept {
  double joule = 0.0;
  for (const One& one : all_) {
    if (one.attachment.is_tie()) continue;
    const Separation way = one.way(x_m);
    if (one.is_as_in_body(way.apart_m.norm())) continue;
    const CohesiveSpring::Pull pull = one.spring().pull(way);
    const double in_body = one.attachment.stiffness_newton_per_m;
    joule += pull.joule - 0.5 * in_body * way.away_m.squaredNorm();
    Eigen::Map<Vector3d>(gradient + 3 * std::size_t{one.attachment.node}) +=
        pull.slope_newton - in_body * way.away_m;
  }
  return joule;
}

void Tearing::add_stiffness(const double* x_m, const BlockPattern& pattern,
                            BlockValues& values) const {
  for (const One& one : all_) {
    if (one.attachment.is_tie()) continue;
    const Separation way = one.way(x_m);
    const std::int32_t row = pattern.row_of[one.attachment.node];
    if (row < 0 || one.is_as_in_body(way.apart_m.norm())) continue;
    const Eigen::Matrix3d more = one.spring().stiffness(way, one.attachment.stiffness_newton_per_m);
    double* block = values.data() + 9 * std::size_t{pattern.starts[static_cast<std::size_t>(row)]};
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) block[3 * i + j] += more(i, j);
    }
  }
}

}  // namespace palpate::elastic
