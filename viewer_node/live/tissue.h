// SPDX-License-Identifier: Apache-2.0
// web_tissue.h — lets web clients of this machine change stiffness and damping of tissues.
//
//   out  hop 8  TissueChange  viewer → physics   only with viewer.control
//
// Thread: the viewer's.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "common/link/zmq_sender.h"
#include "common/process/process_links.h"
#include "common/process/run_node.h"
#include "viewer_node/live/options.h"
#include "viewer_node/server/web_server.h"

namespace palpate::viewer {

/// Throws SetupError if the session has viewer.control and others than pages of this machine could
/// reach the server.
void check_control(const Session& session, const WebOptions& options);

class WebTissue {
 public:
  /// References must outlive it.
  WebTissue(NodeContext& context, ProcessLinks& links, WebServer& server);

  /// A client sent a TissueChange; physics_node decides on it.
  void take(std::uint64_t client, const std::string& payload, TimePoint now);

 private:
  NodeContext& context_;
  WebServer& server_;
  std::optional<ZmqSender<TissueChange>> out_;  // none: no client may change a tissue
  Header header_;
};

}  // namespace palpate::viewer
