// SPDX-License-Identifier: Apache-2.0
// batches.h — made-up telemetry for the tests of this folder: a 1 kHz device and its mofc, whose
// tick n is sampled at n ms.
#pragma once

#include <cstdint>

#include "common/telemetry/telemetry.h"

namespace palpate::viewer {

inline constexpr std::uint64_t kDeviceSession = 11;
inline constexpr std::uint64_t kMofcSession = 22;
inline constexpr std::uint64_t kPhysicsSession = 33;

inline TimePoint time_of_tick(std::uint64_t tick) {
  return TimePoint(std::chrono::milliseconds(static_cast<std::int64_t>(tick)));
}

/// Ticks first … last of the device; every one answered, 1 N acting along z.
inline DeviceBatch device_batch(std::uint64_t batch, std::uint64_t first, std::uint64_t last,
                                std::uint64_t session = kDeviceSession) {
  DeviceBatch made;
  made.header = {.session_id = session, .sequence = batch, .sampled_at = time_of_tick(last)};
  made.counters.loop.ticks = last + 1;
  made.counters.answered_ticks = last + 1;
  for (std::uint64_t n = first; n <= last; ++n) {
    DeviceTick tick;
    tick.sequence = n;
    tick.sampled_at = time_of_tick(n);
    tick.switched_at = tick.sampled_at;
    tick.force_on_hand_newton = {0, 0, 1};
    tick.guard = GuardState::kAnswered;
    tick.is_answered = true;
    made.records.push_back(tick);
  }
  return made;
}

/// The answers to ticks first … last: 2 N asked along z, in contact.
inline MofcBatch mofc_batch(std::uint64_t batch, std::uint64_t first, std::uint64_t last,
                            std::uint64_t device_session = kDeviceSession,
                            std::uint64_t session = kMofcSession) {
  MofcBatch made;
  made.header = {.session_id = session, .sequence = batch, .sampled_at = time_of_tick(last)};
  made.counters.ticks = last + 1;
  for (std::uint64_t n = first; n <= last; ++n) {
    MofcTick tick;
    tick.device_session_id = device_session;
    tick.device_sequence = n;
    tick.device_sampled_at = time_of_tick(n);
    tick.requested_force_on_hand_newton = {0, 0, 2};
    tick.commanded_force_on_hand_newton = {0, 0, 1};
    tick.state = MofcState::kContact;
    tick.is_in_contact = true;
    made.records.push_back(tick);
  }
  return made;
}

inline PhysicsBatch physics_batch(std::uint64_t batch, std::uint64_t first, std::uint64_t last,
                                  std::uint64_t session = kPhysicsSession) {
  PhysicsBatch made;
  made.header = {.session_id = session, .sequence = batch, .sampled_at = time_of_tick(last)};
  made.counters.loop.ticks = last + 1;
  for (std::uint64_t n = first; n <= last; ++n) {
    PhysicsTick tick;
    tick.sequence = n;
    tick.stepped_at = time_of_tick(n);
    tick.compute_time = std::chrono::microseconds(3);
    made.records.push_back(tick);
  }
  return made;
}

}  // namespace palpate::viewer
