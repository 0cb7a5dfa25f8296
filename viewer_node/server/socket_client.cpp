// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/server/socket_client.h"

#include <array>
#include <boost/asio/buffer.hpp>
#include <utility>

#include "viewer_node/server/web_limits.h"

namespace palpate::viewer {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using boost::system::error_code;

constexpr std::size_t kMaxMessageBytes = 64 << 10;
constexpr auto kIdleTimeout = std::chrono::seconds(30);
/// Bounds the kernel's share of a slow client's delay.
constexpr int kSendBufferBytes = 256 << 10;
/// Of an audience: what waits in the kernel is not replaced by newer messages.
constexpr int kAudienceSendBufferBytes = 32 << 10;
constexpr auto kDropNoticeInterval = std::chrono::seconds(1);
/// So many messages in time, and a client gets a finer detail: 3 s at 10 Hz.
constexpr unsigned kFinerAfter = 30;

ClientEvent::Kind event_of(ClientTopic topic) {
  switch (topic) {
    case ClientTopic::kHandTarget:
      return ClientEvent::Kind::kHandTarget;
    case ClientTopic::kRunRequest:
      return ClientEvent::Kind::kRunRequest;
    case ClientTopic::kTissueChange:
      return ClientEvent::Kind::kTissueChange;
    case ClientTopic::kAcknowledgement:
      break;
  }
  return ClientEvent::Kind::kAcknowledgement;
}

}  // namespace

void SocketClient::run(const Request& request, std::string_view subprotocol) {
  websocket::stream_base::timeout timeout =
      websocket::stream_base::timeout::suggested(beast::role_type::server);
  timeout.handshake_timeout = kAnswerTimeout;
  timeout.idle_timeout = kIdleTimeout;
  timeout.keep_alive_pings = true;
  socket_.set_option(timeout);
  socket_.set_option(websocket::stream_base::decorator(
      [name = std::string(subprotocol)](websocket::response_type& response) {
        response.set(http::field::sec_websocket_protocol, name);
        response.set(http::field::server, "palpate");
      }));
  socket_.read_message_max(kMaxMessageBytes);
  socket_.auto_fragment(false);
  error_code ignored;
  auto& tcp = beast::get_lowest_layer(socket_).socket();
  tcp.set_option(asio::socket_base::send_buffer_size(server_.is_audience ? kAudienceSendBufferBytes
                                                                         : kSendBufferBytes),
                 ignored);
  tcp.set_option(asio::ip::tcp::no_delay(true), ignored);
  socket_.async_accept(request, [self = shared_from_this()](const error_code& error) {
    if (!error) self->begin();
  });
}

void SocketClient::begin() {
  protocol_.emplace(server_.description, server_.next_client++);
  server_.clients.emplace(id(), shared_from_this());
  server_.client_count = static_cast<std::uint32_t>(server_.clients.size());
  send_text(protocol_->server_info());
  queue({.payload = server_.advertised, .is_held = true});
  read();
}

void SocketClient::end() {
  for (std::size_t channel = 0; channel < server_.subscribers.size(); ++channel) {
    if (protocol_->subscription(channel)) unsubscribe(channel);
  }
  server_.events.add({.kind = ClientEvent::Kind::kLeft, .client = id()});
  server_.clients.erase(id());
  server_.client_count = static_cast<std::uint32_t>(server_.clients.size());
}

void SocketClient::unsubscribe(std::size_t channel) {
  server_.clients_of[channel].erase(id());
  --server_.subscribers[channel];
}

void SocketClient::read() {
  socket_.async_read(buffer_, [self = shared_from_this()](const error_code& error, std::size_t) {
    if (error) {
      self->end();
      return;
    }
    const auto bytes = beast::buffers_to_string(self->buffer_.data());
    self->buffer_.clear();
    self->take(self->socket_.got_text() ? self->protocol_->take_text(bytes)
                                        : self->protocol_->take_binary(bytes));
    self->read();
  });
}

void SocketClient::take(FoxgloveClient::Outcome outcome) {
  for (std::string& reply : outcome.replies) send_text(std::move(reply));
  for (const std::size_t channel : outcome.unsubscribed) unsubscribe(channel);
  for (const std::size_t channel : outcome.subscribed) {
    server_.clients_of[channel].emplace(id(), this);
    ++server_.subscribers[channel];
    server_.events.add(
        {.kind = ClientEvent::Kind::kSubscribed, .client = id(), .channel = channel});
  }
  if (outcome.published) {
    server_.events.add({.kind = event_of(*outcome.published),
                        .client = id(),
                        .channel = outcome.side,
                        .payload = std::move(outcome.payload)});
  }
}

void SocketClient::publish(std::size_t channel, std::uint64_t log_time_ns, const Payload& payload,
                           bool may_drop) {
  const auto subscription = protocol_->subscription(channel);
  if (!subscription) return;
  const Channel& described = server_.description.channels[channel];
  const bool has_subject = server_.is_audience && described.is_state;
  queue({.header = data_header(*subscription, log_time_ns),
         .payload = payload,
         .is_binary = true,
         .may_drop = may_drop,
         .subject = has_subject ? std::optional(channel) : std::nullopt,
         .is_held = has_subject && described.is_held});
}

void SocketClient::publish(std::size_t channel, std::uint64_t log_time_ns,
                           std::span<const Payload> details) {
  if (!protocol_->subscription(channel)) return;
  if (queue_.has(channel)) {
    in_time_ = 0;
    if (detail_ + 1 < details.size()) ++detail_;
  } else if (++in_time_ >= kFinerAfter) {
    in_time_ = 0;
    if (detail_ > 0) --detail_;
  }
  publish(channel, log_time_ns, details[detail_], true);
}

void SocketClient::send_text(std::string text) {
  queue({.payload = make_payload(std::move(text))});
}

void SocketClient::queue(OutgoingMessage message) {
  const auto [dropped, replaced] = queue_.push(std::move(message));
  server_.dropped += dropped;
  server_.thinned += replaced;
  const auto now = std::chrono::steady_clock::now();
  if (dropped > 0 && now >= next_notice_) {
    next_notice_ = now + kDropNoticeInterval;
    queue_.push({.payload = make_payload(status_text(StatusLevel::kWarning,
                                                     "Send buffer limit reached", "send_buffer"))});
  }
  if (queue_.is_overfull()) {
    disconnect();
    return;
  }
  write();
  count_unread();
  bound_unread_of_all();
}

void SocketClient::count_unread() {
  server_.unread_bytes += queue_.bytes();
  server_.unread_bytes -= counted_bytes_;
  counted_bytes_ = queue_.bytes();
}

/// So many readers that read nothing hold no more memory than a few.
void SocketClient::bound_unread_of_all() {
  if (server_.unread_bytes <= kMaxUnreadBytesOfAll) return;
  SocketClient* most = this;
  for (const auto& [id, client] : server_.clients) {
    if (client->queue_.bytes() > most->queue_.bytes()) most = client.get();
  }
  const std::uint64_t dropped = most->queue_.drop_all();
  most->count_unread();
  server_.dropped += dropped;
  if (dropped == 0) most->disconnect();
}

void SocketClient::write() {
  const OutgoingMessage* const message = queue_.start();
  if (message == nullptr) return;
  socket_.binary(message->is_binary);
  const std::array<asio::const_buffer, 2> buffers = {
      asio::buffer(message->header.data(), message->is_binary ? message->header.size() : 0),
      asio::buffer(*message->payload)};
  socket_.async_write(buffers, [self = shared_from_this()](const error_code& error, std::size_t) {
    if (error) return;  // the pending read fails too and ends the client
    self->queue_.finish();
    self->count_unread();
    self->write();
  });
}

void SocketClient::disconnect() {
  error_code ignored;
  beast::get_lowest_layer(socket_).socket().close(ignored);
}

}  // namespace palpate::viewer
