// SPDX-License-Identifier: Apache-2.0
// The table of a teacher: stations that wait, search, have ended, want a token, or are not there.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/support/program.h"
#include "tests/support/web_client.h"
#include "viewer_node/server/web_server.h"

namespace palpate {
namespace {

using test::Outcome;
using test::run_program;
using testing::ContainsRegex;
using testing::HasSubstr;
using viewer::WebServer;

constexpr const char* kEnded = R"({"session": "x", "task": {"kind": "palpation", "phase": "ended",
  "elapsed_s": 61.4, "time_s": null, "marks": 2, "findings": ["Found 1 of 1."], "figures": {},
  "score": {"coverage_ratio": 0.934, "force": {"most_n": 2.125}}}})";

std::string address_of(const std::string& name, const WebServer& server,
                       const std::string& token = "") {
  return name + "=http://127.0.0.1:" + std::to_string(server.port()) + "/" +
         (token.empty() ? "" : "?token=" + token);
}

TEST(Stations, AreOneTable) {
  WebServer anna({.port = 0, .rules = {.token = "sixteen-letters-1"}}, {});
  anna.set_task(kEnded);
  WebServer ben({.port = 0}, {});
  ben.set_task(R"({"session": "x", "task": {"kind": "palpation", "phase": "running",
    "elapsed_s": 12.0, "time_s": 60, "marks": 1, "findings": [], "figures": {}}})");
  WebServer carl({.port = 0}, {});
  carl.set_task(R"({"session": "x", "task": null})");
  WebServer strange({.port = 0}, {});
  strange.set_task("\x1b[2J{]");
  WebServer lying({.port = 0}, {});
  lying.set_task(R"({"task": {"phase": 3, "elapsed_s": "long", "marks": [], "findings": "many",
    "score": {"coverage_ratio": {}, "force": 7}}})");
  WebServer odd({.port = 0}, {});
  odd.set_task(
      "{\"task\": {\"phase\": \"\xE2\x80\xAE"
      "dedne\", \"elapsed_s\": 1e99, \"marks\": -1e300}}");
  std::string gone;
  {
    const WebServer short_lived({.port = 0}, {});
    gone = address_of("gone", short_lived);
  }
  const Outcome outcome =
      run_program("palpate", {"stations", "--once", address_of("anna", anna, "sixteen-letters-1"),
                              address_of("ben", ben), address_of("carl", carl),
                              address_of("dora", anna), address_of("emil", strange),
                              address_of("fred", lying), address_of("gina", odd), gone});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.out, ContainsRegex("anna +ended +61 +2 +93 +2\\.12 +Found 1 of 1\\."));
  EXPECT_THAT(outcome.out, ContainsRegex("ben +running +12 +1 "));
  EXPECT_THAT(outcome.out, ContainsRegex("carl +no task"));
  EXPECT_THAT(outcome.out, ContainsRegex("dora +absent +needs its \\?token="));
  EXPECT_THAT(outcome.out, ContainsRegex("emil +absent +is no viewer_node"));
  EXPECT_THAT(outcome.out, ContainsRegex("\nfred *\n"));
  EXPECT_THAT(outcome.out, ContainsRegex("\ngina +\\?dedne *\n"));
  EXPECT_THAT(outcome.out, ContainsRegex("gone +absent +cannot be reached"));

  const Outcome csv = run_program("palpate", {"stations", "--once", "--csv", "-",
                                              address_of("anna", anna, "sixteen-letters-1")});
  EXPECT_EQ(csv.out,
            "station,state,time_s,marks,coverage_percent,force_most_n,news\n"
            "anna,ended,61,2,93,2.12,Found 1 of 1.\n");
}

TEST(Stations, AreAPage) {
  WebServer anna({.port = 0}, {});
  anna.set_task(kEnded);
  test::Program stations("palpate", {"stations", "--web-port", "0", address_of("an<na", anna)});
  ASSERT_TRUE(test::await([&] {
    return stations.out().find("Found 1 of 1.") != std::string::npos;
  })) << stations.out()
      << stations.err();
  const std::string address = "http://127.0.0.1:";
  ASSERT_THAT(stations.out(), testing::StartsWith(address));
  const auto port = static_cast<std::uint16_t>(std::stoi(stations.out().substr(address.size())));
  const auto get = [&](const std::string& path) {
    test::WebClient client(port);
    client.send_raw("GET " + path + " HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
    return client.read_to_end();
  };
  const std::string task = get("/task");
  const auto table = nlohmann::json::parse(task.substr(task.find("\r\n\r\n")));
  EXPECT_EQ(table["stations"][0]["name"], "an<na");
  EXPECT_EQ(table["stations"][0]["state"], "ended");
  EXPECT_EQ(table["stations"][0]["cells"],
            nlohmann::json::parse(R"(["61", "2", "93", "2.12", "Found 1 of 1."])"));
  EXPECT_THAT(get("/"), HasSubstr("stations.js"));
  EXPECT_THAT(get("/app.js"), HasSubstr(" 404 ")) << "of another page";
  stations.send_signal(SIGTERM);
  EXPECT_EQ(stations.wait(), 0) << stations.err();
}

TEST(Stations, AnAddressThatIsNoneIsRefused) {
  for (const char* address :
       {"station1", "https://a/", "=http://a/", "http://", "http://a:b/", "http://a:123456/"}) {
    const Outcome outcome = run_program("palpate", {"stations", "--once", address});
    EXPECT_EQ(outcome.status, 2) << address;
    EXPECT_THAT(outcome.err, HasSubstr("give the address of its page")) << address;
  }
}

}  // namespace
}  // namespace palpate
