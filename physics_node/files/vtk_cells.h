// SPDX-License-Identifier: Apache-2.0
// vtk_cells.h — VTK's numbers for types of cells.
#pragma once

#include <cstdint>
#include <string>

namespace palpate::physics {

/// Of first or second order.
inline bool is_tetrahedron(std::int64_t type) { return type == 10 || type == 24; }
inline bool is_other_volume(std::int64_t type) {
  return (type >= 11 && type <= 16) || (type >= 25 && type <= 33);
}
inline std::string not_a_tetrahedron(std::int64_t type) {
  return " of type " + std::to_string(type) +
         ": volumes must be tetrahedra; mesh it with tetrahedra";
}

}  // namespace palpate::physics
