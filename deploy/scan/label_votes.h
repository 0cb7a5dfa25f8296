// SPDX-License-Identifier: Apache-2.0
// label_votes.h — which label an element has: that of most voxels around its centre, near ones
// counting more.
#pragma once

#include <cstdint>
#include <vector>

#include "deploy/scan/label_map.h"
#include "physics_node/surfaces/tetrahedral_mesh.h"

namespace palpate::scan {

class LabelVotes {
 public:
  /// @param map  must outlive this
  explicit LabelVotes(const LabelMap& map) : map_(map) {}

  /// A region for each element, by the votes at its centre, with a handicap for each label such
  /// that the volumes of the regions are in proportion to `wanted`.
  /// @param index_of_m  from the frame of the mesh to indices
  /// @param segments    of the regions
  /// @param wanted      of each region, > 0 for those that have voxels
  [[nodiscard]] std::vector<std::uint16_t> shared_out(const physics::TetrahedralMesh& mesh,
                                                      const Eigen::Affine3d& index_of_m,
                                                      const std::vector<std::uint32_t>& segments,
                                                      const std::vector<double>& wanted) const;

 private:
  struct Vote {
    std::uint16_t number;
    double share;
  };
  /// Of all labels near this index, shares of the votes that are not for the background.
  /// @param edge_m  of the element: of large ones more voxels vote, so that the volumes of large
  ///     labels can be met by handicaps where no element has its centre at the boundary
  [[nodiscard]] std::vector<Vote> votes(const Vector3& index, double edge_m) const;

  const LabelMap& map_;
};

}  // namespace palpate::scan
