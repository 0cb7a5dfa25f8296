// SPDX-License-Identifier: Apache-2.0
/// @file
/// virtual_coupling.h — a spring and a damper between the hand and a proxy that touches the tissue.
#pragma once

#include "interval.h"

namespace palpate::controllers {

/// Spring and damper of the coupling.
struct VirtualCouplingParameters {
  double K_c = 800.0;  ///< > 0, stiffness [N/m]
  double B_c = 0.0;    ///< ≥ 0, damping [N·s/m]
  double T = 0.001;    ///< > 0, period [s]
};

/// Whether a coupling Z_c = B_c + K_c T z/(z − 1) to a device of viscous friction b is stable with
/// any passive hand and any passive tissue: Llewellyn's criterion of the two-port,
///
///     2 Re Z_d Re(1/Z_c) ≥ |ZOH| (1 − cos arg ZOH)   for all ω,   ZOH = (z + 1)/(2z)
///
/// With Re Z_d = b, c = cos(ωT/2) and a = K_c T/2:
///
///     2 b (B_c + a) / ((B_c + a)² + a² c²/(1 − c²)) ≥ c (1 − c)
///
/// The mass of the device cancels. Tried at 400 frequencies. Source: [Adams99], from its two-port.
/// @param p  the coupling   @param b  viscous friction of the device, ≥ 0 [N·s/m]
[[nodiscard]] bool is_unconditionally_stable(const VirtualCouplingParameters& p, double b) noexcept;

/// The stiffest coupling by that criterion, about 9.3 b/T, with the damping that allows it.
/// @param b  > 0 [N·s/m]   @param T  > 0, period [s]
[[nodiscard]] VirtualCouplingParameters llewellyn_coupling(double b, double T) noexcept;
/// The stiffest coupling with K_c T/2 + B_c ≤ b and B_c = 0: it is itself a passive sampled wall
/// [Colgate97].
/// @param b  > 0 [N·s/m]   @param T  > 0, period [s]
[[nodiscard]] VirtualCouplingParameters sampled_data_coupling(double b, double T) noexcept;

/// The proxy p has no mass; implicit Euler, with the tissue evaluated at the proxy:
///
///     F_tissue(p′, (p′ − p)/T) + K_c (x − p′) + B_c (v − (p′ − p)/T) = 0,   v = Δx/T
///     F = −K_c (x − p′) − B_c (v − (p′ − p)/T)
///
/// solved by a few steps of Newton's method; what remains is carried by the proxy, not by F.
///
/// Property: unconditionally stable with passive tissue, whatever its stiffness. Broken by: tissue
/// that is active, and so by any that is late, lost or hostile; a friction below b. Always softer
/// than the tissue: 1/K = 1/K_c + 1/K_tissue.
/// Source: [Colgate95], [Adams99]. Needs the contact model; without one F = F_e.
class VirtualCoupling final : public ForceController {
 public:
  /// Does not check the parameters.
  explicit VirtualCoupling(const VirtualCouplingParameters& parameters) : p_(parameters) {}
  void reset() noexcept override;
  /// The proxy begins at the hand, in the first step and after a gap.
  [[nodiscard]] ControlOutput step(const ControlInput& input) noexcept override;

  /// p of the last step.
  [[nodiscard]] const Vector3& proxy_m() const noexcept { return proxy_m_; }

 private:
  void solve(const TissueProbe& tissue, const Vector3& x, const Vector3& v) noexcept;
  [[nodiscard]] Vector3 coupling_newton(const Vector3& x, const Vector3& v,
                                        const Vector3& proxy_m) const noexcept;

  VirtualCouplingParameters p_;
  IntervalReader interval_;
  bool has_proxy_ = false;
  Vector3 proxy_m_ = Vector3::Zero();     // p
  Vector3 solution_m_ = Vector3::Zero();  // p′
};

}  // namespace palpate::controllers
