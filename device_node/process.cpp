// SPDX-License-Identifier: Apache-2.0
#include "device_node/process.h"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <optional>
#include <utility>

#include "common/core/check.h"
#include "common/core/inbox.h"
#include "common/core/spsc_ring.h"
#include "common/link/exchange_client.h"
#include "common/link/zmq_sender.h"
#include "common/link/zmq_source.h"
#include "common/process/rate_loop.h"
#include "common/process/realtime.h"
#include "common/process/refused_peers_log.h"
#include "common/process/rejection_log.h"
#include "common/telemetry/flight_recorder.h"
#include "common/telemetry/telemetry_publisher.h"
#include "device_node/device_node.h"
#include "device_node/drivers/driver_registry.h"
#include "device_node/identification/hands_off_check.h"
#include "device_node/post_mortem.h"
#include "device_node/release.h"
#include "device_node/simulation/pointer_hold.h"
#include "device_node/simulation/true_state_recorder.h"
#include "device_node/suspend_watch.h"
#include "device_node/tick_watch.h"

namespace palpate::device {
namespace {

constexpr std::size_t kHandGoals = 64;             // far more than arrive in one turn of the tick
constexpr std::size_t kPageAcknowledgements = 16;  // likewise

/// Hop 6: the targets of a pointer, on the telemetry thread; the tick receives only goals.
class PointerInput {
 public:
  PointerInput(const Session& session, ZmqContext& side, NodeContext& context, HandGoals& goals)
      : log_(context.log),
        targets_(side, context.clock,
                 bind_to(session.side().links.hand_target, "links.hand_target")),
        refused_(context.log, "hand_target", targets_.rejections()),
        hold_(session.side().hand.pointer->holder_timeout),
        goals_(goals) {}

  void pump(TimePoint now) {
    HandTarget target;
    TimePoint received_at;
    while (targets_.receive(target, received_at)) {
      if (!hold_.accept(target, received_at)) continue;
      goals_.push(target.is_released
                      ? std::nullopt
                      : std::optional(HandGoal{target.hand_position_m, target.buttons}));
    }
    if (hold_.is_held(now) != was_held_) {
      was_held_ = !was_held_;
      if (!was_held_) goals_.push(std::nullopt);  // also after the time-out
      log_.info(was_held_ ? "event=hand_taken" : "event=hand_left");
    }
    refused_.note(now);
  }

 private:
  spdlog::logger& log_;
  ZmqSource<HandTarget> targets_;
  RejectionLog refused_;
  PointerHold hold_;
  HandGoals& goals_;
  bool was_held_ = false;
};

/// Hop 9: acknowledgements of pages, on the telemetry thread; the tick decides on them.
class PageInput {
 public:
  PageInput(const Session& session, ZmqContext& side, NodeContext& context)
      : session_id_(context.session_id),
        source_(side, context.clock,
                bind_to(session.side().links.acknowledgement, "viewer.control")),
        refused_(context.log, "acknowledgement", source_.rejections()) {}

  void pump(TimePoint now) {
    Acknowledgement message;
    TimePoint received_at;
    while (source_.receive(message, received_at)) {
      // one that names another process start is of a device as it no longer is
      if (message.device_session_id != session_id_) message.seen = {};
      seen_.push(message.seen);
    }
    refused_.note(now);
  }
  /// Of the tick. No allocation, no lock.
  bool next(SeenDevice& seen) noexcept { return seen_.pop(seen); }

 private:
  std::uint64_t session_id_;
  ZmqSource<Acknowledgement> source_;
  RejectionLog refused_;
  SpscRing<SeenDevice> seen_{kPageAcknowledgements};
};

/// Acknowledges the device of this process and no other, whatever the program is called.
std::string acknowledge_command() { return "kill -USR2 " + std::to_string(::getpid()); }

/// What the person at a real device is told, on the telemetry thread.
class DevicePrompts {
 public:
  DevicePrompts(spdlog::logger& log, std::string calibration)
      : log_(log), calibration_(std::move(calibration)) {}

  /// @param vain_acknowledgements  DeviceNode::vain_acknowledgements()
  void note(DevicePhase phase, std::uint64_t vain_acknowledgements) {
    const bool is_new = told_.exchange(phase) != phase;
    const bool was_in_vain = std::exchange(vain_, vain_acknowledgements) != vain_acknowledgements;
    if (was_in_vain && phase == DevicePhase::kConnected) {
      log_.warn("event=acknowledgement_in_vain: the device did not take its calibration");
    } else if (was_in_vain) {
      log_.warn(
          "event=acknowledgement_in_vain: the device cannot be reached, or did not confirm that "
          "its motors are released; remedy=\"check its cable and supply\"");
    }
    if (phase == DevicePhase::kConnected && (is_new || was_in_vain)) {
      log_.warn("event=device_prompt: {}; then {}", calibration_, acknowledge_command());
    }
  }
  /// Of the tick.
  [[nodiscard]] bool was_told_of(DevicePhase phase) const noexcept { return told_ == phase; }

 private:
  spdlog::logger& log_;
  std::string calibration_;
  std::atomic<DevicePhase> told_{DevicePhase::kUnknown};
  std::uint64_t vain_ = 0;
};

/// Prompts of a driver go through the log.
StartUp start_up_of(NodeContext& context) {
  return {.prompt = [&log = context.log](
                        const std::string& text) { log.warn("event=device_prompt: {}", text); },
          .stop = context.stop,
          .is_acknowledged =
              [&requests = context.requests.fault_resets,
               seen = context.requests.fault_resets.load()]() mutable {
                const std::uint32_t now = requests;
                return std::exchange(seen, now) != now;
              }};
}

/// What the friction of the session's device is worth. A real one moves only after a prompt that a
/// person acknowledged to this process: a restart by a supervisor waits for that again.
CheckedProfile checked_hands_off(const Session& session, NodeContext& context,
                                 HapticDevice& device) {
  const DeviceProfile& profile = session.side().device.profile;
  if (device.specification().is_simulated) {
    ManualClock virtual_time;
    const auto let_go =
        open_simulated_device({.device = session.side().simulated, .hand = nobody()}, virtual_time);
    return check_hands_off(*let_go, virtual_time, profile);
  }
  const StartUp start_up = start_up_of(context);
  await_calibration(device, start_up);
  const std::optional<std::uint32_t>& button = session.side().device.dead_man_button;
  await_acknowledgement(
      start_up,
      "the hands-off check moves the device by itself, with up to 1 N: move it to the middle of "
      "its workspace, take the hand off, clear its way, " +
          std::string(button ? "hold the dead-man button until it has ended, " : "") + "then " +
          acknowledge_command());
  context.log.info("event=hands_off_check_acknowledged");
  return check_hands_off(device, context.clock, profile, button, context.stop);
}

/// The session's configuration, its profile lowered where the device has less friction.
/// @param ratio  receives CheckedProfile::ratio; 0 without a check
DeviceConfig checked_config(const Session& session, NodeContext& context, HapticDevice& device,
                            double& ratio) {
  DeviceConfig config = session.side().device;
  ratio = 0.0;
  if (!config.has_hands_off_check) return config;
  refuse_hands_off_check(device.specification());
  context.log.info("event=hands_off_check_began: nobody may hold the device");
  const CheckedProfile checked = checked_hands_off(session, context, device);
  ratio = checked.ratio;
  config.profile = checked.profile;
  if (checked.is_lowered) {
    context.log.warn(
        "event=friction_below_profile ratio={:.2f}: the device relies on lower values now; "
        "identify its friction with `palpate identify`",
        ratio);
  } else {
    context.log.info("event=hands_off_check_ended: the profile holds");
  }
  return config;
}

}  // namespace

void run_process(NodeContext& context, ProcessLinks& links) {
  ExchangeClient exchange(links.exchange, context.clock,
                          connect_to(context.session.side().links.exchange, "links.exchange"));
  run_with({exchange, exchange, exchange.rejections()}, context, links.side);
}

void run_with(const Exchange& exchange, NodeContext& context, ZmqContext& side) {
  const Session& session = context.session;
  HandGoals goals(kHandGoals);
  Journal journal(session.side().device.rate_hz);  // outlives the device
  PostMortem post_mortem;                          // outlives the publisher, whose thread fills it
  const DriverRegistry drivers =
      all_drivers({.simulated = {.device = session.side().simulated,
                                 .hand = session.side().hand,
                                 .seed = stream_seed(session, session.side(), "hand"),
                                 .goals = &goals},
                   .driver = session.side().driver});
  const Driver& driver = drivers.at(driver_name(session.side().driver));
  if (!driver.is_simulated) {
    context.log.info("event=acknowledge_with command=\"{}\": this device and no other",
                     acknowledge_command());
  }
  const auto device = driver.open(context.clock, start_up_of(context));
  refuse_unmonitored(session.side().device, device->specification(), context.is_unsafe);
  refuse_missing_button(session.side().device, device->specification());
  refuse_unlikely_friction(session.side().device, device->specification());
  refuse_finer_resolution(session.side().device, device->specification());
  double friction_ratio = 0.0;
  const DeviceConfig config = checked_config(session, context, *device, friction_ratio);
  if (!config.monitor.is_on) {
    context.log.log(
        device->specification().is_simulated ? spdlog::level::info : spdlog::level::warn,
        "event=monitor_off: nothing checks the energy of the commands");
  }
  if (!device->specification().has_motor_watchdog) {
    context.log.warn("event=no_motor_watchdog device=\"{}\": {}",
                     device->specification().model_name,
                     no_watchdog_text(config.accepts_no_motor_watchdog));
  }
  if (const auto limit =
          friction_limit(config, device->specification(), driver_name(session.side().driver))) {
    context.log.log(limit->is_below_friction ? spdlog::level::warn : spdlog::level::info,
                    "event=force_limit newton={:.3g}: {}{}", limit->newton, limit->why,
                    limit->remedy.empty() ? "" : "; remedy=\"" + limit->remedy + "\"");
  }

  if (config.wrist && !device->specification().is_simulated) {
    const double newton_m =
        with_torque_limit(config, device->specification()).wrist->peak_torque_newton_m;
    if (newton_m <= config.wrist->coulomb_newton_m) {
      context.log.warn(
          "event=torque_limit newton_m={:.3g}: the friction of the joints, "
          "device.wrist.coulomb_newton_m; "
          "more needs a motor watchdog, and device.wrist.accept: UNCHECKED_MOTORS",
          newton_m);
    }
  }
  if (config.skips_motor_check && !device->specification().is_simulated) {
    context.log.warn("event=motor_check_skipped: nothing notices motors of a wrong sign or gain");
  }

  Inbox<ForceCommand> force_in(exchange.commands, context.clock, session.faults.force_command,
                               stream_seed(session, session.side(), "force_command"));

  // hop 5
  ZmqSender<DeviceBatch> telemetry(
      side, bind_to(session.side().links.device_telemetry, "links.device_telemetry"));
  RingSink<DeviceTick> ticks;
  Snapshot<DeviceCounters> counters;
  FlightRecorder<DeviceTick> recorder(
      flight_files(context, with_side(session.side().name, "device")),
      std::max(kFlightRecorderTicks, PostMortem::ticks_of_window(session.side().device.rate_hz)));
  RejectionLog refused(context.log, "force_command", exchange.refused);
  std::optional<PointerInput> pointer;
  if (session.side().hand.pointer && device->specification().is_simulated) {
    pointer.emplace(session, side, context, goals);
  }
  std::optional<PageInput> page;
  if (session.viewer.has_control) page.emplace(session, side, context);
  RefusedPeersLog refused_peers(context.log, side.refused());
  TelemetryPublisher publisher(context.session_id, context.clock, ticks, counters, telemetry,
                               context.log, session.side().name);
  publisher.record_to(recorder);
  recorder.append = [&](std::ostream& out) {
    const DeviceCounters now = counters.load();
    post_mortem.write(
        out, device->specification().model_name + ", phase " + name(now.phase) + ", " +
                 std::to_string(now.device_faults) + " faults, last \"" + name(now.last_fault) +
                 "\", " + std::to_string(now.monitor_reductions) +
                 " commands reduced by the monitor, " + std::to_string(now.ledger_excesses) +
                 " ledgers too high" + (now.is_release_unconfirmed ? ", release unconfirmed" : ""));
  };
  publisher.peers_refused = [&] { return side.refused().total(); };
  TickWatch ticks_watched;
  std::atomic<std::uint64_t> vain_acknowledgements{0};
  DevicePrompts prompts(context.log, device->specification().calibration);
  publisher.on_pump = [&](TimePoint now) {
    prompts.note(counters.load().phase, vain_acknowledgements);
    if (!context.stop.stop_requested() && ticks_watched.hangs(counters.load().loop.ticks, now)) {
      context.log.error(
          "event=device_hangs: a call of {} has not returned for 2 s, so nothing is read and no "
          "force changes; remedy=\"end this program; its driver or the device is at fault: "
          "`palpate conform device`\"",
          device->specification().model_name);
    }
    post_mortem.take(journal);
    refused_peers.note(now);
    refused.note(now);
    if (pointer) pointer->pump(now);
    if (page) page->pump(now);
  };
  publisher.start();

  // the tick
  TrueStateRecorder true_state(*device);
  DeviceNode node(config, *device, context.clock, exchange.states, force_in, ticks,
                  context.session_id, &true_state, &journal);
  device->tap(&journal);
  node.report_checked_friction(friction_ratio);
  context.log.info("event=realtime {}", enter_realtime(session.side().realtime).text);
  SteadyClock appointments(session.side().realtime.wait);
  SuspendWatch suspend;
  RateLoop loop(appointments, session.side().device.rate_hz);
  // a signal before this counts for nothing: nobody was asked yet
  std::uint32_t resets = context.requests.fault_resets;
  loop.run(context.stop, [&](const Tick& tick) {
    // nor does one of a phase that nobody was told of
    const std::uint32_t resets_asked = context.requests.fault_resets;
    if (std::exchange(resets, resets_asked) != resets_asked && prompts.was_told_of(node.phase())) {
      node.acknowledge();
      // what came while the device was reached for is no answer to what came of it
      resets = context.requests.fault_resets;
    }
    for (SeenDevice seen; page && page->next(seen);) node.acknowledge(seen);
    node.suspended(suspend.slept());
    node.step(tick);
    if (exchange.after_switch) exchange.after_switch();
    counters.store(node.counters());
    vain_acknowledgements = node.vain_acknowledgements();
  });
  const bool is_released =
      released_within(std::chrono::milliseconds(500), context.clock, [&] { return node.stop(); });
  counters.store(node.counters());
  if (!is_released) {
    context.log.error("event=release_unconfirmed remedy=\"{}\"", kReleaseUnconfirmedText);
  }
}

}  // namespace palpate::device
