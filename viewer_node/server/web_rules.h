// web_rules.h — what the web server lets in. Decides on one HTTP request; no socket.
//
// On loopback any program of this machine may look on, but no web page of somebody else: a browser
// names the page in Origin, and the host name it believes to talk to in Host, so a name that was
// bent to 127.0.0.1 (DNS rebinding) is refused. Elsewhere a token is needed too.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "viewer_node/server/web_assets.h"

namespace palpate::viewer {

struct WebRules {
  /// Beside localhost and addresses in figures: names of this machine, without port.
  std::vector<std::string> hosts{};
  /// Beside the server's own pages: "https://app.example.org".
  std::vector<std::string> origins{};
  std::string token{};  ///< empty: none needed
};

/// As far as it matters. A field that is absent is empty, which no browser sends.
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
  unsigned status = 200;    ///< 101: go on as a WebSocket
  std::string_view text{};  ///< the body, if there is no asset
  const WebAsset* asset = nullptr;
  bool is_metrics = false;         ///< the body is what WebServer::set_metrics gave
  std::string_view subprotocol{};  ///< of the WebSocket
  bool closes = false;             ///< the connection, after the answer
};

[[nodiscard]] WebDecision decide(const WebRequest& request, const WebRules& rules);

/// Whether text outside may learn by the time this takes how much of it is right: it may not.
[[nodiscard]] bool equal_in_constant_time(std::string_view a, std::string_view b);

}  // namespace palpate::viewer
