// SPDX-License-Identifier: Apache-2.0
// random_surface.h — random news of a surface that satisfy every rule of hop 3: what a physics
// sends that describes tissue which does not exist.
#pragma once

#include "common/core/messages.h"
#include "common/core/random.h"

namespace palpate {

/// Each component in [-limit, limit).
inline Vector3 random_vector(Random& random, double limit) {
  return {random.uniform(-limit, limit), random.uniform(-limit, limit),
          random.uniform(-limit, limit)};
}

inline DescribedGeometry random_geometry(Random& random) {
  switch (random.below(5)) {
    case 0:
      return HalfSpaceGeometry{.point_m = random_vector(random, 1.0),
                               .normal = random_vector(random, 1.0).normalized()};
    case 1:
      return SphereGeometry{.center_m = random_vector(random, 1.0),
                            .radius_m = random.uniform(0.0, 1.0)};
    case 2:
      return BoxGeometry{.center_m = random_vector(random, 1.0),
                         .size_m = random_vector(random, 1.0).cwiseAbs()};
    case 3:
      return CapsuleGeometry{.from_m = random_vector(random, 1.0),
                             .to_m = random_vector(random, 1.0),
                             .radius_m = random.uniform(0.0, 1.0)};
    default:
      return TiledGeometry{.is_sheet = random.chance(0.5), .is_cloud = random.chance(0.5)};
  }
}

inline void randomise(TissueDescription& d, Random& random) {
  d = {.slot = static_cast<std::uint32_t>(random.below(kMaxDescribed)),
       .version = static_cast<std::uint32_t>(random.bits()),
       .tissue = static_cast<std::uint32_t>(random.bits()),
       .geometry = random_geometry(random),
       .material = {.stiffness_newton_per_m = random.uniform(0.0, 1e6),
                    .damping_newton_s_per_m = random.uniform(0.0, 1e3),
                    .is_damping_isotropic = random.chance(0.5),
                    .is_adhesive = random.chance(0.5),
                    .stiffening_newton_per_m3 = random.uniform(0.0, 1e9),
                    .relaxing_stiffness_newton_per_m = random.uniform(0.0, 1e6),
                    .relaxation_time_s = random.uniform(0.1, 1e3),
                    .friction_coefficient = random.uniform(0.0, 2.0),
                    .friction_stiffness_newton_per_m = random.uniform(1.0, 1e6),
                    .puncture_newton = random.uniform(0.0, 10.0),
                    .cutting_newton = random.uniform(0.0, 10.0)},
       .inclusion_count = 1 + static_cast<std::uint32_t>(random.below(kMaxDescribedInclusions)),
       .motion = {.amplitude_m = random_vector(random, 1.0),
                  .frequency_hz = random.uniform(0.0, 1.0),
                  .phase_rad = random.uniform(-10.0, 10.0)},
       .tool = {.tip_radius_m = random.uniform(0.0, 1.0),
                .shaft_length_m = random.uniform(0.0, 1.0),
                .shaft_radius_m = random.uniform(0.0, 1.0)}};
  for (std::uint32_t i = 0; i < d.inclusion_count; ++i) {
    d.inclusions[i] = {.center_m = random_vector(random, 1.0),
                       .radius_m = random.uniform(0.0, 1.0),
                       .transition_m = random.uniform(1e-3, 1.0),
                       .stiffness_newton_per_m = random.uniform(0.0, 1e6),
                       .damping_newton_s_per_m = random.uniform(0.0, 1e3)};
  }
}

inline void randomise(TilePoint& point, Random& random) {
  const auto some = [&] { return static_cast<std::int16_t>(random.bits()); };
  const Vector3 normal = kTilePointScale * random_vector(random, 1.0).normalized();
  for (std::uint16_t& x : point.place) x = static_cast<std::uint16_t>(random.bits());
  point.reach = static_cast<std::uint16_t>(1 + random.below(65535));
  for (std::size_t i = 0; i < 3; ++i) {
    point.normal[i] = static_cast<std::int16_t>(normal[static_cast<Eigen::Index>(i)]);
  }
  point.offset = some();
  for (std::int16_t& x : point.curvature) x = some();
  point.stiffness_ratio = static_cast<float>(random.uniform(0.0, 10.0));
}

/// Random vertices: three of them are never on one line.
inline void randomise(SurfaceTile& tile, Random& random) {
  if (random.chance(0.5)) {
    tile = {.slot = static_cast<std::uint32_t>(random.below(kTileSlots)),
            .described_slot = static_cast<std::uint32_t>(random.below(kMaxDescribed)),
            .version = static_cast<std::uint32_t>(random.bits()),
            .origin_m = random_vector(random, 1.0),
            .step_m = random.uniform(1e-9, 1e-3),
            .point_count = 1 + static_cast<std::uint32_t>(random.below(kMaxTilePoints))};
    for (std::uint32_t i = 0; i < tile.point_count; ++i) randomise(tile.points[i], random);
    return;
  }
  tile = {.slot = static_cast<std::uint32_t>(random.below(kTileSlots)),
          .described_slot = static_cast<std::uint32_t>(random.below(kMaxDescribed)),
          .version = static_cast<std::uint32_t>(random.bits()),
          .origin_m = random_vector(random, 1.0),
          .step_m = random.uniform(1e-9, 1e-3),
          .vertex_count = 3 + static_cast<std::uint32_t>(random.below(kMaxTileVertices - 2)),
          .facet_count = 1 + static_cast<std::uint32_t>(random.below(kMaxTileFacets))};
  for (std::uint32_t i = 0; i < tile.vertex_count; ++i) {
    for (std::uint16_t& x : tile.vertices[i]) x = static_cast<std::uint16_t>(random.bits());
  }
  for (std::uint32_t i = 0; i < tile.facet_count; ++i) {
    const auto first = random.below(tile.vertex_count);
    for (std::size_t k = 0; k < 3; ++k) {
      tile.facets[i][k] = static_cast<std::uint8_t>((first + k) % tile.vertex_count);
    }
  }
}

inline void randomise(SurfaceNews& news, Random& random) {
  news = {.store_id = random.bits() | 1, .number = random.bits() | 1, .has_description = true};
  randomise(news.description, random);
  news.tile_count = 1 + static_cast<std::uint32_t>(random.below(kLeastTilesPerMessage));
  for (std::uint32_t i = 0; i < news.tile_count; ++i) randomise(news.tiles[i], random);
  news.coverage_count = 1 + static_cast<std::uint32_t>(random.below(kMaxDescribed));
  for (std::uint32_t i = 0; i < news.coverage_count; ++i) {
    news.coverages[i] = {.described_slot = static_cast<std::uint32_t>(random.below(kMaxDescribed)),
                         .description_version = static_cast<std::uint32_t>(random.bits()),
                         .region = {.from_m = random_vector(random, 1.0),
                                    .to_m = random_vector(random, 1.0),
                                    .radius_m = random.uniform(0.0, 1.0)}};
    CapsuleGeometry& region = news.coverages[i].region;
    if (random.chance(0.5)) region.to_m = region.from_m;
  }
  news.pending_count = 1 + static_cast<std::uint32_t>(random.below(kMaxPendingTiles));
  for (std::uint32_t i = 0; i < news.pending_count; ++i) {
    news.pending[i] = {.slot = static_cast<std::uint32_t>(random.below(kTileSlots)),
                       .described_slot = static_cast<std::uint32_t>(random.below(kMaxDescribed)),
                       .version = static_cast<std::uint32_t>(random.bits()),
                       .center_m = {static_cast<float>(random.uniform(-1.0, 1.0)),
                                    static_cast<float>(random.uniform(-1.0, 1.0)),
                                    static_cast<float>(random.uniform(-1.0, 1.0))},
                       .radius_m = static_cast<float>(random.uniform(0.0, 1.0))};
  }
}

}  // namespace palpate
