// SPDX-License-Identifier: Apache-2.0
// telemetry_counters.h — the counters of the three nodes on hop 5.
#pragma once

#include "common/link/codec/wire_format.h"
#include "palpate/v1/telemetry.pb.h"

namespace palpate::wire {

void put(const DeviceCounters& c, v1::DeviceCounters& to);
void check_counters(const v1::DeviceCounters& c, Verdict& verdict);
[[nodiscard]] DeviceCounters counters(const v1::DeviceCounters& c);

void put(const MofcCounters& c, v1::MofcCounters& to);
void check_counters(const v1::MofcCounters& c, Verdict& verdict);
[[nodiscard]] MofcCounters counters(const v1::MofcCounters& c);

void put(const PhysicsCounters& c, v1::PhysicsCounters& to);
void check_counters(const v1::PhysicsCounters& c, Verdict& verdict);
[[nodiscard]] PhysicsCounters counters(const v1::PhysicsCounters& c);

}  // namespace palpate::wire
