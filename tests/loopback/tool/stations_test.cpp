// SPDX-License-Identifier: Apache-2.0
// The table of a teacher: stations that wait, search, have ended, want a token, or are not there.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "common/task/needle_score.h"
#include "common/task/score.h"
#include "common/task/traction_score.h"
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
  "score": {"coverage_ratio": 0.934, "force": {"most_n": 2.125}, "missing_ratio": 0.0}}})";

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
  const Outcome outcome = run_program(
      "palpate", {"stations", "--once", address_of("anna", anna, "sixteen-letters-1"),
                  address_of("ben", ben), address_of("carl", carl), address_of("dora", anna),
                  address_of("emil", strange), address_of("fred", lying), address_of("gina", odd),
                  gone, address_of("hugo", anna, "sixteen-letters-2")});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.out,
              ContainsRegex("station +task +time s +marks +cover % +Fmax N +lost % +result\n"));
  EXPECT_THAT(outcome.out, ContainsRegex("anna +ended +61 +2 +93 +2\\.12 +0 +Found 1 of 1\\."));
  EXPECT_THAT(outcome.out, ContainsRegex("ben +running +12 +1 "));
  EXPECT_THAT(outcome.out, ContainsRegex("carl +no task"));
  EXPECT_THAT(outcome.out, ContainsRegex("dora +absent +needs its \\?token="));
  EXPECT_THAT(outcome.out, ContainsRegex("emil +absent +is no viewer_node"));
  EXPECT_THAT(outcome.out, ContainsRegex("\nfred +not understood +phase is no word\n"));
  EXPECT_THAT(outcome.out, ContainsRegex("\ngina +not understood +phase is \"\\?dedne\"\n"));
  EXPECT_THAT(outcome.out, ContainsRegex("hugo +absent +its token is another one"));
  EXPECT_THAT(outcome.out, ContainsRegex("gone +absent +cannot be reached"));

  const Outcome csv = run_program("palpate", {"stations", "--once", "--csv", "-",
                                              address_of("anna", anna, "sixteen-letters-1")});
  EXPECT_EQ(csv.out,
            "station,state,time_s,marks,coverage_percent,force_most_n,missing_percent,news\n"
            "anna,ended,61,2,93,2.12,0,Found 1 of 1.\n");
}

/// What a viewer_node says of a task that has ended, of whose ticks 2 of 1000 are missing.
std::string answer_of(TaskScore score) {
  score.end = TaskScore::End::kStopped;
  score.ticks = 998;
  score.missing_ticks = 2;
  TaskState state;
  state.kind = score.kind;
  state.phase = TaskState::Phase::kEnded;
  state.findings = findings_of(score);
  EXPECT_THAT(state.findings.front(), HasSubstr("measurements are missing"));
  nlohmann::ordered_json task = state_json(state);
  task["score"] = score_json(score);
  return nlohmann::ordered_json{{"session", "x"}, {"task", task}}.dump();
}

TEST(Stations, TellTheResultAndTheMissingShareApart) {
  TaskScore search;
  search.kind = TaskState::Kind::kPalpation;
  search.area_m2 = 0.01;
  search.targets.resize(2);
  search.targets[0].outcome = TargetScore::Outcome::kFound;
  TaskScore needle;
  needle.kind = TaskState::Kind::kNeedle;
  needle.needle.emplace();
  needle.needle->layers.resize(1);
  needle.needle->layers[0].name = "ligamentum flavum, which is long to read";
  TaskScore traction;
  traction.kind = TaskState::Kind::kTraction;
  traction.traction.emplace();
  traction.traction->unknown_ticks = 3;
  WebServer searcher({.port = 0}, {});
  searcher.set_task(answer_of(search));
  WebServer pusher({.port = 0}, {});
  pusher.set_task(answer_of(needle));
  WebServer holder({.port = 0}, {});
  holder.set_task(answer_of(traction));
  const std::vector<std::string> stations{
      address_of("searcher", searcher), address_of("pusher", pusher), address_of("holder", holder)};
  const auto run = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), stations.begin(), stations.end());
    return run_program("palpate", arguments).out;
  };

  const std::string table = run({"stations", "--once"});
  const std::string csv = run({"stations", "--csv", "-", "--once"});

  EXPECT_THAT(table, ContainsRegex("searcher +ended .* 0\\.2 +Found 1 of 2\\.\n"));
  // 60 characters at most, whole words
  EXPECT_THAT(table, ContainsRegex("pusher +ended .* 0\\.2 +You did not get through ligamentum "
                                   "flavum, which is long to…\n"));
  EXPECT_THAT(table,
              ContainsRegex("holder +ended .* 0\\.2 +You did not take hold of the tissue\\.\n"));
  EXPECT_THAT(csv, HasSubstr(",0.2,\"You did not get through ligamentum flavum, which is long to "
                             "read.\"\n"));
}

TEST(Stations, WhatIsNotUnderstoodIsSaidWithTheReason) {
  const std::vector<std::pair<std::string, std::string>> cases{
      {R"({"task": 3})", "task is no object"},
      {R"({"task": {}})", "phase is no word"},
      {R"({"task": {"phase": "ended", "elapsed_s": "long"}})", "elapsed_s is no number"},
      {R"({"task": {"phase": "ended", "marks": 1e99}})", "marks is too large"},
      {R"({"task": {"phase": "ended", "findings": "many"}})", "findings is no list"},
      {R"({"task": {"phase": "ended", "findings": [7]}})", "findings has more than sentences"},
      {R"({"task": {"phase": "ended", "score": []}})", "score is no object"},
      {R"({"task": {"phase": "ended", "score": {"force": 7}}})", "force is no object"},
      {R"({"task": {"phase": "ended", "score": {"missing_ratio": {}}}})",
       "missing_ratio is no number"}};
  for (const auto& [json, reason] : cases) {
    WebServer station({.port = 0}, {});
    station.set_task(json);
    const Outcome outcome =
        run_program("palpate", {"stations", "--once", address_of("anna", station)});
    EXPECT_THAT(outcome.out, ContainsRegex("anna +not understood +" + reason + "\n")) << json;
  }
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
            nlohmann::json::parse(R"(["61", "2", "93", "2.12", "0", "Found 1 of 1."])"));
  EXPECT_THAT(get("/"), HasSubstr("stations.js"));
  EXPECT_THAT(get("/app.js"), HasSubstr(" 404 ")) << "of another page";
  stations.send_signal(SIGTERM);
  EXPECT_EQ(stations.wait(), 0) << stations.err();
}

TEST(Stations, AnAddressThatIsNoneIsRefused) {
  for (const char* address : {"station1", "https://a/", "=http://a/", "http://", "http://a:b/",
                              "http://a:123456/", "http://a:65536/", "http://a:0/"}) {
    const Outcome outcome = run_program("palpate", {"stations", "--once", address});
    EXPECT_EQ(outcome.status, 2) << address;
    EXPECT_THAT(outcome.err, HasSubstr("give the address of its page")) << address;
  }
  const Outcome twice =
      run_program("palpate", {"stations", "--once", "ben=http://a:1/", "ben=http://b:1/"});
  EXPECT_EQ(twice.status, 2);
  EXPECT_THAT(twice.err, HasSubstr("station ben: is given twice; give each a name of its own"));
}

}  // namespace
}  // namespace palpate
