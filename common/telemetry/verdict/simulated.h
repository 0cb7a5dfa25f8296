// SPDX-License-Identifier: Apache-2.0
// simulated.h — what a session simulates to go wrong, and how much of a run it disturbs.
#pragma once

#include <cstdint>
#include <string>

#include "common/session/session.h"

namespace palpate {

/// Where a disturbance is simulated.
enum class SimulatedAt : std::uint8_t {
  kExchange,  ///< hops 1 and 4
  kPhysics,   ///< hops 2 and 3, and a hostile physics
  kHostile,   ///< of these the physics alone
  kStandby,   ///< hops 2 and 3 of physics.standby
  kDevice,    ///< ticks and switches of device_node
  kClamp,     ///< a clamp that lies
};

struct SimulatedDisturbance {
  std::string fields{};  ///< of the session: "faults.interaction"; empty: there is none
  /// Of the messages or ticks of the run: lost, late or false, 0 … 1. A duplicate is dropped and
  /// disturbs nothing; a delay disturbs all, by its share of a period of the device.
  double share = 0.0;
};

/// @param period_s       of the device
/// @param run_s          length of the run
/// @param least_delay_s  of a delay, what nobody notices
[[nodiscard]] SimulatedDisturbance simulated_at(SimulatedAt place, const FaultsConfig& faults,
                                                const AdversaryConfig& adversary, double period_s,
                                                double run_s, double least_delay_s = 0.0);

}  // namespace palpate
