// SPDX-License-Identifier: Apache-2.0
// NIfTI: nifti1.h and nifti2.h of the NIfTI Data Format Working Group.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <optional>
#include <vector>

#include "common/core/check.h"
#include "deploy/scan/byte_source.h"
#include "deploy/scan/label_map.h"

namespace palpate::scan {
namespace {

constexpr std::size_t kHeader1 = 348;
constexpr std::size_t kHeader2 = 540;
constexpr std::size_t kMostExtensions = 1 << 20;

/// A header of either version, by the offsets of its fields.
class Header {
 public:
  Header(std::vector<char> bytes, std::endian endian, std::string name)
      : bytes_(std::move(bytes)), endian_(endian), name_(std::move(name)) {}

  template <class T>
  [[nodiscard]] T get(std::size_t offset) const {
    std::array<char, sizeof(T)> raw;
    std::memcpy(raw.data(), bytes_.data() + offset, sizeof(T));
    if (endian_ != std::endian::native) std::reverse(raw.begin(), raw.end());
    return std::bit_cast<T>(raw);
  }
  [[nodiscard]] bool is_second() const { return bytes_.size() == kHeader2; }
  /// A number that is short in version 1 and long in version 2, and so on.
  template <class T1, class T2>
  [[nodiscard]] T2 either(std::size_t first, std::size_t second) const {
    return is_second() ? get<T2>(second) : static_cast<T2>(get<T1>(first));
  }
  /// A real number, which must be finite.
  [[nodiscard]] double real(const char* field, std::size_t first, std::size_t second) const {
    const double value = either<float, double>(first, second);
    if (!std::isfinite(value)) fail(field, value, "must be finite; save the file again");
    return value;
  }
  template <class T>
  [[noreturn]] void fail(const std::string& field, T value, const std::string& rule) const {
    throw SetupError(name_ + ": " + field + " = " + std::to_string(value) + ": " + rule);
  }
  [[nodiscard]] std::endian endian() const { return endian_; }

 private:
  std::vector<char> bytes_;
  std::endian endian_;
  std::string name_;
};

Header read_header(ByteSource& source, const std::string& name) {
  std::vector<char> bytes(kHeader1);
  source.read(bytes);
  std::int32_t size = 0;
  std::memcpy(&size, bytes.data(), sizeof size);
  std::endian endian = std::endian::native;
  const auto is_size = [](std::int32_t s) {
    return s == static_cast<std::int32_t>(kHeader1) || s == static_cast<std::int32_t>(kHeader2);
  };
  if (!is_size(size)) {
    size = static_cast<std::int32_t>(__builtin_bswap32(static_cast<std::uint32_t>(size)));
    endian = std::endian::native == std::endian::little ? std::endian::big : std::endian::little;
  }
  if (!is_size(size)) {
    throw SetupError(name + ": is not a NIfTI file: sizeof_hdr must be 348 or 540");
  }
  const std::size_t magic_at = size == static_cast<std::int32_t>(kHeader2) ? 4 : 344;
  if (magic_at == 4) {
    bytes.resize(kHeader2);
    source.read(std::span(bytes).subspan(kHeader1));
  }
  const std::string_view magic(bytes.data() + magic_at, 3);
  if (magic == "ni1" || magic == "ni2") {
    throw SetupError(name +
                     ": has its voxels in another file (.hdr and .img): must be one file; save it "
                     "as .nii.gz");
  }
  if (magic != (magic_at == 4 ? "n+2" : "n+1") || bytes[magic_at + 3] != '\0') {
    throw SetupError(name + ": is not a NIfTI file: magic must be n+1 or n+2");
  }
  return {std::move(bytes), endian, name};
}

std::optional<ValueType> type_of(int datatype) {
  switch (datatype) {
    case 2:
      return ValueType::kUint8;
    case 4:
      return ValueType::kInt16;
    case 8:
      return ValueType::kInt32;
    case 16:
      return ValueType::kFloat;
    case 64:
      return ValueType::kDouble;
    case 256:
      return ValueType::kInt8;
    case 512:
      return ValueType::kUint16;
    case 768:
      return ValueType::kUint32;
    case 1024:
      return ValueType::kInt64;
    case 1280:
      return ValueType::kUint64;
    default:
      return std::nullopt;
  }
}

Eigen::Affine3d sform_of(const Header& header) {
  Eigen::Affine3d affine = Eigen::Affine3d::Identity();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      const auto at = 4 * static_cast<std::size_t>(row) + static_cast<std::size_t>(column);
      affine(row, column) = header.real("srow", 280 + 4 * at, 400 + 8 * at);
    }
  }
  return affine;
}

/// nifti1.h, method 2: R diag(pixdim) with the third axis mirrored where pixdim[0] is −1.
Eigen::Affine3d qform_of(const Header& header) {
  const double b = header.real("quatern_b", 256, 352);
  const double c = header.real("quatern_c", 260, 360);
  const double d = header.real("quatern_d", 264, 368);
  const double rest = 1.0 - (b * b + c * c + d * d);
  // rounding of the three to float may make them a little longer than 1
  if (!(rest > -1e-4)) {
    header.fail("quatern_b² + quatern_c² + quatern_d²", 1.0 - rest,
                "must be at most 1; save it again");
  }
  const Quaternion rotation = Quaternion(std::sqrt(std::max(rest, 0.0)), b, c, d).normalized();
  const double mirror = header.real("pixdim[0]", 76, 104) < 0.0 ? -1.0 : 1.0;
  Vector3 pixel;
  Vector3 offset;
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    pixel[axis] = header.real("pixdim", 80 + 4 * i, 112 + 8 * i);
    offset[axis] = header.real("qoffset", 268 + 4 * i, 376 + 8 * i);
  }
  if (!(pixel.minCoeff() > 0.0)) header.fail("pixdim", pixel.minCoeff(), "must be above 0");
  pixel.z() *= mirror;
  Eigen::Affine3d affine = Eigen::Affine3d::Identity();
  affine.linear() = rotation.toRotationMatrix() * pixel.asDiagonal();
  affine.translation() = offset;
  return affine;
}

Eigen::Affine3d affine_of(const Header& header, const std::array<std::uint64_t, 3>& size,
                          const std::string& name, std::vector<std::string>& notes) {
  const bool has_sform = header.either<std::int16_t, std::int32_t>(254, 348) > 0;
  const bool has_qform = header.either<std::int16_t, std::int32_t>(252, 344) > 0;
  if (!has_sform && !has_qform) {
    throw SetupError(name +
                     ": sform_code and qform_code are 0: the file does not say which side of the "
                     "patient is left; export the segmentation again, with its geometry");
  }
  Eigen::Affine3d affine = has_sform ? sform_of(header) : qform_of(header);
  notes.emplace_back(has_sform ? "orientation from the matrix of the file (sform)"
                               : "orientation from the quaternion of the file (qform)");
  if (has_sform && has_qform) {
    const Eigen::Affine3d other = qform_of(header);
    double largest = 0.0;
    for (int corner = 0; corner < 8; ++corner) {
      const Vector3 index(corner & 1 ? static_cast<double>(size[0]) - 1.0 : 0.0,
                          corner & 2 ? static_cast<double>(size[1]) - 1.0 : 0.0,
                          corner & 4 ? static_cast<double>(size[2]) - 1.0 : 0.0);
      largest = std::max(largest, (affine * index - other * index).norm());
    }
    if (largest > affine.linear().colwise().norm().maxCoeff()) {
      notes.emplace_back(
          "WARNING: the quaternion of the file (qform) says otherwise; the matrix counts");
    }
  }
  // bits 0 … 2 of xyzt_units: 1 m, 2 mm, 3 µm
  const int unit = (header.is_second() ? header.get<std::int32_t>(500) : header.get<char>(123)) & 7;
  if (unit == 0) notes.emplace_back("the file gives no unit of length: millimetres assumed");
  if (unit > 3) header.fail("xyzt_units", unit, "the unit of length must be m, mm or µm");
  const double scale = unit == 1 ? 1.0 : unit == 3 ? 1e-6 : 1e-3;
  affine.matrix().topRows<3>() *= scale;
  return affine;
}

/// Names by value from the label table (XML) that Connectome Workbench and TotalSegmentator put
/// into a header extension: <Label Key="1" …>name</Label>, or with <![CDATA[name]]>.
std::vector<Segment> table_of(std::string_view extensions) {
  std::vector<Segment> table;
  constexpr std::string_view kBegin = "<Label ";
  constexpr std::string_view kData = "<![CDATA[";
  for (std::size_t at = extensions.find(kBegin); at != std::string_view::npos;
       at = extensions.find(kBegin, at + 1)) {
    const std::size_t close = extensions.find('>', at);
    const std::size_t end = extensions.find("</Label>", at);
    const std::size_t key = extensions.find("Key=\"", at);
    if (end == std::string_view::npos) break;
    if (close > end || key > close) continue;
    std::uint32_t value = 0;
    std::size_t digit = key + 5;
    while (digit < close && extensions[digit] >= '0' && extensions[digit] <= '9' &&
           value <= 65'535) {
      value = 10 * value + static_cast<std::uint32_t>(extensions[digit++] - '0');
    }
    std::string_view text = extensions.substr(close + 1, end - close - 1);
    if (text.starts_with(kData) && text.ends_with("]]>")) {
      text = text.substr(kData.size(), text.size() - kData.size() - 3);
    }
    if (digit == key + 5 || extensions[digit] != '"' || value == 0 || value > 65'535) continue;
    table.push_back({.value = value, .name = std::string(text)});
  }
  return table;
}

}  // namespace

LabelMap parse_nifti(std::string_view bytes, const std::string& name) {
  ByteSource source(bytes, is_gzip(bytes), name);
  const Header header = read_header(source, name);
  const auto dim = [&](std::size_t i) {
    return header.either<std::int16_t, std::int64_t>(40 + 2 * i, 16 + 8 * i);
  };

  if (dim(0) < 3 || dim(0) > 7) header.fail("dim[0]", dim(0), "a label map must have 3 dimensions");
  std::array<std::uint64_t, 3> size{};
  for (std::size_t i = 0; i < 3; ++i) {
    if (dim(i + 1) < 1)
      header.fail("dim[" + std::to_string(i + 1) + "]", dim(i + 1), "must be at least 1");
    size[i] = static_cast<std::uint64_t>(dim(i + 1));
  }
  for (std::size_t i = 4; i <= static_cast<std::size_t>(dim(0)); ++i) {
    if (dim(i) != 1) {
      header.fail("dim[" + std::to_string(i) + "]", dim(i),
                  "must be 1: one label map; save the time or channel that is wanted");
    }
  }
  const int datatype = header.either<std::int16_t, std::int16_t>(70, 12);
  const std::optional<ValueType> type = type_of(datatype);
  if (!type)
    header.fail("datatype", datatype,
                "must be whole or real numbers; save labels as unsigned char");

  std::vector<std::string> notes;
  const Eigen::Affine3d affine = affine_of(header, size, name, notes);
  check_grid(size, 1, affine, name);
  // a slope of 0 means not scaled; NaN, which other programs write for the same, too
  double slope = header.either<float, double>(112, 176);
  double inter = header.either<float, double>(116, 184);
  if (!std::isfinite(slope) || !std::isfinite(inter)) {
    notes.emplace_back("scl_slope or scl_inter is not a number: values taken as they are");
    slope = 0.0;
    inter = 0.0;
  }

  const double offset_value = header.is_second()
                                  ? static_cast<double>(header.get<std::int64_t>(168))
                                  : double{header.get<float>(108)};
  const std::size_t head = header.is_second() ? kHeader2 : kHeader1;
  if (!(offset_value >= static_cast<double>(head) && offset_value <= 1e9)) {
    header.fail("vox_offset", offset_value, "must be behind the header, up to 1e9");
  }
  auto between = static_cast<std::uint64_t>(offset_value) - head;
  std::string extensions(std::min<std::uint64_t>(between, kMostExtensions), '\0');
  source.read(extensions);
  source.skip(between - extensions.size());

  source.expect(size[0] * size[1] * size[2] * bytes_of(*type));
  Layer layer(size[0] * size[1] * size[2]);
  constexpr std::size_t kPiece = 65'536;
  std::vector<double> values;
  const bool is_scaled = slope != 0.0 && !(slope == 1.0 && inter == 0.0);
  for (std::size_t begin = 0; begin < layer.size(); begin += values.size()) {
    values.resize(std::min(kPiece, layer.size() - begin));
    read_values(source, *type, header.endian(), values);
    for (std::size_t i = 0; i < values.size(); ++i) {
      double value = values[i];
      // scaled numbers are rounded: they come from 32 bits
      if (is_scaled) {
        value = slope * value + inter;
        if (std::abs(value - std::round(value)) < 1e-3) value = std::round(value);
      }
      layer[begin + i] = label_of(value, begin + i, name);
    }
  }
  source.finish();

  // a table may name labels that are not there, and need not name all that are
  std::vector<Segment> names = table_of(extensions);
  std::vector<Layer> layers;
  layers.push_back(std::move(layer));
  LabelMap map = label_map_of(size, affine, std::move(layers), {}, name);
  for (Segment& segment : map.segments) {
    for (const Segment& named : names) {
      if (named.value == segment.value && !named.name.empty()) segment.name = named.name;
    }
  }
  map.notes.insert(map.notes.begin(), notes.begin(), notes.end());
  return map;
}

}  // namespace palpate::scan
