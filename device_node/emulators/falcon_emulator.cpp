// SPDX-License-Identifier: Apache-2.0
#include "device_node/emulators/falcon_emulator.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <thread>
#include <utility>

#include "device_node/drivers/falcon/falcon_delta.h"
#include "device_node/drivers/falcon/falcon_driver.h"
#include "device_node/drivers/falcon/falcon_firmware.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t kMostBytes = 4096;  // that the chip keeps

}  // namespace

FalconEmulator::FalconEmulator(EmulatedDevice& device, const FalconConfig& config,
                               const State& state)
    : device_(device),
      config_(config),
      state_(state),
      listener_(config.port, "device.falcon.port"),
      grip_m_(FalconDelta::middle_m()) {
  place(device_.read());
}

void FalconEmulator::run(const std::stop_token& stop) {
  listener_.run(device_, kFalconIds, stop, [&](PacketPort& client) { serve(client, stop); });
}

void FalconEmulator::serve(PacketPort& client, const std::stop_token& stop) {
  is_asked_ = false;
  to_host_.clear();
  later_.clear();
  command_.clear();
  std::array<std::byte, 1 + kUsbPacketBytes> packet{};
  while (!stop.stop_requested()) {
    const Duration wait = is_asked_ ? Duration(flushed_at_ + latency_ - Steady::now()) : 20ms;
    std::size_t size = 0;
    const Transfer outcome = client.read(packet, size, std::clamp<Duration>(wait, 0ms, 20ms));
    if (outcome == Transfer::kClosed) return;
    if (outcome == Transfer::kDone && (device_.fault() == WireFault::kUnplugged ||
                                       !take(client, std::span(packet).first(size)))) {
      return;
    }
    flush(client);
  }
}

bool FalconEmulator::take(PacketPort& client, std::span<const std::byte> packet) {
  const auto byte = [&](std::size_t at) { return std::to_integer<std::uint8_t>(packet[at]); };
  switch (static_cast<EmulatedUsb>(packet[0])) {
    case EmulatedUsb::kControl:
      if (packet.size() != 4) return false;
      control(byte(1), static_cast<std::uint16_t>(byte(2) | (byte(3) << 8)));
      return client.write(packet.first(1), 1s) == Transfer::kDone;
    case EmulatedUsb::kOut:
      for (const std::byte each : packet.subspan(1)) take_byte(each);
      return true;
    case EmulatedUsb::kIn:
      if (packet.size() != 2) return false;
      is_asked_ = true;
      tag_ = packet[1];
      return true;
  }
  return false;
}

void FalconEmulator::control(std::uint8_t request, std::uint16_t value) {
  switch (static_cast<FtdiRequest>(request)) {
    case FtdiRequest::kReset:
      if (value == 1) {
        to_host_.clear();
        later_.clear();
      }
      if (value == 2) command_.clear();
      break;
    case FtdiRequest::kModemControl:
      if (value == kFtdiDtrHigh && !is_dtr_high_) {  // starts the boot loader
        state_.is_loaded = false;
        is_booting_ = false;
        greeting_.clear();
        image_.clear();
      }
      if (value == kFtdiDtrHigh || value == kFtdiDtrLow) is_dtr_high_ = value == kFtdiDtrHigh;
      break;
    case FtdiRequest::kBaudRate:
      divisor_ = value;
      // the first byte only tries the new rate
      if (value == kFalconRunDivisor && is_booting_ && image_.size() > 1) {
        image_.erase(image_.begin());
        state_.is_loaded = true;
        is_booting_ = false;
        homing_since_s_.reset();
      }
      break;
    case FtdiRequest::kEventCharacter:
      event_ = value;
      break;
    case FtdiRequest::kLatency:
      latency_ = std::chrono::milliseconds(value);
      break;
    case FtdiRequest::kFlowControl:
    case FtdiRequest::kData:
      break;
  }
}

void FalconEmulator::take_byte(std::byte byte) {
  if (!state_.is_loaded) return boot(byte);
  if (divisor_ != kFalconRunDivisor) return;
  command_.push_back(byte);
  if (command_.front() != std::byte{'<'}) command_.clear();
  if (command_.size() < kFalconMessageBytes) return;
  FalconMessage command{};
  std::copy(command_.begin(), command_.end(), command.begin());
  command_.clear();
  answer(command);
}

void FalconEmulator::boot(std::byte byte) {
  if (divisor_ == kFalconBootDivisor && is_dtr_high_) {
    greeting_.push_back(byte);
    if (greeting_.size() < kFalconGreeting.size()) return;
    is_booting_ = std::equal(greeting_.begin(), greeting_.end(), kFalconGreeting.begin());
    greeting_.clear();
    if (is_booting_) send_from_device(kFalconWelcome);
  } else if (divisor_ == kFalconLoadDivisor && is_booting_) {
    image_.push_back(byte);
    if (device_.fault() == WireFault::kEcho) byte ^= std::byte{0x10};
    send_from_device(std::span(&byte, 1));
  }
}

void FalconEmulator::answer(const FalconMessage& command) {
  FalconCounts motors{};
  std::uint8_t flags = 0;
  const WireFault fault = device_.fault();
  if (fault == WireFault::kSilent || !read_falcon_command(command, motors, flags)) return;
  const double now_s = device_.now_s();
  if (device_.takes_begin_of(WireFault::kEncoderZero)) {  // a moment without power
    homing_since_s_.reset();
    state_.homing = 1min;
  }
  if ((flags & kFalconHoming) != 0 && !homing_since_s_) homing_since_s_ = now_s;
  const bool is_homed = homing_since_s_ && now_s - *homing_since_s_ >= to_seconds(state_.homing);
  const DeviceSample sample = move(motors);
  place(sample);
  FalconMessage message = falcon_answer({.encoders = encoders_,
                                         .buttons = static_cast<std::uint8_t>(sample.buttons & 15U),
                                         .homed = is_homed ? kFalconAllHomed : std::uint8_t{0}});
  if (fault == WireFault::kGarbage) message.fill(std::byte{0xFF});
  if (fault == WireFault::kDelayed) std::this_thread::sleep_for(5ms);
  const std::size_t size = fault == WireFault::kShort ? message.size() / 2 : message.size();
  for (auto& transfer : device_.transfers_of(std::span(message).first(size))) {
    if (device_.has(WireFault::kPartial) && !to_host_.empty()) {
      later_ = std::move(transfer);
    } else {
      send_from_device(transfer);
    }
  }
}

void FalconEmulator::send_from_device(std::span<const std::byte> bytes) {
  if (to_host_.size() + bytes.size() > kMostBytes) to_host_.clear();
  to_host_.insert(to_host_.end(), bytes.begin(), bytes.end());
  const auto event = static_cast<std::byte>(event_ & 0xFFU);
  has_event_ = has_event_ || ((event_ & kFtdiEventOn) != 0 &&
                              std::find(bytes.begin(), bytes.end(), event) != bytes.end());
}

void FalconEmulator::flush(PacketPort& client) {
  const bool is_due = Steady::now() >= flushed_at_ + latency_;
  if (!is_asked_ || !(is_due || has_event_ || to_host_.size() >= kFtdiPayloadBytes)) return;
  std::array<std::byte, 2 + kUsbPacketBytes> packet{static_cast<std::byte>(EmulatedUsb::kIn), tag_,
                                                    std::byte{0x01}, std::byte{0x60}};
  const std::size_t size = std::min(to_host_.size(), kFtdiPayloadBytes);
  const auto end = to_host_.begin() + static_cast<std::ptrdiff_t>(size);
  std::copy(to_host_.begin(), end, packet.begin() + 2 + kFtdiStatusBytes);
  to_host_.erase(to_host_.begin(), end);
  if (to_host_.empty()) has_event_ = false;
  if (to_host_.empty() && !later_.empty()) send_from_device(std::exchange(later_, {}));
  is_asked_ = false;
  flushed_at_ = Steady::now();
  static_cast<void>(client.write(std::span(packet).first(2 + kFtdiStatusBytes + size), 50ms));
}

void FalconEmulator::place(const DeviceSample& sample) {
  const Vector3 grip_m = config_.rotation.conjugate() * sample.hand_position_m + config_.origin_m;
  const std::optional<Vector3> angles = FalconDelta::angles_rad(grip_m);
  if (!angles) return;  // at the end of its reach
  const Vector3 zero = falcon_angles_rad(config_, {});
  for (std::size_t leg = 0; leg < kFalconLegs; ++leg) {
    const auto i = static_cast<Eigen::Index>(leg);
    encoders_[leg] =
        static_cast<std::int16_t>(std::lround(((*angles)[i] - zero[i]) / FalconDelta::kCount_rad));
  }
  grip_m_ = FalconDelta::grip_m(falcon_angles_rad(config_, encoders_), grip_m).value_or(grip_m);
}

DeviceSample FalconEmulator::move(const FalconCounts& motors) {
  if (!device_.has(WireFault::kTurning)) {
    return device_.switch_to(force_newton(motors, grip_m_, falcon_angles_rad(config_, encoders_)));
  }
  return device_.switch_to([this, motors](const Vector3& hand_m) {
    const Vector3 grip_m = config_.rotation.conjugate() * hand_m + config_.origin_m;
    const std::optional<Vector3> angles = FalconDelta::angles_rad(grip_m);
    return angles ? force_newton(motors, grip_m, *angles) : Vector3(Vector3::Zero());
  });
}

Vector3 FalconEmulator::force_newton(const FalconCounts& motors, const Vector3& grip_m,
                                     const Vector3& angles_rad) const {
  const std::optional<Matrix3> jacobian = FalconDelta::jacobian(grip_m, angles_rad);
  if (!jacobian) return Vector3::Zero();
  const Vector3 torque_newton_m = Vector3(motors[0], motors[1], motors[2]) / config_.torque_gain;
  return config_.rotation * (jacobian->transpose().inverse() * torque_newton_m);
}

}  // namespace palpate::device
