// SPDX-License-Identifier: Apache-2.0
// power_law.h — a power law of the complex modulus as Maxwell branches.
#pragma once

#include <complex>
#include <vector>

#include "common/session/scene_config.h"

namespace palpate {

/// Frequencies over which a power law is fitted.
inline constexpr double kPowerLawLeast_hz = 0.1;
inline constexpr double kPowerLawLargest_hz = 10.0;

struct PowerLawFit {
  double rest_ratio = 1.0;  ///< modulus when all has relaxed over that of the law at `at_hz`
  std::vector<ElasticMaterial::Branch> branches;
  double error_ratio = 0.0;  ///< largest |E_fit − E*| / |E*| from 0.1 to 10 Hz
};

/// The seven Maxwell branches that are nearest to E*(f) = (i f/at_hz)^exponent from 0.1 to 10 Hz in
/// the mean square of the relative error, with time constants evenly spaced in the logarithm and
/// no negative share.
/// @param exponent  in (0, 0.3]   @param at_hz  > 0
[[nodiscard]] PowerLawFit fit_power_law(double exponent, double at_hz);

/// 1 + Σ γ iωτ/(1 + iωτ), γ = share/(1 − Σ share): complex modulus over that at rest.
[[nodiscard]] std::complex<double> modulus_ratio(
    const std::vector<ElasticMaterial::Branch>& branches, double frequency_hz);

}  // namespace palpate
