// SPDX-License-Identifier: Apache-2.0
// tool_motion_codec.cpp — hop 2: ToolMotion.
#include <algorithm>

#include "common/core/physics_term.h"
#include "common/link/codec/wire_format.h"
#include "palpate/v1/tool_motion.pb.h"

namespace palpate {

using namespace wire;

namespace {
constexpr std::int64_t kMaxLoopAgeNs = 10'000'000'000;
}

template <>
struct WireFormat<ToolMotion> {
  using Message = v1::ToolMotion;

  static void fill(const ToolMotion& m, v1::ToolMotion& wire) {
    put_stamp(m.device_session_id, m.device_sequence, m.device_sampled_at, *wire.mutable_device());
    put(m.tool_position_world_m, *wire.mutable_tool_position_world_m());
    put(m.tool_orientation_world, *wire.mutable_tool_orientation_world());
    put(m.tool_velocity_world_m_per_s, *wire.mutable_tool_velocity_world_m_per_s());
    wire.set_buttons(m.buttons);
    wire.set_physics_term(m.physics_term);
    if (m.scene_time) wire.set_scene_time_ns(ns(*m.scene_time));
    if (m.wave.is_present()) put(m.wave, *wire.mutable_wave());
    if (m.grip) {
      wire.mutable_grip()->set_physics_session_id(m.grip->physics_session_id);
      wire.mutable_grip()->set_number(m.grip->number);
      put(m.grip->slip_m, *wire.mutable_grip()->mutable_slip_m());
      wire.mutable_grip()->set_has_let_go(m.grip->has_let_go);
    }
    if (m.wants_torque) wire.set_wants_torque(true);
    if (!m.tool_angular_velocity_world_rad_per_s.isZero(0.0)) {
      put(m.tool_angular_velocity_world_rad_per_s,
          *wire.mutable_tool_angular_velocity_world_rad_per_s());
    }
    if (m.receipts.store_id == 0) return;
    v1::SurfaceReceipts& receipts = *wire.mutable_receipts();
    receipts.set_store_id(m.receipts.store_id);
    receipts.set_newest(m.receipts.newest);
    receipts.set_received(m.receipts.received);
    receipts.set_loop_age_ns(m.receipts.loop_age.count());
    receipts.set_tile_slots(m.receipts.tile_slots);
    receipts.set_tiles_per_message(m.receipts.tiles_per_message);
    if (!m.elastic_receipts) return;
    v1::ElasticReceipts& elastic = *wire.mutable_elastic_receipts();
    elastic.set_newest(m.elastic_receipts->newest);
    elastic.set_received(m.elastic_receipts->received);
  }

  static void check(const v1::ToolMotion& wire, Verdict& verdict) {
    verdict.stamp(wire.has_device(), wire.device());
    verdict.vector(wire.has_tool_position_world_m(), wire.tool_position_world_m(), kMaxPositionM);
    verdict.orientation(wire.has_tool_orientation_world(), wire.tool_orientation_world());
    verdict.vector(wire.has_tool_velocity_world_m_per_s(), wire.tool_velocity_world_m_per_s(),
                   kMaxVelocityMPerS);
    if (wire.has_tool_angular_velocity_world_rad_per_s()) {
      verdict.vector(true, wire.tool_angular_velocity_world_rad_per_s(), kMaxVelocityRadPerS);
    }
    verdict.expect(wire.physics_term() <= kMaxPhysicsTerm);
    verdict.time(wire.scene_time_ns());
    if (wire.has_wave()) check_wave(wire.wave(), verdict);
    if (wire.has_grip()) {
      verdict.expect(wire.grip().physics_session_id() != 0 && wire.grip().number() != 0);
      verdict.vector(wire.grip().has_slip_m(), wire.grip().slip_m(), kMaxPositionM);
    }
    if (!wire.has_receipts()) return;
    const v1::SurfaceReceipts& receipts = wire.receipts();
    verdict.expect(receipts.store_id() != 0);
    verdict.expect(receipts.loop_age_ns() >= 0 && receipts.loop_age_ns() <= kMaxLoopAgeNs);
  }

  static void read(const v1::ToolMotion& wire, ToolMotion& m) {
    m.device_session_id = wire.device().session_id();
    m.device_sequence = wire.device().sequence();
    m.device_sampled_at = time(wire.device().sampled_at_ns());
    m.tool_position_world_m = vector(wire.tool_position_world_m());
    m.tool_orientation_world = quaternion(wire.tool_orientation_world());
    m.tool_velocity_world_m_per_s = vector(wire.tool_velocity_world_m_per_s());
    m.buttons = wire.buttons();
    m.receipts = {.store_id = wire.receipts().store_id(),
                  .newest = wire.receipts().newest(),
                  .received = wire.receipts().received(),
                  .loop_age = Duration(wire.receipts().loop_age_ns())};
    m.elastic_receipts.reset();
    if (wire.has_elastic_receipts()) {
      m.elastic_receipts = {.newest = wire.elastic_receipts().newest(),
                            .received = wire.elastic_receipts().received()};
    }
    // older receivers do not report them; a larger store is used as far as this program's own goes
    const auto limit = [](std::uint32_t given, std::size_t least, std::size_t most) {
      return static_cast<std::uint32_t>(given == 0 ? least : std::min<std::size_t>(given, most));
    };
    m.receipts.tile_slots = limit(wire.receipts().tile_slots(), kLeastTileSlots, kTileSlots);
    m.receipts.tiles_per_message =
        limit(wire.receipts().tiles_per_message(), kLeastTilesPerMessage, kMaxTilesPerMessage);
    m.physics_term = wire.physics_term();
    m.scene_time.reset();
    if (wire.has_scene_time_ns()) m.scene_time = time(wire.scene_time_ns());
    m.wave = wire.has_wave() ? wave(wire.wave()) : Wave{};
    m.wants_torque = wire.wants_torque();
    m.tool_angular_velocity_world_rad_per_s =
        wire.has_tool_angular_velocity_world_rad_per_s()
            ? vector(wire.tool_angular_velocity_world_rad_per_s())
            : Vector3(Vector3::Zero());
    m.grip.reset();
    if (wire.has_grip()) {
      m.grip = {.physics_session_id = wire.grip().physics_session_id(),
                .number = wire.grip().number(),
                .slip_m = vector(wire.grip().slip_m()),
                .has_let_go = wire.grip().has_let_go()};
    }
  }
};
template class Codec<ToolMotion>;

}  // namespace palpate
