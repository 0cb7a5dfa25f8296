// SPDX-License-Identifier: Apache-2.0
// device_node_bench.h — a DeviceNode between memory links, with a scripted answerer in mofc's
// place.
#pragma once

#include <chrono>
#include <functional>
#include <limits>
#include <utility>
#include <vector>

#include "common/core/clock.h"
#include "common/core/inbox.h"
#include "common/core/memory_link.h"
#include "common/session/simulation_config.h"
#include "device_node/device_node.h"
#include "device_node/simulation/true_state_recorder.h"
#include "tests/support/alloc_guard.h"

namespace palpate::test {

using namespace std::chrono_literals;

/// 1 kHz; answers within 0.5 ms, leases of 2 ms, fallback for 20 ms, fade of 50 ms, f_co 0.1 N. No
/// monitor, because the scripted answers have no clamp; no check of the motors.
inline DeviceConfig device_config() {
  DeviceConfig config;
  config.reply = 500us;
  config.lease = 2ms;
  config.limp_after = 20ms;
  config.fade = 50ms;
  config.monitor.is_on = false;
  config.skips_motor_check = true;  // motor_check_test.cpp has it
  return config;
}

struct TickVector final : TickSink<DeviceTick> {
  std::vector<DeviceTick> ticks;
  void keep(const DeviceTick& record) noexcept override { ticks.push_back(record); }
};

/// Time passes only between ticks, inside waits and in a stalled switch. Device is constructed as
/// Device(arguments…, clock, seed), Device(clock) or Device(clock, of_device).
template <class Device>
class DeviceNodeBench {
 public:
  static constexpr std::uint64_t kSession = 42;

  explicit DeviceNodeBench(const DeviceConfig& config) : device(clock), node(make(config)) {
    wire();
  }
  /// @param of_device  of a ScriptedDevice: false for one that needs an acknowledgement
  template <class Argument>
  DeviceNodeBench(const DeviceConfig& config, const Argument& of_device,
                  device::Journal* journal = nullptr)
      : device(clock, of_device), node(make(config, journal)) {
    device.tap(journal);
    wire();
  }
  DeviceNodeBench(const DeviceConfig& config, const SimulatedDeviceConfig& simulated,
                  const HandConfig& hand, std::uint64_t seed)
      : device(simulated, hand, clock, seed), node(make(config)) {
    wire();
  }

  /// Answers every DeviceState with this force, `reply_delay` later.
  void answer_with(const Vector3& force_newton, Duration valid_for = 1h) {
    on_state = [this, force_newton, valid_for](const DeviceState& state) {
      send_answer(state.header.session_id, state.header.sequence, force_newton, valid_for);
    };
  }
  void send_answer(std::uint64_t session_id, std::uint64_t sequence, const Vector3& force_newton,
                   Duration valid_for = 1h) {
    answer_ = {.header = {.session_id = 7, .sequence = next_answer_++, .sampled_at = clock.now()},
               .answers_session_id = session_id,
               .answers_sequence = sequence,
               .answers_sampled_at = states.back().header.sampled_at,
               .force_on_hand_newton = force_newton,
               .valid_for = valid_for,
               .begins_within = begins_within,
               .counted_energy_joule = ledger_joule,
               .wrist_torque_newton_m = wrist_torque_newton_m};
    due_ = clock.now() + reply_delay;
    is_pending_ = true;
    deliver();
  }

  /// One tick at the next whole millisecond, or now if that is later.
  void tick() {
    const TimePoint appointment = TimePoint(1ms * index_);
    clock.sleep_until(appointment);
    step({.index = index_, .scheduled_at = appointment, .now = clock.now()});
    ++index_;
  }
  void step(const Tick& tick) {
    is_pending_ = false;
    node.step(tick);
  }

  /// Allocations of 1000 ticks, the second half of them without answers.
  std::uint64_t allocations_of_ticks() {
    states.reserve(2'000);
    ticks.reserve(2'000);
    std::uint64_t allocations = 0;
    for (int i = 0; i < 1'000; ++i) {
      if (i == 500) on_state = nullptr;
      const AllocGuard guard;
      tick();
      allocations += guard.count();
    }
    return allocations;
  }

  /// The pending answer arrives if it is due.
  void deliver() {
    if (!is_pending_ || due_ > clock.now()) return;
    is_pending_ = false;
    commands_.send(answer_);
  }

  ManualClock clock;
  Device device;
  std::function<void(const DeviceState&)> on_state;  ///< mofc
  Duration reply_delay{};
  /// That each answer names; 0: none.
  Duration begins_within{};
  /// That comes with each answer; NaN: none.
  double ledger_joule = std::numeric_limits<double>::quiet_NaN();
  Vector3 wrist_torque_newton_m = Vector3::Zero();  ///< of each answer
  Duration stall_in_wait{};  ///< > 0: the process is stopped for so long in its next wait

 private:
  struct StateVector final : Sender<DeviceState> {
    explicit StateVector(DeviceNodeBench& b) : bench(b) {}
    SendResult send(const DeviceState& state) noexcept override {
      bench.states.push_back(state);
      if (bench.on_state) bench.on_state(state);
      return SendResult::kSent;
    }
    DeviceNodeBench& bench;
  };

  device::DeviceNode make(const DeviceConfig& config, device::Journal* journal = nullptr) {
    return device::DeviceNode(config, device, clock, state_out_, inbox_, sink_, kSession,
                              &true_state_, journal);
  }
  void wire() {
    commands_.on_wait = [this](TimePoint deadline) {
      // the answer's arrival, the deadline, or much later
      TimePoint wake = is_pending_ ? std::min(due_, deadline) : deadline;
      if (stall_in_wait > Duration::zero()) {
        wake = clock.now() + std::exchange(stall_in_wait, Duration::zero());
      }
      clock.sleep_until(wake);
      deliver();
    };
  }
  device::TrueStateRecorder true_state_{device};
  StateVector state_out_{*this};
  TickVector sink_;
  MemoryLink<ForceCommand> commands_{clock};
  Inbox<ForceCommand> inbox_{commands_, clock};
  ForceCommand answer_;
  TimePoint due_{};
  bool is_pending_ = false;
  std::uint64_t next_answer_ = 0;
  std::uint64_t index_ = 0;

 public:
  std::vector<DeviceState> states;
  std::vector<DeviceTick>& ticks = sink_.ticks;
  device::DeviceNode node;
};

}  // namespace palpate::test
