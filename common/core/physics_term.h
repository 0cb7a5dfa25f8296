// SPDX-License-Identifier: Apache-2.0
// physics_term.h — which of two physics_nodes speaks.
#pragma once

#include <cstddef>
#include <cstdint>

namespace palpate {

enum class PhysicsRole : std::uint8_t {
  kFirst = 0,    ///< speaks at the start
  kStandby = 1,  ///< physics.standby
};
inline constexpr std::size_t kPhysicsRoles = 2;

[[nodiscard]] inline constexpr PhysicsRole other(PhysicsRole role) noexcept {
  return role == PhysicsRole::kFirst ? PhysicsRole::kStandby : PhysicsRole::kFirst;
}
[[nodiscard]] inline constexpr std::size_t index_of(PhysicsRole role) noexcept {
  return static_cast<std::size_t>(role);
}

/// A term is a number that only grows; every side and both physics keep the highest that they have
/// heard of and repeat it in every message (docs/theory.md §5.1).
inline constexpr std::uint64_t kMaxPhysicsTerm = (std::uint64_t{1} << 62) - 1;
/// The physics that a term names.
[[nodiscard]] inline constexpr PhysicsRole speaker_of(std::uint64_t term) noexcept {
  return term % 2 == 0 ? PhysicsRole::kFirst : PhysicsRole::kStandby;
}

}  // namespace palpate
