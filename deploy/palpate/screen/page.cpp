// SPDX-License-Identifier: Apache-2.0
#include "deploy/palpate/screen/page.h"

#include <cstdio>
#include <string>

#include "deploy/palpate/options.h"

namespace palpate {

std::optional<ListeningPort> announce_page(const WebConfig& web) {
  auto port = web.port != 0 ? ListeningPort::open(web.port) : std::nullopt;
  const bool is_own = port.has_value();
  if (!port) port = ListeningPort::open(0);
  if (!port) return port;
  std::printf("http://127.0.0.1:%d/\n", port->port());
  std::fflush(stdout);
  if (!is_own && web.port != 0) {
    say("port " + std::to_string(web.port) + " is in use; the page has another");
  }
  return port;
}

}  // namespace palpate
