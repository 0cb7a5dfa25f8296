// SPDX-License-Identifier: Apache-2.0
// finding.h — what a conformance suite has found.
#pragma once

#include <functional>
#include <string>

namespace palpate {

struct ConformFinding {
  std::string check;  ///< "stamps"
  bool is_good = false;
  std::string text;         ///< what was found
  std::string remedy = {};  ///< empty if it is good
  bool is_checked = true;   ///< false: it cannot be observed; is_good says nothing
};

/// Called for each, in order.
using OnFinding = std::function<void(const ConformFinding&)>;

}  // namespace palpate
