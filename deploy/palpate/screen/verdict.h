// SPDX-License-Identifier: Apache-2.0
// verdict.h — the verdict on a run (common/telemetry/verdict/verdict.h) on a terminal.
#pragma once

#include <string>
#include <vector>

#include "common/telemetry/verdict/verdict.h"

namespace palpate {

/// "  good  …", in colour on a terminal.
[[nodiscard]] std::string graded_line(Grade grade, const std::string& text);
/// A line for each, "  good  …: remedy", in colour on a terminal.
[[nodiscard]] std::string verdict_text(const std::vector<RunFinding>& findings);

/// The tool was in tissue at the first step of the physics: why the force may be wrong there, and
/// what to do; empty if it was not.
[[nodiscard]] std::string start_warning(const PhysicsTick& first);

}  // namespace palpate
