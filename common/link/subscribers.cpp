// SPDX-License-Identifier: Apache-2.0
#include "common/link/subscribers.h"

#include <algorithm>
#include <cstring>

#include "common/core/clock.h"
#include "common/link/socket/frame_bytes.h"

namespace palpate {
namespace {

constexpr std::uint32_t bit(std::size_t kind) { return std::uint32_t{1} << kind; }

}  // namespace

void Subscribers::take() noexcept {
  const TimePoint now = SteadyClock().now();
  for (int i = 0; i < kMostReadPerCall; ++i) {
    const Reception reception = socket_.receive(frame_, &from_);
    if (reception == Reception::kNothing) break;
    if (reception == Reception::kMalformed || !accept(from_, frame_, now)) ++refused_;
  }
  if (socket_.is_inproc()) return;
  for (std::size_t i = size_; i-- > 0;) {
    if (now - peers_[i].heard_at >= kSilence) remove(i);
  }
}

bool Subscribers::accept(const zmq::message_t& from, const zmq::message_t& frame,
                         TimePoint now) noexcept {
  const auto bytes = bytes_of(frame);
  if (from.size() != sizeof(PeerId) || bytes.empty() || bytes.size() > kMessageKinds ||
      bytes[0] != static_cast<std::byte>(MessageKind::kSubscription)) {
    return false;
  }
  PeerId id;
  std::memcpy(id.data(), from.data(), id.size());
  const auto end = peers_.begin() + static_cast<std::ptrdiff_t>(size_);
  auto peer = std::find_if(peers_.begin(), end, [&](const Peer& known) { return known.id == id; });
  if (peer == peers_.end()) return false;
  if (peer == end) {
    ++size_;
    *peer = {.id = id};
  }
  std::uint32_t kinds = 0;
  for (const std::byte kind : bytes.subspan(1)) {  // a later version may know more kinds
    const auto index = static_cast<std::size_t>(kind);
    if (index < kMessageKinds) kinds |= bit(index);
  }
  for (std::size_t kind = 0; kind < kMessageKinds; ++kind) {
    if ((kinds & ~peer->kinds & bit(kind)) != 0) ++counts_[kind];
  }
  peer->kinds = kinds;
  peer->heard_at = now;
  return true;
}

bool Subscribers::has(MessageKind kind) const noexcept {
  return std::any_of(
      peers_.begin(), peers_.begin() + static_cast<std::ptrdiff_t>(size_),
      [&](const Peer& peer) { return (peer.kinds & bit(static_cast<std::size_t>(kind))) != 0; });
}

SendResult Subscribers::send(MessageKind kind, zmq::message_t& frame) noexcept {
  SendResult result = SendResult::kNoPeer;
  for (std::size_t i = size_; i-- > 0;) {
    if ((peers_[i].kinds & bit(static_cast<std::size_t>(kind))) == 0) continue;
    zmq::message_t to(peers_[i].id.data(), peers_[i].id.size());
    const SendResult reached = socket_.send(to, ZMQ_SNDMORE);
    if (reached == SendResult::kNoPeer) {
      remove(i);
      continue;
    }
    result = SendResult::kSent;
    if (reached == SendResult::kDropped) continue;  // its queue is full
    zmq::message_t shared;
    shared.copy(frame);
    static_cast<void>(socket_.send(shared, 0));
  }
  return result;
}

}  // namespace palpate
