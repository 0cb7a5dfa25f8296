#include "common/link/zmq_links.h"

#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <thread>

#include "common/core/check.h"

namespace palpate {
namespace {

constexpr int kReconnectMs = 10;
/// A connection attempt or handshake that takes longer is given up and begun again.
constexpr int kConnectMs = 500;
constexpr int kHandshakeMs = 2000;
/// A peer silent for three heartbeats is cut off; so is one that acknowledges nothing for as long.
constexpr int kHeartbeatMs = 100;
constexpr int kHeartbeatTimeoutMs = 300;
constexpr int kTcpMaxRetransmitMs = 500;
/// The kernel's own way to notice a host that is gone: after a second of silence, three probes.
constexpr int kTcpKeepaliveSeconds = 1;
constexpr int kTcpKeepaliveProbes = 3;

/// Over inproc nothing may be lost: lockstep runs many messages between two looks at the queue.
constexpr int kInprocQueue = 1000;
/// libzmq cuts off a peer that announces a longer frame before any memory is taken for it. Above
/// every kMaxFrameBytes of hop 5, so that ordinary excess is refused, counted and explained by the
/// codec; so is the 2 MiB of all other sockets.
constexpr std::int64_t kLargestOfHop5Bytes = std::int64_t{17} << 20;
/// Bad frames looked at in one receive(): a flood must not hold the tick.
constexpr int kMaxRejectedPerCall = 16;

/// Of these queues libzmq tells the other thread every half length, by a signal that wakes whoever
/// waits: with 8 every fourth answer came 20 µs later. ExchangeClient keeps them short.
constexpr LinkSocket::Settings kExchange{
    .type = zmq::socket_type::router, .send_queue = 4096, .receive_queue = 4096};
constexpr std::uint64_t kMostUnanswered = 256;
constexpr std::uint64_t kOneInSilence = 16;

/// Short queues and kernel buffers: what waits in them is old when it arrives.
constexpr LinkSocket::Settings kOneWay{
    .type = zmq::socket_type::xpub, .send_queue = 4, .receive_queue = 4, .buffer_bytes = 8 << 10};
constexpr int kEveryQueue = 64;

/// Lingers, so that the last batch of a node leaves. No heartbeats: see incoming().
constexpr LinkSocket::Settings kTelemetry{.type = zmq::socket_type::xpub,
                                          .send_queue = 8,
                                          .receive_queue = 8,
                                          .buffer_bytes = 64 << 10,
                                          .linger_ms = 200};

constexpr int kSceneQueue = 32;    // a scene's tissues come in one go
constexpr int kViewerQueue = 128;  // 0.7 s of three nodes and a mesh, while a viewer starts

LinkSocket::Settings with_type(LinkSocket::Settings settings, zmq::socket_type type) {
  settings.type = type;
  return settings;
}

/// physics_node's end.
LinkSocket::Settings of_scene_sender() {
  LinkSocket::Settings settings = kTelemetry;
  settings.send_queue = kSceneQueue;
  settings.tells_each = true;
  return settings;
}

/// A viewer's end.
LinkSocket::Settings of_viewer() {
  LinkSocket::Settings settings = with_type(kTelemetry, zmq::socket_type::sub);
  settings.receive_queue = kViewerQueue;
  settings.takes_all = false;
  settings.largest_bytes = kLargestOfHop5Bytes;
  return settings;
}

LinkSocket::Settings incoming(Delivery delivery) {
  LinkSocket::Settings settings = with_type(kOneWay, zmq::socket_type::sub);
  settings.conflates = delivery == Delivery::kNewest;
  settings.heartbeats = delivery == Delivery::kNewest;
  if (delivery == Delivery::kEvery) {
    settings.receive_queue = kEveryQueue;
    // libzmq up to 4.3.5 aborts the process when heartbeats replace a connection whose receive
    // queue was full, and the queue is then read (libzmq issue 3937): a receiver that may lag has
    // none of its own; nor has a publisher, whose peers may send it anything
  }
  return settings;
}

/// An IPv4 address as people write it; libzmq says [::ffff:127.0.0.1].
std::string readable(std::string endpoint) {
  constexpr std::string_view kMapped = "tcp://[::ffff:";
  if (!endpoint.starts_with(kMapped)) return endpoint;
  endpoint.erase(endpoint.find(']'), 1);
  return "tcp://" + endpoint.substr(kMapped.size());
}

std::span<const std::byte> bytes(const zmq::message_t& frame) {
  return {static_cast<const std::byte*>(frame.data()), frame.size()};
}

template <class T>
SendResult send_frame(LinkSocket& socket, Codec<T>& codec, const T& message) noexcept {
  const std::size_t size = codec.encode(message);
  if (size > kMaxFrameBytes<T>) return SendResult::kDropped;
  zmq::message_t frame(size);
  codec.write(static_cast<std::byte*>(frame.data()));
  return socket.send(frame, 0);
}

/// The next good message of a socket whose messages have one part.
template <class T>
bool receive_frame(LinkSocket& socket, Codec<T>& codec, zmq::message_t& frame,
                   Rejections& rejections, T& message) noexcept {
  for (int i = 0; i < kMaxRejectedPerCall && socket.receive(frame); ++i) {
    const DecodeError error = socket.drop_more_parts(frame) ? DecodeError::kMalformed
                                                            : codec.decode(bytes(frame), message);
    if (error == DecodeError::kNone) return true;
    rejections.count(error, codec.peer_major());
  }
  return false;
}

}  // namespace

// --- context ----------------------------------------------------------------------------------

ZmqContext::ZmqContext(const RealtimeConfig& realtime, TcpRules tcp)
    : tcp_(std::move(tcp)), wait_(realtime.wait) {
  // ask the kernel itself, on a thread that ends at once
  std::thread([&] {
    const sched_param parameters{.sched_priority = realtime.priority};
    is_realtime_ = realtime.priority > 0 &&
                   pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters) == 0;
    if (realtime.cpu >= 0 && realtime.cpu < CPU_SETSIZE) {
      cpu_set_t cpus;
      CPU_ZERO(&cpus);
      CPU_SET(static_cast<std::size_t>(realtime.cpu), &cpus);
      is_pinned_ = pthread_setaffinity_np(pthread_self(), sizeof(cpus), &cpus) == 0;
    }
  }).join();

  if (is_realtime_) {
    context_.set(zmq::ctxopt::thread_sched_policy, SCHED_FIFO);
    context_.set(zmq::ctxopt::thread_priority, realtime.priority);
  }
  if (is_pinned_) context_.set(zmq::ctxopt::thread_affinity_cpu_add, realtime.cpu);
  if (tcp_.keys) zap_.emplace(context_, tcp_.keys->allowed, *tcp_.refused);
}

// --- rejections -------------------------------------------------------------------------------

std::uint64_t Rejections::total() const noexcept {
  std::uint64_t total = second_writer();
  for (const auto& n : by_reason_) total += n.load(std::memory_order_relaxed);
  return total;
}
std::uint64_t Rejections::of(DecodeError error) const noexcept {
  return by_reason_[static_cast<std::size_t>(error)].load(std::memory_order_relaxed);
}
std::uint64_t Rejections::second_writer() const noexcept {
  return second_writer_.load(std::memory_order_relaxed);
}
DecodeError Rejections::latest() const noexcept { return latest_.load(std::memory_order_relaxed); }
std::uint32_t Rejections::peer_major() const noexcept {
  return peer_major_.load(std::memory_order_relaxed);
}
void Rejections::count(DecodeError error, std::uint32_t peer_major) noexcept {
  by_reason_[static_cast<std::size_t>(error)].fetch_add(1, std::memory_order_relaxed);
  latest_.store(error, std::memory_order_relaxed);
  if (error == DecodeError::kWrongVersion) {
    peer_major_.store(peer_major, std::memory_order_relaxed);
  }
}
void Rejections::count_second_writer() noexcept {
  second_writer_.fetch_add(1, std::memory_order_relaxed);
  latest_.store(DecodeError::kNone, std::memory_order_relaxed);
}

// --- alarm ------------------------------------------------------------------------------------

Alarm::~Alarm() {
  if (descriptor_ >= 0) close(descriptor_);
}

void Alarm::set(TimePoint at) noexcept {
  if (descriptor_ < 0) descriptor_ = timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK);
  const std::int64_t ns = at.time_since_epoch().count();
  const itimerspec when{.it_interval = {},
                        .it_value = {.tv_sec = ns / 1'000'000'000, .tv_nsec = ns % 1'000'000'000}};
  const bool is_set = timerfd_settime(descriptor_, TFD_TIMER_ABSTIME, &when, nullptr) == 0;
  at_ = is_set ? at : TimePoint{};
}

// --- socket -----------------------------------------------------------------------------------

LinkSocket::LinkSocket(ZmqContext& context, const Settings& settings,
                       const std::vector<Attachment>& attachments)
    : socket_(context.get(), settings.type), spins_(context.wait() == WaitStrategy::kSpin) {
  PALPATE_REQUIRE(!attachments.empty());
  const auto is_any = [&](Scheme scheme) {
    return std::any_of(attachments.begin(), attachments.end(),
                       [&](const Attachment& a) { return scheme_of(a) == scheme; });
  };
  const bool is_inproc = is_any(Scheme::kInproc);

  socket_.set(zmq::sockopt::ipv6, true);
  socket_.set(zmq::sockopt::linger, settings.linger_ms);
  socket_.set(zmq::sockopt::sndhwm, is_inproc ? kInprocQueue : settings.send_queue);
  socket_.set(zmq::sockopt::rcvhwm, is_inproc ? kInprocQueue : settings.receive_queue);
  socket_.set(zmq::sockopt::maxmsgsize, settings.largest_bytes);
  socket_.set(zmq::sockopt::reconnect_ivl, kReconnectMs);
  socket_.set(zmq::sockopt::connect_timeout, kConnectMs);
  socket_.set(zmq::sockopt::handshake_ivl, kHandshakeMs);
  if (is_any(Scheme::kTcp)) {
    socket_.set(zmq::sockopt::tcp_maxrt, kTcpMaxRetransmitMs);
    socket_.set(zmq::sockopt::tcp_keepalive, 1);
    socket_.set(zmq::sockopt::tcp_keepalive_idle, kTcpKeepaliveSeconds);
    socket_.set(zmq::sockopt::tcp_keepalive_intvl, kTcpKeepaliveSeconds);
    socket_.set(zmq::sockopt::tcp_keepalive_cnt, kTcpKeepaliveProbes);
    if (settings.buffer_bytes > 0) {
      socket_.set(zmq::sockopt::sndbuf, settings.buffer_bytes);
      socket_.set(zmq::sockopt::rcvbuf, settings.buffer_bytes);
    }
  }
  if (settings.heartbeats) {
    socket_.set(zmq::sockopt::heartbeat_ivl, kHeartbeatMs);
    socket_.set(zmq::sockopt::heartbeat_timeout, kHeartbeatTimeoutMs);
  }
  if (settings.conflates && !is_inproc) socket_.set(zmq::sockopt::conflate, true);
  if (settings.type == zmq::socket_type::router) socket_.set(zmq::sockopt::router_mandatory, true);
  if (settings.tells_each) socket_.set(zmq::sockopt::xpub_verbose, 1);
  if (settings.type == zmq::socket_type::sub) {
    if (settings.takes_all) socket_.set(zmq::sockopt::subscribe, "");
  } else {
    socket_.set(zmq::sockopt::immediate, true);  // nothing queues for a peer that is not there
  }

  if (context.tcp().keys && is_any(Scheme::kTcp)) {
    const Attachment& first = attachments.front();
    const LinkRoles* roles = roles_of(first.setting);
    watched_ = context.zap().watch(
        socket_, attachments.size() > 1 || roles == nullptr ? "telemetry" : roles->link,
        first.role == Attachment::Role::kBind);
  }
  for (const Attachment& attachment : attachments) {
    protect(context, attachment);
    attach(attachment);
  }
  endpoint_ = readable(socket_.get(zmq::sockopt::last_endpoint));
  descriptor_ = socket_.get(zmq::sockopt::fd);
}

void LinkSocket::protect(ZmqContext& context, const Attachment& a) {
  socket_.set(zmq::sockopt::curve_server, false);  // plain, until told otherwise
  if (scheme_of(a) != Scheme::kTcp) return;
  const LinkRoles* const roles = roles_of(a.setting);
  const LinkKeys* const keys = context.tcp().keys.get();
  if (keys == nullptr || roles == nullptr) {
    if (is_on_loopback(a) || context.tcp().may_be_plain) return;
    throw SetupError(
        a.setting + " = " + a.endpoint +
        ": would leave this machine in plain text, open to strangers; make keys with "
        "`palpate keygen DIR` and give security { key_folder: \"DIR\" } to the session, "
        "or say --insecure where nobody else is on the network");
  }
  const bool binds = a.role == Attachment::Role::kBind;
  const KeyRole role = binds ? roles->server : roles->client;
  const std::optional<KeyPair>& own = keys->of(role);
  if (!own) {
    throw SetupError(a.setting + " = " + a.endpoint + ": this program has no key of " +
                     name_of(role) + "; start the one that has");
  }
  socket_.set(zmq::sockopt::curve_publickey, own->public_key);
  socket_.set(zmq::sockopt::curve_secretkey, own->secret_key);
  if (!binds) {
    socket_.set(zmq::sockopt::curve_serverkey, keys->allowed.server_key(roles->server));
    return;
  }
  socket_.set(zmq::sockopt::curve_server, true);
  socket_.set(zmq::sockopt::zap_domain, roles->link);
  // Without this libzmq lets everybody in when nobody answers for ZAP. Its header hides the name.
  constexpr int kZapEnforceDomain = 93;
  const int yes = 1;
  PALPATE_REQUIRE(zmq_setsockopt(handle(), kZapEnforceDomain, &yes, sizeof(yes)) == 0);
}

void LinkSocket::attach(const Attachment& a) {
  const Scheme scheme = scheme_of(a);
  const bool binds = a.role == Attachment::Role::kBind;
  if (binds && scheme == Scheme::kIpc) claim_.emplace(a);
  try {
    if (binds) {
      socket_.bind(a.endpoint);
    } else {
      socket_.connect(a.endpoint);
    }
  } catch (const zmq::error_t& error) {
    std::string why = std::string(binds ? "cannot bind" : "cannot connect") + " (" + error.what() +
                      "); give ipc://PATH, tcp://HOST:PORT or inproc://NAME";
    if (error.num() == EADDRINUSE) {
      why = "in use by another process; stop it or give " + a.setting + " another endpoint";
    } else if (error.num() == EADDRNOTAVAIL || error.num() == ENODEV) {
      why = "this machine does not have that address; give one of its own";
    } else if (error.num() == EACCES) {
      why = "no right to bind there; give a port above 1023, or a path that you may write";
    }
    throw SetupError(a.setting + " = " + a.endpoint + ": " + why);
  }
}

bool LinkSocket::receive(zmq::message_t& part) noexcept {
  while (zmq_msg_recv(part.handle(), handle(), ZMQ_DONTWAIT) < 0) {
    if (zmq_errno() == EINTR) continue;
    is_empty_ = zmq_errno() == EAGAIN;
    return false;
  }
  is_empty_ = false;
  return true;
}

bool LinkSocket::drop_more_parts(const zmq::message_t& part) noexcept {
  if (!part.more()) return false;
  zmq::message_t rest;
  while (receive(rest) && rest.more()) {
  }
  return true;
}

SendResult LinkSocket::send(zmq::message_t& part, int flags) noexcept {
  is_empty_ = false;  // this may take the descriptor's signal
  while (zmq_msg_send(part.handle(), handle(), ZMQ_DONTWAIT | flags) < 0) {
    if (zmq_errno() == EHOSTUNREACH) return SendResult::kNoPeer;
    if (zmq_errno() != EINTR) return SendResult::kDropped;
  }
  return SendResult::kSent;
}

void LinkSocket::subscribe(MessageKind kind) {
  const auto topic = static_cast<char>(kind);
  socket_.set(zmq::sockopt::subscribe, std::string_view(&topic, 1));
}

void LinkSocket::unsubscribe(MessageKind kind) {
  const auto topic = static_cast<char>(kind);
  socket_.set(zmq::sockopt::unsubscribe, std::string_view(&topic, 1));
}

bool LinkSocket::is_ready(int events) noexcept {
  is_empty_ = false;  // this takes the descriptor's signal
  int present = 0;
  std::size_t size = sizeof(present);
  return zmq_getsockopt(handle(), ZMQ_EVENTS, &present, &size) == 0 && (present & events) != 0;
}

void LinkSocket::wait_until(int events, const Clock& clock, TimePoint deadline) noexcept {
  // The descriptor signals changes, not states, and is_ready() takes the signal: so look before
  // and after each wait.
  while (!is_ready(events)) {
    if (!sleep_until(clock, deadline)) return;
  }
}

/// Until something happens to the socket; false at the deadline or on a signal. ppoll, because
/// zmq_poll counts whole milliseconds.
bool LinkSocket::sleep_until(const Clock& clock, TimePoint deadline) noexcept {
  const TimePoint now = clock.now();
  const Duration left = deadline - now;
  if (left <= Duration::zero()) return false;
  if (spins_) {
    sched_yield();
    return true;
  }
  pollfd descriptors[] = {{.fd = descriptor_, .events = POLLIN, .revents = 0},
                          {.fd = alarm_.descriptor(), .events = POLLIN, .revents = 0}};
  if (alarm_.rings(now, deadline)) return ppoll(descriptors, 2, nullptr, nullptr) > 0;
  const timespec timeout{.tv_sec = left.count() / 1'000'000'000,
                         .tv_nsec = left.count() % 1'000'000'000};
  return ppoll(descriptors, 1, &timeout, nullptr) > 0;
}

void LinkSocket::prepare_wait(TimePoint deadline) noexcept {
  if (!spins_) alarm_.set(deadline);
}

void LinkSocket::wait_for_message(const WaitHook& on_wait, const Clock& clock,
                                  TimePoint deadline) noexcept {
  if (on_wait) {
    if (!is_ready(ZMQ_POLLIN)) on_wait(deadline);
  } else if (is_empty_ && !spins_) {
    // the caller has looked and will look again: fewer system calls on the way to an answer
    is_empty_ = false;
    sleep_until(clock, deadline);
  } else {
    wait_until(ZMQ_POLLIN, clock, deadline);
  }
}

// --- one-way links ----------------------------------------------------------------------------

template <class T>
ZmqSender<T>::ZmqSender(ZmqContext& context, const Attachment& attachment)
    : socket_(context, kIsTelemetry<T> ? kTelemetry : kOneWay, {attachment}) {}

void Subscriptions::take(LinkSocket& socket) noexcept {
  while (socket.receive(notice_)) {
    // first byte 1: somebody subscribed to the topic behind it; 0: nobody has it any more. Longer
    // topics than ours match nothing that is sent here.
    const auto notice = bytes(notice_);
    if (notice.empty() || notice.size() > 2) continue;
    const auto kind = notice.size() == 2 ? static_cast<std::size_t>(notice[1]) : std::size_t{0};
    if (kind >= kMessageKinds) continue;
    Topic& topic = notice.size() == 2 ? of_kind_[kind] : all_;
    topic.is_wanted = notice[0] == std::byte{1};
    if (topic.is_wanted) ++topic.count;
  }
}
bool Subscriptions::has(MessageKind kind) const noexcept {
  return all_.is_wanted || of_kind_[static_cast<std::size_t>(kind)].is_wanted;
}
std::uint64_t Subscriptions::count(MessageKind kind) const noexcept {
  return all_.count + of_kind_[static_cast<std::size_t>(kind)].count;
}

template <class T>
bool ZmqSender<T>::has_subscriber() noexcept {
  subscriptions_.take(socket_);
  return subscriptions_.has(kKindOf<T>);
}

template <class T>
SendResult ZmqSender<T>::send(const T& message) noexcept {
  if (!has_subscriber()) return SendResult::kNoPeer;
  const SendResult result = send_frame(socket_, codec_, message);
  if (result == SendResult::kSent && on_send) on_send();
  return result;
}

template <class T>
bool ZmqSender<T>::wait_for_peer(Duration timeout) noexcept {
  const SteadyClock clock;
  const TimePoint deadline = clock.now() + timeout;
  while (!has_subscriber()) {
    if (clock.now() >= deadline) return false;
    socket_.wait_until(ZMQ_POLLIN, clock, deadline);
  }
  return true;
}

template <class T>
ZmqSource<T>::ZmqSource(ZmqContext& context, const Clock& clock, const Attachment& attachment,
                        Delivery delivery)
    : clock_(clock), socket_(context, incoming(delivery), {attachment}) {}

template <class T>
bool ZmqSource<T>::receive(T& message, TimePoint& received_at) noexcept {
  for (int i = 0; i < kMaxRejectedPerCall; ++i) {
    if (!receive_frame(socket_, codec_, frame_, rejections_, message)) return false;
    received_at = clock_.now();
    if (writer_ && !writer_->admit(message.header.session_id, received_at)) {
      rejections_.count_second_writer();
      continue;
    }
    return true;
  }
  return false;
}

template <class T>
void ZmqSource<T>::wait_until(TimePoint deadline) noexcept {
  socket_.wait_for_message(on_wait, clock_, deadline);
}

template class ZmqSender<ToolMotion>;
template class ZmqSender<Interaction>;
template class ZmqSender<DeviceBatch>;
template class ZmqSender<MofcBatch>;
template class ZmqSender<PhysicsBatch>;
template class ZmqSender<HandTarget>;
template class ZmqSource<ToolMotion>;
template class ZmqSource<Interaction>;
template class ZmqSource<HandTarget>;

// --- exchange ---------------------------------------------------------------------------------

ExchangeServer::ExchangeServer(ZmqContext& context, const Clock& clock,
                               const Attachment& attachment)
    : clock_(clock), socket_(context, kExchange, {attachment}) {}

bool ExchangeServer::admit(const DeviceState& message, TimePoint now) noexcept {
  const bool is_served =
      is_serving_ && (message.header.session_id == served_session_id_ || peer_ == served_peer_);
  if (!is_served && is_serving_ && now - heard_at_ < kSilence && !has_left(now)) return false;
  if (!is_served) answer_.reset();
  is_serving_ = true;
  served_session_id_ = message.header.session_id;
  served_peer_.copy(peer_);
  heard_at_ = now;
  return true;
}

/// libzmq says that a connection has ended when it is asked to send: the last answer once more,
/// which a device that is still there drops as a duplicate.
bool ExchangeServer::has_left(TimePoint now) noexcept {
  if (!answer_ || now < next_try_at_) return false;
  next_try_at_ = now + kTryInterval;
  return send(*answer_) == SendResult::kNoPeer;
}

bool ExchangeServer::receive(DeviceState& message, TimePoint& received_at) noexcept {
  for (int i = 0; i < kMaxRejectedPerCall && socket_.receive(peer_); ++i) {
    // part 1: which connection, by libzmq; part 2: the frame
    const bool is_whole =
        peer_.more() && socket_.receive(frame_) && !socket_.drop_more_parts(frame_);
    const DecodeError error =
        is_whole ? states_.decode(bytes(frame_), decoded_) : DecodeError::kMalformed;
    if (error != DecodeError::kNone) {
      rejections_.count(error, states_.peer_major());
      continue;
    }
    const TimePoint now = clock_.now();
    if (!admit(decoded_, now)) {
      rejections_.count_second_writer();
      continue;
    }
    message = decoded_;
    received_at = now;
    return true;
  }
  return false;
}

void ExchangeServer::wait_until(TimePoint deadline) noexcept {
  socket_.wait_for_message(on_wait, clock_, deadline);
}

SendResult ExchangeServer::send(const ForceCommand& message) noexcept {
  if (!is_serving_) return SendResult::kNoPeer;
  zmq::message_t peer;
  peer.copy(served_peer_);
  SendResult result = socket_.send(peer, ZMQ_SNDMORE);
  if (result == SendResult::kSent) result = send_frame(socket_, commands_, message);
  if (result == SendResult::kSent) answer_ = message;
  if (result == SendResult::kNoPeer) is_serving_ = false;
  if (result == SendResult::kSent && on_send) on_send();
  return result;
}

ExchangeClient::ExchangeClient(ZmqContext& context, const Clock& clock,
                               const Attachment& attachment)
    : clock_(clock),
      socket_(context, with_type(kExchange, zmq::socket_type::dealer), {attachment}) {}

SendResult ExchangeClient::send(const DeviceState& message) noexcept {
  if (++unanswered_ > kMostUnanswered && unanswered_ % kOneInSilence != 0) {
    return SendResult::kDropped;
  }
  const SendResult result = send_frame(socket_, states_, message);
  if (result != SendResult::kSent) unanswered_ = 0;
  if (result == SendResult::kSent && on_send) on_send();
  return result;
}

bool ExchangeClient::receive(ForceCommand& message, TimePoint& received_at) noexcept {
  if (!receive_frame(socket_, commands_, frame_, rejections_, message)) return false;
  unanswered_ = 0;
  received_at = clock_.now();
  return true;
}

void ExchangeClient::wait_until(TimePoint deadline) noexcept {
  socket_.wait_for_message(on_wait, clock_, deadline);
}

bool ExchangeClient::wait_for_peer(Duration timeout) noexcept {
  const SteadyClock clock;
  socket_.wait_until(ZMQ_POLLOUT, clock, clock.now() + timeout);
  return socket_.is_ready(ZMQ_POLLOUT);
}

// --- telemetry --------------------------------------------------------------------------------

SceneSender::SceneSender(ZmqContext& context, const Attachment& attachment)
    : socket_(context, of_scene_sender(), {attachment}) {}

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

TelemetrySubscriber::TelemetrySubscriber(ZmqContext& context, const Clock& clock,
                                         const std::vector<Attachment>& attachments)
    : clock_(clock), socket_(context, of_viewer(), attachments) {
  subscribe<DeviceBatch>();
  subscribe<MofcBatch>();
  subscribe<PhysicsBatch>();
}

template <class T>
bool TelemetrySubscriber::take(Codec<T>& codec, TelemetryMessage& message) noexcept {
  // in place if it is of this kind already: its vectors keep their memory
  auto* held = std::get_if<T>(&message);
  T fresh;
  const DecodeError error = codec.decode(bytes(frame_), held != nullptr ? *held : fresh);
  if (error != DecodeError::kNone) {
    rejections_.count(error, codec.peer_major());
    return false;
  }
  if (held == nullptr) message = std::move(fresh);
  return true;
}

std::span<const std::byte> TelemetrySubscriber::payload() const noexcept {
  return bytes(frame_).subspan(frame_.size() > 0 ? 1 : 0);
}

bool TelemetrySubscriber::receive(TelemetryMessage& message, TimePoint& received_at) noexcept {
  for (int i = 0; i < kMaxRejectedPerCall && socket_.receive(frame_); ++i) {
    if (socket_.drop_more_parts(frame_) || frame_.size() == 0) {
      rejections_.count(DecodeError::kMalformed);
      continue;
    }
    bool is_good = false;
    switch (static_cast<MessageKind>(bytes(frame_)[0])) {
      case MessageKind::kDeviceBatch:
        is_good = take(device_, message);
        break;
      case MessageKind::kMofcBatch:
        is_good = take(mofc_, message);
        break;
      case MessageKind::kPhysicsBatch:
        is_good = take(physics_, message);
        break;
      case MessageKind::kSceneState:
        is_good = take(scenes_, message);
        break;
      case MessageKind::kMeshFrame:
        is_good = take(meshes_, message);
        break;
      default:
        rejections_.count(DecodeError::kWrongKind);
    }
    if (!is_good) continue;
    received_at = clock_.now();
    return true;
  }
  return false;
}

void TelemetrySubscriber::wait_until(TimePoint deadline) noexcept {
  socket_.wait_for_message(on_wait, clock_, deadline);
}

}  // namespace palpate
