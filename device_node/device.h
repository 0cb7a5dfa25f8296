// SPDX-License-Identifier: Apache-2.0
// device.h — what a haptic device is to device_node: a position that can be read and motors that
// can be written. Every driver passes device_node/conformance/device_checks.h. Frame D throughout;
// a driver converts its own axes and units once, here.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>

#include "common/core/messages.h"
#include "common/core/time.h"
#include "common/core/vector.h"
#include "common/telemetry/device_telemetry.h"

namespace palpate::device {

struct DeviceSpecification {
  std::string model_name;
  Vector3 workspace_half_extent_m = Vector3::Zero();  ///< D, box around the origin
  double peak_force_newton = 0.0;                     ///< |F| for moments
  double continuous_force_newton = 0.0;               ///< |F| without a time limit
  double position_resolution_m = 0.0;                 ///< per axis; 0: exact
  /// What the motors can give of a force, D: a projection onto the axes that have motors.
  Matrix3 force_axes = Matrix3::Identity();
  std::uint32_t button_count = 0;  ///< bits used of DeviceSample::buttons
  bool is_simulated = false;
  /// What a person does before calibrate(); empty where phase() is never kConnected.
  std::string calibration = {};
  /// False: it says nothing before it is calibrated, so that only its calibration confirms a
  /// release.
  bool answers_uncalibrated = true;
  /// True: the motors end each force with its lease, whatever this process does. False: a force
  /// goes on until the next read(), apply() or release(), however late, and may end by itself at
  /// any time after its lease. Forces above f_co then need an acceptance in the session.
  bool has_motor_watchdog = false;
  /// The watchdog stores the position as it ends a force: take_latched() returns it.
  bool has_position_latch = false;
  /// Motors that hold their currents: how many times the force of one place the same currents are
  /// at another one of the workspace, at most; infinite where no bound is known. 1: the motors hold
  /// the force. Without a watchdog and that acceptance no force exceeds f_co divided
  /// by it.
  double held_force_ratio = 1.0;
  /// Of the same motors: by what share the force of the same currents changes per metre, at most;
  /// 0: the motors hold the force, or no bound is known; infinite: the workspace has a singular
  /// place of the arm, and no force acts.
  double turning_per_m = 0.0;
  /// Of each joint of the wrist that the session uses, the limit of its motor; zero: no wrist.
  Vector3 peak_torque_newton_m = Vector3::Zero();

  /// How far on each axis of D something bounds what held currents do: infinite where none are
  /// held.
  [[nodiscard]] Vector3 bounded_reach_m() const noexcept {
    return held_force_ratio > 1.0 || turning_per_m > 0.0
               ? workspace_half_extent_m
               : Vector3::Constant(std::numeric_limits<double>::infinity());
  }
};

/// One reading of position and buttons.
struct DeviceSample {
  Vector3 hand_position_m = Vector3::Zero();        ///< D
  Quaternion orientation = Quaternion::Identity();  ///< D from T, unit
  std::uint32_t buttons = 0;                        ///< bit i set while button i is held
  TimePoint sampled_at{};                           ///< this host's clock
  /// The force that acts from this reading on [N], D, as the motors realise it, limited and
  /// quantised; the energy is counted with it. Of a switch, and of a reading of a device without a
  /// motor watchdog: there it is zero where the lease was over.
  Vector3 applied_force_newton = Vector3::Zero();
  /// Position and switch may be older than sampled_at by so much: the time of the transfer. 0: they
  /// are one instant.
  Duration skew{};
  /// What the motors did since the last message beyond F·Δx: held currents make another force while
  /// the arm turns [J]. 0: the device holds the force.
  double turning_joule = 0.0;
  /// What the arm's turning has made of the force of held currents since the last message [N], D:
  /// this one changes the force by applied_force_newton − the last one − that. 0: the device holds
  /// the force.
  Vector3 turned_newton = Vector3::Zero();
  /// What the device measured, by motor currents or joint torques, that its motors do now [N], D;
  /// none: it measures nothing.
  std::optional<Vector3> measured_newton = {};
  /// Its joints, with what their motors do from this reading on; none: the device has no wrist.
  std::optional<WristState> wrist = {};

  [[nodiscard]] bool is_finite() const noexcept {
    return hand_position_m.allFinite() && orientation.coeffs().allFinite() &&
           applied_force_newton.allFinite() &&
           (!wrist || (wrist->pose.angle_rad.allFinite() && wrist->pose.axes.allFinite() &&
                       wrist->acting_torque_newton_m.allFinite()));
  }
};

/// Why a transfer failed.
enum class DeviceError : std::uint8_t {
  kNone = 0,
  kFailed = 1,     ///< no more is known
  kTimeout = 2,    ///< no answer in time
  kUnplugged = 3,  ///< the device, or the program that owns it, is gone
  kCorrupt = 4,    ///< the answer breaks the rules of the wire
  kNotReady = 5,   ///< it has no supply or no calibration
};

/// Sees the raw messages of a device's wire as they pass, on the device's thread. Neither blocks
/// nor allocates.
class WireTap {
 public:
  virtual ~WireTap() = default;
  /// @param bytes  of one message; none: an answer that did not come
  virtual void transferred(TimePoint at, bool is_sent,
                           std::span<const std::byte> bytes) noexcept = 0;
};

/// One thread. read(), apply() and release() do not allocate, lock, log or throw; they may block
/// only as long as the hardware's own transfer takes. The destructor releases the motors.
class HapticDevice {
 public:
  virtual ~HapticDevice() = default;

  [[nodiscard]] virtual const DeviceSpecification& specification() const noexcept = 0;

  /// Takes one reading. False: the device gave none; `sample` is then meaningless.
  [[nodiscard]] virtual bool read(DeviceSample& sample) noexcept = 0;

  /// Applies `force_on_hand_newton` (D) from now on, for at most `lease`: if that time passes
  /// without another apply(), the amplifier goes to zero by itself, whatever this process does.
  /// A lease ≤ 0 means no force. |force| is limited to the device's peak; its direction is kept.
  ///
  /// `at_switch` is the reading latched as the force changes; it separates the energies of the two
  /// forces exactly, and names the force that acts now. Returns false, motors limp, for a
  /// non-finite force or if the device failed.
  [[nodiscard]] virtual bool apply(const Vector3& force_on_hand_newton, Duration lease,
                                   DeviceSample& at_switch) noexcept = 0;

  /// What the motors of its wrist are to do per joint [N·m] from the next apply() on, for the same
  /// lease; zero unless given before each. A device without a wrist ignores it.
  virtual void set_wrist_torque(const Vector3& torque_on_hand_newton_m) noexcept {
    static_cast<void>(torque_on_hand_newton_m);
  }

  /// The reading that the watchdog stored when a force ended by itself: once for each such end,
  /// after the read() or apply() that follows it. False: there is none.
  [[nodiscard]] virtual bool take_latched(DeviceSample& at_end) noexcept {
    static_cast<void>(at_end);
    return false;
  }

  /// Motors limp, at once. A later apply() applies a force again. True: the device confirmed that
  /// no force acts. False: the motors may still push; call it again until it is true.
  [[nodiscard]] virtual bool release() noexcept = 0;

  /// kClosed, kConnected or kCalibrated: what the device and its connection are good for. Positions
  /// and forces need kCalibrated.
  [[nodiscard]] virtual DevicePhase phase() const noexcept { return DevicePhase::kCalibrated; }
  /// A person has done what specification().calibration asks for: kCalibrated if the device takes
  /// it. Motors limp, nothing moves. May allocate, and take as long as some messages.
  [[nodiscard]] virtual bool calibrate() noexcept { return phase() == DevicePhase::kCalibrated; }

  /// Why the last read(), apply() or release() returned false.
  [[nodiscard]] virtual DeviceError last_error() const noexcept { return DeviceError::kFailed; }

  /// From now on `tap` sees the raw messages, where the device has a wire; null: nobody does. It
  /// must outlive the device.
  virtual void tap(WireTap* tap) noexcept { static_cast<void>(tap); }

  /// After a fault, before the next reading: opens the device once more if it has to be. Motors
  /// limp. Its calibration counts again only if the device itself says that it has one: see
  /// phase(). May allocate, and take `within` for the connection. False: not yet, the fault stays.
  [[nodiscard]] virtual bool reopen(Duration within) noexcept {
    static_cast<void>(within);
    return true;
  }
};

/// A device that knows what its motors do: by current sensors, or as a simulation.
class MotorForceSource {
 public:
  virtual ~MotorForceSource() = default;
  /// As of the last reading or switch [N], D.
  [[nodiscard]] virtual Vector3 motor_force_on_hand_newton() const noexcept = 0;
};

}  // namespace palpate::device
