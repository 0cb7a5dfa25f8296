// SPDX-License-Identifier: Apache-2.0
// packet_relay.h — two TUN devices in two networks and a process that copies packets between them
// with delay, jitter and loss: what `tc netem` does, for kernels that are built without it.
#pragma once

#include <sys/types.h>

#include <string>

#include "common/core/time.h"

namespace palpate::test {

/// Of each direction.
struct PacketDisturbance {
  Duration delay{};
  Duration jitter{};  ///< each packet's delay is uniform in delay ± jitter, so packets overtake
  double loss_ratio = 0.0;
};

class PacketRelay {
 public:
  PacketRelay() = default;
  ~PacketRelay();
  PacketRelay(const PacketRelay&) = delete;
  PacketRelay& operator=(const PacketRelay&) = delete;

  /// Makes the device `near` in the network of this process and `far` in the other one, and starts
  /// to copy. The devices have no address and are down.
  /// @param far_network  descriptor of the other network namespace
  /// @return the reason of a failure; "" on success
  [[nodiscard]] std::string start(const char* near, int far_network, const char* far,
                                  const PacketDisturbance& disturbance);

 private:
  pid_t pid_ = 0;
};

}  // namespace palpate::test
