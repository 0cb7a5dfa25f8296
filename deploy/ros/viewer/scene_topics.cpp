// SPDX-License-Identifier: Apache-2.0
#include "deploy/ros/viewer/scene_topics.h"

#include <vector>

#include "common/core/clock.h"

namespace palpate::ros {
namespace {

// of visualization_msgs/Marker
constexpr std::int32_t kPoints = 8;
constexpr std::int32_t kTriangleList = 11;
constexpr double kPointSize_m = 0.001;
constexpr std_msgs_msg_dds__ColorRGBA_ kTissueColor{.r = 0.85F, .g = 0.6F, .b = 0.5F, .a = 0.8F};

TransformStamped transform_of(std::int64_t at_ns, const std::string& child,
                              const Vector3& position_m, const Quaternion& orientation) {
  return {.header = header_of(at_ns, kWorldFrame),
          .child_frame_id = borrowed(child),
          .transform = {.translation = xyz<geometry_msgs_msg_dds__Vector3_>(position_m),
                        .rotation = quaternion_of(orientation)}};
}

void write(Writer<TFMessage>& out, std::vector<TransformStamped>& transforms) {
  if (transforms.empty()) return;
  out.write({.transforms = sequence_of<dds_sequence_geometry_msgs_msg_dds__TransformStamped_>(
                 transforms.data(), transforms.size())});
}

/// The corners of every triangle, or the vertices.
std::vector<Point> points_of(const SurfaceMesh& mesh) {
  std::vector<Point> points;
  if (mesh.triangles.empty()) {
    points.reserve(mesh.vertex_count());
    for (std::uint32_t i = 0; i < mesh.vertex_count(); ++i) {
      points.push_back(xyz<Point>(mesh.vertex_m(i)));
    }
  } else {
    points.reserve(mesh.triangles.size());
    for (const std::uint32_t corner : mesh.triangles) {
      points.push_back(xyz<Point>(mesh.vertex_m(corner)));
    }
  }
  return points;
}

}  // namespace

SceneTopics::SceneTopics(Node& node, const std::string& name_space)
    : frames_out_(node.writer<TFMessage>("tf", Offer::kReliable)),
      static_frames_out_(node.writer<TFMessage>("tf_static", Offer::kLatched)),
      markers_out_(node.writer<Marker>(name_space + "/tissues", Offer::kLatched)) {}

void SceneTopics::write_bases(const Session& session, std::span<SideTopics* const> sides) {
  std::vector<TransformStamped> bases;
  for (std::size_t i = 0; i < sides.size(); ++i) {
    bases.push_back(
        transform_of(static_cast<std::int64_t>(wall_clock_ns()), sides[i]->frames().device,
                     session.sides[i].device.workspace.offset_m, Quaternion::Identity()));
  }
  write(static_frames_out_, bases);
}

void SceneTopics::take(const SceneState& scene) {
  if (scene_ && scene_->header.session_id == scene.header.session_id &&
      scene_->revision == scene.revision) {
    return;
  }
  scene_ = scene;
  served_ = markers_out_.readers_so_far();
  write_markers();
}

void SceneTopics::pump(std::span<SideTopics* const> sides) {
  std::vector<TransformStamped> tools;
  for (SideTopics* side : sides) {
    const auto pose = side->take_pose();
    if (!pose) continue;
    tools.push_back(
        transform_of(pose->at_ns, side->frames().tool, pose->position_m, pose->orientation));
  }
  write(frames_out_, tools);
  // one that asks for volatile gets nothing of before it came
  if (const std::uint32_t readers = markers_out_.readers_so_far(); scene_ && readers != served_) {
    served_ = readers;
    write_markers();
  }
}

void SceneTopics::write_markers() {
  std::int32_t id = 0;
  for (const TissueSurface& tissue : scene_->tissues) {
    std::vector<Point> points = points_of(tissue.mesh);
    Marker marker{};
    marker.header = header_of(static_cast<std::int64_t>(wall_clock_ns()), kWorldFrame);
    marker.ns = borrowed(tissue.name);
    marker.id = id++;
    marker.type = tissue.mesh.triangles.empty() ? kPoints : kTriangleList;
    marker.pose = pose_of(Vector3::Zero(), Quaternion::Identity());
    const double scale = tissue.mesh.triangles.empty() ? kPointSize_m : 1.0;
    marker.scale = {.x = scale, .y = scale, .z = scale};
    marker.color = kTissueColor;
    marker.points =
        sequence_of<dds_sequence_geometry_msgs_msg_dds__Point_>(points.data(), points.size());
    marker.texture_resource = marker.texture.format = marker.text = marker.mesh_resource =
        borrowed("");
    marker.texture.header = header_of(0, "");
    marker.mesh_file.filename = borrowed("");
    markers_out_.write(marker);
  }
}

}  // namespace palpate::ros
