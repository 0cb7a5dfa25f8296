// SPDX-License-Identifier: Apache-2.0
#include "common/link/codec/surface_wire.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <span>
#include <string>

namespace palpate::wire {
namespace {

constexpr double kMaxAngleRad = 1e6;
constexpr double kMaxTileStepM = 1.0;
constexpr std::size_t kVertexBytes = 6;
constexpr std::size_t kFacetBytes = 3;
constexpr std::size_t kPointBytes = 32;
constexpr double kMaxStiffnessRatio = 1e6;

// --- description ------------------------------------------------------------------------------

void put_geometry(const HalfSpaceGeometry& shape, v1::TissueDescription& to) {
  put(shape.point_m, *to.mutable_half_space()->mutable_point_m());
  put(shape.normal, *to.mutable_half_space()->mutable_normal());
}
void put_geometry(const SphereGeometry& shape, v1::TissueDescription& to) {
  put(shape.center_m, *to.mutable_sphere()->mutable_center_m());
  to.mutable_sphere()->set_radius_m(shape.radius_m);
}
void put_geometry(const BoxGeometry& shape, v1::TissueDescription& to) {
  put(shape.center_m, *to.mutable_box()->mutable_center_m());
  put(shape.size_m, *to.mutable_box()->mutable_size_m());
}
void put_geometry(const CapsuleGeometry& shape, v1::TissueDescription& to) {
  put(shape.from_m, *to.mutable_capsule()->mutable_from_m());
  put(shape.to_m, *to.mutable_capsule()->mutable_to_m());
  to.mutable_capsule()->set_radius_m(shape.radius_m);
}
void put_geometry(const TiledGeometry& shape, v1::TissueDescription& to) {
  to.mutable_tiles()->set_is_sheet(shape.is_sheet);
  to.mutable_tiles()->set_is_cloud(shape.is_cloud);
}

void put_description(const TissueDescription& d, v1::TissueDescription& to) {
  to.set_slot(d.slot);
  to.set_version(d.version);
  to.set_tissue(d.tissue);
  std::visit([&](const auto& shape) { put_geometry(shape, to); }, d.geometry);
  const KelvinVoigtMaterial& m = d.material;
  to.set_stiffness_newton_per_m(m.stiffness_newton_per_m);
  to.set_damping_newton_s_per_m(m.damping_newton_s_per_m);
  if (m.exponent > 0.0) {
    to.set_exponent(m.exponent);
    to.set_exponent_depth_m(m.exponent_depth_m);
  }
  to.set_is_damping_isotropic(m.is_damping_isotropic);
  to.set_is_adhesive(m.is_adhesive);
  to.set_stiffening_newton_per_m3(m.stiffening_newton_per_m3);
  to.set_relaxing_stiffness_newton_per_m(m.relaxing_stiffness_newton_per_m);
  to.set_relaxation_time_s(m.relaxation_time_s);
  to.set_friction_coefficient(m.friction_coefficient);
  to.set_friction_stiffness_newton_per_m(m.friction_stiffness_newton_per_m);
  to.set_puncture_newton(m.puncture_newton);
  to.set_cutting_newton(m.cutting_newton);
  const std::size_t count = std::min<std::size_t>(d.inclusion_count, kMaxDescribedInclusions);
  for (std::size_t i = 0; i < count; ++i) {
    const InclusionConfig& one = d.inclusions[i];
    v1::DescribedInclusion& wire = *to.add_inclusions();
    put(one.center_m, *wire.mutable_center_m());
    wire.set_radius_m(one.radius_m);
    wire.set_transition_m(one.transition_m);
    wire.set_stiffness_newton_per_m(one.stiffness_newton_per_m);
    wire.set_damping_newton_s_per_m(one.damping_newton_s_per_m);
  }
  if (!d.motion.amplitude_m.isZero(0.0)) {
    put(d.motion.amplitude_m, *to.mutable_motion_amplitude_m());
  }
  to.set_motion_frequency_hz(d.motion.frequency_hz);
  to.set_motion_phase_rad(d.motion.phase_rad);
  to.set_tip_radius_m(d.tool.tip_radius_m);
  to.set_shaft_length_m(d.tool.shaft_length_m);
  to.set_shaft_radius_m(d.tool.shaft_radius_m);
}

void check_geometry(const v1::TissueDescription& d, Verdict& verdict) {
  const int given = int{d.has_half_space()} + int{d.has_sphere()} + int{d.has_box()} +
                    int{d.has_capsule()} + int{d.has_tiles()};
  verdict.require(given > 0);
  verdict.expect(given <= 1);
  if (d.has_half_space()) {
    const auto& shape = d.half_space();
    verdict.vector(shape.has_point_m(), shape.point_m(), kMaxPositionM);
    verdict.unit_vector(shape.has_normal(), shape.normal());
  }
  if (d.has_sphere()) {
    verdict.vector(d.sphere().has_center_m(), d.sphere().center_m(), kMaxPositionM);
    verdict.number(d.sphere().radius_m(), 0.0, kMaxPositionM);
  }
  if (d.has_box()) {
    verdict.vector(d.box().has_center_m(), d.box().center_m(), kMaxPositionM);
    verdict.vector(d.box().has_size_m(), d.box().size_m(), kMaxPositionM);
    const v1::Vector3& size = d.box().size_m();
    verdict.expect(size.x() >= 0.0 && size.y() >= 0.0 && size.z() >= 0.0);
  }
  if (d.has_capsule()) {
    verdict.vector(d.capsule().has_from_m(), d.capsule().from_m(), kMaxPositionM);
    verdict.vector(d.capsule().has_to_m(), d.capsule().to_m(), kMaxPositionM);
    verdict.number(d.capsule().radius_m(), 0.0, kMaxPositionM);
  }
}

void check_description(const v1::TissueDescription& d, Verdict& verdict) {
  verdict.expect(d.slot() < kMaxDescribed);
  check_geometry(d, verdict);
  for (const double x : {d.stiffness_newton_per_m(), d.relaxing_stiffness_newton_per_m(),
                         d.friction_stiffness_newton_per_m()}) {
    verdict.number(x, 0.0, kMaxStiffnessNewtonPerM);
  }
  verdict.number(d.damping_newton_s_per_m(), 0.0, kMaxDampingNewtonSPerM);
  verdict.number(d.puncture_newton(), 0.0, kMaxTissueForceNewton);
  verdict.number(d.cutting_newton(), 0.0, kMaxTissueForceNewton);
  if (d.exponent() != 0.0) {
    verdict.number(d.exponent(), 1.0, kMaxExponent);
    verdict.number(d.exponent_depth_m(), kMinExponentDepthM, kMaxExponentDepthM);
  }
  verdict.finite(d.exponent_depth_m());
  verdict.number(d.stiffening_newton_per_m3(), 0.0, kMaxStiffeningNewtonPerM3);
  verdict.number(d.friction_coefficient(), 0.0, kMaxFrictionCoefficient);
  verdict.number(d.relaxation_time_s(), 0.0, kMaxRelaxationS);
  verdict.expect(d.relaxing_stiffness_newton_per_m() == 0.0 ||
                 d.relaxation_time_s() >= kMinRelaxationS);
  verdict.expect((d.friction_coefficient() == 0.0 && d.puncture_newton() == 0.0) ||
                 d.friction_stiffness_newton_per_m() > 0.0);
  verdict.expect(d.inclusions_size() <= static_cast<int>(kMaxDescribedInclusions));
  for (const v1::DescribedInclusion& one : d.inclusions()) {
    verdict.vector(one.has_center_m(), one.center_m(), kMaxPositionM);
    verdict.number(one.radius_m(), 0.0, kMaxPositionM);
    verdict.number(one.transition_m(), 0.0, kMaxPositionM);
    verdict.expect(one.transition_m() > 0.0);
    verdict.number(one.stiffness_newton_per_m(), 0.0, kMaxStiffnessNewtonPerM);
    verdict.number(one.damping_newton_s_per_m(), 0.0, kMaxDampingNewtonSPerM);
  }
  if (d.has_motion_amplitude_m()) verdict.vector(true, d.motion_amplitude_m(), kMaxPositionM);
  verdict.number(d.motion_frequency_hz(), 0.0, kMaxTissueFrequencyHz);
  for (const double a :
       {d.motion_amplitude_m().x(), d.motion_amplitude_m().y(), d.motion_amplitude_m().z()}) {
    verdict.expect(2.0 * std::numbers::pi * d.motion_frequency_hz() * std::abs(a) <=
                   kMaxTissueSpeedMPerS);
  }
  verdict.number(d.motion_phase_rad(), -kMaxAngleRad, kMaxAngleRad);
  for (const double x : {d.tip_radius_m(), d.shaft_length_m(), d.shaft_radius_m()}) {
    verdict.number(x, 0.0, kMaxPositionM);
  }
}

void read(const v1::TissueDescription& wire, TissueDescription& d) {
  d.slot = wire.slot();
  d.version = wire.version();
  d.tissue = wire.tissue();
  if (wire.has_half_space()) {
    d.geometry = HalfSpaceGeometry{.point_m = vector(wire.half_space().point_m()),
                                   .normal = unit(vector(wire.half_space().normal()))};
  } else if (wire.has_sphere()) {
    d.geometry = SphereGeometry{.center_m = vector(wire.sphere().center_m()),
                                .radius_m = wire.sphere().radius_m()};
  } else if (wire.has_box()) {
    d.geometry = BoxGeometry{.center_m = vector(wire.box().center_m()),
                             .size_m = vector(wire.box().size_m())};
  } else if (wire.has_capsule()) {
    d.geometry = CapsuleGeometry{.from_m = vector(wire.capsule().from_m()),
                                 .to_m = vector(wire.capsule().to_m()),
                                 .radius_m = wire.capsule().radius_m()};
  } else {
    d.geometry =
        TiledGeometry{.is_sheet = wire.tiles().is_sheet(), .is_cloud = wire.tiles().is_cloud()};
  }
  KelvinVoigtMaterial& m = d.material;
  m.stiffness_newton_per_m = wire.stiffness_newton_per_m();
  m.damping_newton_s_per_m = wire.damping_newton_s_per_m();
  m.exponent = wire.exponent();
  m.exponent_depth_m = wire.exponent() > 0.0 ? wire.exponent_depth_m() : 1e-3;
  m.is_damping_isotropic = wire.is_damping_isotropic();
  m.is_adhesive = wire.is_adhesive();
  m.stiffening_newton_per_m3 = wire.stiffening_newton_per_m3();
  m.relaxing_stiffness_newton_per_m = wire.relaxing_stiffness_newton_per_m();
  m.relaxation_time_s = wire.relaxation_time_s();
  m.friction_coefficient = wire.friction_coefficient();
  m.friction_stiffness_newton_per_m = wire.friction_stiffness_newton_per_m();
  m.puncture_newton = wire.puncture_newton();
  m.cutting_newton = wire.cutting_newton();
  d.inclusion_count = static_cast<std::uint32_t>(wire.inclusions_size());
  for (std::uint32_t i = 0; i < d.inclusion_count; ++i) {
    const v1::DescribedInclusion& one = wire.inclusions(static_cast<int>(i));
    d.inclusions[i] = {.center_m = vector(one.center_m()),
                       .radius_m = one.radius_m(),
                       .transition_m = one.transition_m(),
                       .stiffness_newton_per_m = one.stiffness_newton_per_m(),
                       .damping_newton_s_per_m = one.damping_newton_s_per_m()};
  }
  d.motion.amplitude_m =
      wire.has_motion_amplitude_m() ? vector(wire.motion_amplitude_m()) : Vector3::Zero();
  d.motion.frequency_hz = wire.motion_frequency_hz();
  d.motion.phase_rad = wire.motion_phase_rad();
  d.tool = {.tip_radius_m = wire.tip_radius_m(),
            .shaft_length_m = wire.shaft_length_m(),
            .shaft_radius_m = wire.shaft_radius_m()};
}

// --- tiles ------------------------------------------------------------------------------------

void put_points(const SurfaceTile& tile, std::string& to) {
  const std::size_t count = std::min<std::size_t>(tile.point_count, kMaxTilePoints);
  const auto put_signed = [&](std::int16_t x) {
    put_integer(static_cast<std::uint16_t>(x), 2, to);
  };
  for (const TilePoint& point : std::span(tile.points).first(count)) {
    for (const std::uint16_t x : point.place) put_integer(x, 2, to);
    put_integer(point.reach, 2, to);
    for (const std::int16_t x : point.normal) put_signed(x);
    put_signed(point.offset);
    for (const std::int16_t x : point.curvature) put_signed(x);
    put_integer(std::bit_cast<std::uint32_t>(point.stiffness_ratio), 4, to);
  }
}

/// @param at  its first byte
TilePoint point_at(const std::string& points, std::size_t at) {
  const auto next = [&] {
    at += 2;
    return static_cast<std::uint16_t>(integer(points, at - 2, 2));
  };
  const auto next_signed = [&] { return static_cast<std::int16_t>(next()); };
  TilePoint point;
  for (std::uint16_t& x : point.place) x = next();
  point.reach = next();
  for (std::int16_t& x : point.normal) x = next_signed();
  point.offset = next_signed();
  for (std::int16_t& x : point.curvature) x = next_signed();
  point.stiffness_ratio = std::bit_cast<float>(integer(points, at, 4));
  return point;
}

void check_points(const std::string& points, Verdict& verdict) {
  const bool has_size = points.size() % kPointBytes == 0 && !points.empty() &&
                        points.size() / kPointBytes <= kMaxTilePoints;
  verdict.expect(has_size);
  for (std::size_t at = 0; has_size && at < points.size(); at += kPointBytes) {
    const TilePoint point = point_at(points, at);
    verdict.expect(point.reach > 0);
    const auto& [x, y, z] = point.normal;
    constexpr double kScale = kTilePointScale;
    const double norm = Vector3(x, y, z).norm() / kScale;
    verdict.number(norm, 0.99, 1.01);
    verdict.number(static_cast<double>(point.stiffness_ratio), 0.0, kMaxStiffnessRatio);
  }
}

void put_tile(const SurfaceTile& tile, v1::SurfaceTile& to) {
  to.set_slot(tile.slot);
  to.set_described_slot(tile.described_slot);
  to.set_version(tile.version);
  put(tile.origin_m, *to.mutable_origin_m());
  to.set_step_m(tile.step_m);
  std::string& vertices = *to.mutable_vertices();
  const std::size_t vertex_count = std::min<std::size_t>(tile.vertex_count, kMaxTileVertices);
  for (std::size_t i = 0; i < vertex_count; ++i) {
    for (const std::uint16_t x : tile.vertices[i]) put_integer(x, 2, vertices);
  }
  put_points(tile, *to.mutable_points());
  std::string& facets = *to.mutable_facets();
  const std::size_t facet_count = std::min<std::size_t>(tile.facet_count, kMaxTileFacets);
  for (std::size_t i = 0; i < facet_count; ++i) {
    for (const std::uint8_t corner : tile.facets[i]) facets.push_back(static_cast<char>(corner));
  }
}

std::array<std::int64_t, 3> lattice_point(const std::string& vertices, std::size_t index) {
  std::array<std::int64_t, 3> point{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    point[axis] = integer(vertices, kVertexBytes * index + 2 * axis, 2);
  }
  return point;
}

void check_tile(const v1::SurfaceTile& tile, Verdict& verdict) {
  verdict.expect(tile.slot() < kTileSlots && tile.described_slot() < kMaxDescribed);
  verdict.vector(tile.has_origin_m(), tile.origin_m(), kMaxPositionM);
  verdict.number(tile.step_m(), 0.0, kMaxTileStepM);
  verdict.expect(tile.step_m() > 0.0);
  const std::string& vertices = tile.vertices();
  const std::string& facets = tile.facets();
  if (!tile.points().empty()) {
    verdict.expect(vertices.empty() && facets.empty());
    check_points(tile.points(), verdict);
    return;
  }
  const std::size_t vertex_count = vertices.size() / kVertexBytes;
  const std::size_t facet_count = facets.size() / kFacetBytes;
  const bool has_size = vertices.size() % kVertexBytes == 0 && facets.size() % kFacetBytes == 0 &&
                        vertex_count <= kMaxTileVertices && facet_count >= 1 &&
                        facet_count <= kMaxTileFacets;
  verdict.expect(has_size);
  if (!has_size) return;
  for (std::size_t i = 0; i < facet_count; ++i) {
    std::array<std::array<std::int64_t, 3>, 3> corners{};
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t corner = static_cast<std::uint8_t>(facets[kFacetBytes * i + k]);
      verdict.expect(corner < vertex_count);
      if (corner >= vertex_count) return;
      corners[k] = lattice_point(vertices, corner);
    }
    // the cross product of two edges, exact: its terms are below 2³²
    const auto edge = [&](std::size_t to, std::size_t axis) {
      return corners[to][axis] - corners[0][axis];
    };
    bool is_flat = true;
    for (std::size_t a = 0; a < 3; ++a) {
      const std::size_t b = (a + 1) % 3;
      is_flat = is_flat && edge(1, a) * edge(2, b) == edge(1, b) * edge(2, a);
    }
    verdict.expect(!is_flat);
  }
}

void read(const v1::SurfaceTile& wire, SurfaceTile& tile) {
  tile.slot = wire.slot();
  tile.described_slot = wire.described_slot();
  tile.version = wire.version();
  tile.origin_m = vector(wire.origin_m());
  tile.step_m = wire.step_m();
  tile.vertex_count = static_cast<std::uint32_t>(wire.vertices().size() / kVertexBytes);
  for (std::size_t i = 0; i < tile.vertex_count; ++i) {
    const std::array<std::int64_t, 3> point = lattice_point(wire.vertices(), i);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      tile.vertices[i][axis] = static_cast<std::uint16_t>(point[axis]);
    }
  }
  tile.facet_count = static_cast<std::uint32_t>(wire.facets().size() / kFacetBytes);
  for (std::size_t i = 0; i < tile.facet_count; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      tile.facets[i][k] = static_cast<std::uint8_t>(wire.facets()[kFacetBytes * i + k]);
    }
  }
  tile.point_count = static_cast<std::uint32_t>(wire.points().size() / kPointBytes);
  for (std::size_t i = 0; i < tile.point_count; ++i) {
    tile.points[i] = point_at(wire.points(), kPointBytes * i);
  }
}

}  // namespace

// --- all --------------------------------------------------------------------------------------

void put(const SurfaceNews& news, v1::SurfaceNews& to) {
  to.set_store_id(news.store_id);
  to.set_number(news.number);
  if (news.has_description) put_description(news.description, *to.mutable_description());
  const std::size_t tiles = std::min<std::size_t>(news.tile_count, kMaxTilesPerMessage);
  for (std::size_t i = 0; i < tiles; ++i) put_tile(news.tiles[i], *to.add_tiles());
  const std::size_t coverages = std::min<std::size_t>(news.coverage_count, kMaxDescribed);
  for (std::size_t i = 0; i < coverages; ++i) {
    v1::SurfaceCoverage& wire = *to.add_coverages();
    wire.set_described_slot(news.coverages[i].described_slot);
    const CapsuleGeometry& region = news.coverages[i].region;
    put(region.from_m, *wire.mutable_center_m());
    if (region.to_m != region.from_m) put(region.to_m, *wire.mutable_to_m());
    wire.set_radius_m(region.radius_m);
    wire.set_description_version(news.coverages[i].description_version);
  }
  const std::size_t pending = std::min<std::size_t>(news.pending_count, kMaxPendingTiles);
  for (std::size_t i = 0; i < pending; ++i) {
    v1::PendingTile& wire = *to.add_pending();
    wire.set_slot(news.pending[i].slot);
    wire.set_version(news.pending[i].version);
    wire.set_center_x_m(news.pending[i].center_m[0]);
    wire.set_center_y_m(news.pending[i].center_m[1]);
    wire.set_center_z_m(news.pending[i].center_m[2]);
    wire.set_radius_m(news.pending[i].radius_m);
    wire.set_described_slot(news.pending[i].described_slot);
  }
}

void check_surface(const v1::SurfaceNews& news, Verdict& verdict) {
  verdict.expect(news.store_id() != 0);
  const bool carries = news.has_description() || news.tiles_size() > 0;
  verdict.expect(carries == (news.number() > 0));
  if (news.has_description()) check_description(news.description(), verdict);
  verdict.expect(news.tiles_size() <= static_cast<int>(kMaxTilesPerMessage));
  verdict.expect(news.coverages_size() <= static_cast<int>(kMaxDescribed));
  verdict.expect(news.pending_size() <= static_cast<int>(kMaxPendingTiles));
  for (const v1::SurfaceTile& tile : news.tiles()) check_tile(tile, verdict);
  for (const v1::SurfaceCoverage& one : news.coverages()) {
    verdict.expect(one.described_slot() < kMaxDescribed);
    verdict.vector(one.has_center_m(), one.center_m(), kMaxPositionM);
    if (one.has_to_m()) verdict.vector(true, one.to_m(), kMaxPositionM);
    verdict.number(one.radius_m(), 0.0, kMaxPositionM);
  }
  for (const v1::PendingTile& one : news.pending()) {
    verdict.expect(one.slot() < kTileSlots && one.described_slot() < kMaxDescribed);
    for (const double x : {one.center_x_m(), one.center_y_m(), one.center_z_m()}) {
      verdict.number(x, -kMaxPositionM, kMaxPositionM);
    }
    verdict.number(one.radius_m(), 0.0, kMaxPositionM);
  }
}

void read_surface(const v1::SurfaceNews& wire, SurfaceNews& news) {
  news.store_id = wire.store_id();
  news.number = wire.number();
  news.has_description = wire.has_description();
  if (wire.has_description()) read(wire.description(), news.description);
  news.tile_count = static_cast<std::uint32_t>(wire.tiles_size());
  for (std::uint32_t i = 0; i < news.tile_count; ++i) {
    read(wire.tiles(static_cast<int>(i)), news.tiles[i]);
  }
  news.coverage_count = static_cast<std::uint32_t>(wire.coverages_size());
  for (std::uint32_t i = 0; i < news.coverage_count; ++i) {
    const v1::SurfaceCoverage& one = wire.coverages(static_cast<int>(i));
    news.coverages[i] = {.described_slot = one.described_slot(),
                         .description_version = one.description_version(),
                         .region = {.from_m = vector(one.center_m()),
                                    .to_m = vector(one.has_to_m() ? one.to_m() : one.center_m()),
                                    .radius_m = one.radius_m()}};
  }
  news.pending_count = static_cast<std::uint32_t>(wire.pending_size());
  for (std::uint32_t i = 0; i < news.pending_count; ++i) {
    const v1::PendingTile& one = wire.pending(static_cast<int>(i));
    news.pending[i] = {.slot = one.slot(),
                       .described_slot = one.described_slot(),
                       .version = one.version(),
                       .center_m = {one.center_x_m(), one.center_y_m(), one.center_z_m()},
                       .radius_m = one.radius_m()};
  }
}

}  // namespace palpate::wire
