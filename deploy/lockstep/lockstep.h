// lockstep.h — the whole system in one thread on virtual time: the same node classes as in the
// processes, deterministic to the bit for a seed, as fast as the machine can.
#pragma once

#include <functional>
#include <memory>

#include "common/core/messages.h"
#include "common/session/session.h"
#include "common/telemetry/telemetry.h"
#include "common/telemetry/tick_row.h"

namespace palpate {

/// Session ids of the nodes. Fixed, so that a run repeats to the bit; real processes draw random
/// ones.
inline constexpr std::uint64_t kLockstepDevice = 1;
inline constexpr std::uint64_t kLockstepMofc = 2;
inline constexpr std::uint64_t kLockstepPhysics = 3;

/// What carries the messages between the nodes.
enum class LockstepLinks : std::uint8_t {
  kMemory,  ///< structs in a queue
  kInproc,  ///< encoded, through ZeroMQ sockets, decoded: the same bits come out
};

struct LockstepOptions {
  LockstepLinks links = LockstepLinks::kMemory;
  /// Compute the ideal force and the ideal run (docs/theory.md §7.1). Costs about as much as the run itself.
  bool has_ideal = false;
  /// A hostile physics: changes each Interaction as it leaves physics_node. Empty: honest.
  std::function<void(Interaction&)> tamper_with_interaction{};
  /// How long after its appointment the next device tick begins. Empty: on time.
  std::function<Duration()> device_lateness{};
  /// Every record, as it is made. Empty: nobody asks.
  std::function<void(const DeviceTick&)> on_device_tick{};
  std::function<void(const MofcTick&)> on_mofc_tick{};
  std::function<void(const PhysicsTick&)> on_physics_tick{};
};

/// Device, mofc and physics of a session, and their links. Order of events at one instant: device
/// tick, mofc's answer, physics step.
class Lockstep {
 public:
  using RowConsumer = std::function<void(const TickRow&, const IdealState&)>;

  /// @param on_row  called after every device tick; may be empty
  Lockstep(const Session& session, const LockstepOptions& options, RowConsumer on_row);
  ~Lockstep();
  Lockstep(const Lockstep&) = delete;
  Lockstep& operator=(const Lockstep&) = delete;

  /// Runs every event due before `end`, counted from the start; may be called again to go on.
  void run_until(Duration end);

  [[nodiscard]] DeviceCounters device_counters() const;
  [[nodiscard]] MofcCounters mofc_counters() const;
  [[nodiscard]] PhysicsCounters physics_counters() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate
