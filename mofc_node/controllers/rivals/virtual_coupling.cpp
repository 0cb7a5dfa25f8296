// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/controllers/rivals/virtual_coupling.h"

#include <limits>

#include "implicit_step.h"

namespace palpate::controllers {

namespace {

constexpr int kFrequencies = 400;
constexpr int kDampings = 60;
constexpr int kHalvings = 40;

}  // namespace

bool is_unconditionally_stable(const VirtualCouplingParameters& p, double b) noexcept {
  const double a = 0.5 * p.K_c * p.T;
  const double sum = p.B_c + a;
  for (int i = 0; i < kFrequencies; ++i) {
    const double c = (i + 0.5) / kFrequencies;
    const double c2 = c * c;
    const double re_admittance = sum / (sum * sum + a * a * c2 / (1.0 - c2));
    if (2.0 * b * re_admittance < c * (1.0 - c)) return false;
  }
  return true;
}

VirtualCouplingParameters llewellyn_coupling(double b, double T) noexcept {
  VirtualCouplingParameters best{.K_c = 0.0, .B_c = 0.0, .T = T};
  for (int i = 0; i < kDampings; ++i) {
    VirtualCouplingParameters p{.K_c = 0.0, .B_c = b * i / kDampings, .T = T};
    double low = 0.0;
    double high = 20.0 * b / T;
    for (int k = 0; k < kHalvings; ++k) {
      p.K_c = 0.5 * (low + high);
      (is_unconditionally_stable(p, b) ? low : high) = p.K_c;
    }
    p.K_c = low;
    if (p.K_c > best.K_c) best = p;
  }
  return best;
}

VirtualCouplingParameters sampled_data_coupling(double b, double T) noexcept {
  return {.K_c = 2.0 * b / T, .B_c = 0.0, .T = T};
}

void VirtualCoupling::reset() noexcept {
  interval_.reset();
  has_proxy_ = false;
}

ControlOutput VirtualCoupling::step(const ControlInput& input) noexcept {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  const Interval interval = interval_.read(input);
  if (input.tissue == nullptr) {
    return unbounded_output(input, input.requested_force_on_hand_newton, kNone);
  }
  if (!has_proxy_ || input.has_gap) proxy_m_ = input.hand_position_m;
  has_proxy_ = true;
  const Vector3 v = interval.moved_m / p_.T;
  solve(*input.tissue, input.hand_position_m, v);
  const Vector3 force = -coupling_newton(input.hand_position_m, v, solution_m_);
  proxy_m_ = solution_m_;
  return unbounded_output(input, force, kNone);
}

/// On the proxy: K_c (x − p′) + B_c (v − u′).
Vector3 VirtualCoupling::coupling_newton(const Vector3& x, const Vector3& v,
                                         const Vector3& proxy_m) const noexcept {
  return p_.K_c * (x - proxy_m) + p_.B_c * (v - (proxy_m - proxy_m_) / p_.T);
}

void VirtualCoupling::solve(const TissueProbe& tissue, const Vector3& x,
                            const Vector3& v) noexcept {
  const auto residual = [&](const Vector3& p) {
    return Vector3(tissue.at(p, (p - proxy_m_) / p_.T).force_on_hand_newton +
                   coupling_newton(x, v, p));
  };
  const double slope = p_.K_c + p_.B_c / p_.T;
  solution_m_ =
      implicit_step(residual, proxy_m_ + (p_.K_c * (x - proxy_m_) + p_.B_c * v) / slope, slope);
}

}  // namespace palpate::controllers
