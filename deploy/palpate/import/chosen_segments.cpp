// SPDX-License-Identifier: Apache-2.0
#include "deploy/palpate/import/chosen_segments.h"

#include <algorithm>

#include "common/core/check.h"
#include "common/core/user/nearest.h"

namespace palpate {

std::vector<std::uint32_t> segments_named(const scan::LabelMap& map,
                                          const std::vector<std::string>& names,
                                          const char* option) {
  std::vector<std::uint32_t> found;
  std::vector<std::string> known;
  for (const scan::Segment& segment : map.segments) known.push_back(segment.name);
  for (const std::string& name : names) {
    const auto is_meant = [&](const scan::Segment& s) {
      return s.name == name || std::to_string(s.value) == name;
    };
    const auto at = std::find_if(map.segments.begin(), map.segments.end(), is_meant);
    if (at == map.segments.end()) {
      const std::string meant = nearest(name, known);
      throw SetupError(
          std::string(option) + " " + name + ": the label map has no such label; " +
          (meant.empty() ? "without -o its labels are listed" : "did you mean \"" + meant + "\"?"));
    }
    // a name counts before a value, which segments of several layers may share
    const auto of_name = std::find_if(at, map.segments.end(),
                                      [&](const scan::Segment& s) { return s.name == name; });
    const auto other = of_name != map.segments.end()
                           ? map.segments.end()
                           : std::find_if(at + 1, map.segments.end(), is_meant);
    if (other != map.segments.end()) {
      throw SetupError(std::string(option) + " " + name + ": \"" + at->name + "\" and \"" +
                       other->name + "\" have this value; give a name");
    }
    found.push_back(static_cast<std::uint32_t>((of_name != map.segments.end() ? of_name : at) -
                                               map.segments.begin()));
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

}  // namespace palpate
