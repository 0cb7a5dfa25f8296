#include "common/link/socket/subscriptions.h"

#include <cstddef>

#include "common/link/socket/frame_bytes.h"

namespace palpate {

void Subscriptions::take(LinkSocket& socket) noexcept {
  while (socket.receive(notice_)) {
    // first byte 1: a peer subscribed to the topic that follows; 0: the last subscriber left.
    // Longer topics match no message.
    const auto notice = bytes_of(notice_);
    if (notice.empty() || notice.size() > 2) continue;
    const auto kind = notice.size() == 2 ? static_cast<std::size_t>(notice[1]) : std::size_t{0};
    if (kind >= kMessageKinds) continue;
    Topic& topic = notice.size() == 2 ? of_kind_[kind] : all_;
    topic.is_wanted = notice[0] == std::byte{1};
    if (topic.is_wanted) ++topic.count;
  }
}
bool Subscriptions::has(MessageKind kind) const noexcept {
  return all_.is_wanted || of_kind_[static_cast<std::size_t>(kind)].is_wanted;
}
std::uint64_t Subscriptions::count(MessageKind kind) const noexcept {
  return all_.count + of_kind_[static_cast<std::size_t>(kind)].count;
}

}  // namespace palpate
