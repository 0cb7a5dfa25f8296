// SPDX-License-Identifier: Apache-2.0
// label_map_fuzz.cpp — any bytes as a label map, read by PALPATE_PARSE: a map whose voxels are all
// in its segments and places, or a SetupError; never a crash, a hang or another exception.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "common/core/check.h"
#include "deploy/scan/label_map.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using palpate::Vector3;
  try {
    const palpate::scan::LabelMap map = palpate::scan::PALPATE_PARSE(
        std::string_view(reinterpret_cast<const char*>(data), size), "fuzz");
    PALPATE_REQUIRE(map.voxels.size() == std::size_t{map.size[0]} * map.size[1] * map.size[2]);
    std::uint64_t counted = 0;
    for (const std::uint16_t voxel : map.voxels) {
      PALPATE_REQUIRE(voxel <= map.segments.size());
      counted += voxel != 0 ? 1 : 0;
    }
    for (const auto& segment : map.segments) {
      PALPATE_REQUIRE(!segment.name.empty());
      counted -= segment.voxels;
    }
    PALPATE_REQUIRE(counted == 0 && map.ras_of_index_m.matrix().allFinite() &&
                    map.voxel_m3() > 0.0);
  } catch (const palpate::SetupError&) {
    // the expected result of most inputs
  }
  return 0;
}
