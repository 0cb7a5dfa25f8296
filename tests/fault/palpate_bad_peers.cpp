// SPDX-License-Identifier: Apache-2.0
// palpate_bad_peers — a program that is no node, or has other keys, listens where a node connects,
// and is then replaced by that node; or one byte is damaged on the way between two nodes: how long
// until the link works.
//
//   palpate_bad_peers                        runs all and prints the table
//   palpate_bad_peers --gtest_filter='*Keys*'  runs some
//
// Each row is also a test.
#include <gtest/gtest.h>
#include <poll.h>

#include <array>
#include <atomic>
#include <cstdio>
#include <functional>
#include <memory>
#include <optional>
#include <thread>

#include "common/core/check.h"
#include "common/link/exchange_client.h"
#include "common/link/exchange_server.h"
#include "common/link/telemetry_subscriber.h"
#include "common/link/zmq_sender.h"
#include "common/link/zmq_source.h"
#include "tests/support/hostile/raw_zmtp.h"
#include "tests/support/machine/machine.h"
#include "tests/support/port.h"
#include "tests/support/random_messages.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;
using namespace test;

constexpr auto kLimit = 2s;
/// Each bad peer listens for this long at least.
constexpr Duration kPresent = 400ms;
constexpr RealtimeConfig kOrdinary{.priority = 0, .cpu = -1};

// --- keys -----------------------------------------------------------------------------------

LinkKeys new_keys() {
  LinkKeys keys;
  std::string list;
  for (std::size_t i = 0; i < kKeyRoles; ++i) {
    keys.own[i] = new_key_pair();
    list += std::string(name_of(static_cast<KeyRole>(i))) + " " + keys.own[i]->public_key + "\n";
  }
  keys.allowed = parse_allowed_keys(list, "test");
  return keys;
}
TcpRules rules(const LinkKeys& keys) { return {.keys = std::make_shared<const LinkKeys>(keys)}; }

// --- links ----------------------------------------------------------------------------------

/// Both ends of a link; the connecting end lives throughout.
struct Link {
  virtual ~Link() = default;
  virtual void connect(ZmqContext& context, const std::string& endpoint) = 0;
  /// @return the endpoint with the actual port
  virtual std::string bind(ZmqContext& context, const std::string& endpoint) = 0;
  virtual void unbind() = 0;
  /// Lets the connecting end work and, if the other end is bound, sends a message through.
  virtual bool passes() = 0;

  SteadyClock clock;
  Random random{1};
};

template <class T>
struct MessageLink : Link {
  explicit MessageLink(std::string link) : name(std::move(link)) {}
  const std::string name;
  T message = random_message<T>(random);
  TimePoint at;
};

struct ExchangeLink final : MessageLink<DeviceState> {
  ExchangeLink() : MessageLink("links.exchange") {}
  void connect(ZmqContext& context, const std::string& endpoint) override {
    client.emplace(context, clock, connect_to(endpoint, name));
  }
  std::string bind(ZmqContext& context, const std::string& endpoint) override {
    return server.emplace(context, clock, bind_to(endpoint, name)).endpoint();
  }
  void unbind() override { server.reset(); }
  bool passes() override {
    ++message.header.sequence;
    static_cast<void>(client->send(message));
    DeviceState state;
    if (server && server->receive(state, at)) server->send(command);
    ForceCommand answer;
    return client->receive(answer, at);
  }
  ForceCommand command = random_message<ForceCommand>(random);
  std::optional<ExchangeClient> client;
  std::optional<ExchangeServer> server;
};

/// Hops 2 and 6: the sender connects.
template <class T>
struct OneWayLink final : MessageLink<T> {
  using MessageLink<T>::MessageLink;
  void connect(ZmqContext& context, const std::string& endpoint) override {
    sender.emplace(context, connect_to(endpoint, this->name));
  }
  std::string bind(ZmqContext& context, const std::string& endpoint) override {
    return source.emplace(context, this->clock, bind_to(endpoint, this->name)).endpoint();
  }
  void unbind() override { source.reset(); }
  bool passes() override {
    static_cast<void>(sender->send(this->message));
    return source && source->receive(this->message, this->at);
  }
  std::optional<ZmqSender<T>> sender;
  std::optional<ZmqSource<T>> source;
};

struct InteractionLink final : MessageLink<Interaction> {
  InteractionLink() : MessageLink("links.interaction") {}
  void connect(ZmqContext& context, const std::string& endpoint) override {
    source.emplace(context, clock, connect_to(endpoint, name));
  }
  std::string bind(ZmqContext& context, const std::string& endpoint) override {
    return sender.emplace(context, bind_to(endpoint, name)).endpoint();
  }
  void unbind() override { sender.reset(); }
  bool passes() override {
    if (sender) static_cast<void>(sender->send(message));
    return source->receive(message, at);
  }
  std::optional<ZmqSource<Interaction>> source;
  std::optional<ZmqSender<Interaction>> sender;
};

struct TelemetryLink final : MessageLink<PhysicsBatch> {
  TelemetryLink() : MessageLink("links.physics_telemetry") {}
  void connect(ZmqContext& context, const std::string& endpoint) override {
    viewer.emplace(context, clock, std::vector{connect_to(endpoint, name)});
  }
  std::string bind(ZmqContext& context, const std::string& endpoint) override {
    return node.emplace(context, bind_to(endpoint, name)).endpoint();
  }
  void unbind() override { node.reset(); }
  bool passes() override {
    if (node) static_cast<void>(node->send(message));
    return viewer->receive(received, at);
  }
  TelemetryMessage received;
  std::optional<TelemetrySubscriber> viewer;
  std::optional<ZmqSender<PhysicsBatch>> node;
};

constexpr std::array kLinkNames{"exchange", "tool_motion", "interaction", "telemetry",
                                "hand_target"};
/// What the binding end is.
constexpr std::array kBindingTypes{zmq::socket_type::router, zmq::socket_type::pull,
                                   zmq::socket_type::router, zmq::socket_type::router,
                                   zmq::socket_type::pull};
std::unique_ptr<Link> make_link(std::size_t index) {
  switch (index) {
    case 0:
      return std::make_unique<ExchangeLink>();
    case 1:
      return std::make_unique<OneWayLink<ToolMotion>>("links.tool_motion");
    case 2:
      return std::make_unique<InteractionLink>();
    case 3:
      return std::make_unique<TelemetryLink>();
    default:
      return std::make_unique<OneWayLink<HandTarget>>("links.hand_target");
  }
}

// --- bad peers ------------------------------------------------------------------------------

std::string random_bytes(std::size_t size) {
  Random random(7);
  std::string bytes;
  while (bytes.size() < size) bytes += static_cast<char>(random.bits());
  return bytes;
}

/// Listens on a port of 127.0.0.1 in a thread and writes the same bytes to each connection.
class Listener {
 public:
  /// @param relay_to  endpoint of a true node to which all bytes are passed on and whose bytes
  ///     precede `bytes`; "" for none
  Listener(const std::string& endpoint, std::string bytes, bool closes, std::string relay_to = "")
      : bytes_(std::move(bytes)), closes_(closes), relay_to_(std::move(relay_to)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port =
        htons(static_cast<std::uint16_t>(std::stoi(endpoint.substr(endpoint.rfind(':') + 1))));
    socket_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    const int yes = 1;
    setsockopt(socket_, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
    is_listening_ = ::bind(socket_, reinterpret_cast<sockaddr*>(&address), sizeof(address)) == 0 &&
                    listen(socket_, 16) == 0;
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  }
  ~Listener() {
    thread_ = {};
    close(socket_);
  }
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  [[nodiscard]] bool is_listening() const { return is_listening_; }
  [[nodiscard]] int served() const { return served_; }

 private:
  struct Peer {
    int descriptor = -1;
    int relay = -1;
    TimePoint relayed_at{};
    bool is_served = false;
  };

  void run(const std::stop_token& stop) {
    std::vector<Peer> peers;
    while (!stop.stop_requested()) {
      std::vector<pollfd> items{{.fd = socket_, .events = POLLIN, .revents = 0}};
      for (const Peer& peer : peers) {
        items.push_back({.fd = peer.descriptor, .events = POLLIN, .revents = 0});
        if (peer.relay >= 0) items.push_back({.fd = peer.relay, .events = POLLIN, .revents = 0});
      }
      poll(items.data(), items.size(), 5);
      const int descriptor = accept4(socket_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
      if (descriptor >= 0) peers.push_back({.descriptor = descriptor, .relay = open_relay()});
      std::erase_if(peers, [&](Peer& peer) {
        const bool is_over = serve(peer);
        if (is_over) finish(peer);
        return is_over;
      });
    }
    for (const Peer& peer : peers) finish(peer);
  }
  [[nodiscard]] int open_relay() const {
    if (relay_to_.empty()) return -1;
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port =
        htons(static_cast<std::uint16_t>(std::stoi(relay_to_.substr(relay_to_.rfind(':') + 1))));
    const int relay = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    EXPECT_EQ(::connect(relay, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
    return relay;
  }
  static void finish(const Peer& peer) {
    close(peer.descriptor);
    if (peer.relay >= 0) close(peer.relay);
  }
  /// Passes on what has arrived; false once `from` is closed.
  static bool pass(int from, int to) {
    char buffer[4096];
    for (;;) {
      const ssize_t n = recv(from, buffer, sizeof(buffer), MSG_DONTWAIT);
      if (n == 0) return false;
      if (n < 0) return errno == EAGAIN;
      if (to >= 0) send(to, buffer, static_cast<std::size_t>(n), MSG_NOSIGNAL);
    }
  }
  /// True once the connection is over.
  bool serve(Peer& peer) {
    if (!pass(peer.descriptor, peer.relay)) return true;
    if (peer.relay >= 0) {
      if (!pass(peer.relay, peer.descriptor)) return true;
      constexpr Duration kGood = 100ms;
      if (peer.relayed_at == TimePoint{}) peer.relayed_at = clock_.now();
      if (clock_.now() - peer.relayed_at < kGood) return false;
    }
    if (peer.is_served) return false;
    peer.is_served = true;
    send(peer.descriptor, bytes_.data(), bytes_.size(), MSG_NOSIGNAL);
    ++served_;
    return closes_;
  }

  SteadyClock clock_;
  std::string bytes_;
  bool closes_;
  std::string relay_to_;
  int socket_ = -1;
  bool is_listening_ = false;
  std::atomic<int> served_{0};
  std::jthread thread_;
};

struct BadPeer {
  const char* name;
  bool with_keys;
  /// The bytes that it writes, for a binding end of this type.
  std::function<std::string(const char* type)> bytes{};
  bool closes = false;
  enum class Kind { kBytes, kNoKeys, kKeys, kRelay } kind = Kind::kBytes;
};
void PrintTo(const BadPeer& peer, std::ostream* out) { *out << peer.name; }

std::string handshake(const char* type) { return zmtp_greeting() + zmtp_ready(type); }

const std::vector<BadPeer>& bad_peers() {
  static const auto all = [] {
    std::vector<BadPeer> peers;
    for (const bool keys : {false, true}) {
      const auto same = [](const std::string& bytes) { return [=](const char*) { return bytes; }; };
      peers.push_back({"accepts and closes", keys, same(""), true});
      peers.push_back({"accepts and is silent", keys, same("")});
      peers.push_back({"zeros", keys, same(std::string(300, '\0'))});
      peers.push_back({"random bytes", keys, same(random_bytes(300))});
      peers.push_back({"HTTP", keys, same("HTTP/1.1 400 Bad Request\r\n\r\n")});
      peers.push_back({"mechanism PLAIN", keys, same(zmtp_greeting("PLAIN"))});
      peers.push_back({"READY garbage", keys,
                       same(zmtp_greeting(keys ? "CURVE" : "NULL") +
                            zmtp_frame(kCommand, "\5READY" + random_bytes(100)))});
    }
    peers.push_back({"wrong type of socket", false, [](const char*) { return handshake("PUB"); }});
    peers.push_back({"a frame of 1 TiB", false, [](const char* type) {
                       return handshake(type) + zmtp_head(kLastPart, std::uint64_t{1} << 40);
                     }});
    peers.push_back({"an oversized frame", false, [](const char* type) {
                       return handshake(type) + zmtp_head(kLastPart, 20 << 20) + random_bytes(3000);
                     }});
    peers.push_back({"random bytes after the handshake", false,
                     [](const char* type) { return handshake(type) + random_bytes(300); }});
    peers.push_back({"a node with keys", false, {}, false, BadPeer::Kind::kKeys});
    peers.push_back({"a node without keys", true, {}, false, BadPeer::Kind::kNoKeys});
    peers.push_back({"a node with other keys", true, {}, false, BadPeer::Kind::kKeys});
    peers.push_back({"300 random bytes in the stream", true,
                     [](const char*) { return random_bytes(300); }, false, BadPeer::Kind::kRelay});
    return peers;
  }();
  return all;
}

// --- the table ------------------------------------------------------------------------------

struct Row {
  std::string peer;
  bool with_keys;
  std::array<std::optional<Duration>, kLinkNames.size()> back{};
  std::array<bool, kLinkNames.size()> is_left_out{};
};
std::vector<Row>& table() {
  static std::vector<Row> rows;
  return rows;
}
void print_table() {
  std::printf("| the other end was | keys |");
  for (const char* link : kLinkNames) std::printf(" %s |", link);
  std::printf("\n|---|---|---|---|---|---|---|\n");
  for (const Row& row : table()) {
    std::printf("| %s | %s |", row.peer.c_str(), row.with_keys ? "yes" : "no");
    for (std::size_t i = 0; i < row.back.size(); ++i) {
      if (row.back[i]) {
        std::printf(" %.0f ms |", 1e3 * to_seconds(*row.back[i]));
      } else {
        std::printf(" %s |", row.is_left_out[i] ? "–" : "NEVER");
      }
    }
    std::printf("\n");
  }
}

class BadPeers : public testing::TestWithParam<BadPeer> {};

std::string name_of_test(const testing::TestParamInfo<BadPeer>& peer) {
  std::string name = peer.param.with_keys ? "Keys_" : "Plain_";
  for (const char* c = peer.param.name; *c != '\0'; ++c) {
    if (std::isalnum(static_cast<unsigned char>(*c)) != 0) name += *c;
  }
  return name;
}
INSTANTIATE_TEST_SUITE_P(Links, BadPeers, testing::ValuesIn(bad_peers()), name_of_test);

TEST_P(BadPeers, AreReplacedByTheNode) {
  const BadPeer& bad = GetParam();
  const QuietMachine machine;
  const LinkKeys keys = new_keys();
  const TcpRules good_rules = bad.with_keys ? rules(keys) : TcpRules{};
  const TcpRules other_rules = bad.kind == BadPeer::Kind::kKeys ? rules(new_keys()) : TcpRules{};
  ZmqContext clients(kOrdinary, good_rules);
  ZmqContext nodes(kOrdinary, good_rules);
  const SteadyClock clock;

  struct Tested {
    std::unique_ptr<Link> link;
    std::string endpoint;
    std::unique_ptr<Listener> listener{};
    std::unique_ptr<Link> other_node{};
  };
  std::vector<Tested> tested;
  {
    std::array<HeldPort, kLinkNames.size()> ports;
    for (std::size_t i = 0; i < kLinkNames.size(); ++i) {
      tested.push_back({.link = make_link(i), .endpoint = ports[i].endpoint()});
    }
  }
  // declared after the links that use it
  ZmqContext others(kOrdinary, other_rules);
  for (std::size_t i = 0; i < tested.size(); ++i) {
    Tested& t = tested[i];
    t.link->connect(clients, t.endpoint);
    if (bad.kind == BadPeer::Kind::kKeys || bad.kind == BadPeer::Kind::kNoKeys) {
      t.other_node = make_link(i);
      t.other_node->bind(others, t.endpoint);
      continue;
    }
    std::string relay_to;
    if (bad.kind == BadPeer::Kind::kRelay) {
      relay_to = t.link->bind(nodes, "tcp://127.0.0.1:*");
    }
    const char* type = kBindingTypes[i] == zmq::socket_type::pull ? "PULL" : "ROUTER";
    t.listener = std::make_unique<Listener>(t.endpoint, bad.bytes(type), bad.closes, relay_to);
    ASSERT_TRUE(t.listener->is_listening());
  }
  const auto run_until = [&](TimePoint deadline, const std::function<bool()>& is_done) {
    while (clock.now() < deadline && !is_done()) std::this_thread::sleep_for(500us);
  };
  const TimePoint present_until = clock.now() + kPresent;
  run_until(present_until + patience(5s), [&] {
    bool is_done = clock.now() >= present_until;
    for (Tested& t : tested) {
      static_cast<void>(t.link->passes());
      if (t.listener) is_done = is_done && t.listener->served() > 0;
    }
    return is_done;
  });

  Row row{.peer = bad.name, .with_keys = bad.with_keys};
  for (Tested& t : tested) {
    t.link->unbind();
    t.listener.reset();
    t.other_node.reset();
  }
  const TimePoint begin = clock.now();
  const TimePoint deadline = begin + patience(kLimit);
  for (std::size_t i = 0; i < tested.size(); ++i) {
    // libzmq releases a port shortly after closing
    run_until(deadline, [&] {
      try {
        tested[i].link->bind(nodes, tested[i].endpoint);
        return true;
      } catch (const SetupError&) {
        return false;
      }
    });
  }
  run_until(deadline, [&] {
    bool is_done = true;
    for (std::size_t i = 0; i < tested.size(); ++i) {
      if (!row.back[i] && tested[i].link->passes()) row.back[i] = clock.now() - begin;
      is_done = is_done && row.back[i];
    }
    return is_done;
  });

  for (std::size_t i = 0; i < tested.size(); ++i) {
    ASSERT_TRUE(row.back[i]) << kLinkNames[i] << " does not come back";
    if (*row.back[i] < kLimit || machine.may_check("back within 2 s")) {
      EXPECT_LT(*row.back[i], kLimit) << kLinkNames[i];
    }
  }
  table().push_back(row);
}

// --- one damaged byte -------------------------------------------------------------------------

/// What happens to one byte of a chunk.
struct Damage {
  const char* name;
  enum class Kind { kFlip, kDrop, kRepeat } kind;
  std::size_t at;  ///< of the chunk; its middle if it is beyond its end
};
void PrintTo(const Damage& damage, std::ostream* out) { *out << damage.name; }

/// Passes a tcp connection on to a node, and damages one byte when it is told to.
class DamagingRelay {
 public:
  explicit DamagingRelay(std::string node) : node_(std::move(node)) {
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  }

  [[nodiscard]] const std::string& endpoint() const { return endpoint_; }
  /// In the next chunk in this direction. Call it once.
  void damage(const Damage& damage, bool towards_node) {
    damage_ = damage;
    towards_node_ = towards_node;
    is_due_ = true;
  }
  [[nodiscard]] bool has_damaged() const { return has_damaged_; }
  [[nodiscard]] int connections() const { return connections_; }

 private:
  struct Connection {
    int near = -1;
    int far = -1;
  };

  void run(const std::stop_token& stop) {
    std::vector<Connection> open;
    while (!stop.stop_requested()) {
      std::vector<pollfd> items;
      for (const Connection& c : open) {
        items.push_back({.fd = c.near, .events = POLLIN, .revents = 0});
        items.push_back({.fd = c.far, .events = POLLIN, .revents = 0});
      }
      if (!items.empty()) poll(items.data(), items.size(), 2);
      pollfd ready{.fd = listener_.descriptor(), .events = POLLIN, .revents = 0};
      if (poll(&ready, 1, open.empty() ? 5 : 0) == 1) {
        const RawAddress address(node_);
        const Connection c{.near = listener_.accept(),
                           .far = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)};
        if (::connect(c.far, address.get(), address.size()) == 0) ++connections_;
        open.push_back(c);
      }
      std::erase_if(open, [&](const Connection& c) {
        if (pass(c.near, c.far, true) && pass(c.far, c.near, false)) return false;
        close_both(c);
        return true;
      });
    }
    for (const Connection& c : open) close_both(c);
  }
  static void close_both(const Connection& c) {
    close(c.near);
    close(c.far);
  }
  /// False once `from` is closed.
  bool pass(int from, int to, bool towards_node) {
    char buffer[4096];
    const ssize_t n = recv(from, buffer, sizeof(buffer), MSG_DONTWAIT);
    if (n <= 0) return n < 0 && errno == EAGAIN;
    std::string bytes(buffer, static_cast<std::size_t>(n));
    if (is_due_ && !has_damaged_ && towards_node == towards_node_) {
      const std::size_t at = std::min(damage_.at, bytes.size() / 2);
      constexpr int kBits = 0x42;  // of the flags: one that is unused, and "long frame"
      if (damage_.kind == Damage::Kind::kFlip) bytes[at] = static_cast<char>(bytes[at] ^ kBits);
      if (damage_.kind == Damage::Kind::kDrop) bytes.erase(at, 1);
      if (damage_.kind == Damage::Kind::kRepeat) bytes.insert(at, 1, bytes[at]);
      has_damaged_ = true;
    }
    return send(to, bytes.data(), bytes.size(), MSG_NOSIGNAL) > 0;
  }

  std::string node_;
  RawListener listener_{"tcp://127.0.0.1:0"};
  std::string endpoint_ = listener_.tcp_endpoint();
  Damage damage_{};
  bool towards_node_ = false;
  std::atomic<bool> is_due_{false};
  std::atomic<bool> has_damaged_{false};
  std::atomic<int> connections_{0};
  std::jthread thread_;
};

class DamagedByte : public testing::TestWithParam<Damage> {
 protected:
  /// One byte on its way to the binding ends, or from them, of all links that send that way.
  void expect_back(bool towards_node);
};

constexpr std::size_t kMiddle = 1 << 20;
INSTANTIATE_TEST_SUITE_P(Links, DamagedByte,
                         testing::Values(Damage{"Flipped", Damage::Kind::kFlip, kMiddle},
                                         Damage{"FlagsFlipped", Damage::Kind::kFlip, 0},
                                         Damage{"LengthFlipped", Damage::Kind::kFlip, 1},
                                         Damage{"Dropped", Damage::Kind::kDrop, kMiddle},
                                         Damage{"Repeated", Damage::Kind::kRepeat, kMiddle}),
                         [](const auto& test) { return std::string(test.param.name); });

void DamagedByte::expect_back(bool towards_node) {
  const QuietMachine machine;
  const LinkKeys keys = new_keys();
  ZmqContext clients(kOrdinary, rules(keys));
  ZmqContext nodes(kOrdinary, rules(keys));
  const SteadyClock clock;
  struct Tested {
    std::unique_ptr<Link> link;
    std::unique_ptr<DamagingRelay> relay;
    std::optional<TimePoint> damaged_at{};
    std::optional<Duration> back{};
  };
  std::array<std::optional<Tested>, kLinkNames.size()> tested;
  for (std::size_t i = 0; i < tested.size(); ++i) {
    // a binding end that only receives sends nothing to damage
    if (!towards_node && kBindingTypes[i] == zmq::socket_type::pull) continue;
    tested[i].emplace(Tested{.link = make_link(i), .relay = nullptr});
    tested[i]->relay =
        std::make_unique<DamagingRelay>(tested[i]->link->bind(nodes, "tcp://127.0.0.1:*"));
    tested[i]->link->connect(clients, tested[i]->relay->endpoint());
  }

  // each works, is damaged, and comes back over another connection
  const auto run_until = [&](Duration limit, const std::function<bool(Tested&, bool)>& is_done) {
    const TimePoint deadline = clock.now() + limit;
    bool are_done = false;
    while (!are_done && clock.now() < deadline) {
      are_done = true;
      for (auto& t : tested) {
        if (t && !is_done(*t, t->link->passes())) are_done = false;
      }
      std::this_thread::sleep_for(500us);
    }
    return are_done;
  };
  std::size_t working = 0;
  ASSERT_TRUE(run_until(patience(5s), [&](Tested& t, bool passes) {
    if (passes && !t.damaged_at) {
      t.relay->damage(GetParam(), towards_node);
      t.damaged_at = clock.now();
      ++working;
    }
    if (!t.relay->has_damaged()) t.damaged_at = t.damaged_at ? clock.now() : t.damaged_at;
    return t.damaged_at && t.relay->has_damaged();
  })) << working;
  static_cast<void>(run_until(patience(kLimit) + 1s, [&](Tested& t, bool passes) {
    if (passes && !t.back && t.relay->connections() > 1) t.back = clock.now() - *t.damaged_at;
    return t.back.has_value();
  }));

  Row row{.peer = std::string(GetParam().name) + (towards_node ? " to" : " from") + " the node",
          .with_keys = true};
  for (std::size_t i = 0; i < tested.size(); ++i) {
    row.is_left_out[i] = !tested[i];
    if (!tested[i]) continue;
    row.back[i] = tested[i]->back;
    EXPECT_TRUE(tested[i]->back) << kLinkNames[i] << " does not come back";
    if (tested[i]->back && (*tested[i]->back < kLimit || machine.may_check("back within 2 s"))) {
      EXPECT_LT(*tested[i]->back, kLimit) << kLinkNames[i];
    }
  }
  table().push_back(row);
}

TEST_P(DamagedByte, OnItsWayToTheNode) { expect_back(true); }
TEST_P(DamagedByte, OnItsWayFromTheNode) { expect_back(false); }

}  // namespace
}  // namespace palpate

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  const int status = RUN_ALL_TESTS();
  palpate::print_table();
  return status;
}
