// SPDX-License-Identifier: Apache-2.0
// motor_check.h — do the motors push the way they are told, as hard as they are told, and do the
// encoders see it? A small push along each axis that has motors, before full force.
#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/core/time.h"
#include "common/core/vector.h"
#include "common/session/device_profile.h"

namespace palpate::device {

struct MotorCheckPlan {
  double rate_hz = 1000.0;                   ///< of the readings
  DeviceProfile profile;                     ///< friction and resolution that the session claims
  Matrix3 force_axes = Matrix3::Identity();  ///< DeviceSpecification::force_axes
  double limit_newton = 0.0;                 ///< no push is stronger, whatever f_co is
  Duration latency{};                        ///< of positions and forces together, at most
};

enum class MotorVerdict : std::uint8_t {
  kChecking = 0,
  kGood = 1,
  kWrongWay = 2,   ///< reversed, or along another axis
  kTooStrong = 3,  ///< at least 1.5 times as strong as told, by the friction of the profile; or the
                   ///< handle went further than kFarthest_m in half a wave
  kFrozen = 4,     ///< the readings repeat exactly
  kNotSeen = 5,    ///< the readings change, but not with the push
  kInterrupted = 6,  ///< pauses of more than 5 ms again and again
};

/// A force of f_co + 0.3 N along each axis in turn, at 16 Hz: it moves a free arm of 30 g by
/// ±1.3 mm, and a held one less. Four cycles at a time, position and force are fitted by a cubic
/// and a wave, so that slow motion of the hand does not count: H = X/F along the axis and across
/// it. After four such blocks, and until 20, H is judged if its mean is beyond five times its
/// standard error.
///
/// Sign: every load that stores or dissipates energy follows the force by a lag of 0 (a spring)
/// to 180° (a mass). H must be within 80° of the lag of 110°; within 80° of the opposite it is
/// reversed. Axis: motion across the axis is at most twice that along it. Gain: of the work of the
/// force at least the friction of the profile is dissipated, so the motors are at least
///
///   g ≥ (4 f_co A ω/2π + f_d ω² A²/2) / (−ω |F|² Im H/2) ,   A = |H F|
///
/// times as strong as told, where H is turned by the part of the latency that makes this bound
/// least. That is close to g if nobody holds the arm, less if somebody does, and
/// known only where the handle moves by no more than the push moves it.
///
/// A push ends with the reading that shows that the handle went more than 5 mm along an axis of D
/// in half a wave.
/// In ticks that were skipped the last push went on, and is taken for that; after a pause of more
/// than 4 ms and a period and a half the axis begins anew, up to 100 times.
///
/// One thread. No allocation after construction, no throw.
class MotorCheck {
 public:
  explicit MotorCheck(const MotorCheckPlan& plan);

  /// Anew, from the first axis.
  void begin() noexcept;
  /// @param at  of the reading
  /// @return    the force from this reading to the next [N], D
  [[nodiscard]] Vector3 next(TimePoint at, const Vector3& position_m) noexcept;
  /// What the motors make of it; follows each next().
  void applied(const Vector3& force_newton) noexcept;

  [[nodiscard]] MotorVerdict verdict() const noexcept { return verdict_; }
  /// Largest of the axes; 0: not known.
  [[nodiscard]] double gain_at_least() const noexcept { return gain_; }
  /// The axis of the verdict, D.
  [[nodiscard]] const Vector3& axis() const noexcept { return axes_[axis_]; }
  [[nodiscard]] std::size_t axis_count() const noexcept { return axis_count_; }

  static constexpr double kBeyondFriction_newton = 0.3;
  static constexpr double kFarthest_m = 5e-3;

 private:
  using Complex = std::complex<double>;
  using Complex3 = Eigen::Vector3cd;

  void begin_axis() noexcept;
  void begin_block() noexcept;
  void take(const Vector3& position_m) noexcept;
  void fill_in(std::int64_t periods, const Vector3& position_m) noexcept;
  void finish_block() noexcept;
  [[nodiscard]] bool has_decided() noexcept;
  [[nodiscard]] double gain_along(const Complex& along) const noexcept;

  DeviceProfile profile_;
  double rate_hz_;
  std::size_t block_;  // readings of four cycles
  double omega_rad_per_s_;
  double lag_rad_;             // of readings and forces that are late
  std::vector<Complex> wave_;  // Σ of these times readings: the wave's amplitude
  std::array<Vector3, 3> axes_{};
  std::array<double, 3> push_newton_{};
  std::size_t axis_count_ = 0;

  MotorVerdict verdict_ = MotorVerdict::kChecking;
  double gain_ = 0.0;
  std::size_t axis_ = 0;
  std::size_t index_ = 0;   // of the next reading, since the axis began
  std::size_t ending_ = 0;  // readings until the push has faded out; 0: it goes on
  TimePoint last_at_{};
  Vector3 last_m_ = Vector3::Zero();
  Vector3 last_applied_newton_ = Vector3::Zero();
  int interruptions_ = 0;
  Vector3 first_m_ = Vector3::Zero();      // of the axis
  bool has_moved_ = false;                 // since then
  std::size_t half_wave_ = 0;              // of the present reading
  Vector3 half_wave_m_ = Vector3::Zero();  // where the last half wave began
  double range_m_ = 0.0;                   // of the widest block, along the axis
  double force_newton_ = 0.0;              // |F| of the last block
  double block_low_m_ = 0.0;
  double block_high_m_ = 0.0;
  Complex3 block_position_ = Complex3::Zero();
  Complex block_requested_;        // force along the axis
  Complex block_applied_;          // what the motors say that they made of it
  double requested_newton_ = 0.0;  // of the last reading
  int blocks_ = 0;
  Complex3 sum_ = Complex3::Zero();    // of H
  Vector3 squares_ = Vector3::Zero();  // of |H|
};

}  // namespace palpate::device
