// SPDX-License-Identifier: Apache-2.0
// mcap_format.h — the MCAP container, version 0 (mcap.dev/spec): records of one byte opcode, a
// 64-bit length and the content; little-endian; strings and maps with a 32-bit length in bytes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>

namespace palpate::viewer::mcap {

inline constexpr std::string_view kMagic("\x89MCAP0\r\n", 8);
inline constexpr std::size_t kRecordHead = 9;  ///< opcode and length
inline constexpr std::size_t kFooterBytes = kRecordHead + 20;

enum class Opcode : std::uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kAttachment = 0x09,
  kStatistics = 0x0B,
  kMetadata = 0x0C,
  kMetadataIndex = 0x0D,
  kSummaryOffset = 0x0E,
  kDataEnd = 0x0F,
};

/// One metadata record.
using Strings = std::map<std::string, std::string>;

/// A topic and the message on it.
struct Channel {
  std::string topic;
  std::string schema_name;  ///< full name of the message
  std::string schema;       ///< of protobuf: binary FileDescriptorSet
  std::string encoding = "protobuf";
  std::string schema_encoding = "protobuf";
};

/// IEEE CRC-32. @param crc  of the preceding bytes
[[nodiscard]] std::uint32_t crc_of(std::string_view bytes, std::uint32_t crc = 0);

/// Appends numbers and strings to a buffer.
class Bytes {
 public:
  explicit Bytes(std::string& to) : to_(to) {}
  template <class Unsigned>
  Bytes& number(Unsigned value) {
    for (std::size_t i = 0; i < sizeof(Unsigned); ++i) {
      to_ += static_cast<char>(static_cast<std::uint64_t>(value) >> (8 * i) & 0xFFU);
    }
    return *this;
  }
  Bytes& text(std::string_view text) {
    number(static_cast<std::uint32_t>(text.size()));
    to_ += text;
    return *this;
  }
  Bytes& strings(const Strings& strings);
  /// Opcode and length of the record whose content is appended next.
  Bytes& head(Opcode opcode, std::uint64_t length) {
    number(static_cast<std::uint8_t>(opcode));
    return number(length);
  }

 private:
  std::string& to_;
};

/// Reads them back. Past the end everything is 0 or empty, and `is_good()` is false.
class Fields {
 public:
  explicit Fields(std::string_view bytes) : rest_(bytes) {}
  template <class Unsigned>
  Unsigned number() {
    const std::string_view bytes = take(sizeof(Unsigned));
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      value |= std::uint64_t{static_cast<unsigned char>(bytes[i])} << (8 * i);
    }
    return static_cast<Unsigned>(value);
  }
  std::string_view take(std::uint64_t count) {
    if (count > rest_.size()) {
      is_good_ = false;
      rest_ = {};
      return {};
    }
    const std::string_view taken = rest_.substr(0, count);
    rest_.remove_prefix(count);
    return taken;
  }
  std::string_view text() { return take(number<std::uint32_t>()); }
  Strings strings();

  [[nodiscard]] bool is_good() const { return is_good_; }
  [[nodiscard]] std::string_view rest() const { return rest_; }

 private:
  std::string_view rest_;
  bool is_good_ = true;
};

}  // namespace palpate::viewer::mcap
