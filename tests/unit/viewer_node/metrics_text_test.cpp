// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/feed/metrics_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <regex>
#include <set>
#include <sstream>

#include "tests/support/machine/places.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/viewer_node/batches.h"

namespace palpate::viewer {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::Not;

class MetricsTextTest : public testing::Test {
 protected:
  explicit MetricsTextTest(const Session& session = {})
      : mirrors_(session.sides.size()), metrics_(session) {}

  void take_all(std::size_t side = 0) {
    DeviceBatch device = device_batch(0, 0, 9);
    device.records[0].lateness = 20us;
    device.records[1].lateness = 21us;
    device.records[2].lateness = 2s;
    device.records[3].is_answered = false;
    device.counters.limp_ticks = 7;
    device.peers_refused = 5;
    const MofcBatch mofc = mofc_batch(0, 0, 9);
    PhysicsBatch physics = physics_batch(0, 0, 9);
    physics.counters.mesh_frames = 11;
    physics.counters.meshes_skipped = 12;
    const auto take = [&](const auto& batch) {
      metrics_.note(side, batch);
      mirrors_[side].take(batch, TimePoint{});
    };
    take(device);
    take(mofc);
    take(physics);
  }
  [[nodiscard]] std::string text() const {
    return metrics_.text(mirrors_, {.clients = 3, .messages_dropped = 4, .messages_thinned = 5},
                         TimePoint{});
  }
  /// The rules of the text format that promtool checks too.
  void expect_well_formed() const;
  void expect_promtool_accepts() const;

  std::vector<TelemetryMirror> mirrors_;
  MetricsText metrics_;
};

/// A device for each hand.
class MetricsOfTwoHands : public MetricsTextTest {
 protected:
  MetricsOfTwoHands() : MetricsTextTest(two_hands()) {}

  static Session two_hands() {
    Session session;
    session.sides.resize(2);
    session.sides[0].name = "left";
    session.sides[1].name = "right";
    return session;
  }
};

TEST_F(MetricsTextTest, ANodeThatWasNeverHeardIsDownAndCountsNothing) {
  EXPECT_THAT(text(), HasSubstr("palpate_node_up{node=\"mofc\"} 0\n"));
  EXPECT_THAT(text(), Not(HasSubstr("palpate_mofc_ticks")));
  EXPECT_THAT(text(), HasSubstr("palpate_viewer_clients 3\n"));
}

TEST_F(MetricsTextTest, CountersAreThoseOfTheNodes) {
  take_all();
  EXPECT_THAT(text(), HasSubstr("palpate_node_up{node=\"device\"} 1\n"));
  EXPECT_THAT(text(), HasSubstr("palpate_loop_ticks_total{node=\"device\"} 10\n"));
  EXPECT_THAT(text(), HasSubstr("palpate_device_ticks_total{force=\"limp\"} 7\n"));
  EXPECT_THAT(text(), HasSubstr("palpate_peers_refused_total{node=\"device\"} 5\n"));
  EXPECT_THAT(text(), HasSubstr("palpate_mofc_ticks_total 10\n"));
  EXPECT_THAT(text(), HasSubstr("palpate_physics_mesh_frames_total 11\n"));
  EXPECT_THAT(text(), HasSubstr("palpate_physics_meshes_skipped_total 12\n"));
  EXPECT_THAT(text(), HasSubstr("palpate_device_minimum_true_energy_joules NaN\n"));
  EXPECT_THAT(text(), HasSubstr("palpate_viewer_messages_dropped_total 4\n"));
  EXPECT_THAT(text(), HasSubstr("palpate_viewer_messages_thinned_total 5\n"));
}

// Lateness: 20 µs belongs to its bucket, 21 µs to the next, 2 s to none but the last, seven are 0.
TEST_F(MetricsTextTest, TheAlertRulesNameMetricsThatExist) {
  take_all();
  const std::string page = text();
  const std::string rules =
      test::text_of(test::source_dir() + "/deploy/prometheus/palpate_rules.yml");
  const std::regex metric("expr:[^\n]*?(palpate_[a-z_]+)");
  int count = 0;
  for (std::sregex_iterator at(rules.begin(), rules.end(), metric), end; at != end; ++at) {
    EXPECT_THAT(page, HasSubstr("\n" + (*at)[1].str())) << "of an alert";
    ++count;
  }
  EXPECT_GE(count, 6);
}

TEST_F(MetricsTextTest, HistogramsCountUpToAndWithTheirBounds) {
  take_all();
  EXPECT_THAT(text(), HasSubstr("palpate_tick_lateness_seconds_bucket{le=\"1e-05\"} 7\n"));
  EXPECT_THAT(text(), HasSubstr("palpate_tick_lateness_seconds_bucket{le=\"2e-05\"} 8\n"));
  EXPECT_THAT(text(), HasSubstr("palpate_tick_lateness_seconds_bucket{le=\"5e-05\"} 9\n"));
  EXPECT_THAT(text(), HasSubstr("palpate_tick_lateness_seconds_bucket{le=\"1\"} 9\n"));
  EXPECT_THAT(text(), HasSubstr("palpate_tick_lateness_seconds_bucket{le=\"+Inf\"} 10\n"));
  EXPECT_THAT(text(), HasSubstr("palpate_tick_lateness_seconds_sum 2.000041\n"));
  EXPECT_THAT(text(), HasSubstr("palpate_tick_lateness_seconds_count 10\n"));
  EXPECT_THAT(text(), HasSubstr("palpate_reply_time_seconds_count 9\n"));
  EXPECT_THAT(text(), HasSubstr("palpate_physics_compute_time_seconds_count 10\n"));
}

// Ten ticks on the left, of which one is not answered and one is 2 s late; five on the right.
TEST_F(MetricsOfTwoHands, EachCountsForItself) {
  take_all(0);
  EXPECT_THAT(text(), HasSubstr("palpate_node_up{side=\"left\",node=\"device\"} 1\n"));
  EXPECT_THAT(text(), HasSubstr("palpate_node_up{side=\"right\",node=\"device\"} 0\n"));
  EXPECT_THAT(text(), Not(HasSubstr("palpate_mofc_ticks_total{side=\"right\"}")));
  const DeviceBatch right = device_batch(0, 0, 4);
  metrics_.note(1, right);
  mirrors_[1].take(right, TimePoint{});

  const std::string page = text();
  EXPECT_THAT(page, HasSubstr("palpate_mofc_ticks_total{side=\"left\"} 10\n"));
  EXPECT_THAT(page, HasSubstr("palpate_device_ticks_total{side=\"left\",force=\"limp\"} 7\n"));
  EXPECT_THAT(page, HasSubstr("palpate_loop_ticks_total{side=\"left\",node=\"device\"} 10\n"));
  EXPECT_THAT(page, HasSubstr("palpate_loop_ticks_total{side=\"right\",node=\"device\"} 5\n"));
  EXPECT_THAT(page, HasSubstr("palpate_reply_time_seconds_count{side=\"left\"} 9\n"));
  EXPECT_THAT(page, HasSubstr("palpate_reply_time_seconds_count{side=\"right\"} 5\n"));
  EXPECT_THAT(page, HasSubstr("palpate_tick_lateness_seconds_bucket{side=\"left\",le=\"1\"} 9\n"));
  EXPECT_THAT(page, HasSubstr("palpate_tick_lateness_seconds_bucket{side=\"right\",le=\"1\"} 5\n"));
  EXPECT_THAT(page, HasSubstr("palpate_viewer_clients 3\n"));
}

void MetricsTextTest::expect_well_formed() const {
  const std::regex sample(
      R"(([a-z_]+)(\{[a-z]+="[^"\\]*"(,[a-z]+="[^"\\]*")*\})? (NaN|[+-]Inf|-?[0-9.]+(e[+-][0-9]+)?))");
  std::istringstream lines(text());
  std::set<std::string> seen;
  std::string name;
  std::string type;
  for (std::string line; std::getline(lines, line);) {
    SCOPED_TRACE(line);
    if (line.starts_with("# HELP ")) {
      name = line.substr(7, line.find(' ', 7) - 7);
      EXPECT_TRUE(seen.insert(name).second);
      continue;
    }
    if (line.starts_with("# TYPE ")) {
      ASSERT_TRUE(line.starts_with("# TYPE " + name + " "));
      type = line.substr(8 + name.size());
      EXPECT_EQ(name.ends_with("_total"), type == "counter");
      continue;
    }
    std::smatch parts;
    ASSERT_TRUE(std::regex_match(line, parts, sample));
    if (type == "histogram") {
      EXPECT_TRUE(parts[1].str().starts_with(name + "_"));
    } else {
      EXPECT_EQ(parts[1], name);
    }
  }
  EXPECT_GT(seen.size(), 25u);
}

TEST_F(MetricsTextTest, EveryLineIsWellFormedAndBelongsToTheHeadAboveIt) {
  take_all();
  expect_well_formed();
}

TEST_F(MetricsOfTwoHands, EveryLineIsWellFormedAndBelongsToTheHeadAboveIt) {
  take_all(0);
  take_all(1);
  expect_well_formed();
}

constexpr const char* kNoPromtool = "promtool is not installed (Debian's prometheus)";
bool has_promtool() { return std::system("command -v promtool >/dev/null") == 0; }

void MetricsTextTest::expect_promtool_accepts() const {
  if (!has_promtool()) GTEST_SKIP() << kNoPromtool;
  const test::TempFolder folder;
  const std::string file = folder.write("metrics", text());
  EXPECT_EQ(std::system(("promtool check metrics < " + file).c_str()), 0);
}

TEST_F(MetricsTextTest, PromtoolAcceptsIt) {
  take_all();
  expect_promtool_accepts();
}

TEST_F(MetricsOfTwoHands, PromtoolAcceptsIt) {
  take_all(0);
  take_all(1);
  expect_promtool_accepts();
}

TEST(PrometheusFiles, PromtoolAcceptsConfigurationAndAlertRules) {
  if (!has_promtool()) GTEST_SKIP() << kNoPromtool;
  const std::string check =
      "promtool check config " + test::source_dir() + "/deploy/prometheus/prometheus.yml";
  EXPECT_EQ(std::system(check.c_str()), 0);
}

}  // namespace
}  // namespace palpate::viewer
