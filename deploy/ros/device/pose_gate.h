// SPDX-License-Identifier: Apache-2.0
// pose_gate.h — which poses of a device beyond our control count, and its axes. Knows nothing of
// how they come.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "common/core/time.h"
#include "common/core/vector.h"
#include "deploy/ros/dds/one_source.h"

namespace palpate::ros {

/// Frame B is that of the poses and forces of the device, D that of device_node (palpate_device.h).
struct DeviceAxes {
  Matrix3 device_from_base = Matrix3::Identity();  ///< a rotation
  Vector3 center_m = Vector3::Zero();              ///< B, the origin of D

  /// @param text  what x, y and z of D are in B: "-y x z"
  /// @throws SetupError  not three different axes of a right-handed frame
  [[nodiscard]] static Matrix3 rotation_of(const std::string& text);
};

/// As received.
struct DevicePose {
  std::uint64_t source = 0;  ///< which writer; not 0
  std::int64_t stamp_ns = 0;
  std::string_view frame;
  Vector3 position_m = Vector3::Zero();             ///< B; after judge() D
  Quaternion orientation = Quaternion::Identity();  ///< into B; after judge() into D, unit
  bool is_known_type = true;                        ///< false: its fields may be others
};

/// Why a pose does not count.
enum class PoseRefusal : std::uint8_t {
  kNone,
  kUnknownType,
  kOtherSource,  ///< another one is heard
  kNoPose,       ///< NaN, or no rotation
  kOtherFrame,
  kNotNewer,  ///< repeated or reordered
};
inline constexpr std::size_t kPoseRefusals = 6;
/// For people: what it is and what helps.
[[nodiscard]] const char* explain(PoseRefusal refusal);

/// Of one device. One thread; no allocation but for the name of the frame.
class PoseGate {
 public:
  /// @param frame  of the poses; empty: that of the first one of a source
  PoseGate(DeviceAxes axes, std::string frame)
      : axes_(std::move(axes)), frame_(std::move(frame)), is_frame_given_(!frame_.empty()) {}

  /// @param pose  is put into D unless it is refused
  [[nodiscard]] PoseRefusal judge(DevicePose& pose, TimePoint now);
  /// A force of D in B.
  [[nodiscard]] Vector3 in_base(const Vector3& v) const noexcept {
    return axes_.device_from_base.transpose() * v;
  }
  [[nodiscard]] const std::string& frame() const noexcept { return frame_; }

 private:
  DeviceAxes axes_;
  std::string frame_;
  bool is_frame_given_;
  OneSource arm_;
};

}  // namespace palpate::ros
