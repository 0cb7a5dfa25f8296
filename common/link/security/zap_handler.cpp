// SPDX-License-Identifier: Apache-2.0
#include "common/link/security/zap_handler.h"

#include <array>

namespace palpate {
namespace {

constexpr const char* kZapEndpoint = "inproc://zeromq.zap.01";
constexpr const char* kZapVersion = "1.0";
constexpr std::size_t kKeyBytes = 32;

std::string z85(const std::string& key) {
  std::array<char, kKeyBytes * 5 / 4 + 1> text{};
  zmq_z85_encode(text.data(), reinterpret_cast<const std::uint8_t*>(key.data()), kKeyBytes);
  return text.data();
}

}  // namespace

bool receive_parts(zmq::socket_t& socket, std::vector<std::string>& parts) {
  parts.clear();
  zmq::message_t part;
  do {
    if (zmq_msg_recv(part.handle(), socket.handle(), ZMQ_DONTWAIT) < 0) return false;
    parts.emplace_back(static_cast<const char*>(part.data()), part.size());
  } while (part.more());
  return true;
}

ZapVerdict judge(const std::vector<std::string>& frames, const AllowedKeys& allowed) {
  constexpr std::size_t kCurveFrames = 7;
  if (frames.size() < 2 || frames[0] != kZapVersion)
    return {.status = "500", .text = "Not ZAP 1.0"};
  if (frames.size() != kCurveFrames || frames[5] != "CURVE" || frames[6].size() != kKeyBytes) {
    return {.status = "400", .text = "No key"};
  }
  const LinkRoles* link = roles_of(frames[2]);
  if (link == nullptr) return {.status = "400", .text = "No such link"};
  const auto role = allowed.role_of(z85(frames[6]));
  if (!role) {
    return {.status = "400", .text = "Unknown key", .link = link, .refusal = Refusal::kUnknownKey};
  }
  if (*role != link->client) {
    return {.status = "400", .text = "Wrong role", .link = link, .refusal = Refusal::kWrongRole};
  }
  return {.status = "200", .text = "OK", .link = link};
}

ZapHandler::ZapHandler(zmq::context_t& context, const AllowedKeys& allowed, RefusedPeers& refused)
    : allowed_(allowed), refused_(refused), requests_(context, zmq::socket_type::rep) {
  requests_.set(zmq::sockopt::linger, 0);
  requests_.bind(kZapEndpoint);
}

void ZapHandler::answer() {
  std::vector<std::string> frames;
  while (receive_parts(requests_, frames)) {
    const ZapVerdict verdict = judge(frames, allowed_);
    if (verdict.refusal) refused_.count(verdict.link->link, *verdict.refusal, frames[3]);
    const std::array<std::string, 6> reply{
        kZapVersion, frames.size() > 1 ? frames[1] : "", verdict.status, verdict.text, "", ""};
    for (std::size_t i = 0; i < reply.size(); ++i) {
      const bool is_last = i + 1 == reply.size();
      requests_.send(zmq::buffer(reply[i]),
                     is_last ? zmq::send_flags::none : zmq::send_flags::sndmore);
    }
  }
}

}  // namespace palpate
