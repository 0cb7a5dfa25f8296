#include "deploy/lockstep/lockstep.h"

#include <optional>
#include <string>
#include <utility>

#include "common/core/inbox.h"
#include "common/core/messages.h"
#include "common/core/random.h"
#include "common/core/tick_schedule.h"
#include "deploy/lockstep/adversary.h"
#include "deploy/lockstep/device_faults.h"
#include "deploy/lockstep/ideal.h"
#include "deploy/lockstep/virtual_time.h"
#include "device_node/device_node.h"
#include "device_node/hands_off_check.h"
#include "device_node/simulation/simulated_device.h"
#include "device_node/simulation/true_state_recorder.h"
#include "mofc_node/mofc_node.h"
#include "physics_node/physics_node.h"
#include "physics_node/scene_engine.h"

namespace palpate {
namespace {

// Order of events of one instant.
enum Rank : int { kDeviceRank = 0, kMofcRank = 1, kPhysicsRank = 2 };

/// Keeps the last record of a node and passes every record on.
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

/// Hop 3 with the session's adversary and LockstepOptions::tamper_with_interaction.
class TamperedSender final : public Sender<Interaction> {
 public:
  TamperedSender(Sender<Interaction>& out, HostilePhysics physics, std::uint64_t seed,
                 std::function<void(Interaction&)> tamper)
      : out_(out),
        is_honest_(physics == HostilePhysics::kHonest && !tamper),
        tamperer_(physics, seed),
        tamper_(std::move(tamper)) {}
  SendResult send(const Interaction& interaction) noexcept override {
    if (is_honest_) return out_.send(interaction);
    copy_message(interaction, changed_);
    tamperer_.tamper(changed_);
    if (tamper_) tamper_(changed_);
    return out_.send(changed_);
  }

 private:
  Sender<Interaction>& out_;
  bool is_honest_;
  PhysicsTamperer tamperer_;
  std::function<void(Interaction&)> tamper_;
  Interaction changed_{};
};

/// Session::device, after the hands-off check if the session has one.
DeviceConfig checked_config(const Session& session, double& ratio) {
  DeviceConfig config = session.side().device;
  if (!config.has_hands_off_check) return config;
  ManualClock clock;
  device::SimulatedDevice let_go(session.side().simulated, device::nobody(), clock, session.seed);
  const device::CheckedProfile checked = device::check_hands_off(let_go, clock, config.profile);
  ratio = checked.ratio;
  config.profile = checked.profile;
  return config;
}

}  // namespace

class Lockstep::Impl {
 public:
  Impl(const Session& session, const LockstepOptions& options, RowConsumer on_row)
      : session_(session),
        on_row_(std::move(on_row)),
        device_lateness_(options.device_lateness),
        late_ticks_(session.adversary, session.side().device.rate_hz,
                    stream_seed(session, session.side(), "tick jitter")),
        clamp_tamperer_(session.adversary.clamp),
        links_(make_links(options.links, time_, link_hooks())),
        tampered_interaction_out_(*links_->interaction_out, session.adversary.physics,
                                  stream_seed(session, session.side(), "hostile physics"),
                                  options.tamper_with_interaction),
        device_(session.side().simulated, session.side().hand, time_,
                stream_seed(session, session.side(), "hand")),
        preempted_device_(device_, session.faults.device, time_,
                          stream_seed(session, session.side(), "device")),
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
        device_node_(checked_config(session, friction_ratio_), preempted_device_, time_,
                     *links_->state_out, command_in_, device_tick_, kLockstepDevice, &true_state_),
        mofc_node_(session.side().mofc, clamped_device(session.side().device), time_,
                   *links_->motion_out, interaction_in_, mofc_tick_, kLockstepMofc),
        engine_(options.make_engine
                    ? options.make_engine(session)
                    : std::make_unique<physics::SceneEngine>(session.scene, session.physics,
                                                             session.side().mofc.interaction)),
        physics_node_(*engine_, session.physics, session.side().mofc.interaction, time_, motion_in_,
                      tampered_interaction_out_, physics_tick_, kLockstepPhysics),
        device_schedule_(TimePoint{}, session.side().device.rate_hz),
        physics_schedule_(TimePoint{}, session.physics.rate_hz),
        steps_on_arrival_(session.side().mofc.wait_for_physics.count() > 0) {
    device_node_.report_checked_friction(friction_ratio_);
    if (options.has_ideal) ideal_.emplace(session_);
    schedule_device();
    if (!steps_on_arrival_) {
      time_.schedule(physics_schedule_.next(), kPhysicsRank, [this] { physics_turn(); });
    }
  }

  void run_until(Duration end) {
    // excludes the events of `end` itself
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
  LinkHooks link_hooks() {
    return {.on_state_sent =
                [this] { time_.schedule(time_.now(), kMofcRank, [this] { mofc_turn(); }); },
            .on_motion_sent =
                [this] {
                  if (!steps_on_arrival_) return;
                  time_.schedule(time_.now(), kPhysicsRank, [this] { arrival_turn(); });
                },
            .on_wait = [this](TimePoint deadline) { time_.run_one_until(deadline); }};
  }

  void schedule_device() {
    const TimePoint next = device_schedule_.next();
    Duration lateness = preempted_device_.lateness(next, device_schedule_.period());
    lateness += late_ticks_.next();
    if (device_lateness_) lateness += device_lateness_();
    time_.schedule(next + lateness, kDeviceRank, [this] { device_turn(); });
  }

  void device_turn() {
    device_node_.step(device_schedule_.begin(time_.now()));
    device_schedule_.finish(time_.now());
    schedule_device();
    if (device_tick_.last && on_row_) give_row();
  }

  /// Answers every DeviceState that is due and schedules a turn for the next delayed one.
  void mofc_turn() {
    if (is_mofc_busy_) return;  // a turn is waiting for physics; it takes the new state too
    is_mofc_busy_ = true;
    while (const Received<DeviceState>* state = state_in_.next()) {
      ForceCommand command = mofc_node_.answer(*state);
      clamp_tamperer_.tamper(state->value, command);
      links_->command_out->send(command);
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

  /// Same-tick mode: physics steps when a motion arrives.
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
  LateTicks late_ticks_;
  ClampTamperer clamp_tamperer_;
  double friction_ratio_ = 0.0;  // of the hands-off check
  VirtualTime time_;
  std::unique_ptr<Links> links_;
  TamperedSender tampered_interaction_out_;
  device::SimulatedDevice device_;
  PreemptedDevice preempted_device_;
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
  std::unique_ptr<physics::Engine> engine_;
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
