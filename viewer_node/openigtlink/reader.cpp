// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/openigtlink/reader.h"

#include <algorithm>
#include <optional>
#include <span>
#include <utility>

namespace palpate::viewer::igtl {

bool Reader::take(std::string_view bytes, const std::function<bool(const Header&)>& wants,
                  const std::function<void(const Header&, const std::string& body)>& on_message) {
  while (true) {
    if (!is_in_body_) {
      const std::size_t count = std::min(bytes.size(), kHeaderBytes - head_.size());
      head_ += bytes.substr(0, count);
      bytes.remove_prefix(count);
      if (head_.size() < kHeaderBytes) return true;
      const std::optional<Header> header =
          read_header(std::span<const char, kHeaderBytes>(head_.data(), kHeaderBytes));
      if (!header) return false;
      head_.clear();
      header_ = *header;
      left_bytes_ = header->body_bytes;
      is_in_body_ = true;
      is_kept_ = header->body_bytes <= kMostBodyBytes && wants(header_);
    }
    const std::size_t count = std::min<std::uint64_t>(bytes.size(), left_bytes_);
    if (is_kept_) body_ += bytes.substr(0, count);
    bytes.remove_prefix(count);
    left_bytes_ -= count;
    if (left_bytes_ > 0) return true;
    is_in_body_ = false;
    const std::string body = std::exchange(body_, {});
    if (is_kept_) on_message(header_, body);
  }
}

}  // namespace palpate::viewer::igtl
