// SPDX-License-Identifier: Apache-2.0
// dynamixel_models.h — the servos that are known, and the entries of their control table that a
// leader arm needs. From ROBOTIS' e-manual of each model; none was measured.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace palpate::device {

/// Addresses of the control table, the same for all models below.
namespace dynamixel {
inline constexpr unsigned kReturnDelay = 9;         // 1, in 2 µs
inline constexpr unsigned kDriveMode = 10;          // 1
inline constexpr unsigned kOperatingMode = 11;      // 1
inline constexpr unsigned kCurrentLimit = 38;       // 2
inline constexpr unsigned kTorqueEnable = 64;       // 1
inline constexpr unsigned kStatusReturnLevel = 68;  // 1: 2 for an answer to every instruction
inline constexpr unsigned kHardwareError = 70;      // 1
inline constexpr unsigned kBusWatchdog = 98;        // 1, in 20 ms; 255 after it has fired
inline constexpr unsigned kGoalCurrent = 102;       // 2
inline constexpr unsigned kRealtimeTick = 120;      // 2, in ms, 0 … 32767
inline constexpr unsigned kPresentCurrent = 126;    // 2
inline constexpr unsigned kPresentVelocity = 128;   // 4, in 0.229 turns a minute
inline constexpr unsigned kPresentPosition = 132;   // 4, in 1/4096 of a turn
inline constexpr unsigned kIndirectAddress = 168;   // 2 each

inline constexpr unsigned kCurrentControl = 0;  ///< as operating mode
inline constexpr unsigned kWatchdogFired = 0xFF;
inline constexpr double kWatchdogUnitS = 0.020;
inline constexpr double kStepsPerTurn = 4096.0;
inline constexpr double kTurnsPerMinute = 0.229;  ///< of one unit of velocity
}  // namespace dynamixel

struct DynamixelModel {
  std::uint16_t number;
  const char* name;
  double ampere_per_unit;  ///< of currents; 0: it controls no current
  /// The manual's stall torque over its stall current, where the motor has its recommended voltage.
  double stall_newton_m_per_ampere;
  std::uint8_t watchdog_since;   ///< firmware with a Bus Watchdog
  std::uint8_t fast_read_since;  ///< firmware with Fast Sync Read
  std::uint16_t indirect_data;   ///< address of the first byte
  /// The servo measures the current of its supply, not of its motor: what it makes of a goal is not
  /// proportional to the torque.
  bool measures_supply_current;
};

inline constexpr std::array<DynamixelModel, 12> kDynamixelModels{{
    {1020, "XM430-W350", 2.69e-3, 4.1 / 2.3, 38, 45, 224, false},
    {1030, "XM430-W210", 2.69e-3, 3.0 / 2.3, 38, 45, 224, false},
    {1060, "XL430-W250", 0.0, 0.0, 38, 45, 224, false},
    {1070, "XC430-W150", 0.0, 0.0, 38, 45, 224, false},
    {1120, "XM540-W270", 2.69e-3, 10.6 / 4.4, 38, 45, 224, false},
    {1130, "XM540-W150", 2.69e-3, 7.3 / 4.4, 38, 45, 224, false},
    {1190, "XL330-M077", 1e-3, 0.215 / 1.47, 1, 46, 208, false},
    {1200, "XL330-M288", 1e-3, 0.52 / 1.47, 1, 46, 208, false},
    {1210, "XC330-T181", 1e-3, 0.76 / 0.80, 1, 46, 208, true},
    {1220, "XC330-T288", 1e-3, 0.92 / 0.80, 1, 46, 208, true},
    {1230, "XC330-M181", 1e-3, 0.60 / 1.80, 1, 46, 208, true},
    {1240, "XC330-M288", 1e-3, 0.93 / 1.80, 1, 46, 208, true},
}};

/// Null: unknown.
[[nodiscard]] constexpr const DynamixelModel* dynamixel_model(unsigned number) {
  for (const DynamixelModel& model : kDynamixelModels) {
    if (model.number == number) return &model;
  }
  return nullptr;
}

/// What is read of every servo in each cycle: entries of the control table that Indirect Data makes
/// one block of.
struct DynamixelBlock {
  std::uint8_t torque_enable = 0;
  std::uint8_t hardware_error = 0;
  std::uint8_t bus_watchdog = 0;
  std::int16_t goal_current = 0;
  std::uint16_t tick_ms = 0;
  std::int16_t current = 0;
  std::int32_t velocity = 0;
  std::int32_t position = 0;
};
inline constexpr std::array<std::uint8_t, 17> kDynamixelBlock{
    64, 70, 98, 102, 103, 120, 121, 126, 127, 128, 129, 130, 131, 132, 133, 134, 135};

}  // namespace palpate::device
