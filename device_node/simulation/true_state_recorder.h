// SPDX-License-Identifier: Apache-2.0
// true_state_recorder.h — the true state of a simulated device, for telemetry.
#pragma once

#include "device_node/device.h"
#include "device_node/reading_observer.h"
#include "device_node/simulation/true_state.h"

namespace palpate::device {

/// Writes the true state of a device into the records of its tick; nothing for real hardware.
class TrueStateRecorder final : public ReadingObserver {
 public:
  /// @param device  must outlive the recorder
  explicit TrueStateRecorder(const HapticDevice& device)
      : source_(dynamic_cast<const TrueStateSource*>(&device)) {}

  void on_reading(const WorkspaceMap& workspace, DeviceTick& record) noexcept override {
    if (source_ == nullptr) return;
    const TrueState truth = source_->true_state();
    record.true_tool_position_world_m = workspace.tool_position_world_m(truth.hand_position_m);
    record.true_tool_velocity_world_m_per_s =
        workspace.tool_velocity_world_m_per_s(truth.hand_velocity_m_per_s);
    record.true_energy_joule = truth.energy_joule;
    record.minimum_true_energy_joule = truth.minimum_energy_joule;
    if (!truth.wrist) return;
    record.true_wrist_angle_rad = truth.wrist->angle_rad;
    record.true_wrist_velocity_rad_per_s = truth.wrist->velocity_rad_per_s;
  }

 private:
  const TrueStateSource* source_;
};

}  // namespace palpate::device
