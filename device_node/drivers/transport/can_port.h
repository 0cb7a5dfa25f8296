// SPDX-License-Identifier: Apache-2.0
// can_port.h — frames of a CAN bus, classic and FD: over SocketCAN, or over the socket of an
// emulator that carries the same frames where a computer has no such interface.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

#include "common/core/time.h"
#include "device_node/drivers/transport/packet_port.h"
#include "device_node/drivers/transport/transfer.h"

namespace palpate::device {

/// A data frame with a standard identifier.
struct CanFrame {
  std::uint32_t id = 0;   ///< 0 … 0x7FF
  bool is_fd = false;     ///< with a switch to the higher bit rate
  std::uint8_t size = 0;  ///< of data: ≤ 8, FD ≤ 64
  std::array<std::byte, 64> data{};
};

/// The frame as the kernel's struct can_frame or canfd_frame.
struct CanBytes {
  std::array<std::byte, 72> bytes{};
  std::size_t size = 0;
};
[[nodiscard]] CanBytes to_bytes(const CanFrame& frame) noexcept;

/// What the bytes of such a struct are.
enum class CanKind : std::uint8_t {
  kData,
  kOther,    ///< an extended identifier, a request, or an error that passes
  kBusOff,   ///< the controller has left the bus after errors
  kCorrupt,  ///< no frame
};
[[nodiscard]] CanKind read_can(std::span<const std::byte> bytes, CanFrame& frame) noexcept;

/// One thread; transfers neither allocate nor throw.
class CanPort {
 public:
  /// @param name  of an interface, such as can0; with a slash: of an emulator's socket
  /// @param is_fd  the interface must be one for FD
  /// @throws std::runtime_error  why it cannot be opened, and the remedy
  CanPort(const std::string& name, bool is_fd);
  /// Of an emulator's client, which it owns from now on.
  explicit CanPort(int socket) : port_(socket) {}

  /// kFull if the frame could not leave within the time, kDown if the interface is down.
  [[nodiscard]] Transfer send(const CanFrame& frame, Duration within) noexcept;
  /// The next data frame.
  [[nodiscard]] Transfer receive(CanFrame& frame, Duration within) noexcept;
  /// Forgets what has come, up to a limit.
  void discard() noexcept;

 private:
  PacketPort port_;
};

}  // namespace palpate::device
