// SPDX-License-Identifier: Apache-2.0
// subscribers.h — the sender's part of hops 3 and 5, where the sender binds: the receivers and the
// kinds of message that each of them wants.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <zmq.hpp>

#include "common/core/time.h"
#include "common/link/codec/codec.h"
#include "common/link/socket/link_socket.h"

namespace palpate {

/// A table of bounded size: whatever peers send, it takes no memory. A receiver repeats its
/// subscription while it lives; one that is silent for kSilence is forgotten, except over inproc.
class Subscribers {
 public:
  static constexpr std::size_t kMost = 32;
  static constexpr Duration kSilence = std::chrono::seconds(1);
  /// Bounds the time that a flood of subscriptions can take.
  static constexpr int kMostReadPerCall = 32;

  /// @param socket  a ROUTER that binds; outlives this
  explicit Subscribers(LinkSocket& socket) : socket_(socket) {}

  /// Reads the subscriptions that have arrived. Neither blocks nor allocates.
  void take() noexcept;
  [[nodiscard]] bool has(MessageKind kind) const noexcept;
  /// Number of subscriptions to it so far, repetitions excluded. If it has increased, a new
  /// receiver needs all of it.
  [[nodiscard]] std::uint64_t count(MessageKind kind) const noexcept {
    return counts_[static_cast<std::size_t>(kind)];
  }
  /// Frames that are no subscription, or of a receiver beyond kMost.
  [[nodiscard]] std::uint64_t refused() const noexcept { return refused_; }

  /// To all that want the kind; one whose queue is full misses it without notice. kNoPeer: none
  /// wants it. Neither blocks nor copies the frame.
  SendResult send(MessageKind kind, zmq::message_t& frame) noexcept;

 private:
  /// libzmq's name of a connection that has not chosen one: 0 and a number.
  using PeerId = std::array<char, 5>;
  struct Peer {
    PeerId id{};
    std::uint32_t kinds = 0;  // one bit each
    TimePoint heard_at{};     // of the steady clock
  };

  [[nodiscard]] bool accept(const zmq::message_t& from, const zmq::message_t& frame,
                            TimePoint now) noexcept;
  void remove(std::size_t peer) noexcept { peers_[peer] = peers_[--size_]; }

  LinkSocket& socket_;
  zmq::message_t from_;
  zmq::message_t frame_;
  std::array<Peer, kMost> peers_{};
  std::size_t size_ = 0;
  std::array<std::uint64_t, kMessageKinds> counts_{};
  std::uint64_t refused_ = 0;
};

}  // namespace palpate
