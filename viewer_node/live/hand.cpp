// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/live/hand.h"

#include <chrono>

#include "common/link/codec/viewer_codec.h"

namespace palpate::viewer {
namespace {

constexpr Duration kTargetInterval = std::chrono::microseconds(8333);  // 120 Hz at most

}  // namespace

bool may_lead_hand(const Side& side, const ProcessLinks& links) {
  const LinkKeys* const keys = links.side.tcp().keys.get();
  return side.hand.pointer && (keys == nullptr || keys->of(KeyRole::kPointer) ||
                               !side.links.hand_target.starts_with("tcp://"));
}

WebHand::WebHand(NodeContext& context, ProcessLinks& links, WebServer& server, const Side& side)
    : context_(context), side_(side), server_(server), status_(with_side(side.name, "hand")) {
  if (may_lead_hand(side, links)) {
    out_.emplace(links.side, connect_to(side.links.hand_target, "links.hand_target"));
  }
}

void WebHand::take(std::uint64_t client, const std::string& payload, TimePoint now) {
  if (!out_) return;
  const auto target = decode_page_target(payload);
  if (!target) {
    server_.send_text_to(client,
                         status_text(StatusLevel::kError, "not a valid palpate.v1.HandTarget"));
    return;
  }
  if (holder_ != 0 && holder_ != client) {
    if (refused_.insert(client).second) {
      server_.send_text_to(
          client, status_text(StatusLevel::kWarning, "another page leads the hand", status_));
    }
    return;
  }
  if (holder_ == 0 && target->is_released) return;
  holder_ = client;
  holder_heard_at_ = now;
  target_.holder_id = client;
  target_.hand_position_m = target->hand_position_m;
  target_.buttons = target->buttons;
  if (target->is_released) {
    release(now);
  } else {
    is_target_due_ = true;
  }
  if (refused_.erase(client) > 0) server_.send_text_to(client, remove_status_text(status_));
}

void WebHand::client_left(std::uint64_t client, TimePoint now) {
  refused_.erase(client);
  if (client == holder_) release(now);
}

void WebHand::pump(TimePoint now) {
  if (holder_ != 0 && now - holder_heard_at_ >= side_.hand.pointer->holder_timeout) {
    release(now);
  }
  if (is_target_due_ && now >= next_target_) send_target(now);
}

void WebHand::send_target(TimePoint now) {
  target_.header.session_id = context_.session_id;
  target_.header.sampled_at = now;
  out_->send(target_);
  ++target_.header.sequence;
  is_target_due_ = false;
  next_target_ = now + kTargetInterval;
}

void WebHand::release(TimePoint now) {
  target_.is_released = true;
  target_.buttons = 0;
  send_target(now);
  target_.is_released = false;
  holder_ = 0;
  for (const std::uint64_t client : refused_) {
    server_.send_text_to(client, remove_status_text(status_));
  }
  refused_.clear();
}

}  // namespace palpate::viewer
