// SPDX-License-Identifier: Apache-2.0
#include "deploy/scan/organ_mesh.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <utility>

#include "common/core/check.h"
#include "deploy/scan/label_votes.h"
#include "deploy/scan/stuffing.h"
#include "physics_node/elastic/mesh.h"

namespace palpate::scan {
namespace {

constexpr double kVolumeError = 1e-3;
constexpr double kLargestLevel = 0.6;  // of a field of −1 … 1
constexpr double kLeastCell = 0.2;     // of a voxel: smaller ones do not bring back what is gone
constexpr int kCoarsest = 2;
// A lobe is at least so many of the cubes at its surface thick.
constexpr double kCellsThick = 1.25;
// A field of more voxels for each cell of the lattice than this cubed is averaged first.
constexpr double kMostVoxelsPerCell = 8.0;
constexpr double kTetrahedraPerCube = 12.0;  // of a uniform lattice

double volume_m3(const physics::TetrahedralMesh& mesh) {
  double sixfold = 0.0;
  for (const auto& corners : mesh.tetrahedra)
    sixfold += physics::six_volumes_m3(mesh.nodes_m, corners);
  return sixfold / 6.0;
}

/// The body, and meshes of it.
class Mesher {
 public:
  Mesher(const LabelMap& map, const SmoothField& field, const OrganMeshing& meshing,
         double base_level)
      : map_(map),
        field_(field),
        base_level_(base_level),
        is_fine_(map.segments.size() + 1, false),
        meshing_(meshing),
        index_of_m_(map.ras_of_index_m.inverse()) {
    for (const std::uint32_t segment : meshing.fine) is_fine_[segment + 1] = true;
    for (int corner = 0; corner < 8; ++corner) {
      const Vector3 index((corner & 1 ? field.highest() : field.lowest()).x(),
                          (corner & 2 ? field.highest() : field.lowest()).y(),
                          (corner & 4 ? field.highest() : field.lowest()).z());
      const Vector3 place_m = map.ras_of_index_m * index;
      bounds_.lowest_m = corner == 0 ? place_m : Vector3(bounds_.lowest_m.cwiseMin(place_m));
      bounds_.highest_m = corner == 0 ? place_m : Vector3(bounds_.highest_m.cwiseMax(place_m));
    }
    // the surface at another level than 0 may lie a voxel further out
    const Vector3 margin_m = Vector3::Constant(2.0 * map.spacing_m().maxCoeff());
    bounds_.lowest_m -= margin_m;
    bounds_.highest_m += margin_m;
  }

  /// @param level  moves the surface where it is coarsest, relative to the base level
  [[nodiscard]] physics::TetrahedralMesh mesh(double cell_m, double level) const {
    Stuffing stuffing{.bounds = bounds_, .cell_m = cell_m, .coarsest = kCoarsest};
    stuffing.inside = [&](const Vector3& place_m) { return inside(place_m, level); };
    if (!meshing_.fine.empty()) {
      stuffing.coarsest_at = [&, cell_m](const Vector3& place_m) {
        return is_at_fine_boundary(place_m, cell_m) ? 0 : kCoarsest;
      };
    }
    if (meshing_.site_m) {
      stuffing.coarsest_at_surface = [&, cell_m, level](const Vector3& place_m) {
        const double distance_m = (place_m - *meshing_.site_m).norm();
        const int coarsest = distance_m < meshing_.site_radius_m         ? 0
                             : distance_m < 2.0 * meshing_.site_radius_m ? 1
                                                                         : kCoarsest;
        return coarsest == 0 ? 0
                             : std::min(coarsest, coarsest_of_thickness(place_m, cell_m, level));
      };
    }
    return stuffed(stuffing);
  }

  /// The mesh whose volume is that of the voxels.
  [[nodiscard]] physics::TetrahedralMesh mesh_of_volume(double cell_m, double wanted_m3,
                                                        double& level) const {
    double last_level = level;
    physics::TetrahedralMesh made = mesh(cell_m, level);
    double error = volume_m3(made) / wanted_m3 - 1.0;
    double slope = -1.0;  // of the error over the level, corrected from the second mesh on
    double last_error = error;
    for (int i = 0; i < 6 && std::abs(error) > kVolumeError; ++i) {
      const double next = std::clamp(level - error / slope, level - 0.3, level + 0.3);
      last_level = level;
      last_error = error;
      level = std::clamp(next, -kLargestLevel, kLargestLevel);
      if (level == last_level) break;
      made = mesh(cell_m, level);
      error = volume_m3(made) / wanted_m3 - 1.0;
      const double measured = (error - last_error) / (level - last_level);
      if (measured < 0.0) slope = measured;
    }
    return made;
  }

 private:
  [[nodiscard]] double inside(const Vector3& place_m, double level) const {
    return field_.at(index_of_m_ * place_m) - base_level_ - level * faceting(place_m);
  }

  /// The cubes that a thin lobe allows, so that it does not vanish between their nodes.
  /// @param place_m  at most a cell from the surface
  [[nodiscard]] int coarsest_of_thickness(const Vector3& place_m, double cell_m,
                                          double level) const {
    Vector3 inwards;
    for (int axis = 0; axis < 3; ++axis) {
      const Vector3 step_m = 0.5 * cell_m * Vector3::Unit(axis);
      inwards[axis] = inside(place_m + step_m, level) - inside(place_m - step_m, level);
    }
    if (!(inwards.norm() > 0.0)) return 0;
    inwards.normalize();
    constexpr double kStep = 0.25;  // of a cell
    double thickness = 0.0;         // in cells
    for (double at = -1.5; at < kCellsThick * (1 << kCoarsest); at += kStep) {
      if (inside(place_m + at * cell_m * inwards, level) > 0.0) {
        thickness += kStep;
      } else if (at > 1.0) {
        break;
      }
    }
    return thickness < 2.0 * kCellsThick ? 0 : thickness < 4.0 * kCellsThick ? 1 : kCoarsest;
  }

  /// How far flat facets lie inside a curved surface, relative to where they are largest: as the
  /// square of their size. Otherwise the surface would be lifted at the site to make up for the
  /// volume that is lost elsewhere.
  [[nodiscard]] double faceting(const Vector3& place_m) const {
    if (!meshing_.site_m) return 1.0;
    const double distance = (place_m - *meshing_.site_m).norm() / meshing_.site_radius_m;
    const double doublings =
        std::clamp((distance - 0.9) / 0.2, 0.0, 1.0) + std::clamp((distance - 1.9) / 0.2, 0.0, 1.0);
    return std::pow(4.0, doublings - kCoarsest);
  }

  /// Number of LabelMap::voxels of the nearest voxel.
  [[nodiscard]] std::uint16_t label_at(const Vector3& place_m) const {
    const Vector3 index = index_of_m_ * place_m;
    std::array<std::int64_t, 3> nearest{};
    for (std::size_t a = 0; a < 3; ++a) {
      const auto most = static_cast<double>(map_.size[a]) - 1.0;
      nearest[a] = static_cast<std::int64_t>(
          std::lround(std::clamp(index[static_cast<Eigen::Index>(a)], 0.0, most)));
    }
    return map_.at(nearest[0], nearest[1], nearest[2]);
  }

  [[nodiscard]] bool is_at_fine_boundary(const Vector3& place_m, double cell_m) const {
    const std::uint16_t here = label_at(place_m);
    if (here == 0) return false;
    for (int axis = 0; axis < 3; ++axis) {
      for (const double side : {-1.0, 1.0}) {
        Vector3 beside_m = place_m;
        beside_m[axis] += side * cell_m;
        const std::uint16_t there = label_at(beside_m);
        if (there != here && there != 0 && (is_fine_[here] || is_fine_[there])) return true;
      }
    }
    return false;
  }

  const LabelMap& map_;
  const SmoothField& field_;
  double base_level_;
  std::vector<bool> is_fine_;  // of the numbers of voxels
  const OrganMeshing& meshing_;
  Eigen::Affine3d index_of_m_;
  Bounds bounds_{};
};

}  // namespace

std::array<double, 6> face_angles_rad(const physics::TetrahedralMesh& mesh, std::size_t element) {
  const auto& corners = mesh.tetrahedra[element];
  std::array<Vector3, 4> outward;
  for (std::size_t k = 0; k < 4; ++k) {
    const auto at = [&](std::size_t i) {
      return mesh.nodes_m[corners[static_cast<std::size_t>(elastic::kFaces[k][i])]];
    };
    outward[k] = (at(1) - at(0)).cross(at(2) - at(0)).normalized();
  }
  std::array<double, 6> angles_rad{};
  std::size_t count = 0;
  for (std::size_t a = 0; a < 4; ++a) {
    for (std::size_t b = a + 1; b < 4; ++b) {
      angles_rad[count++] =
          std::numbers::pi - std::acos(std::clamp(outward[a].dot(outward[b]), -1.0, 1.0));
    }
  }
  return angles_rad;
}

FaceAngles face_angles_of(const physics::TetrahedralMesh& mesh) {
  FaceAngles angles{.least_rad = std::numbers::pi};
  constexpr double kDegrees = 180.0 / std::numbers::pi;
  for (std::size_t e = 0; e < mesh.tetrahedra.size(); ++e) {
    bool is_sliver = false;
    for (const double angle : face_angles_rad(mesh, e)) {
      angles.least_rad = std::min(angles.least_rad, angle);
      angles.largest_rad = std::max(angles.largest_rad, angle);
      ++angles.histogram[std::min<std::size_t>(17,
                                               static_cast<std::size_t>(kDegrees * angle / 10.0))];
      is_sliver = is_sliver || kDegrees * angle < kSliverAngle_degrees;
    }
    if (is_sliver) ++angles.slivers;
  }
  return angles;
}

std::vector<std::size_t> largest_part_of(const LabelMap& map,
                                         const std::function<bool(std::uint16_t)>& is_inside) {
  std::vector<bool> counts(map.segments.size() + 1);
  for (std::size_t n = 0; n < counts.size(); ++n)
    counts[n] = is_inside(static_cast<std::uint16_t>(n));
  const std::array<std::int64_t, 3> size{map.size[0], map.size[1], map.size[2]};
  const std::array<std::int64_t, 3> stride{1, size[0], size[0] * size[1]};
  std::vector<bool> is_seen(map.voxels.size());
  std::vector<std::size_t> part;
  std::vector<std::size_t> largest;
  for (std::size_t start = 0; start < map.voxels.size(); ++start) {
    if (!counts[map.voxels[start]] || is_seen[start]) continue;
    part.assign(1, start);
    is_seen[start] = true;
    for (std::size_t next = 0; next < part.size(); ++next) {
      const auto at = static_cast<std::int64_t>(part[next]);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::int64_t place = at / stride[axis] % size[axis];
        for (const int step : {-1, 1}) {
          if (place + step < 0 || place + step >= size[axis]) continue;
          const auto beside = static_cast<std::size_t>(at + step * stride[axis]);
          if (!counts[map.voxels[beside]] || is_seen[beside]) continue;
          is_seen[beside] = true;
          part.push_back(beside);
        }
      }
    }
    if (part.size() > largest.size()) std::swap(part, largest);
  }
  return largest;
}

std::vector<Region> keep_largest_part(LabelMap& map, const std::vector<std::uint32_t>& segments) {
  constexpr auto kOther = static_cast<std::uint32_t>(-1);
  std::vector<Region> regions;
  std::vector<std::uint32_t> region_of(map.segments.size() + 1, kOther);
  for (const std::uint32_t segment : segments) {
    region_of[segment + 1] = static_cast<std::uint32_t>(regions.size());
    regions.push_back({.segment = segment});
  }
  for (std::uint16_t& voxel : map.voxels) {
    if (region_of[voxel] == kOther) voxel = 0;
    if (voxel != 0) ++regions[region_of[voxel]].voxels;
  }
  std::vector<std::uint16_t> kept(map.voxels.size(), 0);
  for (const std::size_t at :
       largest_part_of(map, [](std::uint16_t voxel) { return voxel != 0; })) {
    kept[at] = map.voxels[at];
    regions[region_of[kept[at]]].voxels_m3 += map.voxel_m3();
  }
  for (std::size_t at = 0; at < kept.size(); ++at) {
    if (map.voxels[at] != kept[at]) ++regions[region_of[map.voxels[at]]].dropped_voxels;
  }
  map.voxels = std::move(kept);
  return regions;
}

OrganMesh organ_mesh_of(const LabelMap& map, std::vector<Region> regions,
                        const OrganMeshing& meshing) {
  OrganMesh organ;
  organ.regions = std::move(regions);
  std::vector<std::uint32_t> segments;
  for (const Region& region : organ.regions) segments.push_back(region.segment);
  double wanted_m3 = 0.0;
  for (const Region& region : organ.regions) wanted_m3 += region.voxels_m3;
  if (!(wanted_m3 > 0.0)) throw SetupError("the labels that were chosen have no voxels");

  // about: a uniform lattice of as many tetrahedra, halved because it is coarse inside
  double cell_m = meshing.cell_m.value_or(
      std::cbrt(kTetrahedraPerCube * wanted_m3 / static_cast<double>(meshing.tetrahedra)));
  Smoothing smoothing = meshing.smoothing;
  const double spacing_m = std::cbrt(map.voxel_m3());
  while (cell_m > 2.0 * kMostVoxelsPerCell * spacing_m * std::exp2(smoothing.coarsening))
    ++smoothing.coarsening;
  organ.smoothing_m = smoothing.width_m > 0.0
                          ? smoothing.width_m
                          : map.spacing_m().maxCoeff() * std::exp2(smoothing.coarsening);
  smoothing.width_m = organ.smoothing_m;
  std::vector<bool> is_inside(map.segments.size() + 1, false);
  for (const std::uint32_t segment : segments) is_inside[segment + 1] = true;
  const SmoothField field(map, is_inside, smoothing);
  const LabelVotes votes(map);
  const double base_level = field.level_of(wanted_m3 / map.voxel_m3(), kLargestLevel);
  const Mesher mesher(map, field, meshing, base_level);

  physics::TetrahedralMesh made;
  for (int i = 0; i < 12; ++i) {
    made = mesher.mesh_of_volume(cell_m, wanted_m3, organ.level);
    const double ratio =
        static_cast<double>(made.tetrahedra.size()) / static_cast<double>(meshing.tetrahedra);
    const bool is_last = meshing.cell_m || (ratio <= 1.0 && (ratio > 0.75 || i > 8));
    if (is_last) break;
    if (made.tetrahedra.empty()) {
      if (cell_m < kLeastCell * spacing_m) break;
      cell_m *= 0.7;
    } else {
      cell_m *= std::clamp(std::pow(ratio / 0.9, 1.0 / 2.6), 0.5, 2.0);
    }
  }
  if (made.tetrahedra.empty() && cell_m < kLeastCell * spacing_m) {
    throw SetupError(
        "the body is as thin as its voxels, and smoothing leaves nothing of it; resample the "
        "segmentation to smaller voxels, or choose more labels");
  }
  if (made.tetrahedra.empty()) {
    throw SetupError(
        "the cells are larger than the body; give a smaller --cell-mm, or more --tetrahedra");
  }
  organ.cell_m = cell_m;
  std::vector<std::uint32_t> kept;
  const double before_m3 = volume_m3(made);
  organ.mesh = one_solid(made, kept);
  organ.lost_m3 = before_m3 - volume_m3(organ.mesh);
  open_slivers(organ.mesh);
  organ.angles = face_angles_of(organ.mesh);
  // elements that overlap, where the surface passes between cubes of different size, add to the one
  // and not to the other
  const double mesh_m3 = volume_m3(organ.mesh);
  if (!(std::abs(physics::enclosed_volume_m3(physics::surface_of(organ.mesh)) - mesh_m3) <=
        1e-6 * mesh_m3)) {
    throw SetupError(
        "the lattice does not fit this body: elements overlap; give another --cell-mm");
  }

  // a region for each element
  std::vector<double> wanted;
  for (const Region& region : organ.regions) wanted.push_back(region.voxels_m3);
  const std::vector<std::uint16_t> winners =
      votes.shared_out(organ.mesh, map.ras_of_index_m.inverse(), segments, wanted);
  for (std::size_t e = 0; e < winners.size(); ++e) {
    Region& region = organ.regions[winners[e]];
    region.mesh_m3 += physics::six_volumes_m3(organ.mesh.nodes_m, organ.mesh.tetrahedra[e]) / 6.0;
    ++region.elements;
  }
  organ.mesh.regions = winners;
  for (const Region& region : organ.regions)
    organ.mesh.region_names.push_back(map.segments[region.segment].name);
  return organ;
}

physics::TriangleMesh surface_of_region(const physics::TetrahedralMesh& mesh,
                                        std::uint16_t region) {
  physics::TetrahedralMesh part;
  std::vector<std::uint32_t> node_of(mesh.nodes_m.size(), 0xffffffff);
  for (std::size_t e = 0; e < mesh.tetrahedra.size(); ++e) {
    if (mesh.regions[e] != region) continue;
    auto corners = mesh.tetrahedra[e];
    for (std::uint32_t& corner : corners) {
      std::uint32_t& node = node_of[corner];
      if (node == 0xffffffff) {
        node = static_cast<std::uint32_t>(part.nodes_m.size());
        part.nodes_m.push_back(mesh.nodes_m[corner]);
      }
      corner = node;
    }
    part.tetrahedra.push_back(corners);
  }
  return physics::surface_of(part);
}

}  // namespace palpate::scan
