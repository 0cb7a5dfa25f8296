// web_process.h — what the web server's clients are told of a running session, and the one thing
// they may say.
//
//   in   hop 5  telemetry of all nodes, SceneState, MeshFrame
//   out  hop 6  HandTarget  viewer → device   only if the session lets a pointer lead the hand;
//                                             of several, that of the first side
//
// Thread: the viewer's; the server has its own.
#pragma once

#include <cstddef>
#include <cstdint>
#include <list>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "common/link/codec/viewer_codec.h"
#include "common/link/telemetry_subscriber.h"
#include "common/link/zmq_sender.h"
#include "common/process/process_links.h"
#include "common/telemetry/remote_events.h"
#include "common/process/run_node.h"
#include "viewer_node/feed/metrics_text.h"
#include "viewer_node/feed/scene_mirror.h"
#include "viewer_node/feed/telemetry_mirror.h"
#include "viewer_node/server/web_server.h"

namespace palpate::viewer {

/// As given on the command line.
struct WebOptions {
  std::string listen{};      ///< ADDRESS:PORT; empty: 127.0.0.1 and the session's port
  std::string token_file{};  ///< empty: no token
  std::vector<std::string> origins{};
  std::vector<std::string> hosts{};
  bool is_off = false;

  [[nodiscard]] bool is_asked_for(const WebConfig& session) const {
    return !is_off && (session.is_on || !listen.empty());
  }
};

/// What the options and the session come to. Throws SetupError: an address elsewhere than on
/// loopback without a token, a token of less than 16 characters.
[[nodiscard]] WebServerConfig web_config(const WebOptions& options, const WebConfig& session);

class WebFeed {
 public:
  /// Listens; throws SetupError. All references must outlive it.
  /// @param mirrors  of each of context.session.sides
  WebFeed(NodeContext& context, ProcessLinks& links, const WebOptions& options,
          TelemetrySubscriber& subscriber, std::span<const TelemetryMirror> mirrors);

  /// Passes one message of hop 5 on. @param payload  the same, as it came
  void take(const TelemetryMessage& message, std::span<const std::byte> payload);
  /// Serves what clients asked for and what is due. Call at least every 20 ms.
  void pump(TimePoint now);

 private:
  struct SideEvents {
    SideEvents(WebFeed& feed, const std::string& side);
    RemoteEvents<DeviceTick, DeviceCounters> device;
    RemoteEvents<MofcTick, MofcCounters> mofc;
    RemoteEvents<PhysicsTick, PhysicsCounters> physics;
  };

  void serve(const WebServer::Event& event, TimePoint now);
  void send_scene_to(std::uint64_t client);
  void send_meshes_to(std::uint64_t client);
  void watch_meshes();
  void lead_hand(std::uint64_t client, const std::string& payload, TimePoint now);
  void send_target(TimePoint now);
  /// What that node has to say, on /log.
  [[nodiscard]] OnEventLine told_by(const std::string& node);
  void let_go_of_hand(TimePoint now);
  void tell_health(TimePoint now);
  void tell_tools(TimePoint now);
  void tell_tools(std::size_t side, std::uint64_t at_ns, bool is_telemetry_due, bool is_tool_due);
  void log(LogLevel level, const std::string& node, const std::string& message);

  NodeContext& context_;
  TelemetrySubscriber& subscriber_;
  std::span<const TelemetryMirror> mirrors_;
  WebServer server_;
  MetricsText metrics_;
  SceneMirror scene_;
  Codec<MeshFrame> meshes_;
  Payload scene_payload_;
  bool is_watching_meshes_ = false;
  bool has_new_vertices_ = false;

  std::optional<ZmqSender<HandTarget>> hand_;  // none: nobody may lead the hand
  HandTarget target_;                          // the newest of the holder
  bool is_target_due_ = false;                 // not sent yet
  TimePoint next_target_{};
  std::uint64_t holder_ = 0;  // client; 0: nobody
  TimePoint holder_heard_at_{};
  std::set<std::uint64_t> told_of_holder_;  // clients that were refused

  TimePoint next_health_{};
  TimePoint next_telemetry_{};
  TimePoint next_tools_{};
  std::map<std::string, bool> was_heard_;  // nodes
  std::list<SideEvents> events_;           // of each side
};

}  // namespace palpate::viewer
