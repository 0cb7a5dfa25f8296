// SPDX-License-Identifier: Apache-2.0
// tissue_bench: the tissue library by itself: steps per second, memory of many scenes, states, and
// whether anything is kept in many steps.
#include <unistd.h>
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <string>
#include <vector>

#include "physics_node/library/palpate_tissue.hpp"
#include "tests/bench/bench_output.h"

namespace {

using namespace palpate;
using bench::BenchOptions;
using bench::Table;

constexpr double kTick_s = 1e-3;

double cpu_s() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double resident_mib() {
  std::ifstream file("/proc/self/statm");
  double all = 0.0;
  double resident = 0.0;
  file >> all >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1048576.0;
}

/// Presses up to 5 mm deep every 0.7 s and drifts, each copy elsewhere; away: above the tissue.
void place(palpate_tool& tool, const std::vector<double>& over_m, std::size_t copy, double time_s,
           bool is_away) {
  const double phase = 0.61803 * static_cast<double>(copy);
  tool.position_m[0] = over_m[0] + 0.01 * std::sin(0.9 * time_s + 7.0 * phase);
  tool.position_m[1] = over_m[1] + 0.01 * std::sin(0.7 * time_s + 3.0 * phase);
  tool.position_m[2] =
      over_m[2] + (is_away ? 0.03 : -0.002 + 0.003 * std::cos(9.0 * time_s + phase));
}

struct Case {
  std::string name;
  std::string file;
  std::vector<double> over_m;  ///< the tip there touches
};

class Bench {
 public:
  explicit Bench(const BenchOptions& options) : options_(options) {}
  std::vector<std::size_t> copies{1, 16, 1000};
  std::size_t threads = 1;
  double seconds = 0.4;
  double many_steps = 0.0;

  void run() {
    const std::string folder = PALPATE_SOURCE_DIR "/deploy/sessions/";
    const std::vector<Case> cases{
        {"default", folder + "default.txtpb", {0.0, 0.0, 0.003}},
        {"block_with_tumour", folder + "block_with_tumour.txtpb", {0.0, 0.0, 0.006}}};
    if (many_steps > 0.0) {
      for (const Case& one : cases) keep(one);
      return;
    }
    for (const Case& one : cases) {
      for (const std::size_t count : copies) {
        if (options_.is_quick && count > 100) continue;
        measure(one, count);
      }
    }
    table_.publish(options_);
  }

 private:
  void measure(const Case& one, std::size_t count) {
    const tissue::Scene scene = tissue::Scene::load(one.file);
    const double before_mib = resident_mib();
    tissue::Batch batch(scene, count, 1, threads);
    const auto steps = static_cast<int>(seconds / kTick_s);
    const auto go = [&](bool is_away) {
      const double from_s = cpu_s();
      for (int k = 0; k < steps; ++k) {
        for (std::size_t i = 0; i < count; ++i) {
          place(batch.tool(i), one.over_m, i, kTick_s * k, is_away);
        }
        batch.step(kTick_s);
      }
      return (cpu_s() - from_s) / static_cast<double>(steps) / static_cast<double>(count);
    };
    const double away_s = go(true);
    const double pressed_s = go(false);
    const double after_mib = resident_mib();
    const auto time_us = [&](int times, const auto& call) {
      const double from_s = cpu_s();
      for (int i = 0; i < times; ++i) call(static_cast<std::size_t>(i) % count);
      return 1e6 * (cpu_s() - from_s) / times;
    };
    const tissue::Snapshot kept = batch.snapshot(0);
    const double snapshot_us =
        time_us(20, [&](std::size_t i) { static_cast<void>(batch.snapshot(i)); });
    const double restore_us = time_us(50, [&](std::size_t i) { batch.restore(kept, i); });
    const double reset_us = time_us(50, [&](std::size_t i) { batch.reset(i); });
    table_.add({one.name, static_cast<double>(count), 1.0 / away_s, 1.0 / pressed_s,
                after_mib - before_mib, (after_mib - before_mib) / static_cast<double>(count),
                snapshot_us, restore_us, reset_us});
  }

  /// Many steps, with a reset now and then, as of episodes.
  void keep(const Case& one) const {
    const tissue::Scene scene = tissue::Scene::load(one.file);
    tissue::Batch batch(scene, 1, 1, 1);
    const auto steps = static_cast<long>(many_steps);
    double first_mib = 0.0;
    for (long k = 0; k < steps; ++k) {
      place(batch.tool(), one.over_m, 0, kTick_s * static_cast<double>(k % 5000), false);
      batch.step(kTick_s);
      if (k % 5000 == 4999) batch.reset();
      if (k == steps / 10) first_mib = resident_mib();
    }
    std::printf("%s: %ld steps; resident %.1f MiB after a tenth, %.1f MiB at the end\n",
                one.name.c_str(), steps, first_mib, resident_mib());
  }

  const BenchOptions& options_;
  Table table_{{{"session", "session", ""},
                {"scenes", "scenes", "{:.0f}"},
                {"away_steps_per_core_s", "steps/s per core, away", "{:.0f}"},
                {"pressed_steps_per_core_s", "pressed", "{:.0f}"},
                {"mib", "MiB", "{:.0f}"},
                {"mib_per_scene", "MiB a scene", "{:.2f}"},
                {"snapshot_us", "snapshot µs", "{:.0f}"},
                {"restore_us", "restore µs", "{:.0f}"},
                {"reset_us", "reset µs", "{:.0f}"}}};
};

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"The tissue library: steps per second, memory, states. Steps of 1 ms."};
  BenchOptions options;
  Bench bench(options);
  app.add_option("--scenes", bench.copies, "How many at once (default 1 16 1000)");
  app.add_option("--threads", bench.threads, "That make the steps (default 1)");
  app.add_option("--seconds", bench.seconds, "Of each row, simulated (default 0.4)");
  app.add_option("--keep", bench.many_steps,
                 "Instead: so many steps of one scene, and the memory before and after");
  return bench::run_bench(app, options, argc, argv, [&] { bench.run(); });
}
