// SPDX-License-Identifier: Apache-2.0
// telemetry.h — hop 5 as plain structs: what each node publishes. Periodic threads only fill
// records and push them to a sink; other threads batch, encode and publish them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/telemetry/device_telemetry.h"
#include "common/telemetry/mofc_telemetry.h"
#include "common/telemetry/physics_telemetry.h"

namespace palpate {

/// One publication of a node: the ticks since the previous one, the counters since the
/// start.
template <class Record, class Counters>
struct TelemetryBatch {
  Header header;
  Counters counters;
  std::uint64_t records_lost = 0;   ///< did not fit the ring between tick and telemetry thread
  std::uint64_t peers_refused = 0;  ///< connections refused for lack of the right keys
  std::string node_version{};       ///< of the program
  std::string side{};               ///< of the session; "" where there is one device
  std::vector<Record> records;
};
using DeviceBatch = TelemetryBatch<DeviceTick, DeviceCounters>;
using MofcBatch = TelemetryBatch<MofcTick, MofcCounters>;
using PhysicsBatch = TelemetryBatch<PhysicsTick, PhysicsCounters>;

}  // namespace palpate
