// SPDX-License-Identifier: Apache-2.0
// byte_source.h — the bytes of a file from strangers, plain or compressed by gzip, piece by piece:
// never more in memory than a reader asks for, whatever a compressed file claims to hold.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

namespace palpate::scan {

class ByteSource {
 public:
  /// @param bytes  must outlive this
  /// @param name   of the file, for messages
  ByteSource(std::string_view bytes, bool is_gzip, std::string name);
  ~ByteSource();
  ByteSource(const ByteSource&) = delete;
  ByteSource& operator=(const ByteSource&) = delete;

  /// To be called before memory is taken for what follows. @throws SetupError  if the rest of the
  /// file cannot hold `count` bytes: gzip makes nothing smaller than a 1032nd
  void expect(std::uint64_t count) const;
  /// Fills `into`. @throws SetupError  if the file ends before, or its compressed data are damaged
  void read(std::span<char> into);
  void skip(std::uint64_t count);
  /// To be called after the last byte that is needed: checks the check sum of compressed data.
  /// @throws SetupError  if it is wrong, or if more than kMostTrailing bytes follow
  void finish();
  static constexpr std::size_t kMostTrailing = 65'536;

 private:
  struct Stream;
  /// At most into.size() bytes; 0 at the end.
  std::size_t some(std::span<char> into);

  std::string_view bytes_;
  std::string name_;
  std::size_t at_ = 0;
  std::unique_ptr<Stream> stream_;
};

/// Whether the bytes begin as a gzip file.
[[nodiscard]] bool is_gzip(std::string_view bytes) noexcept;

enum class ValueType : std::uint8_t {
  kInt8,
  kUint8,
  kInt16,
  kUint16,
  kInt32,
  kUint32,
  kInt64,
  kUint64,
  kFloat,
  kDouble
};

[[nodiscard]] std::size_t bytes_of(ValueType type) noexcept;

/// The next values, as double. @param values  filled
void read_values(ByteSource& source, ValueType type, std::endian endian, std::span<double> values);

}  // namespace palpate::scan
