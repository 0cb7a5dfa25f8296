// SPDX-License-Identifier: Apache-2.0
// device_findings.h — what the device itself says about a run.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "common/telemetry/verdict/verdict.h"

namespace palpate {

/// A finding that is its own cause.
struct OwnFinding {
  Grade grade;
  const char* what;
  std::string text;
  std::string remedy = {};
  double share = 1.0;

  [[nodiscard]] RunFinding finding() && {
    return {grade, what, what, std::move(text), std::move(remedy), share};
  }
};

/// One was latched, or is.
[[nodiscard]] bool has_fault(const RunFacts& facts);
/// Each explains itself.
[[nodiscard]] std::vector<RunFinding> device_findings(const RunFacts& facts);

}  // namespace palpate
