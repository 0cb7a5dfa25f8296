#include "common/link/socket/link_socket.h"

#include <poll.h>
#include <sched.h>

#include <algorithm>
#include <cerrno>

#include "common/core/check.h"
#include "common/link/codec/codec.h"

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
                       const std::vector<Attachment>& attachments)
    : socket_(context.get(), settings.type), spins_(context.wait() == WaitStrategy::kSpin) {
  PALPATE_REQUIRE(!attachments.empty());
  const auto is_any = [&](Scheme scheme) {
    return std::any_of(attachments.begin(), attachments.end(),
                       [&](const Attachment& a) { return scheme_of(a) == scheme; });
  };
  const bool is_inproc = is_any(Scheme::kInproc);

  socket_.set(zmq::sockopt::ipv6, true);
  socket_.set(zmq::sockopt::linger, settings.linger_ms);
  socket_.set(zmq::sockopt::sndhwm, is_inproc ? kInprocQueue : settings.send_queue);
  socket_.set(zmq::sockopt::rcvhwm, is_inproc ? kInprocQueue : settings.receive_queue);
  socket_.set(zmq::sockopt::maxmsgsize, settings.largest_frame_bytes);
  socket_.set(zmq::sockopt::reconnect_ivl, kReconnectMs);
  socket_.set(zmq::sockopt::connect_timeout, kConnectMs);
  socket_.set(zmq::sockopt::handshake_ivl, kHandshakeMs);
  if (is_any(Scheme::kTcp)) {
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
  if (settings.heartbeats) {
    socket_.set(zmq::sockopt::heartbeat_ivl, kHeartbeatMs);
    socket_.set(zmq::sockopt::heartbeat_timeout, kHeartbeatTimeoutMs);
  }
  if (settings.conflates && !is_inproc) socket_.set(zmq::sockopt::conflate, true);
  if (settings.type == zmq::socket_type::router) socket_.set(zmq::sockopt::router_mandatory, true);
  if (settings.reports_every_subscription) socket_.set(zmq::sockopt::xpub_verbose, 1);
  if (settings.type == zmq::socket_type::sub) {
    if (settings.subscribes_to_all) socket_.set(zmq::sockopt::subscribe, "");
  } else {
    socket_.set(zmq::sockopt::immediate, true);  // no queue for a peer that is not connected
  }

  if (context.tcp().keys && is_any(Scheme::kTcp)) {
    const Attachment& first = attachments.front();
    const LinkRoles* roles = roles_of(first.setting);
    watched_ = context.zap().watch(
        socket_, attachments.size() > 1 || roles == nullptr ? "telemetry" : roles->link,
        first.role == Attachment::Role::kBind);
  }
  for (const Attachment& attachment : attachments) {
    protect(context, attachment);
    attach(attachment);
  }
  endpoint_ = readable(socket_.get(zmq::sockopt::last_endpoint));
  descriptor_ = socket_.get(zmq::sockopt::fd);
}

void LinkSocket::protect(ZmqContext& context, const Attachment& a) {
  socket_.set(zmq::sockopt::curve_server, false);  // unencrypted unless set below
  if (scheme_of(a) != Scheme::kTcp) return;
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

void LinkSocket::attach(const Attachment& a) {
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
      why = "this machine does not have that address; give one of its own";
    } else if (error.num() == EACCES) {
      why = "no permission to bind there; give a port above 1023, or a path that you may write";
    }
    throw SetupError(a.setting + " = " + a.endpoint + ": " + why);
  }
}

bool LinkSocket::receive(zmq::message_t& part) noexcept {
  while (zmq_msg_recv(part.handle(), handle(), ZMQ_DONTWAIT) < 0) {
    if (zmq_errno() == EINTR) continue;
    is_empty_ = zmq_errno() == EAGAIN;
    return false;
  }
  is_empty_ = false;
  return true;
}

bool LinkSocket::drop_more_parts(const zmq::message_t& part) noexcept {
  if (!part.more()) return false;
  zmq::message_t rest;
  while (receive(rest) && rest.more()) {
  }
  return true;
}

SendResult LinkSocket::send(zmq::message_t& part, int flags) noexcept {
  is_empty_ = false;  // sending may consume the signal of the descriptor
  while (zmq_msg_send(part.handle(), handle(), ZMQ_DONTWAIT | flags) < 0) {
    if (zmq_errno() == EHOSTUNREACH) return SendResult::kNoPeer;
    if (zmq_errno() != EINTR) return SendResult::kDropped;
  }
  return SendResult::kSent;
}

void LinkSocket::subscribe(MessageKind kind) {
  const auto topic = static_cast<char>(kind);
  socket_.set(zmq::sockopt::subscribe, std::string_view(&topic, 1));
}

void LinkSocket::unsubscribe(MessageKind kind) {
  const auto topic = static_cast<char>(kind);
  socket_.set(zmq::sockopt::unsubscribe, std::string_view(&topic, 1));
}

bool LinkSocket::is_ready(int events) noexcept {
  is_empty_ = false;  // the call below consumes the signal of the descriptor
  int present = 0;
  std::size_t size = sizeof(present);
  return zmq_getsockopt(handle(), ZMQ_EVENTS, &present, &size) == 0 && (present & events) != 0;
}

void LinkSocket::wait_until(int events, const Clock& clock, TimePoint deadline) noexcept {
  // The descriptor signals changes, not states, and is_ready() consumes the signal: so the state is
  // checked before and after each wait.
  while (!is_ready(events)) {
    if (!sleep_until(clock, deadline)) return;
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
