// SPDX-License-Identifier: Apache-2.0
// lockstep.h — the whole system in one thread on virtual time: the node classes of the processes,
// bit-identical for a seed, as fast as the machine allows.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>

#include "common/core/clock.h"
#include "common/core/messages.h"
#include "common/core/physics_term.h"
#include "common/session/session.h"
#include "common/telemetry/telemetry.h"
#include "common/telemetry/tick_row.h"
#include "deploy/lockstep/lockstep_links.h"
#include "device_node/device.h"
#include "device_node/journal.h"
#include "physics_node/engine.h"

namespace palpate {

namespace controllers {
class ForceController;
}

/// Session ids of the nodes, fixed so that runs are bit-identical; processes draw random ones.
inline constexpr std::uint64_t kLockstepDevice = 1;
inline constexpr std::uint64_t kLockstepMofc = 2;
inline constexpr std::uint64_t kLockstepPhysics = 3;
inline constexpr std::uint64_t kLockstepStandby = 4;

struct LockstepOptions {
  LockstepLinks links = LockstepLinks::kMemory;
  /// Compute the ideal force and the ideal run (docs/theory.md §7.1); costs about as much time as
  /// the run itself.
  bool has_ideal = false;
  /// The tissue instead of the session's scene, which the ideal keeps. Empty: that scene.
  std::function<std::unique_ptr<physics::Engine>(const Session&)> make_engine{};
  /// The device of a side instead of its simulated one; `seed` is that of its hand. Empty: that
  /// one.
  std::function<std::unique_ptr<device::HapticDevice>(const Side&, const Clock&,
                                                      std::uint64_t seed)>
      make_device{};
  /// The controller of a side, which may look at its device as no real one can. Empty: the one that
  /// the session selects.
  std::function<std::unique_ptr<controllers::ForceController>(const Side&,
                                                              const device::HapticDevice&)>
      make_controller{};
  /// Changes each Interaction as it leaves physics_node, after the session's adversary. Empty:
  /// none.
  std::function<void(Interaction&)> tamper_with_interaction{};
  /// More lateness of the next device tick. Empty: none.
  std::function<Duration()> device_lateness{};
  /// Receives what decides about faults of the first side's device; may be null.
  device::Journal* journal = nullptr;
  /// Called after every device tick of every side; may be empty.
  std::function<void(std::size_t side, const TickRow&, const IdealState&)> on_side_row{};
  // --- with physics.standby
  /// Whether hops 2 and 3 between a side and a physics are cut at present; may be empty.
  std::function<bool(std::size_t side, PhysicsRole, TimePoint now)> is_cut{};
  /// Whether the process of a physics is suspended; may be empty.
  std::function<bool(PhysicsRole, TimePoint now)> is_stopped{};
  /// The clock of the standby's host before that of the others.
  Duration standby_clock_ahead{};
  /// Called with every record of a node of the first side and the first physics; may be empty.
  std::function<void(const DeviceTick&)> on_device_tick{};
  std::function<void(const MofcTick&)> on_mofc_tick{};
  std::function<void(const PhysicsTick&)> on_physics_tick{};
};

/// All sides of a session, its physics and their links. Events of one instant run in the order
/// device tick, mofc's answer, physics step.
class Lockstep {
 public:
  using RowConsumer = std::function<void(const TickRow&, const IdealState&)>;

  /// @param on_row  called after every device tick of the first side; may be empty
  Lockstep(const Session& session, const LockstepOptions& options, RowConsumer on_row);
  ~Lockstep();
  Lockstep(const Lockstep&) = delete;
  Lockstep& operator=(const Lockstep&) = delete;

  /// Runs every event before `end`, counted from the start; a later call with a later `end` goes
  /// on.
  void run_until(Duration end);

  [[nodiscard]] DeviceCounters device_counters(std::size_t side = 0) const;
  [[nodiscard]] MofcCounters mofc_counters(std::size_t side = 0) const;
  [[nodiscard]] PhysicsCounters physics_counters(std::size_t side = 0) const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate
