// SPDX-License-Identifier: Apache-2.0
// random.h — seeded random numbers that are identical on every machine. The standard specifies the
// output of its engines but not of its distributions, so the distributions are implemented here.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>
#include <string_view>

#include "common/core/vector.h"

namespace palpate {

/// 64-bit FNV-1a of the bytes of `text`. Not cryptographic: for seeds, tags and comparisons.
[[nodiscard]] constexpr std::uint64_t fnv1a(std::string_view text) noexcept {
  std::uint64_t hash = 14695981039346656037ULL;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ULL;
  return hash;
}

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  /// In [0, 1).
  double uniform() { return static_cast<double>(engine_() >> 11) * 0x1.0p-53; }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// In [0, n); n ≥ 1.
  std::uint64_t below(std::uint64_t n) { return engine_() % n; }
  bool chance(double probability) { return uniform() < probability; }

  /// Mean 0, variance 1 (Box–Muller, one of the pair).
  double normal() {
    const double r = std::sqrt(-2.0 * std::log(1.0 - uniform()));
    return r * std::cos(2.0 * std::numbers::pi * uniform());
  }

  /// Uniform on the unit sphere.
  Vector3 direction() {
    const double z = uniform(-1.0, 1.0);
    const double azimuth = uniform(0.0, 2.0 * std::numbers::pi);
    const double r = std::sqrt(1.0 - z * z);
    return {r * std::cos(azimuth), r * std::sin(azimuth), z};
  }

  std::uint64_t bits() { return engine_(); }

 private:
  std::mt19937_64 engine_;
};

}  // namespace palpate
