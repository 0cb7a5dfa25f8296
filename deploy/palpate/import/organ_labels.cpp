// SPDX-License-Identifier: Apache-2.0
#include "deploy/palpate/import/organ_labels.h"

#include <Eigen/Geometry>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <numbers>

#include "common/core/check.h"
#include "deploy/palpate/organ.h"

namespace palpate {
namespace {

// Everything lies within this box around the origin.
const Vector3 kHalf_m(0.09, 0.06, 0.045);
constexpr double kLobe_m = 0.04;

char label_at(const Vector3& p, bool has_thin_lobe) {
  const bool is_in_lobe = has_thin_lobe && p.x() > 0.0 && p.x() < 0.045 + kLobe_m &&
                          std::abs(p.y()) < 0.5 * kLobe_m && std::abs(p.z()) < 0.002;
  if (!is_in_organ(p) && !is_in_lobe) return 0;
  if ((p - Vector3(0.02, 0.005, 0.012)).norm() < 0.007) return 2;
  return p.z() < -0.015 ? 3 : 1;
}

struct Grid {
  std::array<std::uint32_t, 3> size{};
  Matrix3 steps_mm;   // columns: in right, anterior, superior
  Vector3 origin_mm;  // the centre of the first voxel
};

Grid grid_of(const OrganLabels& labels) {
  Grid grid;
  const Matrix3 turned = Eigen::AngleAxisd(labels.oblique_degrees * std::numbers::pi / 180.0,
                                           Vector3(1, 2, 3).normalized())
                             .toRotationMatrix();
  // right, anterior, superior of x, y, z
  Matrix3 ras;
  ras << -1, 0, 0, 0, 0, 1, 0, 1, 0;
  double voxels = 1.0;
  Vector3 half_mm;
  for (int a = 0; a < 3; ++a) {
    // of the turned box
    half_mm[a] = 1e3 * kHalf_m.dot(turned.col(a).cwiseAbs());
    const double count = std::ceil(2.0 * half_mm[a] / labels.voxel_mm[a]);
    voxels *= count;
    if (!(voxels <= OrganLabels::kMostVoxels))
      throw SetupError("--voxel-mm: more than 150 million voxels; give larger ones");
    grid.size[static_cast<std::size_t>(a)] = static_cast<std::uint32_t>(count);
  }
  grid.steps_mm = ras * turned * Matrix3(labels.voxel_mm.asDiagonal());
  grid.origin_mm = ras * turned * -half_mm;
  return grid;
}

std::string voxels_of(const OrganLabels& labels, const Grid& grid) {
  Matrix3 body_of_ras;  // the inverse of `ras` above
  body_of_ras << -1, 0, 0, 0, 0, 1, 0, 1, 0;
  std::string voxels;
  voxels.reserve(std::size_t{grid.size[0]} * grid.size[1] * grid.size[2]);
  for (std::uint32_t k = 0; k < grid.size[2]; ++k) {
    for (std::uint32_t j = 0; j < grid.size[1]; ++j) {
      for (std::uint32_t i = 0; i < grid.size[0]; ++i) {
        const Vector3 place_mm = grid.origin_mm + grid.steps_mm * Vector3(i, j, k);
        voxels += label_at(1e-3 * (body_of_ras * place_mm), labels.has_thin_lobe);
      }
    }
  }
  return voxels;
}

std::string nifti_header(const Grid& grid) {
  std::string bytes(352, '\0');
  const auto put = [&](std::size_t offset, auto value) {
    for (std::size_t i = 0; i < sizeof value; ++i) {
      // little-endian, whatever the machine is
      std::array<unsigned char, sizeof value> raw{};
      std::memcpy(raw.data(), &value, sizeof value);
      bytes[offset + i] = static_cast<char>(
          raw[std::endian::native == std::endian::little ? i : sizeof value - 1 - i]);
    }
  };
  put(0, std::int32_t{348});
  put(40, std::int16_t{3});
  for (std::size_t a = 0; a < 3; ++a) put(42 + 2 * a, static_cast<std::int16_t>(grid.size[a]));
  for (std::size_t a = 3; a < 7; ++a) put(42 + 2 * a, std::int16_t{1});
  put(70, std::int16_t{2});  // unsigned char
  put(72, std::int16_t{8});
  put(76, 1.0F);
  for (int a = 0; a < 3; ++a) {
    put(80 + 4 * static_cast<std::size_t>(a), static_cast<float>(grid.steps_mm.col(a).norm()));
  }
  put(108, 352.0F);
  bytes[123] = 2;  // mm
  put(254, std::int16_t{1});
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      put(280 + 16 * static_cast<std::size_t>(row) + 4 * static_cast<std::size_t>(column),
          static_cast<float>(column < 3 ? grid.steps_mm(row, column) : grid.origin_mm[row]));
    }
  }
  std::memcpy(bytes.data() + 344, "n+1", 4);
  return bytes;
}

std::string nrrd_header(const Grid& grid) {
  const auto vector_text = [](const Vector3& ras) {
    std::array<char, 100> text{};
    std::snprintf(text.data(), text.size(), "(%.9g,%.9g,%.9g)", -ras.x(), -ras.y(), ras.z());
    return std::string(text.data());
  };
  std::string text =
      "NRRD0004\ntype: unsigned char\ndimension: 3\nspace: left-posterior-superior\n";
  text += "sizes: " + std::to_string(grid.size[0]) + " " + std::to_string(grid.size[1]) + " " +
          std::to_string(grid.size[2]) + "\nspace directions:";
  for (int a = 0; a < 3; ++a) text += " " + vector_text(grid.steps_mm.col(a));
  text +=
      "\nspace units: \"mm\" \"mm\" \"mm\"\nkinds: domain domain domain\nencoding: raw\n"
      "space origin: " +
      vector_text(grid.origin_mm) + "\n";
  const std::array<const char*, 3> names{"liver", "tumor", "ligament"};
  for (std::size_t s = 0; s < names.size(); ++s) {
    const std::string segment = "Segment" + std::to_string(s);
    text += segment + "_ID:=Segment_" + std::to_string(s + 1) + "\n" + segment +
            "_LabelValue:=" + std::to_string(s + 1) + "\n" + segment + "_Layer:=0\n" + segment +
            "_Name:=" + names[s] + "\n";
  }
  return text + "\n";
}

}  // namespace

std::string organ_labels_text(const OrganLabels& labels, bool is_nifti) {
  const Grid grid = grid_of(labels);
  return (is_nifti ? nifti_header(grid) : nrrd_header(grid)) + voxels_of(labels, grid);
}

}  // namespace palpate
