// SPDX-License-Identifier: Apache-2.0
// hostile_design.h — the random design `hostile {}`: runs of deploy/sessions/hostile.txtpb in which
// everything that mode guard tolerates is against it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace palpate::campaign {

/// Overrides of a run drawn at random within the assumptions of mode guard: any device, lease,
/// deadline, encoder, workspace, scene, network, scheduler and physics, true friction at or above
/// the profile. The same for a seed on every machine.
[[nodiscard]] std::vector<std::string> hostile_overrides(std::uint64_t seed);
/// Of a session whose device has a wrist, besides.
[[nodiscard]] std::vector<std::string> hostile_wrist_overrides(std::uint64_t seed);

/// A law of adversary.clamp, any but the truthful one.
[[nodiscard]] std::string lying_clamp_override(std::uint64_t seed);

}  // namespace palpate::campaign
