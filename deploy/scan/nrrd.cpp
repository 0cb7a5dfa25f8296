// SPDX-License-Identifier: Apache-2.0
// NRRD: "Definition of NRRD File Format", teem.sourceforge.net/nrrd/format.html; the keys of
// segments are those of 3D Slicer's developer guide (Segmentations).
#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <map>
#include <optional>
#include <vector>

#include "common/core/check.h"
#include "deploy/scan/byte_source.h"
#include "deploy/scan/label_map.h"
#include "physics_node/files/file_text.h"

namespace palpate::scan {
namespace {

using physics::FileText;
using physics::shown_word;

constexpr std::size_t kMostHeader = 4 << 20;

struct Field {
  std::string value{};
  int line = 0;
};

struct NrrdHeader {
  std::map<std::string, Field> fields{};  ///< "sizes: …"
  std::map<std::string, Field> keys{};    ///< "Segment0_Name:=…"
  std::size_t bytes = 0;                  ///< up to the voxels
};

std::string trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(" \t\r");
  if (begin == std::string_view::npos) return {};
  return std::string(text.substr(begin, text.find_last_not_of(" \t\r") - begin + 1));
}

std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

/// "\\n" and "\\\\" of a value of a key.
std::string unescaped(std::string_view text) {
  std::string result;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '\\' && i + 1 < text.size() && (text[i + 1] == 'n' || text[i + 1] == '\\')) {
      result += text[++i] == 'n' ? ' ' : '\\';
    } else {
      result += text[i];
    }
  }
  return result;
}

NrrdHeader read_header(FileText& text, std::string_view bytes) {
  const std::string_view magic = text.rest_of_line();
  if (magic.size() < 8 || !magic.starts_with("NRRD000")) {
    text.fail_at_line(1, "is not an NRRD file: must begin with NRRD0004 or the like");
  }
  NrrdHeader header;
  while (true) {
    const int line_number = text.line();
    if (text.is_at_end()) {
      text.fail(
          "the header must end with an empty line, and the voxels follow; is the file complete?");
    }
    std::string_view line = text.rest_of_line();
    header.bytes = bytes.size() - text.left();
    if (header.bytes > kMostHeader) text.fail("the header is longer than 4 MiB");
    if (line.ends_with('\r')) line.remove_suffix(1);
    if (line.empty()) return header;
    if (line.starts_with('#')) continue;
    const std::size_t colon = line.find(':');
    if (colon == std::string_view::npos) {
      text.fail_at_line(line_number,
                        "'" + shown_word(line) + "': must be 'field: value' or 'key:=value'");
    }
    const bool is_key = line.substr(colon).starts_with(":=");
    const std::string name =
        is_key ? trimmed(line.substr(0, colon)) : lower(trimmed(line.substr(0, colon)));
    auto& there = is_key ? header.keys : header.fields;
    const Field field{is_key ? unescaped(line.substr(colon + 2)) : trimmed(line.substr(colon + 1)),
                      line_number};
    if (!there.emplace(name, field).second) {
      text.fail_at_line(line_number, shown_word(name) + ": is given twice");
    }
  }
}

/// Reads the values of fields; errors name their line.
class Fields {
 public:
  Fields(const FileText& text, const NrrdHeader& header, std::string name)
      : text_(text), header_(header), name_(std::move(name)) {}

  [[nodiscard]] const Field* find(const std::string& field) const {
    const auto at = header_.fields.find(field);
    return at == header_.fields.end() ? nullptr : &at->second;
  }
  [[nodiscard]] const Field& get(const std::string& field) const {
    const Field* found = find(field);
    if (found == nullptr)
      text_.fail_at_line(1, field + ": must be in the header; save the file again");
    return *found;
  }
  [[noreturn]] void fail(const std::string& field, const std::string& rule) const {
    const Field& found = get(field);
    text_.fail_at_line(found.line, field + ": " + shown_word(found.value) + ": " + rule);
  }
  /// Words, or vectors "(1,0,0)" and "none", of a field.
  [[nodiscard]] std::vector<std::string> words(const std::string& field) const {
    std::vector<std::string> list;
    std::string word;
    int depth = 0;
    for (const char c : get(field).value + " ") {
      if (c == '(') ++depth;
      if (c == ')') --depth;
      if ((c == ' ' || c == '\t') && depth <= 0) {
        if (!word.empty()) list.push_back(word);
        word.clear();
      } else if (c != ' ' && c != '\t') {
        word += c;
      }
    }
    if (depth != 0) fail(field, "each '(' must have its ')'");
    return list;
  }
  [[nodiscard]] std::uint64_t whole(const std::string& field, const std::string& word,
                                    std::uint64_t most) const {
    FileText text(word, name_);
    std::uint64_t value = 0;
    for (const char c : word) {
      if (c < '0' || c > '9' || value > most)
        fail(field, "must be whole numbers from 1 to " + std::to_string(most));
      value = 10 * value + static_cast<std::uint64_t>(c - '0');
    }
    if (value < 1 || value > most)
      fail(field, "must be whole numbers from 1 to " + std::to_string(most));
    return value;
  }
  /// "(x,y,z)"
  [[nodiscard]] Vector3 vector(const std::string& field, std::string word) const {
    if (word.size() < 2 || word.front() != '(' || word.back() != ')') {
      fail(field, "must be vectors (x,y,z)");
    }
    word = word.substr(1, word.size() - 2) + ",";
    Vector3 vector = Vector3::Zero();
    int count = 0;
    for (std::size_t at = 0; at < word.size(); ++count) {
      const std::size_t comma = word.find(',', at);
      double number = 0.0;
      if (count > 2 || !physics::read_number(word.substr(at, comma - at), number)) {
        fail(field, "must be vectors of three finite numbers");
      }
      vector[count] = number;
      at = comma + 1;
    }
    if (count != 3) fail(field, "must be vectors of three finite numbers");
    return vector;
  }

 private:
  const FileText& text_;
  const NrrdHeader& header_;
  std::string name_;
};

ValueType type_of(const Fields& fields) {
  static const std::map<std::string, ValueType> kTypes = {
      {"signed char", ValueType::kInt8},
      {"int8", ValueType::kInt8},
      {"int8_t", ValueType::kInt8},
      {"uchar", ValueType::kUint8},
      {"unsigned char", ValueType::kUint8},
      {"uint8", ValueType::kUint8},
      {"uint8_t", ValueType::kUint8},
      {"short", ValueType::kInt16},
      {"short int", ValueType::kInt16},
      {"signed short", ValueType::kInt16},
      {"signed short int", ValueType::kInt16},
      {"int16", ValueType::kInt16},
      {"int16_t", ValueType::kInt16},
      {"ushort", ValueType::kUint16},
      {"unsigned short", ValueType::kUint16},
      {"unsigned short int", ValueType::kUint16},
      {"uint16", ValueType::kUint16},
      {"uint16_t", ValueType::kUint16},
      {"int", ValueType::kInt32},
      {"signed int", ValueType::kInt32},
      {"int32", ValueType::kInt32},
      {"int32_t", ValueType::kInt32},
      {"uint", ValueType::kUint32},
      {"unsigned int", ValueType::kUint32},
      {"uint32", ValueType::kUint32},
      {"uint32_t", ValueType::kUint32},
      {"longlong", ValueType::kInt64},
      {"long long", ValueType::kInt64},
      {"long long int", ValueType::kInt64},
      {"signed long long", ValueType::kInt64},
      {"signed long long int", ValueType::kInt64},
      {"int64", ValueType::kInt64},
      {"int64_t", ValueType::kInt64},
      {"ulonglong", ValueType::kUint64},
      {"unsigned long long", ValueType::kUint64},
      {"unsigned long long int", ValueType::kUint64},
      {"uint64", ValueType::kUint64},
      {"uint64_t", ValueType::kUint64},
      {"float", ValueType::kFloat},
      {"double", ValueType::kDouble}};
  const auto found = kTypes.find(lower(fields.get("type").value));
  if (found == kTypes.end()) fields.fail("type", "must be a number; save labels as unsigned char");
  return found->second;
}

/// Signs that turn the space of the file into RAS.
Vector3 ras_signs(const Fields& fields) {
  static const std::map<std::string, Vector3> kSpaces = {
      {"right-anterior-superior", {1, 1, 1}},   {"ras", {1, 1, 1}},
      {"left-anterior-superior", {-1, 1, 1}},   {"las", {-1, 1, 1}},
      {"left-posterior-superior", {-1, -1, 1}}, {"lps", {-1, -1, 1}}};
  if (fields.find("space") == nullptr) {
    (void)fields.get("space (which side of the patient is left)");
  }
  const auto found = kSpaces.find(lower(fields.get("space").value));
  if (found == kSpaces.end()) {
    fields.fail("space",
                "must be left-posterior-superior, right-anterior-superior or "
                "left-anterior-superior: which side of the patient is left is not guessed");
  }
  return found->second;
}

double unit_m(const Fields& fields, std::vector<std::string>& notes) {
  if (fields.find("space units") == nullptr) {
    notes.emplace_back("the file gives no unit of length: millimetres assumed");
    return 1e-3;
  }
  const std::string units = fields.get("space units").value;
  std::string first = units.substr(0, units.find('"', 1) + 1);
  if (units != first + " " + first + " " + first)
    fields.fail("space units", "must be three times the same");
  if (first == "\"mm\"") return 1e-3;
  if (first == "\"m\"") return 1.0;
  if (first == "\"cm\"") return 1e-2;
  if (first == "\"um\"") return 1e-6;
  fields.fail("space units", "must be \"mm\", \"m\", \"cm\" or \"um\"");
}

/// Type of the first TerminologyEntry of Slicer's Segment_Tags, "…~SCT^10200004^Liver~…", as
/// "SCT:10200004"; "" without.
std::string code_of(const std::string& tags) {
  constexpr std::string_view kBegin = "TerminologyEntry:";
  std::size_t at = tags.find(kBegin);
  if (at == std::string::npos) return {};
  for (int field = 0; field < 2; ++field) {
    at = tags.find('~', at);
    if (at == std::string::npos) return {};
    ++at;
  }
  const std::string type = tags.substr(at, tags.find_first_of("~|", at) - at);
  const std::size_t scheme = type.find('^');
  if (scheme == std::string::npos || scheme == 0) return {};
  const std::string value = type.substr(scheme + 1, type.find('^', scheme + 1) - scheme - 1);
  return value.empty() ? "" : type.substr(0, scheme) + ":" + value;
}

/// Segment0_LabelValue and so on; empty if the file has no segments.
std::vector<Segment> table_of(const FileText& text, const NrrdHeader& header,
                              std::uint64_t layers) {
  std::vector<Segment> table;
  const auto key = [&](std::size_t i, const char* what) -> const Field* {
    const auto found = header.keys.find("Segment" + std::to_string(i) + "_" + what);
    return found == header.keys.end() ? nullptr : &found->second;
  };
  const auto number = [&](const Field* field, const char* what, std::uint32_t most,
                          std::uint32_t otherwise) {
    if (field == nullptr) return otherwise;
    std::uint64_t value = 0;
    const std::string word = trimmed(field->value);
    for (const char c : word) {
      value = c >= '0' && c <= '9' && value <= most
                  ? 10 * value + static_cast<std::uint64_t>(c - '0')
                  : most + 1ULL;
    }
    if (word.empty() || value > most) {
      text.fail_at_line(field->line, std::string(what) + ": '" + shown_word(word) +
                                         "': must be a whole number up to " + std::to_string(most));
    }
    return static_cast<std::uint32_t>(value);
  };
  for (std::size_t i = 0;
       key(i, "ID") != nullptr || key(i, "LabelValue") != nullptr || key(i, "Name") != nullptr;
       ++i) {
    const Field* any = key(i, "LabelValue") != nullptr ? key(i, "LabelValue")
                       : key(i, "ID") != nullptr       ? key(i, "ID")
                                                       : key(i, "Name");
    Segment segment;
    segment.value = number(key(i, "LabelValue"), "LabelValue", 65'535, 1);
    segment.layer = number(key(i, "Layer"), "Layer", static_cast<std::uint32_t>(layers - 1), 0);
    if (segment.value == 0)
      text.fail_at_line(any->line, "LabelValue: must be above 0, the background");
    if (const Field* name = key(i, "Name")) segment.name = trimmed(name->value);
    if (const Field* tags = key(i, "Tags")) segment.code = code_of(tags->value);
    for (const Segment& other : table) {
      if (other.value == segment.value && other.layer == segment.layer) {
        text.fail_at_line(
            any->line,
            "Segment" + std::to_string(i) + ": has the layer and label value of another segment" +
                (key(i, "LabelValue") == nullptr ? "; LabelValue is missing, which counts as 1"
                                                 : ""));
      }
    }
    table.push_back(segment);
  }
  return table;
}

}  // namespace

LabelMap parse_nrrd(std::string_view bytes, const std::string& name) {
  FileText text(bytes, name);
  const NrrdHeader header = read_header(text, bytes);
  const Fields fields(text, header, name);
  std::vector<std::string> notes;

  for (const char* detached : {"data file", "datafile"}) {
    if (fields.find(detached) != nullptr) {
      fields.fail(detached, "the voxels must be in the same file; save it as .nrrd, not .nhdr");
    }
  }
  for (const char* skip : {"line skip", "lineskip", "byte skip", "byteskip"}) {
    if (fields.find(skip) != nullptr && fields.get(skip).value != "0")
      fields.fail(skip, "must be 0; save it again");
  }
  const std::uint64_t dimension = fields.whole("dimension", fields.get("dimension").value, 16);
  if (dimension != 3 && dimension != 4)
    fields.fail("dimension", "must be 3, or 4 with a list of layers");
  const std::vector<std::string> sizes = fields.words("sizes");
  if (sizes.size() != dimension) fields.fail("sizes", "must be as many as the dimension says");
  const std::vector<std::string> directions = fields.words("space directions");
  if (directions.size() != dimension)
    fields.fail("space directions", "must be as many as the dimension says");

  // the axis without a direction counts layers
  std::uint64_t layers = 1;
  std::size_t list_axis = dimension;
  std::array<std::uint64_t, 3> size{};
  Eigen::Affine3d affine = Eigen::Affine3d::Identity();
  std::size_t axis = 0;
  for (std::size_t d = 0; d < dimension; ++d) {
    const std::uint64_t length = fields.whole("sizes", sizes[d], 1'000'000'000);
    if (lower(directions[d]) == "none" && list_axis == dimension) {
      list_axis = d;
      layers = length;
    } else if (axis < 3) {
      size[axis] = length;
      affine.linear().col(static_cast<Eigen::Index>(axis)) =
          fields.vector("space directions", directions[d]);
      ++axis;
    } else {
      fields.fail("space directions", "of 4 axes one must be none: the list of layers");
    }
  }
  if (axis != 3) fields.fail("space directions", "must be three vectors");
  const Vector3 signs = ras_signs(fields);
  affine.translation() = fields.vector("space origin", fields.get("space origin").value);
  affine.matrix().topRows<3>() = signs.asDiagonal() * affine.matrix().topRows<3>();
  affine.matrix().topRows<3>() *= unit_m(fields, notes);
  if (layers > kMostLayers)
    fields.fail("sizes", "at most 64 layers; is it a picture in time or colour?");
  check_grid(size, layers, affine, name);

  const ValueType type = type_of(fields);
  const std::string encoding = lower(fields.get("encoding").value);
  const bool is_text = encoding == "text" || encoding == "txt" || encoding == "ascii";
  const bool is_compressed = encoding == "gzip" || encoding == "gz";
  if (!is_text && !is_compressed && encoding != "raw") {
    fields.fail("encoding", "must be raw, gzip or text; save it with gzip");
  }
  std::endian endian = std::endian::little;
  if (bytes_of(type) > 1 && !is_text) {
    const std::string word = lower(fields.get("endian").value);
    if (word != "little" && word != "big") fields.fail("endian", "must be little or big");
    if (word == "big") endian = std::endian::big;
  }
  std::vector<Segment> table = table_of(text, header, layers);

  const std::uint64_t per_layer = size[0] * size[1] * size[2];
  const std::uint64_t all = per_layer * layers;
  ByteSource source(bytes.substr(header.bytes), is_compressed, name);
  source.expect(is_text ? 2 * all - 1 : all * bytes_of(type));
  std::vector<Layer> read(layers, Layer(per_layer));
  // voxels before the list axis, which turn fastest
  std::uint64_t inner = 1;
  for (std::size_t d = 0, a = 0; d < list_axis && list_axis < dimension; ++d) inner *= size[a++];
  if (list_axis == dimension) inner = per_layer;
  std::vector<double> values;
  constexpr std::uint64_t kPiece = 65'536;
  for (std::uint64_t begin = 0; begin < all; begin += values.size()) {
    values.resize(std::min(kPiece, all - begin));
    if (is_text) {
      for (double& value : values) value = text.number("voxel");
    } else {
      read_values(source, type, endian, values);
    }
    for (std::uint64_t i = 0; i < values.size(); ++i) {
      const std::uint64_t at = begin + i;
      const std::uint64_t layer = at / inner % layers;
      read[layer][at / (inner * layers) * inner + at % inner] = label_of(values[i], at, name);
    }
  }
  if (!is_text) source.finish();
  LabelMap map = label_map_of(size, affine, std::move(read), std::move(table), name);
  map.notes.insert(map.notes.begin(), notes.begin(), notes.end());
  map.notes.insert(map.notes.begin(),
                   "orientation from the file's space, " + shown_word(fields.get("space").value));
  return map;
}

}  // namespace palpate::scan
