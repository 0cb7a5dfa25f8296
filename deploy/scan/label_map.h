// SPDX-License-Identifier: Apache-2.0
// label_map.h — a segmentation: for each voxel of a scan the segment that it belongs to, and where
// the voxels lie in the patient.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/vector.h"

namespace palpate::scan {

struct Segment {
  std::uint32_t value = 0;   ///< of its voxels in the file
  std::uint32_t layer = 0;   ///< of the file in which it has that value
  std::string name{};        ///< unique; "label 3" where the file gives none
  std::string code{};        ///< of a terminology, "SCT:10200004"; "": none
  std::uint64_t voxels = 0;  ///< that are its own in the map
};

struct LabelMap {
  std::array<std::uint32_t, 3> size{};  ///< voxels along i, j, k
  /// From (i, j, k), whole at the centres of voxels, to the patient's right, anterior, superior
  /// (RAS) [m]. Any regular matrix: oblique, mirrored, anisotropic, sheared.
  Eigen::Affine3d ras_of_index_m = Eigen::Affine3d::Identity();
  std::vector<Segment> segments{};
  /// i fastest: 0 for none, otherwise 1 + index of the segment.
  std::vector<std::uint16_t> voxels{};
  std::vector<std::string> notes{};  ///< what a user should know of how the file was understood

  [[nodiscard]] std::uint16_t at(std::int64_t i, std::int64_t j, std::int64_t k) const noexcept {
    return voxels[static_cast<std::size_t>((k * size[1] + j) * size[0] + i)];
  }
  /// Edges of a voxel [m].
  [[nodiscard]] Vector3 spacing_m() const { return ras_of_index_m.linear().colwise().norm(); }
  [[nodiscard]] double voxel_m3() const { return std::abs(ras_of_index_m.linear().determinant()); }
};

/// A map of more voxels, times layers, is refused.
inline constexpr std::uint64_t kMostVoxels = 300'000'000;
inline constexpr std::uint32_t kMostLayers = 64;

/// NIfTI-1 or NIfTI-2 in one file, plain or gzip.
/// Orientation: the matrix (sform) if its code says that it is valid, otherwise the quaternion
/// (qform); a file with neither is refused, because it does not say which side is left.
/// @throws SetupError  as "file: field = value: rule; remedy"
[[nodiscard]] LabelMap parse_nifti(std::string_view bytes, const std::string& name);

/// NRRD with an attached image, raw, gzip or text, in RAS, LAS or LPS; Slicer's `.seg.nrrd` with
/// names, label values, layers and terminology. Where segments of different layers overlap, a voxel
/// belongs to the segment that is smaller as a whole: a lesion within its organ.
/// @throws SetupError  as "file:line: field: rule; remedy"
[[nodiscard]] LabelMap parse_nrrd(std::string_view bytes, const std::string& name);

/// DICOM Segmentation, binary or fractional, not compressed; only in builds with PALPATE_DICOM.
/// Slices lie where frames are, at one distance; where segments overlap, as above.
/// @throws SetupError  as "file: field (group,element): rule; remedy"
[[nodiscard]] LabelMap parse_dicom_seg(std::string_view bytes, const std::string& name);

/// The format follows the name: .nii, .nii.gz, .nrrd, .dcm. @throws SetupError
[[nodiscard]] LabelMap load_label_map(const std::string& file);

/// Names segments that have none of their own by lines "value name", or those of ITK-SNAP's label
/// descriptions; '#' begins a comment.
/// @throws SetupError  as "file:line: …"
void name_segments(LabelMap& map, std::string_view text, const std::string& file_name);

// --- for readers --------------------------------------------------------------------------------

/// One number per voxel, as the file has it.
using Layer = std::vector<std::uint16_t>;

/// @return the value as a label. @throws SetupError  unless it is a whole number 0 … 65535
[[nodiscard]] std::uint16_t label_of(double value, std::uint64_t voxel, const std::string& name);

/// Throws SetupError unless 1 ≤ each size, their product · layers ≤ kMostVoxels, and the matrix
/// makes voxels of 1 µm … 100 mm.
void check_grid(const std::array<std::uint64_t, 3>& size, std::uint64_t layers,
                const Eigen::Affine3d& ras_of_index_m, const std::string& name);

/// @param table  segments of the file with value, layer, name and code; empty: one for each value
[[nodiscard]] LabelMap label_map_of(const std::array<std::uint64_t, 3>& size,
                                    const Eigen::Affine3d& ras_of_index_m,
                                    std::vector<Layer> layers, std::vector<Segment> table,
                                    const std::string& name);

}  // namespace palpate::scan
