// SPDX-License-Identifier: Apache-2.0
// packet_port.h — a file whose transfers are whole packets: a hidraw device, the socket of a CAN
// interface, or that of an emulator that stands in for one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "common/core/time.h"
#include "device_node/drivers/transport/transfer.h"

namespace palpate::device {

/// What a USB device says that it is.
struct UsbIds {
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  friend bool operator==(const UsbIds&, const UsbIds&) = default;
};
/// "0403:cb48"
[[nodiscard]] std::string to_text(const UsbIds& ids);

/// Whether `path` is a socket: an emulator's.
[[nodiscard]] bool is_emulated(const std::string& path);

/// One thread; transfers neither allocate nor throw.
class PacketPort {
 public:
  /// A socket (SOCK_SEQPACKET) is connected to, any other file opened.
  /// @throws std::runtime_error  says why it cannot
  explicit PacketPort(const std::string& path);
  /// Of an open file, which it owns from now on.
  explicit PacketPort(int file);
  ~PacketPort();
  PacketPort(const PacketPort&) = delete;
  PacketPort& operator=(const PacketPort&) = delete;

  [[nodiscard]] Transfer write(std::span<const std::byte> packet, Duration within) noexcept;
  /// The next packet, cut to the size of `buffer`.
  [[nodiscard]] Transfer read(std::span<std::byte> buffer, std::size_t& size,
                              Duration within) noexcept;
  /// Forgets what has arrived.
  void discard_input() noexcept;
  /// Whether a packet waits that no read() has asked for.
  [[nodiscard]] bool has_input() const noexcept;
  [[nodiscard]] int file() const noexcept { return file_; }

  /// The first packet of an emulator: what its device is.
  /// @throws std::runtime_error  it sends none within `within`
  [[nodiscard]] UsbIds emulated_ids(Duration within);
  /// Of an emulator to its client.
  [[nodiscard]] Transfer send_ids(const UsbIds& ids) noexcept;

 private:
  int file_;
};

}  // namespace palpate::device
