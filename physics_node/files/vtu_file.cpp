// SPDX-License-Identifier: Apache-2.0
#include <expat.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "physics_node/files/cell_regions.h"
#include "physics_node/files/file_text.h"
#include "physics_node/files/mesh_builder.h"
#include "physics_node/files/tetrahedral_files.h"
#include "physics_node/files/vtk_cells.h"

namespace palpate::physics {
namespace {

constexpr std::size_t kMostArrayBytes = std::size_t{1} << 30;
constexpr std::size_t kMostArrays = 1000;
constexpr double kMostIndex = 9e15;  // exact in a double

/// An array as the XML describes it.
struct DataArray {
  std::string type;    ///< such as "Float64"
  std::string format;  ///< "ascii", "binary" (base64 in the text) or "appended"
  std::string offset;  ///< of what is appended
  std::string components;
  std::string text{};
  int line = 0;
};

/// The part of a .vtu file before what is appended. Arrays by "Element/Name", such as
/// "CellData/labels"; that of the points is "Points/".
struct VtuDescription {
  std::map<std::string, std::string> file{};   ///< attributes of VTKFile
  std::map<std::string, std::string> piece{};  ///< attributes of Piece
  std::vector<std::pair<std::string, DataArray>> arrays{};
  std::size_t pieces = 0;
  bool is_grid = false;

  [[nodiscard]] const DataArray* array(std::string_view name) const {
    const auto found = std::find_if(arrays.begin(), arrays.end(),
                                    [&](const auto& array) { return array.first == name; });
    return found == arrays.end() ? nullptr : &found->second;
  }
};

/// Calls of expat fill a VtuDescription. They throw nothing: C code is between.
class VtuXml {
 public:
  VtuXml(FileText& text, VtuDescription& description) : text_(text), description_(description) {}

  /// @throws SetupError  not well-formed, or with declarations of its own
  void parse(std::string_view bytes) {
    const std::unique_ptr<XML_ParserStruct, void (*)(XML_Parser)> parser(XML_ParserCreate(nullptr),
                                                                         XML_ParserFree);
    if (parser == nullptr) text_.fail("out of memory");
    parser_ = parser.get();
    XML_SetUserData(parser_, this);
    XML_SetElementHandler(parser_, on_begin, on_end);
    XML_SetCharacterDataHandler(parser_, on_text);
    XML_SetStartDoctypeDeclHandler(parser_, on_doctype);
    if (XML_Parse(parser_, bytes.data(), static_cast<int>(bytes.size()), 0) == XML_STATUS_ERROR) {
      fail();
    }
    // what is appended was cut off, and the end with it
    constexpr std::string_view kEnd = "</VTKFile>";
    if (depth_ > 0 && XML_Parse(parser_, kEnd.data(), kEnd.size(), 1) == XML_STATUS_ERROR) fail();
  }

 private:
  [[noreturn]] void fail() const {
    const int line = static_cast<int>(XML_GetCurrentLineNumber(parser_));
    if (!complaint_.empty()) text_.fail_at_line(line, complaint_);
    text_.fail_at_line(
        line, std::string("is not well-formed XML: ") + XML_ErrorString(XML_GetErrorCode(parser_)));
  }
  void refuse(const char* complaint) {
    complaint_ = complaint;
    XML_StopParser(parser_, XML_FALSE);
  }

  static void on_doctype(void* self, const XML_Char*, const XML_Char*, const XML_Char*, int) {
    static_cast<VtuXml*>(self)->refuse("<!DOCTYPE: must not be in a .vtu file");
  }
  static void on_text(void* self, const XML_Char* text, int length) {
    auto& xml = *static_cast<VtuXml*>(self);
    if (xml.depth_ == xml.array_depth_) {  // not of what is nested, such as InformationKey
      xml.description_.arrays.back().second.text.append(text, static_cast<std::size_t>(length));
    }
  }
  static void on_end(void* self, const XML_Char* name) {
    auto& xml = *static_cast<VtuXml*>(self);
    --xml.depth_;
    if (std::string_view(name) == "DataArray") xml.array_depth_ = -1;
  }
  static void on_begin(void* self, const XML_Char* name, const XML_Char** attributes) {
    static_cast<VtuXml*>(self)->begin(name, attributes);
  }
  void begin(std::string_view name, const XML_Char** attributes) {
    ++depth_;
    std::map<std::string, std::string> given;
    for (; *attributes != nullptr; attributes += 2) given[attributes[0]] = attributes[1];
    if (name == "VTKFile") {
      description_.file = std::move(given);
    } else if (name == "UnstructuredGrid") {
      description_.is_grid = true;
    } else if (name == "Piece") {
      description_.piece = std::move(given);
      if (++description_.pieces > 1) {
        refuse("<Piece>: is given twice; merge the pieces, e.g. in ParaView with Append Datasets");
      }
    } else if (name == "Points" || name == "Cells" || name == "CellData" || name == "PointData" ||
               name == "FieldData") {
      section_ = name;
    } else if (name == "DataArray") {
      array_depth_ = depth_;
      description_.arrays.push_back(
          {section_ + '/' + (section_ == "Points" ? "" : given["Name"]),
           DataArray{.type = given["type"],
                     .format = given["format"],
                     .offset = given["offset"],
                     .components = given["NumberOfComponents"],
                     .line = static_cast<int>(XML_GetCurrentLineNumber(parser_))}});
      if (description_.arrays.size() > kMostArrays) refuse("has more than 1000 arrays");
    }
  }

  FileText& text_;
  VtuDescription& description_;
  XML_Parser parser_ = nullptr;
  std::string complaint_;
  std::string section_;
  int depth_ = 0;
  int array_depth_ = -1;  ///< -1: in none
};

/// The bytes of a base64 text without its blanks; false if it is none.
bool decode_base64(std::string_view text, std::string& bytes) {
  bytes.clear();
  if (text.size() % 4 != 0) return false;
  std::uint32_t bits = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    std::uint32_t six = 0;
    if (c >= 'A' && c <= 'Z') {
      six = static_cast<std::uint32_t>(c - 'A');
    } else if (c >= 'a' && c <= 'z') {
      six = static_cast<std::uint32_t>(c - 'a' + 26);
    } else if (c >= '0' && c <= '9') {
      six = static_cast<std::uint32_t>(c - '0' + 52);
    } else if (c == '+') {
      six = 62;
    } else if (c == '/') {
      six = 63;
    } else if (c != '=' || i + 2 < text.size()) {
      return false;
    }
    bits = bits << 6 | six;
    if (i % 4 != 3) continue;
    bytes += static_cast<char>(bits >> 16 & 0xff);
    bytes += static_cast<char>(bits >> 8 & 0xff);
    bytes += static_cast<char>(bits & 0xff);
    bits = 0;
  }
  if (text.ends_with('=')) bytes.pop_back();
  if (text.ends_with("==")) bytes.pop_back();
  return true;
}

std::size_t base64_length(std::size_t bytes) { return (bytes + 2) / 3 * 4; }

class VtuReader {
 public:
  VtuReader(std::string_view bytes, const std::string& file_name)
      : bytes_(bytes), file_name_(file_name), text_(bytes, file_name), builder_(text_) {}

  TetrahedralMesh read();

 private:
  void read_description();
  [[nodiscard]] std::int64_t piece_count(const char* attribute) const;
  /// All values of an array that must be there. @param count  of them
  std::vector<double> values(const std::string& name, std::size_t count);
  /// The same of whole numbers from 0.
  std::vector<std::int64_t> indices(const std::string& name, std::size_t count);
  std::vector<double> values(const std::string& name, const DataArray& array, std::size_t count);
  /// The uncompressed bytes of an array that is not text.
  std::string bytes_of(const std::string& name, const DataArray& array, std::size_t size);
  template <class T>
  std::vector<double> numbers(const std::string& name, const DataArray& array, std::size_t count);

  std::string_view bytes_;
  std::string file_name_;
  FileText text_;
  MeshBuilder builder_;
  VtuDescription description_;
  std::string_view appended_{};
  bool is_appended_raw_ = false;
  bool has_long_headers_ = false;
  bool is_compressed_ = false;
  std::endian endian_ = std::endian::little;
};

void VtuReader::read_description() {
  const std::size_t appended = bytes_.find("<AppendedData");
  VtuXml(text_, description_).parse(bytes_.substr(0, appended));
  auto& file = description_.file;
  if (file["type"] != "UnstructuredGrid" || !description_.is_grid || description_.pieces == 0) {
    text_.fail_at_line(1, "must be a VTKFile of type UnstructuredGrid with a Piece");
  }
  endian_ = file["byte_order"] == "BigEndian" ? std::endian::big : std::endian::little;
  has_long_headers_ = file["header_type"] == "UInt64";
  is_compressed_ = !file["compressor"].empty();
  if (is_compressed_ && file["compressor"] != "vtkZLibDataCompressor") {
    text_.fail_at_line(1, "compressor " + shown_word(file["compressor"]) +
                              ": must be vtkZLibDataCompressor; save it with that or without one");
  }
  if (appended == std::string_view::npos) return;
  const std::string_view rest = bytes_.substr(appended);
  const std::size_t end_of_tag = rest.find('>');
  const std::size_t begin = rest.find('_', end_of_tag);
  if (end_of_tag == std::string_view::npos || begin == std::string_view::npos) {
    text_.fail("<AppendedData>: must hold data behind a '_'; is the file complete?");
  }
  is_appended_raw_ = rest.substr(0, end_of_tag).find("\"raw\"") != std::string_view::npos;
  appended_ = rest.substr(begin + 1);
  if (is_appended_raw_) return;
  appended_ = appended_.substr(0, appended_.find('<'));
}

std::int64_t VtuReader::piece_count(const char* attribute) const {
  const auto given = description_.piece.find(attribute);
  FileText number(given == description_.piece.end() ? std::string_view() : given->second,
                  file_name_);
  return checked_count(text_, attribute, number.integer(attribute, 0, kMaxTag));
}

std::string VtuReader::bytes_of(const std::string& name, const DataArray& array, std::size_t size) {
  const auto fail = [&](const std::string& what) {
    text_.fail_at_line(array.line, "DataArray " + shown_word(name) + ": " + what);
  };
  // where it begins
  std::string inline_text;
  std::string_view source;
  bool is_raw = false;
  if (array.format == "appended") {
    FileText number(array.offset, file_name_);
    const std::int64_t offset = number.integer("offset", 0, kMaxTag);
    if (offset > static_cast<std::int64_t>(appended_.size())) {
      fail("offset = " + array.offset + ": the appended data ends before it");
    }
    source = appended_.substr(static_cast<std::size_t>(offset));
    is_raw = is_appended_raw_;
  } else if (array.format == "binary") {
    for (const char c : array.text) {
      if (c != ' ' && c != '\n' && c != '\t' && c != '\r') inline_text += c;
    }
    source = inline_text;
  } else {
    fail("format '" + shown_word(array.format) + "': must be ascii, binary or appended");
  }
  // the next bytes, from the beginning of a base64 text or at a place of raw bytes
  const auto take = [&](std::size_t bytes) {
    const std::size_t length = is_raw ? bytes : base64_length(bytes);
    if (length > source.size()) fail("ends early; is the file complete?");
    std::string taken(source.substr(0, length));
    source.remove_prefix(length);
    if (is_raw) return taken;
    std::string decoded;
    if (!decode_base64(taken, decoded) || decoded.size() < bytes) fail("is not base64");
    decoded.resize(bytes);
    return decoded;
  };
  const std::size_t word = has_long_headers_ ? 8 : 4;
  const auto header = [&](std::string_view raw, std::size_t i) {
    FileText at(raw.substr(i * word, word), file_name_);
    return has_long_headers_ ? at.binary<std::uint64_t>("header", endian_)
                             : std::uint64_t{at.binary<std::uint32_t>("header", endian_)};
  };
  const auto expect_size = [&](std::uint64_t bytes) {
    if (bytes != size) {
      fail("has " + std::to_string(bytes) + " bytes: must be " + std::to_string(size));
    }
  };

  if (!is_compressed_) {  // the header and the bytes are one text
    const std::string_view begin = source;
    expect_size(header(take(word), 0));
    source = begin;
    return take(word + size).substr(word);
  }
  // numbers of blocks, bytes of a block and of the last (0: as the others), compressed bytes of
  // each
  const std::string_view begin = source;
  const std::uint64_t blocks = header(take(word), 0);
  if (blocks == 0) {
    expect_size(0);
    return {};
  }
  if (blocks > size) fail("has " + std::to_string(blocks) + " blocks, more than bytes");
  source = begin;
  const std::string head = take(word * (3 + static_cast<std::size_t>(blocks)));
  const std::uint64_t of_block = header(head, 1);
  const std::uint64_t of_last = header(head, 2) > 0 ? header(head, 2) : of_block;
  if (of_block > kMostArrayBytes || of_last > of_block) fail("its blocks are too large");
  expect_size((blocks - 1) * of_block + of_last);
  std::uint64_t compressed = 0;
  for (std::size_t i = 0; i < blocks; ++i) {
    if (header(head, 3 + i) > source.size()) fail("ends early; is the file complete?");
    compressed += header(head, 3 + i);
    if (compressed > source.size()) fail("ends early; is the file complete?");
  }
  const std::string packed = take(static_cast<std::size_t>(compressed));
  std::string bytes(size, '\0');
  std::size_t from = 0;
  for (std::size_t i = 0; i < blocks; ++i) {
    const auto length = static_cast<std::size_t>(header(head, 3 + i));
    const std::uint64_t expected = i + 1 == blocks ? of_last : of_block;
    uLongf got = static_cast<uLongf>(expected);
    if (uncompress(reinterpret_cast<Bytef*>(bytes.data() + i * of_block), &got,
                   reinterpret_cast<const Bytef*>(packed.data() + from),
                   static_cast<uLong>(length)) != Z_OK ||
        got != expected) {
      fail("is damaged: zlib cannot uncompress it");
    }
    from += length;
  }
  return bytes;
}

template <class T>
std::vector<double> VtuReader::numbers(const std::string& name, const DataArray& array,
                                       std::size_t count) {
  const std::string bytes = bytes_of(name, array, count * sizeof(T));
  FileText raw(bytes, file_name_);
  std::vector<double> values(count);
  for (double& value : values) value = static_cast<double>(raw.binary<T>(name.c_str(), endian_));
  return values;
}

std::vector<double> VtuReader::values(const std::string& name, const DataArray& array,
                                      std::size_t count) {
  if (count > kMostArrayBytes / 8) {
    text_.fail_at_line(array.line, "DataArray " + shown_word(name) + ": is larger than 1 GiB");
  }
  if (array.format == "ascii") {
    FileText text(array.text, file_name_);
    std::vector<double> values;
    for (std::string_view word = text.word(); !word.empty(); word = text.word()) {
      double value = 0.0;
      if (!read_number(word, value) || values.size() == count) {
        text_.fail_at_line(array.line + text.line() - 1,
                           "DataArray " + shown_word(name) + ": '" + shown_word(word) +
                               "': must be " + std::to_string(count) + " finite numbers");
      }
      values.push_back(value);
    }
    if (values.size() < count) {
      text_.fail_at_line(array.line, "DataArray " + shown_word(name) + ": has " +
                                         std::to_string(values.size()) + " numbers: must be " +
                                         std::to_string(count));
    }
    return values;
  }
  if (array.type == "Float64") return numbers<double>(name, array, count);
  if (array.type == "Float32") return numbers<float>(name, array, count);
  if (array.type == "Int64") return numbers<std::int64_t>(name, array, count);
  if (array.type == "UInt64") return numbers<std::uint64_t>(name, array, count);
  if (array.type == "Int32") return numbers<std::int32_t>(name, array, count);
  if (array.type == "UInt32") return numbers<std::uint32_t>(name, array, count);
  if (array.type == "Int16") return numbers<std::int16_t>(name, array, count);
  if (array.type == "UInt16") return numbers<std::uint16_t>(name, array, count);
  if (array.type == "Int8") return numbers<std::int8_t>(name, array, count);
  if (array.type == "UInt8") return numbers<std::uint8_t>(name, array, count);
  text_.fail_at_line(array.line, "DataArray " + shown_word(name) + ": type '" +
                                     shown_word(array.type) + "': is not known");
}

std::vector<double> VtuReader::values(const std::string& name, std::size_t count) {
  const DataArray* array = description_.array(name);
  if (array == nullptr) text_.fail_at_line(1, "must have a DataArray " + name);
  return values(name, *array, count);
}

std::vector<std::int64_t> VtuReader::indices(const std::string& name, std::size_t count) {
  std::vector<std::int64_t> indices;
  for (const double value : values(name, count)) {
    if (!(value >= 0.0 && value <= kMostIndex && value == std::floor(value))) {
      text_.fail_at_line(description_.array(name)->line,
                         "DataArray " + name + ": must be whole numbers from 0");
    }
    indices.push_back(static_cast<std::int64_t>(value));
  }
  return indices;
}

TetrahedralMesh VtuReader::read() {
  read_description();
  const auto points = static_cast<std::size_t>(piece_count("NumberOfPoints"));
  const auto cells = static_cast<std::size_t>(piece_count("NumberOfCells"));
  const std::vector<double> places = values("Points/", 3 * points);
  for (std::size_t i = 0; i < points; ++i) {
    const Vector3 place(places[3 * i], places[3 * i + 1], places[3 * i + 2]);
    if (!place.allFinite())
      text_.fail_at_line(1, "point " + std::to_string(i) + ": must be finite");
    builder_.add_node(static_cast<std::int64_t>(i), place);
  }
  CellRegions regions;
  for (const auto& [name, array] : description_.arrays) {
    const bool is_one = array.components.empty() || array.components == "1";
    if (!name.starts_with("CellData/") || !is_one || array.type == "String") continue;
    regions.offer(std::string_view(name).substr(std::string_view("CellData/").size()),
                  !array.type.starts_with("Float"), values(name, array, cells));
  }

  const std::vector<std::int64_t> ends = indices("Cells/offsets", cells);
  const std::vector<std::int64_t> types = indices("Cells/types", cells);
  const std::int64_t size = ends.empty() ? 0 : ends.back();
  const std::vector<std::int64_t> nodes =
      indices("Cells/connectivity", static_cast<std::size_t>(size));
  std::int64_t begin = 0;
  for (std::size_t cell = 0; cell < cells; ++cell) {
    const std::int64_t end = ends[cell];
    const std::string name = "cell " + std::to_string(cell);
    if (end < begin || end > size) text_.fail_at_line(1, name + ": offsets must increase");
    if (is_other_volume(types[cell])) text_.fail_at_line(1, name + not_a_tetrahedron(types[cell]));
    if (is_tetrahedron(types[cell])) {
      if (end - begin < 4) text_.fail_at_line(1, name + ": a tetrahedron must have 4 nodes");
      const auto first = static_cast<std::size_t>(begin);
      builder_.add_tetrahedron(static_cast<std::int64_t>(cell),
                               {nodes[first], nodes[first + 1], nodes[first + 2], nodes[first + 3]},
                               regions.of(cell), 1);
    }
    begin = end;
  }
  return builder_.take();
}

}  // namespace

TetrahedralMesh parse_vtu(std::string_view bytes, const std::string& file_name) {
  return VtuReader(bytes, file_name).read();
}

}  // namespace palpate::physics
