// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/falcon/ftdi_line.h"

#include <algorithm>

#include "device_node/drivers/transport/wait_for.h"

namespace palpate::device {

Transfer FtdiLine::read(std::span<std::byte> bytes, Duration within) noexcept {
  const WireClock::time_point deadline = wire_deadline(within);
  for (std::size_t done = 0;;) {
    const std::size_t taken = std::min(size_, bytes.size() - done);
    std::copy_n(packet_.begin() + static_cast<std::ptrdiff_t>(from_), taken,
                bytes.begin() + static_cast<std::ptrdiff_t>(done));
    done += taken;
    from_ += taken;
    size_ -= taken;
    if (done == bytes.size()) return Transfer::kDone;
    const Duration left(deadline - WireClock::now());
    if (left <= Duration::zero()) return Transfer::kTimeout;
    std::size_t got = 0;
    const Transfer outcome = port_->read(packet_, got, left);
    if (outcome != Transfer::kDone) return outcome;
    if (got < kFtdiStatusBytes) return Transfer::kCorrupt;
    from_ = kFtdiStatusBytes;
    size_ = got - kFtdiStatusBytes;
  }
}

}  // namespace palpate::device
