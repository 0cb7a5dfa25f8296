// SPDX-License-Identifier: Apache-2.0
// feed.h — what a running session tells clients of OpenIGTLink, such as 3D Slicer, and the only
// thing that they tell: where their image is.
//
//   out  TRANSFORM  Tool      W from T, and  Device  the hand in D: 60 Hz
//        SENSOR     ForceOnHand  N, as rendered: 60 Hz
//        POLYDATA   by the name of a tissue: at first and when it has moved, at most 30 Hz
//        STATUS     Palpate   of the device: at first, on a change, and every second
//   in   TRANSFORM  ImageToPatient  a registration, rigid: from then on this client gets W's places
//                                   in its image. W is the patient.
//        GET_STATUS
//
// With several sides the names end in _SIDE. Nothing here leads to the clamp or the device.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "common/core/time.h"
#include "common/link/telemetry_subscriber.h"
#include "common/process/run_node.h"
#include "common/telemetry/event_throttle.h"
#include "common/telemetry/telemetry_message.h"
#include "viewer_node/feed/scene_mirror.h"
#include "viewer_node/feed/telemetry_mirror.h"
#include "viewer_node/openigtlink/server.h"

namespace palpate::viewer {

class IgtlFeed {
 public:
  /// All references must outlive it. @param mirrors  of each of context.session.sides
  /// @throws SetupError  the port is in use
  IgtlFeed(NodeContext& context, std::uint16_t port, TelemetrySubscriber& subscriber,
           std::span<const TelemetryMirror> mirrors);

  void take(const TelemetryMessage& message);
  /// Call it at due().
  void pump(TimePoint now);
  [[nodiscard]] TimePoint due() const { return next_pose_; }
  [[nodiscard]] std::uint16_t port() const { return server_.port(); }

 private:
  void receive(igtl::Client& client, const igtl::Header& header, const std::string& body);
  void reply(igtl::Client& client, igtl::Status code, const std::string& text);
  void send_poses(igtl::Client& client, std::uint64_t at_ns);
  void send_surfaces(igtl::Client& client, std::uint64_t at_ns);
  [[nodiscard]] std::pair<igtl::Status, std::string> status(TimePoint now) const;
  [[nodiscard]] std::string name_of(const char* what, std::size_t side) const;
  void log(TimePoint now);

  NodeContext& context_;
  TelemetrySubscriber& subscriber_;
  std::span<const TelemetryMirror> mirrors_;
  igtl::Server server_;
  SceneMirror scene_;
  std::vector<std::uint64_t> changes_;  // of each tissue
  // of each client: the change of each tissue that it has, of the scene's revision
  struct Sent {
    std::uint64_t physics_session = 0;
    std::uint64_t revision = 0;
    std::vector<std::uint64_t> changes{};
  };
  std::map<std::uint64_t, Sent> sent_;
  std::pair<igtl::Status, std::string> status_{igtl::Status::kSilent, ""};
  TimePoint now_{};
  TimePoint next_pose_{};
  TimePoint next_surface_{};
  TimePoint next_status_{};
  bool is_subscribed_ = false;
  igtl::Server::Counters logged_;
  EventThrottle throttle_;
};

}  // namespace palpate::viewer
