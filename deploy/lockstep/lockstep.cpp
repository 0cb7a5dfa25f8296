// SPDX-License-Identifier: Apache-2.0
#include "deploy/lockstep/lockstep.h"

#include <algorithm>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/core/inbox.h"
#include "common/core/messages.h"
#include "common/core/random.h"
#include "common/core/tick_schedule.h"
#include "deploy/lockstep/adversary.h"
#include "deploy/lockstep/device_faults.h"
#include "deploy/lockstep/ideal.h"
#include "deploy/lockstep/physics_host.h"
#include "deploy/lockstep/virtual_time.h"
#include "device_node/device_node.h"
#include "device_node/identification/hands_off_check.h"
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

/// Hops 2 and 3 with LockstepOptions::is_cut.
template <class T>
class CutSender final : public Sender<T> {
 public:
  CutSender(Sender<T>& out, std::function<bool()> is_cut) : out_(out), is_cut_(std::move(is_cut)) {}
  SendResult send(const T& message) noexcept override {
    return is_cut_ && is_cut_() ? SendResult::kSent : out_.send(message);
  }

 private:
  Sender<T>& out_;
  std::function<bool()> is_cut_;
};

/// Side::device, after the hands-off check if the session has one.
DeviceConfig checked_config(const Side& side, std::uint64_t seed, double& ratio) {
  DeviceConfig config = side.device;
  config.skips_motor_check = true;  // nobody stands at a device on virtual time
  if (!config.has_hands_off_check) return config;
  ManualClock clock;
  device::SimulatedDevice let_go(side.simulated, device::nobody(), clock, seed);
  const device::CheckedProfile checked = device::check_hands_off(let_go, clock, config.profile);
  ratio = checked.ratio;
  config.profile = checked.profile;
  return config;
}

std::unique_ptr<device::HapticDevice> device_of(const Side& side, const LockstepOptions& options,
                                                const Clock& clock, std::uint64_t seed) {
  if (options.make_device) return options.make_device(side, clock, seed);
  return std::make_unique<device::SimulatedDevice>(side.simulated, side.hand, clock, seed);
}

/// Hops 2 and 3 between one side and one physics, and that physics' tool.
class PhysicsTool {
 public:
  struct Setup {
    const Session& session;
    const Side& side;
    std::size_t index;
    PhysicsRole role;
    InteractionUse use;
  };
  PhysicsTool(const Setup& setup, const LockstepOptions& options, VirtualTime& time,
              PhysicsHost& host, std::shared_ptr<const physics::Scene> scene, Links& links)
      : cut_motion_(*links.motion_out, cut_of(options, setup, time)),
        cut_interaction_(*links.interaction_out, cut_of(options, setup, time)),
        tampered_out_(cut_interaction_, setup.session.adversary.physics,
                      stream_seed(setup.session, setup.side, stream("hostile physics", setup)),
                      options.tamper_with_interaction),
        motion_in_(*links.motion_in, host.clock(),
                   setup.role == PhysicsRole::kFirst ? setup.session.faults.tool_motion
                                                     : setup.session.faults.standby_tool_motion,
                   stream_seed(setup.session, setup.side, stream("tool_motion", setup))),
        interaction_in_(*links.interaction_in, time,
                        setup.role == PhysicsRole::kFirst
                            ? setup.session.faults.interaction
                            : setup.session.faults.standby_interaction,
                        stream_seed(setup.session, setup.side, stream("interaction", setup))),
        ticks_(setup.index == 0 && setup.role == PhysicsRole::kFirst
                   ? options.on_physics_tick
                   : std::function<void(const PhysicsTick&)>{}),
        engine_(options.make_engine
                    ? options.make_engine(setup.session)
                    : std::make_unique<physics::SceneEngine>(
                          std::move(scene), setup.session.physics.rate_hz, setup.use,
                          setup.use == InteractionUse::kLocal ? setup.session.physics.reach_m : 0.0,
                          host.elastic(), setup.index)),
        node_(*engine_, setup.session.physics, setup.use, host.clock(), motion_in_, tampered_out_,
              ticks_, setup.role == PhysicsRole::kFirst ? kLockstepPhysics : kLockstepStandby,
              host.speaker()) {
    host.add(node_);
  }

  [[nodiscard]] Sender<ToolMotion>& motion_out() { return cut_motion_; }
  [[nodiscard]] Inbox<Interaction>& interaction_in() { return interaction_in_; }
  [[nodiscard]] Inbox<ToolMotion>& motion_in() { return motion_in_; }
  [[nodiscard]] physics::PhysicsNode& node() { return node_; }

 private:
  static const char* stream(const char* name, const Setup& setup) {
    if (setup.role == PhysicsRole::kFirst) return name;
    return std::string_view(name) == "tool_motion"   ? "standby_tool_motion"
           : std::string_view(name) == "interaction" ? "standby_interaction"
                                                     : "hostile standby";
  }
  static std::function<bool()> cut_of(const LockstepOptions& options, const Setup& setup,
                                      const VirtualTime& time) {
    if (!options.is_cut) return {};
    return [&time, is_cut = options.is_cut, side = setup.index, role = setup.role] {
      return is_cut(side, role, time.now());
    };
  }

  CutSender<ToolMotion> cut_motion_;
  CutSender<Interaction> cut_interaction_;
  TamperedSender tampered_out_;
  Inbox<ToolMotion> motion_in_;
  Inbox<Interaction> interaction_in_;
  LastTick<PhysicsTick> ticks_;
  std::unique_ptr<physics::Engine> engine_;
  physics::PhysicsNode node_;
};

/// Device and mofc of one side.
class LockstepSide {
 public:
  using RowConsumer = std::function<void(const TickRow&, const IdealState&)>;

  LockstepSide(const Session& session, std::size_t index, const LockstepOptions& options,
               VirtualTime& time, std::vector<std::unique_ptr<PhysicsHost>>& hosts,
               const std::shared_ptr<const physics::Scene>& scene, RowConsumer on_row)
      : session_(session),
        side_(session.sides[index]),
        index_(index),
        on_row_(std::move(on_row)),
        device_lateness_(options.device_lateness),
        late_ticks_(session.adversary, side_.device.rate_hz,
                    stream_seed(session, side_, "tick jitter")),
        clamp_tamperer_(session.adversary.clamp, side_.device),
        time_(time),
        host_(*hosts.front()),
        links_(make_links(options.links, time_, host_.clock(), link_hooks())),
        device_(device_of(side_, options, time_, stream_seed(session, side_, "hand"))),
        preempted_device_(*device_, session.faults.device, time_,
                          stream_seed(session, side_, "device")),
        true_state_(*device_),
        command_in_(*links_->command_in, time_, session.faults.force_command,
                    stream_seed(session, side_, "force_command")),
        state_in_(*links_->state_in, time_, session.faults.device_state,
                  stream_seed(session, side_, "device_state")),
        first_({session, side_, index, PhysicsRole::kFirst, side_.mofc.interaction}, options, time_,
               host_, scene, *links_),
        device_tick_(index == 0 ? options.on_device_tick
                                : std::function<void(const DeviceTick&)>{}),
        mofc_tick_(index == 0 ? options.on_mofc_tick : std::function<void(const MofcTick&)>{}),
        device_node_(checked_config(side_, session.seed, friction_ratio_), preempted_device_, time_,
                     *links_->state_out, command_in_, device_tick_, session_id(kLockstepDevice),
                     &true_state_, index == 0 ? options.journal : nullptr),
        device_schedule_(TimePoint{}, side_.device.rate_hz),
        steps_on_arrival_(side_.mofc.wait_for_physics.count() > 0) {
    if (hosts.size() > 1) {
      PhysicsHost& host = *hosts[1];
      standby_links_ = make_links(options.links, time_, host.clock(), {});
      standby_.emplace(
          PhysicsTool::Setup{session, side_, index, PhysicsRole::kStandby, side_.mofc.interaction},
          options, time_, host, scene, *standby_links_);
    }
    mofc_node_.emplace(
        side_.mofc, clamped_device(side_.device), time_, first_.motion_out(),
        first_.interaction_in(), mofc_tick_, session_id(kLockstepMofc),
        standby_
            ? std::optional(mofc::StandbyLinks{standby_->motion_out(), standby_->interaction_in()})
            : std::nullopt,
        options.make_controller ? options.make_controller(side_, *device_) : nullptr);
    device_node_.report_checked_friction(friction_ratio_);
    if (index == 0) device_->tap(options.journal);
    // nobody stands at a device on virtual time: who builds one that is not simulated agrees
    if (!device_->specification().is_simulated) device_node_.acknowledge();
    if (options.has_ideal) {
      ideal_.emplace(session_, side_);
      auto* const simulated = dynamic_cast<device::SimulatedDevice*>(device_.get());
      if (simulated != nullptr) simulated->record_steps(&steps_);
    }
    schedule_device();
  }

  [[nodiscard]] bool steps_on_arrival() const { return steps_on_arrival_; }

  [[nodiscard]] DeviceCounters device_counters() const {
    DeviceCounters counters = device_node_.counters();
    counters.force_command = command_in_.counters();
    return counters;
  }
  [[nodiscard]] MofcCounters mofc_counters() const {
    MofcCounters counters = mofc_node_->counters();
    counters.device_state = state_in_.counters();
    return counters;
  }
  [[nodiscard]] PhysicsCounters physics_counters() { return first_.node().counters(); }

 private:
  /// Of a node of this side; the first side's are the constants.
  [[nodiscard]] std::uint64_t session_id(std::uint64_t of_first) const {
    return of_first + 10 * index_;
  }

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
      ForceCommand command = mofc_node_->answer(*state);
      clamp_tamperer_.tamper(state->value, command);
      links_->command_out->send(command);
      mofc_node_->finish_turn();
    }
    is_mofc_busy_ = false;
    if (state_in_.next_due() != TimePoint::max()) {
      time_.schedule(state_in_.next_due(), kMofcRank, [this] { mofc_turn(); });
    }
  }

  /// Same-tick mode: physics steps when a motion arrives.
  void arrival_turn() {
    if (first_.node().has_new_motion()) host_.turn();
    if (first_.motion_in().next_due() != TimePoint::max()) {
      time_.schedule(first_.motion_in().next_due(), kPhysicsRank, [this] { arrival_turn(); });
    }
  }

  void give_row() {
    TickRow row{.device_session_id = session_id(kLockstepDevice), .device = *device_tick_.last};
    if (mofc_tick_.last && mofc_tick_.last->device_sequence == row.device.sequence) {
      row.mofc = mofc_tick_.last;
    }
    IdealState ideal;
    if (ideal_) {
      ideal_->judge(row, steps_);
      ideal = ideal_->advance(row.device);
    }
    device_tick_.last.reset();
    on_row_(row, ideal);
  }

  const Session& session_;
  const Side& side_;
  std::size_t index_;
  RowConsumer on_row_;
  std::function<Duration()> device_lateness_;
  LateTicks late_ticks_;
  ClampTamperer clamp_tamperer_;
  double friction_ratio_ = 0.0;  // of the hands-off check
  VirtualTime& time_;
  PhysicsHost& host_;
  std::unique_ptr<Links> links_;
  std::unique_ptr<Links> standby_links_;  // hops 2 and 3 are used
  std::vector<device::InnerStep> steps_;  // not yet judged
  std::unique_ptr<device::HapticDevice> device_;
  PreemptedDevice preempted_device_;
  device::TrueStateRecorder true_state_;
  Inbox<ForceCommand> command_in_;
  Inbox<DeviceState> state_in_;
  PhysicsTool first_;
  std::optional<PhysicsTool> standby_;
  LastTick<DeviceTick> device_tick_;
  LastTick<MofcTick> mofc_tick_;
  device::DeviceNode device_node_;
  std::optional<mofc::MofcNode> mofc_node_;
  TickSchedule device_schedule_;
  bool steps_on_arrival_;
  bool is_mofc_busy_ = false;
  std::optional<Ideal> ideal_;
};

}  // namespace

class Lockstep::Impl {
 public:
  Impl(const Session& session, const LockstepOptions& options, RowConsumer on_row)
      : session_(session) {
    const std::size_t roles = session_.physics.standby ? kPhysicsRoles : 1;
    for (std::size_t i = 0; i < roles; ++i) {
      const auto role = static_cast<PhysicsRole>(i);
      std::function<bool(TimePoint)> is_stopped;
      if (options.is_stopped) {
        is_stopped = [stopped = options.is_stopped, role](TimePoint now) {
          return stopped(role, now);
        };
      }
      hosts_.push_back(std::make_unique<PhysicsHost>(
          session_, time_, role,
          role == PhysicsRole::kStandby ? options.standby_clock_ahead : Duration::zero(),
          std::move(is_stopped)));
    }
    std::shared_ptr<const physics::Scene> scene;
    if (!options.make_engine) {
      scene = std::make_shared<const physics::Scene>(session_.scene, reach_of(session_));
    }
    for (std::size_t i = 0; i < session_.sides.size(); ++i) {
      RowConsumer of_side;
      if (i == 0) of_side = std::exchange(on_row, {});
      if (options.on_side_row) {
        of_side = [before = std::move(of_side), on_row = options.on_side_row, i](
                      const TickRow& row, const IdealState& ideal) {
          if (before) before(row, ideal);
          on_row(i, row, ideal);
        };
      }
      sides_.push_back(std::make_unique<LockstepSide>(session_, i, options, time_, hosts_, scene,
                                                      std::move(of_side)));
    }
    if (sides_.front()->steps_on_arrival()) return;
    for (const auto& host : hosts_) host->start(kPhysicsRank);
  }

  void run_until(Duration end) {
    // excludes the events of `end` itself
    time_.sleep_until(TimePoint(end - Duration(1)));
  }

  [[nodiscard]] LockstepSide& side(std::size_t index) const { return *sides_.at(index); }

 private:
  Session session_;
  VirtualTime time_;
  std::vector<std::unique_ptr<PhysicsHost>> hosts_;
  std::vector<std::unique_ptr<LockstepSide>> sides_;
};

Lockstep::Lockstep(const Session& session, const LockstepOptions& options, RowConsumer on_row)
    : impl_(std::make_unique<Impl>(session, options, std::move(on_row))) {}
Lockstep::~Lockstep() = default;
void Lockstep::run_until(Duration end) { impl_->run_until(end); }
DeviceCounters Lockstep::device_counters(std::size_t side) const {
  return impl_->side(side).device_counters();
}
MofcCounters Lockstep::mofc_counters(std::size_t side) const {
  return impl_->side(side).mofc_counters();
}
PhysicsCounters Lockstep::physics_counters(std::size_t side) const {
  return impl_->side(side).physics_counters();
}

}  // namespace palpate
