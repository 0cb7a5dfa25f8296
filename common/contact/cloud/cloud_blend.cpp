// SPDX-License-Identifier: Apache-2.0
#include "common/contact/cloud/cloud_blend.h"

namespace palpate {
namespace {

// Closer to the centre of curvature than a tenth of its radius the foot is ill-defined.
constexpr double kLeastDenominator = 0.1;

}  // namespace

void CloudBlender::add(const Vector3& point_m, double reach_m, const CloudQuadric& quadric,
                       double stiffness_ratio) noexcept {
  const Vector3 r = place_m_ - point_m;
  const double per_reach2 = 1.0 / (reach_m * reach_m);
  const double s = 1.0 - r.squaredNorm() * per_reach2;
  if (!(s > 0.0)) return;

  // full weight up to a right angle with the viewed side, none beyond 120°
  const Vector3 n(quadric.normal[0], quadric.normal[1], quadric.normal[2]);
  const double cosine = n.dot(side_);
  if (cosine <= -0.5) return;
  const double same_side = std::min(1.0, 1.0 + 2.0 * cosine);

  const double w = same_side * s * s * s;
  const Vector3 weight_gradient = (-6.0 * same_side * s * s * per_reach2) * r;
  const std::array<float, 6>& h = quadric.curvature;
  Matrix3 H;
  H << h[0], h[1], h[2], h[1], h[3], h[4], h[2], h[4], h[5];
  const Vector3 Hr = H * r;
  const double g = n.dot(r) + 0.5 * r.dot(Hr) - static_cast<double>(quadric.offset);

  weight_ += w;
  height_ += w * g;
  reach_ += w * reach_m;
  gradient_ += w * (n + Hr);
  weight_gradient_ += weight_gradient;
  height_gradient_ += g * weight_gradient;
  curvature_ += w * H;
  stiffness_ += w * stiffness_ratio;
}

CloudBlend CloudBlender::result() const noexcept {
  CloudBlend blend;
  // at the very end of the last reach the weight is rounding
  constexpr double kLeastWeight = 1e-9;
  if (weight_ < kLeastWeight) return blend;
  blend.weight = weight_;
  blend.height_m = height_ / weight_;
  blend.gradient = (gradient_ + height_gradient_ - blend.height_m * weight_gradient_) / weight_;
  blend.curvature_per_m = curvature_ / weight_;
  blend.reach_m = reach_ / weight_;
  blend.stiffness_ratio = stiffness_ / weight_;
  // opposite normals may cancel
  constexpr double kLeastGradient = 0.1;
  if (blend.gradient.norm() < kLeastGradient) blend.gradient = side_;
  return blend;
}

// Symbols:
//   x  place of the blend   r  from x to the tool   n  unit gradient   d  height of the tool above
//   the tangent plane       κ  principal curvatures, with directions e
//   u  = r·e / (1 + d κ), the foot on the quadric along e
CloudStep step_towards_foot(const CloudBlend& blend, const Vector3& from_place_m) noexcept {
  const double slope = blend.gradient.norm();
  const Vector3 n = blend.gradient / slope;
  const double height = blend.height_m / slope;
  const double along_normal = n.dot(from_place_m);
  const double d = along_normal + height;

  // principal curvatures of the surface, limited to what the points can resolve
  const Tangents t(n);
  const Vector3 Ht1 = blend.curvature_per_m * t.first / slope;
  const double a = t.first.dot(Ht1);
  const double b = t.second.dot(Ht1);
  const double c = t.second.dot(blend.curvature_per_m * t.second) / slope;
  const double mean = 0.5 * (a + c);
  const double half = 0.5 * (a - c);
  const double radius = std::sqrt(half * half + b * b);
  Eigen::Vector2d first(1.0, 0.0);
  if (radius > 0.0) {
    first = (half >= 0.0 ? Eigen::Vector2d(half + radius, b) : Eigen::Vector2d(b, radius - half))
                .normalized();
  }
  const std::array<Vector3, 2> e{first.x() * t.first + first.y() * t.second,
                                 -first.y() * t.first + first.x() * t.second};
  const double most = 1.0 / blend.reach_m;
  const std::array<double, 2> kappa{std::clamp(mean + radius, -most, most),
                                    std::clamp(mean - radius, -most, most)};

  CloudStep step;
  std::array<double, 2> u{};
  for (std::size_t i = 0; i < 2; ++i) {
    const double r = from_place_m.dot(e[i]);
    u[i] = r / std::max(1.0 + d * kappa[i], kLeastDenominator);
    step.tangent_m += u[i] * u[i];
  }
  step.tangent_m = std::sqrt(step.tangent_m);
  // no farther than the blend is valid
  if (step.tangent_m > blend.reach_m) {
    for (double& part : u) part *= blend.reach_m / step.tangent_m;
  }

  step.distance_m = d;
  step.normal = n;
  step.to_foot_m = -height * n;
  for (std::size_t i = 0; i < 2; ++i) {
    step.distance_m += 0.5 * kappa[i] * u[i] * from_place_m.dot(e[i]);
    step.normal += kappa[i] * u[i] * e[i];
    step.to_foot_m += u[i] * e[i] - 0.5 * kappa[i] * u[i] * u[i] * n;
  }
  step.normal.normalize();
  step.trust_radius_m = blend.reach_m;
  for (std::size_t i = 0; i < 2; ++i) {
    const Vector3 tangent = e[i] - e[i].dot(step.normal) * step.normal;
    const double denominator = std::max(1.0 + step.distance_m * kappa[i], kLeastDenominator);
    step.curvature_per_m += kappa[i] / denominator * tangent * tangent.transpose();
    // the foot moves 1 / denominator as far as the tool
    step.trust_radius_m = std::min(step.trust_radius_m, blend.reach_m * denominator);
    if (kappa[i] != 0.0) {
      step.trust_radius_m = std::min(step.trust_radius_m, denominator / std::abs(kappa[i]));
    }
  }
  step.trust_radius_m = std::clamp(step.trust_radius_m, kMinTrustRadiusM, kMaxTrustRadiusM);
  return step;
}

}  // namespace palpate
