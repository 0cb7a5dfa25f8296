// SPDX-License-Identifier: Apache-2.0
// lockstep_links.h — the four links between the nodes of a lockstep run.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include "common/core/clock.h"
#include "common/core/messages.h"
#include "common/core/ports.h"

namespace palpate {

/// What carries the messages between the nodes.
enum class LockstepLinks : std::uint8_t {
  kMemory,  ///< structs in a queue
  kInproc,  ///< encoded, sent through ZeroMQ sockets and decoded; gives the same bits
};

/// Both ends of each link.
struct Links {
  virtual ~Links() = default;
  Sender<DeviceState>* state_out = nullptr;
  Source<DeviceState>* state_in = nullptr;
  Sender<ForceCommand>* command_out = nullptr;
  Source<ForceCommand>* command_in = nullptr;
  Sender<ToolMotion>* motion_out = nullptr;
  Source<ToolMotion>* motion_in = nullptr;
  Sender<Interaction>* interaction_out = nullptr;
  Source<Interaction>* interaction_in = nullptr;
};

/// How the links drive the virtual time.
struct LinkHooks {
  std::function<void()> on_state_sent;
  std::function<void()> on_motion_sent;
  std::function<void(TimePoint deadline)> on_wait;  ///< a node waits for a message
};

/// @param physics_clock  of the host of the physics; both clocks must outlive the result
[[nodiscard]] std::unique_ptr<Links> make_links(LockstepLinks kind, const Clock& clock,
                                                const Clock& physics_clock, const LinkHooks& hooks);

}  // namespace palpate
