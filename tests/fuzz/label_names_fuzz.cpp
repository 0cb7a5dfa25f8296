// SPDX-License-Identifier: Apache-2.0
// label_names_fuzz.cpp — any bytes as a file of names for the labels of a map: names that a session
// can hold, each once, or a SetupError.
#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <string_view>

#include "common/core/check.h"
#include "deploy/scan/label_map.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  palpate::scan::LabelMap map;
  map.segments = {{.value = 1, .name = "label 1"},
                  {.value = 2, .name = "label 2"},
                  {.value = 65'535, .name = "label 65535"}};
  try {
    palpate::scan::name_segments(map, std::string_view(reinterpret_cast<const char*>(data), size),
                                 "fuzz");
  } catch (const palpate::SetupError&) {
    return 0;
  }
  std::set<std::string> names;
  for (const auto& segment : map.segments) {
    PALPATE_REQUIRE(!segment.name.empty() && names.insert(segment.name).second);
    for (const char c : segment.name) PALPATE_REQUIRE(c != '"' && c != '\\' && c != '\n');
  }
  return 0;
}
