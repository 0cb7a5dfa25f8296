#include "physics_node/scene/scene_description.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>
#include <utility>

#include "physics_node/surfaces/triangle_surface.h"

namespace palpate::physics {
namespace {

using LatticePoint = std::array<std::uint16_t, 3>;
constexpr double kLatticeSteps = std::numeric_limits<std::uint16_t>::max();
// Of a description; a longer surface is not sent [m].
constexpr double kLongestSide_m = 1000.0;

bool is_flat(const LatticePoint& a, const LatticePoint& b, const LatticePoint& c) {
  const auto edge = [&](const LatticePoint& to, std::size_t axis) {
    return std::int64_t{to[axis]} - std::int64_t{a[axis]};
  };
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t k = (i + 1) % 3;
    if (edge(b, i) * edge(c, k) != edge(b, k) * edge(c, i)) return false;
  }
  return true;
}

/// The index of the vertex in the tile, which is added if need be; kMaxTileVertices if there is no
/// room.
std::size_t vertex_in(SurfaceTile& tile, const LatticePoint& vertex) {
  const auto end = tile.vertices.begin() + tile.vertex_count;
  const auto found = std::find(tile.vertices.begin(), end, vertex);
  const auto index = static_cast<std::size_t>(found - tile.vertices.begin());
  if (found == end && index < kMaxTileVertices) tile.vertices[tile.vertex_count++] = vertex;
  return index;
}

using LatticeFacet = std::array<LatticePoint, 3>;

/// False if they do not all fit.
bool add_facets(std::span<const LatticeFacet> facets, SurfaceTile& tile) {
  if (facets.size() > kMaxTileFacets) return false;
  for (const LatticeFacet& facet : facets) {
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t index = vertex_in(tile, facet[i]);
      if (index == kMaxTileVertices) return false;
      tile.facets[tile.facet_count][i] = static_cast<std::uint8_t>(index);
    }
    ++tile.facet_count;
  }
  return true;
}

/// Compact tiles: halves across the longest side until they fit, full ones where possible.
void cut_facets(std::span<LatticeFacet> facets, const SurfaceTile& empty,
                std::vector<SurfaceTile>& tiles) {
  if (facets.empty()) return;
  SurfaceTile tile = empty;
  if (add_facets(facets, tile)) {
    tiles.push_back(tile);
    return;
  }
  const auto middle = [](const LatticeFacet& facet) {  // three times it
    Vector3 sum = Vector3::Zero();
    for (const auto& [x, y, z] : facet) sum += Vector3(x, y, z);
    return sum;
  };
  Bounds bounds{middle(facets[0]), middle(facets[0])};
  for (const LatticeFacet& facet : facets) bounds.include(middle(facet));
  const int axis = bounds.longest_axis();
  const std::size_t half = facets.size() / 2;
  const std::size_t count =
      facets.size() > kMaxTileFacets
          ? (half + kMaxTileFacets - 1) / kMaxTileFacets * kMaxTileFacets
          : half;
  std::nth_element(facets.begin(), facets.begin() + static_cast<std::ptrdiff_t>(count),
                   facets.end(), [&](const LatticeFacet& a, const LatticeFacet& b) {
                     return middle(a)[axis] < middle(b)[axis];
                   });
  cut_facets(facets.first(count), empty, tiles);
  cut_facets(facets.subspan(count), empty, tiles);
}

Bounds bounds_of(const SurfaceTile& tile) {
  const auto place = [&](std::size_t i) {
    const auto& [x, y, z] = tile.vertices[i];
    return Vector3(tile.origin_m + tile.step_m * Vector3(x, y, z));
  };
  Bounds bounds{place(0), place(0)};
  for (std::size_t i = 1; i < tile.vertex_count; ++i) bounds.include(place(i));
  return bounds;
}

void cut(const TriangleSurface& surface, const PlacedSurface& placed, DescribedTissue& tissue) {
  std::vector<Vector3> vertices_m;
  vertices_m.reserve(surface.mesh().vertices_m.size());
  for (const Vector3& vertex_m : surface.mesh().vertices_m) {
    vertices_m.push_back(placed.rotation * vertex_m + placed.position_m);
  }
  const Bounds all = palpate::bounds_of(vertices_m);
  SurfaceTile empty;
  empty.origin_m = all.lowest_m;
  empty.step_m = all.longest_side_m() / kLatticeSteps;
  const auto on_lattice = [&](std::uint32_t vertex) {
    const Vector3 steps = (vertices_m[vertex] - empty.origin_m) / empty.step_m;
    LatticePoint point{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      point[axis] = static_cast<std::uint16_t>(
          std::clamp(std::round(steps[static_cast<Eigen::Index>(axis)]), 0.0, kLatticeSteps));
    }
    return point;
  };

  std::vector<LatticeFacet> facets;
  for (const auto& [a, b, c] : surface.mesh().triangles) {
    const LatticeFacet facet{on_lattice(a), on_lattice(b), on_lattice(c)};
    if (!is_flat(facet[0], facet[1], facet[2])) facets.push_back(facet);
  }
  cut_facets(facets, empty, tissue.tiles);

  std::vector<BoxTree::Item> items;
  for (const SurfaceTile& one : tissue.tiles) {
    const Bounds bounds = bounds_of(one);
    items.push_back({bounds, bounds.center_m(), static_cast<std::uint32_t>(items.size())});
    tissue.bounds.push_back(bounds);
  }
  tissue.tree = BoxTree(std::move(items), 1);
}

}  // namespace

DescribedTissue described(const Shape& shape, const KelvinVoigtMaterial& material,
                          const TissueMotionConfig& motion, const ToolShape& tool,
                          std::size_t index) {
  DescribedTissue tissue;
  if (material.inclusions.size() > kMaxDescribedInclusions) return tissue;
  TissueDescription description{.tissue = static_cast<std::uint32_t>(index),
                                .material = material,
                                .motion = motion,
                                .tool = tool};
  description.material.inclusions.clear();
  description.material.inclusions.shrink_to_fit();
  std::copy(material.inclusions.begin(), material.inclusions.end(), description.inclusions.begin());
  description.inclusion_count = static_cast<std::uint32_t>(material.inclusions.size());
  const bool is_described = std::visit(
      [&](const auto& form) {
        if constexpr (std::is_same_v<std::decay_t<decltype(form)>, PlacedSurface>) {
          const auto* surface = dynamic_cast<const TriangleSurface*>(form.surface.get());
          if (surface == nullptr || !(surface->bounds().longest_side_m() < kLongestSide_m)) {
            return false;
          }
          description.geometry = TiledGeometry{.is_sheet = surface->is_sheet()};
          cut(*surface, form, tissue);
        } else {
          description.geometry = form;
        }
        return true;
      },
      shape.form());
  if (is_described) tissue.description = description;
  return tissue;
}

}  // namespace palpate::physics
