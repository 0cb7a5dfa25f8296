// SPDX-License-Identifier: Apache-2.0
// zmq_source.h — incoming end of a one-way link: hops 2, 3, 6 and 7.
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
#include "common/link/subscription.h"

namespace palpate {

/// Receives every message in a queue of bounded length, which the inbox reads whole. If it
/// connects, it has one sender and subscribes to T there.
template <class T>
class ZmqSource final : public Source<T> {
 public:
  ZmqSource(ZmqContext& context, const Clock& clock, const Attachment& attachment);

  WaitHook on_wait;

  /// From now on accepts one sender at a time; see OneWriter.
  void keep_to_one_writer() { writer_.emplace(); }

  [[nodiscard]] bool receive(T& message, TimePoint& received_at) noexcept override;
  void wait_until(TimePoint deadline) noexcept override;
  [[nodiscard]] bool has_lost_peer() const noexcept override {
    return subscription_ && socket_.has_lost_peer();
  }
  [[nodiscard]] std::uint64_t rejected() const noexcept override { return rejections_.total(); }

  [[nodiscard]] const Rejections& rejections() const { return rejections_; }
  [[nodiscard]] const std::string& endpoint() const { return socket_.endpoint(); }

 private:
  const Clock& clock_;
  LinkSocket socket_;
  std::optional<Subscription> subscription_;  // if it connects
  Codec<T> codec_;
  zmq::message_t frame_;
  Rejections rejections_;
  std::optional<OneWriter> writer_;  // empty: every sender is accepted
};

}  // namespace palpate
