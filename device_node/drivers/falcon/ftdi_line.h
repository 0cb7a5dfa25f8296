// SPDX-License-Identifier: Apache-2.0
// ftdi_line.h — the serial line behind an FTDI chip on USB: requests of the chip, and the bytes
// without the two status bytes that begin each packet from it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "common/core/time.h"
#include "device_node/drivers/transport/usb_port.h"

namespace palpate::device {

/// Requests of the chip.
enum class FtdiRequest : std::uint8_t {
  kReset = 0,  ///< 1: forget what the chip has received, 2: what it has to send
  kModemControl = 1,
  kFlowControl = 2,
  kBaudRate = 3,
  kData = 4,
  kEventCharacter = 6,  ///< this byte is passed on at once, with all before it
  kLatency = 9,         ///< [ms] after which bytes are passed on that fill no packet
};

inline constexpr std::uint16_t kFtdiEightBits = 8;  ///< no parity, one stop bit
inline constexpr std::uint16_t kFtdiDtrLow = 0x0100;
inline constexpr std::uint16_t kFtdiDtrHigh = 0x0101;
inline constexpr std::uint16_t kFtdiRtsLow = 0x0200;
inline constexpr std::uint16_t kFtdiEventOn = 0x0100;
inline constexpr std::size_t kFtdiStatusBytes = 2;
inline constexpr std::size_t kFtdiPayloadBytes = kUsbPacketBytes - kFtdiStatusBytes;

/// One thread; transfers neither allocate nor throw.
class FtdiLine {
 public:
  explicit FtdiLine(std::unique_ptr<UsbPort> port) : port_(std::move(port)) {}

  [[nodiscard]] Transfer request(FtdiRequest request, std::uint16_t value) noexcept {
    return port_->control(static_cast<std::uint8_t>(request), value, kControlLimit);
  }
  /// Forgets all bytes that are under way.
  [[nodiscard]] Transfer purge() noexcept {
    size_ = 0;
    const Transfer received = request(FtdiRequest::kReset, 1);
    return received == Transfer::kDone ? request(FtdiRequest::kReset, 2) : received;
  }
  /// @param bytes  ≤ kFtdiPayloadBytes
  [[nodiscard]] Transfer write(std::span<const std::byte> bytes, Duration within) noexcept {
    return port_->write(bytes, within);
  }
  /// Fills `bytes`, or fails.
  [[nodiscard]] Transfer read(std::span<std::byte> bytes, Duration within) noexcept;
  /// Whether the last packet had more than was read.
  [[nodiscard]] bool has_more() const noexcept { return size_ > 0; }

 private:
  static constexpr Duration kControlLimit = std::chrono::seconds(1);

  std::unique_ptr<UsbPort> port_;
  std::array<std::byte, kUsbPacketBytes> packet_{};
  std::size_t from_ = 0;  // of the bytes in the packet that nobody has read
  std::size_t size_ = 0;
};

}  // namespace palpate::device
