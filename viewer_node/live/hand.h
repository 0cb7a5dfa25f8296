// SPDX-License-Identifier: Apache-2.0
// web_hand.h — lets one web client at a time lead the hand of a side.
//
//   out  hop 6  HandTarget  viewer → device   if the side enables hand.pointer
//
// Thread: the viewer's.
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>

#include "common/link/zmq_sender.h"
#include "common/process/process_links.h"
#include "common/process/run_node.h"
#include "viewer_node/server/web_server.h"

namespace palpate::viewer {

/// Whether the side lets a page lead its hand and this host has the key for it, where one is
/// needed.
[[nodiscard]] bool may_lead_hand(const Side& side, const ProcessLinks& links);

class WebHand {
 public:
  /// References must outlive it. @param side  of context.session
  WebHand(NodeContext& context, ProcessLinks& links, WebServer& server, const Side& side);

  /// A client sent a HandTarget. The first client to do so holds the hand; the others are refused
  /// with a status message until it releases the hand, leaves or times out.
  void take(std::uint64_t client, const std::string& payload, TimePoint now);
  void client_left(std::uint64_t client, TimePoint now);
  /// Sends what is due and releases the hand after the holder's timeout.
  void pump(TimePoint now);

  /// The client that leads the hand; 0: none.
  [[nodiscard]] std::uint64_t holder() const { return holder_; }

 private:
  void send_target(TimePoint now);
  void release(TimePoint now);

  NodeContext& context_;
  const Side& side_;
  WebServer& server_;
  std::string status_;                        // id of messages to clients
  std::optional<ZmqSender<HandTarget>> out_;  // none: no client may lead the hand
  HandTarget target_;                         // the holder's newest
  bool is_target_due_ = false;                // not sent yet
  TimePoint next_target_{};
  std::uint64_t holder_ = 0;
  TimePoint holder_heard_at_{};
  std::set<std::uint64_t> refused_;  // clients with a status message
};

}  // namespace palpate::viewer
