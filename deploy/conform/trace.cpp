// SPDX-License-Identifier: Apache-2.0
#include "deploy/conform/trace.h"

#include <algorithm>
#include <cmath>

namespace palpate {
namespace {

constexpr double kMoving_m_per_s = 1e-4;

/// Of what the contacts say that the tissue does to the tool by moving itself [W].
double own_watt(const AnsweredPlace& place) {
  double watt = 0.0;
  for (std::uint32_t i = 0; i < place.answer->listed_count; ++i) {
    const Contact& contact = place.answer->contacts[i];
    watt += contact.force_on_tool_newton.dot(contact.surface_velocity_world_m_per_s);
  }
  return watt;
}

}  // namespace

std::pair<double, double> work_joule(const std::vector<AnsweredPlace>& trace) {
  double sum = 0.0;
  double size = 0.0;
  for (std::size_t i = 1; i < trace.size(); ++i) {
    const double work = 0.5 * (trace[i].force_newton + trace[i - 1].force_newton)
                                  .dot(trace[i].position_m - trace[i - 1].position_m) -
                        0.5 * (own_watt(trace[i]) + own_watt(trace[i - 1])) *
                            to_seconds(trace[i].sampled_at - trace[i - 1].sampled_at);
    sum += work;
    size += std::abs(work);
  }
  // seen from there the path is not closed
  if (is_moving(trace)) {
    sum -= trace.front().answer->stored_energy_joule - trace.back().answer->stored_energy_joule;
  }
  return {sum, size};
}

Variation variation_of(const std::vector<AnsweredPlace>& trace, std::size_t first) {
  Vector3 least = Vector3::Constant(1e9);
  Vector3 most = -least;
  Variation variation;
  for (std::size_t i = first; i < trace.size(); ++i) {
    variation.mean_newton += trace[i].force_newton / static_cast<double>(trace.size() - first);
    least = least.cwiseMin(trace[i].force_newton);
    most = most.cwiseMax(trace[i].force_newton);
    variation.range_newton = (most - least).norm();
    variation.most_newton = std::max(variation.most_newton, trace[i].force_newton.norm());
  }
  return variation;
}

bool is_moving(const std::vector<AnsweredPlace>& trace) {
  return std::any_of(trace.begin(), trace.end(), [](const AnsweredPlace& place) {
    const auto begin = place.answer->contacts.begin();
    return std::any_of(begin, begin + place.answer->listed_count, [](const Contact& contact) {
      return contact.surface_velocity_world_m_per_s.norm() > kMoving_m_per_s;
    });
  });
}

}  // namespace palpate
