// SPDX-License-Identifier: Apache-2.0
// mesh_builder.h — collects and checks a tetrahedral mesh while a file of any format is read.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <unordered_map>
#include <vector>

#include "physics_node/files/file_text.h"
#include "physics_node/surfaces/tetrahedral_mesh.h"

namespace palpate::physics {

/// The largest number by which a file may identify a node, an element or a group.
inline constexpr std::int64_t kMaxTag = std::numeric_limits<std::int64_t>::max() - 1;

/// A number of things of which each takes a byte or more of what is left of the file.
[[nodiscard]] std::int64_t checked_count(const FileText& text, const char* what,
                                         std::int64_t count);

/// The file identifies nodes by numbers of its own, and regions too.
class MeshBuilder {
 public:
  /// @param text  must outlive this; names the place of errors
  explicit MeshBuilder(FileText& text) : text_(text) {}

  void add_node(std::int64_t tag, const Vector3& place);
  /// @param region  its number in the file; 0: in none   @param line  of the element
  void add_tetrahedron(std::int64_t tag, const std::array<std::int64_t, 4>& nodes,
                       std::int64_t region, int line);
  /// Without a name a region is called by its number.
  void name_region(std::int64_t region, const std::string& name) {
    names_.insert_or_assign(region, name);
  }

  /// Checks the complete mesh and returns it without unused nodes.
  [[nodiscard]] TetrahedralMesh take();

 private:
  struct Source {
    std::int64_t tag = 0;
    int line = 0;
  };
  FileText& text_;
  TetrahedralMesh mesh_;
  std::unordered_map<std::int64_t, std::uint32_t> index_of_;
  std::vector<Source> sources_;
  std::unordered_map<std::int64_t, std::uint16_t> region_of_;
  std::unordered_map<std::int64_t, std::string> names_;
};

}  // namespace palpate::physics
