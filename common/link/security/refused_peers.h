// SPDX-License-Identifier: Apache-2.0
// refused_peers.h — counters of the peers that links refused.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

namespace palpate {

/// Why a connection was refused.
enum class Refusal : std::uint8_t {
  kUnknownKey,    ///< the key is not in allowed.keys
  kWrongRole,     ///< the key is listed, but for a role that may not use this link
  kLeft,          ///< the peer closed the connection during the handshake, as unencrypted ones may
  kBadHandshake,  ///< the peer has no keys, expects another server key or is no ZeroMQ 4
  kRefusedByOther,  ///< the binding end refused the key of this program
  kOtherUnknown,    ///< the binding end does not have the key expected of it
  kOtherBroken,     ///< the binding end violated the protocol; this end connects again
  kTooMuch,         ///< the peer sent more bytes without a complete message than the link allows
  kTooMany,         ///< more connections than kMostConnections
};
/// Cause and remedy for the log.
[[nodiscard]] const char* explain(Refusal refusal);

/// Counts refused peers since the start. Thread-safe.
class RefusedPeers {
 public:
  struct Count {
    std::uint64_t count = 0;
    std::string address{};  ///< of the latest one; "" if unknown
  };
  using Counts = std::map<std::pair<std::string_view, Refusal>, Count>;  ///< by link and reason

  void count(std::string_view link, Refusal refusal, const std::string& address);
  [[nodiscard]] Counts counts() const;
  [[nodiscard]] std::uint64_t total() const { return total_.load(std::memory_order_relaxed); }

 private:
  mutable std::mutex mutex_;
  Counts counts_;
  std::atomic<std::uint64_t> total_{0};
};

}  // namespace palpate
