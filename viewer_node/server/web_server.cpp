#include "viewer_node/server/web_server.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <boost/asio/buffer.hpp>
#include <boost/asio/dispatch.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "common/core/check.h"

namespace palpate::viewer {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using boost::system::error_code;
using tcp = asio::ip::tcp;

constexpr std::size_t kMostConnections = 64;
constexpr std::size_t kMostClients = 16;
constexpr std::uint32_t kMostHeaderBytes = 8 << 10;
constexpr std::size_t kMostMessageBytes = 64 << 10;
constexpr auto kRequestTime = std::chrono::seconds(10);
constexpr auto kSilence = std::chrono::seconds(30);
constexpr auto kRetryAccept = std::chrono::milliseconds(100);
/// What waits for one client: a second of everything, and the newest is worth more than the oldest.
constexpr std::size_t kMostWaitingBytes = std::size_t{8} << 20;
/// Answers, statuses and what was asked for are never dropped; a client that causes so much and
/// reads none of it is cut off.
constexpr std::size_t kMostWaitingMessages = 4096;
constexpr std::size_t kMostUnreadBytes = std::size_t{64} << 20;
/// The kernel's share of the delay of a slow client.
constexpr int kSendBufferBytes = 256 << 10;
constexpr auto kDropNotice = std::chrono::seconds(1);

constexpr const char* kContentSecurityPolicy =
    "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'none'";

}  // namespace

class WebServer::Impl {
 public:
  Impl(const WebServerConfig& config, ServerDescription description);
  ~Impl();

  class Connection;
  class Client;

  void accept();
  /// A client took part, or is gone. On the server's thread.
  std::uint64_t enter(const std::shared_ptr<Client>& client);
  void leave(Client& client);
  void note(Event event);

  const WebServerConfig config;
  const ServerDescription description;
  std::string url;
  std::uint16_t port = 0;

  std::size_t connections = 0;
  std::map<std::uint64_t, std::shared_ptr<Client>> clients;
  std::uint64_t next_client = 1;

  std::vector<std::atomic<std::uint32_t>> watchers;  // by channel
  std::atomic<std::uint32_t> client_count{0};
  std::atomic<std::uint64_t> dropped{0};
  std::atomic<std::uint64_t> refused{0};
  std::mutex events_mutex;
  std::vector<Event> events;
  std::string metrics;  // on the server's thread

  // handlers that are destroyed with it use what stands above
  asio::io_context io{1};
  tcp::acceptor acceptor{io};
  asio::steady_timer retry{io};
  std::thread thread;
};

// --- a client -----------------------------------------------------------------------------------

/// One WebSocket. On the server's thread.
class WebServer::Impl::Client : public std::enable_shared_from_this<Client> {
 public:
  Client(Impl& server, beast::tcp_stream&& stream) : server_(server), socket_(std::move(stream)) {}
  ~Client() { --server_.connections; }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  void run(const http::request<http::empty_body>& request, std::string_view subprotocol) {
    websocket::stream_base::timeout timeout =
        websocket::stream_base::timeout::suggested(beast::role_type::server);
    timeout.handshake_timeout = kRequestTime;
    timeout.idle_timeout = kSilence;
    timeout.keep_alive_pings = true;
    socket_.set_option(timeout);
    socket_.set_option(websocket::stream_base::decorator(
        [name = std::string(subprotocol)](websocket::response_type& response) {
          response.set(http::field::sec_websocket_protocol, name);
          response.set(http::field::server, "palpate");
        }));
    socket_.read_message_max(kMostMessageBytes);
    socket_.auto_fragment(false);
    error_code ignored;
    beast::get_lowest_layer(socket_).socket().set_option(
        asio::socket_base::send_buffer_size(kSendBufferBytes), ignored);
    beast::get_lowest_layer(socket_).socket().set_option(tcp::no_delay(true), ignored);
    socket_.async_accept(request, [self = shared_from_this()](const error_code& error) {
      if (!error) self->begin();
    });
  }

  void publish(std::size_t channel, std::uint64_t log_time_ns, const Payload& payload,
               bool may_drop) {
    const auto subscription = protocol_->subscription(channel);
    if (!subscription) return;
    queue({.header = data_header(*subscription, log_time_ns),
           .payload = payload,
           .is_binary = true,
           .may_drop = may_drop});
  }
  void tell(std::string text) {
    queue({.payload = std::make_shared<std::string>(std::move(text))});
  }

  /// Gone, whatever is under way.
  void cut() {
    error_code ignored;
    beast::get_lowest_layer(socket_).socket().close(ignored);
  }

  [[nodiscard]] std::uint64_t id() const { return protocol_ ? protocol_->id() : 0; }
  [[nodiscard]] const FoxgloveClient& protocol() const { return *protocol_; }

 private:
  struct Message {
    DataHeader header{};  // of binary ones
    Payload payload;
    bool is_binary = false;
    bool may_drop = false;

    [[nodiscard]] std::size_t size() const { return payload->size(); }
  };

  void begin() {
    protocol_.emplace(server_.description, server_.enter(shared_from_this()));
    for (std::string& text : protocol_->greeting()) tell(std::move(text));
    read();
  }

  void read() {
    socket_.async_read(buffer_, [self = shared_from_this()](const error_code& error, std::size_t) {
      if (error) {
        self->server_.leave(*self);
        return;
      }
      const auto bytes = beast::buffers_to_string(self->buffer_.data());
      self->buffer_.clear();
      self->take(self->socket_.got_text() ? self->protocol_->take_text(bytes)
                                          : self->protocol_->take_binary(bytes));
      self->read();
    });
  }

  void take(FoxgloveClient::Outcome outcome) {
    for (std::string& reply : outcome.replies) tell(std::move(reply));
    for (const std::size_t channel : outcome.unsubscribed) --server_.watchers[channel];
    for (const std::size_t channel : outcome.subscribed) {
      ++server_.watchers[channel];
      server_.note({.kind = Event::Kind::kSubscribed, .client = id(), .channel = channel});
    }
    if (outcome.hand_target) {
      server_.note({.kind = Event::Kind::kHandTarget,
                    .client = id(),
                    .hand_target = std::move(*outcome.hand_target)});
    }
  }

  void queue(Message message) {
    waiting_bytes_ += message.size();
    waiting_.push_back(std::move(message));
    if (waiting_bytes_ > kMostWaitingBytes) drop_oldest();
    if (waiting_.size() > kMostWaitingMessages || waiting_bytes_ > kMostUnreadBytes) {
      cut();
      return;
    }
    write();
  }

  /// Down to half, so that what is left makes sense in a row.
  void drop_oldest() {
    const std::size_t first = is_writing_ ? 1 : 0;  // that one is on its way
    std::uint64_t count = 0;
    for (std::size_t i = first; i < waiting_.size() && waiting_bytes_ > kMostWaitingBytes / 2;) {
      if (!waiting_[i].may_drop) {
        ++i;
        continue;
      }
      waiting_bytes_ -= waiting_[i].size();
      waiting_.erase(waiting_.begin() + static_cast<std::ptrdiff_t>(i));
      ++count;
    }
    server_.dropped += count;
    const auto now = std::chrono::steady_clock::now();
    if (count == 0 || now < next_notice_) return;
    next_notice_ = now + kDropNotice;
    tell(status_text(StatusLevel::kWarning, "Send buffer limit reached", "send_buffer"));
  }

  void write() {
    if (is_writing_ || waiting_.empty()) return;
    is_writing_ = true;
    const Message& message = waiting_.front();
    socket_.binary(message.is_binary);
    const std::array<asio::const_buffer, 2> buffers = {
        asio::buffer(message.header.data(), message.is_binary ? message.header.size() : 0),
        asio::buffer(*message.payload)};
    socket_.async_write(buffers, [self = shared_from_this()](const error_code& error, std::size_t) {
      self->is_writing_ = false;
      if (error) return;  // the reader sees it too
      self->waiting_bytes_ -= self->waiting_.front().size();
      self->waiting_.pop_front();
      self->write();
    });
  }

  Impl& server_;
  websocket::stream<beast::tcp_stream> socket_;
  beast::flat_buffer buffer_;
  std::optional<FoxgloveClient> protocol_;
  std::deque<Message> waiting_;  // the first is on its way while is_writing_
  std::size_t waiting_bytes_ = 0;
  bool is_writing_ = false;
  std::chrono::steady_clock::time_point next_notice_{};
};

// --- a connection -------------------------------------------------------------------------------

/// HTTP, until it becomes a client or ends. On the server's thread.
class WebServer::Impl::Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(Impl& server, tcp::socket&& socket) : server_(server), stream_(std::move(socket)) {
    ++server_.connections;
  }
  ~Connection() {
    if (!is_handed_on_) --server_.connections;
  }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  void read() {
    parser_.emplace();
    parser_->header_limit(kMostHeaderBytes);
    parser_->body_limit(boost::none);  // a body is refused by the header, and never read
    stream_.expires_after(kRequestTime);
    http::async_read_header(stream_, buffer_, *parser_,
                            [self = shared_from_this()](const error_code& error, std::size_t) {
                              self->on_header(error);
                            });
  }

 private:
  void on_header(const error_code& error) {
    if (error == http::error::end_of_stream) {
      end();
      return;
    }
    if (error) {
      ++server_.refused;
      // what is not HTTP gets an answer in HTTP; a connection that broke gets none
      if (error.category() == http::make_error_code(http::error::bad_method).category()) {
        answer({.status = 400, .text = "not a request\n", .closes = true}, true);
      }
      return;
    }

    const auto& request = parser_->get();
    const auto field = [&](http::field name) { return std::string(request[name]); };
    const WebDecision decision = decide(
        {.method = std::string(request.method_string()),
         .target = std::string(request.target()),
         .host = request.count(http::field::host) == 1 ? field(http::field::host) : std::string(),
         .origin = field(http::field::origin),
         .authorization = field(http::field::authorization),
         .if_none_match = field(http::field::if_none_match),
         .subprotocols = field(http::field::sec_websocket_protocol),
         .is_upgrade = websocket::is_upgrade(request),
         .has_body = parser_->chunked() || parser_->content_length().value_or(0) > 0},
        server_.config.rules);
    if (decision.status == 101) {
      become_client(decision.subprotocol);
    } else {
      answer(decision, false);
    }
  }

  void become_client(std::string_view subprotocol) {
    if (server_.clients.size() >= kMostClients) {
      answer(
          {.status = 503, .text = "as many viewers as are allowed are connected\n", .closes = true},
          false);
      return;
    }
    stream_.expires_never();  // the WebSocket has time-outs of its own
    is_handed_on_ = true;
    std::make_shared<Client>(server_, std::move(stream_))->run(parser_->get(), subprotocol);
  }

  void answer(const WebDecision& decision, bool is_broken) {
    if (decision.status >= 400) ++server_.refused;
    const bool is_head = !is_broken && parser_->get().method() == http::verb::head;
    response_ = {};
    response_.version(11);
    response_.result(decision.status);
    response_.set(http::field::server, "palpate");
    response_.set("X-Content-Type-Options", "nosniff");
    response_.set("Referrer-Policy", "no-referrer");
    response_.set("Cross-Origin-Resource-Policy", "same-origin");
    response_.set("Content-Security-Policy", kContentSecurityPolicy);
    response_.set(http::field::cache_control, "no-cache");
    std::string_view body = decision.text;
    response_.set(http::field::content_type, "text/plain; charset=utf-8");
    if (decision.is_metrics) {
      metrics_ = server_.metrics;
      body = metrics_;
      response_.set(http::field::content_type, "text/plain; version=0.0.4; charset=utf-8");
    }
    if (decision.asset != nullptr) {
      body = decision.asset->bytes;
      response_.set(http::field::content_type, as_beast(decision.asset->content_type));
      response_.set(http::field::etag, as_beast(decision.asset->etag));
      if (decision.asset->is_gzip) response_.set(http::field::content_encoding, "gzip");
    }
    response_.keep_alive(!decision.closes && !is_broken && parser_->get().keep_alive());
    if (decision.status != 304) {
      response_.content_length(body.size());
      if (!is_head) {
        response_.body().data = const_cast<char*>(body.data());  // only read
        response_.body().size = body.size();
      }
    }
    response_.body().more = false;

    serializer_.emplace(response_);
    stream_.expires_after(kRequestTime);
    if (is_head || decision.status == 304) {
      http::async_write_header(stream_, *serializer_,
                               [self = shared_from_this()](const error_code& error, std::size_t) {
                                 self->on_written(error);
                               });
    } else {
      http::async_write(stream_, *serializer_,
                        [self = shared_from_this()](const error_code& error, std::size_t) {
                          self->on_written(error);
                        });
    }
  }

  void on_written(const error_code& error) {
    if (error || !response_.keep_alive()) {
      end();
    } else {
      read();
    }
  }

  void end() {
    error_code ignored;
    stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
  }

  static beast::string_view as_beast(std::string_view text) { return {text.data(), text.size()}; }

  Impl& server_;
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_{2 * kMostHeaderBytes};
  std::optional<http::request_parser<http::empty_body>> parser_;
  http::response<http::buffer_body> response_;
  std::string metrics_;  // what response_ points to, if anything
  std::optional<http::response_serializer<http::buffer_body>> serializer_;
  bool is_handed_on_ = false;
};

// --- the server ---------------------------------------------------------------------------------

WebServer::Impl::Impl(const WebServerConfig& given, ServerDescription told)
    : config(given), description(std::move(told)), watchers(description.channels.size()) {
  error_code error;
  const asio::ip::address address = asio::ip::make_address(config.address, error);
  const std::string where =
      (config.address.find(':') == std::string::npos ? config.address
                                                     : '[' + config.address + ']') +
      ':';
  const auto refuse = [&](const std::string& why) {
    throw SetupError("viewer: " + where + std::to_string(config.port) + ": " + why);
  };
  if (error) refuse("give an address in figures, such as 127.0.0.1:8765");

  acceptor.open(tcp::endpoint(address, 0).protocol(), error);
  if (!error) acceptor.set_option(asio::socket_base::reuse_address(true), error);
  if (!error) acceptor.bind({address, config.port}, error);
  if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
  if (error == asio::error::address_in_use && config.may_move) {
    acceptor.close();
    acceptor.open(tcp::endpoint(address, 0).protocol());
    acceptor.bind({address, 0}, error);
    if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
  }
  if (error == asio::error::address_in_use) {
    refuse("in use by another program; stop it, or give another port (0: any free one)");
  }
  if (error) refuse("cannot listen there: " + error.message());
  port = acceptor.local_endpoint().port();
  url = "http://" + where + std::to_string(port) + '/';

  accept();
  thread = std::thread([this] { io.run(); });
}

WebServer::Impl::~Impl() {
  io.stop();
  thread.join();
  clients.clear();
}

void WebServer::Impl::accept() {
  acceptor.async_accept([this](const error_code& error, tcp::socket socket) {
    if (error) {
      // out of descriptors: let some connections end first
      retry.expires_after(kRetryAccept);
      retry.async_wait([this](const error_code& stopped) {
        if (!stopped) accept();
      });
      return;
    }
    if (connections < kMostConnections) {
      std::make_shared<Connection>(*this, std::move(socket))->read();
    } else {
      ++refused;  // the socket closes as it goes
    }
    accept();
  });
}

std::uint64_t WebServer::Impl::enter(const std::shared_ptr<Client>& client) {
  const std::uint64_t id = next_client++;
  clients.emplace(id, client);
  client_count = static_cast<std::uint32_t>(clients.size());
  return id;
}

void WebServer::Impl::leave(Client& client) {
  for (std::size_t channel = 0; channel < watchers.size(); ++channel) {
    if (client.protocol().subscription(channel)) --watchers[channel];
  }
  note({.kind = Event::Kind::kLeft, .client = client.id()});
  clients.erase(client.id());
  client_count = static_cast<std::uint32_t>(clients.size());
}

void WebServer::Impl::note(Event event) {
  const std::lock_guard lock(events_mutex);
  if (event.kind == Event::Kind::kHandTarget) {
    // only the newest of a client counts, so a flood takes no memory
    for (Event& waiting : events) {
      if (waiting.kind == Event::Kind::kHandTarget && waiting.client == event.client) {
        waiting.hand_target = std::move(event.hand_target);
        return;
      }
    }
  }
  if (event.kind == Event::Kind::kSubscribed) {
    // nor does subscribing over and over
    for (const Event& waiting : events) {
      if (waiting.kind == event.kind && waiting.client == event.client &&
          waiting.channel == event.channel) {
        return;
      }
    }
  }
  events.push_back(std::move(event));
}

WebServer::WebServer(const WebServerConfig& config, ServerDescription description)
    : impl_(std::make_unique<Impl>(config, std::move(description))) {}
WebServer::~WebServer() = default;

std::uint16_t WebServer::port() const { return impl_->port; }
std::string WebServer::url() const { return impl_->url; }

bool WebServer::is_watched(std::size_t channel) const {
  return impl_->watchers[channel].load(std::memory_order_relaxed) > 0;
}

void WebServer::publish(std::size_t channel, std::uint64_t log_time_ns, Payload payload) {
  if (!is_watched(channel)) return;
  asio::post(impl_->io, [impl = impl_.get(), channel, log_time_ns, payload = std::move(payload)] {
    for (const auto& [id, client] : impl->clients) {
      client->publish(channel, log_time_ns, payload, true);
    }
  });
}

void WebServer::send_to(std::uint64_t client, std::size_t channel, std::uint64_t log_time_ns,
                        Payload payload) {
  asio::post(impl_->io,
             [impl = impl_.get(), client, channel, log_time_ns, payload = std::move(payload)] {
               const auto it = impl->clients.find(client);
               if (it == impl->clients.end()) return;
               it->second->publish(channel, log_time_ns, payload, false);
             });
}

void WebServer::tell(std::uint64_t client, std::string text) {
  asio::post(impl_->io, [impl = impl_.get(), client, text = std::move(text)]() mutable {
    const auto it = impl->clients.find(client);
    if (it != impl->clients.end()) it->second->tell(std::move(text));
  });
}

std::vector<WebServer::Event> WebServer::take_events() {
  const std::lock_guard lock(impl_->events_mutex);
  return std::exchange(impl_->events, {});
}

void WebServer::set_metrics(std::string text) {
  asio::post(impl_->io, [impl = impl_.get(), text = std::move(text)]() mutable {
    impl->metrics = std::move(text);
  });
}

WebServer::Counters WebServer::counters() const {
  return {.clients = impl_->client_count, .dropped = impl_->dropped, .refused = impl_->refused};
}

}  // namespace palpate::viewer
