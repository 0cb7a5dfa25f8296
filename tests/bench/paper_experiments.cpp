// SPDX-License-Identifier: Apache-2.0
// paper_experiments — the experiments of the paper in lockstep: soft, rigid and mixed tissue, with
// and without the controller, after different lengths of free motion, beside the figures that the
// paper prints. The sessions are those of deploy/sessions, so that `palpate loopback` repeats each
// row.
#include <spdlog/fmt/fmt.h>
#include <CLI/CLI.hpp>

#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "common/session/session_file.h"
#include "common/telemetry/summary.h"
#include "deploy/lockstep/loopback.h"
#include "tests/bench/bench_output.h"
#include "tests/bench/paper/paper_fit.h"
#include "tests/support/machine/places.h"

namespace palpate::bench {
namespace {

const std::filesystem::path kSessions =
    std::filesystem::path(test::source_dir()) / "deploy/sessions";

struct Controller {
  const char* label;
  std::vector<std::string> overrides;
};
const Controller kNone{"none", {"mofc.controller=none"}};
const Controller kPaper{"paper", {"mofc.mode=paper"}};
const Controller kPaperIsotropic{
    "paper/√3", {"mofc.mode=paper", "mofc.paper_settings={ friction: isotropic }"}};
const Controller kVector{"vector", {"mofc.mode=vector"}};
const Controller kGuard{"guard", {"mofc.mode=guard"}};

struct Tissue {
  const char* label;
  const char* session;
  int parts;
  const char* printed;  ///< transparency x / y / z in the paper, with the controller
};
const Tissue kTissues[] = {{"soft", "paper_soft", 1, "100 / 100 / 100 %"},
                           {"rigid", "paper_rigid", 1, "71.59 / 79.21 / 73.4 %"},
                           {"mixed", "paper_mixed", 2, "not printed"}};

/// Time for the V after the free motion, and for the hand to come to rest.
constexpr double kVSeconds = 3.0;

Session session_of(const Tissue& tissue, const Controller& controller, double free_s,
                   bool is_two_way, const std::vector<std::string>& more = {}) {
  std::vector<std::string> overrides = controller.overrides;
  overrides.push_back(fmt::format("hand.v.free_motion_s={}", free_s));
  for (int i = 0; i < tissue.parts; ++i) {
    overrides.push_back(fmt::format("scene.tissue[{}].kelvin_voigt.adhesive={}", i, is_two_way));
  }
  overrides.insert(overrides.end(), more.begin(), more.end());
  return load_session(kSessions / (std::string(tissue.session) + ".txtpb"), overrides);
}

Table::Cell percent(double ratio) { return 100.0 * ratio; }

void add_row(Table& table, const std::string& tissue, const std::string& damper,
             const Controller& controller, double free_s, const RunReport& report,
             const std::string& printed) {
  const RunStatistics& s = report.statistics;
  const Vector3 transparency = s.transparency();
  table.add({tissue, damper, std::string(controller.label), free_s, percent(transparency.x()),
             percent(transparency.y()), percent(transparency.z()), percent(s.vector_transparency()),
             percent(s.clamp_ratio()), static_cast<double>(s.excess_reversals()),
             s.maximum_force_newton(), 1e6 * s.minimum_true_energy_joule(), printed});
}

Table make_table() {
  return Table({{"tissue", "tissue", ""},
                {"damper", "damper", ""},
                {"controller", "MOFC", ""},
                {"t_free_s", "t_free s", "{:g}"},
                {"transparency_x_percent", "x %", "{:.1f}"},
                {"transparency_y_percent", "y %", "{:.1f}"},
                {"transparency_z_percent", "z %", "{:.1f}"},
                {"transparency_vector_percent", "vector %", "{:.1f}"},
                {"clamped_percent", "clamped %", "{:.1f}"},
                {"excess_reversals", "excess rev.", "{:.0f}"},
                {"max_force_n", "peak N", "{:.2f}"},
                {"min_true_energy_uj", "min energy µJ", "{:.1f}"},
                {"paper_transparency", "paper x / y / z", ""}});
}

/// Soft, rigid, mixed × damper that also pulls or only pushes × controller × length of free motion.
/// The excerpt is what docs/benchmarks.md shows: the sessions as shipped.
void add_experiments(Table& table, bool is_excerpt) {
  using Dampers = std::vector<bool>;
  using Controllers = std::vector<const Controller*>;
  using Seconds = std::vector<double>;
  const Dampers dampers = is_excerpt ? Dampers{true} : Dampers{true, false};
  const Controllers controllers =
      is_excerpt ? Controllers{&kNone, &kPaper, &kVector, &kGuard}
                 : Controllers{&kNone, &kPaper, &kPaperIsotropic, &kVector, &kGuard};
  const Seconds free_motions_s = is_excerpt ? Seconds{14.0} : Seconds{0.0, 2.0, 14.0, 40.0};
  Steps steps(std::size(kTissues) * dampers.size() * controllers.size() * free_motions_s.size());
  for (const Tissue& tissue : kTissues) {
    for (const bool is_two_way : dampers) {
      for (const Controller* controller : controllers) {
        for (const double free_s : free_motions_s) {
          const Session session = session_of(tissue, *controller, free_s, is_two_way);
          const RunReport report = run_loopback(session, {.seconds = free_s + kVSeconds});
          steps.next();
          const bool is_papers = controller == &kPaper && is_two_way && free_s == 14.0;
          add_row(table, tissue.label, is_two_way ? "two-way" : "one-way", *controller, free_s,
                  report, is_papers ? tissue.printed : "");
        }
      }
    }
    table.add_gap();
  }
}

/// The guarantee of the paper holds for one axis and exact positions: a V straight down and up.
void add_one_axis(Table& table) {
  const std::vector<std::string> exact{"hand.v.half_width_m=0",
                                       "device.simulated.position_resolution_m=0",
                                       "device.profile.position_resolution_m=0"};
  for (const Controller* controller : {&kNone, &kPaper, &kPaperIsotropic, &kVector, &kGuard}) {
    const Session session = session_of(kTissues[1], *controller, 0.0, true, exact);
    add_row(table, "rigid, one axis, exact positions", "two-way", *controller, 0.0,
            run_loopback(session, {.seconds = kVSeconds}), "");
  }
  table.add_gap();
}

/// A hand that extracts energy at the surface of the rigid tissue, on three axes, with a firm grip:
/// the worst of `seeds` runs.
void add_hostile(Table& table, int seeds, bool is_excerpt) {
  const std::vector<std::string> hostile{"hand.hostile={radius_m: 0.02}",
                                         "hand.stiffness_newton_per_m=2000",
                                         "hand.damping_newton_s_per_m=40"};
  struct Row {
    const char* label;
    std::vector<std::string> overrides;
  };
  const Row rows[] = {
      {"rigid, hostile hand, exact positions",
       {"device.simulated.position_resolution_m=0", "device.profile.position_resolution_m=0"}},
      {"rigid, hostile hand, 0.055 mm", {}}};
  for (const Row& row : rows) {
    if (is_excerpt && &row == &rows[0]) continue;
    for (const Controller* controller : {&kNone, &kPaper, &kPaperIsotropic, &kVector, &kGuard}) {
      if (is_excerpt && controller == &kPaperIsotropic) continue;
      RunReport worst;
      for (int seed = 1; seed <= seeds; ++seed) {
        std::vector<std::string> overrides = controller->overrides;
        overrides.insert(overrides.end(), hostile.begin(), hostile.end());
        overrides.insert(overrides.end(), row.overrides.begin(), row.overrides.end());
        overrides.push_back(fmt::format("seed={}", seed));
        const Session session = load_session(kSessions / "paper_rigid.txtpb", overrides);
        const RunReport report = run_loopback(session, {.seconds = 10.0});
        if (seed == 1 || report.statistics.minimum_true_energy_joule() <
                             worst.statistics.minimum_true_energy_joule()) {
          worst = report;
        }
      }
      add_row(table, row.label, "two-way", *controller, 0.0, worst, "");
    }
  }
}

/// Figures 6 to 10 of the paper: position, requested force and rendered force against time.
struct Figure {
  const char* file;
  const char* title;
  const Tissue& tissue;
  const Controller& controller;
};

/// Figures 8 and 9 on one axis: what the controller is for.
void draw_comparison(const std::filesystem::path& folder) {
  draw_figure(folder, "rigid_compared", R"(set datafile separator ','
set terminal svg size 900,520 dynamic background rgb 'white' font 'sans,13'
set output 'rigid_compared.svg'
without = 'figure_08_rigid_without.csv'
with = 'figure_09_rigid_with.csv'
set multiplot layout 2,1 title 'Poking rigid tissue (45 N/m, 150 N·s/m) at 50 Hz along a V'
set xrange [14.3:15.4]
set lmargin 9
set rmargin 24
set grid
set key outside right
set ylabel 'depth z, mm'
plot without using 't_s':(1e3*column('z_m')) with lines lw 2 lc rgb '#c0392b' title 'without MOFC', \
     with using 't_s':(1e3*column('z_m')) with lines lw 2 lc rgb '#1f618d' title 'with MOFC'
set ylabel 'force on the hand, N'
set xlabel 'time, s'
plot without using 't_s':'fs_z' with steps lw 2 lc rgb '#c0392b' title 'without MOFC', \
     with using 't_s':'fs_z' with steps lw 2 lc rgb '#1f618d' title 'with MOFC'
unset multiplot
)");
}

void draw_figures(const BenchOptions& options) {
  const Figure figures[] = {
      {"figure_06_soft_without", "Soft tissue, without MOFC", kTissues[0], kNone},
      {"figure_07_soft_with", "Soft tissue, with MOFC", kTissues[0], kPaper},
      {"figure_08_rigid_without", "Rigid tissue, without MOFC", kTissues[1], kNone},
      {"figure_09_rigid_with", "Rigid tissue, with MOFC", kTissues[1], kPaper},
      {"figure_10_mixed_with", "Soft, then rigid tissue, with MOFC", kTissues[2], kPaper}};
  const std::filesystem::path folder = options.plot_folder;
  std::filesystem::create_directories(folder);
  for (const Figure& figure : figures) {
    const std::string name = figure.file;
    const Session session = session_of(figure.tissue, figure.controller, 14.0, true);
    static_cast<void>(run_loopback(session, {.seconds = 14.0 + kVSeconds,
                                             .csv_file = (folder / (name + ".csv")).string(),
                                             .may_overwrite = true}));
    // only the V, not the free motion before it
    draw_figure(folder, name,
                fmt::format(R"(set datafile separator ','
set terminal svg size 900,640 dynamic background rgb 'white' font 'sans,13'
set output '{0}.svg'
set multiplot layout 2,1 title '{1}'
set xrange [14.2:15.8]
set lmargin 9
set rmargin 22
set grid
set key outside right
set ylabel 'position, mm'
plot '{0}.csv' using 't_s':(1e3*column('x_m')) with lines lw 2 title 'x', \
     '' using 't_s':(1e3*column('y_m')) with lines lw 2 title 'y', \
     '' using 't_s':(1e3*column('z_m')) with lines lw 2 title 'z'
set ylabel 'force on the hand, N'
set xlabel 'time, s'
plot '{0}.csv' using 't_s':'fe_x' with steps lw 1 dt 2 lc 1 title 'x requested', \
     '' using 't_s':'fe_y' with steps lw 1 dt 2 lc 2 title 'y requested', \
     '' using 't_s':'fe_z' with steps lw 1 dt 2 lc 3 title 'z requested', \
     '' using 't_s':'fs_x' with steps lw 2 lc 1 title 'x rendered', \
     '' using 't_s':'fs_y' with steps lw 2 lc 2 title 'y rendered', \
     '' using 't_s':'fs_z' with steps lw 2 lc 3 title 'z rendered'
unset multiplot
)",
                            name, figure.title));
  }
  draw_comparison(folder);
}

struct PaperOptions {
  BenchOptions bench;
  bool is_excerpt = false;
  bool is_fit = false;
};

void run(const PaperOptions& options) {
  const int seeds = options.bench.is_quick || options.is_excerpt ? 5 : 20;
  Table table = make_table();
  add_experiments(table, options.is_excerpt);
  if (!options.is_excerpt) add_one_axis(table);
  add_hostile(table, seeds, options.is_excerpt);
  table.publish(options.bench);
  std::printf(
      "\nTransparency: rendered force / requested force, eqs. (15)-(18), per axis, over samples "
      "with "
      "more than 0.05 N requested."
      "\nExcess reversals: direction changes > 0.5 mm beyond those of the continuous-time ideal "
      "run, "
      "all axes."
      "\nMin energy: least true energy at the device's port over all inner steps; the controller "
      "never receives it."
      "\nHostile rows: the worst of %d seeds, 10 s each.\n",
      seeds);
  if (!options.bench.plot_folder.empty()) draw_figures(options.bench);
}

}  // namespace
}  // namespace palpate::bench

int main(int argc, char** argv) {
  CLI::App app("The experiments of the paper, in lockstep, beside the figures that it prints.");
  palpate::bench::PaperOptions options;
  app.add_flag("--excerpt", options.is_excerpt,
               "only the rows of docs/benchmarks.md: the sessions as shipped, and a hostile hand");
  app.add_flag("--fit", options.is_fit,
               "instead: parameters that the paper does not state, chosen so that all its "
               "statements hold, and how much each matters (--quick: the statements)")
      ->excludes("--excerpt");
  return palpate::bench::run_bench(app, options.bench, argc, argv, [&] {
    options.is_fit ? palpate::bench::run_paper_fit(options.bench) : palpate::bench::run(options);
  });
}
