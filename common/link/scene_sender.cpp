// SPDX-License-Identifier: Apache-2.0
#include "common/link/scene_sender.h"

#include "common/link/frame_io.h"

namespace palpate {

SceneSender::SceneSender(ZmqContext& context, const Attachment& attachment)
    : socket_(context, kSceneSender, attachment) {}

SendResult SceneSender::send(const PhysicsBatch& message) noexcept {
  return send_frame(subscribers_, batches_, message);
}
SendResult SceneSender::send(const SceneState& message) noexcept {
  return send_frame(subscribers_, scenes_, message);
}
SendResult SceneSender::send(const MeshFrame& message) noexcept {
  return send_frame(subscribers_, meshes_, message);
}

}  // namespace palpate
