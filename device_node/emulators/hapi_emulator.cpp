// SPDX-License-Identifier: Apache-2.0
#include "device_node/emulators/hapi_emulator.h"

#include <array>
#include <bit>
#include <chrono>
#include <cmath>
#include <numbers>
#include <optional>
#include <span>
#include <thread>
#include <utility>

#include "device_node/drivers/hapi/hapi_driver.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

constexpr Duration kLater = 200us;  // the second transfer of an answer

float number_at(const std::byte* bytes) {
  std::uint32_t bits = 0;
  for (unsigned b = 0; b < 4; ++b) bits |= std::to_integer<std::uint32_t>(bytes[b]) << (8 * b);
  return std::bit_cast<float>(bits);
}

}  // namespace

HapiEmulator::HapiEmulator(EmulatedDevice& device, const HapiConfig& config)
    : device_(device),
      config_(config),
      links_(pantograph_geometry(config)),
      line_(terminal_.end()),
      angles_rad_(Vector2(std::numbers::pi, 0.0)) {}

void HapiEmulator::run(const std::stop_token& stop) {
  std::array<std::byte, kHapiSetUpBytes> message{};
  while (!stop.stop_requested()) {
    if (line_.read(std::span(message).first(1), 50ms) != Transfer::kDone) continue;
    const auto type = std::to_integer<unsigned>(message[0]);
    const std::size_t size = type == 1 ? kHapiSetUpBytes : type == 2 ? kHapiTorqueBytes : 1;
    // without frame or check sum: what does not come in time is forgotten
    if (line_.read(std::span(message).subspan(1, size - 1), 50ms) != Transfer::kDone) continue;
    if (device_.takes_begin_of(WireFault::kPowerCycle)) {
      is_set_up_ = false;
      device_.let_go();
    }
    if (type == 1) set_up();
    if (type == 2 && is_set_up_) answer(message.data());
  }
}

/// The counters are set to the home position's, wherever the handle is. The emulated person holds
/// it there; who does not is off by the rest of the way.
void HapiEmulator::set_up() {
  ++set_ups_;
  is_set_up_ = true;
  zero_rad_.setZero();
  if (!device_.has(WireFault::kSetUpAnywhere)) return;
  place(device_.read());
  for (std::size_t i = 0; i < kHapiMotors; ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    zero_rad_[axis] = angles_rad_[axis] - config_.encoder_offsets_deg[i] * std::numbers::pi / 180.0;
  }
}

void HapiEmulator::place(const DeviceSample& sample) {
  const Vector3 handle_m = config_.rotation.conjugate() * sample.hand_position_m + config_.origin_m;
  if (const std::optional<Vector2> angles = links_.angles_rad(handle_m.head<2>())) {
    const double count_rad = 2.0 * std::numbers::pi / config_.encoder_resolution;
    for (Eigen::Index i = 0; i < 2; ++i) {
      angles_rad_[i] = count_rad * std::round((*angles)[i] / count_rad);
    }
  }
}

Vector3 HapiEmulator::force_newton(const Vector2& torque_newton_m,
                                   const Vector2& angles_rad) const {
  const std::optional<Matrix2> jacobian = links_.jacobian(angles_rad);
  if (!jacobian || !torque_newton_m.allFinite()) return Vector3::Zero();
  const Vector2 force = jacobian->transpose().inverse() * torque_newton_m;
  return config_.rotation * Vector3(force.x(), force.y(), 0.0);
}

DeviceSample HapiEmulator::move(const Vector2& torque_newton_m) {
  if (!device_.has(WireFault::kTurning)) {
    return device_.switch_to(force_newton(torque_newton_m, angles_rad_));
  }
  return device_.switch_to([this, torque_newton_m](const Vector3& hand_m) {
    const Vector3 handle_m = config_.rotation.conjugate() * hand_m + config_.origin_m;
    const std::optional<Vector2> angles = links_.angles_rad(handle_m.head<2>());
    return angles ? force_newton(torque_newton_m, *angles) : Vector3(Vector3::Zero());
  });
}

Vector2 HapiEmulator::made_torque_newton_m(Vector2 sent) const {
  const double largest = sent.cwiseAbs().maxCoeff();
  if (largest > config_.largest_torque_newton_m) sent *= config_.largest_torque_newton_m / largest;
  const double step = config_.torque_step_newton_m;
  return step * (sent / step).array().round() / config_.torque_gain;
}

void HapiEmulator::answer(const std::byte* message) {
  const WireFault fault = device_.fault();
  const auto id = std::to_integer<std::uint8_t>(message[1]);
  // as if it were not there
  if (id != config_.device_id || fault == WireFault::kUnplugged || fault == WireFault::kSilent)
    return;

  place(move(made_torque_newton_m(Vector2(number_at(message + 2), number_at(message + 6)))));
  std::array<float, kHapiMotors> angles_deg{};
  for (std::size_t i = 0; i < kHapiMotors; ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    angles_deg[i] =
        static_cast<float>((angles_rad_[axis] - zero_rad_[axis]) * 180.0 / std::numbers::pi);
  }
  std::array<std::byte, kHapiReadingBytes> reading{};
  const std::array<std::byte, kHapiTorqueBytes> numbers = hapi_torques(id, angles_deg);
  reading[0] = fault == WireFault::kWrongId ? std::byte{0xEE} : std::byte{id};
  std::copy(numbers.begin() + 2, numbers.end(), reading.begin() + 1);
  if (fault == WireFault::kGarbage) reading.fill(std::byte{0xFF});
  if (fault == WireFault::kDelayed) std::this_thread::sleep_for(5ms);
  const std::size_t size = fault == WireFault::kShort ? reading.size() / 2 : reading.size();
  bool is_later = false;
  for (const auto& transfer : device_.transfers_of(std::span(reading).first(size))) {
    const bool is_second = std::exchange(is_later, true);
    if (is_second && device_.has(WireFault::kPartial)) std::this_thread::sleep_for(kLater);
    static_cast<void>(line_.write(transfer, 50ms));
  }
}

}  // namespace palpate::device
