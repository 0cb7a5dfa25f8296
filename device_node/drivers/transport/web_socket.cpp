// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/transport/web_socket.h"

#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <boost/asio/buffer.hpp>
#include <boost/asio/error.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/beast/core/flat_static_buffer.hpp>
#include <boost/beast/websocket.hpp>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <utility>

namespace palpate::device {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
using boost::system::error_code;
using Steady = std::chrono::steady_clock;

/// How far the bytes of one direction are within a frame (RFC 6455 §5.2).
class FrameBounds {
 public:
  /// Bytes until a header is complete or a frame ends: no frame is read beyond its end.
  [[nodiscard]] std::size_t left() const noexcept {
    return payload_ > 0 ? static_cast<std::size_t>(payload_) : header_size() - header_bytes_;
  }
  /// The next bytes, at most left().
  void pass(const unsigned char* bytes, std::size_t size) noexcept {
    if (payload_ > 0) {
      payload_ -= size;
      return;
    }
    std::copy_n(bytes, size, header_.begin() + static_cast<std::ptrdiff_t>(header_bytes_));
    header_bytes_ += size;
    if (header_bytes_ < header_size()) return;
    payload_ = header_[1] & 0x7FU;
    if (payload_ >= 126) {
      const std::size_t length_bytes = payload_ == 126 ? 2 : 8;
      payload_ = 0;
      for (std::size_t i = 0; i < length_bytes; ++i) payload_ = payload_ << 8U | header_[2 + i];
    }
    header_bytes_ = 0;
  }

 private:
  /// As far as it is known: the second byte says the rest.
  [[nodiscard]] std::size_t header_size() const noexcept {
    if (header_bytes_ < 2) return 2;
    const unsigned length = header_[1] & 0x7FU;
    const std::size_t mask_bytes = (header_[1] & 0x80U) != 0 ? 4 : 0;
    return 2 + (length == 126 ? 2 : length == 127 ? 8 : 0) + mask_bytes;
  }

  std::array<unsigned char, 14> header_{};
  std::size_t header_bytes_ = 0;
  std::uint64_t payload_ = 0;  // of the frame under way, not yet passed
};

/// A connected socket as Beast's lowest layer, whose reads and writes end at a deadline. It is
/// never read beyond the end of a frame, so that what waits in it is a message that nobody asked
/// for.
class TimedSocket {
 public:
  using executor_type = asio::io_context::executor_type;

  TimedSocket(const executor_type& executor, int socket) : executor_(executor), socket_(socket) {}
  ~TimedSocket() { close(); }
  TimedSocket(TimedSocket&& other) noexcept
      : executor_(std::move(other.executor_)),
        socket_(std::exchange(other.socket_, -1)),
        frames_(other.frames_) {}
  TimedSocket& operator=(TimedSocket&&) = delete;

  executor_type get_executor() const noexcept { return executor_; }
  void set_deadline(Steady::time_point deadline) noexcept { deadline_ = deadline; }
  void close() noexcept {
    if (socket_ >= 0) ::close(std::exchange(socket_, -1));
  }
  void shut_down() noexcept { ::shutdown(socket_, SHUT_RDWR); }
  /// The handshake is over: frames follow.
  void begin_frames() noexcept { frames_.emplace(); }
  /// Whether a data frame waits, between two frames.
  [[nodiscard]] bool has_message() const noexcept {
    unsigned char first_byte = 0;
    if (::recv(socket_, &first_byte, 1, MSG_PEEK | MSG_DONTWAIT) != 1) return false;
    return (first_byte & 0x0FU) < 8;  // pings and the end of the connection are more
  }

  template <class Buffers>
  std::size_t read_some(const Buffers& buffers, error_code& error) {
    const asio::mutable_buffer into = first<asio::mutable_buffer>(buffers);
    const std::size_t most = std::min(into.size(), frames_ ? frames_->left() : 1);
    const std::size_t size =
        transfer(POLLIN, error, [&] { return ::recv(socket_, into.data(), most, MSG_DONTWAIT); });
    if (frames_ && size > 0) frames_->pass(static_cast<const unsigned char*>(into.data()), size);
    return size;
  }
  template <class Buffers>
  std::size_t write_some(const Buffers& buffers, error_code& error) {
    const asio::const_buffer from = first<asio::const_buffer>(buffers);
    return transfer(POLLOUT, error, [&] {
      return ::send(socket_, from.data(), from.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
    });
  }
  // what Beast asks of a stream besides
  template <class Buffers>
  std::size_t read_some(const Buffers& buffers) {
    error_code error;
    const std::size_t size = read_some(buffers, error);
    if (error) throw boost::system::system_error(error);
    return size;
  }
  template <class Buffers>
  std::size_t write_some(const Buffers& buffers) {
    error_code error;
    const std::size_t size = write_some(buffers, error);
    if (error) throw boost::system::system_error(error);
    return size;
  }

 private:
  /// The first part that is not empty.
  template <class Buffer, class Buffers>
  static Buffer first(const Buffers& buffers) {
    for (auto part = asio::buffer_sequence_begin(buffers);
         part != asio::buffer_sequence_end(buffers); ++part) {
      const Buffer buffer(*part);
      if (buffer.size() > 0) return buffer;
    }
    return {};
  }

  [[nodiscard]] bool is_ready(short events, error_code& error) noexcept {
    for (;;) {
      const auto left = std::max(deadline_ - Steady::now(), Steady::duration::zero());
      const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(left);
      const timespec wait{.tv_sec = seconds.count(),
                          .tv_nsec = std::chrono::nanoseconds(left - seconds).count()};
      pollfd entry{.fd = socket_, .events = events, .revents = 0};
      const int ready = ::ppoll(&entry, 1, &wait, nullptr);
      if (ready > 0) return true;
      if (ready == 0) {
        error = asio::error::timed_out;
        return false;
      }
      if (errno != EINTR) {
        error = error_code(errno, boost::system::system_category());
        return false;
      }
    }
  }

  template <class Operation>
  std::size_t transfer(short events, error_code& error, const Operation& operation) {
    error = {};
    for (;;) {
      const ssize_t size = operation();
      if (size > 0) return static_cast<std::size_t>(size);
      if (size == 0) {
        error = asio::error::eof;
        return 0;
      }
      if (errno == EINTR) continue;
      if (errno != EAGAIN && errno != EWOULDBLOCK) {
        error = error_code(errno, boost::system::system_category());
        return 0;
      }
      if (!is_ready(events, error)) return 0;
    }
  }

  executor_type executor_;
  int socket_;
  std::optional<FrameBounds> frames_;  // none during the handshake, which is read byte by byte
  Steady::time_point deadline_ = Steady::now();
};

// found by Beast
[[maybe_unused]] void teardown(beast::role_type, TimedSocket& socket, error_code& error) {
  error = {};
  socket.shut_down();
}
[[maybe_unused]] void beast_close_socket(TimedSocket& socket) { socket.shut_down(); }

Transfer outcome(const error_code& error) {
  if (!error) return Transfer::kDone;
  if (error == asio::error::timed_out) return Transfer::kTimeout;
  if (error.category() ==
          beast::websocket::make_error_code(beast::websocket::error::closed).category() &&
      error != beast::websocket::error::closed) {
    return Transfer::kCorrupt;
  }
  return Transfer::kClosed;
}

std::string name_of(const std::string& host, std::uint16_t port) {
  return host + ":" + std::to_string(port);
}

/// A connected TCP socket.
int connected(const std::string& host, std::uint16_t port, Steady::time_point deadline) {
  addrinfo wanted{};
  wanted.ai_family = AF_UNSPEC;
  wanted.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  const int failed = getaddrinfo(host.c_str(), std::to_string(port).c_str(), &wanted, &found);
  if (failed != 0) throw std::runtime_error(name_of(host, port) + ": " + gai_strerror(failed));
  const std::unique_ptr<addrinfo, decltype(&freeaddrinfo)> addresses(found, &freeaddrinfo);
  int reason = ETIMEDOUT;
  for (const addrinfo* address = found; address != nullptr; address = address->ai_next) {
    const int socket = ::socket(address->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (socket < 0) continue;
    reason = ::connect(socket, address->ai_addr, address->ai_addrlen) == 0 ? 0 : errno;
    if (reason == EINPROGRESS) {
      const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
          std::max(deadline - Steady::now(), Steady::duration::zero()));
      pollfd entry{.fd = socket, .events = POLLOUT, .revents = 0};
      reason = ETIMEDOUT;
      socklen_t size = sizeof(reason);
      if (::poll(&entry, 1, static_cast<int>(left.count())) > 0) {
        getsockopt(socket, SOL_SOCKET, SO_ERROR, &reason, &size);
      }
    }
    if (reason == 0) return socket;
    ::close(socket);
  }
  throw std::runtime_error(name_of(host, port) + ": " +
                           error_code(reason, boost::system::system_category()).message());
}

}  // namespace

class WebSocket::Impl {
 public:
  explicit Impl(int socket) : stream_(TimedSocket(io_.get_executor(), socket)) {
    const int on = 1;
    setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
    stream_.auto_fragment(false);
    stream_.read_message_max(kLongestBytes);
    stream_.text(true);
  }

  beast::websocket::stream<TimedSocket>& stream() { return stream_; }
  void allow(Duration within) noexcept {
    stream_.next_layer().set_deadline(Steady::now() +
                                      std::chrono::duration_cast<Steady::duration>(within));
  }

  Transfer send(std::string_view text, Duration within) {
    allow(within);
    error_code error;
    stream_.write(asio::buffer(text.data(), text.size()), error);
    return outcome(error);
  }
  Transfer receive(std::string_view& text, Duration within) {
    allow(within);
    buffer_.consume(buffer_.size());
    error_code error;
    stream_.read(buffer_, error);
    if (error) return outcome(error);
    text = {static_cast<const char*>(buffer_.data().data()), buffer_.size()};
    return Transfer::kDone;
  }

 private:
  asio::io_context io_;
  beast::websocket::stream<TimedSocket> stream_;
  beast::flat_static_buffer<kLongestBytes> buffer_;
};

WebSocket::WebSocket(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
WebSocket::~WebSocket() = default;

std::unique_ptr<WebSocket> WebSocket::connect(const std::string& host, std::uint16_t port,
                                              Duration within) {
  const Steady::time_point deadline =
      Steady::now() + std::chrono::duration_cast<Steady::duration>(within);
  auto impl = std::make_unique<Impl>(connected(host, port, deadline));
  impl->stream().next_layer().set_deadline(deadline);
  error_code error;
  impl->stream().handshake(name_of(host, port), "/", error);
  if (error) throw std::runtime_error(name_of(host, port) + ": no WebSocket: " + error.message());
  impl->stream().next_layer().begin_frames();
  return std::unique_ptr<WebSocket>(new WebSocket(std::move(impl)));
}

std::unique_ptr<WebSocket> WebSocket::accept(int socket, Duration within) {
  auto impl = std::make_unique<Impl>(socket);
  impl->allow(within);
  error_code error;
  impl->stream().accept(error);
  if (error) throw std::runtime_error("no WebSocket: " + error.message());
  impl->stream().next_layer().begin_frames();
  return std::unique_ptr<WebSocket>(new WebSocket(std::move(impl)));
}

Transfer WebSocket::send(std::string_view text, Duration within) noexcept {
  return impl_->send(text, within);
}
Transfer WebSocket::receive(std::string_view& text, Duration within) noexcept {
  return impl_->receive(text, within);
}
bool WebSocket::has_message() const noexcept { return impl_->stream().next_layer().has_message(); }
void WebSocket::interrupt() noexcept { impl_->stream().next_layer().shut_down(); }

}  // namespace palpate::device
