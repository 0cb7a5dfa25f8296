// SPDX-License-Identifier: Apache-2.0
#include "common/link/rejections.h"

namespace palpate {

std::uint64_t Rejections::total() const noexcept {
  std::uint64_t total = second_writer();
  for (const auto& n : by_reason_) total += n.load(std::memory_order_relaxed);
  return total;
}
std::uint64_t Rejections::of(DecodeError error) const noexcept {
  return by_reason_[static_cast<std::size_t>(error)].load(std::memory_order_relaxed);
}
std::uint64_t Rejections::second_writer() const noexcept {
  return second_writer_.load(std::memory_order_relaxed);
}
DecodeError Rejections::latest() const noexcept { return latest_.load(std::memory_order_relaxed); }
std::uint32_t Rejections::peer_major() const noexcept {
  return peer_major_.load(std::memory_order_relaxed);
}
void Rejections::count(DecodeError error, std::uint32_t peer_major) noexcept {
  by_reason_[static_cast<std::size_t>(error)].fetch_add(1, std::memory_order_relaxed);
  latest_.store(error, std::memory_order_relaxed);
  if (error == DecodeError::kWrongVersion) {
    peer_major_.store(peer_major, std::memory_order_relaxed);
  }
}
void Rejections::count_second_writer() noexcept {
  second_writer_.fetch_add(1, std::memory_order_relaxed);
  latest_.store(DecodeError::kNone, std::memory_order_relaxed);
}

}  // namespace palpate
