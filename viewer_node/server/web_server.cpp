// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/server/web_server.h"

#include <sys/resource.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <exception>
#include <set>
#include <thread>
#include <utility>

#include "common/core/check.h"
#include "common/core/user/missing_address.h"
#include "viewer_node/server/http_connection.h"
#include "viewer_node/server/server_state.h"
#include "viewer_node/server/socket_client.h"
#include "viewer_node/server/web_limits.h"

namespace palpate::viewer {
namespace {

namespace asio = boost::asio;
using boost::system::error_code;
using tcp = asio::ip::tcp;

constexpr int kAcceptsPerTurn = 64;
constexpr auto kAcceptRetryDelay = std::chrono::milliseconds(10);

error_code listen_at(tcp::acceptor& acceptor, const tcp::endpoint& endpoint) {
  error_code error;
  acceptor.open(endpoint.protocol(), error);
  if (!error) acceptor.set_option(asio::socket_base::reuse_address(true), error);
  if (!error) acceptor.bind(endpoint, error);
  if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
  return error;
}

/// A mapped IPv4 address, ::ffff:10.0.0.1, as IPv4: so it arrives at a server that listens on [::].
asio::ip::address unmapped(const asio::ip::address& address) {
  if (!address.is_v6() || !address.to_v6().is_v4_mapped()) return address;
  return asio::ip::make_address_v4(asio::ip::v4_mapped, address.to_v6());
}

/// Each client needs a file descriptor.
void allow_descriptors(std::size_t clients) {
  constexpr std::size_t kOthers = 256;
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  const rlim_t needed = clients + kOthers;
  if (limit.rlim_cur >= needed) return;
  if (limit.rlim_max < needed) {
    throw SetupError("viewer: --audience " + std::to_string(clients) + " needs " +
                     std::to_string(needed) + " open files, " + std::to_string(limit.rlim_max) +
                     " are allowed; raise LimitNOFILE= of the service, or `ulimit -Hn`");
  }
  limit.rlim_cur = needed;
  setrlimit(RLIMIT_NOFILE, &limit);
}

}  // namespace

class WebServer::Impl {
 public:
  Impl(const WebServerConfig& config, const ServerDescription& description);
  ~Impl();
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void accept();
  /// Runs `use(client)` on the server's thread, if the client is still connected.
  template <class Use>
  void with_client(std::uint64_t id, Use use);

  ServerState state;
  std::string url;
  std::uint16_t port = 0;
  // last: pending handlers use the state until they are destroyed
  asio::io_context io{1};

 private:
  void run();
  /// Takes those who wait already: one a turn would be few while each turn serves thousands of
  /// clients. @return whether there may be place for the next
  bool accept_waiting();
  /// Whether a newcomer finds a place, or a connection that gives way to it.
  [[nodiscard]] bool has_place() const { return !is_full() || !state.waiting.empty(); }
  [[nodiscard]] bool is_full() const {
    return state.connections >= kMaxConnections - kMaxClients + state.most_clients;
  }
  /// Where has_place().
  void welcome(tcp::socket socket);

  tcp::acceptor acceptor_{io};
  std::set<asio::ip::address> proxies_;
  asio::steady_timer retry_{io};
  std::thread thread_;
};

WebServer::Impl::Impl(const WebServerConfig& config, const ServerDescription& description)
    : state(config.rules, description, config.audience, config.answer_timeout,
            RecordingShelf(config.record_folder, description.session_name)) {
  if (config.audience > 0) allow_descriptors(config.audience);
  error_code error;
  const asio::ip::address address = asio::ip::make_address(config.address, error);
  const bool is_v6 = config.address.find(':') != std::string::npos;
  const std::string host = (is_v6 ? '[' + config.address + ']' : config.address) + ':';
  const auto refuse = [&](const std::string& why) {
    throw SetupError("viewer: " + host + std::to_string(config.port) + ": " + why);
  };
  if (error) refuse("give a numeric address, such as 127.0.0.1:8765");
  for (const std::string& proxy : config.proxies) {
    proxies_.insert(unmapped(asio::ip::make_address(proxy, error)));
    if (error) throw SetupError("viewer: --proxy " + proxy + ": give a numeric address");
  }

  if (config.descriptor >= 0) {
    acceptor_.assign(tcp::v4(), config.descriptor, error);
    if (!error) static_cast<void>(acceptor_.local_endpoint(error));
    if (error) {
      throw SetupError("viewer: --listen-descriptor " + std::to_string(config.descriptor) + ": " +
                       error.message());
    }
  } else {
    error = listen_at(acceptor_, {address, config.port});
  }
  if (error == asio::error::address_in_use && config.may_move) {
    acceptor_.close();
    error = listen_at(acceptor_, {address, 0});
  }
  if (error == asio::error::address_in_use) {
    refuse("in use by another program; stop it, or give another port (0: any free port)");
  }
  if (error == boost::system::errc::address_not_available) {
    throw MissingAddress("viewer: " + host + std::to_string(config.port) +
                         ": this machine does not have that address; give one of its own");
  }
  if (error) refuse("cannot listen on this address: " + error.message());
  acceptor_.non_blocking(true);
  port = acceptor_.local_endpoint().port();
  url = "http://" + host + std::to_string(port) + '/';

  accept();
  thread_ = std::thread([this] { run(); });
}

WebServer::Impl::~Impl() {
  io.stop();
  thread_.join();
  state.clients.clear();
}

/// A failure, such as exhausted memory, costs what one client asked for, not the viewer.
void WebServer::Impl::run() {
  for (;;) {
    try {
      io.run();
      return;
    } catch (const std::exception& failure) {
      state.events.add({.kind = ClientEvent::Kind::kFailed, .payload = failure.what()});
    }
  }
}

void WebServer::Impl::accept() {
  acceptor_.async_wait(tcp::acceptor::wait_read, [this](const error_code& failure) {
    if (!failure && accept_waiting()) {
      accept();
      return;
    }
    // until answers are written or file descriptors free, newcomers wait where the kernel has them
    retry_.expires_after(kAcceptRetryDelay);
    retry_.async_wait([this](const error_code& aborted) {
      if (!aborted) accept();
    });
  });
}

bool WebServer::Impl::accept_waiting() {
  for (int i = 0; i < kAcceptsPerTurn; ++i) {
    if (!has_place()) return false;
    error_code error;
    tcp::socket socket = acceptor_.accept(error);
    if (error == asio::error::would_block || error == asio::error::connection_aborted) return true;
    if (error) return false;
    welcome(std::move(socket));
  }
  return true;
}

void WebServer::Impl::welcome(tcp::socket socket) {
  error_code gone;
  const asio::ip::address peer = unmapped(socket.remote_endpoint(gone).address());
  const auto of_peer = state.connections_of.find(peer);
  const bool is_limited = !peer.is_loopback() && !proxies_.contains(peer);
  if (gone || (is_limited && of_peer != state.connections_of.end() &&
               of_peer->second >= kMaxConnectionsPerAddress)) {
    ++state.refused;  // the destructor closes the socket
    return;
  }
  if (is_full()) {
    ++state.refused;
    state.waiting.front()->give_way();
  }
  std::make_shared<HttpConnection>(state, CountedConnection(state, peer), std::move(socket))
      ->read();
}

template <class Use>
void WebServer::Impl::with_client(std::uint64_t id, Use use) {
  asio::post(io, [this, id, use = std::move(use)]() mutable {
    const auto it = state.clients.find(id);
    if (it != state.clients.end()) use(*it->second);
  });
}

WebServer::WebServer(const WebServerConfig& config, const ServerDescription& description)
    : impl_(std::make_unique<Impl>(config, description)) {}
WebServer::~WebServer() = default;

std::uint16_t WebServer::port() const { return impl_->port; }
std::string WebServer::url() const { return impl_->url; }

bool WebServer::has_subscriber(std::size_t channel) const {
  return impl_->state.subscribers[channel].load(std::memory_order_relaxed) > 0;
}

void WebServer::publish(std::size_t channel, std::uint64_t log_time_ns, Payload payload) {
  if (!has_subscriber(channel)) return;
  asio::post(impl_->io, [impl = impl_.get(), channel, log_time_ns, payload = std::move(payload)] {
    for (const auto& [id, client] : impl->state.clients_of[channel]) {
      client->publish(channel, log_time_ns, payload, true);
    }
  });
}

void WebServer::publish(std::size_t channel, std::uint64_t log_time_ns,
                        std::vector<Payload> details) {
  if (!has_subscriber(channel)) return;
  asio::post(impl_->io, [impl = impl_.get(), channel, log_time_ns, details = std::move(details)] {
    for (const auto& [id, client] : impl->state.clients_of[channel]) {
      client->publish(channel, log_time_ns, details);
    }
  });
}

void WebServer::send_to(std::uint64_t client, std::size_t channel, std::uint64_t log_time_ns,
                        Payload payload) {
  impl_->with_client(client,
                     [channel, log_time_ns, payload = std::move(payload)](SocketClient& to) {
                       to.publish(channel, log_time_ns, payload, false);
                     });
}

void WebServer::send_text_to(std::uint64_t client, std::string text) {
  impl_->with_client(client, [text = std::move(text)](SocketClient& to) mutable {
    to.send_text(std::move(text));
  });
}

std::vector<WebServer::Event> WebServer::take_events() { return impl_->state.events.take(); }

void WebServer::set_metrics(std::string text) {
  asio::post(impl_->io, [impl = impl_.get(), text = std::move(text)]() mutable {
    impl->state.metrics = std::move(text);
  });
}

void WebServer::set_verdict(std::string json) {
  asio::post(impl_->io, [impl = impl_.get(), json = std::move(json)]() mutable {
    impl->state.verdict = std::move(json);
  });
}

void WebServer::set_task(std::string json) {
  asio::post(impl_->io, [impl = impl_.get(), json = std::move(json)]() mutable {
    impl->state.task = std::move(json);
  });
}

void WebServer::set_recordings(bool may_be_read, std::string written) {
  asio::post(impl_->io, [impl = impl_.get(), may_be_read, written = std::move(written)]() mutable {
    impl->state.shelf.set(may_be_read, std::move(written));
  });
}

WebServer::Counters WebServer::counters() const {
  const ServerState& state = impl_->state;
  return {.clients = state.client_count,
          .dropped = state.dropped,
          .thinned = state.thinned,
          .refused = state.refused};
}

}  // namespace palpate::viewer
