// SPDX-License-Identifier: Apache-2.0
#include "common/link/codec/viewer_codec.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <span>

#include "common/core/check.h"
#include "common/link/codec/run_wire.h"
#include "common/link/codec/scene_wire.h"
#include "foxglove/foxglove_subset.pb.h"
#include "palpate/v1/acknowledgement.pb.h"
#include "palpate/v1/hand_target.pb.h"
#include "palpate/v1/plot.pb.h"
#include "palpate/v1/scene.pb.h"
#include "palpate/v1/telemetry.pb.h"
#include "palpate/v1/tissue_change.pb.h"
#include "palpate/v1/viewer.pb.h"

namespace palpate {
namespace {

namespace pb = google::protobuf;

constexpr const char* kWorld = "world";
constexpr double kArrowMPerNewton = 0.02;  // 3 N, a device's peak, is 6 cm
constexpr double kArrowWidth_m = 0.002;
constexpr double kSmallestTip_m = 0.001;  // a point would be invisible
constexpr double kShortestArrow_m = 1e-5;

void add_file(const pb::FileDescriptor* file, std::set<std::string>& seen,
              pb::FileDescriptorSet& set) {
  if (!seen.insert(file->name()).second) return;
  for (int i = 0; i < file->dependency_count(); ++i) add_file(file->dependency(i), seen, set);
  file->CopyTo(set.add_file());
}

void put(std::uint64_t at_ns, pb::Timestamp& to) {
  to.set_seconds(static_cast<std::int64_t>(at_ns / 1'000'000'000));
  to.set_nanos(static_cast<std::int32_t>(at_ns % 1'000'000'000));
}
template <class Xyz>
void put(const Vector3& v, Xyz& to) {
  to.set_x(v.x());
  to.set_y(v.y());
  to.set_z(v.z());
}
template <class Wxyz>
void put(const Quaternion& q, Wxyz& to) {
  to.set_x(q.x());
  to.set_y(q.y());
  to.set_z(q.z());
  to.set_w(q.w());
}
void put(const ViewerHealth::Side& side, v1::Health::Side& to) {
  to.set_name(side.name);
  to.set_device_session_id(side.device_session_id);
  to.set_phase(static_cast<std::uint32_t>(side.phase));
  to.set_device_faults(side.device_faults);
  to.set_last_fault(static_cast<std::uint32_t>(side.last_fault));
  if (side.device) {
    to.set_guard(static_cast<std::uint32_t>(side.device->guard));
    put(side.device->measured_tool_position_world_m, *to.mutable_tool_position_world_m());
    put(side.device->measured_tool_orientation_world, *to.mutable_tool_orientation_world());
    put(side.device->force_on_hand_newton, *to.mutable_force_on_hand_newton());
  }
  if (side.requested_force_newton) {
    put(*side.requested_force_newton, *to.mutable_requested_force_on_hand_newton());
  }
  to.set_hand_holder(side.hand_holder);
  if (side.pointer) palpate::wire::put(*side.pointer, *to.mutable_pointer());
  to.set_workspace_scale_ratio(side.workspace_scale_ratio);
}
struct Rgba {
  double r, g, b, a;
};
void put(const Rgba& colour, foxglove::Color& to) {
  to.set_r(colour.r);
  to.set_g(colour.g);
  to.set_b(colour.b);
  to.set_a(colour.a);
}

/// By index in the scene, as on the page (viewer_node/web/src/colours.ts).
constexpr std::array kTissueColours{0xd8968a, 0x7d3f4a, 0xe2c58f, 0xa86a7c, 0xb9a6a0, 0x8f5a3c};
constexpr double kClear = 0.66;  // opacity of a tissue around another

Rgba tissue_colour(std::size_t tissue, double opacity) {
  const int rgb = kTissueColours[tissue % kTissueColours.size()];
  const auto part = [rgb](int shift) { return static_cast<double>((rgb >> shift) & 0xff) / 255.0; };
  return {part(16), part(8), part(0), opacity};
}

using Box = Eigen::AlignedBox3f;
Box box_of(const std::vector<float>& vertices_m) {
  Box box;
  for (std::size_t i = 0; i + 2 < vertices_m.size(); i += 3) {
    box.extend(Eigen::Vector3f(vertices_m[i], vertices_m[i + 1], vertices_m[i + 2]));
  }
  return box;
}

void add_ball(const Vector3& center_m, double radius_m, const Rgba& colour,
              foxglove::SceneEntity& entity) {
  foxglove::SpherePrimitive& ball = *entity.add_spheres();
  put(center_m, *ball.mutable_pose()->mutable_position());
  put(Quaternion::Identity(), *ball.mutable_pose()->mutable_orientation());
  put(Vector3::Constant(2.0 * radius_m), *ball.mutable_size());
  put(colour, *ball.mutable_color());
}

void add_arrow(const Vector3& from_m, const Vector3& force_newton, const Rgba& colour,
               foxglove::SceneEntity& entity) {
  const double length_m = kArrowMPerNewton * force_newton.norm();
  if (!(length_m > kShortestArrow_m)) return;
  foxglove::ArrowPrimitive& arrow = *entity.add_arrows();
  put(from_m, *arrow.mutable_pose()->mutable_position());
  // arrows point along +x
  put(Quaternion(Quaternion::FromTwoVectors(Vector3::UnitX(), force_newton)),
      *arrow.mutable_pose()->mutable_orientation());
  const double head_m = std::min(3.0 * kArrowWidth_m, 0.5 * length_m);
  arrow.set_shaft_length(length_m - head_m);
  arrow.set_shaft_diameter(kArrowWidth_m);
  arrow.set_head_length(head_m);
  arrow.set_head_diameter(2.0 * kArrowWidth_m);
  put(colour, *arrow.mutable_color());
}

}  // namespace

std::string schema_of(std::string_view message) {
  // referred to by name so that a static link keeps each of them
  const std::array published{v1::DeviceTelemetry::descriptor(),
                             v1::MofcTelemetry::descriptor(),
                             v1::PhysicsTelemetry::descriptor(),
                             v1::SceneState::descriptor(),
                             v1::MeshFrame::descriptor(),
                             v1::Health::descriptor(),
                             v1::MeshSteps::descriptor(),
                             v1::TaskMap::descriptor(),
                             v1::Marker::descriptor(),
                             v1::IdealForces::descriptor(),
                             v1::Telemetry::descriptor(),
                             foxglove::PointCloud::descriptor(),
                             foxglove::SceneUpdate::descriptor(),
                             foxglove::FrameTransforms::descriptor(),
                             foxglove::Log::descriptor()};
  const auto* const found = std::find_if(
      published.begin(), published.end(),
      [&](const pb::Descriptor* descriptor) { return descriptor->full_name() == message; });
  PALPATE_REQUIRE(found != published.end());
  pb::FileDescriptorSet set;
  std::set<std::string> seen;
  add_file((*found)->file(), seen, set);
  return set.SerializeAsString();
}

std::string encode_mesh_steps(const MeshSteps& steps) {
  v1::MeshSteps wire;
  wire.set_session_id(steps.session_id);
  wire.set_scene_revision(steps.scene_revision);
  wire.set_step_m(steps.step_m);
  for (const MeshSteps::Tissue& tissue : steps.tissues) {
    v1::MeshSteps::Tissue& to = *wire.add_tissues();
    to.set_tissue(tissue.tissue);
    to.mutable_runs()->Add(tissue.runs.begin(), tissue.runs.end());
    to.mutable_displacement_steps()->Add(tissue.displacement_steps.begin(),
                                         tissue.displacement_steps.end());
    if (tissue.offset_steps != std::array<std::int32_t, 3>{}) {
      to.mutable_offset_steps()->Add(tissue.offset_steps.begin(), tissue.offset_steps.end());
    }
  }
  return wire.SerializeAsString();
}

std::string encode_health(const ViewerHealth& health) {
  v1::Health wire;
  for (const ViewerHealth::Node& node : health.nodes) {
    v1::Health::Node& to = *wire.add_nodes();
    to.set_name(node.name);
    to.set_is_heard(node.is_heard);
    to.set_silence_s(node.silence_s);
    to.set_sessions(node.sessions);
    to.set_batches_lost(node.batches_lost);
    to.set_records_lost(node.records_lost);
  }
  wire.set_clients(health.clients);
  wire.set_messages_dropped(health.messages_dropped);
  wire.set_frames_rejected(health.frames_rejected);
  wire.set_hand_holder(health.hand_holder);
  wire.set_version(health.version);
  v1::Health::Recorder& recorder = *wire.mutable_recorder();
  recorder.set_is_possible(health.recorder.is_possible);
  recorder.set_is_recording(health.recorder.is_recording);
  recorder.set_file(health.recorder.file);
  recorder.set_length_s(health.recorder.length_s);
  recorder.set_problem(health.recorder.problem);
  palpate::wire::put(health.run, wire);
  if (health.task) palpate::wire::put(*health.task, *wire.mutable_task());
  for (const ViewerHealth::Side& side : health.sides) put(side, *wire.add_sides());
  return wire.SerializeAsString();
}

std::string encode_task_map(const TaskMap& map) {
  v1::TaskMap wire;
  wire.mutable_places_m()->assign(reinterpret_cast<const char*>(map.places_m.data()),
                                  map.places_m.size() * sizeof(map.places_m[0]));
  wire.mutable_is_searched()->assign(map.is_searched.begin(), map.is_searched.end());
  for (const TaskMap::Lesion& lesion : map.lesions) {
    v1::TaskMap::Lesion& out = *wire.add_lesions();
    out.set_name(lesion.name);
    put(lesion.center_m, *out.mutable_center_m());
    out.set_radius_m(lesion.radius_m);
    out.set_is_found(lesion.is_found);
  }
  wire.set_slot_s(map.slot_s);
  wire.mutable_most_newton()->Assign(map.most_newton.begin(), map.most_newton.end());
  wire.mutable_marks_s()->Assign(map.marks_s.begin(), map.marks_s.end());
  wire.set_limit_newton(map.limit_newton);
  return wire.SerializeAsString();
}

std::string encode_telemetry(std::uint64_t at_ns, const DeviceTick& device,
                             const std::optional<MofcTick>& mofc, double transparency) {
  v1::Telemetry wire;
  wire.set_timestamp(static_cast<double>(at_ns) * 1e-9);
  wire.set_device_sequence(device.sequence);
  put(device.measured_tool_position_world_m, *wire.mutable_tool_position_world_m());
  put(device.force_on_hand_newton, *wire.mutable_force_on_hand_newton());
  wire.set_applied_newton(device.force_on_hand_newton.norm());
  wire.set_true_energy_joule(device.true_energy_joule);
  wire.set_transparency(transparency);
  wire.set_reply_time_s(device.is_answered ? to_seconds(device.reply_time) : kNaN);
  wire.set_lateness_s(to_seconds(device.lateness));
  wire.set_guard(static_cast<v1::Telemetry::Guard>(device.guard));
  const MofcTick unknown{};
  const MofcTick& m = mofc ? *mofc : unknown;
  put(mofc ? m.requested_force_on_hand_newton : Vector3(Vector3::Constant(kNaN)),
      *wire.mutable_requested_force_on_hand_newton());
  wire.set_requested_newton(mofc ? m.requested_force_on_hand_newton.norm() : kNaN);
  wire.set_f_max_newton(m.f_max_newton.minCoeff());
  wire.set_ledger_energy_joule(m.ledger_energy_joule);
  wire.set_force_age_s(mofc ? to_seconds(m.force_age) : kNaN);
  wire.set_state(static_cast<v1::Telemetry::State>(m.state));
  wire.set_is_in_contact(m.is_in_contact);
  wire.set_is_clamped(m.is_clamped);
  if (device.has_wrist()) {
    put(m.requested_wrist_torque_newton_m, *wire.mutable_requested_wrist_torque_newton_m());
    put(device.wrist_torque_newton_m, *wire.mutable_wrist_torque_newton_m());
    wire.set_requested_newton_m(m.requested_wrist_torque_newton_m.norm());
    wire.set_applied_newton_m(device.wrist_torque_newton_m.norm());
  }
  return wire.SerializeAsString();
}

std::string encode_point_cloud(std::uint64_t at_ns, const std::vector<std::vector<float>>& parts) {
  foxglove::PointCloud wire;
  put(at_ns, *wire.mutable_timestamp());
  wire.set_frame_id(kWorld);
  wire.mutable_pose()->mutable_position();
  put(Quaternion::Identity(), *wire.mutable_pose()->mutable_orientation());
  wire.set_point_stride(3 * sizeof(float));
  std::uint32_t offset = 0;
  for (const char* name : {"x", "y", "z"}) {
    foxglove::PackedElementField& field = *wire.add_fields();
    field.set_name(name);
    field.set_offset(offset);
    field.set_type(foxglove::PackedElementField::FLOAT32);
    offset += sizeof(float);
  }
  for (const std::vector<float>& part : parts) {
    wire.mutable_data()->append(reinterpret_cast<const char*>(part.data()),
                                part.size() * sizeof(float));
  }
  return wire.SerializeAsString();
}

std::string encode_tissues(std::uint64_t at_ns, const SceneState& scene,
                           const std::vector<std::vector<float>>& vertices_m) {
  foxglove::SceneUpdate wire;
  std::vector<Box> boxes;
  for (const TissueSurface& tissue : scene.tissues) boxes.push_back(box_of(tissue.mesh.vertices_m));
  for (std::size_t i = 0; i < scene.tissues.size() && i < vertices_m.size(); ++i) {
    const TissueSurface& tissue = scene.tissues[i];
    if (tissue.mesh.triangles.empty()) continue;
    foxglove::SceneEntity& entity = *wire.add_entities();
    put(at_ns, *entity.mutable_timestamp());
    entity.set_frame_id(kWorld);
    entity.set_id("tissue " + tissue.name);  // names differ within a session
    foxglove::TriangleListPrimitive& surface = *entity.add_triangles();
    surface.mutable_pose()->mutable_position();
    put(Quaternion::Identity(), *surface.mutable_pose()->mutable_orientation());
    const bool is_around = std::any_of(boxes.begin(), boxes.end(), [&](const Box& other) {
      return &other != &boxes[i] && !other.isEmpty() && boxes[i].contains(other);
    });
    put(tissue_colour(i, is_around ? kClear : 1.0), *surface.mutable_color());
    const std::vector<float>& at_m = vertices_m[i];
    for (std::size_t v = 0; v + 2 < at_m.size(); v += 3) {
      foxglove::Point3& point = *surface.add_points();
      point.set_x(static_cast<double>(at_m[v]));
      point.set_y(static_cast<double>(at_m[v + 1]));
      point.set_z(static_cast<double>(at_m[v + 2]));
    }
    surface.mutable_indices()->Add(tissue.mesh.triangles.begin(), tissue.mesh.triangles.end());
  }
  return wire.SerializeAsString();
}

std::string encode_tool(std::uint64_t at_ns, const DeviceTick& device, const SceneState& scene,
                        const Vector3& requested_newton) {
  const Vector3& tip_m = device.measured_tool_position_world_m;
  const Quaternion& orientation = device.measured_tool_orientation_world;
  foxglove::SceneUpdate wire;
  foxglove::SceneEntity& entity = *wire.add_entities();
  put(at_ns, *entity.mutable_timestamp());
  entity.set_frame_id(kWorld);
  entity.set_id("tool");
  add_ball(tip_m, std::max(scene.tip_radius_m, kSmallestTip_m), {0.75, 0.75, 0.8, 1.0}, entity);
  if (scene.shaft_length_m > 0.0) {
    const Rgba glass{0.75, 0.75, 0.8, 0.35};  // the force arrows remain visible
    const Vector3 shaft_m = orientation * Vector3(0.0, 0.0, scene.shaft_length_m);
    foxglove::CylinderPrimitive& shaft = *entity.add_cylinders();
    put(Vector3(tip_m + 0.5 * shaft_m), *shaft.mutable_pose()->mutable_position());
    put(orientation, *shaft.mutable_pose()->mutable_orientation());  // cylinders stand along +z
    const double width_m = 2.0 * scene.shaft_radius_m;
    put(Vector3(width_m, width_m, scene.shaft_length_m), *shaft.mutable_size());
    shaft.set_bottom_scale(1.0);
    shaft.set_top_scale(1.0);
    put(glass, *shaft.mutable_color());
    add_ball(tip_m + shaft_m, scene.shaft_radius_m, glass, entity);
  }
  add_arrow(tip_m, requested_newton, {0.95, 0.6, 0.1, 0.6}, entity);
  add_arrow(tip_m, device.force_on_hand_newton, {0.1, 0.55, 0.95, 1.0}, entity);
  return wire.SerializeAsString();
}

std::string encode_transforms(std::uint64_t at_ns, const std::string& frame,
                              const DeviceTick& device) {
  foxglove::FrameTransforms wire;
  foxglove::FrameTransform& tool = *wire.add_transforms();
  put(at_ns, *tool.mutable_timestamp());
  tool.set_parent_frame_id(kWorld);
  tool.set_child_frame_id(frame);
  put(device.measured_tool_position_world_m, *tool.mutable_translation());
  put(device.measured_tool_orientation_world, *tool.mutable_rotation());
  return wire.SerializeAsString();
}

std::string encode_log(std::uint64_t at_ns, LogLevel level, const std::string& node,
                       const std::string& message) {
  foxglove::Log wire;
  put(at_ns, *wire.mutable_timestamp());
  wire.set_level(static_cast<foxglove::Log::Level>(level));
  wire.set_message(message);
  wire.set_name(node);
  return wire.SerializeAsString();
}

namespace {

/// Message T of a page, whose header viewer_node sets; the codec checks the result.
template <class T, class Wire>
std::optional<T> decode_of_page(std::string_view payload, void (*complete)(Wire&)) {
  Wire wire;
  if (payload.size() > kMaxFrameBytes<T> ||
      !wire.ParseFromArray(payload.data(), static_cast<int>(payload.size()))) {
    return std::nullopt;
  }
  wire.mutable_header()->set_protocol_major(kProtocolMajor);
  wire.mutable_header()->set_session_id(1);
  wire.mutable_header()->set_sampled_at_ns(0);
  complete(wire);
  const std::string frame = static_cast<char>(kKindOf<T>) + wire.SerializeAsString();
  T message;
  const auto bytes = std::as_bytes(std::span(frame));
  if (Codec<T>().decode(bytes, message) != DecodeError::kNone) return std::nullopt;
  return message;
}

}  // namespace

std::optional<HandTarget> decode_page_target(std::string_view payload) {
  return decode_of_page<HandTarget, v1::HandTarget>(
      payload, [](v1::HandTarget& wire) { wire.set_holder_id(1); });
}

std::optional<TissueChange> decode_page_change(std::string_view payload) {
  return decode_of_page<TissueChange, v1::TissueChange>(payload, [](v1::TissueChange&) {});
}

std::optional<Acknowledgement> decode_page_acknowledgement(std::string_view payload) {
  return decode_of_page<Acknowledgement, v1::Acknowledgement>(payload, [](v1::Acknowledgement&) {});
}

std::optional<RunRequest> decode_page_request(std::string_view payload) {
  return decode_of_page<RunRequest, v1::RunRequest>(payload, [](v1::RunRequest&) {});
}

}  // namespace palpate
