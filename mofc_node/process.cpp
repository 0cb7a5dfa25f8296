// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/process.h"

#include <chrono>
#include <memory>
#include <optional>

#include "common/core/inbox.h"
#include "common/link/exchange_server.h"
#include "common/link/zmq_sender.h"
#include "common/link/zmq_source.h"
#include "common/process/realtime.h"
#include "common/process/refused_peers_log.h"
#include "common/process/rejection_log.h"
#include "common/process/threaded_link.h"
#include "common/telemetry/flight_recorder.h"
#include "common/telemetry/telemetry_publisher.h"
#include "mofc_node/mofc_node.h"

namespace palpate::mofc {
namespace {

// How soon a stop is noticed while no device speaks.
constexpr auto kIdleWait = std::chrono::milliseconds(50);
// Of the device's period after a state: hop 3 is read then, so that the answer to the next state
// need not.
constexpr double kReadAheadAt = 0.8;

/// One below the device's tick: where both share a processor, the device acts on an answer before
/// this node finishes its turn. Not for threads that spin: the lower one would never run.
RealtimeConfig below_device(RealtimeConfig realtime) {
  if (realtime.priority > 1 && realtime.wait != WaitStrategy::kSpin) --realtime.priority;
  return realtime;
}

/// Of one physics; of physics.standby or not.
struct PhysicsLinks {
  Attachment motion;
  Attachment interaction;
  const char* name;  ///< of hop 3: of its faults and its log
  const LinkFaults& faults;
};

/// Hops 2 and 3 of one physics.
class PhysicsEnds {
 public:
  PhysicsEnds(NodeContext& context, ZmqContext& context_of_links, const PhysicsLinks& links,
              ClampThreads threads)
      : motion_out_(context_of_links, links.motion),
        interactions_(context_of_links, context.clock, links.interaction),
        threads_(threads == ClampThreads::kOfPhysics
                     ? std::make_unique<Threads>(motion_out_, interactions_, context)
                     : nullptr),
        interaction_in_(
            threads_ ? static_cast<Source<Interaction>&>(threads_->interactions) : interactions_,
            context.clock, links.faults,
            stream_seed(context.session, context.session.side(), links.name)),
        refused_(context.log, links.name, interactions_.rejections()) {}

  [[nodiscard]] Sender<ToolMotion>& motion_out() {
    return threads_ ? static_cast<Sender<ToolMotion>&>(threads_->motions) : motion_out_;
  }
  [[nodiscard]] Inbox<Interaction>& interaction_in() { return interaction_in_; }
  void note_refused(TimePoint now) { refused_.note(now); }

 private:
  struct Threads {
    Threads(Sender<ToolMotion>& out, Source<Interaction>& in, const NodeContext& context)
        : motions(out, context.session.side().realtime),
          interactions(in, context.clock, context.session.side().realtime) {}
    ThreadedSender<ToolMotion> motions;
    ThreadedSource<Interaction> interactions;
  };

  ZmqSender<ToolMotion> motion_out_;
  ZmqSource<Interaction> interactions_;
  std::unique_ptr<Threads> threads_;
  Inbox<Interaction> interaction_in_;
  RejectionLog refused_;
};

}  // namespace

class Clamp::Impl {
 public:
  Impl(NodeContext& context, ZmqContext& side, Source<DeviceState>& states,
       Sender<ForceCommand>& commands, const Rejections& refused, ClampThreads threads)
      : session_(context.session),
        side_(session_.side()),
        commands_(commands),
        state_in_(states, context.clock, session_.faults.device_state,
                  stream_seed(session_, side_, "device_state")),
        physics_(context, side,
                 {.motion = connect_to(side_.links.tool_motion, "links.tool_motion"),
                  .interaction = connect_to(side_.links.interaction, "links.interaction"),
                  .name = "interaction",
                  .faults = session_.faults.interaction},
                 threads),
        standby_(session_.physics.standby ? standby_ends(context, side, threads) : nullptr),
        telemetry_(side, bind_to(side_.links.mofc_telemetry, "links.mofc_telemetry")),
        recorder_(flight_files(context, with_side(side_.name, "mofc"))),
        refused_peers_(context.log, side.refused()),
        refused_states_(context.log, "device_state", refused),
        clock_(context.clock),
        read_ahead_after_(threads == ClampThreads::kNone
                              ? std::optional(from_seconds(kReadAheadAt / side_.device.rate_hz))
                              : std::nullopt),
        node_(side_.mofc, clamped_device(side_.device), context.clock, physics_.motion_out(),
              physics_.interaction_in(), ticks_, context.session_id,
              standby_ ? std::optional<StandbyLinks>({.motion_out = standby_->motion_out(),
                                                      .interaction_in = standby_->interaction_in()})
                       : std::nullopt),
        publisher_(context.session_id, context.clock, ticks_, counters_, telemetry_, context.log,
                   side_.name) {
    publisher_.record_to(recorder_);
    publisher_.peers_refused = [&side] { return side.refused().total(); };
    publisher_.on_pump = [this](TimePoint now) {
      refused_peers_.note(now);
      refused_states_.note(now);
      physics_.note_refused(now);
      if (standby_) standby_->note_refused(now);
    };
    publisher_.start();
  }

  void wait_until(TimePoint deadline) noexcept {
    if (read_ahead_at_ < deadline) {
      state_in_.wait_until(read_ahead_at_);
      if (clock_.now() < read_ahead_at_) return;
      node_.read_ahead();
      read_ahead_at_ = TimePoint::max();
    }
    state_in_.wait_until(deadline);
  }

  [[nodiscard]] TimePoint next_due() const noexcept { return state_in_.next_due(); }

  bool answer_next() noexcept {
    const Received<DeviceState>* state = state_in_.next();
    if (state == nullptr) return false;
    commands_.send(node_.answer(*state));
    if (read_ahead_after_) read_ahead_at_ = state->received_at + *read_ahead_after_;
    return true;
  }

  void finish_turn() noexcept {
    node_.finish_turn();
    MofcCounters now = node_.counters();
    now.device_state = state_in_.counters();
    counters_.store(now);
  }

 private:
  [[nodiscard]] static std::unique_ptr<PhysicsEnds> standby_ends(NodeContext& context,
                                                                 ZmqContext& context_of_links,
                                                                 ClampThreads threads) {
    const LinksConfig& links = context.session.side().links;
    return std::make_unique<PhysicsEnds>(
        context, context_of_links,
        PhysicsLinks{
            .motion = connect_to(links.standby_tool_motion, "links.standby_tool_motion"),
            .interaction = connect_to(links.standby_interaction, "links.standby_interaction"),
            .name = "standby_interaction",
            .faults = context.session.faults.standby_interaction},
        threads);
  }

  const Session& session_;
  const Side& side_;

  // hops 1 and 4
  Sender<ForceCommand>& commands_;
  Inbox<DeviceState> state_in_;

  PhysicsEnds physics_;
  std::unique_ptr<PhysicsEnds> standby_;  // null: none

  // hop 5
  ZmqSender<MofcBatch> telemetry_;
  RingSink<MofcTick> ticks_;
  Snapshot<MofcCounters> counters_;
  FlightRecorder<MofcTick> recorder_;
  RefusedPeersLog refused_peers_;
  RejectionLog refused_states_;

  const Clock& clock_;
  std::optional<Duration> read_ahead_after_;  // none: threads do
  TimePoint read_ahead_at_ = TimePoint::max();
  MofcNode node_;
  TelemetryPublisher<MofcTick, MofcCounters> publisher_;  // last: its thread uses the others
};

Clamp::Clamp(NodeContext& context, ZmqContext& side, Source<DeviceState>& states,
             Sender<ForceCommand>& commands, const Rejections& refused, ClampThreads threads)
    : impl_(std::make_unique<Impl>(context, side, states, commands, refused, threads)) {}
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
