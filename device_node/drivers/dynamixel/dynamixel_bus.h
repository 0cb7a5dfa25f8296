// SPDX-License-Identifier: Apache-2.0
// dynamixel_bus.h — instructions to the servos of one serial line and their answers, each within a
// given time. One thread; nothing allocates after the construction, nothing throws.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "common/core/time.h"
#include "device_node/drivers/dynamixel/dynamixel_packet.h"
#include "device_node/drivers/transport/serial_port.h"
#include "device_node/drivers/transport/transfer.h"

namespace palpate::device {

/// Whole packets over a serial line: what either end of it needs.
class DynamixelLine {
 public:
  explicit DynamixelLine(SerialPort& port) : port_(port) {}

  /// @param within  that the line takes the packet; it may still be on its way then
  [[nodiscard]] Transfer send(std::span<const std::byte> packet, Duration within) noexcept;
  /// The next packet, whole, its CRC not checked; noise before its header is left out.
  /// @param packet  receives where it is, until the next call
  [[nodiscard]] Transfer receive(std::span<std::byte>& packet, Duration within) noexcept;
  /// Forgets what has come.
  void discard() noexcept { port_.discard_input(); }

 private:
  SerialPort& port_;
  std::array<std::byte, kMostDynamixelBytes> buffer_{};
};

/// What a servo says of itself.
struct DynamixelPing {
  unsigned model = 0;
  unsigned firmware = 0;
};

/// One servo's answer to a read of several.
struct DynamixelAnswer {
  std::uint8_t error = 0;
  std::array<std::byte, 32> data{};
};

class DynamixelBus {
 public:
  /// @param answer_limit  for an answer, beside the time that its bytes take on the line
  /// @throws std::runtime_error  the port cannot be opened or has no such speed; says why
  DynamixelBus(const std::string& path, unsigned bits_per_second, Duration answer_limit);

  [[nodiscard]] Transfer ping(unsigned id, DynamixelPing& answer) noexcept;
  /// @param error  receives the status' error; 0: none
  [[nodiscard]] Transfer read(unsigned id, unsigned address, std::span<std::byte> data,
                              std::uint8_t& error) noexcept;
  [[nodiscard]] Transfer write(unsigned id, unsigned address, std::span<const std::byte> data,
                               std::uint8_t& error) noexcept;
  /// No servo answers.
  /// @param data  the bytes of the first id, then of the second, …
  [[nodiscard]] Transfer sync_write(unsigned address, std::size_t bytes_each,
                                    std::span<const std::uint8_t> ids,
                                    std::span<const std::byte> data) noexcept;
  /// The same bytes from every servo.
  /// @param is_fast  as one packet (Fast Sync Read)   @param bytes_each  ≤ 32
  [[nodiscard]] Transfer sync_read(bool is_fast, unsigned address, std::size_t bytes_each,
                                   std::span<const std::uint8_t> ids,
                                   std::span<DynamixelAnswer> answers) noexcept;

 private:
  [[nodiscard]] Transfer ask(DynamixelPacket& instruction, std::size_t answer_bytes) noexcept;
  [[nodiscard]] Transfer status(unsigned id, std::size_t data_bytes,
                                DynamixelMessage& message) noexcept;
  [[nodiscard]] Duration time_for(std::size_t bytes) const noexcept;

  SerialPort port_;
  DynamixelLine line_;
  unsigned bits_per_second_;
  Duration answer_limit_;
};

}  // namespace palpate::device
