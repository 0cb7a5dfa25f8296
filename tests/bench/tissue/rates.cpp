// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/tissue/rates.h"

#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <string>

#include "physics_node/library/palpate_tissue.hpp"
#include "tests/bench/elastic/elastic_rows.h"
#include "tests/support/machine/places.h"

namespace palpate::bench {
namespace {

constexpr double kTick_s = 1e-3;

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

std::vector<Case> cases() {
  const std::string folder = test::source_dir() + "/deploy/sessions/";
  return {{"default", folder + "default.txtpb", {0.0, 0.0, 0.003}},
          {"block_with_tumour", folder + "block_with_tumour.txtpb", {0.0, 0.0, 0.006}}};
}

void measure(const Case& one, std::size_t count, const RateOptions& options, Table& table) {
  const tissue::Scene scene = tissue::Scene::load(one.file);
  const double before_mib = resident_mib();
  tissue::Batch batch(scene, count, 1, options.threads);
  const auto steps = static_cast<int>(options.seconds / kTick_s);
  const auto go = [&](bool is_away) {
    const double from_s = process_cpu_s();
    for (int k = 0; k < steps; ++k) {
      for (std::size_t i = 0; i < count; ++i) {
        place(batch.tool(i), one.over_m, i, kTick_s * k, is_away);
      }
      batch.step(kTick_s);
    }
    return (process_cpu_s() - from_s) / static_cast<double>(steps) / static_cast<double>(count);
  };
  const double away_s = go(true);
  const double pressed_s = go(false);
  const double after_mib = resident_mib();
  const auto time_us = [&](int times, const auto& call) {
    const double from_s = process_cpu_s();
    for (int i = 0; i < times; ++i) call(static_cast<std::size_t>(i) % count);
    return 1e6 * (process_cpu_s() - from_s) / times;
  };
  const tissue::Snapshot kept = batch.snapshot(0);
  const double snapshot_us =
      time_us(20, [&](std::size_t i) { static_cast<void>(batch.snapshot(i)); });
  const double restore_us = time_us(50, [&](std::size_t i) { batch.restore(kept, i); });
  const double reset_us = time_us(50, [&](std::size_t i) { batch.reset(i); });
  table.add({one.name, static_cast<double>(count), 1.0 / away_s, 1.0 / pressed_s,
             after_mib - before_mib, (after_mib - before_mib) / static_cast<double>(count),
             snapshot_us, restore_us, reset_us});
}

/// Many steps, with a reset now and then, as of episodes.
void keep(const Case& one, double many_steps) {
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

}  // namespace

Table rates(const RateOptions& options, bool is_quick) {
  Table table({{"session", "session", ""},
               {"scenes", "scenes", "{:.0f}"},
               {"away_steps_per_core_s", "steps/s per core, away", "{:.0f}"},
               {"pressed_steps_per_core_s", "pressed", "{:.0f}"},
               {"mib", "MiB", "{:.0f}"},
               {"mib_per_scene", "MiB a scene", "{:.2f}"},
               {"snapshot_us", "snapshot µs", "{:.0f}"},
               {"restore_us", "restore µs", "{:.0f}"},
               {"reset_us", "reset µs", "{:.0f}"}});
  for (const Case& one : cases()) {
    for (const std::size_t count : options.copies) {
      if (is_quick && count > 100) continue;
      measure(one, count, options, table);
    }
  }
  return table;
}

void keep_memory(const RateOptions& options) {
  for (const Case& one : cases()) keep(one, options.many_steps);
}

}  // namespace palpate::bench
