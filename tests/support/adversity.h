// SPDX-License-Identifier: Apache-2.0
// adversity.h — runs of the whole system in lockstep against a hand, a physics, a network and a
// scheduler that try to give the hand energy.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/telemetry/summary.h"
#include "deploy/lockstep/lockstep.h"
#include "tests/support/black_box/black_box.h"

namespace palpate::test {

/// One run. The session's `adversary` attacks, its `faults` are the network.
struct AdverseRun {
  std::vector<std::string> overrides;  ///< on this session of deploy/sessions
  std::string session = "hostile.txtpb";
  /// The physics is an engine from elsewhere that tells this much; the contact models are estimated
  /// from it. None: physics_node's own.
  std::optional<Told> told{};
  LockstepLinks links = LockstepLinks::kMemory;
  /// LockstepOptions::make_device
  std::function<std::unique_ptr<device::HapticDevice>(const Side&, const Clock&,
                                                      std::uint64_t seed)>
      make_device{};
  double seconds = 2.0;
};

struct AdverseResult {
  RunStatistics statistics;
  DeviceCounters device;
  MofcCounters mofc;
  double top_speed_m_per_s = 0.0;  ///< of the hand, true, at the ticks
  double v_max_m_per_s = 0.0;      ///< what the controller assumes of the hand
  double wrist_speed_ratio = 0.0;  ///< the same of the fastest joint of a wrist, over its v_max

  [[nodiscard]] bool is_too_fast() const {
    return top_speed_m_per_s > v_max_m_per_s || wrist_speed_ratio > 1.0;
  }
};

/// Same run and seed: same result, to the bit. Throws SetupError on overrides that are refused.
[[nodiscard]] AdverseResult run_adverse(const AdverseRun& run, std::uint64_t seed);

/// Of the random design hostile {} (deploy/campaign/hostile_design.h).
[[nodiscard]] AdverseRun random_adverse_run(std::uint64_t seed);
/// The same, with a physics from elsewhere, of which only forces, or contact points, are known.
[[nodiscard]] AdverseRun random_black_box_run(std::uint64_t seed);
/// The same with force and torque of a wrist, 0.5 s.
[[nodiscard]] AdverseRun random_wrist_run(std::uint64_t seed);
/// That of random_adverse_run(), with a clamp that lies.
[[nodiscard]] AdverseRun random_lying_run(std::uint64_t seed);

}  // namespace palpate::test
