// SPDX-License-Identifier: Apache-2.0
// reading_observer.h — adds to the record of a tick what device_node itself does not know.
#pragma once

#include "common/core/workspace_map.h"
#include "common/telemetry/device_telemetry.h"

namespace palpate::device {

/// Called on the tick's thread after each reading, and after a fault was latched. Does not
/// allocate, lock, log or throw.
class ReadingObserver {
 public:
  virtual ~ReadingObserver() = default;
  /// @param workspace  from the hand (D) to the tool (W), as of this reading
  virtual void on_reading(const WorkspaceMap& workspace, DeviceTick& record) noexcept = 0;
};

}  // namespace palpate::device
