// SPDX-License-Identifier: Apache-2.0
#include "device_node/emulators/wooden_emulator.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <thread>

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

}  // namespace

WoodenEmulator::WoodenEmulator(EmulatedDevice& device, const WoodenConfig& config)
    : device_(device),
      config_(config),
      drive_(config),
      listener_(config.port, "device.wooden.port"),
      sample_(device_.read()),
      raw_(raw_counts(sample_.hand_position_m)) {
  // powered at this position: the counters are 0
  if (!config_.is_calibrated) zero_ = raw_;
}

void WoodenEmulator::run(const std::stop_token& stop) {
  listener_.run(device_, kWoodenIds, stop, [&](PacketPort& client) { serve(client, stop); });
}

void WoodenEmulator::serve(PacketPort& client, const std::stop_token& stop) {
  was_button_pressed_ = is_person_there();
  std::array<std::byte, 2 * kWoodenReportBytes> packet{};
  while (!stop.stop_requested()) {
    std::size_t size = 0;
    const Transfer outcome = client.read(packet, size, 20ms);
    if (outcome == Transfer::kClosed) return;
    if (outcome == Transfer::kTimeout) continue;
    WoodenCommand command;
    if (!read_wooden_command(std::span(packet).first(size), command)) continue;
    const WireFault fault = device_.fault();
    if (fault == WireFault::kUnplugged) return;
    if (device_.takes_begin_of(WireFault::kEncoderZero)) zero_ = raw_;
    if (device_.takes_begin_of(WireFault::kPowerCycle)) {
      zero_ = raw_;
      has_lost_power_ = true;
      return;  // the board leaves the bus and comes back
    }
    if (fault == WireFault::kSilent) continue;
    take(command);
    WoodenReportBytes report = wooden_report(reading());
    if (fault == WireFault::kGarbage) report.fill(std::byte{0xFF});
    if (fault == WireFault::kDelayed) std::this_thread::sleep_for(5ms);
    const std::size_t length = fault == WireFault::kShort ? report.size() / 2 : report.size();
    for (const auto& transfer : device_.transfers_of(std::span(report).first(length))) {
      static_cast<void>(client.write(transfer, 50ms));
    }
  }
}

void WoodenEmulator::take(const WoodenCommand& command) {
  Vector3 ma = Vector3::Zero();
  if (command.command == kWoodenSetCounters) {
    was_button_pressed_ = is_person_there();  // who presses it once more
    // as if the hand held the handle where the session says
    for (std::size_t axis = 0; axis < kWoodenAxes; ++axis) {
      zero_[axis] = config_.calibration_counts[axis] - command.attributes[axis];
    }
  } else {
    for (std::size_t axis = 0; axis < kWoodenAxes; ++axis) {
      ma[static_cast<Eigen::Index>(axis)] =
          std::clamp<double>(command.currents_ma[axis], -drive_.largest_ma, drive_.largest_ma);
    }
  }
  if (device_.has(WireFault::kTurning)) {
    sample_ = device_.switch_to([this, ma](const Vector3& hand_m) {
      const Vector3 handle_m = config_.rotation.conjugate() * hand_m + config_.origin_m;
      const std::optional<Vector3> angles = drive_.arm.angles_rad(handle_m);
      return angles ? force_newton(ma, *angles) : Vector3(Vector3::Zero());
    });
  } else {
    const Vector3 counts(raw_[0], raw_[1], raw_[2]);
    sample_ = device_.switch_to(force_newton(ma, drive_.rad_per_count.cwiseProduct(counts)));
  }
  raw_ = raw_counts(sample_.hand_position_m);
}

Vector3 WoodenEmulator::force_newton(const Vector3& ma, const Vector3& angles_rad) const {
  const std::optional<Matrix3> jacobian = drive_.arm.jacobian(angles_rad);
  if (!jacobian) return Vector3::Zero();
  return config_.rotation *
         (jacobian->transpose().inverse() * ma.cwiseQuotient(drive_.ma_per_newton_m));
}

std::array<std::int32_t, kWoodenAxes> WoodenEmulator::raw_counts(const Vector3& hand_m) const {
  const Vector3 handle_m = config_.rotation.conjugate() * hand_m + config_.origin_m;
  const std::optional<Vector3> angles = drive_.arm.angles_rad(handle_m);
  if (!angles) return raw_;  // at the end of its reach
  std::array<std::int32_t, kWoodenAxes> counts{};
  for (std::size_t axis = 0; axis < kWoodenAxes; ++axis) {
    const auto i = static_cast<Eigen::Index>(axis);
    counts[axis] = static_cast<std::int32_t>(std::lround((*angles)[i] / drive_.rad_per_count[i]));
  }
  return counts;
}

WoodenReading WoodenEmulator::reading() const {
  WoodenReading reading;
  for (std::size_t axis = 0; axis < kWoodenAxes; ++axis) {
    reading.encoders[axis] = static_cast<std::int16_t>(raw_[axis] - zero_[axis]);
  }
  if ((sample_.buttons & 1U) != 0) reading.encoders[3] = 10000;
  reading.info = was_button_pressed_ ? 1 : 0;
  return reading;
}

}  // namespace palpate::device
