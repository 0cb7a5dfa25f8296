// SPDX-License-Identifier: Apache-2.0
// scene_topics.h — the tissues of a running session as markers, and its frames:
//
//   NAMESPACE/tissues  Marker     of each tissue at rest, once, and again for each new subscriber
//   tf                 TFMessage  world → tool
//   tf_static          TFMessage  world → device_base
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "common/core/scene_messages.h"
#include "common/core/time.h"
#include "common/session/session.h"
#include "deploy/ros/dds/node.h"
#include "deploy/ros/viewer/side_topics.h"

namespace palpate::ros {

class SceneTopics {
 public:
  SceneTopics(Node& node, const std::string& name_space);

  /// The bases of the devices, as the session places them.
  void write_bases(const Session& session, std::span<SideTopics* const> sides);
  void take(const SceneState& scene);
  /// Poses that have come, and markers for subscribers that have.
  void pump(std::span<SideTopics* const> sides);

 private:
  void write_markers();

  Writer<TFMessage> frames_out_;
  Writer<TFMessage> static_frames_out_;
  Writer<Marker> markers_out_;
  std::optional<SceneState> scene_;
  std::uint32_t served_ = 0;  // subscribers of markers so far
};

}  // namespace palpate::ros
