// SPDX-License-Identifier: Apache-2.0
#include "physics_node/files/ply.h"

#include <array>
#include <bit>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "physics_node/files/file_text.h"

namespace palpate::physics {
namespace {

enum class Type : std::uint8_t { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };
constexpr std::array<std::size_t, 8> kBytesOf{1, 1, 2, 2, 4, 4, 4, 8};
constexpr std::int64_t kMaxCount = 1'000'000'000;

struct Property {
  std::string name;
  Type type = Type::kFloat;
  std::optional<Type> list_count{};  // of a list: the type of its length
};
struct Element {
  std::string name;
  std::int64_t count = 0;
  std::vector<Property> properties{};
};
struct Header {
  bool is_ascii = false;
  std::endian endian = std::endian::little;
  std::vector<Element> elements{};
};

Type to_type(std::string_view name, const FileText& text) {
  static const std::map<std::string_view, Type> kTypes{
      {"char", Type::kInt8},     {"int8", Type::kInt8},     {"uchar", Type::kUint8},
      {"uint8", Type::kUint8},   {"short", Type::kInt16},   {"int16", Type::kInt16},
      {"ushort", Type::kUint16}, {"uint16", Type::kUint16}, {"int", Type::kInt32},
      {"int32", Type::kInt32},   {"uint", Type::kUint32},   {"uint32", Type::kUint32},
      {"float", Type::kFloat},   {"float32", Type::kFloat}, {"double", Type::kDouble},
      {"float64", Type::kDouble}};
  const auto type = kTypes.find(name);
  if (type == kTypes.end()) {
    text.fail("type '" + shown_word(name) + "': must be one of PLY, such as float or uchar");
  }
  return type->second;
}

Property read_property(FileText& text) {
  Property property;
  std::string_view type = text.word_of_line();
  if (type == "list") {
    property.list_count = to_type(text.word_of_line(), text);
    if (*property.list_count == Type::kFloat || *property.list_count == Type::kDouble) {
      text.fail("list: its length must be of a whole-number type");
    }
    type = text.word_of_line();
  }
  property.type = to_type(type, text);
  property.name = text.word_of_line();
  return property;
}

Header read_header(FileText& text) {
  if (text.rest_of_line() != "ply")
    text.fail_at_line(1, "must begin with 'ply'; is it a PLY file?");
  Header header;
  bool has_format = false;
  while (true) {
    if (text.is_at_end()) text.fail("the header ends without 'end_header'; is the file complete?");
    const std::string_view keyword = text.word_of_line();
    if (keyword == "format") {
      const std::string_view format = text.word_of_line();
      has_format = true;
      header.is_ascii = format == "ascii";
      header.endian = format == "binary_big_endian" ? std::endian::big : std::endian::little;
      if (!header.is_ascii && format != "binary_little_endian" && format != "binary_big_endian") {
        text.fail("format '" + shown_word(format) +
                  "': must be ascii, binary_little_endian or binary_big_endian");
      }
    } else if (keyword == "element") {
      const std::string name(text.word_of_line());
      header.elements.push_back({.name = name, .count = text.integer("count", 0, kMaxCount)});
    } else if (keyword == "property") {
      if (header.elements.empty()) text.fail("property: must follow an element");
      header.elements.back().properties.push_back(read_property(text));
    } else if (keyword == "end_header") {
      text.rest_of_line();
      break;
    } else if (keyword != "comment" && keyword != "obj_info" && !keyword.empty()) {
      text.fail("'" + shown_word(keyword) + "': is not a keyword of a PLY header");
    }
    text.rest_of_line();
  }
  if (!has_format) text.fail("the header has no 'format' line");
  return header;
}

/// The values of the file in sequence, ASCII or binary.
class Values {
 public:
  Values(FileText& text, const Header& header) : text_(text), header_(header) {}

  double read(const Property& property, Type type) {
    const char* const what = property.name.c_str();
    if (header_.is_ascii) return text_.number(what);
    const std::endian e = header_.endian;
    switch (type) {
      case Type::kInt8:
        return text_.binary<std::int8_t>(what, e);
      case Type::kUint8:
        return text_.binary<std::uint8_t>(what, e);
      case Type::kInt16:
        return text_.binary<std::int16_t>(what, e);
      case Type::kUint16:
        return text_.binary<std::uint16_t>(what, e);
      case Type::kInt32:
        return text_.binary<std::int32_t>(what, e);
      case Type::kUint32:
        return text_.binary<std::uint32_t>(what, e);
      case Type::kFloat:
        return static_cast<double>(text_.binary<float>(what, e));
      case Type::kDouble:
        break;
    }
    return text_.binary<double>(what, e);
  }

  void skip(const Property& property) {
    if (!property.list_count) {
      read(property, property.type);
      return;
    }
    const double length = read(property, *property.list_count);
    if (!(length >= 0.0 && length <= static_cast<double>(text_.left()))) {
      fail(property.name + ": a list must have a length of 0 or more, and fit into the file");
    }
    if (header_.is_ascii) {
      for (double i = 0.0; i < length; ++i) text_.number(property.name.c_str());
      return;
    }
    const std::size_t bytes = kBytesOf[static_cast<std::size_t>(property.type)];
    text_.skip_bytes(static_cast<std::size_t>(length) * bytes, property.name.c_str());
  }

  [[noreturn]] void fail(const std::string& what) const {
    if (header_.is_ascii) text_.fail(what);
    text_.fail_at_byte(what);
  }

 private:
  FileText& text_;
  const Header& header_;
};

PointCloud read_vertices(FileText& text, const Header& header, const Element& element,
                         const std::string& stiffness_property) {
  // which property is which
  std::array<std::ptrdiff_t, 7> column{-1, -1, -1, -1, -1, -1, -1};
  const std::array<std::string, 7> name{"x", "y", "z", "nx", "ny", "nz", stiffness_property};
  for (std::size_t p = 0; p < element.properties.size(); ++p) {
    for (std::size_t i = 0; i < name.size(); ++i) {
      if (element.properties[p].name != name[i]) continue;
      if (column[i] >= 0) text.fail("property '" + name[i] + "': is given twice");
      if (element.properties[p].list_count) text.fail("property '" + name[i] + "': is a list");
      column[i] = static_cast<std::ptrdiff_t>(p);
    }
  }
  for (std::size_t i = 0; i < 3; ++i) {
    if (column[i] < 0) text.fail("vertices have no property '" + name[i] + "'");
  }
  const int normal_columns = (column[3] >= 0) + (column[4] >= 0) + (column[5] >= 0);
  if (normal_columns == 1 || normal_columns == 2) {
    text.fail("normals: must have nx, ny and nz, or none of them");
  }
  if (!stiffness_property.empty() && column[6] < 0) {
    text.fail("vertices have no property '" + shown_word(stiffness_property) +
              "' that the material's stiffness_property names");
  }
  // the count of the header must be plausible before memory is reserved for it
  if (element.count > static_cast<std::int64_t>(text.left())) {
    text.fail("element vertex: the file is too short for " + std::to_string(element.count));
  }

  PointCloud cloud;
  cloud.points_m.reserve(static_cast<std::size_t>(element.count));
  Values values(text, header);
  std::vector<double> row(element.properties.size());
  for (std::int64_t vertex = 0; vertex < element.count; ++vertex) {
    for (std::size_t p = 0; p < row.size(); ++p) {
      const Property& property = element.properties[p];
      if (property.list_count) {
        values.skip(property);
      } else {
        row[p] = values.read(property, property.type);
      }
    }
    const auto at = [&](std::size_t i) { return row[static_cast<std::size_t>(column[i])]; };
    const std::string vertex_name = "vertex " + std::to_string(vertex);
    const Vector3 point(at(0), at(1), at(2));
    if (!point.allFinite()) values.fail(vertex_name + ": x, y and z must be finite");
    cloud.points_m.push_back(point);
    if (normal_columns == 3) {
      const Vector3 normal(at(3), at(4), at(5));
      const double length = normal.norm();
      if (!(length > 1e-6) || !std::isfinite(length)) {
        values.fail(vertex_name +
                    ": its normal must not be zero; omit nx, ny, nz to have "
                    "normals estimated");
      }
      cloud.normals.push_back(normal / length);
    }
    if (column[6] >= 0) {
      const double ratio = at(6);
      if (!(ratio >= 0.0 && ratio <= 1e6)) {
        values.fail(vertex_name + ": '" + shown_word(stiffness_property) +
                    "' must be a factor of 0 … 1e6");
      }
      cloud.stiffness_ratios.push_back(ratio);
    }
  }
  return cloud;
}

}  // namespace

PointCloud parse_ply(std::string_view bytes, const std::string& file_name,
                     const std::string& stiffness_property) {
  FileText text(bytes, file_name);
  const Header header = read_header(text);
  for (const Element& element : header.elements) {
    if (element.name == "vertex") {
      PointCloud cloud = read_vertices(text, header, element, stiffness_property);
      if (cloud.points_m.size() < CloudSurface::kMinPoints) {
        text.fail(std::to_string(cloud.points_m.size()) + " vertices: a surface needs at least " +
                  std::to_string(CloudSurface::kMinPoints));
      }
      return cloud;
    }
    if (element.properties.empty()) continue;
    Values values(text, header);
    for (std::int64_t i = 0; i < element.count; ++i) {
      for (const Property& property : element.properties) values.skip(property);
    }
  }
  text.fail("has no element 'vertex'");
}

std::string ply_text(const PointCloud& cloud) {
  std::string text = "ply\nformat binary_little_endian 1.0\nelement vertex " +
                     std::to_string(cloud.points_m.size()) +
                     "\nproperty float x\nproperty float y\nproperty float z\n";
  if (!cloud.normals.empty()) {
    text += "property float nx\nproperty float ny\nproperty float nz\n";
  }
  if (!cloud.stiffness_ratios.empty()) text += "property float stiffness_ratio\n";
  text += "end_header\n";
  static_assert(std::endian::native == std::endian::little);
  const auto append_number = [&](double number) {
    const auto raw = std::bit_cast<std::array<char, sizeof(float)>>(static_cast<float>(number));
    text.append(raw.data(), raw.size());
  };
  const auto append = [&](const Vector3& vector) {
    for (int axis = 0; axis < 3; ++axis) append_number(vector[axis]);
  };
  for (std::size_t i = 0; i < cloud.points_m.size(); ++i) {
    append(cloud.points_m[i]);
    if (!cloud.normals.empty()) append(cloud.normals[i]);
    if (!cloud.stiffness_ratios.empty()) append_number(cloud.stiffness_ratios[i]);
  }
  return text;
}

}  // namespace palpate::physics
