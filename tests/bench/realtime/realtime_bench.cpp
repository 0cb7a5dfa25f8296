// SPDX-License-Identifier: Apache-2.0
// realtime_bench — sessions in real time on an ordinary machine (no SCHED_FIFO, the page open, busy
// processors), or with the physics on another machine behind a disturbed network.
#include <spdlog/fmt/fmt.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "common/core/check.h"
#include "common/process/realtime.h"
#include "common/session/session_file.h"
#include "common/telemetry/quantile.h"
#include "tests/bench/bench_output.h"
#include "tests/bench/realtime/open_page.h"
#include "tests/support/machine/places.h"
#include "tests/support/network/two_networks.h"
#include "tests/support/program.h"
#include "tests/support/run_folder.h"
#include "tests/support/watcher.h"

namespace palpate::bench {
namespace {

using test::PacketDisturbance;
using test::Program;
using test::TwoNetworks;
using test::Watcher;
using namespace std::chrono_literals;

std::string file_of(const std::string& session) {
  return fmt::format("{}/deploy/sessions/{}.txtpb", test::source_dir(), session);
}

// --- what was measured --------------------------------------------------------------------------

double micro(Duration time) { return 1e6 * to_seconds(time); }

Table make_table() {
  return Table({{"session", "session", ""},
                {"conditions", "conditions", ""},
                {"transparency_percent", "T %", "{:.1f}"},
                {"answered_percent", "answered %", "{:.2f}"},
                {"skipped_percent", "skipped %", "{:.2f}"},
                {"reply_p50_us", "reply µs p50", "{:.0f}"},
                {"reply_p99_us", "p99", "{:.0f}"},
                {"reply_p999_us", "p99.9", "{:.0f}"},
                {"lateness_p50_us", "lateness µs p50", "{:.0f}"},
                {"lateness_p99_us", "p99", "{:.0f}"},
                {"lateness_p999_us", "p99.9", "{:.0f}"},
                {"force_age_p50_ms", "force age ms p50", "{:.1f}"},
                {"force_age_p99_ms", "p99", "{:.1f}"},
                {"min_true_energy_uj", "min energy µJ", "{:.1f}"},
                {"pictures_per_s", "pictures/s", "{:.1f}"},
                {"machine_load", "load", ""}});
}

/// What the running nodes report.
class Observer {
 public:
  Observer(const std::string& session, const std::vector<std::string>& overrides,
           const TcpRules& tcp)
      : session_(load_session(file_of(session), overrides)),
        links_({.priority = 0, .cpu = -1}, tcp),
        watcher_(session_, links_) {}

  void await_nodes(const std::function<std::string()>& said) {
    if (!watcher_.until([&] { return watcher_.sees_all_nodes(); })) {
      throw SetupError("the nodes do not run:\n" + said());
    }
    pass(2s);
  }
  void pass(Duration time) {
    const SteadyClock clock;
    const TimePoint end = clock.now() + time;
    watcher_.until([&] { return clock.now() >= end; }, time + 1s);
  }
  /// A row of the table for each side.
  void measure(Table& table, const std::string& conditions, Duration time, OpenPage* page) {
    struct Before {
      std::size_t rows = 0;
      DeviceCounters device{};
      MofcCounters mofc{};
    };
    std::vector<Before> before;
    for (std::size_t side = 0; side < session_.sides.size(); ++side) {
      before.push_back({.rows = watcher_.rows(side).size(),
                        .device = watcher_.mirror(side).device_counters(),
                        .mofc = watcher_.mirror(side).mofc_counters()});
    }
    const double frames = page != nullptr ? page->frames() : kNaN;
    const SteadyClock clock;
    const TimePoint began_at = clock.now();
    pass(time);
    const double drawn = page != nullptr ? page->frames() - frames : kNaN;
    const double pictures_per_s = drawn / to_seconds(clock.now() - began_at);

    for (std::size_t side = 0; side < session_.sides.size(); ++side) {
      const DeviceCounters& device = before[side].device;
      const MofcCounters& mofc = before[side].mofc;
      const DeviceCounters after = watcher_.mirror(side).device_counters();
      const MofcCounters mofc_after = watcher_.mirror(side).mofc_counters();
      std::vector<double> reply_us;
      std::vector<double> lateness_us;
      std::vector<double> age_ms;
      for (const TickRow& row : std::span(watcher_.rows(side)).subspan(before[side].rows)) {
        lateness_us.push_back(micro(row.device.lateness));
        if (row.device.is_answered) reply_us.push_back(micro(row.device.reply_time));
        if (row.mofc && row.mofc->is_in_contact)
          age_ms.push_back(1e-3 * micro(row.mofc->force_age));
      }
      const auto at = [](std::vector<double>& values, double q) {
        return values.empty() ? kNaN : quantile(values, q);
      };
      const auto ticks = static_cast<double>(after.loop.ticks - device.loop.ticks);
      const auto skipped =
          static_cast<double>(after.loop.skipped_ticks - device.loop.skipped_ticks);
      const auto answered = static_cast<double>(after.answered_ticks - device.answered_ticks);
      const double transparency =
          (mofc_after.transparency_integral_ns - mofc.transparency_integral_ns) /
          static_cast<double>(mofc_after.transparency_time_ns - mofc.transparency_time_ns);
      const std::string& name = session_.sides[side].name;
      table.add({name.empty() ? session_.name : session_.name + ", " + name, conditions,
                 100.0 * transparency, 100.0 * answered / (ticks + skipped),
                 100.0 * skipped / (ticks + skipped), at(reply_us, 0.5), at(reply_us, 0.99),
                 at(reply_us, 0.999), at(lateness_us, 0.5), at(lateness_us, 0.99),
                 at(lateness_us, 0.999), at(age_ms, 0.5), at(age_ms, 0.99),
                 1e6 * after.minimum_true_energy_joule, pictures_per_s, machine_load()});
    }
  }

 private:
  Session session_;
  ProcessLinks links_;
  Watcher watcher_;
};

std::vector<std::string> with_overrides(std::vector<std::string> arguments,
                                        const std::vector<std::string>& overrides) {
  for (const std::string& one : overrides) arguments.insert(arguments.end(), {"--set", one});
  return arguments;
}

// --- an ordinary machine ------------------------------------------------------------------------

/// A loop on each processor, with ordinary priority.
class BusyProcessors {
 public:
  BusyProcessors() {
    for (unsigned i = 0; i < std::thread::hardware_concurrency(); ++i) {
      threads_.emplace_back([](const std::stop_token& stop) {
        while (!stop.stop_requested()) {
        }
      });
    }
  }

 private:
  std::vector<std::jthread> threads_;
};

void measure_ordinary(Table& table, Duration time) {
  const std::string no_page = OpenPage::missing();
  if (!no_page.empty()) std::printf("Without a page: %s.\n", no_page.c_str());
  const std::vector<std::string> overrides{"viewer.web.port=0"};
  for (const char* const session : {"default", "liver", "two_hands"}) {
    struct Way {
      const char* name;
      std::vector<std::string> arguments;
    };
    const Way ways[] = {{"ordinary", {"--no-realtime"}},
                        {"ordinary, together", {"--no-realtime", "--together", "device,mofc"}},
                        {"SCHED_FIFO", {}}};
    for (const Way& way : ways) {
      if (way.arguments.empty() && !may_use_fifo(80)) {
        std::printf("SCHED_FIFO is not permitted: no rows with it.\n");
        continue;
      }
      const test::RunFolder run_folder;  // apart from other sessions
      std::vector<std::string> arguments{"launch", file_of(session)};
      arguments.insert(arguments.end(), way.arguments.begin(), way.arguments.end());
      Program launch("palpate", with_overrides(arguments, overrides));
      Observer observer(session, overrides, {});
      observer.await_nodes([&] { return launch.err(); });
      const std::string port = launch.await_err("event=web url=http://127.0.0.1:");
      if (port.empty()) throw SetupError("viewer_node serves no page:\n" + launch.err());
      std::optional<OpenPage> page;
      if (no_page.empty()) page.emplace(fmt::format("http://127.0.0.1:{}/", std::stoi(port)));
      const std::string scheduling = fmt::format("{}{}", way.name, page ? ", page" : "");
      for (const bool is_busy : {false, true}) {
        std::optional<BusyProcessors> busy;
        if (is_busy) busy.emplace();
        observer.pass(2s);
        observer.measure(table, scheduling + (is_busy ? ", processors busy" : ""), time,
                         page ? &*page : nullptr);
      }
      page.reset();
      launch.send_signal(SIGTERM);
      launch.wait();
    }
    table.add_gap();
  }
}

// --- two machines -------------------------------------------------------------------------------

void measure_network(Table& table, Duration time) {
  struct Network {
    const char* name;
    std::optional<PacketDisturbance> disturbance;
  };
  const Network networks[] = {
      {"undisturbed", {}},
      {"20 ms", PacketDisturbance{.delay = 20ms}},
      {"20 ± 5 ms", PacketDisturbance{.delay = 20ms, .jitter = 5ms}},
      {"20 ms, 1 % lost", PacketDisturbance{.delay = 20ms, .loss_ratio = 0.01}},
      {"20 ± 5 ms, 1 % lost", PacketDisturbance{.delay = 20ms, .jitter = 5ms, .loss_ratio = 0.01}}};

  TwoNetworks machines;
  if (const std::string why = machines.make(); !why.empty()) {
    std::printf("Skipped: %s.\n", why.c_str());
    return;
  }
  const std::string near = TwoNetworks::kBedside;
  const std::string far = TwoNetworks::kWorkstation;
  const std::vector<std::string> overrides{"links.tool_motion=tcp://" + far + ":5551",
                                           "links.interaction=tcp://" + far + ":5552",
                                           "links.physics_telemetry=tcp://" + far + ":5553",
                                           "links.device_telemetry=tcp://" + near + ":5554",
                                           "links.mofc_telemetry=tcp://" + near + ":5555"};
  for (const char* const session : {"default", "liver", "cloud"}) {
    for (const Network& network : networks) {
      if (const std::string why = machines.connect(network.disturbance); !why.empty()) {
        std::printf("Skipped: %s.\n", why.c_str());
        return;
      }
      const test::RunFolder bedside_folder;  // each machine has its own
      const test::RunFolder workstation_folder;
      Program physics(
          "palpate",
          with_overrides({"launch", file_of(session), "--nodes", "physics", "--insecure"},
                         overrides),
          machines.workstation());
      bedside_folder.use();
      Program bedside("palpate", with_overrides({"launch", file_of(session), "--nodes",
                                                 "device,mofc", "--insecure"},
                                                overrides));
      Observer observer(session, overrides, {.may_be_plain = true});
      observer.await_nodes([&] { return physics.err() + bedside.err(); });
      observer.measure(table, fmt::format("{}, {}", network.name, machines.cable()), time, nullptr);
      for (Program* launch : {&bedside, &physics}) {
        launch->send_signal(SIGTERM);
        launch->wait();
      }
    }
    table.add_gap();
  }
}

}  // namespace
}  // namespace palpate::bench

int main(int argc, char** argv) {
  CLI::App app("Sessions in real time: on an ordinary, busy machine, or over a disturbed network.");
  palpate::bench::BenchOptions options;
  bool is_of_network = false;
  app.add_flag(
      "--network", is_of_network,
      "instead: physics on another machine (a network namespace), packets delayed, jittered "
      "and lost");
  return palpate::bench::run_bench(app, options, argc, argv, [&] {
    const auto time = std::chrono::seconds(options.is_quick ? 4 : 20);
    palpate::bench::Table table = palpate::bench::make_table();
    (is_of_network ? palpate::bench::measure_network : palpate::bench::measure_ordinary)(table,
                                                                                         time);
    table.publish(options);
    std::printf(
        "\n%d s each. T: transparency against what mofc_node requested, skipped ticks included. "
        "Answered, skipped: of the\nscheduled ticks. Load: average of the last minute.\n"
        "TUN relay: the kernel has no netem. Page: drawn by a headless Chromium with WebGL on the "
        "processor; busy: a loop on each "
        "processor.\n",
        options.is_quick ? 4 : 20);
  });
}
