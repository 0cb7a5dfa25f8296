// device.h — what a haptic device is to device_node: a position that can be read and motors that
// can be written. Every driver passes tests/support/device_conformance.h. Frame D throughout; a
// driver converts its own axes and units once, here.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "common/core/time.h"
#include "common/core/vector.h"

namespace palpate::device {

struct DeviceSpecification {
  std::string model_name;
  Vector3 workspace_half_extent_m = Vector3::Zero();  ///< D, box around the origin
  double peak_force_newton = 0.0;                     ///< |F| for moments
  double continuous_force_newton = 0.0;               ///< |F| for ever
  double position_resolution_m = 0.0;                 ///< per axis; 0: exact
  std::uint32_t button_count = 0;                     ///< bits used of DeviceSample::buttons
  bool is_simulated = false;
  /// False: the motors go on pushing when this process stops. The passivity guarantee is then not
  /// available and is reported so.
  bool has_motor_watchdog = false;
};

/// One reading.
struct DeviceSample {
  Vector3 hand_position_m = Vector3::Zero();        ///< D
  Quaternion orientation = Quaternion::Identity();  ///< D from T, unit
  std::uint32_t buttons = 0;                        ///< bit i set while button i is held
  TimePoint sampled_at{};                           ///< this host's clock
};

/// What only a simulation knows. The controller never sees it.
struct TrueState {
  Vector3 hand_position_m = Vector3::Zero();        ///< D, before the encoder
  Vector3 hand_velocity_m_per_s = Vector3::Zero();  ///< D
  double energy_joule = 0.0;                        ///< E(t) of docs/theory.md §1
  double minimum_energy_joule = 0.0;                ///< over all inner steps so far, ≤ 0
};

/// One thread. read(), apply() and release() do not allocate, lock, log or throw; they may block
/// only as long as the hardware's own transfer takes. A destructor releases the motors.
class HapticDevice {
 public:
  virtual ~HapticDevice() = default;

  [[nodiscard]] virtual const DeviceSpecification& specification() const noexcept = 0;

  /// Takes one reading. False: none could be taken; `sample` is then meaningless.
  [[nodiscard]] virtual bool read(DeviceSample& sample) noexcept = 0;

  /// Lets `force_on_hand_newton` (D) act from now on, for `lease` at most: when that time passes
  /// without another apply() the amplifier goes to zero by itself, whatever this process does.
  /// A lease ≤ 0 is no force. |force| above the device's peak is cut, direction kept.
  ///
  /// `at_switch` is the reading latched as the force changes, so the energy of both forces can be
  /// told apart exactly. False, motors limp: a non-finite force, or the device failed.
  [[nodiscard]] virtual bool apply(const Vector3& force_on_hand_newton, Duration lease,
                                   DeviceSample& at_switch) noexcept = 0;

  /// Limp, at once. A later apply() acts again.
  virtual void release() noexcept = 0;

  /// As of the last reading or switch; nothing on real hardware.
  [[nodiscard]] virtual std::optional<TrueState> true_state() const noexcept {
    return std::nullopt;
  }
};

}  // namespace palpate::device
