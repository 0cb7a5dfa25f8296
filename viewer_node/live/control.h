// SPDX-License-Identifier: Apache-2.0
// control.h — what viewer.control lets web clients of this machine do: acknowledge a device that
// waits for it; where all devices are simulated, change stiffness and damping of tissues.
//
//   out  hop 8  TissueChange     viewer → physics
//        hop 9  Acknowledgement  viewer → device    one link for each side
//
// Thread: the viewer's.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>

#include "common/link/zmq_sender.h"
#include "common/process/process_links.h"
#include "common/process/run_node.h"
#include "viewer_node/feed/telemetry_mirror.h"
#include "viewer_node/live/options.h"
#include "viewer_node/server/web_server.h"

namespace palpate::viewer {

/// Throws SetupError if the session has viewer.control and others than pages of this machine could
/// reach the server.
void check_control(const Session& session, const WebOptions& options);

class WebControl {
 public:
  /// References must outlive it. @param mirrors  of each of session.sides
  WebControl(NodeContext& context, ProcessLinks& links, std::span<const TelemetryMirror> mirrors,
             WebServer& server);

  /// A client sent a TissueChange; physics_node decides on it.
  void change(std::uint64_t client, const std::string& payload, TimePoint now);
  /// A client sent an Acknowledgement; the device_node that it names decides on it.
  void acknowledge(std::uint64_t client, const std::string& payload, TimePoint now);

 private:
  template <class T>
  [[nodiscard]] bool send(T& message, ZmqSender<T>& out, TimePoint now);
  void complain(std::uint64_t client, const char* what);

  std::span<const TelemetryMirror> mirrors_;
  WebServer& server_;
  std::optional<ZmqSender<TissueChange>> changes_;     // none: no client may change a tissue
  std::deque<ZmqSender<Acknowledgement>> to_devices_;  // by side; empty: no client may
  Header header_;
};

}  // namespace palpate::viewer
