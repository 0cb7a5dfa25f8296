// SPDX-License-Identifier: Apache-2.0
// web_options.h — the web server's command line options, and the configuration they make with the
// session.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "common/core/time.h"
#include "common/session/session.h"
#include "viewer_node/server/web_server.h"

namespace palpate::viewer {

/// As given on the command line.
struct WebOptions {
  std::string listen{};      ///< ADDRESS:PORT; empty: 127.0.0.1 and the session's port
  int descriptor = -1;       ///< of an inherited socket that listens on loopback; −1: none
  std::string token_file{};  ///< empty: no token
  std::vector<std::string> origins{};
  std::vector<std::string> hosts{};
  std::vector<std::string> proxies{};
  std::optional<std::string> record_folder{};  ///< of recordings that pages begin
  bool is_off = false;
  std::size_t audience = 0;        ///< clients that only watch, at most; 0: no audience
  double audience_rate_hz = 10.0;  ///< updates of each client, at most

  /// Between two updates; 0 without an audience.
  [[nodiscard]] Duration audience_interval() const {
    return audience > 0 ? from_seconds(1.0 / audience_rate_hz) : Duration::zero();
  }
  /// Whether to serve the page in this session.
  [[nodiscard]] bool is_enabled(const WebConfig& session) const {
    return !is_off && (session.is_on || !listen.empty());
  }
};

/// A numeric address of this machine alone.
[[nodiscard]] bool is_loopback(const std::string& address);

/// Combines the options with the session. Throws SetupError: a malformed address, an address other
/// than loopback without a token, a token file that is unreadable, open to other users or holds
/// less than 16 characters.
[[nodiscard]] WebServerConfig web_config(const WebOptions& options, const WebConfig& session);

/// Where pages may record: as given, else the current folder if the server is on loopback; empty:
/// nowhere.
[[nodiscard]] std::string page_record_folder(const WebOptions& options);

}  // namespace palpate::viewer
