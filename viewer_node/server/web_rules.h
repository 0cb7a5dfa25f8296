// SPDX-License-Identifier: Apache-2.0
// web_rules.h — decides on one HTTP request; no socket.
//
// On loopback any program of this machine may connect, but no foreign web page: browsers send the
// page's origin in Origin and the requested host name in Host, so a foreign name that resolves to
// 127.0.0.1 (DNS rebinding) is refused. Other addresses require a token as well.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "viewer_node/server/web_assets.h"

namespace palpate::viewer {

struct WebRules {
  /// Names of this machine, without port, in addition to localhost and numeric addresses.
  std::vector<std::string> hosts{};
  /// Origins allowed in addition to the server's own: "https://app.example.org".
  std::vector<std::string> origins{};
  std::string token{};  ///< empty: none required
  /// What is served; "/" is the page.
  std::span<const WebAsset> assets = web_assets();
};

/// The relevant fields. Absent fields are empty, which no browser sends.
struct WebRequest {
  std::string method{};
  std::string target{};
  std::string host{};
  std::string origin{};
  std::string authorization{};
  std::string if_none_match{};
  std::string subprotocols{};  ///< Sec-WebSocket-Protocol
  bool is_upgrade = false;     ///< to a WebSocket
  bool has_body = false;
};

struct WebDecision {
  unsigned status = 200;    ///< 101: continue as a WebSocket
  std::string_view text{};  ///< the body without an asset
  const WebAsset* asset = nullptr;
  bool is_metrics = false;         ///< the body is that of WebServer::set_metrics()
  bool is_verdict = false;         ///< the body is that of WebServer::set_verdict()
  bool is_task = false;            ///< the body is that of WebServer::set_task()
  bool is_list = false;            ///< the body is the list of recordings
  std::string recording{};         ///< the body is the recording of that name; empty: none
  std::string_view subprotocol{};  ///< of the WebSocket
  bool closes = false;             ///< the connection, after the answer
};

[[nodiscard]] WebDecision decide(const WebRequest& request, const WebRules& rules);

/// Constant-time comparison; prevents timing attacks on the token.
[[nodiscard]] bool equal_in_constant_time(std::string_view a, std::string_view b);

}  // namespace palpate::viewer
