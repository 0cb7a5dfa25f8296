// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/openigtlink/feed.h"

#include <algorithm>
#include <chrono>
#include <utility>
#include <variant>

namespace palpate::viewer {
namespace {

constexpr Duration kPoseInterval = std::chrono::nanoseconds(1'000'000'000 / 60);
constexpr Duration kSurfaceInterval = std::chrono::nanoseconds(1'000'000'000 / 30);
constexpr Duration kStatusInterval = std::chrono::seconds(1);
constexpr Duration kReplyInterval = std::chrono::milliseconds(100);  // to a client that floods
constexpr const char* kRegistration = "ImageToPatient";
constexpr const char* kStatusName = "Palpate";

}  // namespace

IgtlFeed::IgtlFeed(NodeContext& context, std::uint16_t port, TelemetrySubscriber& subscriber,
                   std::span<const TelemetryMirror> mirrors)
    : context_(context), subscriber_(subscriber), mirrors_(mirrors), server_(port) {
  server_.wants = [](const igtl::Header& header) {
    return header.type == "GET_STATUS" ||
           (header.type == "TRANSFORM" && header.device == kRegistration);
  };
  server_.on_message = [this](igtl::Client& client, const igtl::Header& header,
                              const std::string& body) { receive(client, header, body); };
  subscriber_.subscribe<SceneState>();
  context_.log.info("event=openigtlink address=127.0.0.1 port={}", server_.port());
}

void IgtlFeed::take(const TelemetryMessage& message) {
  if (const auto* scene = std::get_if<SceneState>(&message)) {
    if (scene_.take(*scene)) changes_.assign(scene->tissues.size(), 1);
  } else if (const auto* frame = std::get_if<MeshFrame>(&message)) {
    if (scene_.take(*frame)) ++changes_[frame->tissue];
  }
}

void IgtlFeed::pump(TimePoint now) {
  now_ = now;
  server_.pump(now);
  if (const bool is_needed = !server_.clients().empty(); is_needed != is_subscribed_) {
    is_subscribed_ = is_needed;
    if (is_needed) {
      scene_.forget_motion();
      subscriber_.subscribe<MeshFrame>();
    } else {
      subscriber_.unsubscribe<MeshFrame>();
    }
  }
  if (now < next_pose_) return;
  next_pose_ = std::max(next_pose_ + kPoseInterval, now);
  const std::uint64_t at_ns = wall_clock_ns();
  std::pair<igtl::Status, std::string> is = status(now);
  const bool is_status_due = now >= next_status_ || is != status_;
  if (is_status_due) next_status_ = now + kStatusInterval;
  status_ = std::move(is);
  const bool is_surface_due = now >= next_surface_;
  if (is_surface_due) next_surface_ = std::max(next_surface_ + kSurfaceInterval, now);
  std::erase_if(sent_, [&](const auto& sent) {
    return std::none_of(server_.clients().begin(), server_.clients().end(),
                        [&](const igtl::Client& client) { return client.id == sent.first; });
  });
  for (igtl::Client& client : server_.clients()) {
    if (is_status_due || client.is_new) {
      client.is_new = !server_.send(
          client, igtl::status_message(kStatusName, at_ns, status_.first, status_.second), now);
    }
    if (!client.reply.empty() && now >= client.reply_after) {
      client.reply_after = now + kReplyInterval;
      server_.send(client, std::exchange(client.reply, {}), now);
    }
    send_poses(client, at_ns);
    if (is_surface_due) send_surfaces(client, at_ns);
  }
  server_.pump(now);
  log(now);
}

void IgtlFeed::send_poses(igtl::Client& client, std::uint64_t at_ns) {
  for (std::size_t side = 0; side < mirrors_.size(); ++side) {
    const TelemetryMirror::JoinedTick* newest = mirrors_[side].newest_of_device();
    if (newest == nullptr) continue;
    const std::optional<DeviceTick>& tick = newest->device;
    igtl::Pose tool = igtl::Pose::Identity();
    tool.linear() = tick->measured_tool_orientation_world.normalized().toRotationMatrix();
    tool.translation() = tick->measured_tool_position_world_m;
    igtl::Pose device = igtl::Pose::Identity();
    device.translation() = tick->measured_hand_position_m;
    server_.send(
        client, igtl::transform_message(name_of("Tool", side), at_ns, client.image_of_world * tool),
        now_);
    server_.send(client, igtl::transform_message(name_of("Device", side), at_ns, device), now_);
    server_.send(client,
                 igtl::force_message(name_of("ForceOnHand", side), at_ns,
                                     client.image_of_world.linear() * tick->force_on_hand_newton),
                 now_);
  }
}

/// Of the tissues that have moved since it got them.
void IgtlFeed::send_surfaces(igtl::Client& client, std::uint64_t at_ns) {
  const std::optional<SceneState>& scene = scene_.scene();
  if (!scene) return;
  Sent& sent = sent_[client.id];
  if (sent.physics_session != scene->header.session_id || sent.revision != scene->revision) {
    sent = {.physics_session = scene->header.session_id, .revision = scene->revision};
  }
  sent.changes.resize(changes_.size(), 0);
  for (std::size_t i = 0; i < changes_.size(); ++i) {
    if (sent.changes[i] == changes_[i]) continue;
    if (!client.waiting.empty()) return;  // they come when it has read the rest
    const std::string message = igtl::polydata_message(
        igtl::device_name(scene->tissues[i].name), at_ns, scene_.vertices_m(i),
        scene->tissues[i].mesh.triangles, client.image_of_world);
    if (server_.send(client, message, now_)) sent.changes[i] = changes_[i];
  }
}

void IgtlFeed::receive(igtl::Client& client, const igtl::Header& header, const std::string& body) {
  if (igtl::crc64(body) != header.crc) {
    return reply(client, igtl::Status::kChecksum, header.type + ": its checksum is wrong");
  }
  if (header.type == "GET_STATUS") return reply(client, status_.first, status_.second);
  const igtl::ReadTransform read = igtl::read_transform(header, body);
  if (!read.complaint.empty()) {
    return reply(client, igtl::Status::kConfiguration,
                 std::string(kRegistration) + " " + read.complaint);
  }
  client.image_of_world = read.pose.inverse();
  sent_.erase(client.id);
  reply(client, igtl::Status::kOk, std::string(kRegistration) + " is used");
}

/// Sent by pump(); of what a client sends too fast the newest is answered.
void IgtlFeed::reply(igtl::Client& client, igtl::Status code, const std::string& text) {
  client.reply = igtl::status_message(kStatusName, wall_clock_ns(), code, text);
}

std::pair<igtl::Status, std::string> IgtlFeed::status(TimePoint now) const {
  std::string text;
  igtl::Status worst = igtl::Status::kOk;
  for (std::size_t side = 0; side < mirrors_.size(); ++side) {
    const std::string& name = context_.session.sides[side].name;
    const auto add = [&](igtl::Status code, const std::string& what) {
      if (!text.empty()) text += "; ";
      if (!name.empty()) text.append(name).append(": ");
      text += what;
      worst = code;
    };
    const TelemetryMirror& mirror = mirrors_[side];
    const DevicePhase phase = mirror.device_counters().phase;
    if (!mirror.device_link().is_alive(now)) {
      add(igtl::Status::kSilent, "device_node is silent");
    } else if (phase == DevicePhase::kFaulted) {
      add(igtl::Status::kHardwareFailure,
          std::string("fault: ") + palpate::name(mirror.device_counters().last_fault));
    } else if (phase != DevicePhase::kEnabled && phase != DevicePhase::kUnknown) {
      add(igtl::Status::kNotReady, std::string("no force yet: ") + palpate::name(phase));
    }
  }
  return {worst, text.empty() ? "running" : text};
}

/// The name of what a side has; where it is too long for the wire, with the number of the side.
std::string IgtlFeed::name_of(const char* what, std::size_t side) const {
  const std::string& name = context_.session.sides[side].name;
  if (name.empty()) return what;
  const std::string text = what + ("_" + name);
  return text.size() <= igtl::kNameBytes ? igtl::device_name(text)
                                         : what + ("_" + std::to_string(side));
}

void IgtlFeed::log(TimePoint now) {
  const igtl::Server::Counters& counters = server_.counters();
  const std::uint64_t events = counters.accepted + counters.refused + counters.invalid +
                               counters.stalled - logged_.accepted - logged_.refused -
                               logged_.invalid - logged_.stalled;
  logged_ = counters;
  if (throttle_.note(now, events) == 0) return;
  context_.log.info(
      "event=openigtlink_clients now={} accepted={} refused={} invalid={} stalled={} left_out={}",
      server_.clients().size(), counters.accepted, counters.refused, counters.invalid,
      counters.stalled, counters.left_out);
}

}  // namespace palpate::viewer
