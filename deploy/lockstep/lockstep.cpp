#include "deploy/lockstep/lockstep.h"

#include <algorithm>
#include <optional>
#include <string>
#include <utility>

#include "common/core/check.h"
#include "common/core/inbox.h"
#include "common/core/memory_link.h"
#include "common/core/virtual_time.h"
#include "common/core/workspace_map.h"
#include "common/link/exchange_client.h"
#include "common/link/exchange_server.h"
#include "common/link/zmq_sender.h"
#include "common/link/zmq_source.h"
#include "device_node/device_node.h"
#include "device_node/simulation/ideal_run.h"
#include "device_node/simulation/simulated_device.h"
#include "device_node/simulation/true_state_recorder.h"
#include "mofc_node/mofc_node.h"
#include "physics_node/physics_node.h"
#include "physics_node/scene/scene.h"

namespace palpate {
namespace {

// Order of the events of one instant.
enum Rank : int { kDeviceRank = 0, kMofcRank = 1, kPhysicsRank = 2 };

/// Keeps the last record of a node.
template <class Record>
class LastTick final : public TickSink<Record> {
 public:
  explicit LastTick(std::function<void(const Record&)> on_tick) : on_tick_(std::move(on_tick)) {}
  void keep(const Record& record) noexcept override {
    last = record;
    if (on_tick_) on_tick_(record);
  }
  std::optional<Record> last;

 private:
  std::function<void(const Record&)> on_tick_;
};

/// Both ends of the four links, whatever carries them.
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

struct LinkHooks {
  SendHook on_state_sent;
  SendHook on_motion_sent;
  WaitHook on_wait;
};

struct MemoryLinks final : Links {
  MemoryLinks(const Clock& clock, const LinkHooks& hooks)
      : state(clock), command(clock), motion(clock), interaction(clock) {
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
  InprocLinks(const Clock& clock, const LinkHooks& hooks)
      : server(context, clock, bind_to("inproc://exchange", "lockstep")),
        client(context, clock, connect_to("inproc://exchange", "lockstep")),
        motion_source(context, clock, bind_to("inproc://tool_motion", "lockstep"),
                      Delivery::kEvery),
        motion_sender(context, connect_to("inproc://tool_motion", "lockstep")),
        interaction_sender(context, bind_to("inproc://interaction", "lockstep")),
        interaction_source(context, clock, connect_to("inproc://interaction", "lockstep"),
                           Delivery::kEvery) {
    // publishers drop what is sent before they know their subscriber
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

/// Hop 3 under LockstepOptions::tamper_with_interaction.
class TamperedSender final : public Sender<Interaction> {
 public:
  TamperedSender(Sender<Interaction>& out, std::function<void(Interaction&)> tamper)
      : out_(out), tamper_(std::move(tamper)) {}
  SendResult send(const Interaction& interaction) noexcept override {
    Interaction changed = interaction;
    if (tamper_) tamper_(changed);
    return out_.send(changed);
  }

 private:
  Sender<Interaction>& out_;
  std::function<void(Interaction&)> tamper_;
};

/// The continuous tissue as a force on the hand, and the run it would have given (docs/theory.md
/// §7.1).
class Ideal {
 public:
  explicit Ideal(const Session& session)
      : scene_(session.scene),
        device_(session.side().device),
        peak_force_newton_(
            std::min(session.side().device.peak_force_newton, session.side().simulated.peak_force_newton)),
        memory_(scene_.new_memory()),
        run_map_(session.side().device.workspace),
        run_memory_(scene_.new_memory()),
        run_(
            session.side().simulated, session.side().device.peak_force_newton, session.side().hand,
            stream_seed(session, session.side(), "hand"), TimePoint{},
            [this](double time_s, const Vector3& hand_m, const Vector3& hand_m_per_s) {
              return force_on_hand(
                  run_map_.is_clutched(),
                  scene_.evaluate(run_map_.tool_position_world_m(hand_m),
                                  run_map_.tool_velocity_world_m_per_s(hand_m_per_s), time_s,
                                  run_memory_));
            },
            [this](double time_s, const Vector3& hand_m) {
              scene_.step(run_memory_, run_map_.tool_position_world_m(hand_m), Vector3::Zero(),
                          time_s);
            }) {}

  /// This run's ideal force and true contact.
  void judge(TickRow& row) {
    const DeviceTick& tick = row.device;
    const double time_s = to_seconds(tick.sampled_at.time_since_epoch());
    const physics::SceneForce touch = scene_.step(memory_, tick.true_tool_position_world_m,
                                                  tick.true_tool_velocity_world_m_per_s, time_s);
    row.ideal_force_on_hand_newton =
        limited_to_norm(force_on_hand(tick.is_clutched, touch), peak_force_newton_);
    row.is_truly_in_contact = touch.contact_count > 0;
  }

  /// The ideal run at the time of this tick.
  IdealState advance(const DeviceTick& tick) {
    run_.advance_to(tick.sampled_at);
    run_map_.update(run_.state().hand_position_m, tick.is_clutched);
    return {run_map_.tool_position_world_m(run_.state().hand_position_m),
            run_.force_on_hand_newton()};
  }

 private:
  [[nodiscard]] Vector3 force_on_hand(bool is_clutched, const physics::SceneForce& touch) const {
    if (is_clutched) return Vector3::Zero();
    return device_.workspace.force_ratio * touch.force_on_tool_newton;
  }

  physics::Scene scene_;
  DeviceConfig device_;
  double peak_force_newton_;      // the smaller of the session's and the device's own
  physics::TissueMemory memory_;  // of the run's own tool
  WorkspaceMap run_map_;
  physics::TissueMemory run_memory_;
  device::IdealRun run_;
};

}  // namespace

class Lockstep::Impl {
 public:
  Impl(const Session& session, const LockstepOptions& options, RowConsumer on_row)
      : session_(session),
        on_row_(std::move(on_row)),
        device_lateness_(options.device_lateness),
        links_(make_links(options.links)),
        tampered_interaction_out_(*links_->interaction_out, options.tamper_with_interaction),
        device_(session.side().simulated, session.side().hand, time_,
                stream_seed(session, session.side(), "hand")),
        true_state_(device_),
        command_in_(*links_->command_in, time_, session.faults.force_command,
                    stream_seed(session, session.side(), "force_command")),
        state_in_(*links_->state_in, time_, session.faults.device_state,
                  stream_seed(session, session.side(), "device_state")),
        interaction_in_(*links_->interaction_in, time_, session.faults.interaction,
                        stream_seed(session, session.side(), "interaction")),
        motion_in_(*links_->motion_in, time_, session.faults.tool_motion,
                   stream_seed(session, session.side(), "tool_motion")),
        device_tick_(options.on_device_tick),
        mofc_tick_(options.on_mofc_tick),
        physics_tick_(options.on_physics_tick),
        device_node_(session.side().device, device_, time_, *links_->state_out, command_in_,
                     device_tick_, kLockstepDevice, &true_state_),
        mofc_node_(session.side().mofc,
                   {.profile = session.side().device.profile,
                    .workspace = session.side().device.workspace,
                    .lease = session.side().device.lease,
                    .rate_hz = session.side().device.rate_hz},
                   time_, *links_->motion_out, interaction_in_, mofc_tick_, kLockstepMofc),
        physics_node_(session.scene, session.physics, session.side().mofc.interaction, time_, motion_in_,
                      tampered_interaction_out_, physics_tick_, kLockstepPhysics),
        device_schedule_(TimePoint{}, session.side().device.rate_hz),
        physics_schedule_(TimePoint{}, session.physics.rate_hz),
        steps_on_arrival_(session.side().mofc.wait_for_physics.count() > 0) {
    if (options.has_ideal) ideal_.emplace(session_);
    schedule_device();
    if (!steps_on_arrival_) {
      time_.schedule(physics_schedule_.next(), kPhysicsRank, [this] { physics_turn(); });
    }
  }

  void run_until(Duration end) {
    // up to, not including, the events of `end` itself
    time_.sleep_until(TimePoint(end - Duration(1)));
  }

  [[nodiscard]] DeviceCounters device_counters() const {
    DeviceCounters counters = device_node_.counters();
    counters.force_command = command_in_.counters();
    return counters;
  }
  [[nodiscard]] MofcCounters mofc_counters() const {
    MofcCounters counters = mofc_node_.counters();
    counters.device_state = state_in_.counters();
    return counters;
  }
  [[nodiscard]] PhysicsCounters physics_counters() const { return physics_node_.counters(); }

 private:
  std::unique_ptr<Links> make_links(LockstepLinks kind) {
    LinkHooks hooks{.on_state_sent =
                        [this] { time_.schedule(time_.now(), kMofcRank, [this] { mofc_turn(); }); },
                    .on_motion_sent =
                        [this] {
                          if (steps_on_arrival_) {
                            time_.schedule(time_.now(), kPhysicsRank, [this] { arrival_turn(); });
                          }
                        },
                    .on_wait = [this](TimePoint deadline) { time_.run_one_until(deadline); }};
    if (kind == LockstepLinks::kMemory) return std::make_unique<MemoryLinks>(time_, hooks);
    return std::make_unique<InprocLinks>(time_, hooks);
  }

  void schedule_device() {
    const Duration lateness = device_lateness_ ? device_lateness_() : Duration::zero();
    time_.schedule(device_schedule_.next() + lateness, kDeviceRank, [this] { device_turn(); });
  }

  void device_turn() {
    device_node_.step(device_schedule_.begin(time_.now()));
    device_schedule_.finish(time_.now());
    schedule_device();
    if (device_tick_.last && on_row_) give_row();
  }

  /// Answers every DeviceState that is due; looks again when a delayed one will be.
  void mofc_turn() {
    if (is_mofc_busy_) return;  // it waits for the physics and will look itself
    is_mofc_busy_ = true;
    while (const Received<DeviceState>* state = state_in_.next()) {
      links_->command_out->send(mofc_node_.answer(*state));
      mofc_node_.finish_turn();
    }
    is_mofc_busy_ = false;
    if (state_in_.next_due() != TimePoint::max()) {
      time_.schedule(state_in_.next_due(), kMofcRank, [this] { mofc_turn(); });
    }
  }

  void physics_turn() {
    physics_node_.step(physics_schedule_.begin(time_.now()));
    physics_schedule_.finish(time_.now());
    time_.schedule(physics_schedule_.next(), kPhysicsRank, [this] { physics_turn(); });
  }

  /// Same-tick mode: the physics steps when a motion arrives.
  void arrival_turn() {
    if (physics_node_.has_new_motion()) {
      physics_node_.step(physics_schedule_.begin(time_.now()));
      physics_schedule_.finish(time_.now());
    }
    if (motion_in_.next_due() != TimePoint::max()) {
      time_.schedule(motion_in_.next_due(), kPhysicsRank, [this] { arrival_turn(); });
    }
  }

  void give_row() {
    TickRow row{.device_session_id = kLockstepDevice, .device = *device_tick_.last};
    if (mofc_tick_.last && mofc_tick_.last->device_sequence == row.device.sequence) {
      row.mofc = mofc_tick_.last;
    }
    IdealState ideal;
    if (ideal_) {
      ideal_->judge(row);
      ideal = ideal_->advance(row.device);
    }
    device_tick_.last.reset();
    on_row_(row, ideal);
  }

  Session session_;
  RowConsumer on_row_;
  std::function<Duration()> device_lateness_;
  VirtualTime time_;
  std::unique_ptr<Links> links_;
  TamperedSender tampered_interaction_out_;
  device::SimulatedDevice device_;
  device::TrueStateRecorder true_state_;
  Inbox<ForceCommand> command_in_;
  Inbox<DeviceState> state_in_;
  Inbox<Interaction> interaction_in_;
  Inbox<ToolMotion> motion_in_;
  LastTick<DeviceTick> device_tick_;
  LastTick<MofcTick> mofc_tick_;
  LastTick<PhysicsTick> physics_tick_;
  device::DeviceNode device_node_;
  mofc::MofcNode mofc_node_;
  physics::PhysicsNode physics_node_;
  TickSchedule device_schedule_;
  TickSchedule physics_schedule_;
  bool steps_on_arrival_;
  bool is_mofc_busy_ = false;
  std::optional<Ideal> ideal_;
};

Lockstep::Lockstep(const Session& session, const LockstepOptions& options, RowConsumer on_row)
    : impl_(std::make_unique<Impl>(session, options, std::move(on_row))) {}
Lockstep::~Lockstep() = default;
void Lockstep::run_until(Duration end) { impl_->run_until(end); }
DeviceCounters Lockstep::device_counters() const { return impl_->device_counters(); }
MofcCounters Lockstep::mofc_counters() const { return impl_->mofc_counters(); }
PhysicsCounters Lockstep::physics_counters() const { return impl_->physics_counters(); }

}  // namespace palpate
