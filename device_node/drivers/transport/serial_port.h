// SPDX-License-Identifier: Apache-2.0
// serial_port.h — a serial line or a pseudo-terminal whose transfers end within a given time.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "common/core/time.h"
#include "device_node/drivers/transport/transfer.h"

namespace palpate::device {

/// Raw bytes, no flow control. One thread; transfers neither allocate nor throw.
class SerialPort {
 public:
  /// @throws std::runtime_error  the file cannot be opened or is no terminal; says why
  explicit SerialPort(const std::string& path);
  /// Of an open terminal, which it owns from now on.
  explicit SerialPort(int terminal);
  ~SerialPort();
  SerialPort(const SerialPort&) = delete;
  SerialPort& operator=(const SerialPort&) = delete;

  /// Bits a second, and the adapter's latency as low as it goes.
  /// @throws std::runtime_error  the line cannot have it; says which speeds there are
  void set_speed(unsigned bits_per_second);

  [[nodiscard]] Transfer write(std::span<const std::byte> bytes, Duration within) noexcept;
  /// Fills `bytes`, or fails.
  [[nodiscard]] Transfer read(std::span<std::byte> bytes, Duration within) noexcept;
  /// Whether bytes wait that no read() has asked for.
  [[nodiscard]] bool has_input() const noexcept;
  /// Forgets what has arrived: what a message without frame needs before the next request.
  void discard_input() noexcept;

 private:
  int terminal_;
};

}  // namespace palpate::device
