#include "viewer_node/web_process.h"

#include <arpa/inet.h>
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <utility>

#include "common/core/check.h"
#include "common/core/regular_file.h"
#include "common/core/version.h"

namespace palpate::viewer {
namespace {

// The channels, in the order in which they are advertised: all of these, then for each further side
// those that every side has.
enum ChannelIndex : std::size_t {
  kScene,
  kMesh,
  kDevice,
  kMofc,
  kPhysics,
  kHealth,
  kTelemetry,
  kPoints,
  kTool,
  kTransforms,
  kLog,
};

struct ChannelName {
  const char* topic;
  const char* schema;
  bool is_of_side = false;  // "/left/device"
};
constexpr ChannelName kChannels[] = {
    {"/scene_state", "palpate.v1.SceneState"},
    {"/mesh", "palpate.v1.MeshFrame"},
    {"/device", "palpate.v1.DeviceTelemetry", true},
    {"/mofc", "palpate.v1.MofcTelemetry", true},
    {"/physics", "palpate.v1.PhysicsTelemetry", true},
    {"/health", "palpate.v1.Health"},
    {"/telemetry", "palpate.v1.Telemetry", true},
    {"/tissue/points", "foxglove.PointCloud"},
    {"/scene", "foxglove.SceneUpdate", true},
    {"/tf", "foxglove.FrameTransforms", true},
    {"/log", "foxglove.Log"},
};

constexpr Duration kHealthInterval = std::chrono::milliseconds(200);
constexpr Duration kTelemetryInterval = std::chrono::milliseconds(20);  // tools warn above 60 Hz
constexpr Duration kToolInterval = std::chrono::milliseconds(33);
constexpr Duration kHeardWithin = std::chrono::seconds(1);
constexpr Duration kTargetInterval = std::chrono::microseconds(8333);  // 120 Hz, however many come
constexpr std::size_t kLeastTokenBytes = 16;
constexpr std::uintmax_t kMostTokenBytes = 4096;
constexpr const char* kHandStatus = "hand";

std::uint64_t wall_ns() {
  return static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::nanoseconds>(
                                        std::chrono::system_clock::now().time_since_epoch())
                                        .count());
}

bool is_loopback(const std::string& address) {
  in_addr v4{};
  if (inet_pton(AF_INET, address.c_str(), &v4) == 1) return (ntohl(v4.s_addr) >> 24) == 127;
  return address == "::1";
}

/// "127.0.0.1:8765", "[::1]:0", "localhost:8765".
void read_listen(const std::string& listen, WebServerConfig& config) {
  const std::size_t colon = listen.rfind(':');
  std::string address = listen.substr(0, colon);
  if (address == "localhost") address = "127.0.0.1";
  if (address.starts_with('[') && address.ends_with(']')) {
    address = address.substr(1, address.size() - 2);
  }
  const char* const last = listen.data() + listen.size();
  std::uint16_t port = 0;
  const auto [stop, error] = colon == std::string::npos
                                 ? std::from_chars_result{last, std::errc::invalid_argument}
                                 : std::from_chars(listen.data() + colon + 1, last, port);
  if (error != std::errc() || stop != last || address.empty()) {
    throw SetupError("--listen " + listen + ": give ADDRESS:PORT, such as 127.0.0.1:8765");
  }
  config.address = address;
  config.port = port;
}

std::string read_token(const std::string& file) {
  const FileContent content = read_regular_file(file, kMostTokenBytes);
  if (!content.complaint.empty()) {
    throw SetupError("--token-file " + file + ": " + content.complaint);
  }
  std::string token = content.bytes;
  while (!token.empty() && (token.back() == '\n' || token.back() == '\r')) token.pop_back();
  const bool is_plain = std::all_of(token.begin(), token.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
           c == '_';
  });
  if (token.size() < kLeastTokenBytes || !is_plain) {
    throw SetupError("--token-file " + file +
                     ": must hold one line of at least 16 letters, digits, '-' and '_'; make one "
                     "with: openssl rand -hex 16");
  }
  return token;
}

/// The session lets a page lead the hand, and this host has the key for it where one is needed.
bool may_lead_hand(const Session& session, const ProcessLinks& links) {
  const LinkKeys* const keys = links.side.tcp().keys.get();
  return session.side().hand.pointer && (keys == nullptr || keys->of(KeyRole::kPointer) ||
                                  !session.side().links.hand_target.starts_with("tcp://"));
}

/// Of this kind for this side, counted as above.
std::size_t channel_of(ChannelIndex kind, std::size_t side) {
  if (side == 0 || !kChannels[kind].is_of_side) return kind;
  const auto of_side = [](std::size_t end) {
    return static_cast<std::size_t>(
        std::count_if(std::begin(kChannels), std::begin(kChannels) + end,
                      [](const ChannelName& channel) { return channel.is_of_side; }));
  };
  constexpr std::size_t kAll = std::size(kChannels);
  return kAll + (side - 1) * of_side(kAll) + of_side(kind);
}

ServerDescription description_of(const NodeContext& context, const ProcessLinks& links) {
  ServerDescription description{.name = std::string("viewer_node ") + version(),
                                .session_id = fmt::format("{:x}", context.session_id),
                                .session_name = context.session.name,
                                .accepts_hand_targets = may_lead_hand(context.session, links)};
  bool is_first = true;
  for (const Side& one : context.session.sides) {
    const std::string side = one.name.empty() ? "" : "/" + one.name;
    for (const ChannelName& channel : kChannels) {
      if (!is_first && !channel.is_of_side) continue;
      description.channels.push_back({(channel.is_of_side ? side : "") + channel.topic,
                                      channel.schema, schema_of(channel.schema)});
    }
    is_first = false;
  }
  return description;
}

/// Who speaks in a batch.
const std::string& side_name(const TelemetryMessage& message) {
  static const std::string none;
  return std::visit(
      [](const auto& batch) -> const std::string& {
        if constexpr (requires { batch.side; }) {
          return batch.side;
        } else {
          return none;
        }
      },
      message);
}

Payload shared(std::string payload) {
  return std::make_shared<const std::string>(std::move(payload));
}

}  // namespace

WebServerConfig web_config(const WebOptions& options, const WebConfig& session) {
  WebServerConfig config{.port = session.port, .may_move = true};
  if (!options.listen.empty()) {
    read_listen(options.listen, config);
    config.may_move = false;
  }
  config.rules.origins = options.origins;
  config.rules.hosts = options.hosts;
  if (!options.token_file.empty()) config.rules.token = read_token(options.token_file);
  if (!is_loopback(config.address) && config.rules.token.empty()) {
    throw SetupError("--listen " + options.listen +
                     ": other machines could look on; give --token-file FILE, or listen on "
                     "127.0.0.1");
  }
  return config;
}

WebFeed::SideEvents::SideEvents(WebFeed& feed, const std::string& side)
    : device(feed.told_by(with_side(side, "device_node"))),
      mofc(feed.told_by(with_side(side, "mofc_node"))),
      physics(feed.told_by(with_side(side, "physics_node"))) {}

OnEventLine WebFeed::told_by(const std::string& node) {
  return [this, node](spdlog::level::level_enum level, const std::string& text) {
    log(level >= spdlog::level::err    ? LogLevel::kError
        : level == spdlog::level::warn ? LogLevel::kWarning
                                       : LogLevel::kInfo,
        node, text);
  };
}

WebFeed::WebFeed(NodeContext& context, ProcessLinks& links, const WebOptions& options,
                 TelemetrySubscriber& subscriber, std::span<const TelemetryMirror> mirrors)
    : context_(context),
      subscriber_(subscriber),
      mirrors_(mirrors),
      server_(web_config(options, context.session.viewer.web), description_of(context, links)),
      metrics_(context.session) {
  for (const Side& side : context.session.sides) {
    events_.emplace_back(*this, side.name);
  }
  const WebConfig& asked = context.session.viewer.web;
  if (options.listen.empty() && asked.port != 0 && server_.port() != asked.port) {
    context.log.warn("event=port_in_use port={} instead={}", asked.port, server_.port());
  }
  context.log.info("event=web url={}", server_.url());
  if (may_lead_hand(context.session, links)) {
    hand_.emplace(links.side, connect_to(context.session.side().links.hand_target, "links.hand_target"));
  }
  subscriber_.subscribe<SceneState>();
}

void WebFeed::take(const TelemetryMessage& message, std::span<const std::byte> payload) {
  std::size_t channel = kDevice;
  if (const auto* scene = std::get_if<SceneState>(&message)) {
    const bool is_first = !scene_.scene().has_value();
    scene_.take(*scene);
    if (!is_first) log(LogLevel::kInfo, "physics_node", "event=scene_sent_anew");
    channel = kScene;
  } else if (const auto* frame = std::get_if<MeshFrame>(&message)) {
    if (!scene_.take(*frame)) return;
    has_new_vertices_ = true;
    channel = kMesh;
  } else {
    const std::string& name = side_name(message);
    const std::vector<Side>& sides = context_.session.sides;
    const auto side = std::find_if(sides.begin(), sides.end(),
                                   [&](const Side& known) { return known.name == name; });
    if (side == sides.end()) return;
    const auto index = static_cast<std::size_t>(side - sides.begin());
    const TimePoint now = context_.clock.now();
    SideEvents& events = *std::next(events_.begin(), side - sides.begin());
    ChannelIndex kind = kDevice;
    if (const auto* mofc = std::get_if<MofcBatch>(&message)) {
      metrics_.note(index, *mofc);
      events.mofc.note(*mofc, now);
      kind = kMofc;
    } else if (const auto* physics = std::get_if<PhysicsBatch>(&message)) {
      metrics_.note(index, *physics);
      events.physics.note(*physics, now);
      kind = kPhysics;
    } else {
      const auto& device = std::get<DeviceBatch>(message);
      metrics_.note(index, device);
      events.device.note(device, now);
    }
    channel = channel_of(kind, index);
  }
  if (channel != kScene && !server_.is_watched(channel)) return;
  const Payload bytes =
      shared(std::string(reinterpret_cast<const char*>(payload.data()), payload.size()));
  if (channel == kScene) scene_payload_ = bytes;
  server_.publish(channel, wall_ns(), bytes);
}

void WebFeed::pump(TimePoint now) {
  watch_meshes();
  for (const WebServer::Event& event : server_.take_events()) serve(event, now);
  if (holder_ != 0 && now - holder_heard_at_ >= context_.session.side().hand.pointer->holder_timeout) {
    let_go_of_hand(now);
  }
  if (is_target_due_ && now >= next_target_) send_target(now);
  tell_health(now);
  tell_tools(now);
}

void WebFeed::serve(const WebServer::Event& event, TimePoint now) {
  switch (event.kind) {
    case WebServer::Event::Kind::kSubscribed:
      if (event.channel == kScene) send_scene_to(event.client);
      if (event.channel == kMesh) send_meshes_to(event.client);
      if (event.channel == kPoints) has_new_vertices_ = true;
      return;
    case WebServer::Event::Kind::kHandTarget:
      lead_hand(event.client, event.hand_target, now);
      return;
    case WebServer::Event::Kind::kLeft:
      told_of_holder_.erase(event.client);
      if (event.client == holder_) let_go_of_hand(now);
      return;
  }
}

// --- scene --------------------------------------------------------------------------------------

void WebFeed::send_scene_to(std::uint64_t client) {
  if (scene_payload_) server_.send_to(client, kScene, wall_ns(), scene_payload_);
}

void WebFeed::send_meshes_to(std::uint64_t client) {
  for (const MeshFrame& frame : scene_.whole_frames()) {
    server_.send_to(client, kMesh, wall_ns(), shared(payload_of(meshes_, frame)));
  }
}

/// physics_node computes vertices only while somebody here looks at them.
void WebFeed::watch_meshes() {
  const bool is_wanted = server_.is_watched(kMesh) || server_.is_watched(kPoints);
  if (is_wanted == is_watching_meshes_) return;
  is_watching_meshes_ = is_wanted;
  if (is_wanted) {
    scene_.forget_motion();
    subscriber_.subscribe<MeshFrame>();
  } else {
    subscriber_.unsubscribe<MeshFrame>();
  }
}

// --- hand ---------------------------------------------------------------------------------------

void WebFeed::lead_hand(std::uint64_t client, const std::string& payload, TimePoint now) {
  if (!hand_) return;
  const auto target = decode_page_target(payload);
  if (!target) {
    server_.tell(client, status_text(StatusLevel::kError, "not a valid palpate.v1.HandTarget"));
    return;
  }
  if (holder_ != 0 && holder_ != client) {
    if (told_of_holder_.insert(client).second) {
      server_.tell(client,
                   status_text(StatusLevel::kWarning, "another page leads the hand", kHandStatus));
    }
    return;
  }
  if (holder_ == 0 && target->is_released) return;
  holder_ = client;
  holder_heard_at_ = now;
  target_.holder_id = client;
  target_.hand_position_m = target->hand_position_m;
  if (target->is_released) {
    let_go_of_hand(now);
  } else {
    is_target_due_ = true;
  }
  if (told_of_holder_.erase(client) > 0) server_.tell(client, remove_status_text(kHandStatus));
}

void WebFeed::send_target(TimePoint now) {
  target_.header.session_id = context_.session_id;
  target_.header.sampled_at = now;
  hand_->send(target_);
  ++target_.header.sequence;
  is_target_due_ = false;
  next_target_ = now + kTargetInterval;
}

void WebFeed::let_go_of_hand(TimePoint now) {
  target_.is_released = true;
  send_target(now);
  target_.is_released = false;
  holder_ = 0;
  for (const std::uint64_t client : told_of_holder_) {
    server_.tell(client, remove_status_text(kHandStatus));
  }
  told_of_holder_.clear();
}

// --- figures ------------------------------------------------------------------------------------

void WebFeed::tell_health(TimePoint now) {
  if (now < next_health_) return;
  next_health_ = now + kHealthInterval;

  const WebServer::Counters counters = server_.counters();
  ViewerHealth health{.clients = counters.clients,
                      .messages_dropped = counters.dropped,
                      .frames_rejected = subscriber_.rejected(),
                      .hand_holder = holder_,
                      .version = version()};
  const auto add = [&](const std::string& name, const NodeLink& link) {
    const bool is_heard = link.is_heard() && now - link.heard_at <= kHeardWithin;
    health.nodes.push_back({.name = name,
                            .is_heard = is_heard,
                            .silence_s = link.is_heard() ? to_seconds(now - link.heard_at) : -1.0,
                            .sessions = link.sessions,
                            .batches_lost = link.batches_lost,
                            .records_lost = link.records_lost});
    bool& was_heard = was_heard_[name];
    if (is_heard != was_heard) {
      log(is_heard ? LogLevel::kInfo : LogLevel::kWarning, "viewer_node",
          fmt::format("event={} node={}_node", is_heard ? "node_heard" : "node_silent", name));
    }
    was_heard = is_heard;
  };
  const std::vector<Side>& sides = context_.session.sides;
  for (std::size_t i = 0; i < sides.size(); ++i) {
    add(with_side(sides[i].name, "device"), mirrors_[i].device_link());
    add(with_side(sides[i].name, "mofc"), mirrors_[i].mofc_link());
    add(with_side(sides[i].name, "physics"), mirrors_[i].physics_link());
  }
  server_.set_metrics(metrics_.text(mirrors_,
                                    {.clients = counters.clients,
                                     .messages_dropped = counters.dropped,
                                     .requests_refused = counters.refused,
                                     .frames_rejected = subscriber_.rejected()},
                                    now));
  if (server_.is_watched(kHealth)) {
    server_.publish(kHealth, wall_ns(), shared(encode_health(health)));
  }
}

/// For tools that know nothing of Palpate.
void WebFeed::tell_tools(TimePoint now) {
  const bool is_telemetry_due = now >= next_telemetry_;
  const bool is_tool_due = now >= next_tools_;
  const std::uint64_t at_ns = wall_ns();
  for (std::size_t side = 0; side < mirrors_.size(); ++side) {
    tell_tools(side, at_ns, is_telemetry_due, is_tool_due);
  }
  if (is_telemetry_due) next_telemetry_ = now + kTelemetryInterval;
  if (!is_tool_due) return;
  next_tools_ = now + kToolInterval;
  if (has_new_vertices_ && scene_.scene() && server_.is_watched(kPoints)) {
    has_new_vertices_ = false;
    std::vector<std::vector<float>> parts;
    for (std::size_t i = 0; i < scene_.scene()->tissues.size(); ++i) {
      parts.push_back(scene_.vertices_m(i));
    }
    server_.publish(kPoints, at_ns, shared(encode_point_cloud(at_ns, parts)));
  }
}

void WebFeed::tell_tools(std::size_t side, std::uint64_t at_ns, bool is_telemetry_due,
                         bool is_tool_due) {
  // the newest tick of the device, and if possible one of which mofc's half is here too
  const auto& ticks = mirrors_[side].ticks();
  const auto newest = std::find_if(ticks.rbegin(), ticks.rend(),
                                   [](const auto& tick) { return tick.second.device.has_value(); });
  if (newest == ticks.rend()) return;
  const auto whole = std::find_if(newest, ticks.rend(), [](const auto& tick) {
    return tick.second.device.has_value() && tick.second.mofc.has_value();
  });

  const std::size_t telemetry = channel_of(kTelemetry, side);
  if (is_telemetry_due && server_.is_watched(telemetry)) {
    const auto& tick = (whole != ticks.rend() ? whole : newest)->second;
    const MofcCounters& mofc = mirrors_[side].mofc_counters();
    const double transparency =
        mofc.transparency_samples > 0
            ? mofc.transparency_sum / static_cast<double>(mofc.transparency_samples)
            : kNaN;
    server_.publish(telemetry, at_ns,
                    shared(encode_telemetry(at_ns, *tick.device, tick.mofc, transparency)));
  }

  const std::size_t tool = channel_of(kTool, side);
  const std::size_t transforms = channel_of(kTransforms, side);
  if (is_tool_due && (server_.is_watched(tool) || server_.is_watched(transforms))) {
    const DeviceTick& device = *newest->second.device;
    const Vector3 asked_newton = whole != ticks.rend()
                                     ? whole->second.mofc->asked_force_on_hand_newton
                                     : Vector3(Vector3::Zero());
    const SceneState unknown;
    const SceneState& scene = scene_.scene() ? *scene_.scene() : unknown;
    server_.publish(tool, at_ns, shared(encode_tool(at_ns, device, scene, asked_newton)));
    const std::string frame = with_side(context_.session.sides[side].name, "tool");
    server_.publish(transforms, at_ns, shared(encode_transforms(at_ns, frame, device)));
  }
}

void WebFeed::log(LogLevel level, const std::string& node, const std::string& message) {
  if (!server_.is_watched(kLog)) return;
  const std::uint64_t at_ns = wall_ns();
  server_.publish(kLog, at_ns, shared(encode_log(at_ns, level, node, message)));
}

}  // namespace palpate::viewer
