// SPDX-License-Identifier: Apache-2.0
#include "common/session/path_speed.h"

#include <algorithm>
#include <limits>
#include <numbers>

namespace palpate {
namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;
constexpr double kSamePlace_m = 1e-6;

PathSpeed speed_of(const VPath& path) {
  const double free_m_per_s =
      path.free_motion_s > 0.0 ? kTwoPi * path.free_frequency_hz * path.free_amplitude_m : 0.0;
  if (free_m_per_s > path.speed_m_per_s) return {free_m_per_s, 0.0};
  return {path.speed_m_per_s, path.free_motion_s};
}

PathSpeed speed_of(const HoldPath& /*path*/) { return {}; }

PathSpeed speed_of(const SinusoidPath& path) {
  return {kTwoPi * path.amplitude_m.cwiseProduct(path.frequency_hz).norm(), 0.0};
}

PathSpeed speed_of(const RecordedPath& path) {
  PathSpeed fastest;
  for (std::size_t i = 1; i < path.samples.size(); ++i) {
    const RecordedPath::Sample& from = path.samples[i - 1];
    const RecordedPath::Sample& to = path.samples[i];
    const double m_per_s = (to.position_m - from.position_m).norm() / (to.t_s - from.t_s);
    if (m_per_s > fastest.m_per_s) fastest = {m_per_s, from.t_s};
  }
  if (path.loops && !path.samples.empty() &&
      (path.samples.back().position_m - path.samples.front().position_m).norm() > kSamePlace_m) {
    fastest = {std::numeric_limits<double>::infinity(), path.samples.back().t_s};
  }
  return fastest;
}

PathSpeed speed_of(const HostilePath& path) { return {path.v_max_m_per_s, 0.0}; }

}  // namespace

PathSpeed top_speed_of(const PathConfig& path) {
  return std::visit([](const auto& one) { return speed_of(one); }, path);
}

}  // namespace palpate
