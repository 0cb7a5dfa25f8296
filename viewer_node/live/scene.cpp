// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/live/scene.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "common/link/codec/viewer_codec.h"
#include "viewer_node/audience/mesh_steps.h"
#include "viewer_node/live/channels.h"

namespace palpate::viewer {
namespace {

Payload copy_of(std::span<const std::byte> bytes) {
  return make_payload({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

}  // namespace

WebScene::WebScene(TelemetrySubscriber& subscriber, WebServer& server, Duration audience_interval)
    : subscriber_(subscriber), server_(server), audience_interval_(audience_interval) {
  subscriber_.subscribe<SceneState>();
}

bool WebScene::take(const SceneState& scene, std::span<const std::byte> payload) {
  const bool is_first = !mirror_.scene().has_value();
  if (!mirror_.take(scene)) return false;
  whole_of_.reset();
  scene_payload_ = copy_of(payload);
  server_.publish(index_of(WebChannel::kScene), wall_clock_ns(), scene_payload_);
  return !is_first;
}

void WebScene::take(const MeshFrame& frame, std::span<const std::byte> payload) {
  if (!mirror_.take(frame)) return;
  ++frame_count_;
  const std::size_t channel = index_of(WebChannel::kMesh);
  if (audience_interval_ == Duration::zero() && server_.has_subscriber(channel)) {
    server_.publish(channel, wall_clock_ns(), copy_of(payload));
  }
}

void WebScene::send_scene_to(std::uint64_t client) {
  if (!scene_payload_) return;
  server_.send_to(client, index_of(WebChannel::kScene), wall_clock_ns(), scene_payload_);
}

void WebScene::send_meshes_to(std::uint64_t client) {
  if (!mirror_.scene()) return;
  if (whole_of_ != frame_count_) {
    whole_of_ = frame_count_;
    whole_.clear();
    const std::vector<MeshFrame> frames = mirror_.whole_frames();
    if (audience_interval_ > Duration::zero()) {
      whole_.push_back(make_payload(
          encode_mesh_steps(mesh_steps(*mirror_.scene(), frames, kDetailSteps_m.front()))));
    } else {
      for (const MeshFrame& frame : frames) {
        whole_.push_back(make_payload(payload_of(mesh_codec_, frame)));
      }
    }
  }
  for (const Payload& payload : whole_) {
    server_.send_to(client, index_of(WebChannel::kMesh), wall_clock_ns(), payload);
  }
}

/// If a tissue has moved since the last time.
void WebScene::publish_steps(TimePoint now) {
  if (now < next_steps_ || frames_published_ == frame_count_ || !mirror_.scene()) return;
  next_steps_ = std::max(next_steps_ + audience_interval_, now);
  frames_published_ = frame_count_;
  const std::size_t channel = index_of(WebChannel::kMesh);
  if (!server_.has_subscriber(channel)) return;
  const std::vector<MeshFrame> frames = mirror_.whole_frames();
  std::vector<Payload> details;
  for (const double step_m : kDetailSteps_m) {
    details.push_back(
        make_payload(encode_mesh_steps(mesh_steps(*mirror_.scene(), frames, step_m))));
  }
  server_.publish(channel, wall_clock_ns(), std::move(details));
}

void WebScene::pump(TimePoint now) {
  if (audience_interval_ > Duration::zero()) publish_steps(now);
  const bool is_needed = server_.has_subscriber(index_of(WebChannel::kMesh)) ||
                         server_.has_subscriber(index_of(WebChannel::kPoints)) ||
                         server_.has_subscriber(index_of(WebChannel::kTool, 0));
  if (is_needed == is_subscribed_) return;
  is_subscribed_ = is_needed;
  if (is_needed) {
    mirror_.forget_motion();
    whole_of_.reset();
    subscriber_.subscribe<MeshFrame>();
  } else {
    subscriber_.unsubscribe<MeshFrame>();
  }
}

}  // namespace palpate::viewer
