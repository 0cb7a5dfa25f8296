// SPDX-License-Identifier: Apache-2.0
// side_index.h — the place of a side among those of the session, by its name. Each message of a
// node names its side: with 64 sides no message costs a search through all of them.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "common/session/session.h"

namespace palpate::viewer {

class SideIndex {
 public:
  explicit SideIndex(const Session& session) {
    for (const Side& side : session.sides) index_.emplace(side.name, index_.size());
  }

  /// Index in session.sides; none if the session has no such side.
  [[nodiscard]] std::optional<std::size_t> of(std::string_view side) const {
    const auto it = index_.find(side);
    return it != index_.end() ? std::optional(it->second) : std::nullopt;
  }

 private:
  std::map<std::string, std::size_t, std::less<>> index_;
};

}  // namespace palpate::viewer
