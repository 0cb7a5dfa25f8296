// SPDX-License-Identifier: Apache-2.0
// send_queue.h — the messages that wait for one WebSocket client, and the limits for a client that
// reads too slowly. No socket.
#pragma once

#include <cstddef>
#include <cstdint>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "viewer_node/server/foxglove_client.h"

namespace palpate::viewer {

/// One message, shared by all its recipients.
using Payload = std::shared_ptr<const std::string>;

[[nodiscard]] inline Payload make_payload(std::string bytes) {
  return std::make_shared<const std::string>(std::move(bytes));
}

struct OutgoingMessage {
  DataHeader header{};  ///< of binary messages
  Payload payload;
  bool is_binary = false;
  bool may_drop = false;
  /// Only the newest message of this subject waits; it replaces an older one.
  std::optional<std::size_t> subject{};
  /// The server holds the payload anyway: it counts as no bytes.
  bool is_held = false;

  [[nodiscard]] std::size_t bytes() const { return is_held ? 0 : payload->size(); }
};

/// First in, first out. One message at a time is in flight; the others wait.
class SendQueue {
 public:
  /// Payload bytes that may wait: about a second of all channels. Beyond it the oldest droppable
  /// messages go, until half of it is left, so that the rest is continuous.
  static constexpr std::size_t kMaxWaitingBytes = std::size_t{8} << 20;
  /// Replies, statuses and requested messages are never dropped; a client that causes this much of
  /// them and reads none is disconnected.
  static constexpr std::size_t kMaxWaitingMessages = 4096;
  static constexpr std::size_t kMaxUnreadBytes = std::size_t{32} << 20;

  /// What one message did to older ones; never to the one in flight.
  struct Pushed {
    std::uint64_t dropped = 0;   ///< for lack of space
    std::uint64_t replaced = 0;  ///< by a newer one of the same subject
  };
  /// Appends a message.
  Pushed push(OutgoingMessage message);
  /// Whether a message of the subject waits or is in flight.
  [[nodiscard]] bool has(std::size_t subject) const;
  /// Drops every message that may be dropped; returns their number.
  std::uint64_t drop_all() { return drop_until(0); }
  /// Waiting and in flight.
  [[nodiscard]] std::size_t bytes() const { return bytes_; }
  /// More waits than any client may leave unread.
  [[nodiscard]] bool is_overfull() const;

  /// Takes the oldest message out of the queue; null if none waits or one is in flight already.
  /// The message stays at its address until finish().
  [[nodiscard]] const OutgoingMessage* start();
  /// The message in flight was sent.
  void finish();

 private:
  /// Drops the oldest until `bytes` are left.
  std::uint64_t drop_until(std::size_t bytes);

  std::list<OutgoingMessage> waiting_;
  std::map<std::size_t, std::list<OutgoingMessage>::iterator> newest_;  // waiting, by subject
  std::optional<OutgoingMessage> in_flight_;
  std::size_t bytes_ = 0;
};

}  // namespace palpate::viewer
