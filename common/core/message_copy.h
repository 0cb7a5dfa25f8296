// message_copy.h — copies of messages with long lists: only the entries in use are copied. A
// DeviceState has room for 64 applied forces and uses one or two.
#pragma once

#include <algorithm>
#include <array>

#include "common/core/messages.h"

namespace palpate {

/// Copies the message. Entries of its lists beyond their counts keep what they were.
template <class T>
void copy_message(const T& from, T& to) noexcept {
  to = from;
}

namespace message_copy {

template <class T, std::size_t kMost>
void copy_used(const std::array<T, kMost>& from, std::uint32_t count, std::array<T, kMost>& to) {
  std::copy_n(from.begin(), std::min<std::size_t>(count, kMost), to.begin());
}

}  // namespace message_copy

inline void copy_message(const DeviceState& from, DeviceState& to) noexcept {
  to.header = from.header;
  to.hand_position_m = from.hand_position_m;
  to.tool_position_world_m = from.tool_position_world_m;
  to.tool_orientation_world = from.tool_orientation_world;
  to.buttons = from.buttons;
  to.is_clutched = from.is_clutched;
  message_copy::copy_used(from.applied, from.applied_count, to.applied);
  to.applied_count = from.applied_count;
  to.acting_force_on_hand_newton = from.acting_force_on_hand_newton;
  to.acting_until = from.acting_until;
}

inline void copy_message(const SurfaceNews& from, SurfaceNews& to) noexcept {
  to.store_id = from.store_id;
  to.number = from.number;
  to.has_description = from.has_description;
  if (from.has_description) to.description = from.description;
  message_copy::copy_used(from.tiles, from.tile_count, to.tiles);
  to.tile_count = from.tile_count;
  message_copy::copy_used(from.coverages, from.coverage_count, to.coverages);
  to.coverage_count = from.coverage_count;
  message_copy::copy_used(from.pending, from.pending_count, to.pending);
  to.pending_count = from.pending_count;
}

inline void copy_message(const Interaction& from, Interaction& to) noexcept {
  to.header = from.header;
  to.device_session_id = from.device_session_id;
  to.device_sequence = from.device_sequence;
  to.device_sampled_at = from.device_sampled_at;
  to.tool_position_world_m = from.tool_position_world_m;
  to.tool_orientation_world = from.tool_orientation_world;
  to.force_on_tool_newton = from.force_on_tool_newton;
  to.stored_energy_joule = from.stored_energy_joule;
  message_copy::copy_used(from.contacts, from.listed_count, to.contacts);
  to.listed_count = from.listed_count;
  to.contact_count = from.contact_count;
  copy_message(from.surface, to.surface);
}

}  // namespace palpate
