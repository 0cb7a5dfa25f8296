// SPDX-License-Identifier: Apache-2.0
// remedies.h — words that several findings share.
#pragma once

#include <string>

#include "common/telemetry/verdict/verdict.h"

namespace palpate {

/// The recorded path of the hand moves faster than v_max somewhere.
[[nodiscard]] inline bool is_path_too_fast(const RunFacts& facts) {
  return facts.path_m_per_s > facts.v_max_m_per_s;
}
/// What to do about that.
[[nodiscard]] std::string path_remedy(const RunFacts& facts);
/// What to do where the clamp grants, or counts on, more than the device has seen.
[[nodiscard]] std::string disagreement_remedy(const RunFacts& facts);
/// Of motors that end no force by themselves, in a session that does not accept that.
[[nodiscard]] RunFinding no_motor_watchdog(const RunFacts& facts);
/// They do not, and the session does not accept that, or what it accepts gives no force: nothing
/// bounds in its workspace what they hold.
[[nodiscard]] bool is_held_by_no_watchdog(const RunFacts& facts);
/// "mofc_node, physics_node"; empty: the telemetry of all is there.
[[nodiscard]] std::string nodes_left_out(const RunFacts& facts);

}  // namespace palpate
