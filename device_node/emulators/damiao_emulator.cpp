// SPDX-License-Identifier: Apache-2.0
#include "device_node/emulators/damiao_emulator.h"

#include <linux/can.h>
#include <linux/can/error.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>
#include <thread>
#include <utility>

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

constexpr unsigned kOverloaded = 0xE;
constexpr std::uint64_t kFrameLostOneIn = 20;

/// What the kernel hands over when the controller has left the bus.
std::array<std::byte, CAN_MTU> bus_off() {
  can_frame raw{};
  raw.can_id = CAN_ERR_FLAG | CAN_ERR_BUSOFF;
  raw.can_dlc = CAN_ERR_DLC;
  std::array<std::byte, CAN_MTU> bytes{};
  std::memcpy(bytes.data(), &raw, sizeof(raw));
  return bytes;
}

}  // namespace

std::vector<DamiaoMotorSettings> seven_damiao_motors() {
  std::vector<DamiaoMotorSettings> motors(7);
  for (unsigned i = 0; i < motors.size(); ++i) {
    motors[i].id = i + 1;
    motors[i].feedback_id = i + 0x11;
    motors[i].velocity_range_rad_per_s = i < 2 ? 45.0F : i < 4 ? 10.0F : 30.0F;
    motors[i].torque_range_newton_m = i < 2 ? 54.0F : i < 4 ? 28.0F : 10.0F;
    motors[i].cycle_phase_s = 1.3e-5 * i;
    motors[i].joint.play_rad = 0.001;
  }
  return motors;
}

DamiaoEmulator::DamiaoEmulator(CanEmulation bus, const std::string& path,
                               const std::string& setting, const Clock& clock, std::uint64_t seed)
    : clock_(clock),
      start_(clock.now()),
      bus_(std::move(bus)),
      listener_(path, setting),
      arm_({bus_.motors.begin(), bus_.motors.end()}, bus_.hand),
      has_begun_(bus_.faults.size(), false),
      random_(seed) {}

void DamiaoEmulator::run(const std::stop_token& stop) {
  listener_.run(
      stop, [&](PacketPort& client) { serve(client, stop); }, [&] { catch_up(); });
}

// --- frames -------------------------------------------------------------------------------------

void DamiaoEmulator::serve(PacketPort& client, const std::stop_token& stop) {
  std::array<std::byte, CANFD_MTU> bytes{};
  // a client that leaves answers unread is reset first, and what it sent last comes after that
  bool is_reset = false;
  while (!stop.stop_requested()) {
    std::size_t size = 0;
    const Transfer transfer = client.read(bytes, size, 20ms);
    if (transfer == Transfer::kClosed && is_reset) return;
    is_reset = is_reset || transfer == Transfer::kClosed;
    CanFrame frame;
    if (transfer != Transfer::kDone ||
        read_can(std::span(bytes).first(size), frame) != CanKind::kData) {
      catch_up();
    } else if (!answer(client, frame)) {
      return;
    }
  }
}

bool DamiaoEmulator::answer(PacketPort& client, const CanFrame& frame) {
  std::vector<CanFrame> answers;
  bool is_late = false;
  {
    const std::scoped_lock lock(lock_);
    const double now_s = this->now_s();
    advance_to(now_s);
    if (has(WireFault::kUnplugged, now_s)) return false;
    if (has(WireFault::kBusOff, now_s)) {
      static_cast<void>(client.write(bus_off(), Duration::zero()));
      return true;
    }
    ++messages_;
    is_late = has(WireFault::kDelayed, now_s);
    for (EmulatedDamiaoMotor& motor : arm_.motors()) {
      const std::optional<CanFrame> said = motor.hear(frame, now_s);
      if (!said || has(WireFault::kSilent, now_s)) continue;
      if (has(WireFault::kDropped, now_s) && random_.below(kFrameLostOneIn) == 0) continue;
      CanFrame sent = *said;
      sent.is_fd = frame.is_fd;
      if (has(WireFault::kWrongId, now_s)) sent.id ^= 0x40U;
      if (has(WireFault::kGarbage, now_s)) sent.data.fill(std::byte{0xFF});
      if (has(WireFault::kShort, now_s)) sent.size /= 2;
      answers.push_back(sent);
      if (has(WireFault::kDoubled, now_s)) answers.push_back(sent);
    }
  }
  if (is_late) std::this_thread::sleep_for(5ms);
  for (const CanFrame& sent : answers) {
    const CanBytes out = to_bytes(sent);
    // a controller whose queue nobody reads loses frames
    static_cast<void>(client.write(std::span(out.bytes).first(out.size), Duration::zero()));
  }
  return true;
}

// --- arm ----------------------------------------------------------------------------------------

void DamiaoEmulator::plan(const PlannedFault& fault) {
  const std::scoped_lock lock(lock_);
  bus_.faults.push_back(fault);
  has_begun_.push_back(false);
}

void DamiaoEmulator::with_motor(std::size_t i,
                                const std::function<void(EmulatedDamiaoMotor&)>& change) {
  const std::scoped_lock lock(lock_);
  advance_to(now_s());
  change(arm_.motors()[i]);
}

void DamiaoEmulator::catch_up() {
  const std::scoped_lock lock(lock_);
  advance_to(now_s());
}

bool DamiaoEmulator::has(WireFault kind, double now_s) const {
  return std::any_of(bus_.faults.begin(), bus_.faults.end(), [&](const PlannedFault& fault) {
    return fault.kind == kind && is_under_way(fault, now_s);
  });
}

void DamiaoEmulator::apply_faults(double now_s) {
  std::vector<EmulatedDamiaoMotor>& motors = arm_.motors();
  EmulatedDamiaoMotor& one = motors[motors.size() > 1 ? motors.size() - 2 : 0];
  for (EmulatedDamiaoMotor& motor : motors) {
    motor.has_timeout = !has(WireFault::kNoWatchdog, now_s);
    motor.is_stuck = has(WireFault::kStuck, now_s);
    motor.gain = has(WireFault::kNoSupply, now_s)   ? 0.0
                 : has(WireFault::kReversed, now_s) ? -1.0
                 : has(WireFault::kStrong, now_s)   ? 2.0
                                                    : 1.0;
  }
  for (std::size_t i = 0; i < bus_.faults.size(); ++i) {
    const PlannedFault& fault = bus_.faults[i];
    const bool is_gone = fault.kind == WireFault::kServoGone;
    if (is_gone && has_begun_[i] && !is_under_way(fault, now_s) && !one.is_there) {
      one.is_there = true;  // plugged in again
      one.power_cycle();
    }
    if (has_begun_[i] || now_s < fault.from_s) continue;
    has_begun_[i] = true;
    if (is_gone) one.is_there = false;
    if (fault.kind == WireFault::kServoReboot) one.power_cycle();
    if (fault.kind == WireFault::kServoOverload) one.protect(kOverloaded);
  }
}

void DamiaoEmulator::advance_to(double now_s) {
  arm_.advance_to(now_s, [&](double time_s) { apply_faults(time_s); });
}

double DamiaoEmulator::acting_newton_m() const {
  const std::scoped_lock lock(lock_);
  return arm_.acting_newton_m();
}
double DamiaoEmulator::torque_until_s() const {
  const std::scoped_lock lock(lock_);
  return arm_.torque_until_s();
}
double DamiaoEmulator::least_energy_joule() const {
  const std::scoped_lock lock(lock_);
  return arm_.least_energy_joule();
}
double DamiaoEmulator::fastest_rad_per_s() const {
  const std::scoped_lock lock(lock_);
  return arm_.fastest_rad_per_s();
}
std::uint64_t DamiaoEmulator::messages() const {
  const std::scoped_lock lock(lock_);
  return messages_;
}

}  // namespace palpate::device
