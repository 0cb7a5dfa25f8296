// SPDX-License-Identifier: Apache-2.0
#include "common/link/socket/link_socket.h"

#include <poll.h>
#include <sched.h>

#include <cerrno>

#include "common/core/check.h"
#include "common/core/user/missing_address.h"
#include "common/link/socket/tsan_handover.h"

namespace palpate {
namespace {

/// Converts the mapped IPv4 addresses that libzmq reports, [::ffff:127.0.0.1], to the usual form.
std::string readable(std::string endpoint) {
  constexpr std::string_view kMapped = "tcp://[::ffff:";
  if (!endpoint.starts_with(kMapped)) return endpoint;
  endpoint.erase(endpoint.find(']'), 1);
  return "tcp://" + endpoint.substr(kMapped.size());
}

}  // namespace

LinkSocket::LinkSocket(ZmqContext& context, const LinkSettings& settings,
                       const Attachment& attachment)
    : attachment_(attachment),
      socket_(context.get(), settings.type),
      spins_(context.wait() == WaitStrategy::kSpin),
      keeps_queues_(settings.keeps_queues),
      has_topics_(settings.type == zmq::socket_type::sub),
      must_be_connected_(attachment.role == Attachment::Role::kConnect && !settings.keeps_queues &&
                         settings.type != zmq::socket_type::push) {
  const Scheme scheme = scheme_of(attachment_);
  const bool is_inproc = scheme == Scheme::kInproc;
  is_tcp_ = scheme == Scheme::kTcp;

  socket_.set(zmq::sockopt::ipv6, true);
  socket_.set(zmq::sockopt::linger, settings.linger_ms);
  socket_.set(zmq::sockopt::sndhwm, is_inproc ? kInprocQueue : settings.send_queue);
  socket_.set(zmq::sockopt::rcvhwm, is_inproc ? kInprocQueue : settings.receive_queue);
  socket_.set(zmq::sockopt::maxmsgsize, settings.largest_frame_bytes);
  socket_.set(zmq::sockopt::reconnect_ivl, kReconnectMs);
  socket_.set(zmq::sockopt::connect_timeout, kConnectMs);
  socket_.set(zmq::sockopt::handshake_ivl, kHandshakeMs);
  if (is_tcp_) {
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
  if (settings.type == zmq::socket_type::router) socket_.set(zmq::sockopt::router_mandatory, true);
  // subscriptions count too, and libzmq drops those beyond the limit without notice
  if (has_topics_) socket_.set(zmq::sockopt::sndhwm, 0);
  // every subscription is reported, so that the relay notices each new follower
  if (settings.type == zmq::socket_type::xpub) socket_.set(zmq::sockopt::xpub_verboser, 1);
  // A connecting socket with this option discards its queue in the moment in which a connection
  // ends; if it has read a part of a message, libzmq then aborts. So only for those that never
  // read.
  socket_.set(zmq::sockopt::immediate, settings.type == zmq::socket_type::push);

  if (!is_inproc) {
    const LinkRoles* const roles = roles_of(attachment_.setting);
    connections_ = std::make_shared<Connections>();
    watched_ = context.monitor().watch(
        socket_,
        {.link = roles == nullptr ? "link" : roles->link,
         .binds = attachment_.role == Attachment::Role::kBind,
         .has_keys = is_tcp_ && roles != nullptr && context.tcp().keys != nullptr,
         .is_tcp = is_tcp_,
         .most_unread_bytes = settings.largest_frame_bytes + kMostIncompleteBytes,
         .most_queued_bytes =
             settings.largest_frame_bytes * (settings.receive_queue + 1) + kMostIncompleteBytes,
         .is_never_read = settings.type == zmq::socket_type::pub ||
                          settings.type == zmq::socket_type::xpub ||
                          settings.type == zmq::socket_type::push},
        connections_);
  }
  protect(context);
  attach();
  endpoint_ = readable(socket_.get(zmq::sockopt::last_endpoint));
  descriptor_ = socket_.get(zmq::sockopt::fd);
}

void LinkSocket::protect(ZmqContext& context) {
  const Attachment& a = attachment_;
  if (!is_tcp_) return;
  const LinkRoles* const roles = roles_of(a.setting);
  const LinkKeys* const keys = context.tcp().keys.get();
  if (keys == nullptr || roles == nullptr) {
    if (is_on_loopback(a) || context.tcp().may_be_plain) return;
    throw SetupError(
        a.setting + " = " + a.endpoint +
        ": would send plain text and be open to other machines; make keys with "
        "`palpate keygen DIR` and give security { key_folder: \"DIR\" } to the session, "
        "or use --insecure on an isolated network");
  }
  const bool binds = a.role == Attachment::Role::kBind;
  const KeyRole role = binds ? roles->server : roles->client;
  const std::optional<KeyPair>& own = keys->of(role);
  if (!own) {
    throw SetupError(a.setting + " = " + a.endpoint + ": this program has no key of " +
                     name_of(role) + "; start it on a host that has one");
  }
  socket_.set(zmq::sockopt::curve_publickey, own->public_key);
  socket_.set(zmq::sockopt::curve_secretkey, own->secret_key);
  if (!binds) {
    socket_.set(zmq::sockopt::curve_serverkey, keys->allowed.server_key(roles->server));
    return;
  }
  socket_.set(zmq::sockopt::curve_server, true);
  socket_.set(zmq::sockopt::zap_domain, roles->link);
  // Without this option libzmq admits every peer while no ZAP handler runs. zmq.h omits its name.
  constexpr int kZapEnforceDomain = 93;
  const int yes = 1;
  PALPATE_REQUIRE(zmq_setsockopt(handle(), kZapEnforceDomain, &yes, sizeof(yes)) == 0);
}

void LinkSocket::attach() {
  const Attachment& a = attachment_;
  const Scheme scheme = scheme_of(a);
  const bool binds = a.role == Attachment::Role::kBind;
  if (scheme == Scheme::kIpc) require_private_folder(a);
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
      throw MissingAddress(a.setting + " = " + a.endpoint +
                           ": this machine does not have that address; give one of its own");
    } else if (error.num() == EACCES) {
      why = "no permission to bind there; give a port above 1023, or a path that you may write";
    }
    throw SetupError(a.setting + " = " + a.endpoint + ": " + why);
  }
}

/// Disconnecting fails if libzmq has forgotten the connection; connecting again is right then too.
void LinkSocket::reconnect_if_needed() noexcept {
  if (is_inproc() || !connections_->must_reconnect.load(std::memory_order_relaxed)) return;
  if (has_rest_) return;  // disconnecting discards the queue too
  connections_->must_reconnect.store(false, std::memory_order_relaxed);
  zmq_disconnect(handle(), attachment_.endpoint.c_str());
  zmq_connect(handle(), attachment_.endpoint.c_str());
}

bool LinkSocket::read(zmq::message_t& part) noexcept {
  while (zmq_msg_recv(part.handle(), handle(), ZMQ_DONTWAIT) < 0) {
    if (zmq_errno() == EINTR) continue;
    is_empty_ = zmq_errno() == EAGAIN;
    if (is_tcp_) connections_->emptied.fetch_add(1, std::memory_order_relaxed);
    return false;
  }
  is_empty_ = false;
  acquire_from_sender(part);
  return true;
}

bool LinkSocket::drop_rest() noexcept {
  zmq::message_t part;
  for (int i = 0; has_rest_ && i < kMostPartsPerCall; ++i) has_rest_ = read(part) && part.more();
  return !has_rest_;
}

Reception LinkSocket::receive(zmq::message_t& frame, zmq::message_t* peer) noexcept {
  if (has_rest_ && !drop_rest()) return Reception::kNothing;
  reconnect_if_needed();
  // a ROUTER puts the peer before the message
  if (peer != nullptr && !read(*peer)) return Reception::kNothing;
  if (!read(frame)) return Reception::kNothing;
  if (is_tcp_) {
    const auto from = static_cast<std::size_t>(zmq_msg_get(frame.handle(), ZMQ_SRCFD));
    connections_->read_from[from % connections_->read_from.size()].fetch_add(
        1, std::memory_order_relaxed);
  }
  has_rest_ = frame.more();
  if (!has_rest_) return Reception::kMessage;
  static_cast<void>(drop_rest());
  return Reception::kMalformed;
}

SendResult LinkSocket::send(zmq::message_t& part, int flags) noexcept {
  reconnect_if_needed();
  if (!may_send()) return SendResult::kDropped;
  is_empty_ = false;  // sending may consume the signal of the descriptor
  release_to_receiver(part);
  while (zmq_msg_send(part.handle(), handle(), ZMQ_DONTWAIT | flags) < 0) {
    if (zmq_errno() == EHOSTUNREACH) return SendResult::kNoPeer;
    if (zmq_errno() != EINTR) return SendResult::kDropped;
  }
  return SendResult::kSent;
}

void LinkSocket::set_topic(char topic, bool is_wanted) noexcept {
  zmq_setsockopt(handle(), is_wanted ? ZMQ_SUBSCRIBE : ZMQ_UNSUBSCRIBE, &topic, sizeof(topic));
}

bool LinkSocket::is_ready(int events) noexcept {
  reconnect_if_needed();
  is_empty_ = false;  // the call below consumes the signal of the descriptor
  int present = 0;
  std::size_t size = sizeof(present);
  if (zmq_getsockopt(handle(), ZMQ_EVENTS, &present, &size) != 0) return false;
  if (!may_send()) present &= ~ZMQ_POLLOUT;
  return (present & events) != 0;
}

void LinkSocket::wait_until(int events, const Clock& clock, TimePoint deadline) noexcept {
  // The descriptor signals changes, not states, and is_ready() consumes the signal: so the state is
  // checked before and after each wait.
  while (!is_ready(events)) {
    // the descriptor does not signal a connection
    const TimePoint now = clock.now();
    const bool polls =
        (events & ZMQ_POLLOUT) != 0 && !may_send() && deadline - now > kConnectionPoll;
    if (!sleep_until(clock, polls ? now + kConnectionPoll : deadline) && !polls) return;
  }
}

/// Sleeps until the state of the socket changes; false at the deadline or on a signal. Uses ppoll
/// because zmq_poll has a resolution of 1 ms.
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
  if (alarm_.expires_within(now, deadline)) return ppoll(descriptors, 2, nullptr, nullptr) > 0;
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
    // the caller has read everything and will read again: this saves system calls in the loop
    is_empty_ = false;
    sleep_until(clock, deadline);
  } else {
    wait_until(ZMQ_POLLIN, clock, deadline);
  }
}

}  // namespace palpate
