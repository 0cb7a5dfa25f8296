// SPDX-License-Identifier: Apache-2.0
// two_networks.h — two machines on one: network namespaces that only see each other.
#pragma once

#include <sys/types.h>

#include <optional>
#include <string>

#include "tests/support/network/packet_relay.h"

namespace palpate::test {

/// The calling process becomes the bedside; the workstation is the network of an idle child. Make
/// it before the process has a second thread.
class TwoNetworks {
 public:
  static constexpr const char* kBedside = "10.77.0.1";
  static constexpr const char* kWorkstation = "10.77.0.2";

  TwoNetworks() = default;
  ~TwoNetworks();
  TwoNetworks(const TwoNetworks&) = delete;
  TwoNetworks& operator=(const TwoNetworks&) = delete;

  /// Makes both, without a cable. Returns the reason of a failure; "" on success.
  [[nodiscard]] std::string make();
  /// A cable, in place of the one before. With a disturbance: of `tc netem`, or of a PacketRelay if
  /// the kernel has no netem. Returns the reason of a failure; "" on success.
  [[nodiscard]] std::string connect(const std::optional<PacketDisturbance>& disturbance = {});

  /// Descriptor of its network namespace.
  [[nodiscard]] int workstation() const { return workstation_; }
  /// What the cable is made of: "veth", "veth, netem" or "TUN relay".
  [[nodiscard]] const std::string& cable() const { return cable_; }
  [[nodiscard]] bool cut() const;
  [[nodiscard]] bool mend() const;
  /// Of the workstation: as before its network is up, and after.
  [[nodiscard]] bool remove_address() const;
  [[nodiscard]] bool add_address() const;

 private:
  [[nodiscard]] bool add_netem(const PacketDisturbance& disturbance) const;

  pid_t child_ = 0;
  int workstation_ = -1;
  std::string cable_;
  std::optional<PacketRelay> relay_;
};

}  // namespace palpate::test
