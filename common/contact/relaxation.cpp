// SPDX-License-Identifier: Apache-2.0
#include "common/contact/relaxation.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate {
namespace {

// Tissue that has recovered to this is at rest [m].
constexpr double kRelaxed_m = 1e-12;

}  // namespace

Relaxation::Relaxation(std::vector<double> relaxation_times_s)
    : relaxation_times_s_(std::move(relaxation_times_s)), states_(relaxation_times_s_.size()) {
  awake_.reserve(states_.size());
}

void RelaxationState::press(double relaxation_time_s, double depth_m, double dt_s) noexcept {
  const double now_m = depth_m > 0.0 && std::isfinite(depth_m) ? depth_m : 0.0;
  const double before_m = penetration_m;
  penetration_m = now_m;
  if (!(dt_s > 0.0) || (before_m == 0.0 && now_m == 0.0 && relaxed_m == 0.0)) return;

  // the exact solution of τ ż = p − z for p that changes linearly
  const double lag_m = (now_m - before_m) / dt_s * relaxation_time_s;
  relaxed_m = now_m - lag_m + (relaxed_m - before_m + lag_m) * std::exp(-dt_s / relaxation_time_s);
  if (now_m == 0.0 && std::abs(relaxed_m) < kRelaxed_m) relaxed_m = 0.0;
}

void Relaxation::press(std::size_t index, double depth_m, double dt_s, double time_s) noexcept {
  if (index >= states_.size()) return;
  State& state = states_[index];
  state.advanced_s = time_s;
  const bool was_at_rest = state.is_at_rest();
  state.press(relaxation_times_s_[index], depth_m, dt_s);
  if (was_at_rest && !state.is_at_rest() &&
      std::find(awake_.begin(), awake_.end(), index) == awake_.end()) {
    awake_.push_back(static_cast<std::uint32_t>(index));
  }
}

void Relaxation::finish_step(double dt_s, double time_s) noexcept {
  for (const std::uint32_t index : awake_) {
    State& state = states_[index];
    if (state.advanced_s != time_s) press(index, 0.0, dt_s, time_s);
  }
  std::erase_if(awake_, [&](std::uint32_t index) { return states_[index].is_at_rest(); });
}

}  // namespace palpate
