// SPDX-License-Identifier: Apache-2.0
// process.h — mofc_node connected to the world: sockets, the answering loop, telemetry.
#pragma once

#include <cstdint>
#include <memory>

#include "common/link/rejections.h"
#include "common/process/process_links.h"
#include "common/process/run_node.h"

namespace palpate::mofc {

/// Runs until context.stop. Throws SetupError.
void run_process(NodeContext& context, ProcessLinks& links);

/// Who sends and receives hops 2 and 3 of a Clamp.
enum class ClampThreads : std::uint8_t {
  kNone,       ///< the thread that calls it, which libzmq makes allocate and lock
  kOfPhysics,  ///< threads of their own: the caller does neither
};

/// The clamp and all its links except the exchange, for a device in the same process. All functions
/// are called by one thread, which waits.
class Clamp {
 public:
  /// @param refused  of `states`
  Clamp(NodeContext& context, ZmqContext& side, Source<DeviceState>& states,
        Sender<ForceCommand>& commands, const Rejections& refused,
        ClampThreads threads = ClampThreads::kNone);
  ~Clamp();
  Clamp(const Clamp&) = delete;
  Clamp& operator=(const Clamp&) = delete;

  /// Returns when a state may have arrived, or at `deadline`.
  void wait_until(TimePoint deadline) noexcept;
  /// When a state delayed by a fault line is due; TimePoint::max() if none.
  [[nodiscard]] TimePoint next_due() const noexcept;
  /// Answers the next state; false if there is none.
  bool answer_next() noexcept;
  /// What can wait until the device has its answer.
  void finish_turn() noexcept;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::mofc
