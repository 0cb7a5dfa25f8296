// SPDX-License-Identifier: Apache-2.0
#include "common/core/user/way.h"

#include <deque>
#include <system_error>

namespace palpate {
namespace {

constexpr int kMostLinks = 40;

void push_front(std::deque<std::filesystem::path>& components, const std::filesystem::path& path) {
  std::vector<std::filesystem::path> parts;
  for (const std::filesystem::path& part : path.relative_path()) {
    if (!part.empty() && part != ".") parts.push_back(part);
  }
  components.insert(components.begin(), parts.begin(), parts.end());
}

}  // namespace

std::vector<WayStep> way_to(const std::filesystem::path& path) {
  std::vector<WayStep> way;
  std::deque<std::filesystem::path> components;
  push_front(components, path);
  std::filesystem::path at = "/";  // without links
  int links = 0;
  while (!components.empty()) {
    const std::filesystem::path component = components.front();
    components.pop_front();
    way.push_back({.path = at, .is_end = components.empty()});
    if (component == "..") {
      at = at.parent_path();
      continue;
    }
    const std::filesystem::path next = at / component;
    std::error_code error;
    if (!std::filesystem::is_symlink(next, error)) {
      at = next;
      continue;
    }
    way.push_back({.path = next, .is_link = true});
    const std::filesystem::path target = std::filesystem::read_symlink(next, error);
    if (error || ++links > kMostLinks) return way;
    push_front(components, target);
    if (target.is_absolute()) at = "/";
  }
  way.push_back({.path = at, .is_end = true});
  return way;
}

}  // namespace palpate
