// SPDX-License-Identifier: Apache-2.0
// adversary_config.h — what lockstep runs simulate to attack the clamp: a physics that lies, a
// clamp that lies, a scheduler that is late. proto/palpate/v1/session.proto, message Adversary.
#pragma once

#include <cstdint>

namespace palpate {

/// What physics sends: the force, and the stored energy.
enum class HostilePhysics : std::uint8_t {
  kHonest,
  kSquareWave,    ///< ± more than the peak, in random directions, turning every 1 … 50 ms
  kPushAlong,     ///< more than the peak along the motion last measured: worst sign of velocity
  kNotANumber,    ///< every third answer is NaN, the others push along
  kActiveTissue,  ///< a contact model that pushes along any motion, and the more the further
  kNewSessions,   ///< honest, but killed and restarted: a new session every 0.9 s
  kEverything,    ///< any of the above force laws, changing at random times
  /// Honest, but points and states of elastic bodies are scaled, turned and exchanged at random.
  kLyingCompliance = 8,
  /// Honest, but what jaws hold is scaled, pushed, moved and exchanged at random, and held where
  /// they hold nothing.
  kLyingGrip = 9,
};

/// What the clamp answers to the device.
enum class LyingClamp : std::uint8_t {
  kTruthful,
  kFullForce,    ///< more than the peak along the motion last measured, for an hour
  kWrongLease,   ///< the honest force, for an hour
  kAhead,        ///< full force, as the answer to a state that was never sent, after the honest one
  kReplay,       ///< force and lease of 100 ms ago
  kNotANumber,   ///< every third answer is NaN, the others full force
  kDrift,        ///< as if its ledger drifted: 1 N more force and 1 ms more lease every second
  kMostlyRight,  ///< honest, but for 0.2 s of every 0.5 s: then full force
  kRounding,     ///< all that the monitor covers along the motion last measured, with its rounding
  kLedger,       ///< honest, but says that it counts 1 J more than it does
};

struct AdversaryConfig {
  HostilePhysics physics = HostilePhysics::kHonest;
  LyingClamp clamp = LyingClamp::kTruthful;
  double tick_jitter_ratio = 0.0;  ///< each tick begins up to this share of a period late
  double late_tick_ratio = 0.0;    ///< of the ticks: 1 … 5 periods late instead

  [[nodiscard]] bool is_any() const {
    return physics != HostilePhysics::kHonest || clamp != LyingClamp::kTruthful ||
           tick_jitter_ratio > 0.0 || late_tick_ratio > 0.0;
  }
};

}  // namespace palpate
