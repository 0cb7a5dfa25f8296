// SPDX-License-Identifier: Apache-2.0
// exchange_codec.cpp — hops 1 and 4: DeviceState and ForceCommand.
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "common/link/codec/wire_format.h"
#include "palpate/v1/exchange.pb.h"

namespace palpate {

using namespace wire;

namespace {

constexpr double kMaxForceOnHandNewton = 1e3;
constexpr double kMaxTorqueOnHandNewtonM = 100.0;
constexpr double kMaxAngleRad = 1e3;
constexpr std::int64_t kMaxLeaseNs = 1'000'000'000;

/// No further than `limit` apart; neither may overflow.
bool is_within(std::int64_t from_ns, std::int64_t until_ns, std::int64_t limit_ns) {
  return until_ns >= from_ns && until_ns - from_ns <= limit_ns;
}

void put_wrist(const WristState& wrist, v1::Wrist& to) {
  put(wrist.pose.angle_rad, *to.mutable_angle_rad());
  put(wrist.pose.axes.col(0), *to.mutable_first_axis());
  put(wrist.pose.axes.col(1), *to.mutable_second_axis());
  put(wrist.pose.axes.col(2), *to.mutable_third_axis());
  put(wrist.acting_torque_newton_m, *to.mutable_acting_torque_on_hand_newton_m());
}

void check_wrist(const v1::DeviceState& state, Verdict& verdict) {
  for (const v1::AppliedForce& applied : state.applied()) {
    verdict.require(state.has_wrist() || !(applied.has_wrist_torque_on_hand_newton_m() ||
                                           applied.has_wrist_angle_at_end_rad()));
    if (applied.has_wrist_torque_on_hand_newton_m()) {
      verdict.vector(true, applied.wrist_torque_on_hand_newton_m(), kMaxTorqueOnHandNewtonM);
    }
    if (state.has_wrist() && applied.has_hand_position_at_end_m()) {
      verdict.vector(applied.has_wrist_angle_at_end_rad(), applied.wrist_angle_at_end_rad(),
                     kMaxAngleRad);
    }
  }
  if (!state.has_wrist()) return;
  const v1::Wrist& wrist = state.wrist();
  verdict.vector(wrist.has_angle_rad(), wrist.angle_rad(), kMaxAngleRad);
  verdict.unit_vector(wrist.has_first_axis(), wrist.first_axis());
  verdict.unit_vector(wrist.has_second_axis(), wrist.second_axis());
  verdict.unit_vector(wrist.has_third_axis(), wrist.third_axis());
  verdict.vector(wrist.has_acting_torque_on_hand_newton_m(), wrist.acting_torque_on_hand_newton_m(),
                 kMaxTorqueOnHandNewtonM);
}

std::optional<WristState> wrist_of(const v1::DeviceState& state) {
  if (!state.has_wrist()) return std::nullopt;
  const v1::Wrist& wire = state.wrist();
  WristState wrist;
  wrist.pose.angle_rad = vector(wire.angle_rad());
  wrist.pose.axes.col(0) = unit(vector(wire.first_axis()));
  wrist.pose.axes.col(1) = unit(vector(wire.second_axis()));
  wrist.pose.axes.col(2) = unit(vector(wire.third_axis()));
  wrist.acting_torque_newton_m = vector(wire.acting_torque_on_hand_newton_m());
  return wrist;
}

}  // namespace

template <>
struct WireFormat<DeviceState> {
  using Message = v1::DeviceState;

  static void fill(const DeviceState& m, v1::DeviceState& wire) {
    put(m.hand_position_m, *wire.mutable_hand_position_m());
    put(m.tool_position_world_m, *wire.mutable_tool_position_world_m());
    put(m.tool_orientation_world, *wire.mutable_tool_orientation_world());
    wire.set_buttons(m.buttons);
    wire.set_is_clutched(m.is_clutched);
    const std::size_t count = std::min<std::size_t>(m.applied_count, kMaxAppliedForces);
    for (std::size_t i = 0; i < count; ++i) {
      const AppliedForce& applied = m.applied[i];
      v1::AppliedForce& to = *wire.add_applied();
      put(applied.force_on_hand_newton, *to.mutable_force_on_hand_newton());
      to.set_from_ns(ns(applied.from));
      to.set_until_ns(ns(applied.until));
      if (applied.has_position_at_end) {
        put(applied.hand_position_at_end_m, *to.mutable_hand_position_at_end_m());
      }
      if (!m.wrist) continue;
      put(applied.wrist_torque_newton_m, *to.mutable_wrist_torque_on_hand_newton_m());
      if (applied.has_position_at_end) {
        put(applied.wrist_angle_at_end_rad, *to.mutable_wrist_angle_at_end_rad());
      }
    }
    put(m.acting_force_on_hand_newton, *wire.mutable_acting_force_on_hand_newton());
    // a lease that ended before the reading is over
    wire.set_acting_until_ns(ns(std::max(m.acting_until, m.header.sampled_at)));
    if (std::isfinite(m.monitor_energy_joule)) {
      wire.set_monitor_energy_joule(m.monitor_energy_joule);
    }
    if (m.wrist) put_wrist(*m.wrist, *wire.mutable_wrist());
  }

  static void check(const v1::DeviceState& wire, Verdict& verdict) {
    verdict.vector(wire.has_hand_position_m(), wire.hand_position_m(), kMaxPositionM);
    verdict.vector(wire.has_tool_position_world_m(), wire.tool_position_world_m(), kMaxPositionM);
    verdict.orientation(wire.has_tool_orientation_world(), wire.tool_orientation_world());
    verdict.expect(wire.applied_size() <= static_cast<int>(kMaxAppliedForces));
    const v1::AppliedForce* previous = nullptr;
    for (const v1::AppliedForce& applied : wire.applied()) {
      verdict.vector(applied.has_force_on_hand_newton(), applied.force_on_hand_newton(),
                     kMaxForceOnHandNewton);
      verdict.time(applied.from_ns());
      verdict.time(applied.until_ns());
      verdict.expect(applied.until_ns() >= applied.from_ns());
      verdict.expect(previous == nullptr || previous->until_ns() == applied.from_ns());
      if (applied.has_hand_position_at_end_m()) {
        verdict.vector(true, applied.hand_position_at_end_m(), kMaxPositionM);
      }
      previous = &applied;
    }
    verdict.vector(wire.has_acting_force_on_hand_newton(), wire.acting_force_on_hand_newton(),
                   kMaxForceOnHandNewton);
    verdict.time(wire.acting_until_ns());
    verdict.finite(wire.monitor_energy_joule());
    check_wrist(wire, verdict);
    if (verdict.error() == DecodeError::kNone) {
      verdict.expect(is_within(wire.header().sampled_at_ns(), wire.acting_until_ns(), kMaxLeaseNs));
    }
  }

  static void read(const v1::DeviceState& wire, DeviceState& m) {
    m.hand_position_m = vector(wire.hand_position_m());
    m.tool_position_world_m = vector(wire.tool_position_world_m());
    m.tool_orientation_world = quaternion(wire.tool_orientation_world());
    m.buttons = wire.buttons();
    m.is_clutched = wire.is_clutched();
    const auto used = std::min<std::size_t>(m.applied_count, kMaxAppliedForces);
    m.applied_count = static_cast<std::uint32_t>(wire.applied_size());
    if (used > m.applied_count) {
      std::fill(m.applied.begin() + m.applied_count,
                m.applied.begin() + static_cast<std::ptrdiff_t>(used), AppliedForce{});
    }
    for (std::size_t i = 0; i < m.applied_count; ++i) {
      const v1::AppliedForce& applied = wire.applied(static_cast<int>(i));
      m.applied[i] = {.force_on_hand_newton = vector(applied.force_on_hand_newton()),
                      .from = time(applied.from_ns()),
                      .until = time(applied.until_ns()),
                      .hand_position_at_end_m = vector(applied.hand_position_at_end_m()),
                      .has_position_at_end = applied.has_hand_position_at_end_m(),
                      .wrist_torque_newton_m = vector(applied.wrist_torque_on_hand_newton_m()),
                      .wrist_angle_at_end_rad = vector(applied.wrist_angle_at_end_rad())};
    }
    m.acting_force_on_hand_newton = vector(wire.acting_force_on_hand_newton());
    m.acting_until = time(wire.acting_until_ns());
    m.monitor_energy_joule = wire.has_monitor_energy_joule()
                                 ? wire.monitor_energy_joule()
                                 : std::numeric_limits<double>::infinity();
    m.wrist = wrist_of(wire);
  }
};
template class Codec<DeviceState>;

template <>
struct WireFormat<ForceCommand> {
  using Message = v1::ForceCommand;

  static void fill(const ForceCommand& m, v1::ForceCommand& wire) {
    put_stamp(m.answers_session_id, m.answers_sequence, m.answers_sampled_at,
              *wire.mutable_answers());
    put(m.force_on_hand_newton, *wire.mutable_force_on_hand_newton());
    wire.set_valid_for_ns(m.valid_for.count());
    wire.set_begins_within_ns(m.begins_within.count());
    if (!m.wrist_torque_newton_m.isZero(0.0)) {
      put(m.wrist_torque_newton_m, *wire.mutable_wrist_torque_on_hand_newton_m());
    }
    if (std::isfinite(m.counted_energy_joule)) {
      wire.set_counted_energy_joule(m.counted_energy_joule);
    } else {
      wire.clear_counted_energy_joule();
    }
  }

  static void check(const v1::ForceCommand& wire, Verdict& verdict) {
    verdict.stamp(wire.has_answers(), wire.answers());
    verdict.vector(wire.has_force_on_hand_newton(), wire.force_on_hand_newton(),
                   kMaxForceOnHandNewton);
    verdict.expect(wire.valid_for_ns() >= 0 && wire.valid_for_ns() <= kMaxLeaseNs);
    verdict.expect(wire.begins_within_ns() >= 0 && wire.begins_within_ns() <= kMaxLeaseNs);
    verdict.finite(wire.counted_energy_joule());
    if (wire.has_wrist_torque_on_hand_newton_m()) {
      verdict.vector(true, wire.wrist_torque_on_hand_newton_m(), kMaxTorqueOnHandNewtonM);
    }
  }

  static void read(const v1::ForceCommand& wire, ForceCommand& m) {
    m.answers_session_id = wire.answers().session_id();
    m.answers_sequence = wire.answers().sequence();
    m.answers_sampled_at = time(wire.answers().sampled_at_ns());
    m.force_on_hand_newton = vector(wire.force_on_hand_newton());
    m.valid_for = Duration(wire.valid_for_ns());
    m.begins_within = Duration(wire.begins_within_ns());
    m.counted_energy_joule = wire.has_counted_energy_joule()
                                 ? wire.counted_energy_joule()
                                 : std::numeric_limits<double>::quiet_NaN();
    m.wrist_torque_newton_m = vector(wire.wrist_torque_on_hand_newton_m());
  }
};
template class Codec<ForceCommand>;

}  // namespace palpate
