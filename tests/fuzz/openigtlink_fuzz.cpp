// SPDX-License-Identifier: Apache-2.0
// openigtlink_fuzz.cpp — any bytes as those of a client of OpenIGTLink, in parts whose length is
// the first byte: bounded memory, and of each TRANSFORM a rigid pose or a complaint.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "common/core/check.h"
#include "viewer_node/openigtlink/reader.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace palpate::viewer::igtl;  // NOLINT: all of it
  if (size == 0) return 0;
  const std::size_t part = std::size_t{data[0]} + 1;
  std::string_view bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  Reader reader;
  bool is_good = true;
  while (is_good && !bytes.empty()) {
    is_good = reader.take(
        bytes.substr(0, part), [](const Header& header) { return header.type != "IMAGE"; },
        [](const Header& header, const std::string& body) {
          PALPATE_REQUIRE(body.size() == header.body_bytes && body.size() <= kMostBodyBytes);
          const ReadTransform read = read_transform(header, body);
          PALPATE_REQUIRE(!read.complaint.empty() ||
                          (read.pose.matrix().allFinite() && read.pose.linear().isUnitary(1e-9) &&
                           read.pose.linear().determinant() > 0.0));
        });
    PALPATE_REQUIRE(reader.kept_bytes() <= kHeaderBytes + kMostBodyBytes);
    bytes.remove_prefix(std::min(part, bytes.size()));
  }
  return 0;
}
