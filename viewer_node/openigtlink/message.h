// SPDX-License-Identifier: Apache-2.0
// message.h — messages of OpenIGTLink, the protocol of 3D Slicer and of trackers, as bytes.
// Big-endian: a header of 58 bytes with the CRC of the body, then the body. Lengths are in
// millimetres there, and in metres here.
//
// The protocol's versions 1 and 2 have the same header, whose version is 1; version 3 has 2 there
// and an extended header in the body, which is skipped. What is written is of version 1 (TRANSFORM,
// STATUS) and 2 (SENSOR, POLYDATA).
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "common/core/vector.h"

namespace palpate::viewer::igtl {

inline constexpr std::size_t kHeaderBytes = 58;
inline constexpr std::size_t kTypeBytes = 12;
inline constexpr std::size_t kNameBytes = 20;

/// A rigid transform.
using Pose = Eigen::Transform<double, 3, Eigen::Isometry>;

/// Of ECMA-182: polynomial 42F0E1EBA9EA3693, not reflected, from 0.
[[nodiscard]] std::uint64_t crc64(std::string_view bytes) noexcept;

/// What begins every message.
struct Header {
  std::uint16_t version = 1;
  std::string type{};    ///< at most kTypeBytes
  std::string device{};  ///< at most kNameBytes
  std::uint64_t body_bytes = 0;
  std::uint64_t crc = 0;
};
/// Nothing if it cannot be a header: version 0 or above 2, or a type that is no word.
[[nodiscard]] std::optional<Header> read_header(std::span<const char, kHeaderBytes> bytes) noexcept;

/// A name as the wire takes it: at most kNameBytes, '?' for what is not printable ASCII.
[[nodiscard]] std::string device_name(std::string_view name);

/// @param at_ns  since 1970
[[nodiscard]] std::string transform_message(std::string_view device, std::uint64_t at_ns,
                                            const Pose& pose);
/// A force in N.
[[nodiscard]] std::string force_message(std::string_view device, std::uint64_t at_ns,
                                        const Vector3& newton);

/// Codes of STATUS that are used.
enum class Status : std::uint16_t {
  kOk = 1,
  kSilent = 7,            ///< time out
  kChecksum = 9,          ///< of what came
  kConfiguration = 10,    ///< what came cannot be used
  kNotReady = 13,         ///< the device gives no force yet
  kHardwareFailure = 18,  ///< a fault of the device is latched
};
[[nodiscard]] std::string status_message(std::string_view device, std::uint64_t at_ns, Status code,
                                         std::string_view text);

/// A surface; without triangles its vertices as points.
/// @param vertices_m  x,y,z,…   @param pose  applied to them
/// @param triangles   three indices each
[[nodiscard]] std::string polydata_message(std::string_view device, std::uint64_t at_ns,
                                           std::span<const float> vertices_m,
                                           std::span<const std::uint32_t> triangles,
                                           const Pose& pose);

/// The pose of a TRANSFORM, or why it is none.
struct ReadTransform {
  Pose pose = Pose::Identity();
  std::string complaint{};
};
/// @param body  whose CRC is right
[[nodiscard]] ReadTransform read_transform(const Header& header, std::string_view body);

}  // namespace palpate::viewer::igtl
