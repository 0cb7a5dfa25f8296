// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/recording/mcap_format.h"

#include <zlib.h>

namespace palpate::viewer::mcap {

std::uint32_t crc_of(std::string_view bytes, std::uint32_t crc) {
  return static_cast<std::uint32_t>(
      crc32_z(crc, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()));
}

Bytes& Bytes::strings(const Strings& strings) {
  std::string body;
  Bytes bytes(body);
  for (const auto& [key, value] : strings) bytes.text(key).text(value);
  return text(body);
}

Strings Fields::strings() {
  Fields body(text());
  Strings strings;
  while (is_good_ && !body.rest().empty()) {
    std::string key(body.text());
    strings[std::move(key)] = std::string(body.text());
    is_good_ = body.is_good();
  }
  return strings;
}

}  // namespace palpate::viewer::mcap
