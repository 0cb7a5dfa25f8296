// SPDX-License-Identifier: Apache-2.0
// device_findings.h — what the device itself says about a run.
#pragma once

#include <vector>

#include "common/telemetry/verdict/verdict.h"

namespace palpate {

/// One was latched, or is.
[[nodiscard]] bool has_fault(const RunFacts& facts);
/// Each explains itself.
[[nodiscard]] std::vector<RunFinding> device_findings(const RunFacts& facts);

}  // namespace palpate
