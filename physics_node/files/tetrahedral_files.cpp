// SPDX-License-Identifier: Apache-2.0
#include "physics_node/files/tetrahedral_files.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>
#include <unordered_map>

#include "physics_node/files/file_text.h"

namespace palpate::physics {
namespace {

constexpr std::int64_t kMostListed = 1'000'000'000;
constexpr std::size_t kMostRegions = 65'535;
constexpr std::int64_t kMaxTag = std::numeric_limits<std::int64_t>::max() - 1;
// Six volumes over the cube of the longest edge; 0.7 for a regular tetrahedron.
constexpr double kFlattestElement = 1e-9;

/// Collects a mesh while it is read; the file identifies nodes by numbers of its own.
class Builder {
 public:
  explicit Builder(FileText& text) : text_(text) {}

  void add_node(std::int64_t tag, const Vector3& place) {
    if (!index_of_.emplace(tag, static_cast<std::uint32_t>(mesh_.nodes_m.size())).second) {
      text_.fail("node " + std::to_string(tag) + ": is given twice");
    }
    mesh_.nodes_m.push_back(place);
  }
  void add_tetrahedron(std::int64_t tag, const std::array<std::int64_t, 4>& nodes,
                       std::int64_t physical = 0) {
    std::array<std::uint32_t, 4> corners{};
    for (std::size_t i = 0; i < 4; ++i) {
      const auto node = index_of_.find(nodes[i]);
      if (node == index_of_.end()) {
        text_.fail("element " + std::to_string(tag) + ": node " + std::to_string(nodes[i]) +
                   ": does not exist");
      }
      corners[i] = node->second;
    }
    mesh_.tetrahedra.push_back(corners);
    sources_.push_back({tag, text_.line()});
    const auto [region, is_new] =
        region_of_.try_emplace(physical, static_cast<std::uint16_t>(region_of_.size()));
    if (is_new && region_of_.size() > kMostRegions) text_.fail("more than 65535 physical volumes");
    mesh_.regions.push_back(region->second);
  }
  void name_region(std::int64_t physical, const std::string& name) {
    names_.insert_or_assign(physical, name);
  }
  /// Of an entity of dimension 3 of version 4.
  void set_physical(std::int64_t entity, std::int64_t physical) { physical_of_[entity] = physical; }
  [[nodiscard]] std::int64_t physical_of(std::int64_t entity) const {
    const auto found = physical_of_.find(entity);
    return found == physical_of_.end() ? 0 : found->second;
  }

  /// Checks the complete mesh and returns it without unused nodes.
  TetrahedralMesh take() {
    if (mesh_.tetrahedra.empty()) text_.fail("has no tetrahedra; save the volume, not its surface");
    const auto name = [&](std::size_t i) { return "element " + std::to_string(sources_[i].tag); };

    std::size_t inverted = 0;
    std::size_t first_inverted = 0;
    for (std::size_t i = 0; i < mesh_.tetrahedra.size(); ++i) {
      const auto& corners = mesh_.tetrahedra[i];
      double longest2 = 0.0;
      for (std::size_t a = 0; a < 4; ++a) {
        for (std::size_t b = 0; b < a; ++b) {
          longest2 = std::max(
              longest2, (mesh_.nodes_m[corners[a]] - mesh_.nodes_m[corners[b]]).squaredNorm());
        }
      }
      const double volume = six_volumes_m3(mesh_.nodes_m, corners);
      if (!(std::abs(volume) > kFlattestElement * longest2 * std::sqrt(longest2))) {
        text_.fail_at_line(sources_[i].line, name(i) + ": has no volume; repair the mesh");
      }
      if (volume < 0.0 && inverted++ == 0) first_inverted = i;
    }
    if (inverted == mesh_.tetrahedra.size()) {
      for (auto& corners : mesh_.tetrahedra) std::swap(corners[0], corners[1]);
    } else if (inverted > 0) {
      text_.fail_at_line(
          sources_[first_inverted].line,
          name(first_inverted) + ": is inverted, as are " + std::to_string(inverted) + " of " +
              std::to_string(mesh_.tetrahedra.size()) + "; order the nodes of all elements alike");
    }
    drop_unused_nodes();
    if (region_of_.size() == 1 && region_of_.contains(0)) {
      mesh_.regions.clear();
      return std::move(mesh_);
    }
    mesh_.region_names.resize(region_of_.size());
    for (const auto& [physical, region] : region_of_) {
      const auto given = names_.find(physical);
      mesh_.region_names[region] = given == names_.end() ? std::to_string(physical) : given->second;
    }
    return std::move(mesh_);
  }

 private:
  void drop_unused_nodes() {
    constexpr std::uint32_t kUnused = 0xffffffff;
    std::vector<std::uint32_t> place(mesh_.nodes_m.size(), kUnused);
    std::vector<Vector3> used;
    for (auto& corners : mesh_.tetrahedra) {
      for (const std::uint32_t corner : corners) place[corner] = 0;
    }
    for (std::size_t i = 0; i < place.size(); ++i) {
      if (place[i] == kUnused) continue;
      place[i] = static_cast<std::uint32_t>(used.size());
      used.push_back(mesh_.nodes_m[i]);
    }
    for (auto& corners : mesh_.tetrahedra) {
      for (std::uint32_t& corner : corners) corner = place[corner];
    }
    mesh_.nodes_m = std::move(used);
  }

  struct Source {
    std::int64_t tag = 0;
    int line = 0;
  };
  FileText& text_;
  TetrahedralMesh mesh_;
  std::unordered_map<std::int64_t, std::uint32_t> index_of_;
  std::vector<Source> sources_;
  std::unordered_map<std::int64_t, std::uint16_t> region_of_;  // of physical volumes
  std::unordered_map<std::int64_t, std::string> names_;
  std::unordered_map<std::int64_t, std::int64_t> physical_of_;
};

// --- Gmsh ---------------------------------------------------------------------------------------

Vector3 read_place(FileText& text) {
  const double x = text.number("x");
  const double y = text.number("y");
  const double z = text.number("z");
  return {x, y, z};
}

std::int64_t read_count(FileText& text, const char* what) {
  const std::int64_t count = text.integer(what, 0, kMostListed);
  if (count > static_cast<std::int64_t>(text.left())) {
    text.fail(std::string(what) + ": the file is too short for " + std::to_string(count));
  }
  return count;
}

/// Reads the nodes of one element, after its type.
void read_element(FileText& text, Builder& builder, std::int64_t tag, std::int64_t type,
                  std::int64_t physical) {
  // Gmsh type numbers of volume elements other than tetrahedra of first and second order
  constexpr std::array<std::int64_t, 11> kOtherVolumes{5, 6, 7, 12, 13, 14, 17, 18, 19, 29, 30};
  if (std::find(kOtherVolumes.begin(), kOtherVolumes.end(), type) != kOtherVolumes.end()) {
    text.fail("element " + std::to_string(tag) + " of type " + std::to_string(type) +
              ": volumes must be tetrahedra; mesh it with tetrahedra");
  }
  if (type == 4 || type == 11) {
    std::array<std::int64_t, 4> nodes{};
    for (std::int64_t& node : nodes) node = text.integer("node", 0, kMaxTag);
    builder.add_tetrahedron(tag, nodes, physical);
  }
  text.rest_of_line();
}

void read_nodes(FileText& text, Builder& builder) {  // versions 1 and 2
  const std::int64_t count = read_count(text, "number of nodes");
  for (std::int64_t i = 0; i < count; ++i) {
    const std::int64_t tag = text.integer("node", 0, kMaxTag);
    builder.add_node(tag, read_place(text));
  }
}

void read_elements_1(FileText& text, Builder& builder) {
  const std::int64_t count = read_count(text, "number of elements");
  for (std::int64_t i = 0; i < count; ++i) {
    const std::int64_t tag = text.integer("element", 0, kMaxTag);
    const std::int64_t type = text.integer("element type", 1, 1000);
    text.integer("region", -kMaxTag, kMaxTag);
    text.integer("region", -kMaxTag, kMaxTag);
    text.integer("number of nodes", 1, 1000);
    read_element(text, builder, tag, type, 0);
  }
}

void read_elements_2(FileText& text, Builder& builder) {
  const std::int64_t count = read_count(text, "number of elements");
  for (std::int64_t i = 0; i < count; ++i) {
    const std::int64_t tag = text.integer("element", 0, kMaxTag);
    const std::int64_t type = text.integer("element type", 1, 1000);
    const std::int64_t tags = text.integer("number of tags", 0, 1000);
    std::int64_t physical = 0;  // the first one
    for (std::int64_t t = 0; t < tags; ++t) {
      const std::int64_t number = text.integer("tag", -kMaxTag, kMaxTag);
      if (t == 0) physical = number;
    }
    read_element(text, builder, tag, type, physical);
  }
}

void read_nodes_4(FileText& text, Builder& builder) {
  const std::int64_t blocks = read_count(text, "number of blocks");
  text.rest_of_line();
  for (std::int64_t block = 0; block < blocks; ++block) {
    const std::int64_t dimension = text.integer("dimension", 0, 3);
    text.integer("entity", -kMaxTag, kMaxTag);
    const std::int64_t parametric = text.integer("parametric", 0, 1);
    const std::int64_t count = read_count(text, "number of nodes");
    std::vector<std::int64_t> tags(static_cast<std::size_t>(count));
    for (std::int64_t& tag : tags) tag = text.integer("node", 0, kMaxTag);
    for (const std::int64_t tag : tags) {
      builder.add_node(tag, read_place(text));
      for (std::int64_t i = 0; i < parametric * dimension; ++i) text.number("parameter");
    }
  }
}

void read_elements_4(FileText& text, Builder& builder) {
  const std::int64_t blocks = read_count(text, "number of blocks");
  text.rest_of_line();
  for (std::int64_t block = 0; block < blocks; ++block) {
    const std::int64_t dimension = text.integer("dimension", 0, 3);
    const std::int64_t entity = text.integer("entity", -kMaxTag, kMaxTag);
    const std::int64_t physical = dimension == 3 ? builder.physical_of(entity) : 0;
    const std::int64_t type = text.integer("element type", 1, 1000);
    const std::int64_t count = read_count(text, "number of elements");
    for (std::int64_t i = 0; i < count; ++i) {
      const std::int64_t tag = text.integer("element", 0, kMaxTag);
      read_element(text, builder, tag, type, physical);
    }
  }
}

/// Lines "dimension number "name"".
void read_names(FileText& text, Builder& builder) {
  const std::int64_t count = read_count(text, "number of names");
  text.rest_of_line();
  for (std::int64_t i = 0; i < count; ++i) {
    const std::int64_t dimension = text.integer("dimension", 0, 3);
    const std::int64_t number = text.integer("physical group", -kMaxTag, kMaxTag);
    const std::string_view rest = text.rest_of_line();
    const std::size_t begin = rest.find('"');
    const std::size_t end = rest.rfind('"');
    if (begin == std::string_view::npos || end <= begin + 1) {
      text.fail("the name of a physical group: must be in quotation marks, not empty");
    }
    if (dimension == 3)
      builder.name_region(number, std::string(rest.substr(begin + 1, end - begin - 1)));
  }
}

/// Which physical volume each volume of version 4.1 is of; points, curves and surfaces are skipped.
void read_entities(FileText& text, Builder& builder) {
  std::array<std::int64_t, 4> counts{};
  for (std::int64_t& count : counts) count = read_count(text, "number of entities");
  for (std::size_t dimension = 0; dimension < 4; ++dimension) {
    for (std::int64_t i = 0; i < counts[dimension]; ++i) {
      const std::int64_t entity = text.integer("entity", -kMaxTag, kMaxTag);
      for (int bound = 0; bound < (dimension == 0 ? 3 : 6); ++bound) text.number("bound");
      const std::int64_t groups = read_count(text, "number of physical groups");
      for (std::int64_t g = 0; g < groups; ++g) {
        const std::int64_t physical = text.integer("physical group", -kMaxTag, kMaxTag);
        if (dimension == 3 && g == 0) builder.set_physical(entity, physical);
      }
      if (dimension == 0) continue;
      const std::int64_t parts = read_count(text, "number of bounding entities");
      for (std::int64_t part = 0; part < parts; ++part) {
        text.integer("bounding entity", -kMaxTag, kMaxTag);
      }
    }
  }
}

}  // namespace

TetrahedralMesh parse_msh(std::string_view bytes, const std::string& file_name) {
  FileText text(bytes, file_name);
  Builder builder(text);
  int version = 1;  // which has no $MeshFormat
  bool has_nodes = false;
  bool has_elements = false;
  for (std::string_view section = text.word(); !section.empty(); section = text.word()) {
    if (!section.starts_with('$')) {
      text.fail("'" + shown_word(section) + "': must begin a section, such as $Nodes");
    }
    std::string end = "$End" + std::string(section.substr(1));
    if (section == "$MeshFormat") {
      const double number = text.number("version");
      if (number != 2.2 && number != 2.0 && number != 2.1 && number != 4.1) {
        text.fail("version of the mesh: must be 1, 2.2 or 4.1; save it as 4.1");
      }
      version = static_cast<int>(number);
      if (text.integer("file type", 0, 1) == 1) {
        text.fail("is binary: must be ASCII; save it with Mesh.Binary = 0");
      }
      text.rest_of_line();
    } else if (section == "$PhysicalNames") {
      read_names(text, builder);
    } else if (section == "$Entities" && version == 4) {
      read_entities(text, builder);
    } else if (section == "$NOD" || section == "$Nodes") {
      if (section == "$NOD") end = "$ENDNOD";
      has_nodes = true;
      version == 4 ? read_nodes_4(text, builder) : read_nodes(text, builder);
    } else if (section == "$ELM" || section == "$Elements") {
      if (section == "$ELM") end = "$ENDELM";
      if (!has_nodes) text.fail("elements must follow the nodes");
      has_elements = true;
      if (version == 4) {
        read_elements_4(text, builder);
      } else if (version == 2) {
        read_elements_2(text, builder);
      } else {
        read_elements_1(text, builder);
      }
    } else {
      // a section that is not needed
      while (true) {
        if (text.is_at_end())
          text.fail(shown_word(section) + ": has no end; is the file complete?");
        std::string_view line = text.rest_of_line();
        if (line == end) break;
      }
      continue;
    }
    const std::string_view word = text.word();
    if (word != end) {
      text.fail("'" + shown_word(word) + "': must be " + end + "; does the count fit?");
    }
  }
  if (!has_nodes || !has_elements) text.fail("must have nodes and elements; is it a .msh file?");
  return builder.take();
}

// --- VTK ----------------------------------------------------------------------------------------

namespace {

/// Values of a legacy VTK file: text, or big-endian binary.
class VtkValues {
 public:
  VtkValues(FileText& text, bool is_ascii) : text_(text), is_ascii_(is_ascii) {}

  double real(std::string_view type, const char* what) {
    if (is_ascii_) return text_.number(what);
    const double value = type == "float"
                             ? static_cast<double>(text_.binary<float>(what, std::endian::big))
                             : text_.binary<double>(what, std::endian::big);
    if (!std::isfinite(value)) text_.fail_at_byte(std::string(what) + ": must be finite");
    return value;
  }
  std::int64_t integer(bool is_long, const char* what) {
    if (is_ascii_) return text_.integer(what, 0, kMaxTag);
    return is_long ? text_.binary<std::int64_t>(what, std::endian::big)
                   : std::int64_t{text_.binary<std::int32_t>(what, std::endian::big)};
  }

 private:
  FileText& text_;
  bool is_ascii_;
};

/// The cells in sequence: for each the number of nodes, then the nodes.
std::vector<std::int64_t> read_cells(FileText& text, VtkValues& values, std::int64_t& count) {
  count = read_count(text, "number of cells");
  const std::int64_t size = read_count(text, "size of cells");
  text.rest_of_line();
  std::vector<std::int64_t> cells;

  // version 5: offsets, then nodes
  FileText ahead = text;
  if (ahead.word() == "OFFSETS") {
    const auto read_array = [&](const char* name, std::int64_t length) {
      if (text.word() != name) text.fail(std::string("must be ") + name);
      const std::string_view type = text.word_of_line();
      const bool is_long = type == "vtktypeint64";
      if (!is_long && type != "vtktypeint32") {
        text.fail("type '" + shown_word(type) + "': must be vtktypeint64 or vtktypeint32");
      }
      text.rest_of_line();
      std::vector<std::int64_t> array(static_cast<std::size_t>(length));
      for (std::int64_t& value : array) value = values.integer(is_long, name);
      return array;
    };
    const std::vector<std::int64_t> offsets = read_array("OFFSETS", count);
    const std::vector<std::int64_t> nodes = read_array("CONNECTIVITY", size);
    count = std::max<std::int64_t>(count - 1, 0);
    for (std::size_t i = 0; i + 1 < offsets.size(); ++i) {
      if (offsets[i] < 0 || offsets[i + 1] < offsets[i] || offsets[i + 1] > size) {
        text.fail("OFFSETS: must increase from 0 to the size");
      }
      cells.push_back(offsets[i + 1] - offsets[i]);
      cells.insert(cells.end(), nodes.begin() + offsets[i], nodes.begin() + offsets[i + 1]);
    }
    return cells;
  }
  cells.resize(static_cast<std::size_t>(size));
  for (std::int64_t& value : cells) value = values.integer(false, "cell");
  return cells;
}

}  // namespace

TetrahedralMesh parse_vtk(std::string_view bytes, const std::string& file_name) {
  FileText text(bytes, file_name);
  if (!text.rest_of_line().starts_with("# vtk DataFile Version")) {
    text.fail_at_line(1, "must begin with '# vtk DataFile Version'; save it as legacy VTK");
  }
  text.rest_of_line();  // title
  const std::string_view form = text.word();
  if (form != "ASCII" && form != "BINARY") {
    text.fail("'" + shown_word(form) + "': must be ASCII or BINARY");
  }
  VtkValues values(text, form == "ASCII");
  Builder builder(text);
  std::int64_t count = -1;
  std::vector<std::int64_t> cells;
  bool has_points = false;
  while (true) {
    const std::string_view keyword = text.word();
    if (keyword.empty()) text.fail("must have POINTS, CELLS and CELL_TYPES; is the file complete?");
    if (keyword == "DATASET") {
      const std::string_view kind = text.word();
      if (kind != "UNSTRUCTURED_GRID") {
        text.fail("DATASET " + shown_word(kind) + ": must be UNSTRUCTURED_GRID");
      }
    } else if (keyword == "POINTS") {
      if (has_points) text.fail("POINTS: are given twice");
      has_points = true;
      const std::int64_t points = read_count(text, "number of points");
      const std::string_view type = text.word_of_line();
      if (type != "float" && type != "double") {
        text.fail("type '" + shown_word(type) + "': points must be float or double");
      }
      text.rest_of_line();
      for (std::int64_t i = 0; i < points; ++i) {
        const double x = values.real(type, "x");
        const double y = values.real(type, "y");
        const double z = values.real(type, "z");
        builder.add_node(i, {x, y, z});
      }
    } else if (keyword == "CELLS") {
      cells = read_cells(text, values, count);
    } else if (keyword == "CELL_TYPES") {
      const std::int64_t types = text.integer("number of cell types", 0, kMostListed);
      if (types != count) text.fail("CELL_TYPES: must be as many as CELLS, and follow them");
      text.rest_of_line();
      break;
    } else {
      text.rest_of_line();  // METADATA and the like
    }
  }

  // VTK type numbers: 10 and 24 are tetrahedra of first and second order, 11 … 16 and 25 … 33 other
  // volumes
  std::size_t at = 0;
  for (std::int64_t cell = 0; cell < count; ++cell) {
    const std::int64_t type = values.integer(false, "cell type");
    const std::string name = "cell " + std::to_string(cell);
    if (at >= cells.size()) text.fail(name + ": CELLS has too few numbers");
    const std::int64_t nodes = cells[at];
    if (nodes < 0 || nodes > static_cast<std::int64_t>(cells.size() - at - 1)) {
      text.fail(name + ": has " + std::to_string(nodes) + " nodes, more than CELLS holds");
    }
    if (type == 10 || type == 24) {
      if (nodes < 4) text.fail(name + ": a tetrahedron must have 4 nodes");
      builder.add_tetrahedron(cell, {cells[at + 1], cells[at + 2], cells[at + 3], cells[at + 4]});
    } else if ((type >= 11 && type <= 16) || (type >= 25 && type <= 33)) {
      text.fail(name + " of type " + std::to_string(type) +
                ": volumes must be tetrahedra; mesh it with tetrahedra");
    }
    at += static_cast<std::size_t>(nodes) + 1;
  }
  return builder.take();
}

}  // namespace palpate::physics
