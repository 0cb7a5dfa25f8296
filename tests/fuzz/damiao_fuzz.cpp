// SPDX-License-Identifier: Apache-2.0
// Arbitrary bytes as frames of a CAN bus: what is accepted as a data frame becomes the same bytes
// again; feedback and registers of Damiao's motors are read within their bounds; an emulated motor
// takes any frame.
//
// The input is the kernel's struct can_frame (16 bytes) or canfd_frame (72 bytes).
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "common/core/check.h"
#include "device_node/drivers/damiao/damiao_frame.h"
#include "device_node/drivers/transport/can_port.h"
#include "device_node/emulators/damiao_motor.h"

namespace {

using namespace palpate::device;

void check_bytes(std::span<const std::byte> bytes, const CanFrame& frame) {
  PALPATE_REQUIRE(frame.id <= 0x7FF && frame.size <= 64);
  const CanBytes again = to_bytes(frame);
  PALPATE_REQUIRE(again.size == bytes.size());
  CanFrame read;
  PALPATE_REQUIRE(read_can(std::span(again.bytes).first(again.size), read) == CanKind::kData);
  PALPATE_REQUIRE(read.id == frame.id && read.size == frame.size && read.data == frame.data);
}

void check_motor(const CanFrame& frame) {
  EmulatedDamiaoMotor motor(DamiaoMotorSettings{});
  CanFrame told = frame;
  for (const std::uint32_t id : {frame.id, std::uint32_t{1}, damiao::kEveryone}) {
    told.id = id;
    const std::optional<CanFrame> answer = motor.hear(told, 0.0);
    if (answer) PALPATE_REQUIRE(answer->size == 8 && answer->id == 0x11);
    motor.advance(0.002, 50e-6, 0.1);
    PALPATE_REQUIRE(std::isfinite(motor.torque_newton_m()));
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::span<const std::byte> bytes(reinterpret_cast<const std::byte*>(data), size);
  CanFrame frame;
  if (read_can(bytes, frame) != CanKind::kData) return 0;
  check_bytes(bytes, frame);

  DamiaoFeedback said;
  if (read_damiao_feedback(frame, 1, said)) {
    PALPATE_REQUIRE(said.state <= 0xF && said.position <= 0xFFFF && said.velocity <= 0xFFF &&
                    said.torque <= 0xFFF);
    const double rad = damiao_value(said.position, -12.5, 12.5, 16);
    PALPATE_REQUIRE(rad >= -12.5 - 1e-9 && rad <= 12.5 + 1e-9);
  }
  std::uint32_t value = 0;
  for (unsigned which = 0; which < 256; ++which) {
    static_cast<void>(read_damiao_register(frame, 1, static_cast<std::uint8_t>(which), value));
  }
  check_motor(frame);
  return 0;
}
