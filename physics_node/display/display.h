// SPDX-License-Identifier: Apache-2.0
// display.h — what a physics sends to viewers beside its telemetry, and when.
#pragma once

#include <cstdint>
#include <span>

#include "common/core/scene_messages.h"
#include "common/session/session.h"
#include "common/telemetry/telemetry.h"

namespace palpate::physics {

/// The subscriptions of the connected viewers.
struct Watchers {
  std::uint64_t scene_subscriptions = 0;  ///< since the start
  std::uint64_t mesh_subscriptions = 0;   ///< since the start
  bool has_mesh_watcher = false;          ///< at present
};

/// Thread: the publisher's. The haptic step does not depend on it.
class Display {
 public:
  virtual ~Display() = default;

  /// Sends the scene to new subscribers, and what has moved since the last frame.
  /// @param newest  newest physics step of each tool, at the time of moving tissue; none before its
  ///                first motion
  virtual void publish(const Watchers& watchers, std::span<const PhysicsTick> newest,
                       TimePoint now) = 0;
  /// The link dropped the scene because it exceeds the message size: viewers have none.
  [[nodiscard]] virtual bool is_too_large() const = 0;
  /// Sets the counters of mesh frames made and skipped.
  virtual void count_into(PhysicsCounters& counters) const = 0;
};

/// Longest pause between two frames of a moving surface.
inline constexpr Duration kFrameInterval = std::chrono::nanoseconds(1'000'000'000 / 30);

/// The scene without its tissues: what follows from the session. Revision 0.
[[nodiscard]] SceneState scene_of(const Session& session, std::uint64_t session_id);

}  // namespace palpate::physics
