// SPDX-License-Identifier: Apache-2.0
// haply_wire.h — the messages of Haply's Inverse Service (WebSocket, JSON; service 3.1 to 3.5) as
// far as the driver needs them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "common/core/vector.h"

namespace palpate::device {

/// How a force is written: services from 3.5 on read "vector", clients of 3.1 send "values".
enum class HaplyDialect : std::uint8_t { kVector, kValues };

/// What one message of the service says of one Inverse3 and of one grip. Frame of the service.
struct HaplyState {
  std::optional<Vector3> cursor_position_m;
  std::optional<Vector3> cursor_velocity_m_per_s;
  std::optional<Vector3> cursor_force_newton;  ///< what the service applies now
  std::optional<Quaternion> orientation;       ///< of the grip
  std::optional<std::uint32_t> buttons;        ///< a: bit 0, b: bit 1, c: bit 2; wired: bit 0
  std::optional<bool> is_calibrated;
  std::optional<bool> is_powered;
  std::optional<bool> is_ready;
  bool is_gone = false;         ///< a message like any other, but the device is not in its list
  bool is_transformed = false;  ///< by a workspace transform: counted work would be wrong
  std::optional<bool> is_grip_connected;
};

/// What the first message, a full snapshot, says besides.
struct HaplySnapshot {
  std::string device_id;  ///< of the Inverse3
  std::string grip_id;    ///< "" without a grip
  bool is_wireless_grip = false;
  std::optional<bool> is_calibrated;
  std::optional<bool> is_powered;
  std::optional<bool> is_ready;
  /// Gain of the service's force gate and damping: they change what is felt. 0: off.
  double force_gate_gain = 0.0;
  double damping = 0.0;
  bool compensates_gravity = false;
};

/// Reads a state update. No allocation.
/// @param device_id  entries of other devices are passed over
/// @param grip_id    likewise; "": no grip is read
/// @return  false for a text that is not JSON or whose members have other types, and for an update
///          without the device or without its position
[[nodiscard]] bool read_haply_state(std::string_view text, std::string_view device_id,
                                    std::string_view grip_id, HaplyState& state) noexcept;

/// Reads the first message.
/// @param device_id  "" takes the only Inverse3
/// @param grip_id    "" takes the only grip, if there is one
/// @throws std::runtime_error  not JSON, no such device, several without an id to choose one, or a
///                             device with a workspace transform, a scale, or (dialect kValues) a
///                             mount that is turned; the text says what there is
[[nodiscard]] HaplySnapshot read_haply_snapshot(const std::string& text,
                                                const std::string& device_id,
                                                const std::string& grip_id, HaplyDialect dialect);

/// The first message to the service: names this client.
[[nodiscard]] std::string haply_hello(std::string_view profile);

/// A force for the next tick of the service, which answers with one state. No allocation.
/// @param out  at least kHaplyCommandBytes
/// @return  the bytes written
inline constexpr std::size_t kHaplyCommandBytes = 512;
[[nodiscard]] std::size_t write_haply_force(std::string_view device_id, HaplyDialect dialect,
                                            const Vector3& force_newton,
                                            std::span<char> out) noexcept;

}  // namespace palpate::device
