// SPDX-License-Identifier: Apache-2.0
#include "deploy/lockstep/lockstep_links.h"

#include "common/core/check.h"
#include "common/core/memory_link.h"
#include "common/link/exchange_client.h"
#include "common/link/exchange_server.h"
#include "common/link/zmq_sender.h"
#include "common/link/zmq_source.h"

namespace palpate {
namespace {

struct MemoryLinks final : Links {
  MemoryLinks(const Clock& clock, const Clock& physics_clock, const LinkHooks& hooks)
      : state(clock), command(clock), motion(physics_clock), interaction(clock) {
    state.on_send = hooks.on_state_sent;
    motion.on_send = hooks.on_motion_sent;
    command.on_wait = hooks.on_wait;
    interaction.on_wait = hooks.on_wait;
    state_out = &state;
    state_in = &state;
    command_out = &command;
    command_in = &command;
    motion_out = &motion;
    motion_in = &motion;
    interaction_out = &interaction;
    interaction_in = &interaction;
  }
  MemoryLink<DeviceState> state;
  MemoryLink<ForceCommand> command;
  MemoryLink<ToolMotion> motion;
  MemoryLink<Interaction> interaction;
};

struct InprocLinks final : Links {
  InprocLinks(const Clock& clock, const Clock& physics_clock, const LinkHooks& hooks)
      : server(context, clock, bind_to("inproc://exchange", "lockstep")),
        client(context, clock, connect_to("inproc://exchange", "lockstep")),
        motion_source(context, physics_clock, bind_to("inproc://tool_motion", "lockstep")),
        motion_sender(context, connect_to("inproc://tool_motion", "lockstep")),
        interaction_sender(context, bind_to("inproc://interaction", "lockstep")),
        interaction_source(context, clock, connect_to("inproc://interaction", "lockstep")) {
    // senders drop what is sent before they know their receiver
    motion_source.wait_until(clock.now());
    interaction_source.wait_until(clock.now());
    const bool is_wired = motion_sender.wait_for_peer(std::chrono::seconds(5)) &&
                          interaction_sender.wait_for_peer(std::chrono::seconds(5)) &&
                          client.wait_for_peer(std::chrono::seconds(5));
    PALPATE_REQUIRE(is_wired);

    client.on_send = hooks.on_state_sent;
    motion_sender.on_send = hooks.on_motion_sent;
    client.on_wait = hooks.on_wait;
    interaction_source.on_wait = hooks.on_wait;
    state_out = &client;
    state_in = &server;
    command_out = &server;
    command_in = &client;
    motion_out = &motion_sender;
    motion_in = &motion_source;
    interaction_out = &interaction_sender;
    interaction_in = &interaction_source;
  }
  ZmqContext context;
  ExchangeServer server;
  ExchangeClient client;
  ZmqSource<ToolMotion> motion_source;
  ZmqSender<ToolMotion> motion_sender;
  ZmqSender<Interaction> interaction_sender;
  ZmqSource<Interaction> interaction_source;
};

}  // namespace

std::unique_ptr<Links> make_links(LockstepLinks kind, const Clock& clock,
                                  const Clock& physics_clock, const LinkHooks& hooks) {
  if (kind == LockstepLinks::kMemory)
    return std::make_unique<MemoryLinks>(clock, physics_clock, hooks);
  return std::make_unique<InprocLinks>(clock, physics_clock, hooks);
}

}  // namespace palpate
