#include "physics_node/scene/relaxation.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate::physics {
namespace {

// Tissue that has recovered to this is at rest [m].
constexpr double kRelaxed_m = 1e-12;

}  // namespace

Relaxation::Relaxation(std::vector<double> relaxation_times_s)
    : relaxation_times_s_(std::move(relaxation_times_s)), states_(relaxation_times_s_.size()) {
  awake_.reserve(states_.size());
}

void Relaxation::press(std::size_t index, double depth_m, double dt_s, double time_s) noexcept {
  if (index >= states_.size()) return;
  State& state = states_[index];
  const double now_m = depth_m > 0.0 && std::isfinite(depth_m) ? depth_m : 0.0;
  state.advanced_s = time_s;
  const double before_m = state.penetration_m;
  if (before_m == 0.0 && now_m == 0.0 && state.relaxed_m == 0.0) return;
  if (std::find(awake_.begin(), awake_.end(), index) == awake_.end()) {
    awake_.push_back(static_cast<std::uint32_t>(index));
  }

  // the exact solution of τ ż = p − z for p that changes linearly
  state.penetration_m = now_m;
  if (!(dt_s > 0.0)) return;
  const double tau_s = relaxation_times_s_[index];
  const double lag_m = (now_m - before_m) / dt_s * tau_s;
  state.relaxed_m = now_m - lag_m + (state.relaxed_m - before_m + lag_m) * std::exp(-dt_s / tau_s);
}

void Relaxation::finish_step(double dt_s, double time_s) noexcept {
  for (const std::uint32_t index : awake_) {
    State& state = states_[index];
    if (state.advanced_s != time_s) press(index, 0.0, dt_s, time_s);
    if (state.penetration_m == 0.0 && std::abs(state.relaxed_m) < kRelaxed_m) state.relaxed_m = 0.0;
  }
  std::erase_if(awake_, [&](std::uint32_t index) {
    return states_[index].penetration_m == 0.0 && states_[index].relaxed_m == 0.0;
  });
}

}  // namespace palpate::physics
