// SPDX-License-Identifier: Apache-2.0
#include "deploy/palpate/import/import_site.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>

#include "common/core/check.h"
#include "deploy/palpate/import/import_text.h"
#include "deploy/scan/organ_mesh.h"

namespace palpate {
namespace {

constexpr double kSame_m = 1e-6;

constexpr std::size_t kMostFileNameBytes = 60;
constexpr double kLeastBody_m = 0.001;
constexpr double kLargestBody_m = 5.0;

}  // namespace

std::string surface_name_of(const std::string& label) {
  std::string name = "surface_" + label.substr(0, kMostFileNameBytes);
  for (char& c : name) {
    const bool is_plain =
        (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-';
    if (!is_plain) c = '_';
  }
  return name;
}

std::string stl_text(const physics::TriangleMesh& surface) {
  std::string text = kStlBegin;
  text.resize(80, ' ');
  const auto append = [&](auto value) {
    text.append(reinterpret_cast<const char*>(&value), sizeof value);
  };
  append(static_cast<std::uint32_t>(surface.triangles.size()));
  for (const auto& corners : surface.triangles) {
    const auto& [a, b, c] = corners;
    const Vector3 normal = (surface.vertices_m[b] - surface.vertices_m[a])
                               .cross(surface.vertices_m[c] - surface.vertices_m[a])
                               .normalized();
    for (int i = 0; i < 3; ++i) append(static_cast<float>(normal[i]));
    for (const std::uint32_t corner : corners) {
      for (int i = 0; i < 3; ++i) append(static_cast<float>(surface.vertices_m[corner][i]));
    }
    append(std::uint16_t{0});
  }
  return text;
}

Column column_at(const physics::TriangleMesh& surface, double x, double y) {
  Column column;
  for (const auto& [ia, ib, ic] : surface.triangles) {
    const Vector3& a = surface.vertices_m[ia];
    const Vector3& b = surface.vertices_m[ib];
    const Vector3& c = surface.vertices_m[ic];
    const auto side = [&](const Vector3& p, const Vector3& q) {
      return (q.x() - p.x()) * (y - p.y()) - (q.y() - p.y()) * (x - p.x());
    };
    const Vector3 weights(side(b, c), side(c, a), side(a, b));
    if (!(weights.minCoeff() >= 0.0 || weights.maxCoeff() <= 0.0) || weights.sum() == 0.0) continue;
    const double z =
        (weights.x() * a.z() + weights.y() * b.z() + weights.z() * c.z()) / weights.sum();
    // a line through an edge or a node meets several triangles there
    if (z > column.top_m + kSame_m) {
      column.below_m = column.top_m;
      column.top_m = z;
    } else if (z < column.top_m - kSame_m) {
      column.below_m = std::max(column.below_m, z);
    }
  }
  return column;
}

void check_extent(const Bounds& bounds, const std::string& file) {
  const double extent_m = (bounds.highest_m - bounds.lowest_m).norm();
  if (extent_m >= kLeastBody_m && extent_m <= kLargestBody_m) return;
  throw SetupError(file + text_of(": the body is %.3g mm large: must be 1 mm to 5 m; check the "
                                  "unit of the voxels in the file, and the labels",
                                  1e3 * extent_m));
}

std::string missing_report(const scan::LabelMap& map, const Vector3& moved_m, const Bounds& mesh,
                           double cell_m) {
  double beyond_m = 0.0;
  for (std::uint32_t k = 0; k < map.size[2]; ++k) {
    for (std::uint32_t j = 0; j < map.size[1]; ++j) {
      for (std::uint32_t i = 0; i < map.size[0]; ++i) {
        if (map.at(i, j, k) == 0) continue;
        const Vector3 place_m = map.ras_of_index_m * Vector3(i, j, k) + moved_m;
        beyond_m = std::max({beyond_m, (place_m - mesh.highest_m).maxCoeff(),
                             (mesh.lowest_m - place_m).maxCoeff()});
      }
    }
  }
  if (beyond_m <= cell_m) return "";
  return text_of(
      "  WARNING: the mesh ends %.0f mm before the voxels do: what is thinner than a cell, or "
      "than a slice of the scan, is missing; give a smaller --cell-mm, or more --tetrahedra\n",
      1e3 * beyond_m);
}

Site site_of(const scan::LabelMap& map, const std::optional<std::uint32_t>& target) {
  const auto place_of = [&](std::size_t at) {
    const std::size_t row = at / map.size[0];
    const std::size_t layer = row / map.size[1];
    return Vector3(map.ras_of_index_m * Vector3(static_cast<double>(at % map.size[0]),
                                                static_cast<double>(row % map.size[1]),
                                                static_cast<double>(layer)));
  };
  const std::vector<std::size_t> part = scan::largest_part_of(
      map, [&](std::uint16_t voxel) { return target ? voxel == *target + 1 : voxel != 0; });
  Site site;
  for (const std::size_t at : part) site.centre_m += place_of(at);
  site.centre_m /= static_cast<double>(std::max<std::size_t>(part.size(), 1));
  const double near_m = 1.5 * map.spacing_m().maxCoeff();
  double top = -std::numeric_limits<double>::infinity();
  double nearest_m = std::numeric_limits<double>::infinity();
  for (std::size_t at = 0; at < map.voxels.size(); ++at) {
    if (map.voxels[at] == 0) continue;
    const Vector3 place_m = place_of(at);
    // above the centre, or, in a body that is hollow there, as near as there is one
    const double aside_m = std::max(near_m, (place_m - site.centre_m).head<2>().norm());
    if (aside_m > nearest_m || (aside_m == nearest_m && place_m.z() <= top)) continue;
    nearest_m = aside_m;
    top = place_m.z();
    site.top_m = aside_m == near_m ? Vector3(site.centre_m.x(), site.centre_m.y(), top) : place_m;
  }
  return site;
}

Matrix3 world_of_ras(const std::string& up) {
  // rows: x, y, z of W in right, anterior, superior
  const auto frame = [](const Vector3& y, const Vector3& z) {
    Matrix3 rows;
    rows.row(0) = y.cross(z);
    rows.row(1) = y;
    rows.row(2) = z;
    return rows;
  };
  const Vector3 anterior = Vector3::UnitY();
  const Vector3 superior = Vector3::UnitZ();
  if (up == "anterior") return frame(superior, anterior);
  if (up == "posterior") return frame(superior, -anterior);
  if (up == "right") return frame(superior, Vector3::UnitX());
  if (up == "left") return frame(superior, -Vector3::UnitX());
  if (up == "superior") return frame(anterior, superior);
  if (up == "inferior") return frame(anterior, -superior);
  throw SetupError("--up " + up +
                   ": must be anterior, posterior, right, left, superior or inferior");
}

Vector3 scan_gravity_m_per_s2(const std::string& posture) {
  const std::map<std::string, Vector3> down = {
      {"supine", -Vector3::UnitY()}, {"prone", Vector3::UnitY()},     {"left", -Vector3::UnitX()},
      {"right", Vector3::UnitX()},   {"standing", -Vector3::UnitZ()}, {"none", Vector3::Zero()}};
  const auto found = down.find(posture);
  if (found == down.end()) {
    throw SetupError("--scanned " + posture +
                     ": must be supine, prone, left, right, standing or none");
  }
  return kGravity_m_per_s2 * found->second;
}

}  // namespace palpate
