// SPDX-License-Identifier: Apache-2.0
// tissue_changes.h — hop 8: changes of tissues that viewers ask for, checked and handed to the
// step.
//
//   in   hop 8  TissueChange  viewer → physics   only with viewer.control
//
// Threads: receive() on the publisher's, apply() on the thread of the steps.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "common/core/ports.h"
#include "common/core/scene_messages.h"
#include "common/core/spsc_ring.h"
#include "common/session/scene_config.h"
#include "common/telemetry/physics_telemetry.h"

namespace palpate::physics {

class TissueChanges {
 public:
  /// `source` must outlive this.
  TissueChanges(const SceneConfig& scene, Source<TissueChange>& source);

  /// Takes the changes that have arrived. The codec has checked the constants; a tissue that the
  /// scene does not have, that had neither stiffness nor damping, or that is to be restored and
  /// cannot be ablated, is refused.
  /// @param on_accepted  called for each accepted change
  void receive(const std::function<void(const TissueChange&)>& on_accepted);

  /// Hands out the next accepted change; false if there is none. Real-time safe.
  bool next(TissueChange& change) noexcept { return accepted_.pop(change); }

  /// Sets the counters of changes.
  void count_into(PhysicsCounters& counters) const;

 private:
  Source<TissueChange>& source_;
  std::vector<bool> is_changeable_;  // by tissue
  std::vector<bool> is_restorable_;
  SpscRing<TissueChange> accepted_;
  std::uint64_t changes_ = 0;
  std::uint64_t refused_ = 0;
};

}  // namespace palpate::physics
