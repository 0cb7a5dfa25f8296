// adversity.h — runs of the whole system in lockstep against a hand, a physics, a network and a
// scheduler that try to give the hand energy.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/telemetry/summary.h"
#include "deploy/lockstep/lockstep.h"
#include "tests/support/black_box/black_box.h"

namespace palpate::test {

/// What physics sends: the force, and the stored energy.
enum class Physics : std::uint8_t {
  kHonest,
  kSquareWave,    ///< ± more than the peak, in random directions, turning every 1 … 50 ms
  kPushAlong,     ///< more than the peak along the motion last measured: worst sign of velocity
  kNotANumber,    ///< every third answer is NaN, the others push along
  kActiveTissue,  ///< a contact model that pushes along any motion, and the more the further
  kNewSessions,   ///< honest, but killed and restarted: a new session every 0.9 s
  kEverything,    ///< any of the above force laws, changing at random times
};

/// What the clamp answers to the device.
enum class Clamp : std::uint8_t {
  kHonest,
  kFullForce,    ///< more than the peak along the motion last measured, for an hour
  kWrongLease,   ///< the honest force, for an hour
  kAhead,        ///< full force, as the answer to a state that was never sent, after the honest one
  kReplay,       ///< force and lease of 100 ms ago
  kNotANumber,   ///< every third answer is NaN, the others full force
  kDrift,        ///< as if its ledger drifted: 1 N more force and 1 ms more lease every second
  kMostlyRight,  ///< honest, but for 0.2 s of every 0.5 s: then full force
};

/// One run. The session's `faults` are the network.
struct AdverseRun {
  std::vector<std::string> overrides;  ///< on hostile_session()
  Physics physics = Physics::kHonest;
  Clamp clamp = Clamp::kHonest;
  /// The physics is an engine from elsewhere that tells this much; the contact models are estimated
  /// from it. None: physics_node's own.
  std::optional<Told> told{};
  double tick_jitter = 0.0;      ///< each tick begins up to this share of a period late, 0 … 0.5
  double late_tick_ratio = 0.0;  ///< share of ticks that begin 1 … 5 periods late
  LockstepLinks links = LockstepLinks::kMemory;
  double seconds = 2.0;
};

struct AdverseResult {
  RunStatistics statistics;
  DeviceCounters device;
  MofcCounters mofc;
  double top_speed_m_per_s = 0.0;   ///< true, at the ticks
  double longest_fallback_s = 0.0;  ///< without the force of an answer, after the first one
  double v_max_m_per_s = 0.0;       ///< what the controller assumes of the hand
};

/// The text of a session: a hostile hand with a firm grip, 0.3 m/s at most, at the surface of a
/// stiff and viscous wall; device and physics at 1 kHz.
[[nodiscard]] const char* hostile_session();

/// Same run and seed: same result, to the bit. Throws SetupError on overrides that are refused.
[[nodiscard]] AdverseResult run_adverse(const AdverseRun& run, std::uint64_t seed);

/// A run drawn at random within the assumptions of mode guard: any device, lease, deadline,
/// encoder, workspace, scene, network, scheduler and physics, true friction at or above the
/// profile.
[[nodiscard]] AdverseRun random_adverse_run(std::uint64_t seed);
/// The same, with a physics from elsewhere, of which only forces, or contact points, are known.
[[nodiscard]] AdverseRun random_black_box_run(std::uint64_t seed);
/// The same, with a clamp that lies.
[[nodiscard]] AdverseRun random_lying_run(std::uint64_t seed);

}  // namespace palpate::test
