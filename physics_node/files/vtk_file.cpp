// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "physics_node/files/cell_regions.h"
#include "physics_node/files/file_text.h"
#include "physics_node/files/mesh_builder.h"
#include "physics_node/files/tetrahedral_files.h"
#include "physics_node/files/vtk_cells.h"

namespace palpate::physics {
namespace {

/// Legacy VTK: text, or big-endian binary but for its keywords.
class VtkReader {
 public:
  VtkReader(std::string_view bytes, const std::string& file_name)
      : text_(bytes, file_name), builder_(text_) {}

  TetrahedralMesh read();

 private:
  struct Cell {
    std::int64_t type = 0;
    std::size_t begin = 0;  ///< of its nodes in cells_
    int line = 0;
  };

  /// The next value of an array of this type.
  double value(std::string_view type, const char* what);
  std::int64_t integer(bool is_long, const char* what) {
    if (is_ascii_) return text_.integer(what, 0, kMaxTag);
    return is_long ? text_.binary<std::int64_t>(what, std::endian::big)
                   : std::int64_t{text_.binary<std::int32_t>(what, std::endian::big)};
  }
  std::int64_t count(const char* what) {
    return checked_count(text_, what, text_.integer(what, 0, kMaxTag));
  }

  void read_points();
  void read_cells();
  std::vector<std::int64_t> read_index_array(const char* name, std::int64_t length);
  void read_types();
  [[nodiscard]] std::string_view next_keyword() const {
    FileText ahead = text_;
    return ahead.word();
  }
  /// To the blank line that ends it.
  void skip_metadata() {
    text_.rest_of_line();
    while (!text_.is_at_end() && !text_.rest_of_line().empty()) {
    }
  }
  void read_attributes(bool is_of_cells);
  void read_scalars(std::int64_t things, bool is_of_cells);
  void read_field(std::int64_t things, bool is_of_cells);
  /// `values` of each cell or point. @param is_of_cells  keep them: they may be the regions
  void read_array(const std::string& name, std::string_view type, std::int64_t values,
                  std::int64_t things, bool is_of_cells);
  void add_tetrahedra();

  FileText text_;
  MeshBuilder builder_;
  bool is_ascii_ = true;
  std::int64_t points_ = -1;
  std::vector<std::int64_t> cells_;  // of each cell the number of nodes, then the nodes
  std::int64_t cell_count_ = -1;
  std::vector<Cell> typed_;
  CellRegions regions_;
};

double VtkReader::value(std::string_view type, const char* what) {
  if (is_ascii_) return text_.number(what);
  constexpr auto kBig = std::endian::big;
  if (type == "float") return static_cast<double>(text_.binary<float>(what, kBig));
  if (type == "double") return text_.binary<double>(what, kBig);
  if (type == "char") return text_.binary<std::int8_t>(what, kBig);
  if (type == "unsigned_char") return text_.binary<std::uint8_t>(what, kBig);
  if (type == "short") return text_.binary<std::int16_t>(what, kBig);
  if (type == "unsigned_short") return text_.binary<std::uint16_t>(what, kBig);
  if (type == "int" || type == "vtktypeint32") return text_.binary<std::int32_t>(what, kBig);
  if (type == "unsigned_int" || type == "vtktypeuint32")
    return text_.binary<std::uint32_t>(what, kBig);
  if (type == "long" || type == "vtktypeint64" || type == "vtkIdType") {
    return static_cast<double>(text_.binary<std::int64_t>(what, kBig));
  }
  if (type == "unsigned_long" || type == "vtktypeuint64") {
    return static_cast<double>(text_.binary<std::uint64_t>(what, kBig));
  }
  text_.fail(std::string(what) + ": type '" + shown_word(type) + "': is not known");
}

void VtkReader::read_points() {
  if (points_ >= 0) text_.fail("POINTS: are given twice");
  points_ = count("number of points");
  const std::string_view type = text_.word_of_line();
  if (type != "float" && type != "double") {
    text_.fail("type '" + shown_word(type) + "': points must be float or double");
  }
  text_.rest_of_line();
  const auto finite = [&](const char* what) {
    const double place = value(type, what);
    if (!std::isfinite(place)) text_.fail_at_byte(std::string(what) + ": must be finite");
    return place;
  };
  for (std::int64_t i = 0; i < points_; ++i) {
    const double x = finite("x");
    const double y = finite("y");
    const double z = finite("z");
    builder_.add_node(i, {x, y, z});
  }
}

std::vector<std::int64_t> VtkReader::read_index_array(const char* name, std::int64_t length) {
  if (text_.word() != name) text_.fail(std::string("must be ") + name);
  const std::string_view type = text_.word_of_line();
  const bool is_long = type == "vtktypeint64";
  if (!is_long && type != "vtktypeint32") {
    text_.fail("type '" + shown_word(type) + "': must be vtktypeint64 or vtktypeint32");
  }
  text_.rest_of_line();
  std::vector<std::int64_t> array(static_cast<std::size_t>(length));
  for (std::int64_t& entry : array) entry = integer(is_long, name);
  return array;
}

void VtkReader::read_cells() {
  cell_count_ = count("number of cells");
  const std::int64_t size = count("size of cells");
  text_.rest_of_line();
  cells_.clear();

  // version 5: offsets, then nodes
  if (next_keyword() != "OFFSETS") {
    cells_.resize(static_cast<std::size_t>(size));
    for (std::int64_t& entry : cells_) entry = integer(false, "cell");
    return;
  }
  const std::vector<std::int64_t> offsets = read_index_array("OFFSETS", cell_count_);
  const std::vector<std::int64_t> nodes = read_index_array("CONNECTIVITY", size);
  cell_count_ = std::max<std::int64_t>(cell_count_ - 1, 0);
  for (std::size_t i = 0; i + 1 < offsets.size(); ++i) {
    if (offsets[i] < 0 || offsets[i + 1] < offsets[i] || offsets[i + 1] > size) {
      text_.fail("OFFSETS: must increase from 0 to the size");
    }
    cells_.push_back(offsets[i + 1] - offsets[i]);
    cells_.insert(cells_.end(), nodes.begin() + offsets[i], nodes.begin() + offsets[i + 1]);
  }
}

void VtkReader::read_types() {
  const std::int64_t types = text_.integer("number of cell types", 0, kMaxTag);
  if (types != cell_count_) text_.fail("CELL_TYPES: must be as many as CELLS, and follow them");
  text_.rest_of_line();
  std::size_t at = 0;
  for (std::int64_t cell = 0; cell < types; ++cell) {
    const std::int64_t type = integer(false, "cell type");
    const std::string name = "cell " + std::to_string(cell);
    if (at >= cells_.size()) text_.fail(name + ": CELLS has too few numbers");
    const std::int64_t nodes = cells_[at];
    if (nodes < 0 || nodes > static_cast<std::int64_t>(cells_.size() - at - 1)) {
      text_.fail(name + ": has " + std::to_string(nodes) + " nodes, more than CELLS holds");
    }
    if (is_tetrahedron(type) && nodes < 4) {
      text_.fail(name + ": a tetrahedron must have 4 nodes");
    }
    if (is_other_volume(type)) {
      text_.fail(name + not_a_tetrahedron(type));
    }
    typed_.push_back({type, at + 1, text_.line()});
    at += static_cast<std::size_t>(nodes) + 1;
  }
}

void VtkReader::read_array(const std::string& name, std::string_view type, std::int64_t values,
                           std::int64_t things, bool is_of_cells) {
  const bool is_kept = is_of_cells && values == 1;
  std::vector<double> kept;
  for (std::int64_t i = 0; i < values * things; ++i) {
    const double entry = value(type, name.c_str());
    if (is_kept) kept.push_back(entry);
  }
  const bool is_whole = type != "float" && type != "double";
  if (is_kept) regions_.offer(name, is_whole, std::move(kept));
}

/// What CELL_DATA and POINT_DATA hold, up to the next of them or the end.
void VtkReader::read_attributes(bool is_of_cells) {
  const std::int64_t things = count("number of values");
  if (things != (is_of_cells ? cell_count_ : points_)) {
    text_.fail(is_of_cells ? "CELL_DATA: must be as many as CELLS, and follow CELL_TYPES"
                           : "POINT_DATA: must be as many as POINTS");
  }
  for (std::string_view keyword = next_keyword(); !keyword.empty(); keyword = next_keyword()) {
    if (keyword == "CELL_DATA" || keyword == "POINT_DATA") return;
    text_.word();
    if (keyword == "METADATA") {
      skip_metadata();
    } else if (keyword == "FIELD") {
      read_field(things, is_of_cells);
    } else if (keyword == "SCALARS") {
      read_scalars(things, is_of_cells);
    } else if (keyword == "VECTORS" || keyword == "NORMALS" || keyword == "TENSORS") {
      const std::string name(text_.word_of_line());
      const std::string_view type = text_.word_of_line();
      text_.rest_of_line();
      read_array(name, type, keyword == "TENSORS" ? 9 : 3, things, is_of_cells);
    } else {
      text_.fail("'" + shown_word(keyword) +
                 "': is not read; save the mesh with scalars and fields alone");
    }
  }
}

void VtkReader::read_scalars(std::int64_t things, bool is_of_cells) {
  const std::string name(text_.word_of_line());
  const std::string_view type = text_.word_of_line();
  const std::string_view values = text_.word_of_line();
  if (!values.empty() && (values.size() != 1 || values < "1" || values > "4")) {
    text_.fail("SCALARS " + shown_word(name) + ": must have 1 … 4 values each");
  }
  text_.rest_of_line();
  if (next_keyword() == "LOOKUP_TABLE") {
    text_.word();
    text_.rest_of_line();
  }
  read_array(name, type, values.empty() ? 1 : values.front() - '0', things, is_of_cells);
}

void VtkReader::read_field(std::int64_t things, bool is_of_cells) {
  text_.word_of_line();  // its name
  const std::int64_t arrays = count("number of arrays");
  for (std::int64_t i = 0; i < arrays; ++i) {
    while (next_keyword() == "METADATA") {  // of the array before
      text_.word();
      skip_metadata();
    }
    const std::string name(text_.word());
    const std::int64_t values = count("number of values of each");
    const std::int64_t tuples = count("number of tuples");
    const std::string_view type = text_.word_of_line();
    text_.rest_of_line();
    if (values > 0 && tuples > static_cast<std::int64_t>(text_.left()) / values) {
      text_.fail("FIELD " + shown_word(name) + ": the file is too short for it");
    }
    read_array(name, type, values, tuples, is_of_cells && tuples == things);
  }
}

void VtkReader::add_tetrahedra() {
  for (std::size_t cell = 0; cell < typed_.size(); ++cell) {
    const auto& [type, begin, line] = typed_[cell];
    if (!is_tetrahedron(type)) continue;
    builder_.add_tetrahedron(
        static_cast<std::int64_t>(cell),
        {cells_[begin], cells_[begin + 1], cells_[begin + 2], cells_[begin + 3]}, regions_.of(cell),
        line);
  }
}

TetrahedralMesh VtkReader::read() {
  if (!text_.rest_of_line().starts_with("# vtk DataFile Version")) {
    text_.fail_at_line(1, "must begin with '# vtk DataFile Version'; save it as legacy VTK");
  }
  text_.rest_of_line();  // title
  const std::string_view form = text_.word();
  if (form != "ASCII" && form != "BINARY") {
    text_.fail("'" + shown_word(form) + "': must be ASCII or BINARY");
  }
  is_ascii_ = form == "ASCII";
  bool has_types = false;
  for (std::string_view keyword = text_.word(); !keyword.empty(); keyword = text_.word()) {
    if (keyword == "DATASET") {
      const std::string_view kind = text_.word();
      if (kind != "UNSTRUCTURED_GRID") {
        text_.fail("DATASET " + shown_word(kind) + ": must be UNSTRUCTURED_GRID");
      }
    } else if (keyword == "POINTS") {
      read_points();
    } else if (keyword == "CELLS" && !has_types) {
      read_cells();
    } else if (keyword == "CELL_TYPES" && !has_types) {
      read_types();
      has_types = true;
    } else if (keyword == "CELL_DATA" || keyword == "POINT_DATA") {
      read_attributes(keyword == "CELL_DATA");
    } else {
      text_.rest_of_line();  // METADATA and the like
    }
  }
  if (!has_types) text_.fail("must have POINTS, CELLS and CELL_TYPES; is the file complete?");
  add_tetrahedra();
  return builder_.take();
}

}  // namespace

TetrahedralMesh parse_vtk(std::string_view bytes, const std::string& file_name) {
  return VtkReader(bytes, file_name).read();
}

}  // namespace palpate::physics
