// SPDX-License-Identifier: Apache-2.0
// costly_descriptions.h — descriptions of tissue on hop 3 that are valid and made to cost time.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "common/core/messages.h"
#include "common/core/random.h"

namespace palpate::test {

/// What such descriptions have in common. All tissues of a description are alike and lie at the
/// origin.
struct CostlyGenes {
  std::size_t tissues = 8;
  std::size_t tiles = 128;  ///< of each
  bool is_cloud = false;    ///< else triangles
  bool is_sheet = false;
  bool is_moving = false;         ///< at up to 10 m/s
  bool is_farthest_first = true;  ///< order in which the tiles arrive
  double facet_m = 4e-3;          ///< size of a facet, or reach of a point
  double spread_m = 1e-3;         ///< of the tiles' middles
  double tip_radius_m = 3e-3;
  double shaft_length_m = 0.1;  ///< 0: none
  double friction = 0.5;
  std::size_t elastic_patches = 0;  ///< with all their points in the tip, which never comes to rest
};

/// A tile of the lattice of 16 µm whose parts all lie around its middle.
inline SurfaceTile costly_tile(const CostlyGenes& genes, const Vector3& middle_m, Random& random) {
  constexpr double kStep_m = 16e-6;
  constexpr double kHalf = 32768.0;
  SurfaceTile tile{.origin_m = Vector3::Constant(-kHalf * kStep_m), .step_m = kStep_m};
  const auto lattice = [&](const Vector3& place_m) {
    std::array<std::uint16_t, 3> to{};
    for (std::size_t i = 0; i < 3; ++i) {
      const double x = place_m[static_cast<Eigen::Index>(i)] / kStep_m + kHalf;
      to[i] = static_cast<std::uint16_t>(std::clamp(std::round(x), 0.0, 65535.0));
    }
    return to;
  };
  if (genes.is_cloud) {
    for (; tile.point_count < kMaxTilePoints; ++tile.point_count) {
      const Vector3 off_m =
          0.1 * genes.facet_m * Vector3(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0), 0.0);
      tile.points[tile.point_count] = {
          .place = lattice(middle_m + off_m),
          .reach = static_cast<std::uint16_t>(std::clamp(genes.facet_m / kStep_m, 1.0, 65535.0)),
          .normal = {0, 0, 32767}};
    }
    return tile;
  }
  // a fan around the middle, so that all its facets are equally near to what is above
  tile.vertices[tile.vertex_count++] = lattice(middle_m);
  constexpr std::size_t kRim = kMaxTileVertices - 1;
  for (std::size_t i = 0; i < kRim; ++i) {
    const double angle = 2.0 * std::numbers::pi * static_cast<double>(i) / kRim;
    const Vector3 rim_m = genes.facet_m * Vector3(std::cos(angle), std::sin(angle), 0.0);
    tile.vertices[tile.vertex_count++] = lattice(middle_m + rim_m);
  }
  for (std::size_t i = 0; i < kRim; ++i) {
    const auto second = static_cast<std::uint8_t>(1 + i);
    const auto third = static_cast<std::uint8_t>(1 + (i + 1) % kRim);
    tile.facets[tile.facet_count++] = {0, second, third};
  }
  return tile;
}

/// What the physics of these genes sends, in order, and the answer that it then repeats, with the
/// next states of its elastic bodies.
struct CostlyPhysics {
  std::vector<Interaction> messages;
  Interaction last;
  std::vector<ElasticState> states;
  std::uint64_t elastic_number = 0;

  void next_answer() noexcept {
    if (states.empty()) return;
    last.elastic.store_id = last.surface.store_id;
    last.elastic.number = ++elastic_number;
    last.elastic.state = states[elastic_number % states.size()];
    last.elastic.state.number = static_cast<std::uint32_t>(elastic_number);
  }
};

/// Points whose compliance is no body's: pressed in turn, they push each other on for ever.
inline void add_costly_elastic(const CostlyGenes& genes, std::uint64_t store_id, Random& random,
                               CostlyPhysics& rogue) {
  const auto any = [&] { return static_cast<std::int16_t>(random.uniform(-32767.0, 32767.0)); };
  for (std::uint32_t patch = 0; patch < genes.elastic_patches; ++patch) {
    ElasticState state;
    state.patch = patch;
    state.tissue = static_cast<std::uint32_t>(kMaxDescribed) + patch;
    state.tip_radius_m = genes.tip_radius_m;
    state.radius_m = 1.0;
    state.away_step_m = static_cast<float>(genes.tip_radius_m);
    state.force_step_newton = 1e-3F;
    for (std::uint32_t slot = 0; slot < kElasticSlots; ++slot) {
      Interaction message;
      message.header.session_id = 9;
      message.device_session_id = 1;
      ElasticNews& news = message.elastic;
      news.store_id = store_id;
      news.number = ++rogue.elastic_number;
      news.has_point = true;
      ElasticPoint& point = news.point;
      point.patch = patch;
      point.slot = slot;
      point.version = slot + 1;
      point.rigid_give_m_per_newton = 1e-4F;
      point.step_m_per_newton = 1e-3F;
      point.own = {20000, 0, 0, 20000, 0, 20000};
      for (std::uint32_t other = 0; other < slot; ++other) {
        point.has_other.set(other);
        for (std::int16_t& entry : point.others[other]) entry = any();
      }
      rogue.messages.push_back(message);
      ElasticPlace& place = state.places[slot];
      place.version = point.version;
      place.away = place.rest = {any(), any(), static_cast<std::int16_t>(any() / 4)};
      place.force = {any(), any(), any()};
    }
    rogue.states.push_back(state);
  }
}

inline CostlyPhysics costly_physics(const CostlyGenes& genes, std::uint64_t store_id,
                                    Random& random) {
  CostlyPhysics rogue;
  Interaction base;
  base.header.session_id = 9;
  base.device_session_id = 1;
  base.surface.store_id = store_id;
  std::vector<SurfaceTile> tiles;
  const std::size_t most = std::min(genes.tissues * genes.tiles, kTileSlots);
  for (std::size_t i = 0; i < most; ++i) {
    const Vector3 middle_m(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0),
                           random.uniform(-1.0, 1.0));
    tiles.push_back(costly_tile(genes, genes.spread_m * middle_m, random));
    tiles.back().described_slot = static_cast<std::uint32_t>(i % genes.tissues);
    tiles.back().version = 1;
  }
  const auto distance = [](const SurfaceTile& tile) {
    const auto& [x, y, z] = tile.vertices[0];
    const auto& [u, v, w] = tile.points[0].place;
    const bool is_cloud = tile.point_count > 0;
    return (Vector3(is_cloud ? u : x, is_cloud ? v : y, is_cloud ? w : z) -
            Vector3::Constant(32768.0))
        .norm();
  };
  std::sort(tiles.begin(), tiles.end(), [&](const SurfaceTile& a, const SurfaceTile& b) {
    return genes.is_farthest_first ? distance(a) > distance(b) : distance(a) < distance(b);
  });
  std::uint64_t number = 1;
  for (std::uint32_t i = 0; i < genes.tissues; ++i) {
    Interaction message = base;
    message.surface.number = number++;
    message.surface.has_description = true;
    TissueDescription& d = message.surface.description;
    d.slot = d.tissue = i;
    d.version = 1;
    d.geometry = TiledGeometry{.is_sheet = genes.is_sheet, .is_cloud = genes.is_cloud};
    d.material.stiffness_newton_per_m = 300.0;
    d.material.friction_coefficient = genes.friction;
    d.material.friction_stiffness_newton_per_m = 1000.0;
    if (genes.is_moving) d.motion = {.amplitude_m = {0.0, 0.0, 0.08}, .frequency_hz = 19.0};
    d.tool = {.tip_radius_m = genes.tip_radius_m,
              .shaft_length_m = genes.shaft_length_m,
              .shaft_radius_m = 2e-3};
    rogue.messages.push_back(message);
  }
  for (std::size_t i = 0; i < tiles.size();) {
    Interaction message = base;
    SurfaceNews& news = message.surface;
    news.number = number++;
    constexpr std::size_t kPerMessage = 4;
    for (; i < tiles.size() && news.tile_count < kPerMessage; ++i) {
      tiles[i].slot = static_cast<std::uint32_t>(i);
      news.tiles[news.tile_count++] = tiles[i];
    }
    rogue.messages.push_back(message);
  }
  rogue.last = base;
  for (std::uint32_t i = 0; i < genes.tissues; ++i) {
    rogue.last.surface.coverages[i] = {
        .described_slot = i, .description_version = 1, .region = {.radius_m = 1000.0}};
    rogue.last.surface.coverage_count = i + 1;
    if (genes.elastic_patches > 0 && i >= kMaxContactsWithElastic) continue;
    rogue.last.contacts[i].tissue = i;
    rogue.last.contacts[i].penetration_m = -0.01;
    rogue.last.contacts[i].trust_radius_m = 1.0;
    rogue.last.listed_count = i + 1;
  }
  add_costly_elastic(genes, store_id, random, rogue);
  return rogue;
}

}  // namespace palpate::test
