// SPDX-License-Identifier: Apache-2.0
/// @file
/// leak_gate.h — closes while a force that is late or held generates energy.
#pragma once

#include <algorithm>
#include <cmath>

namespace palpate::controllers {

/// The store S of docs/theory.md §2.7, in [−S_g, S_g]: grows with the friction's work, falls by
/// what holding the force has leaked, and recovers to S_g. Energies alone, so for any number of
/// axes. No allocation, no throw.
class LeakGate {
 public:
  /// Open. @param most_joule  S_g > 0   @param recovery_s  t_rec > 0
  LeakGate(double most_joule, double recovery_s)
      : most_joule_(most_joule), recovery_s_(recovery_s), store_joule_(most_joule) {}
  /// S ← S_g.
  void open() noexcept { store_joule_ = most_joule_; }

  /// @param joule  dissipated by friction up to now, by the ledger's count
  void dissipated(double joule) noexcept {
    store_joule_ += std::max(0.0, joule - dissipated_joule_);
    dissipated_joule_ = joule;
  }
  /// @param joule  ½ s ΔF_e·Δx, below 0 where the force has leaked
  void held(double joule) noexcept { store_joule_ += joule; }
  /// @param elapsed_s  ≥ 0, since the step before
  void recover(double elapsed_s) noexcept {
    store_joule_ += (most_joule_ - store_joule_) * (1.0 - std::exp(-elapsed_s / recovery_s_));
    store_joule_ = std::clamp(store_joule_, -most_joule_, most_joule_);
  }

  /// S / S_g, within 0 … 1.
  [[nodiscard]] double gate() const noexcept {
    return std::max(0.0, store_joule_ / most_joule_);  // the store is ≤ S_g
  }

 private:
  double most_joule_;
  double recovery_s_;
  double store_joule_;
  double dissipated_joule_ = 0.0;  // at the last step
};

}  // namespace palpate::controllers
