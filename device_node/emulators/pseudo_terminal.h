// SPDX-License-Identifier: Apache-2.0
// pseudo_terminal.h — the end of a serial line that an emulator stands behind.
#pragma once

#include <fcntl.h>
#include <stdlib.h>
#include <unistd.h>

#include <string>

#include "common/core/check.h"

namespace palpate::device {

class PseudoTerminal {
 public:
  /// @throws SetupError  none to be had
  PseudoTerminal() : end_(::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC)) {
    if (end_ < 0 || ::grantpt(end_) != 0 || ::unlockpt(end_) != 0) {
      throw SetupError("no pseudo-terminal to be had: is /dev/pts mounted?");
    }
    name_ = ::ptsname(end_);
    client_end_ = ::open(name_.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC);
  }
  ~PseudoTerminal() { ::close(client_end_); }
  PseudoTerminal(const PseudoTerminal&) = delete;
  PseudoTerminal& operator=(const PseudoTerminal&) = delete;

  /// What a driver opens.
  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  /// The emulator's end, for a SerialPort, which owns it.
  [[nodiscard]] int end() const noexcept { return end_; }

 private:
  int end_;
  int client_end_ = -1;  // kept open, so that the line does not hang up between two clients
  std::string name_;
};

}  // namespace palpate::device
