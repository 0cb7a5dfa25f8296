// SPDX-License-Identifier: Apache-2.0
// reader.h — messages of OpenIGTLink out of the bytes of a connection, in whatever parts they come.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include "viewer_node/openigtlink/message.h"

namespace palpate::viewer::igtl {

/// Of a message that is kept; longer ones, and those that are not wanted, are skipped.
inline constexpr std::size_t kMostBodyBytes = 4096;

/// Keeps at most a header and kMostBodyBytes.
class Reader {
 public:
  /// @param wants       whether the message of this header is kept
  /// @param on_message  its body, whose CRC is unchecked
  /// @return false: what comes is no header, and nothing more can be read
  bool take(std::string_view bytes, const std::function<bool(const Header&)>& wants,
            const std::function<void(const Header&, const std::string& body)>& on_message);

  /// Of the body that is being read.
  [[nodiscard]] std::uint64_t left_bytes() const { return left_bytes_; }
  [[nodiscard]] std::size_t kept_bytes() const { return head_.size() + body_.size(); }

 private:
  std::string head_;
  Header header_;  // whose body is being read
  std::string body_;
  std::uint64_t left_bytes_ = 0;
  bool is_in_body_ = false;
  bool is_kept_ = false;
};

}  // namespace palpate::viewer::igtl
