// SPDX-License-Identifier: Apache-2.0
// heat.h — what an electrode does to a piece of tissue: the law of its dose.
//
// With R the reach of the electrode, a the radius of the tip and r the distance from its centre,
// the power per volume falls along a straight line from the surface of the tip to the reach,
//
//   p(r) = p₀ w(r),  w = (R − r)/(R − a) outside of the tip, 1 inside,
//   p₀ = P / ∫ w dV over the shell between a and R,
//
// so that tissue all around the tip takes up P. What falls on air is lost. The dose of a piece of
// tissue is the energy per mass that it has taken up, relative to what makes it vanish. Nothing
// flows off: no conduction, no perfusion.
#pragma once

#include <cstdint>

#include "common/session/scene_config.h"

namespace palpate::physics {

/// p(r) [W/m³]. @pre  electrode.reach_m > tip_radius_m
[[nodiscard]] double power_density_watt_per_m3(const ElectrodeConfig& electrode,
                                               double tip_radius_m, double distance_m) noexcept;

/// Tissue changes in this many steps of the dose; with the last one it vanishes.
inline constexpr std::uint8_t kHeatStages = 4;

/// 0: as it was, kHeatStages: it has vanished.
/// @param dose  ≥ 0; 1: it vanishes
[[nodiscard]] std::uint8_t heat_stage(double dose) noexcept;

/// Stiffness of tissue in that stage over what it was: falls in equal steps from 1 to the softest.
/// @param stage  < kHeatStages
[[nodiscard]] double stiffness_ratio(std::uint8_t stage, double softest_ratio) noexcept;

}  // namespace palpate::physics
