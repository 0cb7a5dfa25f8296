// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/server/web_rules.h"

#include <algorithm>
#include <cctype>
#include <optional>

#include "viewer_node/server/foxglove_client.h"

namespace palpate::viewer {
namespace {

std::string lower(std::string_view text) {
  std::string result(text);
  for (char& c : result) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return result;
}

/// Without the port, and without the dot that ends a full DNS name: "localhost", "127.0.0.1",
/// "[::1]". All of it if something else than a port follows.
std::string_view name_of(std::string_view host) {
  const std::size_t colon = host.find(':', host.starts_with('[') ? host.find(']') : 0);
  const bool has_port = colon != std::string_view::npos &&
                        host.find_first_not_of("0123456789", colon + 1) == std::string_view::npos;
  std::string_view name = has_port ? host.substr(0, colon) : host;
  if (name.ends_with('.')) name.remove_suffix(1);
  return name;
}

/// Numeric addresses cannot be rebound by DNS.
bool is_address(std::string_view name) {
  if (name.starts_with('[')) {
    return name.size() > 2 && name.ends_with(']') &&
           name.find_first_not_of("0123456789abcdef:.", 1) == name.size() - 1;
  }
  return !name.empty() && name.find_first_not_of("0123456789.") == std::string_view::npos &&
         std::count(name.begin(), name.end(), '.') == 3;
}

bool is_known_host(std::string_view host, const WebRules& rules) {
  const std::string name = lower(name_of(host));
  return name == "localhost" || is_address(name) ||
         std::any_of(rules.hosts.begin(), rules.hosts.end(),
                     [&](const std::string& known) { return lower(known) == name; });
}

/// Only browsers send an origin. Behind a TLS proxy it starts with https.
bool is_known_origin(const WebRequest& request, const WebRules& rules) {
  const std::string origin = lower(request.origin);
  return origin.empty() || origin == lower("http://" + request.host) ||
         origin == lower("https://" + request.host) ||
         std::any_of(rules.origins.begin(), rules.origins.end(),
                     [&](const std::string& known) { return lower(known) == origin; });
}

bool has_token(const WebRequest& request, std::string_view query, const WebRules& rules) {
  if (rules.token.empty()) return true;
  constexpr std::string_view kBearer = "Bearer ";
  if (request.authorization.starts_with(kBearer)) {
    return equal_in_constant_time(std::string_view(request.authorization).substr(kBearer.size()),
                                  rules.token);
  }
  while (!query.empty()) {
    constexpr std::string_view kName = "token=";
    const std::string_view part = query.substr(0, query.find('&'));
    if (part.starts_with(kName)) {
      return equal_in_constant_time(part.substr(kName.size()), rules.token);
    }
    query.remove_prefix(std::min(part.size() + 1, query.size()));
  }
  return false;
}

/// The client's first offer that the server supports.
std::optional<std::string_view> common_subprotocol(std::string_view offered) {
  while (!offered.empty()) {
    std::string_view name = offered.substr(0, offered.find(','));
    offered.remove_prefix(std::min(name.size() + 1, offered.size()));
    while (name.starts_with(' ') || name.starts_with('\t')) name.remove_prefix(1);
    while (name.ends_with(' ') || name.ends_with('\t')) name.remove_suffix(1);
    const auto* known = std::find(kSubprotocols.begin(), kSubprotocols.end(), name);
    if (known != kSubprotocols.end()) return *known;
  }
  return std::nullopt;
}

WebDecision refusal(unsigned status, std::string_view text) {
  return {.status = status, .text = text, .closes = true};
}

}  // namespace

bool equal_in_constant_time(std::string_view a, std::string_view b) {
  unsigned difference = a.size() == b.size() ? 0U : 1U;
  for (std::size_t i = 0; i < b.size(); ++i) {
    const char other = i < a.size() ? a[i] : '\0';
    difference |= static_cast<unsigned>(static_cast<unsigned char>(b[i])) ^
                  static_cast<unsigned>(static_cast<unsigned char>(other));
  }
  return difference == 0;
}

WebDecision decide(const WebRequest& request, const WebRules& rules) {
  if (request.method != "GET" && request.method != "HEAD") {
    return refusal(405, "GET and HEAD only\n");
  }
  if (request.has_body) return refusal(400, "requests with a body are not supported\n");
  if (!is_known_host(request.host, rules)) {
    return refusal(403, "this host name is not served: viewer_node --allow-host NAME\n");
  }
  const std::size_t question = request.target.find('?');
  const std::string_view path = std::string_view(request.target).substr(0, question);
  const std::string_view query = question == std::string::npos
                                     ? std::string_view()
                                     : std::string_view(request.target).substr(question + 1);

  if (request.is_upgrade) {
    if (path != "/") return refusal(404, "the WebSocket is at /\n");
    if (!is_known_origin(request, rules)) {
      return refusal(403, "pages of this origin may not connect: viewer_node --allow-origin URL\n");
    }
    if (!has_token(request, query, rules)) return refusal(401, "a token is needed: ?token=…\n");
    const auto subprotocol = common_subprotocol(request.subprotocols);
    if (!subprotocol) {
      return refusal(400, "offer the subprotocol foxglove.sdk.v1 or foxglove.websocket.v1\n");
    }
    return {.status = 101, .subprotocol = *subprotocol};
  }

  if (path == "/healthz") return {.status = 200, .text = "ok\n"};
  const bool is_told = path == "/metrics" || path == "/verdict" || path == "/task";
  constexpr std::string_view kFolder = "/recordings/";
  const std::string_view recording = path.starts_with(kFolder) ? path.substr(kFolder.size()) : "";
  const bool is_list = path == "/recordings";
  if (is_told || is_list || !recording.empty()) {
    if (!is_known_origin(request, rules)) {
      return refusal(403, is_told ? "pages of this origin may not read the metrics\n"
                                  : "pages of this origin may not read recordings\n");
    }
    if (!has_token(request, query, rules)) return refusal(401, "a token is needed: ?token=…\n");
    return {.status = 200,
            .is_metrics = path == "/metrics",
            .is_verdict = path == "/verdict",
            .is_task = path == "/task",
            .is_list = is_list,
            .recording = std::string(recording)};
  }
  for (const WebAsset& asset : rules.assets) {
    if (path != asset.path) continue;
    const bool is_known = !asset.etag.empty() && request.if_none_match == asset.etag;
    return {.status = is_known ? 304U : 200U, .asset = &asset};
  }
  return {.status = 404, .text = "not found\n"};
}

}  // namespace palpate::viewer
