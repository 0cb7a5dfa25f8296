// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/audience/web_audience.h"

#include <pthread.h>

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>
#include <cmath>
#include <ctime>
#include <functional>
#include <future>
#include <random>
#include <string>
#include <thread>
#include <utility>

namespace palpate::bench {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = beast::websocket;
using boost::system::error_code;
using tcp = asio::ip::tcp;

constexpr int kSceneChannel = 1;
constexpr int kMeshChannel = 2;
/// What a page subscribes to: scene, meshes, device, mofc, physics, health, log.
constexpr const char* kSubscribe =
    R"({"op":"subscribe","subscriptions":[{"id":1,"channelId":1},{"id":2,"channelId":2},)"
    R"({"id":3,"channelId":3},{"id":4,"channelId":4},{"id":5,"channelId":5},)"
    R"({"id":6,"channelId":6},{"id":11,"channelId":11}]})";
constexpr std::size_t kLargestMessageBytes = std::size_t{17} << 20;

}  // namespace

class WebAudienceClient : public std::enable_shared_from_this<WebAudienceClient> {
 public:
  WebAudienceClient(WebAudience& audience, asio::io_context& io, std::size_t index)
      : audience_(audience), index_(index), socket_(io) {}

  using Done = std::function<void(bool is_subscribed)>;
  /// Calls `done` when it has subscribed or failed.
  void connect(std::uint16_t port, Done done) {
    const tcp::endpoint server(asio::ip::address_v4::loopback(), port);
    beast::get_lowest_layer(socket_).async_connect(
        server, [self = shared_from_this(), done = std::move(done)](const error_code& error) {
          if (error) return self->lose(done);
          self->upgrade(done);
        });
  }

  void leave() {
    has_left_ = true;
    error_code ignored;
    beast::get_lowest_layer(socket_).close(ignored);
  }

 private:
  void upgrade(const Done& done) {
    socket_.set_option(websocket::stream_base::decorator([](websocket::request_type& request) {
      request.set(beast::http::field::sec_websocket_protocol, "foxglove.sdk.v1");
    }));
    socket_.read_message_max(kLargestMessageBytes);
    socket_.async_handshake("localhost", "/",
                            [self = shared_from_this(), done](const error_code& error) {
                              if (error) return self->lose(done);
                              self->subscribe(done);
                            });
  }
  void subscribe(const Done& done) {
    socket_.text(true);
    socket_.async_write(asio::buffer(subscription_),
                        [self = shared_from_this(), done](const error_code& error, std::size_t) {
                          if (error) return self->lose(done);
                          self->read();
                          done(true);
                        });
  }
  void read() {
    socket_.async_read(buffer_,
                       [self = shared_from_this()](const error_code& error, std::size_t bytes) {
                         if (error) {
                           if (!self->has_left_) ++self->audience_.lost_;
                           return;
                         }
                         self->count(bytes);
                         self->buffer_.clear();
                         self->read();
                       });
  }
  void count(std::size_t bytes) {
    audience_.bytes_ += bytes;
    ++audience_.messages_;
    if (!socket_.got_binary() || bytes < 2) return;
    const int channel = static_cast<const char*>(buffer_.data().data())[1];
    if (channel == kSceneChannel && !has_scene_) {
      has_scene_ = true;
      ++audience_.with_scene_;
    }
    if (channel != kMeshChannel) return;
    ++audience_.meshes_[index_];
    audience_.mesh_bytes_ += bytes;
  }
  static void lose(const Done& done) { done(false); }

  WebAudience& audience_;
  std::size_t index_;
  websocket::stream<tcp::socket> socket_;
  beast::flat_buffer buffer_;
  std::string subscription_ = kSubscribe;
  bool has_scene_ = false;
  bool has_left_ = false;
};

class WebAudience::Impl {
 public:
  Impl(WebAudience& audience, std::uint16_t port) : audience_(audience), port_(port) {
    asio::post(io_, [this] { connect_next(); });
    thread_ = std::thread([this] { io_.run(); });
  }
  ~Impl() {
    io_.stop();
    thread_.join();
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void reconnect() {
    std::promise<void> left;
    asio::post(io_, [&] {
      for (const auto& client : clients_) client->leave();
      audience_.with_scene_ = 0;
      for (std::size_t i = 0; i < clients_.size(); ++i) come_back(i, kFirstRetry_s);
      left.set_value();
    });
    left.get_future().wait();
  }

  [[nodiscard]] double processor_s() {
    clockid_t clock{};
    timespec used{};
    if (pthread_getcpuclockid(thread_.native_handle(), &clock) != 0 ||
        clock_gettime(clock, &used) != 0) {
      return std::nan("");
    }
    return static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
  }

 private:
  static constexpr double kFirstRetry_s = 0.25;
  static constexpr double kLastRetry_s = 2.0;

  std::shared_ptr<WebAudienceClient> client(std::size_t index) {
    return clients_[index] = std::make_shared<WebAudienceClient>(audience_, io_, index);
  }
  void connect_next() {
    if (clients_.size() == audience_.clients_) return;
    clients_.emplace_back();
    client(clients_.size() - 1)->connect(port_, [this](bool is_subscribed) {
      if (!is_subscribed) ++audience_.lost_;
      asio::post(io_, [this] { connect_next(); });
    });
  }
  void come_back(std::size_t index, double retry_s) {
    client(index)->connect(port_, [this, index, retry_s](bool is_subscribed) {
      if (is_subscribed) return;
      ++audience_.retries_;
      const double delay_s = retry_s * std::uniform_real_distribution(0.5, 1.5)(random_);
      auto timer = std::make_shared<asio::steady_timer>(
          io_, std::chrono::duration_cast<asio::steady_timer::duration>(
                   std::chrono::duration<double>(delay_s)));
      timer->async_wait([this, index, retry_s, timer](const error_code& error) {
        if (!error) come_back(index, std::min(2.0 * retry_s, kLastRetry_s));
      });
    });
  }

  WebAudience& audience_;
  std::uint16_t port_;
  std::mt19937 random_{1};
  asio::io_context io_{1};
  std::vector<std::shared_ptr<WebAudienceClient>> clients_;
  std::thread thread_;
};

WebAudience::WebAudience(std::uint16_t port, std::size_t clients)
    : meshes_(std::make_unique<std::atomic<std::uint64_t>[]>(clients)),
      clients_(clients),
      impl_(std::make_unique<Impl>(*this, port)) {}
WebAudience::~WebAudience() = default;

std::vector<std::uint64_t> WebAudience::meshes() const {
  std::vector<std::uint64_t> counts;
  for (std::size_t i = 0; i < clients_; ++i) counts.push_back(meshes_[i]);
  return counts;
}

void WebAudience::reconnect() { impl_->reconnect(); }
double WebAudience::processor_s() const { return impl_->processor_s(); }

}  // namespace palpate::bench
