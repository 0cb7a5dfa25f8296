// SPDX-License-Identifier: Apache-2.0
// ports.h — the interface between a node and the network.
//
//   Sender<T>    outgoing end of a link; never blocks
//   Source<T>    incoming end of a link: a memory queue or a ZeroMQ socket
//   Inbox<T>     used by nodes: a Source with fault line, ordering and counters (inbox.h)
#pragma once

#include <cstdint>

#include "common/core/time.h"

namespace palpate {

enum class SendResult : std::uint8_t {
  kSent,
  kDropped,  ///< the queue is full: the receiver is slow or gone
  kNoPeer,   ///< no peer is connected
};

/// Outgoing end of one link. Never blocks.
template <class T>
class Sender {
 public:
  virtual ~Sender() = default;
  virtual SendResult send(const T& message) noexcept = 0;
};

/// Incoming end of one link, before fault simulation and ordering.
template <class T>
class Source {
 public:
  virtual ~Source() = default;
  /// The next message in order of arrival; false if there is none. Never blocks.
  [[nodiscard]] virtual bool receive(T& message, TimePoint& received_at) noexcept = 0;
  /// Returns when a message may have arrived, or at `deadline`. May return early.
  virtual void wait_until(TimePoint deadline) noexcept = 0;
  /// A hint, given in idle time: the next wait_until() will have about this deadline or a later
  /// one. It moves the cost of setting a timer out of the time-critical path.
  virtual void prepare_wait(TimePoint deadline) noexcept { static_cast<void>(deadline); }
  /// The connection to the sender existed and is lost; false where the transport cannot tell. Call
  /// receive() first.
  [[nodiscard]] virtual bool has_lost_peer() const noexcept { return false; }
  /// Frames that the codec has refused so far; 0 for links without a codec.
  [[nodiscard]] virtual std::uint64_t rejected() const noexcept { return 0; }
};

/// Counters of one incoming link since the start; part of the telemetry.
struct LinkCounters {
  std::uint64_t accepted = 0;
  std::uint64_t skipped = 0;       ///< missing sequence numbers: lost on the way
  std::uint64_t duplicates = 0;    ///< repeated sequence numbers
  std::uint64_t out_of_order = 0;  ///< older than a message already accepted; dropped
  std::uint64_t rejected = 0;      ///< refused by the codec
  std::uint64_t ahead = 0;         ///< answers to a DeviceState that was never sent; dropped
  std::uint64_t sessions = 0;      ///< sender sessions seen; 1 in a run without restarts
};

}  // namespace palpate
