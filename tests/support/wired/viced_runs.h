// SPDX-License-Identifier: Apache-2.0
// viced_runs.h — a driver and the hardware behind it in memory, on virtual time: cheap runs of the
// tick against hardware with vices, a hostile hand and commands that nobody has clamped, judged by
// the true energy.
#pragma once

#include <cstdint>

#include "common/core/time.h"
#include "device_node/emulators/hardware.h"

namespace palpate::test {

/// One run.
struct VicedRun {
  device::HardwareVices vices;
  /// The arm turns: the force of held currents grows by this share per metre.
  double turning_per_m = 0.0;
  /// Instead of random commands one that stays, on x, from the tenth second on, and a hand that
  /// goes to and fro there, 0.2 s each time, with 0.4 m/s, and is at a turn when a stall of the
  /// longest_stall begins, the only one; 0: random ones.
  double steady_newton = 0.0;
  bool bounds_held_currents = true;  ///< DeviceSpecification::held_force_ratio
  bool tells_turned = true;          ///< DeviceSample::turned_newton
  /// The motors take whole multiples of this force on each axis [N]; 0: any.
  double count_newton = 0.0;
  /// The process is stopped this often per tick, and for at most so long. Beyond the lease of a
  /// command no device without a watchdog keeps the promise; what it costs is booked.
  double stalls_per_tick = 0.0;
  Duration longest_stall{};
  /// The answer to a message is lost this often per message; the message itself every other time.
  /// The device faults, and a person acknowledges it again.
  double drops_per_message = 0.0;
  double acknowledgements_per_tick = 0.05;  ///< in a fault
  /// A release fails this often: the motors go on.
  double failed_releases = 0.0;
  /// The machine sleeps this often per tick, and for at most so long: the clock does not count it.
  double sleeps_per_tick = 0.0;
  Duration longest_sleep{};
  /// mofc_node falls silent this often per tick, for up to 100 ms: the fallback acts.
  double silences_per_tick = 0.0;
  /// Commands have leases of 0.01 to 10 ms and deadlines of their own; else leases without end.
  bool has_short_leases = false;
  /// The session has a dead-man button; the hand holds it most of the time, and the grip that has
  /// it vanishes now and then.
  bool has_dead_man_button = false;
  /// `device { accept: NO_MOTOR_WATCHDOG }`
  bool is_accepted = true;
  double coulomb_newton = 0.1;
  double viscous_newton_s_per_m = 0.1;
  double resolution_m = 55e-6;
  double seconds = 2.0;
};

/// How device_node keeps its books of it.
enum class Books : std::uint8_t {
  kTrue,
  /// As if each force ended with its lease, reading and switch were one instant, held currents a
  /// held force and the motors' whole numbers the force asked for.
  kSimple,
};

struct VicedResult {
  double least_true_joule = 0.0;
  /// Most by which M was above the true energy at a reading; ≤ 0: never above [J].
  double most_unbooked_joule = 0.0;
  double largest_force_newton = 0.0;
  double top_speed_m_per_s = 0.0;
  std::uint64_t ticks = 0;
  std::uint64_t ticks_beyond_friction = 0;  ///< with a force above f_co
  double mean_force_newton = 0.0;           ///< over all ticks
  double most_true_joule = 0.0;             ///< that the hand had put in
  double deepest_fall_joule = 0.0;          ///< of the true energy, below what it had been before
  std::uint64_t fallback_ticks = 0;
  std::uint64_t faults = 0;
};

/// Same run and seed: same result, to the bit.
[[nodiscard]] VicedResult run_with_vices(const VicedRun& run, Books books, std::uint64_t seed);

/// Everything that the promise covers at random, several vices at once: no stall outlives a lease,
/// latencies are those of the session, a release is confirmed at once.
[[nodiscard]] VicedRun random_run_within_the_claim(std::uint64_t seed);
/// The same with stalls of any length up to 60 ms, sleeps up to 2 s, releases that fail.
[[nodiscard]] VicedRun random_run_with_stalls(std::uint64_t seed);

}  // namespace palpate::test
