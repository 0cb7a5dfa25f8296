// SPDX-License-Identifier: Apache-2.0
// deadband_bench — deadbands on hops 2 and 3: messages saved against force error, for several k.
#include <spdlog/fmt/fmt.h>
#include <CLI/CLI.hpp>

#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/core/check.h"
#include "common/session/session_file.h"
#include "deploy/lockstep/loopback.h"
#include "tests/bench/bench_output.h"
#include "tests/support/machine/places.h"

namespace palpate::bench {
namespace {

const std::filesystem::path kSessions =
    std::filesystem::path(test::source_dir()) / "deploy/sessions";

struct Tissue {
  const char* label;
  const char* session;
  double seconds;
  std::vector<std::string> overrides;
};
const std::vector<std::string> kAt1kHz{"device.rate_hz=1000",
                                       "device.lease_us=2000",
                                       "physics.rate_hz=1000",
                                       "mofc.wait_for_physics_ms=0",
                                       "mofc.mode=guard",
                                       "hand.v.free_motion_s=2",
                                       "mofc.velocity_estimator={ kalman_acceleration {} }"};
const Tissue kTissues[] = {{"palpation", "default", 10.0, {}},
                           {"paper soft", "paper_soft", 4.0, kAt1kHz},
                           {"paper rigid", "paper_rigid", 4.0, kAt1kHz}};

double saved_percent(std::uint64_t suppressed, std::uint64_t all) {
  return 100.0 * static_cast<double>(suppressed) / static_cast<double>(all);
}

void run(const BenchOptions& options) {
  Table table({{"tissue", "tissue", ""},
               {"interaction", "force", ""},
               {"hops", "deadband on hops", ""},
               {"ratio", "k", "{:g}"},
               {"motions_saved_percent", "hop 2 saved %", "{:.1f}"},
               {"interactions_saved_percent", "hop 3 saved %", "{:.1f}"},
               {"transparency_percent", "transp. %", "{:.1f}"},
               {"force_error_percent", "force err. %", "{:.1f}"},
               {"path_deviation_mm", "path mm", "{:.3f}"},
               {"excess_reversals", "excess rev.", "{:.0f}"},
               {"clamped_percent", "clamped %", "{:.1f}"},
               {"stale_ticks", "stale ticks", "{:.0f}"}});
  struct Hops {
    const char* label;
    bool is_motion;
    bool is_interaction;
  };
  const Hops kHops[] = {
      {"none", false, false}, {"2", true, false}, {"3", false, true}, {"2, 3", true, true}};
  std::string data;
  // without thinning k has no effect: one run instead of four
  std::optional<Steps> steps(std::in_place, std::size(kTissues) * 2 * (1 + 3 * 4));
  for (const Tissue& tissue : kTissues) {
    for (const char* interaction : {"held", "local"}) {
      for (const Hops& hops : kHops) {
        const bool is_thinned = hops.is_motion || hops.is_interaction;
        for (const double k : {0.02, 0.05, 0.1, 0.2}) {
          std::vector<std::string> overrides = tissue.overrides;
          overrides.push_back(fmt::format("mofc.interaction={}", interaction));
          if (hops.is_motion) {
            overrides.push_back(fmt::format("mofc.motion_deadband={{ ratio: {} }}", k));
          }
          if (hops.is_interaction) {
            overrides.push_back(fmt::format("physics.interaction_deadband={{ ratio: {} }}", k));
          }
          const Session session =
              load_session(kSessions / (std::string(tissue.session) + ".txtpb"), overrides);
          const RunReport report = run_loopback(session, {.seconds = tissue.seconds});
          steps->next();
          const RunStatistics& s = report.statistics;
          const double motions = saved_percent(report.mofc.motions_suppressed, report.mofc.ticks);
          const double interactions =
              saved_percent(report.physics.interactions_suppressed, report.physics.loop.ticks);
          table.add({std::string(tissue.label), std::string(interaction), std::string(hops.label),
                     is_thinned ? k : kNaN, motions, interactions, 100.0 * s.ideal_transparency(),
                     100.0 * s.force_error_rms_ratio(), 1e3 * s.path_deviation_rms_m(),
                     static_cast<double>(s.excess_reversals()), 100.0 * s.clamp_ratio(),
                     static_cast<double>(report.mofc.stale_ticks)});
          if (hops.is_motion && hops.is_interaction) {
            if (k == 0.02)
              data += fmt::format("{}# {}, {}\n", data.empty() ? "" : "\n\n", tissue.label,
                                  interaction);
            data += fmt::format("{} {}\n", 0.5 * (motions + interactions),
                                100.0 * s.force_error_rms_ratio());
          }
          if (!is_thinned) break;
        }
      }
    }
    table.add_gap();
  }
  steps.reset();
  table.publish(options);
  std::printf(
      "\nDevice and physics 1 kHz, no network faults, floors and keep-alive as by default (0.1 mm,"
      " 2 mm/s, 0.05 N, 20 ms). Figures against the ideal force and run.\n");
  if (options.plot_folder.empty()) return;
  const std::filesystem::path folder = options.plot_folder;
  std::filesystem::create_directories(folder);
  write_file(folder / "deadband.txt", data);
  std::string plot = "plot ";
  for (std::size_t i = 0; i < 2 * std::size(kTissues); ++i) {
    plot +=
        fmt::format("{}'deadband.txt' index {} using 1:2 with linespoints lw 2 pt 7 title '{}, {}'",
                    i > 0 ? ", " : "", i, kTissues[i / 2].label, i % 2 == 0 ? "held" : "local");
  }
  draw_figure(folder, "deadband",
              R"(set terminal svg size 700,420 dynamic background rgb 'white' font 'sans,13'
set output 'deadband.svg'
set title 'Deadband on hops 2 and 3, k = 2, 5, 10, 20 %'
set grid
set xlabel 'messages saved, %'
set ylabel 'rms force error, % of the ideal'
set yrange [0:*]
set key outside right
)" + plot);
}

}  // namespace
}  // namespace palpate::bench

int main(int argc, char** argv) {
  CLI::App app("Deadbands on hops 2 and 3: messages saved against error.");
  palpate::bench::BenchOptions options;
  return palpate::bench::run_bench(app, options, argc, argv, [&] { palpate::bench::run(options); });
}
