// SPDX-License-Identifier: Apache-2.0
// separated_mesh.h — a mesh of whole elements that is separated along faces between them: where a
// blade has cut.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "physics_node/elastic/mesh.h"

namespace palpate::elastic {

/// A face as one of its elements has it: 4 e + k, opposite to corner k of element e (kFaces).
using FaceSide = std::uint32_t;
inline constexpr std::int32_t kNoSide = -1;

/// By side: the same face as the element across has it; kNoSide on the surface.
[[nodiscard]] std::vector<std::int32_t> opposite_sides(const Mesh& mesh);

/// Faces of a mesh that are cut.
struct FaceCuts {
  std::span<const std::int32_t> opposite;  ///< opposite_sides()
  std::vector<char> is_cut;                ///< by side, the same for both; empty: none

  [[nodiscard]] bool is_there(FaceSide side) const noexcept {
    return !is_cut.empty() && is_cut[side] != 0;
  }
};

struct SeparatedMesh {
  Mesh mesh;
  /// By node: which of the whole mesh it is; ascending, the copies of one node one after the other.
  std::vector<std::uint32_t> nodes;
};

/// The mesh of these elements. Around a node of a cut face, elements that are joined by faces which
/// are not cut keep one copy of it; the node in the middle of an edge is another one where an end
/// of the edge is. No element changes its shape, so that there is no sliver. A face within a cut
/// that does not reach the surface of the body may still have one copy of each node: then its two
/// elements stay joined there.
/// @param elements  indices in `whole`, ascending
[[nodiscard]] SeparatedMesh separated_mesh(const Mesh& whole,
                                           std::span<const std::uint32_t> elements,
                                           const FaceCuts& cuts);

/// The cuts but for faces at whose edges more than two faces of the surface would meet: there would
/// be no inside. They are left for later, when the cut goes on.
[[nodiscard]] FaceCuts clean_cuts(const Mesh& whole, std::span<const std::uint32_t> elements,
                                  FaceCuts cuts);

/// Faces whose two elements do not share all three corners any more.
struct CutArea {
  std::size_t faces = 0;
  double area_m2 = 0.0;  ///< of one side
};
[[nodiscard]] CutArea cut_area(const Mesh& whole, std::span<const std::uint32_t> elements,
                               const FaceCuts& cuts, const Mesh& separated);

}  // namespace palpate::elastic
