// SPDX-License-Identifier: Apache-2.0
#include "device_node/emulators/dynamixel_emulator.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <thread>
#include <utility>

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

constexpr Duration kSecondTransfer = 200us;  // the second transfer of an answer
constexpr std::uint8_t kInstructionError = 0x02;
constexpr std::uint8_t kOverload = 0x20;
constexpr std::uint64_t kLostOneIn = 20;
constexpr std::uint64_t kBitErrorOneIn = 50;

void add_crc(std::vector<std::byte>& bytes) {
  const std::uint16_t crc = dynamixel_crc(bytes);
  bytes.push_back(static_cast<std::byte>(crc & 0xFFU));
  bytes.push_back(static_cast<std::byte>(crc >> 8U));
}

}  // namespace

std::vector<ServoSettings> seven_servos() {
  std::vector<ServoSettings> servos(7);
  for (std::size_t i = 0; i < servos.size(); ++i) {
    servos[i].id = static_cast<std::uint8_t>(i + 1);
    servos[i].tick_phase_s = 1.3e-4 * static_cast<double>(i);
  }
  return servos;
}

DynamixelEmulator::DynamixelEmulator(BusEmulation bus, const Clock& clock, std::uint64_t seed)
    : clock_(clock),
      start_(clock.now()),
      bus_(std::move(bus)),
      port_(terminal_.end()),
      line_(port_),
      arm_({bus_.servos.begin(), bus_.servos.end()}, bus_.hand),
      has_begun_(bus_.faults.size(), false),
      random_(seed) {}

void DynamixelEmulator::run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    std::span<std::byte> packet;
    const Transfer transfer = line_.receive(packet, 20ms);
    if (transfer == Transfer::kDone) {
      serve(packet);
    } else {
      catch_up();
      if (transfer == Transfer::kClosed) std::this_thread::sleep_for(1ms);
    }
  }
}

// --- packets ------------------------------------------------------------------------------------

void DynamixelEmulator::serve(std::span<std::byte> packet) {
  DynamixelMessage message;
  if (read_dynamixel(packet, message) != PacketFault::kNone ||
      message.instruction == DynamixelInstruction::kStatus) {
    return;
  }
  std::vector<Bytes> answers;
  WireFault fault = WireFault::kNone;
  bool is_partial = false;
  {
    const std::scoped_lock lock(lock_);
    const double now_s = this->now_s();
    advance_to(now_s);
    fault = wire_fault(now_s);
    is_partial = has(WireFault::kPartial, now_s);
    if (fault == WireFault::kUnplugged) return;
    ++messages_;
    for (EmulatedServo& servo : arm_.motors()) {
      if (servo.is_there) servo.hear(now_s);
    }
    answers = answers_to(message);
    for (Bytes& answer : answers) {
      if (has(WireFault::kDropped, now_s) && random_.below(kLostOneIn) == 0) answer.clear();
      if (!answer.empty() && has(WireFault::kBitErrors, now_s) &&
          random_.below(kBitErrorOneIn) == 0) {
        const std::size_t at = random_.below(answer.size());
        answer[at] ^= static_cast<std::byte>(1U << random_.below(8));
      }
      if (has(WireFault::kDoubled, now_s)) {
        const Bytes once = answer;
        answer.insert(answer.end(), once.begin(), once.end());
      }
    }
  }
  send(std::move(answers), fault, is_partial);
}

void DynamixelEmulator::send(std::vector<Bytes> answers, WireFault fault, bool is_partial) {
  if (fault == WireFault::kSilent) return;
  if (fault == WireFault::kDelayed) std::this_thread::sleep_for(5ms);
  for (Bytes& answer : answers) {
    if (answer.empty()) continue;
    if (fault == WireFault::kGarbage) std::fill(answer.begin(), answer.end(), std::byte{0xFF});
    if (fault == WireFault::kShort) answer.resize(answer.size() / 2);
    if (bus_.bits_per_second > 0) {
      const auto bits = static_cast<double>(10 * answer.size());
      std::this_thread::sleep_for(from_seconds(bits / bus_.bits_per_second));
    }
    const std::size_t first = is_partial ? answer.size() / 2 : answer.size();
    static_cast<void>(port_.write(std::span(answer).first(first), 50ms));
    if (first < answer.size()) {
      std::this_thread::sleep_for(kSecondTransfer);
      static_cast<void>(port_.write(std::span(answer).subspan(first), 50ms));
    }
  }
}

EmulatedServo* DynamixelEmulator::servo_of(unsigned id) {
  for (EmulatedServo& servo : arm_.motors()) {
    if (servo.id() == id && servo.is_there) return &servo;
  }
  return nullptr;
}

DynamixelEmulator::Bytes DynamixelEmulator::status(const EmulatedServo& servo, std::uint8_t error,
                                                   std::span<const std::byte> data) const {
  const bool is_wrong = has(WireFault::kWrongId, arm_.time_s());
  DynamixelPacket packet(is_wrong ? servo.id() ^ 0x40U : servo.id(), DynamixelInstruction::kStatus);
  packet.u8(error | (servo.has_alert() ? kDynamixelAlert : 0U));
  if (error == 0) packet.bytes(data);
  const std::span<const std::byte> bytes = packet.finish();
  return {bytes.begin(), bytes.end()};
}

std::vector<DynamixelEmulator::Bytes> DynamixelEmulator::answers_to(
    const DynamixelMessage& message) {
  const std::span<const std::byte> p = message.parameters;
  std::vector<Bytes> answers;
  switch (message.instruction) {
    case DynamixelInstruction::kSyncRead:
      return p.size() < 5 ? answers : sync_read(message);
    case DynamixelInstruction::kFastSyncRead:
      if (p.size() >= 5) answers.push_back(fast_sync_read(message));
      return answers;
    case DynamixelInstruction::kSyncWrite:
      if (p.size() >= 5) sync_write(message);
      return answers;
    default:
      break;
  }
  for (EmulatedServo& servo : arm_.motors()) {
    const bool is_for_all = message.id == kDynamixelEveryone;
    if (!servo.is_there || (!is_for_all && message.id != servo.id())) continue;
    const unsigned address = p.size() >= 2 ? dynamixel_u16(p, 0) : 0;
    if (message.instruction == DynamixelInstruction::kPing) {
      const std::array data{static_cast<std::byte>(servo.model() & 0xFFU),
                            static_cast<std::byte>(servo.model() >> 8U),
                            static_cast<std::byte>(servo.firmware())};
      answers.push_back(status(servo, 0, data));
    } else if (message.instruction == DynamixelInstruction::kRead && p.size() == 4) {
      Bytes data(std::min<std::size_t>(dynamixel_u16(p, 2), 200));
      const std::uint8_t error = servo.read(address, data);
      if (!is_for_all) answers.push_back(status(servo, error, data));
    } else if (message.instruction == DynamixelInstruction::kWrite && p.size() >= 3) {
      const std::uint8_t error = servo.write(address, p.subspan(2));
      if (!is_for_all) answers.push_back(status(servo, error, {}));
    } else if (message.instruction == DynamixelInstruction::kReboot) {
      answers.push_back(status(servo, 0, {}));
      servo.reboot();
    } else {
      answers.push_back(status(servo, kInstructionError, {}));
    }
  }
  return answers;
}

std::vector<DynamixelEmulator::Bytes> DynamixelEmulator::sync_read(
    const DynamixelMessage& message) {
  const std::span<const std::byte> p = message.parameters;
  std::vector<Bytes> answers;
  for (const std::byte id : p.subspan(4)) {
    EmulatedServo* servo = servo_of(std::to_integer<unsigned>(id));
    if (servo == nullptr) continue;
    Bytes data(std::min<std::size_t>(dynamixel_u16(p, 2), 200));
    const std::uint8_t error = servo->read(dynamixel_u16(p, 0), data);
    answers.push_back(status(*servo, error, data));
  }
  return answers;
}

/// Each servo goes on where the one before it ended; after one that is silent nobody does.
DynamixelEmulator::Bytes DynamixelEmulator::fast_sync_read(const DynamixelMessage& message) {
  const std::span<const std::byte> p = message.parameters;
  const std::span<const std::byte> ids = p.subspan(4);
  const std::size_t each = std::min<std::size_t>(dynamixel_u16(p, 2), 64);
  const std::size_t length = 1 + ids.size() * (4 + each);
  Bytes answer;
  for (const unsigned value :
       {0xFFU, 0xFFU, 0xFDU, 0x00U, 0xFEU, static_cast<unsigned>(length & 0xFFU),
        static_cast<unsigned>(length >> 8U), 0x55U}) {
    answer.push_back(static_cast<std::byte>(value));
  }
  bool has_any = false;
  for (const std::byte id : ids) {
    EmulatedServo* servo = servo_of(std::to_integer<unsigned>(id));
    if (servo == nullptr) break;
    has_any = true;
    Bytes data(each);
    const std::uint8_t error = servo->read(dynamixel_u16(p, 0), data);
    answer.push_back(static_cast<std::byte>(error | (servo->has_alert() ? kDynamixelAlert : 0U)));
    answer.push_back(has(WireFault::kWrongId, arm_.time_s()) ? id ^ std::byte{0x40} : id);
    answer.insert(answer.end(), data.begin(), data.end());
    add_crc(answer);
  }
  return has_any ? answer : Bytes();
}

void DynamixelEmulator::sync_write(const DynamixelMessage& message) {
  const std::span<const std::byte> p = message.parameters;
  const std::size_t each = dynamixel_u16(p, 2);
  for (std::size_t at = 4; each > 0 && at + 1 + each <= p.size(); at += 1 + each) {
    EmulatedServo* servo = servo_of(std::to_integer<unsigned>(p[at]));
    if (servo != nullptr) {
      static_cast<void>(servo->write(dynamixel_u16(p, 0), p.subspan(at + 1, each)));
    }
  }
}

// --- arm ----------------------------------------------------------------------------------------

void DynamixelEmulator::plan(const PlannedFault& fault) {
  const std::scoped_lock lock(lock_);
  bus_.faults.push_back(fault);
  has_begun_.push_back(false);
}

void DynamixelEmulator::with_servo(std::size_t i,
                                   const std::function<void(EmulatedServo&)>& change) {
  const std::scoped_lock lock(lock_);
  advance_to(now_s());
  change(arm_.motors()[i]);
}

void DynamixelEmulator::catch_up() {
  const std::scoped_lock lock(lock_);
  advance_to(now_s());
}

bool DynamixelEmulator::has(WireFault kind, double now_s) const {
  return std::any_of(bus_.faults.begin(), bus_.faults.end(), [&](const PlannedFault& fault) {
    return fault.kind == kind && is_under_way(fault, now_s);
  });
}

WireFault DynamixelEmulator::wire_fault(double now_s) const {
  for (const PlannedFault& fault : bus_.faults) {
    if (fault.kind <= WireFault::kEcho && is_under_way(fault, now_s)) return fault.kind;
  }
  return WireFault::kNone;
}

void DynamixelEmulator::apply_faults(double now_s) {
  std::vector<EmulatedServo>& servos = arm_.motors();
  EmulatedServo& one = servos[servos.size() > 1 ? servos.size() - 2 : 0];
  for (EmulatedServo& servo : arm_.motors()) {
    servo.has_watchdog = !has(WireFault::kNoWatchdog, now_s);
    servo.is_stuck = has(WireFault::kStuck, now_s);
    servo.gain = has(WireFault::kNoSupply, now_s)   ? 0.0
                 : has(WireFault::kReversed, now_s) ? -1.0
                 : has(WireFault::kStrong, now_s)   ? 2.0
                                                    : 1.0;
  }
  one.is_there = one.is_there && !has(WireFault::kServoGone, now_s);
  for (std::size_t i = 0; i < bus_.faults.size(); ++i) {
    const PlannedFault& fault = bus_.faults[i];
    if (fault.kind == WireFault::kServoGone && has_begun_[i] && !is_under_way(fault, now_s) &&
        !one.is_there) {
      one.is_there = true;  // plugged in again
      one.reboot();
    }
    if (has_begun_[i] || now_s < fault.from_s) continue;
    has_begun_[i] = true;
    if (fault.kind == WireFault::kServoReboot) one.reboot();
    if (fault.kind == WireFault::kServoOverload) one.protect(kOverload);
  }
}

void DynamixelEmulator::advance_to(double now_s) {
  arm_.advance_to(now_s, [&](double time_s) { apply_faults(time_s); });
}

double DynamixelEmulator::acting_newton_m() const {
  const std::scoped_lock lock(lock_);
  return arm_.acting_newton_m();
}
double DynamixelEmulator::torque_until_s() const {
  const std::scoped_lock lock(lock_);
  return arm_.torque_until_s();
}
double DynamixelEmulator::least_energy_joule() const {
  const std::scoped_lock lock(lock_);
  return arm_.least_energy_joule();
}
double DynamixelEmulator::fastest_rad_per_s() const {
  const std::scoped_lock lock(lock_);
  return arm_.fastest_rad_per_s();
}
std::uint64_t DynamixelEmulator::messages() const {
  const std::scoped_lock lock(lock_);
  return messages_;
}

}  // namespace palpate::device
