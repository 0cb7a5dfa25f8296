#include "mofc_node/controllers/one_pool_clamp.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace palpate::controllers {
namespace {

/// drain_watt(p, f, v_max) as a function of (f − f_co)₊, with what does not depend on it.
class AxisDrain {
 public:
  AxisDrain(double f_d, double v_max) noexcept
      : four_f_d_(4.0 * f_d), slow_newton_(2.0 * f_d * v_max), half_(f_d * v_max), v_max_(v_max) {}
  [[nodiscard]] double watt(double excess_newton) const noexcept {
    if (!(excess_newton > slow_newton_)) {
      return excess_newton > 0.0 ? excess_newton * excess_newton / four_f_d_ : 0.0;
    }
    return (excess_newton - half_) * v_max_;
  }

 private:
  double four_f_d_;
  double slow_newton_;  // up to it v* is below v_max
  double half_;
  double v_max_;
};

/// The two bounds of the drain with friction per axis; the smaller one holds.
class PerAxisDrain {
 public:
  PerAxisDrain(const AxisFriction& friction, double v_max) noexcept
      : f_co_(friction.f_co),
        axes_{AxisDrain(friction.f_d[0], v_max), AxisDrain(friction.f_d[1], v_max),
              AxisDrain(friction.f_d[2], v_max)},
        whole_(friction.f_d.minCoeff(), v_max) {}

  /// @param absolute_newton  |F_i|
  [[nodiscard]] Vector3 excess_newton(const Vector3& absolute_newton) const noexcept {
    return (absolute_newton - f_co_).cwiseMax(0.0);
  }
  [[nodiscard]] double by_axis_watt(const Vector3& excess_newton) const noexcept {
    double sum = 0.0;
    for (std::size_t i = 0; i < 3; ++i) sum += axes_[i].watt(excess_newton[static_cast<int>(i)]);
    return sum;
  }
  [[nodiscard]] double whole_watt(const Vector3& excess_newton) const noexcept {
    return whole_.watt(excess_newton.norm());
  }

 private:
  Vector3 f_co_;
  std::array<AxisDrain, 3> axes_;
  AxisDrain whole_;
};

}  // namespace

double OnePoolClamp::drain_watt(const Vector3& force_newton) const noexcept {
  if (!per_axis_) return controllers::drain_watt(p_, force_newton.norm(), v_max_m_per_s_);
  const PerAxisDrain drain(*per_axis_, v_max_m_per_s_);
  const Vector3 excess_newton = drain.excess_newton(force_newton.cwiseAbs());
  return std::min(drain.by_axis_watt(excess_newton), drain.whole_watt(excess_newton));
}

ControlOutput OnePoolClamp::clamp(const Vector3& asked, double energy_joule,
                                  double gate) const noexcept {
  const auto granted = [&](double absorbed, double paid) {
    return absorbed + gate * (paid - absorbed);
  };
  if (!per_axis_) {
    return output_within(asked,
                         granted(p_.f_co, maximum_force_newton(p_, energy_joule, v_max_m_per_s_)));
  }
  ControlOutput output;
  const double scale = granted(absorbed_scale(asked), paid_scale(asked, energy_joule));
  output.force_on_hand_newton = scale < 1.0 ? Vector3(scale * asked) : asked;
  output.is_clamped = output.force_on_hand_newton != asked;
  for (int i = 0; i < 3; ++i) {
    // what the whole pool would pay for along this axis
    const MofcParameters axis = per_axis_->on_axis(i, p_.T);
    output.f_max_newton[i] =
        granted(axis.f_co, maximum_force_newton(axis, energy_joule, v_max_m_per_s_));
  }
  return output;
}

/// Largest scale at which no axis drains anything.
double OnePoolClamp::absorbed_scale(const Vector3& force_newton) const noexcept {
  double scale = 1.0;
  for (int i = 0; i < 3; ++i) {
    const double f = std::abs(force_newton[i]);
    if (f > per_axis_->f_co[i]) scale = std::min(scale, per_axis_->f_co[i] / f);
  }
  return scale;
}

double OnePoolClamp::paid_scale(const Vector3& force_newton, double energy_joule) const noexcept {
  const PerAxisDrain drain(*per_axis_, v_max_m_per_s_);
  const Vector3 absolute_newton = force_newton.cwiseAbs();
  const double pool_joule = std::max(0.0, energy_joule);
  const auto is_paid = [&](double scale) {
    const Vector3 excess_newton = drain.excess_newton(scale * absolute_newton);
    return p_.T * drain.by_axis_watt(excess_newton) <= pool_joule ||
           p_.T * drain.whole_watt(excess_newton) <= pool_joule;
  };
  if (is_paid(1.0)) return 1.0;
  double paid = absorbed_scale(force_newton);
  double unpaid = 1.0;
  constexpr int kHalvings = 60;  // below the last bit of a double
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (paid + unpaid);
    if (!(paid < middle && middle < unpaid)) break;  // no double is between them
    (is_paid(middle) ? paid : unpaid) = middle;
  }
  return paid;
}

}  // namespace palpate::controllers
