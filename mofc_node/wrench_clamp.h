// SPDX-License-Identifier: Apache-2.0
// wrench_clamp.h — the clamp of force and torque together.
#pragma once

#include <array>

#include "common/core/messages.h"
#include "common/core/vector.h"
#include "common/session/clamped_device.h"
#include "common/session/mofc_config.h"
#include "mofc_node/controllers/force_controller.h"
#include "mofc_node/controllers/ports/port_guard.h"

namespace palpate::mofc {

/// Mode `guard` for the axes of D and the three joints of a wrist as six ports of one pool
/// (docs/theory.md §2.8): what the hand does to the tool by turning it, a tissue may give back by
/// moving it. Isotropic friction is shared out to the axes, f_co/√3 each, and v_max counts on each
/// axis. Cap and gate are those of the session. No allocation, no throw.
class WrenchClamp {
 public:
  WrenchClamp(const MofcConfig& mofc, const ClampedDevice& device, const WristProfile& wrist);
  /// A new device session.
  void reset() noexcept { guard_.reset(); }

  struct Output {
    controllers::ControlOutput force;                 ///< and what holds for both
    Vector3 wrist_torque_newton_m = Vector3::Zero();  ///< on the hand, per joint
  };
  /// @param input  of the force; energies are those of force and torque together
  /// @param state  of a device with a wrist: `input` is what it reports
  /// @param applied  the stretches of `input`, as the device reports them
  /// @param requested_newton_m  per joint
  [[nodiscard]] Output step(const controllers::ControlInput& input, const DeviceState& state,
                            std::span<const AppliedForce> applied,
                            const Vector3& requested_newton_m) noexcept;

 private:
  controllers::PortGuard guard_;
  std::array<controllers::PortStretch, kMaxAppliedForces> stretches_{};
};

}  // namespace palpate::mofc
