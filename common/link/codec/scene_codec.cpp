// SPDX-License-Identifier: Apache-2.0
// scene_codec.cpp — hop 5: SceneState and MeshFrame.
#include <bit>
#include <cstring>
#include <string>
#include <vector>

#include "common/link/codec/scene_wire.h"
#include "common/link/codec/wire_format.h"
#include "palpate/v1/scene.pb.h"

namespace palpate {

namespace wire {

void put(const PointerConfig& pointer, v1::SceneState_PointerHand& to) {
  put(pointer.center_m, *to.mutable_center_m());
  to.set_reach_m(pointer.reach_m);
  to.set_speed_m_per_s(pointer.speed_m_per_s);
  to.set_holder_timeout_ns(pointer.holder_timeout.count());
}

}  // namespace wire

using namespace wire;

namespace {

constexpr std::size_t kMaxSessionNameBytes = 64;
static_assert(std::endian::native == std::endian::little, "packed arrays are little-endian");

template <class Number>
void put_packed(const std::vector<Number>& numbers, std::string& to) {
  to.assign(reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(Number));
}
template <class Number>
void read_packed(const std::string& bytes, std::vector<Number>& numbers) {
  numbers.resize(bytes.size() / sizeof(Number));
  if (!numbers.empty()) std::memcpy(numbers.data(), bytes.data(), bytes.size());
}

/// Calls `visit` for each number of a packed array. An array that does not consist of whole rows is
/// out of range.
template <class Number, class Visit>
void for_each_number(const std::string& bytes, std::size_t per_row, Verdict& verdict,
                     const Visit& visit) {
  verdict.expect(bytes.size() % (per_row * sizeof(Number)) == 0);
  for (std::size_t at = 0; at + sizeof(Number) <= bytes.size(); at += sizeof(Number)) {
    Number number;
    std::memcpy(&number, bytes.data() + at, sizeof(Number));
    visit(number);
  }
}
void check_vertices(const std::string& bytes, Verdict& verdict) {
  for_each_number<float>(bytes, 3, verdict, [&](float x) {
    verdict.number(static_cast<double>(x), -kMaxPositionM, kMaxPositionM);
  });
}
void check_strain(const v1::MeshFrame& wire, Verdict& verdict) {
  const std::string& strain = wire.vertex_strain();
  verdict.expect(strain.empty() || 3 * strain.size() == wire.vertices_m().size());
  for_each_number<float>(strain, 1, verdict, [&](float e) {
    verdict.finite(static_cast<double>(e));
    verdict.expect(e >= 0.0F);
  });
}

void put_tissue(const TissueSurface& surface, v1::TissueSurface& to) {
  to.set_name(surface.name);
  to.set_shape(static_cast<v1::TissueSurface::Shape>(surface.shape));
  put_packed(surface.mesh.vertices_m, *to.mutable_vertices_m());
  put_packed(surface.mesh.triangles, *to.mutable_triangles());
  put_packed(surface.vertex_stiffness_newton_per_m, *to.mutable_vertex_stiffness_newton_per_m());
  to.set_stiffness_newton_per_m(surface.stiffness_newton_per_m);
  to.set_damping_newton_s_per_m(surface.damping_newton_s_per_m);
  to.set_is_restorable(surface.is_restorable);
}
void check_tissue(const v1::TissueSurface& surface, Verdict& verdict) {
  check_vertices(surface.vertices_m(), verdict);
  const std::size_t vertices = surface.vertices_m().size() / (3 * sizeof(float));
  for_each_number<std::uint32_t>(surface.triangles(), 3, verdict,
                                 [&](std::uint32_t index) { verdict.expect(index < vertices); });
  const std::string& stiffness = surface.vertex_stiffness_newton_per_m();
  verdict.expect(stiffness.empty() || stiffness.size() == vertices * sizeof(float));
  for_each_number<float>(stiffness, 1, verdict, [&](float k) {
    verdict.finite(static_cast<double>(k));
    verdict.expect(k >= 0.0F);
  });
  for (const double x : {surface.stiffness_newton_per_m(), surface.damping_newton_s_per_m()}) {
    verdict.finite(x);
    verdict.expect(x >= 0.0);
  }
}
void read_tissue(const v1::TissueSurface& wire, TissueSurface& surface) {
  surface.name = wire.name();
  // shapes of newer versions of physics_node are unknown here, but their vertices can be drawn
  surface.shape = v1::TissueSurface::Shape_IsValid(wire.shape())
                      ? static_cast<TissueShape>(wire.shape())
                      : TissueShape::kUnknown;
  read_packed(wire.vertices_m(), surface.mesh.vertices_m);
  read_packed(wire.triangles(), surface.mesh.triangles);
  read_packed(wire.vertex_stiffness_newton_per_m(), surface.vertex_stiffness_newton_per_m);
  surface.stiffness_newton_per_m = wire.stiffness_newton_per_m();
  surface.damping_newton_s_per_m = wire.damping_newton_s_per_m();
  surface.is_restorable = wire.is_restorable();
}

}  // namespace

template <>
struct WireFormat<SceneState> {
  using Message = v1::SceneState;

  static void fill(const SceneState& m, v1::SceneState& wire) {
    wire.set_revision(m.revision);
    wire.set_session_name(m.session_name);
    wire.set_session_text(m.session_text);
    wire.set_controller(m.controller);
    wire.set_device_rate_hz(m.device_rate_hz);
    wire.set_physics_rate_hz(m.physics_rate_hz);
    wire.set_peak_force_newton(m.peak_force_newton);
    wire.set_tip_radius_m(m.tip_radius_m);
    wire.set_shaft_length_m(m.shaft_length_m);
    wire.set_shaft_radius_m(m.shaft_radius_m);
    wire.set_accepts_changes(m.accepts_changes);
    wire.set_workspace_scale_ratio(m.workspace_scale_ratio);
    for (const TissueSurface& surface : m.tissues) put_tissue(surface, *wire.add_tissues());
    if (m.reach) {
      put(m.reach->center_m, *wire.mutable_reach()->mutable_center_m());
      put(m.reach->half_extent_m, *wire.mutable_reach()->mutable_half_extent_m());
    }
    if (m.pointer) put(*m.pointer, *wire.mutable_pointer());
  }

  static void check(const v1::SceneState& wire, Verdict& verdict) {
    const auto positive = [&](double x) {
      verdict.finite(x);
      verdict.expect(x > 0.0);
    };
    verdict.expect(wire.revision() > 0);
    verdict.expect(wire.session_name().size() <= kMaxSessionNameBytes);
    positive(wire.device_rate_hz());
    positive(wire.physics_rate_hz());
    positive(wire.peak_force_newton());
    for (const double length_m :
         {wire.tip_radius_m(), wire.shaft_length_m(), wire.shaft_radius_m()}) {
      verdict.number(length_m, 0.0, kMaxPositionM);
    }
    positive(wire.workspace_scale_ratio());
    for (const v1::TissueSurface& surface : wire.tissues()) check_tissue(surface, verdict);
    if (wire.has_reach()) {
      const v1::SceneState::Reach& reach = wire.reach();
      verdict.vector(reach.has_center_m(), reach.center_m(), kMaxPositionM);
      verdict.vector(reach.has_half_extent_m(), reach.half_extent_m(), kMaxPositionM);
      const Vector3 half_extent_m = vector(reach.half_extent_m());
      verdict.expect((half_extent_m.array() > 0.0).all());
    }
    if (wire.has_pointer()) {
      const v1::SceneState::PointerHand& pointer = wire.pointer();
      verdict.vector(pointer.has_center_m(), pointer.center_m(), kMaxPositionM);
      positive(pointer.reach_m());
      positive(pointer.speed_m_per_s());
      verdict.time(pointer.holder_timeout_ns());
      verdict.expect(pointer.holder_timeout_ns() > 0);
    }
  }

  static void read(const v1::SceneState& wire, SceneState& m) {
    m.revision = wire.revision();
    m.session_name = wire.session_name();
    m.session_text = wire.session_text();
    m.controller = wire.controller();
    m.device_rate_hz = wire.device_rate_hz();
    m.physics_rate_hz = wire.physics_rate_hz();
    m.peak_force_newton = wire.peak_force_newton();
    m.tip_radius_m = wire.tip_radius_m();
    m.accepts_changes = wire.accepts_changes();
    m.shaft_length_m = wire.shaft_length_m();
    m.shaft_radius_m = wire.shaft_radius_m();
    m.workspace_scale_ratio = wire.workspace_scale_ratio();
    m.tissues.resize(static_cast<std::size_t>(wire.tissues_size()));
    for (int i = 0; i < wire.tissues_size(); ++i) {
      read_tissue(wire.tissues(i), m.tissues[static_cast<std::size_t>(i)]);
    }
    m.reach.reset();
    if (wire.has_reach()) {
      m.reach = ReachBox{.center_m = vector(wire.reach().center_m()),
                         .half_extent_m = vector(wire.reach().half_extent_m())};
    }
    m.pointer.reset();
    if (wire.has_pointer()) {
      m.pointer = PointerConfig{.center_m = vector(wire.pointer().center_m()),
                                .reach_m = wire.pointer().reach_m(),
                                .speed_m_per_s = wire.pointer().speed_m_per_s(),
                                .holder_timeout = Duration(wire.pointer().holder_timeout_ns())};
    }
  }
};
template class Codec<SceneState>;

template <>
struct WireFormat<MeshFrame> {
  using Message = v1::MeshFrame;

  static void fill(const MeshFrame& m, v1::MeshFrame& wire) {
    wire.set_scene_revision(m.scene_revision);
    wire.set_tissue(m.tissue);
    wire.set_first_vertex(m.first_vertex);
    put_packed(m.vertices_m, *wire.mutable_vertices_m());
    wire.set_device_sequence(m.device_sequence);
    if (!m.vertex_strain.empty()) put_packed(m.vertex_strain, *wire.mutable_vertex_strain());
    if (!m.displacement_world_m.isZero(0.0)) {
      put(m.displacement_world_m, *wire.mutable_displacement_world_m());
    }
  }

  static void check(const v1::MeshFrame& wire, Verdict& verdict) {
    verdict.expect(wire.scene_revision() > 0);
    check_vertices(wire.vertices_m(), verdict);
    verdict.vector(true, wire.displacement_world_m(), kMaxPositionM);
    check_strain(wire, verdict);
  }

  static void read(const v1::MeshFrame& wire, MeshFrame& m) {
    m.scene_revision = wire.scene_revision();
    m.tissue = wire.tissue();
    m.first_vertex = wire.first_vertex();
    read_packed(wire.vertices_m(), m.vertices_m);
    m.device_sequence = wire.device_sequence();
    m.displacement_world_m = vector(wire.displacement_world_m());
    read_packed(wire.vertex_strain(), m.vertex_strain);
  }
};
template class Codec<MeshFrame>;

}  // namespace palpate
