// SPDX-License-Identifier: Apache-2.0
// usb_port.h — a USB device with one bulk endpoint in each direction, by Linux's own interface to
// USB (/dev/bus/usb): a library in between would allocate memory for every transfer.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "common/core/time.h"
#include "device_node/drivers/transport/packet_port.h"
#include "device_node/drivers/transport/transfer.h"

namespace palpate::device {

/// One thread; transfers neither allocate nor throw.
class UsbPort {
 public:
  virtual ~UsbPort() = default;
  /// A request of the vendor's own, without data.
  [[nodiscard]] virtual Transfer control(std::uint8_t request, std::uint16_t value,
                                         Duration within) noexcept = 0;
  /// To the bulk endpoint 0x02.
  [[nodiscard]] virtual Transfer write(std::span<const std::byte> bytes,
                                       Duration within) noexcept = 0;
  /// One transfer from the bulk endpoint 0x81.
  [[nodiscard]] virtual Transfer read(std::span<std::byte> buffer, std::size_t& size,
                                      Duration within) noexcept = 0;
};

/// Requests to an emulator: one packet each, this byte first.
enum class EmulatedUsb : std::uint8_t {
  kControl = 0,  ///< request, value (little-endian); answered by the same byte alone
  kOut = 1,      ///< the bytes
  kIn = 2,       ///< a tag; answered by this byte, the tag and what the device sends
};
inline constexpr std::size_t kUsbPacketBytes = 64;

/// The file of the only device of these ids below /dev/bus/usb.
/// @throws std::runtime_error  there is none, or several: the text lists them
[[nodiscard]] std::string find_usb_device(const UsbIds& ids);

/// @param path  below /dev/bus/usb, or the socket of an emulator
/// @throws std::runtime_error  it cannot be opened, or is another device
[[nodiscard]] std::unique_ptr<UsbPort> open_usb(const std::string& path, const UsbIds& ids);

}  // namespace palpate::device
