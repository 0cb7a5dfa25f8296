// SPDX-License-Identifier: Apache-2.0
#include "common/link/security/refused_peers.h"

namespace palpate {

const char* explain(Refusal refusal) {
  switch (refusal) {
    case Refusal::kUnknownKey:
      return "unknown key: not in allowed.keys here; if the peer should have access, add its line "
             "and restart";
    case Refusal::kWrongRole:
      return "a key of another role: allowed.keys lists it, but not for this link";
    case Refusal::kLeft:
      return "closed during the handshake: the peer sends plain text (give its session the same "
             "security { }) or was stopped";
    case Refusal::kBadHandshake:
      return "no valid handshake: the peer sends plain text (give its session the same security { "
             "}), expects another key of this end (compare allowed.keys), or is not a ZeroMQ 4 "
             "peer";
    case Refusal::kRefusedByOther:
      return "the other end refuses this program's key; compare allowed.keys";
    case Refusal::kOtherBroken:
      return "the other end violated the protocol: not a Palpate node, or one of the two has no "
             "security { }; this program keeps connecting";
    case Refusal::kTooMuch:
      return "disconnected: the peer sent more than this link allows without a complete message";
    case Refusal::kTooMany:
      return "disconnected: too many connections to this link; look for a program that opens them";
    case Refusal::kOtherUnknown:
      break;
  }
  return "the other end does not have the key listed for it in allowed.keys; compare, or check "
         "which program runs there";
}

void RefusedPeers::count(std::string_view link, Refusal refusal, const std::string& address) {
  const std::lock_guard lock(mutex_);
  Count& count = counts_[{link, refusal}];
  ++count.count;
  count.address = address;
  total_.fetch_add(1, std::memory_order_relaxed);
}

RefusedPeers::Counts RefusedPeers::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

}  // namespace palpate
