// SPDX-License-Identifier: Apache-2.0
#include "common/link/codec/elastic_wire.h"

#include <bitset>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace palpate::wire {
namespace {

constexpr std::size_t kOwnBytes = 12;
constexpr std::size_t kOtherBytes = 19;
constexpr std::size_t kPlaceBytes = 17;
constexpr std::size_t kRestBytes = 6;

void put_all(std::span<const std::int16_t> values, std::string& to) {
  for (const std::int16_t x : values) put_integer(static_cast<std::uint16_t>(x), 2, to);
}
void read_all(const std::string& from, std::size_t at, std::span<std::int16_t> values) {
  for (std::int16_t& x : values) {
    x = static_cast<std::int16_t>(static_cast<std::uint16_t>(integer(from, at, 2)));
    at += 2;
  }
}

// --- point ------------------------------------------------------------------------------------

void put_point(const ElasticPoint& point, v1::ElasticPoint& to) {
  to.set_patch(point.patch);
  to.set_slot(point.slot);
  to.set_version(point.version);
  put(point.rest_m, *to.mutable_rest_m());
  to.set_rigid_give_m_per_newton(point.rigid_give_m_per_newton);
  to.set_is_held(point.is_held);
  to.set_step_m_per_newton(point.step_m_per_newton);
  put_all(point.own, *to.mutable_own());
  std::string& others = *to.mutable_others();
  for (std::size_t slot = 0; slot < kElasticSlots; ++slot) {
    if (!point.has_other[slot]) continue;
    put_integer(static_cast<std::uint32_t>(slot), 1, others);
    put_all(point.others[slot], others);
  }
}

/// All minors that can be negative, exact.
bool is_semidefinite(const std::array<std::int16_t, 6>& m) {
  const auto at = [&](std::size_t i) { return std::int64_t{m[i]}; };
  const std::int64_t xx = at(0);
  const std::int64_t xy = at(1);
  const std::int64_t xz = at(2);
  const std::int64_t yy = at(3);
  const std::int64_t yz = at(4);
  const std::int64_t zz = at(5);
  return xx >= 0 && yy >= 0 && zz >= 0 && xx * yy >= xy * xy && xx * zz >= xz * xz &&
         yy * zz >= yz * yz &&
         xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz) >= 0;
}

void check_point(const v1::ElasticPoint& point, Verdict& verdict) {
  verdict.expect(point.patch() < kMaxElasticPatches && point.slot() < kElasticSlots &&
                 point.version() > 0);
  verdict.vector(point.has_rest_m(), point.rest_m(), kMaxPositionM);
  for (const float x : {point.rigid_give_m_per_newton(), point.step_m_per_newton()}) {
    verdict.number(static_cast<double>(x), kMinComplianceMPerNewton, kMaxComplianceMPerNewton);
  }
  verdict.expect(point.own().size() == kOwnBytes);
  if (point.own().size() == kOwnBytes) {
    std::array<std::int16_t, 6> own{};
    read_all(point.own(), 0, own);
    verdict.expect(is_semidefinite(own));
  }
  const std::string& others = point.others();
  verdict.expect(others.size() % kOtherBytes == 0);
  std::bitset<kElasticSlots> seen;
  if (point.slot() < kElasticSlots) seen.set(point.slot());
  for (std::size_t at = 0; at + kOtherBytes <= others.size(); at += kOtherBytes) {
    const std::uint32_t slot = integer(others, at, 1);
    const bool is_new = slot < kElasticSlots && !seen[slot];
    verdict.expect(is_new);
    if (!is_new) return;
    seen.set(slot);
  }
}

void read(const v1::ElasticPoint& wire, ElasticPoint& point) {
  point.patch = wire.patch();
  point.slot = wire.slot();
  point.version = wire.version();
  point.rest_m = vector(wire.rest_m());
  point.rigid_give_m_per_newton = wire.rigid_give_m_per_newton();
  point.is_held = wire.is_held();
  point.step_m_per_newton = wire.step_m_per_newton();
  read_all(wire.own(), 0, point.own);
  point.has_other.reset();
  for (std::size_t at = 0; at < wire.others().size(); at += kOtherBytes) {
    const std::size_t slot = integer(wire.others(), at, 1);
    point.has_other.set(slot);
    read_all(wire.others(), at + 1, point.others[slot]);
  }
}

// --- state ------------------------------------------------------------------------------------

void put_state(const ElasticState& state, v1::ElasticState& to) {
  to.set_patch(state.patch);
  to.set_tissue(state.tissue);
  to.set_number(state.number);
  to.set_tip_radius_m(state.tip_radius_m);
  put(state.center_m, *to.mutable_center_m());
  if (!state.force_outside_patch_newton.isZero(0.0))
    put(state.force_outside_patch_newton, *to.mutable_force_outside_patch_newton());
  if (state.friction_coefficient > 0.0) {
    to.set_friction_coefficient(state.friction_coefficient);
    to.set_friction_stiffness_newton_per_m(state.friction_stiffness_newton_per_m);
  }
  if (state.has_rest) to.set_compliance_ratio(state.compliance_ratio);
  put(state.normal, *to.mutable_normal());
  put(state.from_m, *to.mutable_from_m());
  if (state.to_m != state.from_m) put(state.to_m, *to.mutable_to_m());
  to.set_radius_m(state.radius_m);
  to.set_away_step_m(state.away_step_m);
  to.set_force_step_newton(state.force_step_newton);
  std::string& places = *to.mutable_places();
  for (std::size_t slot = 0; slot < kElasticSlots; ++slot) {
    const ElasticPlace& place = state.places[slot];
    if (place.version == 0) continue;
    put_integer(static_cast<std::uint32_t>(slot), 1, places);
    put_integer(place.version, 4, places);
    put_all(place.away, places);
    put_all(place.force, places);
    if (state.relaxation_s > 0.0) put_all(place.rest, *to.mutable_rests());
  }
  if (state.relaxation_s > 0.0) to.set_relaxation_s(state.relaxation_s);
  if (state.carried_m.isZero(0.0) && state.carried_m_per_s.isZero(0.0)) return;
  put(state.carried_m, *to.mutable_carried_m());
  put(state.carried_m_per_s, *to.mutable_carried_m_per_s());
  to.set_carried_at_s(state.carried_at_s);
}

void check_state(const v1::ElasticState& state, Verdict& verdict) {
  verdict.expect(state.patch() < kMaxElasticPatches && state.number() > 0);
  verdict.number(state.tip_radius_m(), 0.0, kMaxPositionM);
  verdict.expect(state.tip_radius_m() > 0.0);
  verdict.vector(state.has_center_m(), state.center_m(), kMaxPositionM);
  if (state.has_force_outside_patch_newton()) {
    verdict.vector(true, state.force_outside_patch_newton(), kMaxTissueForceNewton);
  }
  verdict.number(state.friction_coefficient(), 0.0, kMaxFrictionCoefficient);
  verdict.number(state.friction_stiffness_newton_per_m(), 0.0, kMaxStiffnessNewtonPerM);
  verdict.expect(state.friction_coefficient() == 0.0 ||
                 state.friction_stiffness_newton_per_m() > 0.0);
  verdict.finite(state.compliance_ratio());
  if (state.compliance_ratio() != 0.0) {
    verdict.number(state.compliance_ratio(), kMinComplianceRatio, kMaxComplianceRatio);
  }
  verdict.unit_vector(state.has_normal(), state.normal());
  verdict.vector(state.has_from_m(), state.from_m(), kMaxPositionM);
  if (state.has_to_m()) verdict.vector(true, state.to_m(), kMaxPositionM);
  verdict.number(state.radius_m(), 0.0, kMaxPositionM);
  verdict.number(static_cast<double>(state.away_step_m()), 0.0, kMaxPositionM);
  verdict.number(static_cast<double>(state.force_step_newton()), 0.0, kMaxTissueForceNewton);
  verdict.number(state.relaxation_s(), 0.0, kMaxElasticRelaxationS);
  if (state.has_carried_m()) verdict.vector(true, state.carried_m(), kMaxPositionM);
  if (state.has_carried_m_per_s()) {
    verdict.vector(true, state.carried_m_per_s(), kMaxTissueSpeedMPerS);
  }
  verdict.finite(state.carried_at_s());
  const std::string& places = state.places();
  verdict.expect(places.size() % kPlaceBytes == 0);
  verdict.expect(state.rests().empty() ||
                 (state.relaxation_s() > 0.0 &&
                  state.rests().size() == places.size() / kPlaceBytes * kRestBytes));
  std::bitset<kElasticSlots> seen;
  for (std::size_t at = 0; at + kPlaceBytes <= places.size(); at += kPlaceBytes) {
    const std::uint32_t slot = integer(places, at, 1);
    const bool is_new = slot < kElasticSlots && !seen[slot] && integer(places, at + 1, 4) > 0;
    verdict.expect(is_new);
    if (!is_new) return;
    seen.set(slot);
  }
}

void read(const v1::ElasticState& wire, ElasticState& state) {
  state.patch = wire.patch();
  state.tissue = wire.tissue();
  state.number = wire.number();
  state.tip_radius_m = wire.tip_radius_m();
  state.center_m = vector(wire.center_m());
  state.force_outside_patch_newton = wire.has_force_outside_patch_newton()
                                         ? vector(wire.force_outside_patch_newton())
                                         : Vector3::Zero();
  state.friction_coefficient = wire.friction_coefficient();
  state.friction_stiffness_newton_per_m =
      state.friction_coefficient > 0.0 ? wire.friction_stiffness_newton_per_m() : 0.0;
  state.has_rest = wire.compliance_ratio() > 0.0;
  state.compliance_ratio = state.has_rest ? wire.compliance_ratio() : 1.0;
  state.normal = unit(vector(wire.normal()));
  state.from_m = vector(wire.from_m());
  state.to_m = wire.has_to_m() ? vector(wire.to_m()) : state.from_m;
  state.radius_m = wire.radius_m();
  state.away_step_m = wire.away_step_m();
  state.force_step_newton = wire.force_step_newton();
  state.relaxation_s = wire.relaxation_s();
  state.carried_m = wire.has_carried_m() ? vector(wire.carried_m()) : Vector3::Zero();
  state.carried_m_per_s =
      wire.has_carried_m_per_s() ? vector(wire.carried_m_per_s()) : Vector3::Zero();
  state.carried_at_s = wire.carried_at_s();
  state.places.fill({});
  std::size_t rest_at = 0;
  for (std::size_t at = 0; at < wire.places().size(); at += kPlaceBytes) {
    ElasticPlace& place = state.places[integer(wire.places(), at, 1)];
    place.version = integer(wire.places(), at + 1, 4);
    read_all(wire.places(), at + 5, place.away);
    read_all(wire.places(), at + 11, place.force);
    place.rest = place.away;
    if (!wire.rests().empty()) read_all(wire.rests(), rest_at, place.rest);
    rest_at += kRestBytes;
  }
}

}  // namespace

// --- all --------------------------------------------------------------------------------------

void put(const ElasticNews& news, v1::ElasticNews& to) {
  to.set_store_id(news.store_id);
  to.set_number(news.number);
  if (news.has_point) {
    put_point(news.point, *to.mutable_point());
  } else {
    put_state(news.state, *to.mutable_state());
  }
}

void check_elastic(const v1::ElasticNews& news, Verdict& verdict) {
  verdict.expect(news.store_id() != 0 && news.number() > 0);
  verdict.require(news.has_point() || news.has_state());
  verdict.expect(!(news.has_point() && news.has_state()));
  if (news.has_point()) check_point(news.point(), verdict);
  if (news.has_state()) check_state(news.state(), verdict);
}

void read_elastic(const v1::ElasticNews& wire, ElasticNews& news) {
  news.store_id = wire.store_id();
  news.number = wire.number();
  news.has_point = wire.has_point();
  if (news.has_point) {
    read(wire.point(), news.point);
  } else {
    read(wire.state(), news.state);
  }
}

}  // namespace palpate::wire
