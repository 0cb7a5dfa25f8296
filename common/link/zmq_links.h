// zmq_links.h — the ZeroMQ ends of the ports, one class per kind of end:
//
//   hops 1 + 4   ExchangeServer (mofc, binds)      ExchangeClient (device)
//   hops 2, 3    ZmqSender<T>                      ZmqSource<T>
//   hop 5        ZmqSender<…Batch> (node, binds)   TelemetrySubscriber (viewer)
//                SceneSender (physics, binds)
//   hop 6        ZmqSender<HandTarget> (viewer)    ZmqSource<HandTarget> (device, binds)
//
// Socket types, queue lengths and loss policy of each hop: proto/README.md.
//
// Real time. send() and receive() never block and never throw; a constructor throws SetupError.
// Each end belongs to one thread at a time. Only rejections() may be read from other threads.
//
// Lockstep. All ends of one ZmqContext over inproc:// work in one thread: what send() took, the
// next receive() of the other end gives. Nothing is conflated or dropped there. Publishers drop
// what is sent before their subscriber is known, so wiring makes all ends, then for each one-way
// link lets the receiver answer and asks the sender:
//
//   source.wait_until(clock.now());           // processes what the sender's socket told it
//   if (!sender.wait_for_peer(1s)) …
//
// `on_wait` and `on_send` are the same hooks as MemoryLink's: a scheduler's stand-ins for blocking
// and waking where the clock is virtual.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>
#include <zmq.hpp>

#include "common/core/clock.h"
#include "common/core/ports.h"
#include "common/session/session.h"
#include "common/link/codec.h"
#include "common/link/endpoint.h"
#include "common/link/keys.h"
#include "common/link/zap_handler.h"

namespace palpate {

/// What links over tcp ask of a peer. With keys they are encrypted (CURVE), each end knows the
/// other's key, and only the role that a link is meant for is let in. Without keys only loopback is
/// used.
struct TcpRules {
  std::shared_ptr<const LinkKeys> keys{};  ///< nullptr: none
  bool may_be_plain = false;               ///< without keys beyond loopback too
  /// Counts, of all contexts that have these rules.
  std::shared_ptr<RefusedPeers> refused = std::make_shared<RefusedPeers>();
};

/// libzmq's I/O thread, shared by the sockets made from it. Outlives them.
///
/// Use one context for the exchange (hops 1 and 4) and another one for everything else: then
/// viewers cannot delay the loop.
class ZmqContext {
 public:
  /// Ordinary scheduling.
  ZmqContext() : ZmqContext(TcpRules{}) {}
  explicit ZmqContext(TcpRules tcp)
      : ZmqContext(RealtimeConfig{.priority = 0, .cpu = -1, .wait = WaitStrategy::kBlock},
                   std::move(tcp)) {}
  /// The I/O thread runs at SCHED_FIFO and on the processor given, each only if this process may:
  /// libzmq aborts the process otherwise.
  explicit ZmqContext(const RealtimeConfig& realtime, TcpRules tcp = {});

  [[nodiscard]] bool is_realtime() const { return is_realtime_; }
  [[nodiscard]] bool is_pinned() const { return is_pinned_; }
  /// How the sockets made from it wait for messages; kHybrid sleeps.
  [[nodiscard]] WaitStrategy wait() const { return wait_; }
  [[nodiscard]] zmq::context_t& get() { return context_; }
  [[nodiscard]] const TcpRules& tcp() const { return tcp_; }
  /// Only with keys.
  [[nodiscard]] ZapHandler& zap() { return *zap_; }
  [[nodiscard]] const RefusedPeers& refused() const { return *tcp_.refused; }

 private:
  zmq::context_t context_;
  TcpRules tcp_;
  std::optional<ZapHandler> zap_;
  WaitStrategy wait_;
  bool is_realtime_ = false;
  bool is_pinned_ = false;
};

/// Frames refused by one end, by reason. Written by its thread, read by any.
class Rejections {
 public:
  [[nodiscard]] std::uint64_t total() const noexcept;
  [[nodiscard]] std::uint64_t of(DecodeError error) const noexcept;
  /// Good frames of a second device while the first one is being served.
  [[nodiscard]] std::uint64_t second_writer() const noexcept;
  /// Reason of the latest; kNone if none, or if it was a second writer.
  [[nodiscard]] DecodeError latest() const noexcept;
  /// protocol_major of the latest frame of another version, for explain(); 0 if none.
  [[nodiscard]] std::uint32_t peer_major() const noexcept;

  void count(DecodeError error, std::uint32_t peer_major = 0) noexcept;
  void count_second_writer() noexcept;

 private:
  std::array<std::atomic<std::uint64_t>, kDecodeErrors> by_reason_{};
  std::atomic<std::uint64_t> second_writer_{0};
  std::atomic<DecodeError> latest_{DecodeError::kNone};
  std::atomic<std::uint32_t> peer_major_{0};
};

using SendHook = std::function<void()>;
using WaitHook = std::function<void(TimePoint deadline)>;

/// A timer that is set before it is needed: a virtual machine pays 5 to 10 µs for setting one.
class Alarm {
 public:
  Alarm() = default;
  ~Alarm();
  Alarm(const Alarm&) = delete;
  Alarm& operator=(const Alarm&) = delete;

  /// Opens the descriptor at the first call; without one it never rings.
  void set(TimePoint at) noexcept;
  /// Will it ring in (now, deadline]? The descriptor is then readable from that time on.
  [[nodiscard]] bool rings(TimePoint now, TimePoint deadline) const noexcept {
    return at_ > now && at_ <= deadline;
  }
  [[nodiscard]] int descriptor() const noexcept { return descriptor_; }

 private:
  int descriptor_ = -1;
  TimePoint at_{};
};

/// A socket with its settings, attached: what the ends below have in common.
class LinkSocket {
 public:
  struct Settings {
    zmq::socket_type type;
    int send_queue = 0;      ///< messages per peer
    int receive_queue = 0;   ///< messages per peer
    int buffer_bytes = 0;    ///< kernel buffers each way; 0: the system's choice
    int linger_ms = 0;       ///< how long the last messages may take after closing
    bool conflates = false;  ///< keep the newest message only
    bool heartbeats = false;
    bool takes_all = true;  ///< a subscriber: every kind of message; else those it asks for
    bool tells_each =
        false;  ///< a publisher hears of every subscription, not of each topic's first
    std::int64_t largest_bytes = std::int64_t{2} << 20;  ///< a peer that announces more is cut off
  };
  /// Throws SetupError; also for tcp beyond loopback where the context's rules forbid it.
  LinkSocket(ZmqContext& context, const Settings& settings,
             const std::vector<Attachment>& attachments);

  /// libzmq's own name of the endpoint last attached: the real port where "*" was asked for.
  [[nodiscard]] const std::string& endpoint() const { return endpoint_; }

  [[nodiscard]] void* handle() noexcept { return socket_.handle(); }
  /// Next part; false when there is none.
  [[nodiscard]] bool receive(zmq::message_t& part) noexcept;
  /// Takes the rest of a message of several parts; false if there was none.
  bool drop_more_parts(const zmq::message_t& part) noexcept;
  [[nodiscard]] SendResult send(zmq::message_t& part, int flags) noexcept;
  /// Subscribers only. Takes messages of this kind from now on, or no longer.
  void subscribe(MessageKind kind);
  void unsubscribe(MessageKind kind);
  /// `events`: ZMQ_POLLIN or ZMQ_POLLOUT.
  [[nodiscard]] bool is_ready(int events) noexcept;
  /// Returns when ready, on a signal, or at `deadline` to within the kernel's timer slack.
  void wait_until(int events, const Clock& clock, TimePoint deadline) noexcept;
  /// See Source::prepare_wait().
  void prepare_wait(TimePoint deadline) noexcept;
  /// The ends' wait_until(): by the hook where there is one.
  void wait_for_message(const WaitHook& on_wait, const Clock& clock, TimePoint deadline) noexcept;

 private:
  void protect(ZmqContext& context, const Attachment& attachment);
  void attach(const Attachment& attachment);
  bool sleep_until(const Clock& clock, TimePoint deadline) noexcept;

  std::optional<IpcClaim> claim_;  // outlives the socket
  zmq::socket_t socket_;
  ZapHandler::Watched watched_;  // ends before the socket
  std::string endpoint_;
  int descriptor_ = -1;
  Alarm alarm_;
  bool spins_;
  /// receive() just found nothing, so that the descriptor will tell of the next message.
  bool is_empty_ = false;
};

/// What the subscribers of one publisher want. A topic is a kind byte; the empty one means all.
class Subscriptions {
 public:
  /// Takes the notices that libzmq left in the publisher's socket.
  void take(LinkSocket& socket) noexcept;
  [[nodiscard]] bool has(MessageKind kind) const noexcept;
  /// Subscriptions to it so far; of every subscriber if the socket `tells_each`.
  [[nodiscard]] std::uint64_t count(MessageKind kind) const noexcept;

 private:
  struct Topic {
    bool is_wanted = false;
    std::uint64_t count = 0;
  };
  zmq::message_t notice_;
  Topic all_;
  std::array<Topic, kMessageKinds> of_kind_{};
};

/// How an incoming one-way link treats messages that arrive faster than they are taken.
enum class Delivery : std::uint8_t {
  kNewest,  ///< the socket keeps the newest only
  kEvery,   ///< they queue, so that a fault line behind the socket sees each
};

/// Outgoing end of a one-way link: hops 2, 3, 5 and 6. Publishes to whoever is connected.
template <class T>
class ZmqSender final : public Sender<T> {
 public:
  ZmqSender(ZmqContext& context, const Attachment& attachment);

  SendHook on_send;

  /// kNoPeer: nobody subscribes, nothing was encoded. kDropped: longer than kMaxFrameBytes.
  /// A subscriber whose queue is full misses the message; that is not seen here.
  SendResult send(const T& message) noexcept override;

  [[nodiscard]] bool has_subscriber() noexcept;
  /// Waits, in real time, until somebody subscribes.
  [[nodiscard]] bool wait_for_peer(Duration timeout) noexcept;
  [[nodiscard]] const std::string& endpoint() const { return socket_.endpoint(); }

 private:
  LinkSocket socket_;
  Codec<T> codec_;
  Subscriptions subscriptions_;
};

/// physics_node's end of hop 5. Its three kinds of message are three topics of one socket: what
/// nobody subscribes to is neither computed nor encoded.
class SceneSender final : public Sender<PhysicsBatch>,
                          public Sender<SceneState>,
                          public Sender<MeshFrame> {
 public:
  SceneSender(ZmqContext& context, const Attachment& attachment);

  SendResult send(const PhysicsBatch& message) noexcept override;
  SendResult send(const SceneState& message) noexcept override;
  SendResult send(const MeshFrame& message) noexcept override;

  template <class T>
  [[nodiscard]] bool has_subscriber() noexcept {
    subscriptions_.take(socket_);
    return subscriptions_.has(kKindOf<T>);
  }
  /// How often anybody subscribed to T: a greater number means that somebody needs all of it.
  template <class T>
  [[nodiscard]] std::uint64_t subscriptions() noexcept {
    subscriptions_.take(socket_);
    return subscriptions_.count(kKindOf<T>);
  }
  [[nodiscard]] const std::string& endpoint() const { return socket_.endpoint(); }

 private:
  LinkSocket socket_;
  Subscriptions subscriptions_;
  Codec<PhysicsBatch> batches_;
  Codec<SceneState> scenes_;
  Codec<MeshFrame> meshes_;
};

/// The right of one sender to a link on which anybody with the right key may speak: another session
/// is refused until the first has been silent for kSilence.
class OneWriter {
 public:
  /// A process that was restarted takes longer to speak again.
  static constexpr Duration kSilence = std::chrono::milliseconds(100);

  [[nodiscard]] bool admit(std::uint64_t session_id, TimePoint now) noexcept {
    if (session_id != session_id_ && is_held_ && now - heard_at_ < kSilence) return false;
    is_held_ = true;
    session_id_ = session_id;
    heard_at_ = now;
    return true;
  }

 private:
  bool is_held_ = false;
  std::uint64_t session_id_ = 0;
  TimePoint heard_at_{};
};

/// Incoming end of a one-way link: hops 2, 3 and 6.
template <class T>
class ZmqSource final : public Source<T> {
 public:
  ZmqSource(ZmqContext& context, const Clock& clock, const Attachment& attachment,
            Delivery delivery = Delivery::kNewest);

  WaitHook on_wait;

  /// From now on hears one sender only.
  void keep_to_one_writer() { writer_.emplace(); }

  [[nodiscard]] bool receive(T& message, TimePoint& received_at) noexcept override;
  void wait_until(TimePoint deadline) noexcept override;
  [[nodiscard]] std::uint64_t rejected() const noexcept override { return rejections_.total(); }

  [[nodiscard]] const Rejections& rejections() const { return rejections_; }
  [[nodiscard]] const std::string& endpoint() const { return socket_.endpoint(); }

 private:
  const Clock& clock_;
  LinkSocket socket_;
  Codec<T> codec_;
  zmq::message_t frame_;
  Rejections rejections_;
  std::optional<OneWriter> writer_;  // none: whoever speaks is heard
};

/// mofc_node's end of hops 1 and 4. Answers go to the device whose state was accepted last.
///
/// One writer: while one device is being served, states of any other are refused and counted, until
/// the first has been silent for kSilence or its connection has ended. A device that reconnects
/// keeps its place: its session id says who it is.
class ExchangeServer final : public Source<DeviceState>, public Sender<ForceCommand> {
 public:
  static constexpr Duration kSilence = std::chrono::seconds(1);
  /// So often, while another device asks for its place, the first one's connection is tried.
  static constexpr Duration kTryInterval = std::chrono::milliseconds(10);

  ExchangeServer(ZmqContext& context, const Clock& clock, const Attachment& attachment);

  SendHook on_send;
  WaitHook on_wait;

  [[nodiscard]] bool receive(DeviceState& message, TimePoint& received_at) noexcept override;
  void wait_until(TimePoint deadline) noexcept override;
  [[nodiscard]] std::uint64_t rejected() const noexcept override { return rejections_.total(); }
  /// kNoPeer: no device yet, or it is gone; its place is then free at once.
  SendResult send(const ForceCommand& message) noexcept override;

  [[nodiscard]] const Rejections& rejections() const { return rejections_; }
  [[nodiscard]] const std::string& endpoint() const { return socket_.endpoint(); }

 private:
  [[nodiscard]] bool admit(const DeviceState& message, TimePoint now) noexcept;
  [[nodiscard]] bool has_left(TimePoint now) noexcept;

  const Clock& clock_;
  LinkSocket socket_;
  Codec<DeviceState> states_;
  Codec<ForceCommand> commands_;
  zmq::message_t peer_;  // of the frame at hand
  zmq::message_t frame_;
  DeviceState decoded_;
  Rejections rejections_;

  // the device being served
  bool is_serving_ = false;
  zmq::message_t served_peer_;
  std::uint64_t served_session_id_ = 0;
  TimePoint heard_at_{};
  std::optional<ForceCommand> answer_;  // the last one to it
  TimePoint next_try_at_{};
};

/// device_node's end of hops 1 and 4.
class ExchangeClient final : public Sender<DeviceState>, public Source<ForceCommand> {
 public:
  ExchangeClient(ZmqContext& context, const Clock& clock, const Attachment& attachment);

  SendHook on_send;
  WaitHook on_wait;

  /// kDropped: mofc_node is not connected, or has answered none of the last 256 states. It is then
  /// sent one in 16, so that it finds no long backlog when it wakes.
  SendResult send(const DeviceState& message) noexcept override;
  [[nodiscard]] bool receive(ForceCommand& message, TimePoint& received_at) noexcept override;
  void wait_until(TimePoint deadline) noexcept override;
  void prepare_wait(TimePoint deadline) noexcept override { socket_.prepare_wait(deadline); }
  [[nodiscard]] std::uint64_t rejected() const noexcept override { return rejections_.total(); }

  /// Waits, in real time, until mofc_node is connected.
  [[nodiscard]] bool wait_for_peer(Duration timeout) noexcept;
  [[nodiscard]] const Rejections& rejections() const { return rejections_; }
  [[nodiscard]] const std::string& endpoint() const { return socket_.endpoint(); }

 private:
  const Clock& clock_;
  LinkSocket socket_;
  Codec<DeviceState> states_;
  Codec<ForceCommand> commands_;
  zmq::message_t frame_;
  Rejections rejections_;
  std::uint64_t unanswered_ = 0;  // states since the last answer, or since nobody was connected
};

using TelemetryMessage = std::variant<DeviceBatch, MofcBatch, PhysicsBatch, SceneState, MeshFrame>;

/// A viewer's end of hop 5: all nodes into one socket. Takes the batches of every node; SceneState
/// and MeshFrame on request.
class TelemetrySubscriber final : public Source<TelemetryMessage> {
 public:
  TelemetrySubscriber(ZmqContext& context, const Clock& clock,
                      const std::vector<Attachment>& attachments);

  /// From now on, or no longer. What was subscribed to before a node started counts for it too.
  template <class T>
  void subscribe() {
    socket_.subscribe(kKindOf<T>);
  }
  template <class T>
  void unsubscribe() {
    socket_.unsubscribe(kKindOf<T>);
  }

  WaitHook on_wait;

  [[nodiscard]] bool receive(TelemetryMessage& message, TimePoint& received_at) noexcept override;
  void wait_until(TimePoint deadline) noexcept override;
  [[nodiscard]] std::uint64_t rejected() const noexcept override { return rejections_.total(); }

  /// The protobuf message that the last receive() took, as it came; valid until the next.
  [[nodiscard]] std::span<const std::byte> payload() const noexcept;
  [[nodiscard]] const Rejections& rejections() const { return rejections_; }

 private:
  template <class T>
  [[nodiscard]] bool take(Codec<T>& codec, TelemetryMessage& message) noexcept;

  const Clock& clock_;
  LinkSocket socket_;
  Codec<DeviceBatch> device_;
  Codec<MofcBatch> mofc_;
  Codec<PhysicsBatch> physics_;
  Codec<SceneState> scenes_;
  Codec<MeshFrame> meshes_;
  zmq::message_t frame_;
  Rejections rejections_;
};

}  // namespace palpate
