#include "physics_node/process.h"

#include <chrono>

#include "common/core/inbox.h"
#include "common/runtime/flight_recorder.h"
#include "common/runtime/rate_loop.h"
#include "common/runtime/refused_peers_log.h"
#include "common/runtime/rejection_log.h"
#include "common/runtime/telemetry_publisher.h"
#include "physics_node/physics_node.h"
#include "physics_node/scene_display.h"

namespace palpate::physics {
namespace {

// How soon a stop is noticed while no motion arrives.
constexpr auto kIdleWait = std::chrono::milliseconds(50);

}  // namespace

void run_process(NodeContext& context, ProcessLinks& links) {
  const Session& session = context.session;

  // hops 2 and 3; a fault line must see every message, else the newest is enough
  ZmqSource<ToolMotion> motions(
      links.side, context.clock, bind_to(session.links.tool_motion, "links.tool_motion"),
      session.faults.tool_motion.any() ? Delivery::kEvery : Delivery::kNewest);
  motions.keep_to_one_writer();
  Inbox<ToolMotion> motion_in(motions, context.clock, session.faults.tool_motion,
                              stream_seed(session.seed, "tool_motion"));
  ZmqSender<Interaction> interaction_out(links.side,
                                         bind_to(session.links.interaction, "links.interaction"));

  // hop 5
  SceneSender telemetry(links.side,
                        bind_to(session.links.physics_telemetry, "links.physics_telemetry"));
  RingSink<PhysicsTick> ticks;
  Snapshot<PhysicsCounters> counters;
  FlightRecorder<PhysicsTick> recorder(flight_files(context, "physics"));
  RejectionLog refused(context.log, "tool_motion", motions.rejections());
  SceneDisplay display(session, context.session_id, telemetry, telemetry);
  RefusedPeersLog refused_peers(context.log, links.side.refused());
  TelemetryPublisher publisher(context.session_id, context.clock, ticks, counters, telemetry,
                               context.log);
  publisher.record_to(recorder);
  publisher.peers_refused = [&] { return links.side.refused().total(); };
  publisher.on_pump = [&](TimePoint now) {
    refused_peers.note(now);
    refused.note(now);
    display.publish({.scene_subscriptions = telemetry.subscriptions<SceneState>(),
                     .mesh_subscriptions = telemetry.subscriptions<MeshFrame>(),
                     .has_mesh_watcher = telemetry.has_subscriber<MeshFrame>()},
                    publisher.newest(), now);
  };
  publisher.start();

  PhysicsNode node(session.scene, session.physics, session.mofc.interaction, context.clock,
                   motion_in, interaction_out, ticks, context.session_id);
  const auto step = [&](const Tick& tick) {
    node.step(tick);
    counters.store(node.counters());
  };
  if (session.mofc.wait_for_physics.count() == 0) {
    RateLoop(context.clock, session.physics.rate_hz).run(context.stop, step);
    return;
  }
  std::uint64_t index = 0;
  while (!context.stop.stop_requested()) {
    motion_in.wait_until(context.clock.now() + kIdleWait);
    if (!node.has_new_motion()) continue;
    const TimePoint now = context.clock.now();
    step({.index = index++, .scheduled_at = now, .now = now});
  }
}

}  // namespace palpate::physics
