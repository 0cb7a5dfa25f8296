// SPDX-License-Identifier: Apache-2.0
#include "deploy/ros/rosbridge/rosbridge.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/buffers_to_string.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>
#include <utility>

#include "common/core/check.h"
#include "common/core/clock.h"
#include "common/telemetry/event_throttle.h"

namespace palpate::ros {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = beast::websocket;
using asio::ip::tcp;
using boost::system::error_code;

constexpr auto kAnswerTimeout = std::chrono::seconds(5);
constexpr auto kIdleTimeout = std::chrono::seconds(10);  // asked with a ping after half of it
constexpr auto kRetryInterval = std::chrono::seconds(1);
constexpr std::size_t kLargestMessageIn = std::size_t{1} << 20U;
/// What a server is behind with is old when it is read, and TCP would keep it all. So each message
/// is followed by a ping, unless one is on its way; beyond twice the shortest way of those and
/// this, the messages of sensors are left out until its pong comes.
constexpr auto kMostBehind = std::chrono::milliseconds(20);
/// Beyond, so are those that are kept for later.
constexpr std::size_t kMostWaitingBytes = std::size_t{64} << 20U;
/// Of messages that are kept for later, how many the server is asked to hold.
constexpr int kKeptDepth = 256;
constexpr std::size_t kMostLines = 100;  // between two take_lines()
constexpr std::size_t kLongestShown = 200;

/// What a server says may be anything.
std::string shown(const std::string& text) {
  std::string result;
  for (const char c : text.substr(0, kLongestShown)) {
    result += c >= ' ' && c < '\x7F' && c != '"' ? c : '?';
  }
  return result;
}

struct Address {
  std::string host;
  std::string port = "9090";
  std::string name;  // both, for people and for the handshake
};

Address address_of(const std::string& text) {
  const auto wrong = [&](const std::string& why) {
    return SetupError("--rosbridge = " + text + ": " + why);
  };
  if (text.starts_with("wss://")) {
    throw wrong("TLS is not spoken; give an end of a tunnel, as of ssh -L 9090:HOST:9090");
  }
  std::string rest = text.starts_with("ws://") ? text.substr(5) : text;
  if (rest.ends_with('/')) rest.pop_back();
  Address address;
  const std::size_t colon = rest.rfind(':');
  const bool is_bracketed = rest.starts_with('[');  // [::1]:9090
  if (colon != std::string::npos && !(is_bracketed && rest.ends_with(']'))) {
    address.port = rest.substr(colon + 1);
    rest.resize(colon);
  }
  address.name = rest + ":" + address.port;
  if (is_bracketed && rest.ends_with(']')) {
    rest = rest.substr(1, rest.size() - 2);
  } else if (rest.find_first_of(":[]") != std::string::npos) {
    throw wrong("write an address of IPv6 in brackets, such as [::1]:9090");
  }
  address.host = rest;
  const bool is_number = !address.port.empty() && address.port.size() <= 5 &&
                         address.port.find_first_not_of("0123456789") == std::string::npos;
  if (!is_number || std::stoul(address.port) < 1 || std::stoul(address.port) > 65535 ||
      address.host.empty() || address.host.find_first_of("/?#@ \t\"") != std::string::npos) {
    throw wrong("must be HOST or HOST:PORT, such as 192.168.1.5:9090");
  }
  return address;
}

std::string advertisement(const std::string& topic, const std::string& type, bool is_kept) {
  nlohmann::json json{{"op", "advertise"}, {"topic", topic}, {"type", type}};
  if (is_kept) {
    json["latch"] = true;
    json["queue_size"] = kKeptDepth;
  }
  return json.dump();
}
std::string subscription(const std::string& topic, const std::string& type) {
  return nlohmann::json{{"op", "subscribe"}, {"topic", topic}, {"type", type}}.dump();
}

}  // namespace

// --- inbox ---------------------------------------------------------------------------------------

void Inbox::put(Message message) {
  const std::scoped_lock lock(mutex_);
  if (messages_.size() == kDepth) messages_.pop_front();
  messages_.push_back(std::move(message));
}

std::vector<Inbox::Message> Inbox::take() {
  const std::scoped_lock lock(mutex_);
  std::vector<Message> taken(std::make_move_iterator(messages_.begin()),
                             std::make_move_iterator(messages_.end()));
  messages_.clear();
  return taken;
}

// --- client --------------------------------------------------------------------------------------

class Rosbridge::Impl {
 public:
  explicit Impl(const std::string& address)
      : address_(address_of(address)), resolver_(io_), retry_(io_), thread_([this] {
          const auto work = asio::make_work_guard(io_);
          open();
          io_.run();
        }) {}
  ~Impl() { io_.stop(); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void advertise(const std::string& topic, const std::string& type, bool is_kept) {
    const std::scoped_lock lock(mutex_);
    advertised_[topic] = {.type = type, .is_kept = is_kept, .newest = {}};
    send(advertisement(topic, type, is_kept));
  }

  std::shared_ptr<Inbox> subscribe(const std::string& topic, const std::string& type) {
    auto inbox = std::make_shared<Inbox>();
    const std::scoped_lock lock(mutex_);
    subscribed_[topic] = {.type = type, .inbox = inbox};
    send(subscription(topic, type));
    return inbox;
  }

  bool publish(const std::string& topic, const std::string& json) {
    std::string text =
        R"({"op":"publish","topic":)" + nlohmann::json(topic).dump() + R"(,"msg":)" + json + "}";
    const std::scoped_lock lock(mutex_);
    Advertised& advertised = advertised_[topic];
    if (text.size() > kLargestBytes) {
      say(Line::kTooLarge, "a message of " + topic + " has " + std::to_string(text.size()) +
                               " bytes and is left out: a server takes 10,000,000 "
                               "(max_message_size)");
      return false;
    }
    if (advertised.is_kept) advertised.newest = text;
    if (!is_connected_) return true;
    if (advertised.is_kept ? waiting_bytes_ > kMostWaitingBytes : is_behind()) {
      say(Line::kBehind, address_.name + " is behind: messages are left out");
      return false;
    }
    send(std::move(text));
    return true;
  }

  [[nodiscard]] bool is_connected() const { return is_connected_; }
  [[nodiscard]] std::uint32_t connections() const { return connections_; }
  std::vector<std::string> take_lines() {
    const std::scoped_lock lock(mutex_);
    return std::exchange(lines_, {});
  }

 private:
  struct Advertised {
    std::string type;
    bool is_kept = false;
    std::string newest;  // of a topic that keeps it
  };
  struct Subscribed {
    std::string type;
    std::shared_ptr<Inbox> inbox;
  };
  struct Connection {
    explicit Connection(asio::io_context& io) : socket(io) {}
    websocket::stream<beast::tcp_stream> socket;
    beast::flat_buffer buffer;
    bool is_writing = false;
  };
  using Shared = std::shared_ptr<Connection>;
  using Steady = std::chrono::steady_clock;
  /// What may be said again and again.
  enum class Line : std::uint8_t { kTooLarge, kBehind, kStatus, kNoJson };

  // --- by any thread, with the lock

  void send(std::string text) {
    if (!is_connected_) return;  // told at the beginning of the next connection
    waiting_bytes_ += text.size();
    waiting_.push_back(std::make_shared<const std::string>(std::move(text)));
    if (waiting_.size() == 1) asio::post(io_, [this] { write(); });
  }
  void tell(std::string line) {
    if (lines_.size() < kMostLines) lines_.push_back(std::move(line));
  }
  /// At most once a second.
  void say(Line kind, std::string line) {
    const std::uint64_t due =
        throttles_[static_cast<std::size_t>(kind)].note(SteadyClock().now(), 1);
    if (due == 0) return;
    if (due > 1) line += " (and " + std::to_string(due - 1) + " before)";
    tell(std::move(line));
  }
  [[nodiscard]] bool is_behind() const {
    return unanswered_since_ &&
           Steady::now() - *unanswered_since_ > 2 * shortest_way_ + kMostBehind;
  }

  // --- by the thread of the connection

  void open() {
    connection_ = std::make_shared<Connection>(io_);
    resolver_.async_resolve(address_.host, address_.port,
                            [this, connection = connection_](
                                const error_code& error, const tcp::resolver::results_type& found) {
                              if (error) return fail(connection, error.message());
                              auto& stream = beast::get_lowest_layer(connection->socket);
                              stream.expires_after(kAnswerTimeout);
                              stream.async_connect(
                                  found, [this, connection](const error_code& why, const auto&) {
                                    if (why) return fail(connection, why.message());
                                    shake_hands(connection);
                                  });
                            });
  }

  void shake_hands(const Shared& connection) {
    auto& stream = beast::get_lowest_layer(connection->socket);
    error_code ignored;
    stream.socket().set_option(tcp::no_delay(true), ignored);
    stream.expires_never();
    websocket::stream_base::timeout timeout =
        websocket::stream_base::timeout::suggested(beast::role_type::client);
    timeout.handshake_timeout = kAnswerTimeout;
    timeout.idle_timeout = kIdleTimeout;
    timeout.keep_alive_pings = true;
    connection->socket.set_option(timeout);
    connection->socket.read_message_max(kLargestMessageIn);
    connection->socket.auto_fragment(false);
    connection->socket.text(true);
    connection->socket.async_handshake(
        address_.name, "/", [this, connection](const error_code& error) {
          if (error) return fail(connection, "no WebSocket there: " + error.message());
          begin(connection);
        });
  }

  void begin(const Shared& connection) {
    {
      const std::scoped_lock lock(mutex_);
      is_connected_ = true;
      ++connections_;
      told_absence_.clear();
      tell("connected to " + address_.name);
      for (const auto& [topic, entry] : advertised_) {
        send(advertisement(topic, entry.type, entry.is_kept));
      }
      for (const auto& [topic, entry] : subscribed_) send(subscription(topic, entry.type));
      for (const auto& [topic, entry] : advertised_) {
        if (!entry.newest.empty()) send(entry.newest);
      }
    }
    connection->socket.control_callback([this](websocket::frame_type kind, const auto&) {
      if (kind == websocket::frame_type::pong) answered();
    });
    read(connection);
  }

  void ping(const Shared& connection) {
    {
      const std::scoped_lock lock(mutex_);
      if (std::exchange(is_pinged_, true)) return;
      pinged_at_ = Steady::now();
    }
    connection->socket.async_ping({}, [this, connection](const error_code& error) {
      if (error) fail(connection, error.message());
    });
  }
  /// The server has read what was sent before the ping.
  void answered() {
    const std::scoped_lock lock(mutex_);
    if (!std::exchange(is_pinged_, false)) return;  // that of the idle timeout
    shortest_way_ = std::min(shortest_way_, Steady::now() - pinged_at_);
    unanswered_since_.reset();
    if (connection_ && connection_->is_writing) unanswered_since_ = Steady::now();
  }

  void read(const Shared& connection) {
    connection->socket.async_read(connection->buffer,
                                  [this, connection](const error_code& error, std::size_t) {
                                    if (error) return fail(connection, error.message());
                                    take(beast::buffers_to_string(connection->buffer.data()));
                                    connection->buffer.consume(connection->buffer.size());
                                    read(connection);
                                  });
  }

  void take(const std::string& text) {
    const auto received_ns = static_cast<std::int64_t>(wall_clock_ns());
    nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
    const auto text_of = [&](const char* key) {
      const auto found = json.find(key);
      return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
    };
    const std::scoped_lock lock(mutex_);
    if (!json.is_object()) {
      say(Line::kNoJson, address_.name +
                             " sends what is no object of JSON, which knows no NaN and no "
                             "infinity: is it a rosbridge server?");
      return;
    }
    const std::string op = text_of("op");
    if (op == "status") {
      if (const std::string level = text_of("level"); level == "error" || level == "warning") {
        say(Line::kStatus, "the server says: " + shown(text_of("msg")));
      }
      return;
    }
    if (op != "publish") return;
    const auto topic = subscribed_.find(text_of("topic"));
    const auto message = json.find("msg");
    if (topic == subscribed_.end() || message == json.end() || !message->is_object()) return;
    topic->second.inbox->put({.fields = std::make_shared<const nlohmann::json>(std::move(*message)),
                              .received_ns = received_ns});
  }

  void write() {
    const Shared connection = connection_;
    if (!connection || connection->is_writing) return;
    std::shared_ptr<const std::string> next;
    {
      const std::scoped_lock lock(mutex_);
      if (!is_connected_ || waiting_.empty()) return;
      next = waiting_.front();
      if (!unanswered_since_) unanswered_since_ = Steady::now();
    }
    connection->is_writing = true;
    connection->socket.async_write(asio::buffer(*next),
                                   [this, connection, next](const error_code& error, std::size_t) {
                                     connection->is_writing = false;
                                     if (connection != connection_) return;
                                     if (error) return fail(connection, error.message());
                                     {
                                       const std::scoped_lock lock(mutex_);
                                       waiting_bytes_ -= next->size();
                                       waiting_.pop_front();
                                     }
                                     ping(connection);
                                     write();
                                   });
  }

  void fail(const Shared& connection, const std::string& why) {
    if (connection != connection_) return;
    beast::get_lowest_layer(connection->socket).close();
    connection_.reset();
    {
      const std::scoped_lock lock(mutex_);
      if (is_connected_) {
        tell("the connection to " + address_.name + " ended (" + shown(why) +
             "); it is tried again");
      } else if (why != told_absence_) {
        tell("no rosbridge server at " + address_.name + " (" + shown(why) +
             "): ros2 launch rosbridge_server rosbridge_websocket_launch.xml");
        told_absence_ = why;
      }
      is_connected_ = false;
      waiting_.clear();
      waiting_bytes_ = 0;
      unanswered_since_.reset();
      is_pinged_ = false;
      shortest_way_ = kAnswerTimeout;
    }
    retry_.expires_after(kRetryInterval);
    retry_.async_wait([this](const error_code& error) {
      if (!error) open();
    });
  }

  const Address address_;
  asio::io_context io_{1};
  tcp::resolver resolver_;
  asio::steady_timer retry_;
  Shared connection_;
  std::atomic<bool> is_connected_{false};
  std::atomic<std::uint32_t> connections_{0};

  std::mutex mutex_;
  std::map<std::string, Advertised> advertised_;
  std::map<std::string, Subscribed> subscribed_;
  std::deque<std::shared_ptr<const std::string>> waiting_;
  std::size_t waiting_bytes_ = 0;
  std::optional<Steady::time_point> unanswered_since_;  // a write, or a ping
  bool is_pinged_ = false;
  Steady::time_point pinged_at_{};
  Steady::duration shortest_way_ = kAnswerTimeout;  // of a ping and its pong
  std::string told_absence_;                        // its reason
  std::array<EventThrottle, 4> throttles_;          // by Line
  std::vector<std::string> lines_;

  std::jthread thread_;  // ends before the rest
};

Rosbridge::Rosbridge(const std::string& address) : impl_(std::make_unique<Impl>(address)) {}
Rosbridge::~Rosbridge() = default;
void Rosbridge::advertise(const std::string& topic, const std::string& type, bool is_kept) {
  impl_->advertise(topic, type, is_kept);
}
std::shared_ptr<Inbox> Rosbridge::subscribe(const std::string& topic, const std::string& type) {
  return impl_->subscribe(topic, type);
}
bool Rosbridge::publish(const std::string& topic, const std::string& json) {
  return impl_->publish(topic, json);
}
bool Rosbridge::is_connected() const { return impl_->is_connected(); }
std::uint32_t Rosbridge::connections() const { return impl_->connections(); }
std::vector<std::string> Rosbridge::take_lines() { return impl_->take_lines(); }

}  // namespace palpate::ros
