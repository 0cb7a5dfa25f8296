// SPDX-License-Identifier: Apache-2.0
#include "physics_node/scene/scene_description.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>
#include <utility>

#include "common/contact/tiles/tile_surface.h"
#include "physics_node/surfaces/cloud_surface.h"
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

/// Adds what fits; false if that is not all.
bool add(std::span<const LatticeFacet> facets, SurfaceTile& tile) {
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
bool add(std::span<const TilePoint> points, SurfaceTile& tile) {
  if (points.size() > kMaxTilePoints) return false;
  std::copy(points.begin(), points.end(), tile.points.begin());
  tile.point_count = static_cast<std::uint32_t>(points.size());
  return true;
}

/// Some place in it.
Vector3 place_of(const LatticePoint& point) { return Vector3(point[0], point[1], point[2]); }
Vector3 place_of(const LatticeFacet& facet) {
  return place_of(facet[0]) + place_of(facet[1]) + place_of(facet[2]);
}
Vector3 place_of(const TilePoint& point) { return place_of(point.place); }

/// Compact tiles: the parts are halved across the longest side until they fit, with as many full
/// tiles as possible.
template <class Part>
void cut(std::span<Part> parts, std::size_t most, const SurfaceTile& empty,
         std::vector<SurfaceTile>& tiles) {
  if (parts.empty()) return;
  SurfaceTile tile = empty;
  if (add(std::span<const Part>(parts), tile)) {
    tiles.push_back(tile);
    return;
  }
  Bounds bounds{place_of(parts[0]), place_of(parts[0])};
  for (const Part& part : parts) bounds.include(place_of(part));
  const int axis = bounds.longest_axis();
  const std::size_t half = parts.size() / 2;
  const std::size_t count = parts.size() > most ? (half + most - 1) / most * most : half;
  std::nth_element(
      parts.begin(), parts.begin() + static_cast<std::ptrdiff_t>(count), parts.end(),
      [&](const Part& a, const Part& b) { return place_of(a)[axis] < place_of(b)[axis]; });
  cut(parts.first(count), most, empty, tiles);
  cut(parts.subspan(count), most, empty, tiles);
}

/// The lattice of a surface's tiles.
class Lattice {
 public:
  explicit Lattice(const Bounds& bounds) {
    empty_.origin_m = bounds.lowest_m;
    empty_.step_m = bounds.longest_side_m() / kLatticeSteps;
  }
  [[nodiscard]] const SurfaceTile& empty_tile() const { return empty_; }
  [[nodiscard]] std::uint16_t steps(double length_m) const {
    return static_cast<std::uint16_t>(
        std::clamp(std::round(length_m / empty_.step_m), 0.0, kLatticeSteps));
  }
  [[nodiscard]] LatticePoint point(const Vector3& place_m) const {
    const Vector3 from_origin_m = place_m - empty_.origin_m;
    return {steps(from_origin_m.x()), steps(from_origin_m.y()), steps(from_origin_m.z())};
  }

 private:
  SurfaceTile empty_;
};

void cut(const TriangleSurface& surface, const PlacedSurface& placed, DescribedTissue& tissue) {
  std::vector<Vector3> vertices_m;
  vertices_m.reserve(surface.mesh().vertices_m.size());
  for (const Vector3& vertex_m : surface.mesh().vertices_m) {
    vertices_m.push_back(placed.rotation * vertex_m + placed.position_m);
  }
  const Lattice lattice(palpate::bounds_of(vertices_m));
  std::vector<LatticeFacet> facets;
  for (const auto& [a, b, c] : surface.mesh().triangles) {
    const LatticeFacet facet{lattice.point(vertices_m[a]), lattice.point(vertices_m[b]),
                             lattice.point(vertices_m[c])};
    if (!is_flat(facet[0], facet[1], facet[2])) facets.push_back(facet);
  }
  cut(std::span(facets), kMaxTileFacets, lattice.empty_tile(), tissue.tiles);
}

void cut(const CloudSurface& surface, const PlacedSurface& placed, DescribedTissue& tissue) {
  const std::span<const Octree::Point> points = surface.tree().points();
  const Matrix3 R = placed.rotation.toRotationMatrix();
  std::vector<Vector3> places_m;
  Bounds bounds;
  for (const Octree::Point& point : points) {
    places_m.emplace_back(R * (surface.origin_m() + Vector3(point.x, point.y, point.z)) +
                          placed.position_m);
    Bounds reached{places_m.back(), places_m.back()};
    reached.grow(Vector3::Constant(static_cast<double>(point.reach)));
    if (places_m.size() == 1) bounds = reached;
    bounds.include(reached);
  }
  const auto scaled = [](double value) {
    constexpr double kScale = kTilePointScale;
    return static_cast<std::int16_t>(std::round(std::clamp(value, -1.0, 1.0) * kScale));
  };
  const Lattice lattice(bounds);
  std::vector<TilePoint> parts;
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const CloudQuadric& quadric = surface.quadric(i);
    const double reach_m = points[i].reach;
    const Vector3 n = R * surface.normal(i);
    const auto& [xx, xy, xz, yy, yz, zz] = quadric.curvature;
    Matrix3 own;
    own << xx, xy, xz, xy, yy, yz, xz, yz, zz;
    const Matrix3 H = reach_m * (R * own * R.transpose());
    parts.push_back({.place = lattice.point(places_m[i]),
                     .reach = std::max<std::uint16_t>(1, lattice.steps(reach_m)),
                     .normal = {scaled(n.x()), scaled(n.y()), scaled(n.z())},
                     .offset = scaled(static_cast<double>(quadric.offset) / reach_m),
                     .curvature = {scaled(H(0, 0)), scaled(H(0, 1)), scaled(H(0, 2)),
                                   scaled(H(1, 1)), scaled(H(1, 2)), scaled(H(2, 2))},
                     .stiffness_ratio = static_cast<float>(surface.stiffness_ratio(i))});
  }
  cut(std::span(parts), kMaxTilePoints, lattice.empty_tile(), tissue.tiles);
}

/// False if the surface is of another kind, or too large.
bool describe(const PlacedSurface& placed, DescribedTissue& tissue, TiledGeometry& geometry) {
  if (!(placed.surface->bounds().longest_side_m() < kLongestSide_m)) return false;
  if (const auto* mesh = dynamic_cast<const TriangleSurface*>(placed.surface.get())) {
    geometry.is_sheet = mesh->is_sheet();
    cut(*mesh, placed, tissue);
  } else if (const auto* cloud = dynamic_cast<const CloudSurface*>(placed.surface.get())) {
    geometry.is_cloud = true;
    cut(*cloud, placed, tissue);
  } else {
    return false;
  }
  std::vector<BoxTree::Item> items;
  for (const SurfaceTile& tile : tissue.tiles) {
    HeldTile held;
    held.take(tile);
    const Vector3 center_m = held.bounds.center_m();
    double radius_m = 0.0;
    for (std::size_t i = 0; i < tile.vertex_count; ++i) {
      radius_m = std::max(radius_m, (held.vertices_m[i] - center_m).norm());
    }
    for (std::size_t i = 0; i < tile.point_count; ++i) {
      radius_m = std::max(radius_m, (held.place_m(i) - center_m).norm() + held.points[i].reach_m);
    }
    items.push_back({held.bounds, center_m, static_cast<std::uint32_t>(items.size())});
    tissue.bounds.push_back(held.bounds);
    tissue.radii_m.push_back(radius_m);
  }
  tissue.tree = BoxTree(std::move(items), 1);
  return true;
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
          TiledGeometry tiled;
          if (!describe(form, tissue, tiled)) return false;
          description.geometry = tiled;
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
