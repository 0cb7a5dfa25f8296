// SPDX-License-Identifier: Apache-2.0
// emulated_device.h — what stands behind every emulator: the simulated device with its hand, and
// faults of the wire on request.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "common/core/clock.h"
#include "device_node/emulators/hardware.h"

namespace palpate::device {

/// What goes wrong on the wire, while it does.
enum class WireFault : std::uint8_t {
  kNone,
  kUnplugged,  ///< the connection breaks, and none is accepted
  kSilent,     ///< no answer
  kDelayed,    ///< each answer comes 5 ms late
  kGarbage,    ///< answers are no messages of the protocol
  kShort,      ///< answers end in the middle
  kWrongId,    ///< answers are those of another device
  kStuck,      ///< the encoders stand still
  kEcho,       ///< wrong echoes while firmware is loaded
  // beside those above, which are one at a time
  kNoWatchdog,     ///< the motors end no force by themselves, not even when the connection ends
  kNoSupply,       ///< the motors have no supply and make no force; a service says so
  kUncalibrated,   ///< a service says that the device has lost its calibration
  kPowerCycle,     ///< as it begins: the connection breaks, and the counters begin at 0 where it is
  kEncoderZero,    ///< as it begins: the counters begin at 0 where it is, without a word
  kSetUpAnywhere,  ///< nobody holds the handle at its home as the board is set up
  kDoubled,        ///< each answer comes twice
  kGripGone,       ///< no grip in the answers
  kGripOff,        ///< the grip is not connected; its last state is repeated
  kGripFrozen,     ///< the last state of the grip is repeated
  kWatchdog20,     ///< the motors end a force 20 ms after the last message
  kWatchdog100,
  kWatchdog500,
  kLate,      ///< positions are up to 2 ms old, forces begin up to 2 ms late
  kOneTick,   ///< a force ends by itself after 0.5 ms
  kTurning,   ///< currents are held while the arm turns, and with them not the force
  kReversed,  ///< the motors push the other way
  kStrong,    ///< the motors push twice as hard
  kWeight,    ///< nothing compensates gravity: the arm's weight of 0.5 N pulls downwards
  kDropped,   ///< one answer in 20 is lost
  kPartial,   ///< each answer comes in two transfers, the second one later
  kMerged,    ///< each answer comes with the one before it, in one transfer
  kUnlisted,  ///< the service does not list the device any more
  // of one servo on a bus: the last but one
  kServoGone,      ///< its plug is out: no answer, no torque
  kServoReboot,    ///< as it begins: it has no torque, no watchdog, and the turn it was in
  kServoOverload,  ///< as it begins: it protects itself, and says so
  kBitErrors,      ///< one answer in 50 has a wrong bit
  kBusOff,         ///< the controller of a CAN bus has left it after errors
};

struct PlannedFault {
  WireFault kind = WireFault::kNone;
  double from_s = 0.0;  ///< since the emulator's start
  double length_s = 0.0;
};

[[nodiscard]] inline bool is_under_way(const PlannedFault& fault, double now_s) noexcept {
  return now_s >= fault.from_s && now_s < fault.from_s + fault.length_s;
}

/// What the motors did in a planned fault.
struct FaultOutcome {
  PlannedFault fault;
  double force_newton = 0.0;  ///< |F| as it began
  Duration pushed_for{};      ///< from its begin until the last force within it ended
  bool has_begun = false;     ///< EmulatedDevice::takes_begin_of() was told
};

/// The kinds of parse_fault(): "unplugged" …
[[nodiscard]] std::vector<std::string> fault_kinds();

/// "unplugged@2:500": from 2 s on, for 500 ms.
/// @param driver  in sessions
/// @throws SetupError  another form, the text lists the kinds; or no fault of this driver's device
[[nodiscard]] PlannedFault parse_fault(const std::string& text, const std::string& driver);

/// Pairs (a, b): while both are under way only b has an effect.
[[nodiscard]] std::vector<std::pair<std::size_t, std::size_t>> hidden_faults(
    const std::vector<PlannedFault>& faults);

/// One thread, except where another is named.
class EmulatedDevice {
 public:
  /// @param watchdog  after which the motors end their force if no message comes
  EmulatedDevice(const SimulatedDeviceConfig& device, const HandConfig& hand, const Clock& clock,
                 std::uint64_t seed, Duration watchdog, const std::vector<PlannedFault>& faults);

  [[nodiscard]] WireFault fault() const noexcept;
  /// Whether this fault is under way, whatever else is.
  [[nodiscard]] bool has(WireFault kind) const noexcept;

  /// The force that a message asks for, from now on.
  /// @return  the reading at the switch; frozen while the encoders stand still
  DeviceSample switch_to(const Vector3& force_on_hand_newton) noexcept;
  /// The same with currents that are held: a force for each position.
  DeviceSample switch_to(Hardware::HeldForce force_on_hand_newton) noexcept;
  /// The transfers in which the bytes of an answer reach the client: one, unless a fault says
  /// otherwise.
  [[nodiscard]] std::vector<std::vector<std::byte>> transfers_of(std::span<const std::byte> answer);
  /// A reading; the force goes on within the watchdog's time.
  DeviceSample read() noexcept;
  /// The client is gone: the force ends, unless the motors have no watchdog.
  void let_go() noexcept;

  [[nodiscard]] Vector3 force_newton() const noexcept { return device_.force_newton(); }
  [[nodiscard]] Vector3 velocity_m_per_s() const noexcept {
    return device_.true_state().hand_velocity_m_per_s;
  }
  [[nodiscard]] TrueState true_state() const noexcept { return device_.true_state(); }
  /// Least energy that the hand has put in so far [J]; below zero it has received energy.
  [[nodiscard]] double least_energy_joule() const noexcept { return least_energy_joule_; }
  [[nodiscard]] std::uint64_t messages() const noexcept { return messages_; }
  /// Once for each fault of that kind that has begun.
  [[nodiscard]] bool takes_begin_of(WireFault kind) noexcept;
  /// Adds a fault. Any thread.
  void plan(const PlannedFault& fault);
  /// Since the start [s]: what PlannedFault counts from. Any thread.
  [[nodiscard]] double now_s() const noexcept { return to_seconds(clock_.now() - start_); }
  /// |F| that acts now [N]. Any thread.
  [[nodiscard]] double acting_newton() const noexcept;
  /// Of every planned fault, as of now. Any thread.
  [[nodiscard]] std::vector<FaultOutcome> outcomes();

 private:
  DeviceSample seen(const DeviceSample& sample) noexcept;
  void note_switch(TimePoint at, double force_newton) noexcept;
  /// After which the motors end a force now.
  [[nodiscard]] Duration watchdog() const noexcept;
  /// What the faults under way make of the hardware.
  void set_vices() noexcept;
  DeviceSample switched(const DeviceSample& sample) noexcept;
  /// Another force follows now; the lock is held.
  void note_force_until(TimePoint now) noexcept;

  const Clock& clock_;
  TimePoint start_;
  Hardware device_;
  Duration watchdog_;
  mutable std::mutex faults_;  // over the next four
  std::vector<FaultOutcome> outcomes_;
  double force_newton_ = 0.0;  // acting in [force_since_, force_end_)
  TimePoint force_since_{};
  TimePoint force_end_{};
  DeviceSample last_;
  std::vector<std::byte> last_answer_;
  std::uint64_t answers_ = 0;
  std::atomic<double> least_energy_joule_ = 0.0;
  std::atomic<std::uint64_t> messages_ = 0;
};

}  // namespace palpate::device
