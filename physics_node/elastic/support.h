// SPDX-License-Identifier: Apache-2.0
// support.h — whether a mesh is one body that is held: before anything is computed with it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "physics_node/elastic/mesh.h"

namespace palpate::elastic {

/// Why the body has no definite rest position, with the element and what to do, or "": an element
/// given twice; a face of more than two elements; a part that is not held. Parts are elements that
/// are joined by faces. A part is held by three nodes, not on a line, that are fixed or attached,
/// or belong to parts that are held: by fewer it is loose, or turns about a point or a hinge.
/// @param mesh  linear or quadratic
/// @param held_nodes  fixed or attached
[[nodiscard]] std::string complaint_about_support(const Mesh& mesh,
                                                  const std::vector<std::uint32_t>& held_nodes);

/// The elements of the parts that are not held, in the sense of complaint_about_support().
[[nodiscard]] std::vector<std::uint32_t> loose_elements(
    const Mesh& mesh, const std::vector<std::uint32_t>& held_nodes);

/// Around each edge where more than two faces of the surface meet: the elements there that are
/// joined by faces to less volume than others are. They turn about the edge as about a hinge, and
/// the surface has no inside there. Without them other edges may be like that.
[[nodiscard]] std::vector<std::uint32_t> hinged_elements(const Mesh& mesh);

}  // namespace palpate::elastic
