// SPDX-License-Identifier: Apache-2.0
// What the web server lets in, request by request.
#include "viewer_node/server/web_rules.h"

#include <gtest/gtest.h>

#include <functional>

namespace palpate::viewer {
namespace {

WebRequest page() { return {.method = "GET", .target = "/", .host = "localhost:8765"}; }
WebRequest socket() {
  WebRequest request = page();
  request.subprotocols = "foxglove.sdk.v1";
  request.is_upgrade = true;
  return request;
}

unsigned status(WebRequest request, const std::function<void(WebRequest&)>& alter,
                const WebRules& rules = {}) {
  alter(request);
  const WebDecision decision = decide(request, rules);
  // what is refused tells why, and the connection ends
  if (decision.status >= 400 && decision.status != 404) {
    EXPECT_TRUE(decision.closes);
    EXPECT_FALSE(decision.text.empty());
  }
  return decision.status;
}

TEST(WebRules, ServeThePageAndSayThatTheServerLives) {
  const WebDecision index = decide(page(), {});
  EXPECT_EQ(index.status, 200u);
  ASSERT_NE(index.asset, nullptr);
  EXPECT_TRUE(index.asset->content_type.starts_with("text/html"));
  EXPECT_FALSE(index.closes);
  EXPECT_EQ(status(page(), [](auto& r) { r.target = "/?token=x"; }), 200u);
  EXPECT_EQ(status(page(), [](auto& r) { r.method = "HEAD"; }), 200u);

  WebRequest health = page();
  health.target = "/healthz";
  EXPECT_EQ(decide(health, {}).text, "ok\n");
}

TEST(WebRules, MetricsAreForWhoeverMayLookOn) {
  WebRequest request = page();
  request.target = "/metrics";
  EXPECT_TRUE(decide(request, {}).is_metrics);
  request.target = "/verdict";
  EXPECT_TRUE(decide(request, {}).is_verdict);
  request.target = "/metrics";
  EXPECT_EQ(decide(request, {.token = "secret"}).status, 401u);
  EXPECT_EQ(status(request, [](auto& r) { r.origin = "https://elsewhere.example"; }), 403u);
  request.authorization = "Bearer secret";
  EXPECT_TRUE(decide(request, {.token = "secret"}).is_metrics);
}

TEST(WebRules, TheTaskNeedsTheTokenToo) {
  WebRequest request = page();
  request.target = "/task";
  EXPECT_TRUE(decide(request, {}).is_task);
  EXPECT_EQ(decide(request, {.token = "secret"}).status, 401U);
  request.authorization = "Bearer secret";
  EXPECT_TRUE(decide(request, {.token = "secret"}).is_task);
}

TEST(WebRules, RecordingsNeedTheTokenAndAKnownOrigin) {
  WebRequest request = page();
  request.target = "/recordings?token=secret";
  const WebRules rules{.token = "secret"};
  EXPECT_TRUE(decide(request, rules).is_list);
  request.target = "/recordings/x-20261128-010203.mcap?token=secret";
  EXPECT_EQ(decide(request, rules).recording, "x-20261128-010203.mcap");
  request.target = "/recordings/x-20261128-010203.mcap";
  EXPECT_EQ(decide(request, rules).status, 401U);
  EXPECT_EQ(decide(request, {}).recording, "x-20261128-010203.mcap");
  request.origin = "http://elsewhere";
  EXPECT_EQ(decide(request, {}).status, 403U);
}

TEST(WebRules, SendNothingAgainThatTheBrowserHas) {
  WebRequest request = page();
  request.if_none_match = decide(request, {}).asset->etag;
  EXPECT_EQ(decide(request, {}).status, 304u);
  request.if_none_match = "\"other\"";
  EXPECT_EQ(decide(request, {}).status, 200u);
}

TEST(WebRules, RefuseWhatIsNotServed) {
  EXPECT_EQ(status(page(), [](auto& r) { r.target = "/../etc/passwd"; }), 404u);
  EXPECT_EQ(status(page(), [](auto& r) { r.target = "http://localhost/"; }), 404u);
  EXPECT_EQ(status(page(), [](auto& r) { r.target = ""; }), 404u);
  for (const char* method : {"POST", "PUT", "DELETE", "OPTIONS", "CONNECT", "TRACE", "get"}) {
    EXPECT_EQ(status(page(), [&](auto& r) { r.method = method; }), 405u) << method;
  }
  EXPECT_EQ(status(page(), [](auto& r) { r.has_body = true; }), 400u);
  const auto post = [](auto& r) {
    r.method = "POST";
    r.has_body = true;
  };
  EXPECT_EQ(status(page(), post), 405u);
}

TEST(WebRules, AnswerToNamesOfThisMachineOnly) {
  for (const char* good : {"localhost", "LOCALHOST:1", "localhost.:8765", "127.0.0.1:8765",
                           "[::1]:8765", "10.0.0.7"}) {
    EXPECT_EQ(status(page(), [&](auto& r) { r.host = good; }), 200u) << good;
    EXPECT_EQ(status(socket(), [&](auto& r) { r.host = good; }), 101u) << good;
  }
  // a name that somebody bent to 127.0.0.1, and what only looks like an address
  for (const char* bad :
       {"", "evil.example", "localhost.evil.example", "127.0.0.1.evil.example", "evil.example:8765",
        "1.2.3", "[evil]", "[", ":8765", "1.2.3.4.5", "[::1].evil.example",
        "[::1].evil.example:8765", "[::1]x", "[::1", "127.0.0.1:80.evil.example"}) {
    EXPECT_EQ(status(page(), [&](auto& r) { r.host = bad; }), 403u) << bad;
    EXPECT_EQ(status(socket(), [&](auto& r) { r.host = bad; }), 403u) << bad;
  }
  EXPECT_EQ(status(page(), [](auto& r) { r.host = "Bench:80"; }, {.hosts = {"bench"}}), 200u);
  EXPECT_EQ(status(page(), [](auto& r) { r.host = "bench:80"; }, {.hosts = {"Bench"}}), 200u);
  EXPECT_EQ(status(page(), [](auto& r) { r.host = "bench."; }, {.hosts = {"bench"}}), 200u);
}

TEST(WebRules, LetNoPageOfAnotherOriginConnect) {
  const auto from = [](const char* origin) {
    return [origin](WebRequest& r) { r.origin = origin; };
  };
  EXPECT_EQ(status(socket(), from("")), 101u);  // no browser
  EXPECT_EQ(status(socket(), from("http://localhost:8765")), 101u);
  EXPECT_EQ(status(socket(), from("https://localhost:8765")), 101u);  // behind a TLS proxy
  for (const char* bad :
       {"null", "http://evil.example", "http://localhost", "http://localhost:8766",
        "http://localhost:8765.evil.example", "http://127.0.0.1:8765", "file://"}) {
    EXPECT_EQ(status(socket(), from(bad)), 403u) << bad;
  }
  const WebRules rules{.origins = {"https://app.example.org"}};
  EXPECT_EQ(status(socket(), from("https://app.example.org"), rules), 101u);
  EXPECT_EQ(status(socket(), from("https://app.example.org.evil.example"), rules), 403u);
  EXPECT_EQ(
      status(socket(), from("https://app.example.org"), {.origins = {"https://App.Example.org"}}),
      101u);
}

TEST(WebRules, AskForTheTokenOfWhoConnects) {
  const WebRules rules{.token = "0123456789abcdef"};
  const auto target = [](const char* text) { return [text](WebRequest& r) { r.target = text; }; };
  EXPECT_EQ(status(socket(), target("/"), rules), 401u);
  EXPECT_EQ(status(socket(), target("/?token=0123456789abcdef"), rules), 101u);
  EXPECT_EQ(status(socket(), target("/?a=1&token=0123456789abcdef&b"), rules), 101u);
  for (const char* bad : {"/?token=", "/?token=0123456789abcde", "/?token=0123456789abcdeff",
                          "/?xtoken=0123456789abcdef", "/?token=0123456789abcdeF"}) {
    EXPECT_EQ(status(socket(), target(bad), rules), 401u) << bad;
  }
  const auto header = [](const char* text) {
    return [text](WebRequest& r) { r.authorization = text; };
  };
  EXPECT_EQ(status(socket(), header("Bearer 0123456789abcdef"), rules), 101u);
  EXPECT_EQ(status(socket(), header("Bearer x"), rules), 401u);
  EXPECT_EQ(status(
                page(), [](auto&) {}, rules),
            200u);  // the page itself holds nothing
}

TEST(WebRules, ChooseTheFirstSubprotocolThatBothKnow) {
  const auto chosen = [](const char* offered) {
    WebRequest request = socket();
    request.subprotocols = offered;
    return decide(request, {}).subprotocol;
  };
  EXPECT_EQ(chosen("foxglove.websocket.v1"), "foxglove.websocket.v1");
  EXPECT_EQ(chosen("foxglove.websocket.v1, foxglove.sdk.v1"), "foxglove.websocket.v1");
  EXPECT_EQ(chosen("x,\tfoxglove.sdk.v1 ,foxglove.websocket.v1"), "foxglove.sdk.v1");
  for (const char* none : {"", ",", "foxglove.sdk.v2", "foxglove"}) {
    EXPECT_EQ(status(socket(), [&](auto& r) { r.subprotocols = none; }), 400u) << none;
  }
}

TEST(WebRules, HaveTheWebSocketInOnePlace) {
  EXPECT_EQ(status(socket(), [](auto& r) { r.target = "/healthz"; }), 404u);
  EXPECT_EQ(status(socket(), [](auto& r) { r.target = "/x"; }), 404u);
}

TEST(ConstantTime, ComparesLikeAnyOther) {
  EXPECT_TRUE(equal_in_constant_time("abc", "abc"));
  EXPECT_TRUE(equal_in_constant_time("", ""));
  for (const char* other : {"", "ab", "abd", "abcd", "Abc"}) {
    EXPECT_FALSE(equal_in_constant_time(other, "abc")) << other;
  }
}

}  // namespace
}  // namespace palpate::viewer
