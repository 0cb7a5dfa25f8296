// SPDX-License-Identifier: Apache-2.0
// material.h — what an elastic body is made of.
#pragma once

#include <cstddef>
#include <cstdint>

namespace palpate::elastic {

/// Energy per undeformed volume, with F the deformation gradient, R its rotation (polar
/// decomposition F = R S), E = ½(FᵀF − I), J = det F, µ and λ the Lamé parameters:
enum class Law : std::uint8_t {
  /// µ |F − R|² + λ/2 tr²(S − I): the small-strain law in the frame that turns with the material
  kCorotational,
  /// µ |E|² + λ/2 tr²E. Softens when compressed beyond 42 % in one direction, and an element that
  /// is turned inside out may rest there: not for strong indentation
  kStVenantKirchhoff,
  /// µ/2 (|F|² − 3) − µ (J − 1) + (λ + µ)/2 (J − 1)²: [Smith18] eq. (13), finite for every F
  kStableNeoHookean,
};

/// A spring and a dashpot in series (Maxwell), beside the springs of the material.
inline constexpr std::size_t kMostBranches = 8;  ///< of a body

struct Branch {
  double share = 0.0;  ///< of the modulus at once, in (0, 1)
  double tau_s = 0.0;  ///< > 0
};

struct Material {
  double young_modulus_pa = 10e3;     ///< > 0
  double poisson_ratio = 0.45;        ///< in (−1, 0.5)
  double density_kg_per_m3 = 1000.0;  ///< > 0
  double mass_damping_per_s = 0.0;    ///< Rayleigh's α ≥ 0: force −α M v
  double stiffness_damping_s =
      0.0;  ///< β ≥ 0: viscous stress β C Ė; Rayleigh's β K v at small strain

  /// µ, λ [Pa]
  [[nodiscard]] double mu() const noexcept {
    return 0.5 * young_modulus_pa / (1.0 + poisson_ratio);
  }
  [[nodiscard]] double lambda() const noexcept {
    return young_modulus_pa * poisson_ratio / ((1.0 + poisson_ratio) * (1.0 - 2.0 * poisson_ratio));
  }
};

}  // namespace palpate::elastic
