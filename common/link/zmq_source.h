// zmq_source.h — incoming end of a one-way link: hops 2, 3 and 6.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <zmq.hpp>

#include "common/core/clock.h"
#include "common/core/ports.h"
#include "common/link/codec/codec.h"
#include "common/link/one_writer.h"
#include "common/link/rejections.h"
#include "common/link/socket/link_socket.h"
#include "common/link/socket/peer_watch.h"

namespace palpate {

/// Incoming end of a one-way link.
template <class T>
class ZmqSource final : public Source<T> {
 public:
  ZmqSource(ZmqContext& context, const Clock& clock, const Attachment& attachment,
            Delivery delivery = Delivery::kNewest);

  WaitHook on_wait;

  /// From now on accepts one sender at a time; see OneWriter.
  void keep_to_one_writer() { writer_.emplace(); }

  /// From now on has_lost_peer() is known; for sources with one peer.
  void watch_peer() { watch_.emplace(context_, socket_); }

  [[nodiscard]] bool receive(T& message, TimePoint& received_at) noexcept override;
  void wait_until(TimePoint deadline) noexcept override;
  [[nodiscard]] bool has_lost_peer() const noexcept override { return watch_ && watch_->is_lost(); }
  [[nodiscard]] std::uint64_t rejected() const noexcept override { return rejections_.total(); }

  [[nodiscard]] const Rejections& rejections() const { return rejections_; }
  [[nodiscard]] const std::string& endpoint() const { return socket_.endpoint(); }

 private:
  ZmqContext& context_;
  const Clock& clock_;
  LinkSocket socket_;
  Codec<T> codec_;
  zmq::message_t frame_;
  Rejections rejections_;
  std::optional<OneWriter> writer_;  // empty: every sender is accepted
  std::optional<PeerWatch> watch_;   // destroyed before the socket
};

}  // namespace palpate
