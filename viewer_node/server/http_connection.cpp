// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/server/http_connection.h"

#include <linux/sockios.h>
#include <sys/ioctl.h>

#include <algorithm>
#include <boost/beast/websocket.hpp>
#include <utility>

#include "viewer_node/server/socket_client.h"
#include "viewer_node/server/web_limits.h"

namespace palpate::viewer {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using boost::system::error_code;

constexpr const char* kContentSecurityPolicy =
    "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'none'";

beast::string_view as_beast(std::string_view text) { return {text.data(), text.size()}; }

}  // namespace

HttpConnection::HttpConnection(ServerState& server, CountedConnection counted,
                               asio::ip::tcp::socket&& socket)
    : server_(server),
      counted_(std::move(counted)),
      stream_(std::move(socket)),
      progress_(stream_.get_executor()) {}

HttpConnection::~HttpConnection() { stop_waiting(); }

void HttpConnection::stop_waiting() {
  if (waiting_) server_.waiting.erase(*waiting_);
  waiting_.reset();
}

void HttpConnection::give_way() {
  stop_waiting();
  stream_.close();  // ends the pending read
}

void HttpConnection::read() {
  waiting_ = server_.waiting.insert(server_.waiting.end(), this);
  parser_.emplace();
  parser_->header_limit(kMaxHeaderBytes);
  parser_->body_limit(boost::none);  // requests with a body are refused by their header
  stream_.expires_after(kHeaderTimeout);
  http::async_read_header(stream_, buffer_, *parser_,
                          [self = shared_from_this()](const error_code& error, std::size_t) {
                            self->on_header(error);
                          });
}

void HttpConnection::on_header(const error_code& error) {
  stop_waiting();
  if (error == http::error::end_of_stream) {
    end();
    return;
  }
  if (error) {
    ++server_.refused;
    // malformed requests get an HTTP answer; a broken connection gets none
    if (error == http::error::header_limit) {
      answer(too_long(), true);
    } else if (error.category() == http::make_error_code(http::error::bad_method).category()) {
      answer({.status = 400, .text = "not an HTTP request\n", .closes = true}, true);
    }
    return;
  }
  WebDecision decision = decide(request(), server_.rules);
  if (!decision.recording.empty()) {
    file_ = server_.shelf.open(decision.recording);
    if (!file_) {
      decision = {.status = server_.shelf.may_be_read() ? 404U : 403U,
                  .text = server_.shelf.may_be_read()
                              ? "there is no such recording\n"
                              : "no recordings while a task hides where things are\n"};
    }
  }
  if (decision.status == 101) {
    become_client(decision.subprotocol);
  } else {
    answer(decision, false);
  }
}

WebRequest HttpConnection::request() const {
  const auto& request = parser_->get();
  const auto field = [&](http::field name) { return std::string(request[name]); };
  return {.method = std::string(request.method_string()),
          .target = std::string(request.target()),
          .host = request.count(http::field::host) == 1 ? field(http::field::host) : std::string(),
          .origin = field(http::field::origin),
          .authorization = field(http::field::authorization),
          .if_none_match = field(http::field::if_none_match),
          .subprotocols = field(http::field::sec_websocket_protocol),
          .is_upgrade = websocket::is_upgrade(request),
          .has_body = parser_->chunked() || parser_->content_length().value_or(0) > 0};
}

/// The request line alone, or all header fields together. The parser leaves an unfinished header in
/// the buffer.
WebDecision HttpConnection::too_long() const {
  const auto bytes = buffer_.data();
  const std::string_view header(static_cast<const char*>(bytes.data()), bytes.size());
  if (header.find('\n') == std::string_view::npos) {
    return {.status = 414, .text = "the address is too long\n", .closes = true};
  }
  return {.status = 431, .text = "the header fields are too long\n", .closes = true};
}

void HttpConnection::become_client(std::string_view subprotocol) {
  if (server_.sockets >= server_.most_clients) {
    answer({.status = 503,
            .text = "the maximum number of viewers is connected already\n",
            .closes = true},
           false);
    return;
  }
  stream_.expires_never();  // the WebSocket has its own timeouts
  std::make_shared<SocketClient>(server_, std::move(counted_), std::move(stream_), buffer_)
      ->run(parser_->get(), subprotocol);
}

void HttpConnection::answer(const WebDecision& decision, bool is_malformed) {
  if (decision.status >= 400) ++server_.refused;
  const bool is_head = !is_malformed && parser_->get().method() == http::verb::head;
  response_ = {};
  response_.version(11);
  response_.result(decision.status);
  response_.set(http::field::server, "palpate");
  response_.set("X-Content-Type-Options", "nosniff");
  response_.set("Referrer-Policy", "no-referrer");
  response_.set("Cross-Origin-Resource-Policy", "same-origin");
  response_.set("Content-Security-Policy", kContentSecurityPolicy);
  response_.set(http::field::cache_control, "no-cache");
  if (decision.status == 405) response_.set(http::field::allow, "GET, HEAD");
  std::string_view body = decision.text;
  response_.set(http::field::content_type, "text/plain; charset=utf-8");
  if (decision.is_metrics) {
    metrics_ = server_.metrics;
    body = metrics_;
    response_.set(http::field::content_type, "text/plain; version=0.0.4; charset=utf-8");
  }
  if (decision.is_verdict || decision.is_task) {
    metrics_ = decision.is_verdict ? server_.verdict : server_.task;
    body = metrics_;
    response_.set(http::field::content_type, "application/json");
  }
  if (decision.is_list) {
    metrics_ = server_.shelf.list_json();
    body = metrics_;
    response_.set(http::field::content_type, "application/json");
  }
  if (file_) {
    response_.set(http::field::content_type, "application/octet-stream");
    response_.set(http::field::content_disposition,
                  "attachment; filename=\"" + decision.recording + '"');
  }
  if (decision.asset != nullptr) {
    body = decision.asset->bytes;
    response_.set(http::field::content_type, as_beast(decision.asset->content_type));
    if (!decision.asset->etag.empty()) {
      response_.set(http::field::etag, as_beast(decision.asset->etag));
    }
    if (decision.asset->is_gzip) response_.set(http::field::content_encoding, "gzip");
  }
  response_.keep_alive(!decision.closes && !is_malformed && parser_->get().keep_alive());
  if (decision.status != 304) {
    response_.content_length(file_ ? file_->size() : body.size());
    if (!is_head && file_) {
      fill();
    } else if (!is_head) {
      response_.body().data = const_cast<char*>(body.data());  // read only
      response_.body().size = body.size();
    }
  }
  if (!file_ || is_head) response_.body().more = false;

  serializer_.emplace(response_);
  if (file_) {
    stream_.expires_never();  // as large as it is; await_progress() ends one that stands still
  } else {
    stream_.expires_after(kWholeAnswerTimeout);
  }
  is_answering_ = true;
  await_progress();
  if (is_head || decision.status == 304) {
    http::async_write_header(stream_, *serializer_,
                             [self = shared_from_this()](const error_code& error, std::size_t) {
                               self->on_written(error);
                             });
  } else {
    write_part();
  }
}

void HttpConnection::write_part() {
  http::async_write_some(stream_, *serializer_,
                         [self = shared_from_this()](const error_code& error, std::size_t bytes) {
                           self->sent_bytes_ += bytes;
                           if (error == http::error::need_buffer) {
                             self->fill();
                             self->write_part();
                           } else if (error || self->serializer_->is_done()) {
                             self->on_written(error);
                           } else {
                             self->write_part();
                           }
                         });
}

void HttpConnection::fill() {
  part_.resize(kPartBytes);
  const std::string_view bytes = file_->read(part_.data(), part_.size());
  response_.body().data = bytes.empty() ? nullptr : part_.data();
  response_.body().size = bytes.size();
  response_.body().more = !bytes.empty() && file_->left() > 0;
}

/// By what the client acknowledges: the next part may be written only once a third of the kernel's
/// buffer is free, which a slow link does not empty in time.
void HttpConnection::await_progress() {
  progress_.expires_after(server_.answer_timeout);
  progress_.async_wait([weak = weak_from_this(), before = taken_bytes()](const error_code& error) {
    const auto self = weak.lock();
    if (error || !self || !self->is_answering_) return;
    if (self->taken_bytes() == before) {
      self->stream_.close();  // ends the pending write
    } else {
      self->await_progress();
    }
  });
}

std::uint64_t HttpConnection::taken_bytes() {
  int unacknowledged = 0;
  if (ioctl(stream_.socket().native_handle(), SIOCOUTQ, &unacknowledged) != 0) return sent_bytes_;
  return sent_bytes_ - std::min(sent_bytes_, static_cast<std::uint64_t>(unacknowledged));
}

void HttpConnection::on_written(const error_code& error) {
  is_answering_ = false;
  progress_.cancel();
  // of a file that has become shorter the client gets less than was announced
  const bool is_cut = file_ && file_->left() > 0 && parser_->get().method() != http::verb::head;
  file_.reset();
  if (error || is_cut || !response_.keep_alive()) {
    end();
  } else {
    read();
  }
}

void HttpConnection::end() {
  error_code ignored;
  stream_.socket().shutdown(asio::ip::tcp::socket::shutdown_send, ignored);
}

}  // namespace palpate::viewer
