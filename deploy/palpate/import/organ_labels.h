// SPDX-License-Identifier: Apache-2.0
// organ_labels.h — the synthetic organ as a segmentation of a scan that never was: for trying out
// `palpate import`.
#pragma once

#include <string>

#include "common/core/vector.h"

namespace palpate {

struct OrganLabels {
  Vector3 voxel_mm{2.0, 2.0, 2.0};
  double oblique_degrees = 0.0;  ///< the grid is turned by this about an axis askew to all
  bool has_thin_lobe = false;    ///< 40 × 40 × 4 mm at the patient's left
  static constexpr double kMostVoxels = 150e6;
};

/// The body of organ.h with x to the patient's left, y to the head, z to the front: labels 1
/// "liver", 2 "tumor", a ball of 7 mm radius 12 mm above the middle, 3 "ligament", all below −15
/// mm. As Slicer's `.seg.nrrd`, or as NIfTI-1 (without names) if `is_nifti`; not compressed.
/// @throws SetupError  more than kMostVoxels voxels
[[nodiscard]] std::string organ_labels_text(const OrganLabels& labels, bool is_nifti);

}  // namespace palpate
