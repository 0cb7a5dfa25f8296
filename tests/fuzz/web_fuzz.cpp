// SPDX-License-Identifier: Apache-2.0
// web_fuzz.cpp — any bytes as an HTTP request, as messages of the Foxglove protocol and as a
// HandTarget: an answer, never a crash; and nothing is let in that the rules keep out.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <string_view>

#include "common/core/check.h"
#include "common/link/codec/viewer_codec.h"
#include "viewer_node/server/foxglove_client.h"
#include "viewer_node/server/web_rules.h"

namespace {

using palpate::viewer::FoxgloveClient;
using palpate::viewer::WebDecision;
using palpate::viewer::WebRequest;
using palpate::viewer::WebRules;

constexpr std::string_view kToken = "0123456789abcdef";
constexpr std::string_view kOrigin = "https://app.example.org";

/// The lines of the input are the fields of the request.
void request(std::string_view text) {
  const auto line = [&text] {
    const std::string field(text.substr(0, text.find('\n')));
    text.remove_prefix(std::min(field.size() + 1, text.size()));
    return field;
  };
  WebRequest request;
  for (std::string* field :
       {&request.method, &request.target, &request.host, &request.origin, &request.authorization,
        &request.if_none_match, &request.subprotocols}) {
    *field = line();
  }
  for (const bool is_upgrade : {false, true}) {
    for (const bool has_token : {false, true}) {
      request.is_upgrade = is_upgrade;
      const WebRules rules{.hosts = {"palpate.example"},
                           .origins = {std::string(kOrigin)},
                           .token = std::string(has_token ? kToken : "")};
      const WebDecision decision = palpate::viewer::decide(request, rules);
      PALPATE_REQUIRE(decision.status == 101 || decision.asset != nullptr ||
                      !decision.text.empty());
      if (decision.status != 101) continue;
      PALPATE_REQUIRE(is_upgrade && !decision.subprotocol.empty());
      PALPATE_REQUIRE(request.origin.empty() || request.origin == kOrigin ||
                      request.origin.size() == request.host.size() + 7 ||
                      request.origin.size() == request.host.size() + 8);
      PALPATE_REQUIRE(!has_token || request.target.find(kToken) != std::string::npos ||
                      request.authorization.find(kToken) != std::string::npos);
    }
  }
}

/// The lines of the input are messages of one client, each as a text and as a binary.
void messages(std::string_view text) {
  palpate::viewer::ServerDescription server{.name = "fuzz",
                                            .session_id = "1",
                                            .session_name = "fuzz",
                                            .hand_topics = {"/hand_target", "", "/b/hand_target"},
                                            .accepts_requests = true,
                                            .accepts_changes = true,
                                            .accepts_acknowledgements = true};
  for (const char* topic : {"/a", "/b", "/c"}) server.channels.push_back({topic, "p.A", ""});
  FoxgloveClient client(server, 1);
  std::set<std::size_t> subscribed;
  const auto check = [&](const FoxgloveClient::Outcome& outcome) {
    PALPATE_REQUIRE(outcome.replies.size() <= 8);
    for (const std::size_t channel : outcome.unsubscribed) {
      PALPATE_REQUIRE(subscribed.erase(channel) == 1);
    }
    for (const std::size_t channel : outcome.subscribed) {
      PALPATE_REQUIRE(channel < server.channels.size() && subscribed.insert(channel).second);
    }
    for (std::size_t channel = 0; channel < server.channels.size(); ++channel) {
      PALPATE_REQUIRE(client.subscription(channel).has_value() == subscribed.contains(channel));
    }
    if (!outcome.published) return;
    const auto target = palpate::decode_page_target(outcome.payload);
    PALPATE_REQUIRE(!target || target->hand_position_m.allFinite());
    const auto request = palpate::decode_page_request(outcome.payload);
    PALPATE_REQUIRE(!request || !request->seek_s || *request->seek_s >= 0.0);
  };
  while (!text.empty()) {
    const std::string_view line = text.substr(0, text.find('\n'));
    check(client.take_text(line));
    check(client.take_binary(line));
    text.remove_prefix(std::min(line.size() + 1, text.size()));
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  request(text);
  messages(text);
  static_cast<void>(palpate::decode_page_target(text));
  static_cast<void>(palpate::decode_page_request(text));
  static_cast<void>(palpate::decode_page_change(text));
  static_cast<void>(palpate::decode_marker(text));
  return 0;
}
