// SPDX-License-Identifier: Apache-2.0
#include "deploy/scan/byte_source.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

#include "common/core/check.h"

namespace palpate::scan {
namespace {

constexpr int kGzipWindow = 15 + 16;  // zlib: the largest window, with a gzip header

template <class T>
void convert(std::span<const char> raw, std::endian endian, std::span<double> values) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    std::array<char, sizeof(T)> bytes;
    std::memcpy(bytes.data(), raw.data() + i * sizeof(T), sizeof(T));
    if (endian != std::endian::native) std::reverse(bytes.begin(), bytes.end());
    values[i] = static_cast<double>(std::bit_cast<T>(bytes));
  }
}

}  // namespace

struct ByteSource::Stream {
  z_stream zlib{};
  bool is_between_members = false;
};

ByteSource::ByteSource(std::string_view bytes, bool is_compressed, std::string name)
    : bytes_(bytes), name_(std::move(name)) {
  if (!is_compressed) return;
  stream_ = std::make_unique<Stream>();
  PALPATE_REQUIRE(inflateInit2(&stream_->zlib, kGzipWindow) == Z_OK);
}

ByteSource::~ByteSource() {
  if (stream_) inflateEnd(&stream_->zlib);
}

std::size_t ByteSource::some(std::span<char> into) {
  if (!stream_) {
    const std::size_t count = std::min(into.size(), bytes_.size() - at_);
    std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(at_), count, into.begin());
    at_ += count;
    return count;
  }
  constexpr std::size_t kMost = std::numeric_limits<uInt>::max();
  z_stream& zlib = stream_->zlib;
  zlib.next_out = reinterpret_cast<Bytef*>(into.data());
  zlib.avail_out = static_cast<uInt>(std::min(into.size(), kMost));
  const std::size_t wanted = zlib.avail_out;
  while (zlib.avail_out > 0) {
    if (stream_->is_between_members) {
      // a gzip file may be several, one after another; anything else behind is ignored, as gzip
      // does
      if (!is_gzip(bytes_.substr(at_))) break;
      inflateReset(&zlib);
      stream_->is_between_members = false;
    }
    zlib.next_in = const_cast<Bytef*>(reinterpret_cast<const Bytef*>(bytes_.data() + at_));
    zlib.avail_in = static_cast<uInt>(std::min(bytes_.size() - at_, kMost));
    const std::size_t before = zlib.avail_in;
    const int result = inflate(&zlib, Z_NO_FLUSH);
    at_ += before - zlib.avail_in;
    if (result == Z_STREAM_END) {
      stream_->is_between_members = true;
    } else if (result == Z_BUF_ERROR && at_ == bytes_.size()) {
      throw SetupError(name_ +
                       ": the compressed data end too early; copy or download the file again");
    } else if (result != Z_OK) {
      throw SetupError(name_ + ": the compressed data are damaged" +
                       (zlib.msg != nullptr ? std::string(" (") + zlib.msg + ")" : std::string()) +
                       "; copy or download the file again");
    }
  }
  return wanted - zlib.avail_out;
}

void ByteSource::expect(std::uint64_t count) const {
  constexpr std::uint64_t kMostRatio = 1032;
  const std::uint64_t left = bytes_.size() - at_;
  // what inflate holds back is less than its window
  if (count <= (stream_ ? kMostRatio * left + 65'536 : left)) return;
  throw SetupError(name_ + ": is too short for the " + std::to_string(count) +
                   " bytes of voxels that its header announces; copy or download the file again");
}

void ByteSource::read(std::span<char> into) {
  while (!into.empty()) {
    const std::size_t count = some(into);
    if (count == 0) {
      throw SetupError(name_ + ": ends " + std::to_string(into.size()) +
                       " bytes or more too early; copy or download the file again");
    }
    into = into.subspan(count);
  }
}

void ByteSource::skip(std::uint64_t count) {
  std::array<char, 4096> piece;
  while (count > 0) {
    const std::size_t now = std::min<std::uint64_t>(count, piece.size());
    read(std::span(piece).first(now));
    count -= now;
  }
}

void ByteSource::finish() {
  std::vector<char> rest(kMostTrailing + 1);
  std::span<char> free(rest);
  while (!free.empty()) {
    const std::size_t count = some(free);
    if (count == 0) return;
    free = free.subspan(count);
  }
  throw SetupError(name_ +
                   ": goes on after the voxels that its header announces: the sizes in the header "
                   "are wrong; save it again");
}

bool is_gzip(std::string_view bytes) noexcept { return bytes.starts_with("\x1f\x8b"); }

std::size_t bytes_of(ValueType type) noexcept {
  switch (type) {
    case ValueType::kInt8:
    case ValueType::kUint8:
      return 1;
    case ValueType::kInt16:
    case ValueType::kUint16:
      return 2;
    case ValueType::kInt32:
    case ValueType::kUint32:
    case ValueType::kFloat:
      return 4;
    default:
      return 8;
  }
}

void read_values(ByteSource& source, ValueType type, std::endian endian, std::span<double> values) {
  std::vector<char> raw(values.size() * bytes_of(type));
  source.read(raw);
  switch (type) {
    case ValueType::kInt8:
      return convert<std::int8_t>(raw, endian, values);
    case ValueType::kUint8:
      return convert<std::uint8_t>(raw, endian, values);
    case ValueType::kInt16:
      return convert<std::int16_t>(raw, endian, values);
    case ValueType::kUint16:
      return convert<std::uint16_t>(raw, endian, values);
    case ValueType::kInt32:
      return convert<std::int32_t>(raw, endian, values);
    case ValueType::kUint32:
      return convert<std::uint32_t>(raw, endian, values);
    case ValueType::kInt64:
      return convert<std::int64_t>(raw, endian, values);
    case ValueType::kUint64:
      return convert<std::uint64_t>(raw, endian, values);
    case ValueType::kFloat:
      return convert<float>(raw, endian, values);
    case ValueType::kDouble:
      return convert<double>(raw, endian, values);
  }
}

}  // namespace palpate::scan
