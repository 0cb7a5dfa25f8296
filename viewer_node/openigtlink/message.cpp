// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/openigtlink/message.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

namespace palpate::viewer::igtl {
namespace {

constexpr double kMillimetres = 1000.0;
constexpr std::uint64_t kPolynomial = 0x42F0E1EBA9EA3693;
constexpr std::uint64_t kNewton = 0x0B;  // derived SI unit
constexpr std::uint16_t kExtended = 2;   // version of headers with another one in the body
constexpr std::size_t kTransformBytes = 48;
// Of a transform that is taken for rigid, and the farthest.
constexpr double kNotRigid = 1e-3;
constexpr double kFarthest_m = 100.0;

constexpr std::array<std::uint64_t, 256> crc_table() {
  std::array<std::uint64_t, 256> table{};
  for (std::uint64_t i = 0; i < table.size(); ++i) {
    std::uint64_t crc = i << 56U;
    for (int bit = 0; bit < 8; ++bit) {
      crc = (crc << 1U) ^ ((crc >> 63U) != 0 ? kPolynomial : 0);
    }
    table[i] = crc;
  }
  return table;
}

template <class T>
void put(std::string& to, T value) {
  for (std::size_t i = sizeof(T); i-- > 0;) {
    to.push_back(static_cast<char>(static_cast<std::uint64_t>(value) >> (8 * i)));
  }
}
void put_float(std::string& to, double value) {
  put(to, std::bit_cast<std::uint32_t>(static_cast<float>(value)));
}
void put_text(std::string& to, std::string_view text, std::size_t bytes) {
  to.append(text.substr(0, bytes));
  to.append(bytes - std::min(bytes, text.size()), '\0');
}

template <class T>
T read(const char* from) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < sizeof(T); ++i) {
    value = (value << 8U) | static_cast<unsigned char>(from[i]);
  }
  return static_cast<T>(value);
}
std::string read_text(const char* from, std::size_t bytes) {
  const std::string_view all(from, bytes);
  return std::string(all.substr(0, all.find('\0')));
}

/// Seconds, and a fraction of 2^32.
std::uint64_t time_stamp(std::uint64_t at_ns) {
  constexpr std::uint64_t kSecond_ns = 1'000'000'000;
  return ((at_ns / kSecond_ns) << 32U) | (((at_ns % kSecond_ns) << 32U) / kSecond_ns);
}

std::string message(std::string_view type, std::string_view device, std::uint64_t at_ns,
                    const std::string& body) {
  std::string bytes;
  bytes.reserve(kHeaderBytes + body.size());
  put(bytes, std::uint16_t{1});
  put_text(bytes, type, kTypeBytes);
  put_text(bytes, device, kNameBytes);
  put(bytes, time_stamp(at_ns));
  put(bytes, std::uint64_t{body.size()});
  put(bytes, crc64(body));
  return bytes + body;
}

}  // namespace

std::uint64_t crc64(std::string_view bytes) noexcept {
  static constexpr std::array<std::uint64_t, 256> kTable = crc_table();
  std::uint64_t crc = 0;
  for (const char byte : bytes) {
    crc = kTable[(crc >> 56U) ^ static_cast<unsigned char>(byte)] ^ (crc << 8U);
  }
  return crc;
}

std::optional<Header> read_header(std::span<const char, kHeaderBytes> bytes) noexcept {
  const char* at = bytes.data();
  Header header{.version = read<std::uint16_t>(at)};
  header.type = read_text(at += sizeof(std::uint16_t), kTypeBytes);
  header.device = read_text(at += kTypeBytes, kNameBytes);
  at += kNameBytes + sizeof(std::uint64_t);  // and the time stamp
  header.body_bytes = read<std::uint64_t>(at);
  header.crc = read<std::uint64_t>(at + sizeof(std::uint64_t));
  const bool is_word = std::all_of(header.type.begin(), header.type.end(), [](char c) {
    return (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
  });
  if (header.version == 0 || header.version > kExtended || header.type.empty() || !is_word) {
    return std::nullopt;
  }
  return header;
}

std::string device_name(std::string_view name) {
  std::string plain(name.substr(0, kNameBytes));
  for (char& c : plain) {
    if (c < ' ' || c > '~') c = '?';
  }
  return plain;
}

std::string transform_message(std::string_view device, std::uint64_t at_ns, const Pose& pose) {
  std::string body;
  const Matrix3 turn = pose.linear();
  for (int column = 0; column < 3; ++column) {
    for (int row = 0; row < 3; ++row) put_float(body, turn(row, column));
  }
  for (int row = 0; row < 3; ++row) put_float(body, kMillimetres * pose.translation()[row]);
  return message("TRANSFORM", device, at_ns, body);
}

std::string force_message(std::string_view device, std::uint64_t at_ns, const Vector3& newton) {
  std::string body;
  put(body, std::uint8_t{3});
  put(body, std::uint8_t{0});
  // prefix (4 bits), then six times a unit (6 bits) and its exponent (4 bits)
  put(body, std::uint64_t{(kNewton << 54U) | (std::uint64_t{1} << 50U)});
  for (const double component : newton) put(body, std::bit_cast<std::uint64_t>(component));
  return message("SENSOR", device, at_ns, body);
}

std::string status_message(std::string_view device, std::uint64_t at_ns, Status code,
                           std::string_view text) {
  std::string body;
  put(body, static_cast<std::uint16_t>(code));
  put(body, std::uint64_t{0});
  put_text(body, "", kNameBytes);  // name of the error
  body.append(text);
  body.push_back('\0');
  return message("STATUS", device, at_ns, body);
}

std::string polydata_message(std::string_view device, std::uint64_t at_ns,
                             std::span<const float> vertices_m,
                             std::span<const std::uint32_t> triangles, const Pose& pose) {
  const auto points = static_cast<std::uint32_t>(vertices_m.size() / 3);
  const auto polygons = static_cast<std::uint32_t>(triangles.size() / 3);
  const std::uint32_t vertices = polygons == 0 ? points : 0;
  constexpr std::uint32_t kVertexBytes = 2 * sizeof(std::uint32_t);  // a count and its indices
  constexpr std::uint32_t kPolygonBytes = 4 * sizeof(std::uint32_t);
  std::string body;
  body.reserve(40 + 12 * std::size_t{points} + kVertexBytes * std::size_t{vertices} +
               kPolygonBytes * std::size_t{polygons});
  put(body, points);
  put(body, vertices);
  put(body, kVertexBytes * vertices);
  put(body, std::uint32_t{0});  // lines
  put(body, std::uint32_t{0});
  put(body, polygons);
  put(body, kPolygonBytes * polygons);
  put(body, std::uint32_t{0});  // strips
  put(body, std::uint32_t{0});
  put(body, std::uint32_t{0});  // attributes
  for (std::size_t i = 0; i < points; ++i) {
    const Vector3 place_m =
        pose * Vector3(vertices_m[3 * i], vertices_m[3 * i + 1], vertices_m[3 * i + 2]);
    for (const double coordinate_m : place_m) put_float(body, kMillimetres * coordinate_m);
  }
  for (std::uint32_t i = 0; i < vertices; ++i) {
    put(body, std::uint32_t{1});
    put(body, i);
  }
  for (std::size_t i = 0; i < polygons; ++i) {
    put(body, std::uint32_t{3});
    for (std::size_t k = 0; k < 3; ++k) put(body, triangles[3 * i + k]);
  }
  return message("POLYDATA", device, at_ns, body);
}

ReadTransform read_transform(const Header& header, std::string_view body) {
  if (header.version == kExtended) {
    // its own size, that of the metadata's index, of the metadata; the last two come at the end
    constexpr std::size_t kLeast = 12;
    if (body.size() < kLeast) return {.complaint = "has no extended header"};
    const std::size_t own = read<std::uint16_t>(body.data());
    const std::size_t more =
        std::size_t{read<std::uint16_t>(body.data() + 2)} + read<std::uint32_t>(body.data() + 4);
    if (own < kLeast || own > body.size() || more > body.size() - own) {
      return {.complaint = "its extended header is longer than it"};
    }
    body = body.substr(own, body.size() - own - more);
  }
  if (body.size() != kTransformBytes) {
    return {.complaint = "has " + std::to_string(body.size()) + " bytes instead of 48"};
  }
  std::array<double, kTransformBytes / sizeof(float)> numbers{};
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    numbers[i] = std::bit_cast<float>(read<std::uint32_t>(body.data() + sizeof(float) * i));
  }
  const Matrix3 turn = Eigen::Map<const Matrix3>(numbers.data());
  const Vector3 place_m = Eigen::Map<const Vector3>(numbers.data() + 9) / kMillimetres;
  if (!turn.allFinite() || !(place_m.norm() < kFarthest_m)) {
    return {.complaint = "has a number that is not finite, or is more than 100 m away"};
  }
  if (!(turn * turn.transpose()).isIdentity(kNotRigid) || turn.determinant() < 0.0) {
    return {.complaint = "is not rigid: a rotation and a translation are needed"};
  }
  ReadTransform result;
  result.pose.linear() = Quaternion(turn).normalized().toRotationMatrix();
  result.pose.translation() = place_m;
  return result;
}

}  // namespace palpate::viewer::igtl
