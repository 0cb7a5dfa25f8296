// verdict.h — what is good or bad about a run, and what to do about it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/session/session.h"
#include "common/telemetry/telemetry.h"

namespace palpate {

struct Verdict {
  bool is_good = false;
  std::string text;  ///< "1.7 % of the ticks were skipped: run `palpate doctor`"
};

/// Of one device's run. Limits: 0.1 % of the ticks skipped or not answered in time, a true energy
/// of −1 µJ, 5 % of the ticks in contact clamped.
/// @param in_real_time  false: in lockstep, where lateness is a simulated fault
[[nodiscard]] std::vector<Verdict> verdicts_of(const Side& side, const DeviceCounters& device,
                                               const MofcCounters& mofc, bool in_real_time);

/// A line for each, "  good  …", in colour on a terminal.
[[nodiscard]] std::string verdict_text(const std::vector<Verdict>& verdicts);

/// The tool was in tissue at the first step of the physics: why the force may be wrong there, and
/// what to do; empty if it was not.
[[nodiscard]] std::string start_warning(const PhysicsTick& first);

}  // namespace palpate
