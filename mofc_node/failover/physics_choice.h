// SPDX-License-Identifier: Apache-2.0
// physics_choice.h — which of two physics a side uses: the rule of theory.md §5.1.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "common/core/physics_term.h"
#include "common/core/time.h"

namespace palpate::mofc {

/// What is heard of one physics at one answer.
struct HeardPhysics {
  bool has_answered = false;  ///< the present device session
  bool is_lost = false;       ///< its connection has ended, or it costs too much
  Duration silence{};         ///< since it last answered a newer motion; 0 before the first
  std::uint64_t term = 0;     ///< the highest it has reported
};

/// 1. The term grows to the highest one heard of.
/// 2. The physics that the term names is used as soon as it is heard.
/// 3. If the physics in use is silent and the other is heard, that one is used; if the term does
/// not
///    name it, the term grows by one.
///
/// Heard: it answered a newer motion within half of `silence`. Silent: no such answer for
/// `silence`, or its connection has ended; of one that has never answered, for two seconds. Between
/// the two nothing changes, so that a pause of a network that both share changes nothing. Only this
/// host's clock is used. No allocation, no throw.
class PhysicsChoice {
 public:
  explicit PhysicsChoice(Duration silence) : silence_(silence) {}

  /// A new device session: nobody has answered it yet.
  void begin_session() noexcept { began_at_.reset(); }

  /// Once per DeviceState.
  /// @return the physics to use
  PhysicsRole step(const std::array<HeardPhysics, kPhysicsRoles>& heard, TimePoint now) noexcept;

  [[nodiscard]] PhysicsRole in_use() const noexcept { return in_use_; }
  [[nodiscard]] std::uint64_t term() const noexcept { return term_; }
  /// Times that the physics in use has changed.
  [[nodiscard]] std::uint64_t switches() const noexcept { return switches_; }

 private:
  [[nodiscard]] bool is_heard(const HeardPhysics& physics) const noexcept;
  [[nodiscard]] bool is_silent(const HeardPhysics& physics, TimePoint now) const noexcept;
  void use(PhysicsRole role) noexcept;

  Duration silence_;
  std::uint64_t term_ = 0;
  PhysicsRole in_use_ = PhysicsRole::kFirst;
  std::uint64_t switches_ = 0;
  std::optional<TimePoint> began_at_;
};

}  // namespace palpate::mofc
