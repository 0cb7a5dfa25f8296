// SPDX-License-Identifier: Apache-2.0
// guarantee_bench — can a hand extract energy? Every controller mode against every adversity of
// physics, network, scheduler, encoder and profile, with a hand that tries to, in lockstep; beside
// the run without any controller. And whether mode guard depends on the past.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <string>
#include <vector>

#include "tests/bench/bench_output.h"
#include "tests/bench/guarantee/guarantee_tables.h"

namespace palpate::bench {
namespace {

struct GuaranteeOptions {
  BenchOptions bench;
  std::vector<std::string> overrides;  // of every session
  std::string only;  // adversity, monitor, history, devices or the first three ("")
  Shard shard;
};

void run(const GuaranteeOptions& options) {
  const BenchOptions& bench = options.bench;
  nlohmann::ordered_json json;
  const auto is_wanted = [&](const char* table) {
    return options.only.empty() || options.only == table;
  };
  if (is_wanted("adversity")) {
    const Table adversity =
        adversity_table(bench.is_quick ? 3 : 50, options.overrides, options.shard);
    std::printf(
        "%s\nEach run: 2 s, device at 1 kHz, a hand that tries to extract energy, 0.3 m/s at most "
        "unless stated."
        "\nFriction of the device: 0.1 N·s/m and 0.1 N, isotropic; or per axis, x 0.05, y 0.1, z "
        "0.2 of both."
        "\nMin energy: least true energy of the device's port over all inner steps and seeds, "
        "never "
        "seen by the controller."
        "\nPeak, fallback (without the force of an answer), hand speed: the largest of all seeds; "
        "transparency (rendered against requested) and clamped: their mean."
        "\nToo fast: ticks in which the hand was certainly faster than mode guard assumes."
        "\nEffect: the run without a controller loses more than 1 mJ.\n",
        adversity.text().c_str());
    std::fflush(stdout);
    write_table(bench, adversity.csv());
    json["adversity"] = adversity.json();
  }
  if (is_wanted("monitor")) {
    const Table monitor = monitor_table(bench.is_quick ? 5 : 50, options.overrides, options.shard);
    std::printf(
        "\n%s\nMode guard, physics that pushes along the motion or changes its law; else as "
        "above."
        "\nReduced: commands that the monitor of device_node reduced."
        "\nOne tick of the monitor: %.2f µs with isotropic friction, %.2f µs per axis.\n",
        monitor.text().c_str(), monitor_tick_us(false), monitor_tick_us(true));
    std::fflush(stdout);
    json["monitor"] = monitor.json();
  }
  if (options.only == "devices") {  // through sockets and terminals: slow
    double least_joule = 0.0;
    const Table devices =
        device_table(bench.is_quick ? 1 : 5, options.overrides, options.shard, least_joule);
    std::printf(
        "%s\nMode guard, physics at 1 kHz; the driver, its wire and the emulator behind it, in "
        "lockstep."
        "\nSimulated: the plain simulated device of the same specification, whose motors end a "
        "force "
        "with its lease."
        "\nDriver: the emulated motors go on for 20 ms where no message ends a force. Rows with * "
        "need "
        "motors that end a force by themselves: the guarantee is not available to these drivers "
        "there."
        "\nRows of encoders are left out for devices that have one of their own."
        "\nLeast of the drivers' rows without *: %.3f µJ.\n",
        devices.text().c_str(), 1e6 * least_joule);
    json["devices"] = devices.json();
  }
  if (is_wanted("history")) {
    const Table history = history_table(bench.is_quick, options.overrides, options.shard);
    std::printf(
        "\n%s\nThe paper's tissues after t_free of free motion; means over the phases of the "
        "physics "
        "at which the V begins."
        "\n± one run: standard deviation over the phases, the scatter of single runs. "
        "Change "
        "of the mean: against t_free = 0, ± its standard error."
        "\nOne run: largest change of a single run against the one at the same phase with t_free = "
        "0.\n",
        history.text().c_str());
    json["history"] = history.json();
  }
  write_json(bench, json);
}

}  // namespace
}  // namespace palpate::bench

int main(int argc, char** argv) {
  CLI::App app(
      "Energy extracted by the hand, for every controller mode and adversity, in lockstep.");
  palpate::bench::GuaranteeOptions options;
  app.add_option("--only", options.only,
                 "one of the tables; devices is computed only if named here")
      ->check(CLI::IsMember({"adversity", "monitor", "history", "devices"}));
  app.add_option("--set", options.overrides, "path=value: overrides a field of every session");
  palpate::bench::add_shard_option(app, options.shard);
  return palpate::bench::run_bench(app, options.bench, argc, argv,
                                   [&] { palpate::bench::run(options); });
}
