// SPDX-License-Identifier: Apache-2.0
// smooth_field.h — a smooth function that is positive within a body of voxels and negative outside:
// its zero surface has no stairs, and the centre of each voxel stays on its side.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "deploy/scan/label_map.h"

namespace palpate::scan {

struct Smoothing {
  /// Width (standard deviation) of the smoothing [m]; 0: the longest edge of a voxel.
  double width_m = 0.0;
  int rounds = 8;
  /// Voxels are averaged in blocks of 2^coarsening first, for fields of many more voxels than the
  /// mesh has nodes.
  int coarsening = 0;
};

class SmoothField {
 public:
  /// Alternates a low pass that keeps curved surfaces in place (2G − G²) with putting the centres
  /// of voxels back on their side; the last low pass is not put back.
  /// @param is_inside  for each number of LabelMap::voxels whether it is of the body; some voxel is
  SmoothField(const LabelMap& map, const std::vector<bool>& is_inside, const Smoothing& smoothing);

  /// −1 … 1; continuous. @param index  (i, j, k) of the label map, anywhere
  [[nodiscard]] double at(const Vector3& index) const noexcept;

  /// The value above which the field has this volume, in voxels; within ±`largest`.
  [[nodiscard]] double level_of(double voxels, double largest) const;

  /// Of the body in indices of the label map, half a voxel beyond the centres.
  [[nodiscard]] const Vector3& lowest() const noexcept { return lowest_; }
  [[nodiscard]] const Vector3& highest() const noexcept { return highest_; }

 private:
  void smooth(const Vector3& widths, std::vector<float>& values) const;

  std::array<std::int64_t, 3> size_{};
  Vector3 first_ = Vector3::Zero();  // index of the first value in the label map
  double step_ = 1.0;                // of the values in voxels
  std::vector<float> values_;
  Vector3 lowest_ = Vector3::Zero();
  Vector3 highest_ = Vector3::Zero();
};

}  // namespace palpate::scan
