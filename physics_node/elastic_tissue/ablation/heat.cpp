// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic_tissue/ablation/heat.h"

#include <algorithm>
#include <numbers>

namespace palpate::physics {

double power_density_watt_per_m3(const ElectrodeConfig& electrode, double tip_radius_m,
                                 double distance_m) noexcept {
  const double R = electrode.reach_m;
  const double a = tip_radius_m;
  if (!(distance_m < R)) return 0.0;
  // ∫ (R − r)/(R − a) 4π r² dr from a to R
  const double shell_m3 =
      4.0 * std::numbers::pi / (R - a) *
      (R * (R * R * R - a * a * a) / 3.0 - (R * R * R * R - a * a * a * a) / 4.0);
  return electrode.power_watt / shell_m3 * std::min(1.0, (R - distance_m) / (R - a));
}

std::uint8_t heat_stage(double dose) noexcept {
  return static_cast<std::uint8_t>(kHeatStages * std::clamp(dose, 0.0, 1.0));
}

double stiffness_ratio(std::uint8_t stage, double softest_ratio) noexcept {
  return 1.0 - (1.0 - softest_ratio) * stage / (kHeatStages - 1.0);
}

}  // namespace palpate::physics
