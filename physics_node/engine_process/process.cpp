// SPDX-License-Identifier: Apache-2.0
#include "physics_node/engine_process/process.h"

#include <algorithm>
#include <chrono>
#include <list>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "common/core/check.h"
#include "common/core/inbox.h"
#include "common/link/scene_sender.h"
#include "common/link/zmq_sender.h"
#include "common/link/zmq_source.h"
#include "common/process/heap_trim.h"
#include "common/process/rate_loop.h"
#include "common/process/refused_peers_log.h"
#include "common/process/rejection_log.h"
#include "common/telemetry/flight_recorder.h"
#include "common/telemetry/telemetry_publisher.h"
#include "physics_node/answer/speaker.h"
#include "physics_node/physics_node.h"

namespace palpate::physics {
namespace {

// Longest delay until a stop is noticed while no motion arrives.
constexpr auto kIdleWait = std::chrono::milliseconds(50);

/// Where one physics has the links of one side.
struct Ends {
  const char* node;
  Attachment tool_motion;
  Attachment interaction;
  const LinkFaults& motion_faults;
  const char* stream;
};
Ends ends_of(const Session& session, const LinksConfig& links, PhysicsRole role) {
  if (role == PhysicsRole::kFirst) {
    return {.node = "physics",
            .tool_motion = bind_to(links.tool_motion, "links.tool_motion"),
            .interaction = bind_to(links.interaction, "links.interaction"),
            .motion_faults = session.faults.tool_motion,
            .stream = "tool_motion"};
  }
  return {.node = "standby",
          .tool_motion = bind_to(links.standby_tool_motion, "links.standby_tool_motion"),
          .interaction = bind_to(links.standby_interaction, "links.standby_interaction"),
          .motion_faults = session.faults.standby_tool_motion,
          .stream = "standby_tool_motion"};
}

/// Hop 5 of one of two physics: only the one that speaks sends, so viewers see one tissue.
class SpokenTelemetry final : public Sender<PhysicsBatch> {
 public:
  SpokenTelemetry(SceneSender& out, const Speaker* speaker) : out_(out), speaker_(speaker) {}
  SendResult send(const PhysicsBatch& batch) noexcept override {
    return is_speaking() ? out_.send(batch) : SendResult::kNoPeer;
  }
  [[nodiscard]] bool is_speaking() const noexcept {
    return speaker_ == nullptr || speaker_->is_speaking();
  }
  /// The subscriptions so far; whoever begins to speak counts them as new.
  [[nodiscard]] Watchers watchers() noexcept {
    if (!is_speaking()) {
      begun_ = false;
      return {};
    }
    if (speaker_ != nullptr && !begun_) ++beginnings_;
    begun_ = true;
    return {.scene_subscriptions = out_.subscriptions<SceneState>() + beginnings_,
            .mesh_subscriptions = out_.subscriptions<MeshFrame>() + beginnings_,
            .has_mesh_watcher = out_.has_subscriber<MeshFrame>()};
  }

 private:
  SceneSender& out_;
  const Speaker* speaker_;
  bool begun_ = false;
  std::uint64_t beginnings_ = 0;
};

/// One tool: hops 2 and 3 of one device, and their telemetry.
class Tool {
 public:
  /// @param side  of that device
  /// @param ends  of its links here
  Tool(const Session& session, const Side& side, const Ends& ends, Engine& engine,
       NodeContext& context, ProcessLinks& links, Sender<PhysicsBatch>& telemetry, Speaker* speaker)
      : clock_(context.clock),
        log_(context.log.clone(with_side(side.name, context.log.name()))),
        motions_(links.side, context.clock, ends.tool_motion),
        motion_in_(motions_, context.clock, ends.motion_faults,
                   stream_seed(session, side, ends.stream)),
        interaction_out_(links.side, ends.interaction),
        recorder_(flight_files(context, with_side(side.name, ends.node))),
        refused_(*log_, "tool_motion", motions_.rejections()),
        publisher(context.session_id, context.clock, ticks_, counters_, telemetry, *log_,
                  side.name),
        engine_(engine),
        node_(engine, session.physics, side.mofc.interaction, context.clock, motion_in_,
              interaction_out_, ticks_, context.session_id, speaker) {
    motions_.keep_to_one_writer();
    publisher.record_to(recorder_);
    publisher.peers_refused = [&links] { return links.side.refused().total(); };
  }

  void note_refused(TimePoint now) { refused_.note(now); }

  void step(const Tick& tick) {
    node_.step(tick);
    counters_.store(node_.counters());
    engine_.rethrow();
  }
  /// Waits for a motion that no step has used; false if there is none yet.
  [[nodiscard]] bool wait_for_motion() {
    motion_in_.wait_until(clock_.now() + kIdleWait);
    return node_.has_new_motion();
  }

 private:
  SteadyClock& clock_;
  std::shared_ptr<spdlog::logger> log_;
  ZmqSource<ToolMotion> motions_;
  Inbox<ToolMotion> motion_in_;
  ZmqSender<Interaction> interaction_out_;
  RingSink<PhysicsTick> ticks_;
  Snapshot<PhysicsCounters> counters_;
  FlightRecorder<PhysicsTick> recorder_;
  RejectionLog refused_;

 public:
  TelemetryPublisher<PhysicsTick, PhysicsCounters> publisher;

 private:
  Engine& engine_;
  PhysicsNode node_;
};

}  // namespace

void run_process(NodeContext& context, ProcessLinks& links, const PhysicsProgram& program) {
  const Session& session = context.session;
  const std::vector<Side>& sides = session.sides;

  // hop 5: one socket, so the publisher of the first tool sends for all
  SceneSender telemetry(links.side,
                        program.role == PhysicsRole::kFirst
                            ? bind_to(session.physics_telemetry, "links.physics_telemetry")
                            : bind_to(session.standby_telemetry, "links.standby_telemetry"));
  std::optional<Speaker> speaker;
  if (session.physics.standby) speaker.emplace(program.role);
  Speaker* const shared = speaker ? &*speaker : nullptr;
  SpokenTelemetry spoken(telemetry, shared);
  std::vector<std::unique_ptr<Engine>> engines;
  engines.reserve(sides.size());
  for (const Side& side : sides) engines.push_back(program.make_engine(side));
  const std::unique_ptr<Display> display = program.make_display(telemetry, telemetry);
  RefusedPeersLog refused_peers(context.log, links.side.refused());
  HeapTrim heap;
  std::list<Tool> tools;
  for (std::size_t i = 0; i < sides.size(); ++i) {
    Tool& tool =
        tools.emplace_back(session, sides[i], ends_of(session, sides[i].links, program.role),
                           *engines[i], context, links, spoken, shared);
    tool.publisher.add_counts = [&](PhysicsCounters& counts) {
      display->count_into(counts);
      if (program.count_into) program.count_into(counts);
    };
  }
  TelemetryPublisher<PhysicsTick, PhysicsCounters>& publisher = tools.front().publisher;
  std::vector<PhysicsTick> newest;
  bool has_warned = false;
  publisher.on_pump = [&](TimePoint now) {
    refused_peers.note(now);
    heap.note(now);
    newest.clear();
    for (Tool& tool : tools) {
      if (&tool != &tools.front()) tool.publisher.pump();
      if (tool.publisher.newest()) {
        newest.push_back(*tool.publisher.newest());
        if (speaker) newest.back().stepped_at += speaker->scene_ahead();
      }
      tool.note_refused(now);
    }
    if (program.on_pump) program.on_pump(now);
    if (const Watchers watchers = spoken.watchers(); spoken.is_speaking()) {
      display->publish(watchers, newest, now);
    }
    if (display->is_too_large() && !std::exchange(has_warned, true)) {
      context.log.warn(
          "event=scene_not_sent reason=\"longer than 16 MiB: viewers show no tissue; use fewer or "
          "smaller meshes\"");
    }
  };
  publisher.start();

  if (session.side().mofc.wait_for_physics.count() == 0) {
    RateLoop(context.clock, session.physics.rate_hz).run(context.stop, [&](Tick tick) {
      if (program.before_step) program.before_step();
      for (Tool& tool : tools) {
        tool.step(tick);
        tick.now = context.clock.now();
      }
    });
  } else {  // one device only
    std::uint64_t index = 0;
    while (!context.stop.stop_requested()) {
      if (!tools.front().wait_for_motion()) continue;
      if (program.before_step) program.before_step();
      const TimePoint now = context.clock.now();
      tools.front().step({.index = index++, .scheduled_at = now, .now = now});
    }
  }
  publisher.stop();  // before the destruction of the tools whose publishers it drives
}

}  // namespace palpate::physics
