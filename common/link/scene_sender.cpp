#include "common/link/scene_sender.h"

#include "common/link/frame_io.h"

namespace palpate {

SceneSender::SceneSender(ZmqContext& context, const Attachment& attachment)
    : socket_(context, kSceneSender, {attachment}) {}

SendResult SceneSender::send(const PhysicsBatch& message) noexcept {
  return has_subscriber<PhysicsBatch>() ? send_frame(socket_, batches_, message)
                                        : SendResult::kNoPeer;
}
SendResult SceneSender::send(const SceneState& message) noexcept {
  return has_subscriber<SceneState>() ? send_frame(socket_, scenes_, message) : SendResult::kNoPeer;
}
SendResult SceneSender::send(const MeshFrame& message) noexcept {
  return has_subscriber<MeshFrame>() ? send_frame(socket_, meshes_, message) : SendResult::kNoPeer;
}

}  // namespace palpate
