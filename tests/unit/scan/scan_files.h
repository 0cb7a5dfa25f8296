// SPDX-License-Identifier: Apache-2.0
// scan_files.h — label maps byte by byte, after the text of the formats and without their readers.
#pragma once

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

#include "common/core/check.h"

namespace palpate::test {

inline std::string gzipped(std::string_view bytes) {
  z_stream stream{};
  PALPATE_REQUIRE(deflateInit2(&stream, 9, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY) == Z_OK);
  std::string result(deflateBound(&stream, bytes.size()) + 64, '\0');
  stream.next_in = const_cast<Bytef*>(reinterpret_cast<const Bytef*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(result.data());
  stream.avail_out = static_cast<uInt>(result.size());
  PALPATE_REQUIRE(deflate(&stream, Z_FINISH) == Z_STREAM_END);
  result.resize(stream.total_out);
  deflateEnd(&stream);
  return result;
}

/// A header of NIfTI-1, its numbers placed by offset.
struct Nifti1 {
  std::string bytes = std::string(352, '\0');
  bool is_big = false;

  template <class T>
  Nifti1& put(std::size_t offset, T value) {
    std::array<char, sizeof(T)> raw;
    std::memcpy(raw.data(), &value, sizeof value);
    if (is_big) std::reverse(raw.begin(), raw.end());
    std::copy(raw.begin(), raw.end(), bytes.begin() + static_cast<std::ptrdiff_t>(offset));
    return *this;
  }
  /// 4 × 3 × 2 voxels of unsigned char in mm, without orientation.
  explicit Nifti1(bool big = false) : is_big(big) {
    put<std::int32_t>(0, 348);
    const std::array<std::int16_t, 8> dim = {3, 4, 3, 2, 1, 1, 1, 1};
    for (std::size_t i = 0; i < 8; ++i) put(40 + 2 * i, dim[i]);
    put<std::int16_t>(70, 2);
    put<std::int16_t>(72, 8);
    put(76, 1.0F).put(80, 2.0F).put(84, 3.0F).put(88, 4.0F);
    put(108, 352.0F);
    bytes[123] = 2;
    std::memcpy(bytes.data() + 344, "n+1", 4);
  }
  Nifti1& sform(const std::array<float, 12>& rows) {
    put<std::int16_t>(254, 1);
    for (std::size_t i = 0; i < 12; ++i) put(280 + 4 * i, rows[i]);
    return *this;
  }
  Nifti1& qform(float b, float c, float d, std::array<float, 3> offset, float factor) {
    put<std::int16_t>(252, 1).put(76, factor);
    put(256, b).put(260, c).put(264, d);
    for (std::size_t i = 0; i < 3; ++i) put(268 + 4 * i, offset[i]);
    return *this;
  }
  [[nodiscard]] std::string with(std::string_view voxels) const {
    return bytes + std::string(voxels);
  }
};

/// 4 × 3 × 2 voxels that look different from every side: 1 at (0,0,0), 2 at (3,0,0), 3 at (0,2,0),
/// 4 at (0,0,1).
inline std::string four_corners() {
  std::string voxels(24, '\0');
  voxels[0] = 1;
  voxels[3] = 2;
  voxels[8] = 3;
  voxels[12] = 4;
  return voxels;
}

}  // namespace palpate::test
