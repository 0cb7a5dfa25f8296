// SPDX-License-Identifier: Apache-2.0
// guarantee_tables.h — the questions of guarantee_bench, one table each.
#pragma once

#include <string>
#include <vector>

#include "tests/bench/bench_output.h"

namespace palpate::bench {

/// Every controller mode against every adversity, friction and rate of physics.
/// @param more_overrides  of every session
/// @param shard  of the rows
[[nodiscard]] Table adversity_table(int seeds, const std::vector<std::string>& more_overrides,
                                    const Shard& shard);

/// Clamps that lie, without and with the monitor; friction that the profile overestimates, without
/// and with a hands-off check at the start. Mode guard, physics at 1 kHz.
[[nodiscard]] Table monitor_table(int seeds, const std::vector<std::string>& more_overrides,
                                  const Shard& shard);

/// The adversities within the assumptions, in mode guard, with the device behind the wire of each
/// driver of a real device that has an emulator, and with the plain simulated device of the same
/// specification.
/// @param least_joule  receives the least energy of the drivers' rows that need no motor watchdog
[[nodiscard]] Table device_table(int seeds, const std::vector<std::string>& more_overrides,
                                 const Shard& shard, double& least_joule);

/// Time of one tick of the monitor [µs]: a reading, a command, a switch. The best of 20 rounds.
[[nodiscard]] double monitor_tick_us(bool is_per_axis);

/// Soft, rigid and mixed tissue of the paper after increasing lengths of free motion: device and
/// clamp at 1 kHz, physics at 50 Hz, with its contact model or its held force; and all at 50 Hz.
/// The V begins at many phases of the physics, because one tick earlier or later already changes
/// the chatter: the remaining difference between the means is the influence of the past.
/// @param shard  of the groups of rows that share their t_free = 0
[[nodiscard]] Table history_table(bool is_quick, const std::vector<std::string>& more_overrides,
                                  const Shard& shard);

}  // namespace palpate::bench
