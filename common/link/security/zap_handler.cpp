#include "common/link/security/zap_handler.h"

#include <array>
#include <cstring>
#include <map>

#include "common/core/check.h"

namespace palpate {
namespace {

constexpr const char* kZapEndpoint = "inproc://zeromq.zap.01";
constexpr const char* kWakeEndpoint = "inproc://palpate.zap.wake";
constexpr const char* kZapVersion = "1.0";
constexpr std::size_t kKeyBytes = 32;

/// MONITOR_STOPPED reports that a socket was closed, so that its monitor is removed.
constexpr int kWatchedEvents =
    ZMQ_EVENT_ACCEPTED | ZMQ_EVENT_DISCONNECTED | ZMQ_EVENT_HANDSHAKE_SUCCEEDED |
    ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL | ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL |
    ZMQ_EVENT_HANDSHAKE_FAILED_AUTH | ZMQ_EVENT_MONITOR_STOPPED;

/// Reads all parts of the next message; false if there is none.
bool receive(zmq::socket_t& socket, std::vector<std::string>& frames) {
  frames.clear();
  zmq::message_t frame;
  do {
    if (zmq_msg_recv(frame.handle(), socket.handle(), ZMQ_DONTWAIT) < 0) return false;
    frames.emplace_back(static_cast<const char*>(frame.data()), frame.size());
  } while (frame.more());
  return true;
}

std::string z85(const std::string& key) {
  std::array<char, kKeyBytes * 5 / 4 + 1> text{};
  zmq_z85_encode(text.data(), reinterpret_cast<const std::uint8_t*>(key.data()), kKeyBytes);
  return text.data();
}

}  // namespace

// --- requests ---------------------------------------------------------------------------------

ZapVerdict judge(const std::vector<std::string>& frames, const AllowedKeys& allowed) {
  constexpr std::size_t kCurveFrames = 7;
  if (frames.size() < 2 || frames[0] != kZapVersion)
    return {.status = "500", .text = "Not ZAP 1.0"};
  if (frames.size() != kCurveFrames || frames[5] != "CURVE" || frames[6].size() != kKeyBytes) {
    return {.status = "400", .text = "No key"};
  }
  const LinkRoles* link = roles_of(frames[2]);
  if (link == nullptr) return {.status = "400", .text = "No such link"};
  const auto role = allowed.role_of(z85(frames[6]));
  if (!role) {
    return {.status = "400", .text = "Unknown key", .link = link, .refusal = Refusal::kUnknownKey};
  }
  if (*role != link->client) {
    return {.status = "400", .text = "Wrong role", .link = link, .refusal = Refusal::kWrongRole};
  }
  return {.status = "200", .text = "OK", .link = link};
}

// --- handler ----------------------------------------------------------------------------------

/// The monitor of one socket and the state of its connections.
struct ZapHandler::Monitor {
  zmq::socket_t events;
  std::string_view link;
  bool is_server = false;
  bool has_ended = false;
  std::uint64_t outcomes = 0;  // handshakes that succeeded or failed
  /// The value of `outcomes` at the start of each open connection.
  std::map<std::uint32_t, std::uint64_t> outcomes_before{};
};

void ZapHandler::StopWatching::operator()(void* socket) const noexcept {
  zmq_socket_monitor(socket, nullptr, 0);
}

ZapHandler::ZapHandler(zmq::context_t& context, const AllowedKeys& allowed, RefusedPeers& refused)
    : context_(context),
      allowed_(allowed),
      refused_(refused),
      requests_(context, zmq::socket_type::rep),
      wake_(context, zmq::socket_type::pair),
      woken_(context, zmq::socket_type::pair) {
  for (zmq::socket_t* socket : {&requests_, &wake_, &woken_}) {
    socket->set(zmq::sockopt::linger, 0);
  }
  requests_.bind(kZapEndpoint);
  woken_.bind(kWakeEndpoint);
  wake_.connect(kWakeEndpoint);
  thread_ = std::thread([this] { run(); });
}

ZapHandler::~ZapHandler() {
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
    wake_.send(zmq::message_t(), zmq::send_flags::none);
  }
  thread_.join();
}

ZapHandler::Watched ZapHandler::watch(zmq::socket_t& socket, std::string_view link,
                                      bool is_server) {
  const std::lock_guard lock(mutex_);
  const std::string endpoint = "inproc://palpate.zap.monitor" + std::to_string(monitors_made_++);
  PALPATE_REQUIRE(zmq_socket_monitor(socket.handle(), endpoint.c_str(), kWatchedEvents) == 0);
  Watched watched(socket.handle());
  Monitor& monitor =
      new_monitors_.emplace_back(Monitor{.events = zmq::socket_t(context_, zmq::socket_type::pair),
                                         .link = link,
                                         .is_server = is_server});
  monitor.events.set(zmq::sockopt::linger, 0);
  monitor.events.connect(endpoint);
  monitors_.fetch_add(1, std::memory_order_relaxed);
  wake_.send(zmq::message_t(), zmq::send_flags::none);
  return watched;
}

void ZapHandler::run() {
  std::list<Monitor> monitors;
  std::vector<zmq_pollitem_t> items;
  std::vector<std::string> frames;
  for (;;) {
    items.assign({{woken_.handle(), 0, ZMQ_POLLIN, 0}, {requests_.handle(), 0, ZMQ_POLLIN, 0}});
    for (Monitor& monitor : monitors) items.push_back({monitor.events.handle(), 0, ZMQ_POLLIN, 0});
    if (zmq_poll(items.data(), static_cast<int>(items.size()), -1) < 0) continue;  // a signal

    answer();
    for (Monitor& monitor : monitors) take_events(monitor);
    const auto ended = monitors.remove_if([](const Monitor& monitor) { return monitor.has_ended; });
    monitors_.fetch_sub(static_cast<int>(ended), std::memory_order_relaxed);
    while (receive(woken_, frames)) {
      const std::lock_guard lock(mutex_);
      monitors.splice(monitors.end(), new_monitors_);
      if (is_stopping_) return;
    }
  }
}

void ZapHandler::answer() {
  std::vector<std::string> frames;
  while (receive(requests_, frames)) {
    const ZapVerdict verdict = judge(frames, allowed_);
    if (verdict.refusal) refused_.count(verdict.link->link, *verdict.refusal, frames[3]);
    const std::array<std::string, 6> reply{
        kZapVersion, frames.size() > 1 ? frames[1] : "", verdict.status, verdict.text, "", ""};
    for (std::size_t i = 0; i < reply.size(); ++i) {
      const bool is_last = i + 1 == reply.size();
      requests_.send(zmq::buffer(reply[i]),
                     is_last ? zmq::send_flags::none : zmq::send_flags::sndmore);
    }
  }
}

void ZapHandler::take_events(Monitor& monitor) {
  // event and value, then the endpoint
  std::vector<std::string> frames;
  while (receive(monitor.events, frames)) {
    std::uint16_t event = 0;
    std::uint32_t value = 0;
    if (frames.size() != 2 || frames[0].size() != sizeof(event) + sizeof(value)) continue;
    std::memcpy(&event, frames[0].data(), sizeof(event));
    std::memcpy(&value, frames[0].data() + sizeof(event), sizeof(value));
    std::optional<Refusal> refusal;
    switch (event) {
      case ZMQ_EVENT_ACCEPTED:
        monitor.outcomes_before[value] = monitor.outcomes;
        break;
      case ZMQ_EVENT_DISCONNECTED: {
        // libzmq reports no outcome for a peer with another protocol. If connections overlap, the
        // outcome of another one may hide this: the count may then be too low, never too high.
        const auto connection = monitor.outcomes_before.find(value);
        if (connection == monitor.outcomes_before.end()) break;
        if (connection->second == monitor.outcomes) refusal = Refusal::kNoZmtp;
        monitor.outcomes_before.erase(connection);
        break;
      }
      case ZMQ_EVENT_HANDSHAKE_SUCCEEDED:
        ++monitor.outcomes;
        break;
      case ZMQ_EVENT_HANDSHAKE_FAILED_AUTH:
        ++monitor.outcomes;
        if (!monitor.is_server) refusal = Refusal::kRefusedByOther;  // servers: counted in answer()
        break;
      case ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL:
        ++monitor.outcomes;
        refusal = !monitor.is_server                                    ? Refusal::kOtherUnknown
                  : value == ZMQ_PROTOCOL_ERROR_ZMTP_MECHANISM_MISMATCH ? Refusal::kNoKey
                                                                        : Refusal::kBadHandshake;
        break;
      case ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL:
        ++monitor.outcomes;
        refusal = monitor.is_server ? Refusal::kLeft : Refusal::kOtherUnknown;
        break;
      case ZMQ_EVENT_MONITOR_STOPPED:
        monitor.has_ended = true;
        break;
      default:
        break;
    }
    if (refusal) refused_.count(monitor.link, *refusal, monitor.is_server ? "" : frames[1]);
  }
}

}  // namespace palpate
