// SPDX-License-Identifier: Apache-2.0
// viewer_codec.h — the protobuf messages that viewer_node sends to its web clients, and the one
// that it receives from them. They are payloads of the Foxglove protocol, without the kind byte.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/scene_messages.h"
#include "common/link/codec/codec.h"
#include "common/telemetry/metrics.h"
#include "common/telemetry/telemetry.h"

namespace palpate {

/// The serialised FileDescriptorSet of a message and its dependencies, dependencies first.
/// @param message  full name of a message that viewer_node publishes or a recording holds,
///     e.g. "palpate.v1.SceneState"
[[nodiscard]] std::string schema_of(std::string_view message);

/// The encoded protobuf message without the kind byte.
template <class T>
[[nodiscard]] std::string payload_of(Codec<T>& codec, const T& message) {
  std::string frame(codec.encode(message), '\0');
  codec.write(reinterpret_cast<std::byte*>(frame.data()));
  frame.erase(0, 1);
  return frame;
}

/// palpate.v1.Health.
struct ViewerHealth {
  struct Node {
    std::string name;
    bool is_heard = false;
    double silence_s = -1.0;
    std::uint64_t sessions = 0;
    std::uint64_t batches_lost = 0;
    std::uint64_t records_lost = 0;
  };
  std::vector<Node> nodes{};
  std::uint32_t clients = 0;
  std::uint64_t messages_dropped = 0;
  std::uint64_t frames_rejected = 0;
  std::uint64_t hand_holder = 0;
  std::string version{};
  struct Recorder {
    bool is_possible = false;
    bool is_recording = false;
    std::string file{};
    double length_s = 0.0;
    std::string problem{};
  };
  Recorder recorder{};
  RunState run{};
  std::optional<TaskState> task{};
  /// Of a session with several.
  struct Side {
    std::string name;
    std::uint64_t device_session_id = 0;
    DevicePhase phase = DevicePhase::kUnknown;
    std::uint64_t device_faults = 0;
    FaultReason last_fault = FaultReason::kNone;
    std::optional<DeviceTick> device{};               ///< the newest one
    std::optional<Vector3> requested_force_newton{};  ///< on the hand
    std::uint64_t hand_holder = 0;
    std::optional<PointerConfig> pointer{};
    double workspace_scale_ratio = 1.0;
  };
  std::vector<Side> sides{};
};
[[nodiscard]] std::string encode_health(const ViewerHealth& health);

/// palpate.v1.TaskMap.
[[nodiscard]] std::string encode_task_map(const TaskMap& map);

/// palpate.v1.Telemetry. @param at_ns  since 1970
[[nodiscard]] std::string encode_telemetry(std::uint64_t at_ns, const DeviceTick& device,
                                           const std::optional<MofcTick>& mofc,
                                           double transparency);

/// palpate.v1.MeshSteps.
struct MeshSteps {
  struct Tissue {
    std::uint32_t tissue = 0;
    std::vector<std::uint32_t> runs{};
    std::vector<std::int32_t> displacement_steps{};
    std::array<std::int32_t, 3> offset_steps{};
  };
  std::uint64_t session_id = 0;
  std::uint64_t scene_revision = 0;
  double step_m = 0.0;
  std::vector<Tissue> tissues{};
};
[[nodiscard]] std::string encode_mesh_steps(const MeshSteps& steps);

// Foxglove's own schemas, all in frame "world".

/// foxglove.PointCloud of float32 x, y, z. @param parts  x,y,z,x,y,z,… of each part
[[nodiscard]] std::string encode_point_cloud(std::uint64_t at_ns,
                                             const std::vector<std::vector<float>>& parts);

/// foxglove.SceneUpdate: the surfaces of the tissues where they are now, in the page's colours;
/// those around others are transparent. Entities are named "tissue NAME"; tissues of points are
/// left out.
/// @param vertices_m  x,y,z,x,y,z,… of each tissue of the scene
[[nodiscard]] std::string encode_tissues(std::uint64_t at_ns, const SceneState& scene,
                                         const std::vector<std::vector<float>>& vertices_m);

/// foxglove.SceneUpdate: the tool's tip and shaft, and the requested and rendered force on the hand
/// as arrows. @param scene  for the size of the tool
[[nodiscard]] std::string encode_tool(std::uint64_t at_ns, const DeviceTick& device,
                                      const SceneState& scene, const Vector3& requested_newton);

/// foxglove.FrameTransforms: the tool's frame in "world".
[[nodiscard]] std::string encode_transforms(std::uint64_t at_ns, const std::string& frame,
                                            const DeviceTick& device);

/// Values as in foxglove.Log.
enum class LogLevel : std::uint8_t { kInfo = 2, kWarning = 3, kError = 4 };

/// foxglove.Log. @param node  the source of the message
[[nodiscard]] std::string encode_log(std::uint64_t at_ns, LogLevel level, const std::string& node,
                                     const std::string& message);

/// The HandTarget that a page sent, with position and release only; empty if it is not valid.
[[nodiscard]] std::optional<HandTarget> decode_page_target(std::string_view payload);
/// The TissueChange that a page sent; empty if it is not valid.
[[nodiscard]] std::optional<TissueChange> decode_page_change(std::string_view payload);
/// The Acknowledgement that a page sent; empty if it is not valid.
[[nodiscard]] std::optional<Acknowledgement> decode_page_acknowledgement(std::string_view payload);
/// The RunRequest that a page sent; empty if it is not valid.
[[nodiscard]] std::optional<RunRequest> decode_page_request(std::string_view payload);

/// The force of the continuous tissue at one device tick, as TickRow has it.
struct IdealForce {
  TimePoint sampled_at{};  ///< of the tick, device's clock
  Vector3 force_on_hand_newton = Vector3::Zero();
  bool is_in_contact = false;
  std::optional<ForceComparison> comparison{};  ///< TickRow::to_ideal
  /// IdealState::tool_position_world_m; NaN: not recorded.
  Vector3 ideal_tool_position_world_m = Vector3::Constant(kNaN);
};
/// Of consecutive ticks of one device.
struct IdealForces {
  std::string side{};
  std::vector<IdealForce> records{};
};
/// palpate.v1.IdealForces, as recorded. Of decoding: empty if it is not valid.
[[nodiscard]] std::string encode_ideal(const IdealForces& ideal);
[[nodiscard]] std::optional<IdealForces> decode_ideal(std::string_view payload);

/// palpate.v1.Marker, as recorded. Of decoding: empty if it is not valid.
[[nodiscard]] std::string encode_marker(const Marker& marker);
[[nodiscard]] std::optional<Marker> decode_marker(std::string_view payload);

}  // namespace palpate
