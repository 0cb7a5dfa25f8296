// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/process.h"

#include <chrono>

#include "common/core/inbox.h"
#include "common/link/exchange_server.h"
#include "common/link/zmq_sender.h"
#include "common/link/zmq_source.h"
#include "common/process/realtime.h"
#include "common/process/refused_peers_log.h"
#include "common/process/rejection_log.h"
#include "common/telemetry/flight_recorder.h"
#include "common/telemetry/telemetry_publisher.h"
#include "mofc_node/mofc_node.h"

namespace palpate::mofc {
namespace {

// How soon a stop is noticed while no device speaks.
constexpr auto kIdleWait = std::chrono::milliseconds(50);

/// One below the device's tick: where both share a processor, the device acts on an answer before
/// this node finishes its turn. Not for threads that spin: the lower one would never run.
RealtimeConfig below_device(RealtimeConfig realtime) {
  if (realtime.priority > 1 && realtime.wait != WaitStrategy::kSpin) --realtime.priority;
  return realtime;
}

/// Hops 2 and 3 of physics.standby.
class StandbyEnds {
 public:
  StandbyEnds(NodeContext& context, ZmqContext& context_of_links, const Side& side)
      : motion_out_(context_of_links,
                    connect_to(side.links.standby_tool_motion, "links.standby_tool_motion")),
        interactions_(context_of_links, context.clock,
                      connect_to(side.links.standby_interaction, "links.standby_interaction")),
        interaction_in_(interactions_, context.clock, context.session.faults.standby_interaction,
                        stream_seed(context.session, side, "standby_interaction")),
        refused_(context.log, "standby_interaction", interactions_.rejections()) {}

  [[nodiscard]] std::optional<StandbyLinks> links() {
    return StandbyLinks{.motion_out = motion_out_, .interaction_in = interaction_in_};
  }
  void note_refused(TimePoint now) { refused_.note(now); }

 private:
  ZmqSender<ToolMotion> motion_out_;
  ZmqSource<Interaction> interactions_;
  Inbox<Interaction> interaction_in_;
  RejectionLog refused_;
};

}  // namespace

class Clamp::Impl {
 public:
  Impl(NodeContext& context, ZmqContext& side, Source<DeviceState>& states,
       Sender<ForceCommand>& commands, const Rejections& refused)
      : session_(context.session),
        side_(session_.side()),
        commands_(commands),
        state_in_(states, context.clock, session_.faults.device_state,
                  stream_seed(session_, side_, "device_state")),
        motion_out_(side, connect_to(side_.links.tool_motion, "links.tool_motion")),
        interactions_(side, context.clock,
                      connect_to(side_.links.interaction, "links.interaction")),
        interaction_in_(interactions_, context.clock, session_.faults.interaction,
                        stream_seed(session_, side_, "interaction")),
        standby_(session_.physics.standby ? std::make_unique<StandbyEnds>(context, side, side_)
                                          : nullptr),
        telemetry_(side, bind_to(side_.links.mofc_telemetry, "links.mofc_telemetry")),
        recorder_(flight_files(context, with_side(side_.name, "mofc"))),
        refused_peers_(context.log, side.refused()),
        refused_states_(context.log, "device_state", refused),
        refused_interactions_(context.log, "interaction", interactions_.rejections()),
        node_(side_.mofc, clamped_device(side_.device), context.clock, motion_out_, interaction_in_,
              ticks_, context.session_id, standby_ ? standby_->links() : std::nullopt),
        publisher_(context.session_id, context.clock, ticks_, counters_, telemetry_, context.log,
                   side_.name) {
    publisher_.record_to(recorder_);
    publisher_.peers_refused = [&side] { return side.refused().total(); };
    publisher_.on_pump = [this](TimePoint now) {
      refused_peers_.note(now);
      refused_states_.note(now);
      refused_interactions_.note(now);
      if (standby_) standby_->note_refused(now);
    };
    publisher_.start();
  }

  void wait_until(TimePoint deadline) noexcept { state_in_.wait_until(deadline); }

  [[nodiscard]] TimePoint next_due() const noexcept { return state_in_.next_due(); }

  bool answer_next() noexcept {
    const Received<DeviceState>* state = state_in_.next();
    if (state == nullptr) return false;
    commands_.send(node_.answer(*state));
    return true;
  }

  void finish_turn() noexcept {
    node_.finish_turn();
    MofcCounters now = node_.counters();
    now.device_state = state_in_.counters();
    counters_.store(now);
  }

 private:
  const Session& session_;
  const Side& side_;

  // hops 1 and 4
  Sender<ForceCommand>& commands_;
  Inbox<DeviceState> state_in_;

  // hops 2 and 3
  ZmqSender<ToolMotion> motion_out_;
  ZmqSource<Interaction> interactions_;
  Inbox<Interaction> interaction_in_;

  std::unique_ptr<StandbyEnds> standby_;  // null: none

  // hop 5
  ZmqSender<MofcBatch> telemetry_;
  RingSink<MofcTick> ticks_;
  Snapshot<MofcCounters> counters_;
  FlightRecorder<MofcTick> recorder_;
  RefusedPeersLog refused_peers_;
  RejectionLog refused_states_;
  RejectionLog refused_interactions_;

  MofcNode node_;
  TelemetryPublisher<MofcTick, MofcCounters> publisher_;  // last: its thread uses the others
};

Clamp::Clamp(NodeContext& context, ZmqContext& side, Source<DeviceState>& states,
             Sender<ForceCommand>& commands, const Rejections& refused)
    : impl_(std::make_unique<Impl>(context, side, states, commands, refused)) {}
Clamp::~Clamp() = default;
void Clamp::wait_until(TimePoint deadline) noexcept { impl_->wait_until(deadline); }
TimePoint Clamp::next_due() const noexcept { return impl_->next_due(); }
bool Clamp::answer_next() noexcept { return impl_->answer_next(); }
void Clamp::finish_turn() noexcept { impl_->finish_turn(); }

void run_process(NodeContext& context, ProcessLinks& links) {
  ExchangeServer exchange(links.exchange, context.clock,
                          bind_to(context.session.side().links.exchange, "links.exchange"));
  Clamp clamp(context, links.side, exchange, exchange, exchange.rejections());
  context.log.info("event=realtime {}",
                   enter_realtime(below_device(context.session.side().realtime)).text);

  // every DeviceState is answered in order; what can wait comes after the answer
  while (!context.stop.stop_requested()) {
    clamp.wait_until(context.clock.now() + kIdleWait);
    bool is_answered = true;
    while (is_answered) {
      is_answered = clamp.answer_next();
      clamp.finish_turn();
    }
  }
}

}  // namespace palpate::mofc
