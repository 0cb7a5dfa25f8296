// SPDX-License-Identifier: Apache-2.0
// true_state.h — the exact state of a simulated device. The tick and the clamp never see it.
#pragma once

#include <optional>

#include "common/core/vector.h"

namespace palpate::device {

/// Of the joints of a wrist.
struct TrueWristState {
  Vector3 angle_rad = Vector3::Zero();
  Vector3 velocity_rad_per_s = Vector3::Zero();
};

struct TrueState {
  Vector3 hand_position_m = Vector3::Zero();        ///< D, before the encoder
  Vector3 hand_velocity_m_per_s = Vector3::Zero();  ///< D
  double energy_joule = 0.0;                        ///< E(t) of docs/theory.md §1
  double minimum_energy_joule = 0.0;                ///< over all inner steps so far, ≤ 0
  std::optional<TrueWristState> wrist = {};         ///< its energy is in those above
};

/// Implemented by devices that are simulations.
class TrueStateSource {
 public:
  virtual ~TrueStateSource() = default;
  /// As of the last reading or switch.
  [[nodiscard]] virtual TrueState true_state() const noexcept = 0;
};

}  // namespace palpate::device
