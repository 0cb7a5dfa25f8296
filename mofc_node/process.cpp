#include "mofc_node/process.h"

#include <algorithm>
#include <chrono>

#include "common/core/inbox.h"
#include "common/runtime/flight_recorder.h"
#include "common/runtime/realtime.h"
#include "common/runtime/rejection_log.h"
#include "common/runtime/telemetry_publisher.h"
#include "mofc_node/mofc_node.h"

namespace palpate::mofc {
namespace {

// How soon a stop is noticed while no device speaks.
constexpr auto kIdleWait = std::chrono::milliseconds(50);

}  // namespace

void run_process(NodeContext& context, ProcessLinks& links) {
  const Session& session = context.session;
  const FaultsConfig& faults = session.faults;

  // hops 1 and 4
  ExchangeServer exchange(links.exchange, context.clock,
                          bind_to(session.links.exchange, "links.exchange"));
  Inbox<DeviceState> state_in(exchange, context.clock, faults.device_state,
                              stream_seed(session.seed, "device_state"));

  // hops 2 and 3; a fault line must see every message, else the newest is enough
  ZmqSender<ToolMotion> motion_out(links.side,
                                   connect_to(session.links.tool_motion, "links.tool_motion"));
  ZmqSource<Interaction> interactions(
      links.side, context.clock, connect_to(session.links.interaction, "links.interaction"),
      faults.interaction.any() ? Delivery::kEvery : Delivery::kNewest);
  Inbox<Interaction> interaction_in(interactions, context.clock, faults.interaction,
                                    stream_seed(session.seed, "interaction"));

  // hop 5
  ZmqSender<MofcBatch> telemetry(links.side,
                                 bind_to(session.links.mofc_telemetry, "links.mofc_telemetry"));
  RingSink<MofcTick> ticks;
  Snapshot<MofcCounters> counters;
  FlightRecorder<MofcTick> recorder(flight_files(context, "mofc"));
  RejectionLog refused_states(context.log, "device_state", exchange.rejections());
  RejectionLog refused_interactions(context.log, "interaction", interactions.rejections());
  TelemetryPublisher publisher(context.session_id, context.clock, ticks, counters, telemetry,
                               context.log, session.side);
  publisher.record_to(recorder);
  publisher.on_pump = [&](TimePoint now) {
    refused_states.note(now);
    refused_interactions.note(now);
  };
  publisher.start();

  // every DeviceState is answered in order; what can wait comes after the answer
  MofcNode node(session.mofc, session.device, context.clock, motion_out, interaction_in, ticks,
                context.session_id);
  context.log.info("event=realtime {}", enter_realtime(session.realtime).text);
  while (!context.stop.stop_requested()) {
    state_in.wait_until(context.clock.now() + kIdleWait);
    while (const Received<DeviceState>* state = state_in.next()) {
      exchange.send(node.answer(*state));
      node.finish_turn();
    }
    MofcCounters now = node.counters();
    now.device_state = state_in.counters();
    counters.store(now);
  }
}

}  // namespace palpate::mofc
