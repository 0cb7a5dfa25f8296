// SPDX-License-Identifier: Apache-2.0
// leader_bus.h — the motors of one leader arm as LeaderArm needs them, on whatever bus. Angles and
// torques are those of a motor's shaft. Nothing allocates or throws but where it says so.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "common/core/time.h"
#include "device_node/drivers/leader/leader.h"
#include "device_node/drivers/transport/transfer.h"

namespace palpate::device {

/// What a motor said last.
struct MotorState {
  double position_rad = 0.0;
  double velocity_rad_per_s = 0.0;
  double torque_newton_m = 0.0;  ///< that it measures
  bool has_torque = false;       ///< it is switched on
  bool has_command = false;      ///< the last command that was written is the one that it has
};

/// A torque as the wire has it.
struct MotorCommand {
  int units = 0;
  double newton_m = 0.0;  ///< that the motor makes of it
};

/// How something went that is asked of one motor after the other.
struct MotorOutcome {
  Transfer transfer = Transfer::kDone;
  LeaderFault fault = LeaderFault::kNone;
  std::size_t joint = 0;
};

class LeaderBus {
 public:
  virtual ~LeaderBus() = default;

  /// Every motor limp first; then models, modes and limits are checked.
  /// @throws SetupError  what is wrong, of which joint, and the remedy
  virtual void set_up() = 0;
  /// The lease of the motors first, then torque, with none requested.
  [[nodiscard]] virtual MotorOutcome enable() noexcept = 0;
  /// No torque, then off; twice, and no answer is waited for.
  virtual void let_go() noexcept = 0;

  /// The state of every motor.
  [[nodiscard]] virtual Transfer read() noexcept = 0;
  /// @param units  of command(), one a motor
  [[nodiscard]] virtual Transfer write(std::span<const int> units) noexcept = 0;
  /// Of the last read().
  [[nodiscard]] virtual MotorState state(std::size_t joint) const noexcept = 0;
  /// What the last read() says against a motor.
  [[nodiscard]] virtual LeaderFault check(std::size_t joint, bool is_enabled,
                                          TimePoint now) noexcept = 0;
  /// Asks each motor alone.
  /// @return  the first that gives no good answer; fault kNone: all do, or the port is gone
  [[nodiscard]] virtual MotorOutcome find_silent() noexcept = 0;

  /// The nearest torque below, cut off at the limit. @param newton_m  finite
  [[nodiscard]] virtual MotorCommand command(std::size_t joint, double newton_m) const noexcept = 0;
  [[nodiscard]] virtual double largest_newton_m(std::size_t joint) const noexcept = 0;
  /// Twice what an angle may be off by, by its encoder and the wire.
  [[nodiscard]] virtual double step_rad() const noexcept = 0;
  /// From the end of write() until the torques act, with how old an angle may be in a motor.
  [[nodiscard]] virtual double delay_s() const noexcept = 0;
  /// After the last instruction, until each motor has ended its torque by itself.
  [[nodiscard]] virtual double watchdog_s() const noexcept = 0;

  /// Model and firmware, and what there is to say of them. Allocates.
  [[nodiscard]] virtual std::string model_text(std::size_t joint) const = 0;
  /// How torques are scaled, as "0.00035 (as configured)". Allocates.
  [[nodiscard]] virtual std::string scale_text(std::size_t joint) const = 0;
  /// What the motor said of the fault that check() or enable() found; may be empty. Allocates.
  [[nodiscard]] virtual std::string detail_text(LeaderFault fault) const = 0;
};

}  // namespace palpate::device
