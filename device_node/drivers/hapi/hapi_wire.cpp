// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/hapi/hapi_wire.h"

#include <bit>
#include <cmath>

namespace palpate::device {
namespace {

/// Writes bytes one after the other.
template <std::size_t size>
class HapiWriter {
 public:
  void byte(std::uint8_t value) noexcept { bytes_[at_++] = std::byte{value}; }
  void number(float value) noexcept {
    const auto bits = std::bit_cast<std::uint32_t>(value);
    for (unsigned shift = 0; shift < 32; shift += 8) byte(static_cast<std::uint8_t>(bits >> shift));
  }
  [[nodiscard]] const std::array<std::byte, size>& bytes() const noexcept { return bytes_; }

 private:
  std::array<std::byte, size> bytes_{};
  std::size_t at_ = 0;
};

std::uint8_t port_mask(const std::array<std::uint8_t, kHapiMotors>& ports) noexcept {
  unsigned mask = 0;
  for (const std::uint8_t port : ports) mask |= 1U << (port - 1U);
  return static_cast<std::uint8_t>(mask);
}

/// Directions are listed in the order of the ports.
template <std::size_t size>
void write_block(HapiWriter<size>& writer, const std::array<std::uint8_t, kHapiMotors>& ports,
                 const std::array<std::uint8_t, kHapiMotors>& directions) noexcept {
  writer.byte(port_mask(ports));
  const bool is_swapped = ports[0] > ports[1];
  writer.byte(directions[is_swapped ? 1 : 0]);
  writer.byte(directions[is_swapped ? 0 : 1]);
}

}  // namespace

std::array<std::byte, kHapiSetUpBytes> hapi_set_up(const HapiBoard& board) noexcept {
  HapiWriter<kHapiSetUpBytes> writer;
  writer.byte(1);
  writer.byte(board.device_id);
  write_block(writer, board.motor_ports, board.motor_directions);
  write_block(writer, board.encoder_ports, board.encoder_directions);
  writer.byte(0);  // sensors
  writer.byte(0);  // PWM
  const std::size_t first = board.encoder_ports[0] > board.encoder_ports[1] ? 1 : 0;
  for (const std::size_t i : {first, 1 - first}) {
    writer.number(board.encoder_offsets_deg[i]);
    writer.number(board.encoder_resolutions[i]);
  }
  return writer.bytes();
}

std::array<std::byte, kHapiTorqueBytes> hapi_torques(
    std::uint8_t device_id, const std::array<float, kHapiMotors>& torques_newton_m) noexcept {
  HapiWriter<kHapiTorqueBytes> writer;
  writer.byte(2);
  writer.byte(device_id);
  for (const float torque : torques_newton_m) writer.number(torque);
  return writer.bytes();
}

bool read_hapi_angles(std::span<const std::byte, kHapiReadingBytes> bytes, std::uint8_t device_id,
                      std::array<float, kHapiMotors>& angles_deg) noexcept {
  if (bytes[0] != std::byte{device_id}) return false;
  for (std::size_t i = 0; i < kHapiMotors; ++i) {
    std::uint32_t bits = 0;
    for (std::size_t b = 0; b < 4; ++b) {
      bits |= std::to_integer<std::uint32_t>(bytes[1 + 4 * i + b]) << (8 * b);
    }
    angles_deg[i] = std::bit_cast<float>(bits);
    // negated: NaN is refused too
    if (!(std::abs(angles_deg[i]) <= 3600.0F)) return false;
  }
  return true;
}

}  // namespace palpate::device
