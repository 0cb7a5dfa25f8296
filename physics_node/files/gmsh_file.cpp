// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "physics_node/files/file_text.h"
#include "physics_node/files/mesh_builder.h"
#include "physics_node/files/tetrahedral_files.h"

namespace palpate::physics {
namespace {

/// Gmsh's numbers for types of elements.
enum ElementType : std::int64_t { kTetrahedron = 4, kTetrahedronOfSecondOrder = 11 };
// volumes that are no tetrahedra of first or second order
constexpr std::array<std::int64_t, 11> kOtherVolumes{5, 6, 7, 12, 13, 14, 17, 18, 19, 29, 30};
// by the number of the type; 0: unknown
constexpr std::array<std::int64_t, 32> kNodesOfType{0,  2,  3,  4,  4, 8, 6,  5,  3,  6, 9,
                                                    10, 27, 18, 14, 1, 8, 20, 15, 13, 9, 10,
                                                    12, 15, 15, 21, 4, 5, 6,  20, 35, 56};

/// A file of any version: text, or binary but for headings and, before version 4, counts.
class MshReader {
 public:
  MshReader(std::string_view bytes, const std::string& file_name)
      : text_(bytes, file_name), builder_(text_) {}

  TetrahedralMesh read();

 private:
  /// An int of the file.
  std::int64_t whole(const char* what, std::int64_t min, std::int64_t max) {
    if (!is_binary_) return text_.integer(what, min, max);
    return within(what, text_.binary<std::int32_t>(what, endian_), min, max);
  }
  /// A size_t of version 4.
  std::int64_t long_whole(const char* what) {
    if (!is_binary_) return text_.integer(what, 0, kMaxTag);
    return within(what, text_.binary<std::int64_t>(what, endian_), 0, kMaxTag);
  }
  double real(const char* what) {
    if (!is_binary_) return text_.number(what);
    const double value = text_.binary<double>(what, endian_);
    if (!std::isfinite(value)) text_.fail_at_byte(std::string(what) + ": must be finite");
    return value;
  }
  Vector3 place() {
    const double x = real("x");
    const double y = real("y");
    const double z = real("z");
    return {x, y, z};
  }
  std::int64_t within(const char* what, std::int64_t value, std::int64_t min, std::int64_t max) {
    if (value < min || value > max) {
      text_.fail_at_byte(std::string(what) + " = " + std::to_string(value) + ": must be " +
                         std::to_string(min) + " … " + std::to_string(max));
    }
    return value;
  }
  std::int64_t count_4(const char* what) { return checked_count(text_, what, long_whole(what)); }
  /// In a line of its own, also where the rest is binary.
  std::int64_t count_line(const char* what) {
    const std::int64_t count = checked_count(text_, what, text_.integer(what, 0, kMaxTag));
    text_.rest_of_line();
    return count;
  }

  /// Behind the number of blocks: how many things in all, the least and the greatest number.
  void skip_totals() {
    if (is_binary_) {
      text_.skip_bytes(3 * sizeof(std::int64_t), "the numbers of all blocks");
    } else {
      text_.rest_of_line();
    }
  }

  void read_format();
  void read_names();
  void read_entities();
  void read_nodes();
  void read_nodes_4();
  void read_elements_1();
  void read_elements_2();
  void read_elements_2_binary();
  void read_elements_4();
  /// The first of so many tags, the physical group of an element of version 2; 0 if there is none.
  std::int64_t first_of(std::int64_t tags);
  /// The nodes of one element.
  void read_element(std::int64_t tag, std::int64_t type, std::int64_t physical);
  void skip_section(std::string_view section, const std::string& end);

  FileText text_;
  MeshBuilder builder_;
  int version_ = 1;  // which has no $MeshFormat
  bool is_binary_ = false;
  std::endian endian_ = std::endian::native;
  std::unordered_map<std::int64_t, std::int64_t> physical_of_;  // volumes of version 4
};

void MshReader::read_format() {
  const double number = text_.number("version");
  if (number != 2.2 && number != 2.0 && number != 2.1 && number != 4.1) {
    text_.fail("version of the mesh: must be 1, 2.2 or 4.1; save it as 4.1");
  }
  version_ = static_cast<int>(number);
  is_binary_ = text_.integer("file type", 0, 1) == 1;
  const std::int64_t size = text_.integer("data size", 1, 64);
  text_.rest_of_line();
  if (!is_binary_) return;
  if (size != 8) text_.fail("data size = " + std::to_string(size) + ": must be 8");
  const auto one = text_.binary<std::uint32_t>("byte order", std::endian::little);
  if (one != 1U && one != 0x01000000U) text_.fail_at_byte("byte order: must be the number 1");
  endian_ = one == 1U ? std::endian::little : std::endian::big;
}

/// Lines "dimension number "name"".
void MshReader::read_names() {
  const std::int64_t count = count_line("number of names");
  for (std::int64_t i = 0; i < count; ++i) {
    const std::int64_t dimension = text_.integer("dimension", 0, 3);
    const std::int64_t number = text_.integer("physical group", -kMaxTag, kMaxTag);
    const std::string_view rest = text_.rest_of_line();
    const std::size_t begin = rest.find('"');
    const std::size_t end = rest.rfind('"');
    if (begin == std::string_view::npos || end <= begin + 1) {
      text_.fail("the name of a physical group: must be in quotation marks, not empty");
    }
    if (dimension == 3) {
      builder_.name_region(number, std::string(rest.substr(begin + 1, end - begin - 1)));
    }
  }
}

/// Which physical volume each volume of version 4.1 is of; points, curves and surfaces are skipped.
void MshReader::read_entities() {
  std::array<std::int64_t, 4> counts{};
  for (std::int64_t& count : counts) count = count_4("number of entities");
  for (std::size_t dimension = 0; dimension < 4; ++dimension) {
    for (std::int64_t i = 0; i < counts[dimension]; ++i) {
      const std::int64_t entity = whole("entity", -kMaxTag, kMaxTag);
      for (int bound = 0; bound < (dimension == 0 ? 3 : 6); ++bound) real("bound");
      const std::int64_t groups = count_4("number of physical groups");
      for (std::int64_t g = 0; g < groups; ++g) {
        const std::int64_t physical = whole("physical group", -kMaxTag, kMaxTag);
        if (dimension == 3 && g == 0) physical_of_[entity] = physical;
      }
      if (dimension == 0) continue;
      const std::int64_t parts = count_4("number of bounding entities");
      for (std::int64_t part = 0; part < parts; ++part) {
        whole("bounding entity", -kMaxTag, kMaxTag);
      }
    }
  }
}

void MshReader::read_nodes() {  // versions 1 and 2
  const std::int64_t count = count_line("number of nodes");
  for (std::int64_t i = 0; i < count; ++i) {
    const std::int64_t tag = whole("node", 0, kMaxTag);
    builder_.add_node(tag, place());
  }
}

void MshReader::read_nodes_4() {
  const std::int64_t blocks = count_4("number of blocks");
  skip_totals();
  for (std::int64_t block = 0; block < blocks; ++block) {
    const std::int64_t dimension = whole("dimension", 0, 3);
    whole("entity", -kMaxTag, kMaxTag);
    const std::int64_t parametric = whole("parametric", 0, 1);
    std::vector<std::int64_t> tags(static_cast<std::size_t>(count_4("number of nodes")));
    for (std::int64_t& tag : tags) tag = long_whole("node");
    for (const std::int64_t tag : tags) {
      builder_.add_node(tag, place());
      for (std::int64_t i = 0; i < parametric * dimension; ++i) real("parameter");
    }
  }
}

void MshReader::read_element(std::int64_t tag, std::int64_t type, std::int64_t physical) {
  const auto complain = [&](const char* rule) {
    text_.fail("element " + std::to_string(tag) + " of type " + std::to_string(type) + ": " + rule);
  };
  if (std::find(kOtherVolumes.begin(), kOtherVolumes.end(), type) != kOtherVolumes.end()) {
    complain("volumes must be tetrahedra; mesh it with tetrahedra");
  }
  const auto node = [&] { return version_ == 4 ? long_whole("node") : whole("node", 0, kMaxTag); };
  const int line = text_.line();
  std::int64_t read = 0;
  if (type == kTetrahedron || type == kTetrahedronOfSecondOrder) {
    std::array<std::int64_t, 4> nodes{};
    for (std::int64_t& corner : nodes) corner = node();
    read = 4;
    builder_.add_tetrahedron(tag, nodes, physical, line);
  }
  if (!is_binary_) {
    text_.rest_of_line();
    return;
  }
  const std::size_t known = static_cast<std::size_t>(type);
  if (known >= kNodesOfType.size() || kNodesOfType[known] == 0) {
    complain("is not known; save the mesh as text with Mesh.Binary = 0");
  }
  for (; read < kNodesOfType[known]; ++read) node();
}

std::int64_t MshReader::first_of(std::int64_t tags) {
  std::int64_t first = 0;
  for (std::int64_t t = 0; t < tags; ++t) {
    const std::int64_t number = whole("tag", -kMaxTag, kMaxTag);
    if (t == 0) first = number;
  }
  return first;
}

void MshReader::read_elements_1() {
  const std::int64_t count = count_line("number of elements");
  for (std::int64_t i = 0; i < count; ++i) {
    const std::int64_t tag = whole("element", 0, kMaxTag);
    const std::int64_t type = whole("element type", 1, 1000);
    whole("region", -kMaxTag, kMaxTag);
    whole("region", -kMaxTag, kMaxTag);
    whole("number of nodes", 1, 1000);
    read_element(tag, type, 0);
  }
}

void MshReader::read_elements_2() {
  if (is_binary_) {
    read_elements_2_binary();
    return;
  }
  const std::int64_t count = count_line("number of elements");
  for (std::int64_t i = 0; i < count; ++i) {
    const std::int64_t tag = whole("element", 0, kMaxTag);
    const std::int64_t type = whole("element type", 1, 1000);
    const std::int64_t tags = whole("number of tags", 0, 1000);
    read_element(tag, type, first_of(tags));
  }
}

/// Blocks of elements of one type.
void MshReader::read_elements_2_binary() {
  const std::int64_t count = count_line("number of elements");
  for (std::int64_t i = 0; i < count;) {
    const std::int64_t type = whole("element type", 1, 1000);
    const std::int64_t of_block = whole("number of elements of a block", 1, count - i);
    const std::int64_t tags = whole("number of tags", 0, 1000);
    i += of_block;
    for (std::int64_t k = 0; k < of_block; ++k) {
      const std::int64_t tag = whole("element", 0, kMaxTag);
      read_element(tag, type, first_of(tags));
    }
  }
}

void MshReader::read_elements_4() {
  const std::int64_t blocks = count_4("number of blocks");
  skip_totals();
  for (std::int64_t block = 0; block < blocks; ++block) {
    const std::int64_t dimension = whole("dimension", 0, 3);
    const std::int64_t entity = whole("entity", -kMaxTag, kMaxTag);
    const auto volume = physical_of_.find(entity);
    const std::int64_t physical =
        dimension == 3 && volume != physical_of_.end() ? volume->second : 0;
    const std::int64_t type = whole("element type", 1, 1000);
    const std::int64_t count = count_4("number of elements");
    for (std::int64_t i = 0; i < count; ++i) {
      const std::int64_t tag = long_whole("element");
      read_element(tag, type, physical);
    }
  }
}

/// One that is not needed.
void MshReader::skip_section(std::string_view section, const std::string& end) {
  while (text_.rest_of_line() != end) {
    if (text_.is_at_end()) {
      text_.fail(shown_word(section) + ": has no end; is the file complete?");
    }
  }
}

TetrahedralMesh MshReader::read() {
  bool has_nodes = false;
  bool has_elements = false;
  for (std::string_view section = text_.word(); !section.empty(); section = text_.word()) {
    if (!section.starts_with('$')) {
      text_.fail("'" + shown_word(section) + "': must begin a section, such as $Nodes");
    }
    std::string end = "$End" + std::string(section.substr(1));
    text_.rest_of_line();
    if (section == "$MeshFormat") {
      read_format();
    } else if (section == "$PhysicalNames") {
      read_names();
    } else if (section == "$Entities" && version_ == 4) {
      read_entities();
    } else if (section == "$NOD" || section == "$Nodes") {
      if (section == "$NOD") end = "$ENDNOD";
      has_nodes = true;
      version_ == 4 ? read_nodes_4() : read_nodes();
    } else if (section == "$ELM" || section == "$Elements") {
      if (section == "$ELM") end = "$ENDELM";
      if (!has_nodes) text_.fail("elements must follow the nodes");
      has_elements = true;
      if (version_ == 4) {
        read_elements_4();
      } else if (version_ == 2) {
        read_elements_2();
      } else {
        read_elements_1();
      }
    } else {
      skip_section(section, end);
      continue;
    }
    const std::string_view word = text_.word();
    if (word != end) {
      text_.fail("'" + shown_word(word) + "': must be " + end + "; does the count fit?");
    }
  }
  if (!has_nodes || !has_elements) text_.fail("must have nodes and elements; is it a .msh file?");
  return builder_.take();
}

}  // namespace

TetrahedralMesh parse_msh(std::string_view bytes, const std::string& file_name) {
  return MshReader(bytes, file_name).read();
}

}  // namespace palpate::physics
