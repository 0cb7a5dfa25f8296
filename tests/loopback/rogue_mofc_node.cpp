// SPDX-License-Identifier: Apache-2.0
// rogue_mofc_node: takes mofc_node's place and lies. It commands 20 N along the last motion of the
// hand, for as long as the wire allows, whatever the energy. For guarantee_processes_test.
#include <chrono>

#include "common/core/inbox.h"
#include "common/link/exchange_server.h"
#include "common/process/process_links.h"
#include "common/process/run_node.h"

namespace {

using namespace palpate;

constexpr double kForceNewton = 20.0;
constexpr auto kLease = std::chrono::seconds(1);
constexpr auto kIdleWait = std::chrono::milliseconds(50);

void run_rogue(NodeContext& context) {
  ProcessLinks links(context.session.side().realtime);
  ExchangeServer exchange(links.exchange, context.clock,
                          bind_to(context.session.side().links.exchange, "links.exchange"));
  Inbox<DeviceState> states(exchange, context.clock);
  Vector3 position_m = Vector3::Zero();
  Vector3 along = Vector3::UnitZ();
  std::uint64_t sequence = 0;
  while (!context.stop.stop_requested()) {
    states.wait_until(context.clock.now() + kIdleWait);
    while (const Received<DeviceState>* received = states.next()) {
      const DeviceState& state = received->value;
      const Vector3 moved = state.hand_position_m - position_m;
      position_m = state.hand_position_m;
      if (moved.norm() > 0.0) along = moved.normalized();
      exchange.send({.header = {.session_id = context.session_id,
                                .sequence = sequence++,
                                .sampled_at = context.clock.now()},
                     .answers_session_id = state.header.session_id,
                     .answers_sequence = state.header.sequence,
                     .answers_sampled_at = state.header.sampled_at,
                     .force_on_hand_newton = kForceNewton * along,
                     .valid_for = kLease});
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  return run_node(argc, argv,
                  {.name = "rogue_mofc",
                   .description = "Lies in place of mofc_node, for tests.",
                   .is_of_one_side = true},
                  run_rogue);
}
