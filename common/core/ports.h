// ports.h — all a node knows of the network: it can send, it can ask for what arrived, it can wait.
//
//   Sender<T>    outgoing end of a link                        never blocks
//   Source<T>    incoming end, one message after the other     memory queue or ZeroMQ socket
//   Inbox<T>     what a node holds: a Source behind the fault line, ordered and counted (inbox.h)
#pragma once

#include <cstdint>

#include "common/core/time.h"

namespace palpate {

enum class SendResult : std::uint8_t {
  kSent,
  kDropped,  ///< queue full; the receiver is slow or gone
  kNoPeer,   ///< nobody is connected
};

/// Outgoing end of one link. Never blocks.
template <class T>
class Sender {
 public:
  virtual ~Sender() = default;
  virtual SendResult send(const T& message) noexcept = 0;
};

/// Incoming end of one link, below faults and ordering.
template <class T>
class Source {
 public:
  virtual ~Source() = default;
  /// The next message, in arrival order; false when there is none. Never blocks.
  [[nodiscard]] virtual bool receive(T& message, TimePoint& received_at) noexcept = 0;
  /// Returns when a message may have arrived, or at `deadline`. May return early.
  virtual void wait_until(TimePoint deadline) noexcept = 0;
  /// A hint, for idle time: the next wait_until() will want about this deadline, or a later one.
  /// What it costs to set a timer is then not paid on the way to an answer.
  virtual void prepare_wait(TimePoint deadline) noexcept { static_cast<void>(deadline); }
  /// Frames refused so far by the codec below; 0 where there is none.
  [[nodiscard]] virtual std::uint64_t rejected() const noexcept { return 0; }
};

/// What happened on one incoming link since the start. Telemetry, not log lines.
struct LinkCounters {
  std::uint64_t accepted = 0;
  std::uint64_t skipped = 0;     ///< sequence numbers never seen: lost, or overtaken by conflation
  std::uint64_t duplicates = 0;  ///< same sequence again
  std::uint64_t out_of_order = 0;  ///< older than one already accepted; dropped
  std::uint64_t rejected = 0;      ///< refused by the codec
  std::uint64_t sessions = 0;      ///< sender sessions seen; 1 in a run without restarts
};

}  // namespace palpate
