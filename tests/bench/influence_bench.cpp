// SPDX-License-Identifier: Apache-2.0
// influence_bench — the cost of viewers: timing of the haptic loop with 0, 1 and 8 viewers in real
// processes, and viewer_node's share of a core while a page sees a deforming tissue.
#include <spdlog/fmt/fmt.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <memory>
#include <numbers>
#include <string>
#include <thread>
#include <vector>

#include "common/core/check.h"
#include "common/session/session_file.h"
#include "common/telemetry/metrics.h"
#include "common/telemetry/quantile.h"
#include "tests/bench/bench_output.h"
#include "tests/support/machine/places.h"
#include "tests/support/program.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"
#include "tests/support/watcher.h"
#include "tests/support/web_client.h"

namespace palpate::bench {
namespace {

using test::Program;
using test::TempFolder;
using test::Watcher;
using test::WebClient;

constexpr std::size_t kRateHz = 1000;  // of the device, in both sessions
constexpr int kChannels = 11;          // that viewer_node advertises, from 1
constexpr int kMeshChannel = 2;

/// viewer_node with pages that read their subscriptions as fast as they arrive.
class Viewer {
 public:
  Viewer(const std::string& session, std::size_t pages, int first_channel, int last_channel)
      : program_("viewer_node", {"--session", session, "--quiet", "--listen", "127.0.0.1:0"}) {
    const std::string url = program_.await_err("event=web url=http://127.0.0.1:");
    if (url.empty()) throw SetupError("viewer_node does not serve a page:\n" + program_.err());
    for (std::size_t i = 0; i < pages; ++i) {
      threads_.emplace_back([this, port = std::stoi(url), first_channel, last_channel] {
        WebClient page(static_cast<std::uint16_t>(port));
        if (!page.open_web_socket()) return;
        for (int channel = first_channel; channel <= last_channel; ++channel) {
          page.send_text(fmt::format(
              R"({{"op":"subscribe","subscriptions":[{{"id":{0},"channelId":{0}}}]}})", channel));
        }
        while (const auto message = page.next()) {
          messages += message->opcode == 2 ? 1U : 0U;
          bytes += message->payload.size();
        }
      });
    }
  }
  ~Viewer() { program_.send_signal(SIGKILL); }  // the pages' connections end, and their threads
  Viewer(const Viewer&) = delete;
  Viewer& operator=(const Viewer&) = delete;

  void await_data() const {
    const auto deadline = std::chrono::steady_clock::now() + test::patience(Program::kAmple);
    while (messages == 0) {
      if (std::chrono::steady_clock::now() > deadline) throw SetupError("a page gets no data");
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }
  void stall() const { program_.send_signal(SIGSTOP); }
  [[nodiscard]] pid_t pid() const { return program_.pid(); }

  std::atomic<std::uint64_t> messages{0};
  std::atomic<std::uint64_t> bytes{0};

 private:
  Program program_;
  std::vector<std::jthread> threads_;
};

/// The three nodes of a session, and a subscriber to their telemetry that measures.
class Nodes {
 public:
  Nodes(const std::string& session, bool is_realtime)
      : launch_("palpate", arguments(session, is_realtime)),
        watcher_(load_session(session), links_) {
    if (!watcher_.until([&] { return watcher_.sees_all_nodes(); })) {
      throw SetupError("the nodes do not run:\n" + launch_.err());
    }
    skip(2 * kRateHz);
  }
  ~Nodes() {
    launch_.send_signal(SIGTERM);
    launch_.wait();
  }
  Nodes(const Nodes&) = delete;
  Nodes& operator=(const Nodes&) = delete;

  /// Discards this many ticks, so that earlier messages have arrived.
  void skip(std::size_t ticks) {
    if (!watcher_.until_rows(ticks)) throw SetupError("the ticks stopped:\n" + launch_.err());
  }
  /// The next `ticks` ticks of the telemetry.
  [[nodiscard]] std::vector<TickRow> take(std::size_t ticks) {
    const std::size_t first = watcher_.rows().size();
    skip(ticks);
    return {watcher_.rows().begin() + static_cast<std::ptrdiff_t>(first), watcher_.rows().end()};
  }
  [[nodiscard]] pid_t pid_of(const std::string& node) {
    return std::stoi(launch_.await_err("event=node_started node=" + node + " pid="));
  }

 private:
  static std::vector<std::string> arguments(const std::string& session, bool is_realtime) {
    std::vector<std::string> list{"launch", session, "--no-viewer"};
    if (!is_realtime) list.emplace_back("--no-realtime");
    return list;
  }
  Program launch_;
  ProcessLinks links_{{.priority = 0, .cpu = -1}};
  Watcher watcher_;
};

// --- influence ----------------------------------------------------------------------------------

const std::string kDefault = test::source_dir() + "/deploy/sessions/default.txtpb";

struct Condition {
  const char* label;
  std::size_t viewers;
  bool has_stalled;
};
constexpr std::array<Condition, 4> kConditions{
    {{"none", 0, false}, {"1", 1, false}, {"8", 8, false}, {"8, one stopped", 8, true}}};

/// Of one run; times in µs.
using Figures = std::array<double, 7>;

Figures figures_of(const std::vector<TickRow>& rows) {
  std::vector<double> reply_us;
  std::vector<double> lateness_us;
  for (const TickRow& row : rows) {
    lateness_us.push_back(1e6 * to_seconds(row.device.lateness));
    if (row.device.is_answered) reply_us.push_back(1e6 * to_seconds(row.device.reply_time));
  }
  const auto quantile = [](std::vector<double>& values, double q) {
    if (values.empty()) return kNaN;
    return palpate::quantile(values, q);
  };
  const double answered_percent =
      100.0 * static_cast<double>(reply_us.size()) / static_cast<double>(rows.size());
  return {quantile(reply_us, 0.5),
          quantile(reply_us, 0.99),
          quantile(reply_us, 0.999),
          quantile(lateness_us, 0.5),
          quantile(lateness_us, 0.99),
          quantile(lateness_us, 0.999),
          answered_percent};
}

Figures measure(Nodes& nodes, const Condition& condition, std::size_t seconds) {
  std::vector<std::unique_ptr<Viewer>> viewers;
  for (std::size_t i = 0; i < condition.viewers; ++i) {
    viewers.push_back(std::make_unique<Viewer>(kDefault, 1, 1, kChannels));
  }
  for (const auto& viewer : viewers) viewer->await_data();
  if (condition.has_stalled) viewers.front()->stall();
  nodes.skip(kRateHz);
  return figures_of(nodes.take(seconds * kRateHz));
}

void measure_influence(const BenchOptions& options, bool is_realtime) {
  const std::size_t rounds = options.is_quick ? 3 : 5;
  const std::size_t seconds = options.is_quick ? 3 : 10;
  std::array<std::vector<Figures>, kConditions.size()> runs;
  for (std::size_t round = 0; round < rounds; ++round) {
    Nodes nodes(kDefault, is_realtime);
    for (std::size_t i = 0; i < kConditions.size(); ++i) {
      const std::size_t condition = (i + round) % kConditions.size();  // none is always the first
      runs[condition].push_back(measure(nodes, kConditions[condition], seconds));
    }
  }

  Table table({{"viewers", "viewers", ""},
               {"of_rounds", "of the rounds", ""},
               {"reply_p50_us", "reply p50 µs", "{:.0f}"},
               {"reply_p99_us", "p99", "{:.0f}"},
               {"reply_p999_us", "p99.9", "{:.0f}"},
               {"lateness_p50_us", "lateness p50 µs", "{:.0f}"},
               {"lateness_p99_us", "p99", "{:.0f}"},
               {"lateness_p999_us", "p99.9", "{:.0f}"},
               {"answered_percent", "answered %", "{:.2f}"}});
  for (std::size_t i = 0; i < kConditions.size(); ++i) {
    const auto add = [&](const char* name, double share) {
      std::vector<Table::Cell> row{std::string(kConditions[i].label), std::string(name)};
      for (std::size_t figure = 0; figure < Figures().size(); ++figure) {
        std::vector<double> values;
        for (const Figures& run : runs[i]) values.push_back(run[figure]);
        std::sort(values.begin(), values.end());
        row.emplace_back(
            values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))]);
      }
      table.add(row);
    };
    add("least", 0.0);
    add("median", 0.5);
    add("greatest", 1.0);
    table.add_gap();
  }
  table.publish(options);
  std::printf(
      "%zu rounds of %zu s each, the nodes restarted for each round; %s. A viewer is a\n"
      "viewer_node whose page subscribes to all channels. The measuring subscriber is present in\n"
      "every row. The range within one row is the noise for comparing rows.\n",
      rounds, seconds, is_realtime ? "SCHED_FIFO where permitted" : "ordinary scheduling");
}

// --- page ---------------------------------------------------------------------------------------

constexpr std::size_t kRings = 100;
constexpr std::size_t kColumns = 200;

/// A ball of 20 002 vertices. The tip is as wide as the ball, so every one of them is in its dent.
constexpr const char* kBallSession = R"(
name: "ball"
device { rate_hz: 1000 simulated {} }
hand { sinusoid { center_m { z: 0.02 } amplitude_m { x: 0.004 y: 0.003 z: 0.01 } frequency_hz { x: 0.5 y: 0.3 z: 1 } } }
physics { rate_hz: 1000 }
scene {
  tool { tip_radius_m: 0.02 }
  tissue { name: "ball" triangle_surface { file: "ball.obj" } kelvin_voigt { stiffness_newton_per_m: 100 damping_newton_s_per_m: 1 } }
}
)";
constexpr double kBallRadius_m = 0.015;

std::string ball_obj() {
  std::string obj;
  const auto vertex = [&](double polar_rad, double azimuth_rad) {
    obj += fmt::format("v {} {} {}\n", kBallRadius_m * std::sin(polar_rad) * std::cos(azimuth_rad),
                       kBallRadius_m * std::sin(polar_rad) * std::sin(azimuth_rad),
                       kBallRadius_m * std::cos(polar_rad));
  };
  const auto ring = [](std::size_t row, std::size_t column) {
    return 2 + row * kColumns + column % kColumns;
  };
  const std::size_t bottom = 2 + kRings * kColumns;
  vertex(0.0, 0.0);
  for (std::size_t row = 0; row < kRings; ++row) {
    for (std::size_t column = 0; column < kColumns; ++column) {
      vertex(std::numbers::pi * static_cast<double>(row + 1) / (kRings + 1),
             2.0 * std::numbers::pi * static_cast<double>(column) / kColumns);
    }
  }
  vertex(std::numbers::pi, 0.0);
  for (std::size_t i = 0; i < kColumns; ++i) {
    obj += fmt::format("f 1 {} {}\n", ring(0, i), ring(0, i + 1));
    for (std::size_t row = 0; row + 1 < kRings; ++row) {
      obj += fmt::format("f {} {} {} {}\n", ring(row, i), ring(row + 1, i), ring(row + 1, i + 1),
                         ring(row, i + 1));
    }
    obj += fmt::format("f {} {} {}\n", ring(kRings - 1, i), bottom, ring(kRings - 1, i + 1));
  }
  return obj;
}

/// Processor time of all threads since the start.
double processor_s(pid_t pid) {
  clockid_t clock{};
  timespec used{};
  if (clock_getcpuclockid(pid, &clock) != 0 || clock_gettime(clock, &used) != 0) return kNaN;
  return static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
}

void measure_page(const BenchOptions& options, bool is_realtime) {
  const TempFolder folder;
  const std::string session = folder.write("ball.txtpb", kBallSession);
  folder.write("ball.obj", ball_obj());
  const std::size_t seconds = options.is_quick ? 5 : 20;

  Table table({{"pages", "pages", "{:.0f}"},
               {"channels", "channels", ""},
               {"frames_per_s", "frames/s and page", "{:.1f}"},
               {"bytes_per_frame", "bytes/frame", "{:.0f}"},
               {"megabytes_per_s", "MB/s, all pages", "{:.1f}"},
               {"viewer_core_percent", "viewer_node, % of a core", "{:.1f}"},
               {"physics_core_percent", "physics_node, % of a core", "{:.1f}"}});
  Nodes nodes(session, is_realtime);
  const pid_t physics = nodes.pid_of("physics");
  for (const bool has_all : {false, true}) {
    for (const std::size_t pages : {0U, 1U, 4U}) {
      if (has_all && pages == 0) continue;
      Viewer viewer(session, pages, has_all ? 1 : kMeshChannel, has_all ? kChannels : kMeshChannel);
      if (pages > 0) viewer.await_data();
      nodes.skip(kRateHz);
      const auto begin = std::chrono::steady_clock::now();
      const std::uint64_t messages = viewer.messages;
      const std::uint64_t bytes = viewer.bytes;
      const double viewer_s = processor_s(viewer.pid());
      const double physics_s = processor_s(physics);
      nodes.skip(seconds * kRateHz);
      const double span_s =
          std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
      const auto frames = static_cast<double>(viewer.messages - messages);
      const auto volume = static_cast<double>(viewer.bytes - bytes);
      const bool is_mesh_only = !has_all && pages > 0;
      table.add({static_cast<double>(pages), std::string(has_all ? "all 11" : "mesh"),
                 is_mesh_only ? frames / span_s / static_cast<double>(pages) : kNaN,
                 is_mesh_only ? volume / frames : kNaN, 1e-6 * volume / span_s,
                 100.0 * (processor_s(viewer.pid()) - viewer_s) / span_s,
                 100.0 * (processor_s(physics) - physics_s) / span_s});
    }
  }
  table.publish(options);
  std::printf("%zu deforming vertices, %zu s each row. A frame holds 12 bytes a vertex.\n",
              2 + kRings * kColumns, seconds);
}

}  // namespace
}  // namespace palpate::bench

int main(int argc, char** argv) {
  CLI::App app("The cost of viewers: timing of the loop with 0, 1 and 8 viewers.");
  palpate::bench::BenchOptions options;
  bool is_of_page = false;
  bool is_ordinary = false;
  app.add_flag("--page", is_of_page, "instead: the load of 20 000 deforming vertices on a page");
  app.add_flag("--no-realtime", is_ordinary, "the nodes run with ordinary priority");
  return palpate::bench::run_bench(app, options, argc, argv, [&] {
    const palpate::test::RunFolder run_folder;  // apart from other sessions
    (is_of_page ? palpate::bench::measure_page : palpate::bench::measure_influence)(options,
                                                                                    !is_ordinary);
  });
}
