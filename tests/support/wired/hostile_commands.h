// SPDX-License-Identifier: Apache-2.0
// hostile_commands.h — commands of nobody who would clamp them.
#pragma once

#include <cstdint>

#include "common/core/random.h"
#include "common/core/vector.h"

namespace palpate::test {

/// Pushes against the hand's motion, so that it puts energy in, then along it or anywhere, with any
/// force, for as long as it may.
class HostileCommands {
 public:
  HostileCommands(std::uint64_t seed, double most_newton)
      : random_(seed), most_newton_(most_newton) {}

  Vector3 next(const Vector3& hand_m) {
    const Vector3 moved = hand_m - last_m_;
    last_m_ = hand_m;
    if (moved.norm() > 0.0) way_ = moved.normalized();
    if (left_-- == 0) {
      left_ = 1 + random_.below(60);
      kind_ = random_.below(6);
      newton_ =
          random_.chance(0.2) ? random_.uniform(0.0, 0.3) : random_.uniform(0.3, most_newton_);
      direction_ = random_.direction();
    }
    switch (kind_) {
      case 0:
        return newton_ * way_;
      case 1:
      case 2:
      case 3:
        return -newton_ * way_;
      default:
        return newton_ * direction_;
    }
  }

 private:
  Random random_;
  double most_newton_;
  std::uint64_t left_ = 0;
  std::uint64_t kind_ = 0;
  double newton_ = 0.0;
  Vector3 direction_ = Vector3::UnitZ();
  Vector3 way_ = Vector3::UnitX();
  Vector3 last_m_ = Vector3::Zero();
};

}  // namespace palpate::test
