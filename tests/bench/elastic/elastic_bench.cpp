// SPDX-License-Identifier: Apache-2.0
// elastic_bench: elastic bodies, run time against error. A beam of 0.1 × 0.025 × 0.025 m clamped at
// one end (E 100 kPa, ν 0.45, 1,000 kg/m³), and a block of 0.1 × 0.1 × 0.05 m (E 10 kPa, ν 0.45)
// into which a sphere of 5 mm radius is pressed. Ours, and Bullet's where it is installed, are
// measured in this run, one thread; those of other programs were recorded (recorded_peers.h).
#include <spdlog/fmt/fmt.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <iterator>
#include <map>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "physics_node/elastic/condensed/condensed_contact.h"
#include "physics_node/elastic/dynamics.h"
#include "tests/bench/bench_output.h"
#ifdef PALPATE_HAS_BULLET
#include "tests/bench/elastic/bullet_rows.h"
#endif
#include "tests/bench/elastic/elastic_problems.h"
#include "tests/bench/elastic/elastic_rows.h"
#include "tests/bench/elastic/recorded_peers.h"

namespace {

using namespace palpate;
using namespace palpate::elastic;
using bench::BeamSize;
using bench::BenchOptions;
using bench::cpu_s;
using bench::PeakMemory;
using bench::PeerRow;
using bench::Row;
using bench::Samples;
using bench::Table;
using bench::wall_s;

const char* source_of(const Row& row) { return row.is_recorded ? "recorded" : "measured"; }

// The beam is let go and steps of 1 ms are taken in real-time mode; after it a run that converges
// every step. One after the other, as Bullet by itself: two runs in turn would take the caches from
// each other.
void step_rows(const BeamSize& size, int steps, std::vector<Row>& rows) {
  const PeakMemory memory;
  const Body body(
      bench::hanging_beam(beam_mesh(size.along, size.across), Law::kCorotational, 100e3, 0.45));
  const Eigen::Index tip = bench::tip_of(body.mesh());
  Dynamics fast(body, {.theta = 1.0, .most_iterations = 2, .is_exact = false});
  Samples wall;
  Samples cpu;
  std::vector<double> fast_m;
  for (int i = 0; i < steps; ++i) {
    const double from_wall = wall_s();
    const double from_cpu = cpu_s();
    fast.step(1e-3);
    cpu.values.push_back(1e6 * (cpu_s() - from_cpu));
    wall.values.push_back(1e6 * (wall_s() - from_wall));
    fast_m.push_back(fast.x_m()[tip]);
  }
  const double peak_mb = memory.megabytes();
  Dynamics converged(body, {.theta = 1.0, .tolerance_m = 1e-9});
  std::vector<double> converged_m;
  double error_m = 0.0;
  double way_m = 0.0;
  for (const double tip_m : fast_m) {
    converged.step(1e-3);
    converged_m.push_back(converged.x_m()[tip]);
    error_m = std::max(error_m, std::abs(tip_m - converged_m.back()));
    way_m = std::max(way_m, std::abs(converged_m.back() - body.rest_m()[tip]));
  }
  rows.push_back({.figures = {.problem = "step 1 ms",
                              .mesh = size.name,
                              .solver = "palpate",
                              .median_us = wall.at(0.5),
                              .p99_us = wall.at(0.99),
                              .error_ratio = error_m / way_m},
                  .cpu_median_us = cpu.at(0.5),
                  .cpu_p99_us = cpu.at(0.99),
                  .peak_mb = peak_mb});
#ifdef PALPATE_HAS_BULLET
  // fewer: a fifth of a second each at 54,880 elements
  converged_m.resize(std::min<std::size_t>(converged_m.size(), size.along > 32 ? 100 : 300));
  rows.push_back(bench::bullet_step_row(size, body, converged_m));
#endif
}

// How far the tip sags at rest [m]: 27-node hexahedra, converged.
double reference_m(Law law) { return law == Law::kCorotational ? 23.19e-3 : 23.24e-3; }

Row static_row(const char* name, const char* solver, const Mesh& mesh, Law law) {
  Samples total;
  double error_ratio = NAN;
  const PeakMemory memory;
  // short ones again for the median
  for (double spent_s = 0.0; spent_s < 0.5 && total.values.size() < 5;) {
    const double from_s = cpu_s();
    const Body body(bench::hanging_beam(mesh, law, 100e3, 0.45));
    EquilibriumSearch search(body);
    WarpedFactor factor(body, Precision::kDouble);
    VectorXd x = body.rest_m();
    const SearchReport report =
        find_rest(search, factor, nullptr, {.tolerance_m = 1e-6, .slow_iterations = 8}, x);
    total.values.push_back(cpu_s() - from_s);
    spent_s += total.values.back();
    const Eigen::Index tip = bench::tip_of(mesh);
    error_ratio =
        report.is_converged ? (body.rest_m()[tip] - x[tip]) / reference_m(law) - 1.0 : NAN;
  }
  return {.figures = {.problem = "static",
                      .mesh = name,
                      .solver = solver,
                      .total_s = total.at(0.5),
                      .error_ratio = error_ratio},
          .peak_mb = memory.megabytes()};
}

void static_rows(const BenchOptions& options, std::vector<Row>& rows) {
  const auto linear = [&](const BeamSize& size) {
    const Mesh mesh = beam_mesh(size.along, size.across);
    rows.push_back(static_row(size.name, "palpate, linear", mesh, Law::kCorotational));
#ifdef PALPATE_HAS_BULLET
    for (const Law law : {Law::kCorotational, Law::kStableNeoHookean}) {
      if (law == Law::kStableNeoHookean && size.along > 32) continue;  // a minute
      const Body body(bench::hanging_beam(mesh, law, 100e3, 0.45));
      rows.push_back(bench::bullet_static_row(size, body, reference_m(law)));
    }
#endif
  };
  linear({"160 tets", 8, 2});
  for (const BeamSize& size : bench::kBeams) {
    if (!options.is_quick || size.along <= 32) linear(size);
  }
  for (const BeamSize& size : {BeamSize{"393 nodes", 8, 2}, BeamSize{"2,417 nodes", 16, 4},
                               BeamSize{"7,417 nodes", 24, 6}}) {
    const Mesh mesh = quadratic(beam_mesh(size.along, size.across));
    rows.push_back(static_row(size.name, "palpate, quadratic", mesh, Law::kCorotational));
    rows.push_back(static_row(size.name, "palpate NH, quadratic", mesh, Law::kStableNeoHookean));
  }
}

// First minimum and first return of the tip of a beam that is let go, by parabolas through samples.
struct Swing {
  double amplitude_m = 0.0;
  double period_s = 0.0;
};
Swing swing(const Body& body, double dt_s, const DynamicsSettings& settings) {
  Dynamics dynamics(body, settings);
  const Eigen::Index tip = bench::tip_of(body.mesh());
  std::vector<double> z = {0.0};
  for (double t = 0.0; t < 0.3; t += dt_s) {
    dynamics.step(dt_s);
    z.push_back(dynamics.x_m()[tip] - body.rest_m()[tip]);
  }
  const auto peak = [&](double from_s, double to_s, double sign) {
    auto best = static_cast<std::size_t>(from_s / dt_s);
    for (std::size_t i = best; static_cast<double>(i) * dt_s < to_s; ++i) {
      if (sign * z[i] > sign * z[best]) best = i;
    }
    const double bend = z[best - 1] - 2.0 * z[best] + z[best + 1];
    const double slope = z[best - 1] - z[best + 1];
    return std::pair((static_cast<double>(best) + 0.5 * slope / bend) * dt_s,
                     z[best] - 0.125 * slope * slope / bend);
  };
  const auto low = peak(0.06, 0.17, -1.0);
  const auto high = peak(0.18, 0.28, 1.0);
  return {.amplitude_m = high.second - low.second, .period_s = high.first};
}

void released_rows(std::vector<Row>& rows) {
  const Body body(bench::hanging_beam(beam_mesh(16, 4), Law::kCorotational, 100e3, 0.45));
  const Swing reference = swing(body, 0.25e-3, {.theta = 0.5, .tolerance_m = 1e-9});
  struct Case {
    const char* name;
    DynamicsSettings settings;
  };
  for (const Case& one : {Case{"palpate, theta 0.51", {.tolerance_m = 1e-7}},
                          Case{"palpate, step control", {.tolerance_m = 1e-7, .accuracy_m = 3e-7}},
                          Case{"palpate, backward Euler", {.theta = 1.0, .tolerance_m = 1e-7}}}) {
    const Swing found = swing(body, 5e-3, one.settings);
    rows.push_back({.figures = {.problem = "released 5 ms",
                                .mesh = "1,280 tets",
                                .solver = one.name,
                                .error_ratio = found.period_s / reference.period_s - 1.0,
                                .kept_ratio = found.amplitude_m / reference.amplitude_m}});
  }
  std::printf("released beam, 1,280 tets, dt 0.25 ms: return after %.5f s\n", reference.period_s);
}

// A sphere pressed into a block: the force where the body rests, at three depths.
void press_rows(const BenchOptions& options, std::vector<Row>& rows) {
  const PeakMemory memory;
  const Body body(
      bench::standing_block(quadratic(bench::nested_block(2, 0.003, 6)), Law::kStableNeoHookean));
  SphereContact contact(bench::top_points(body.mesh(), 0.015, 6), 4e8);
  EquilibriumSearch search(body);
  WarpedFactor factor(body, Precision::kDouble);
  VectorXd x = body.rest_m();
  const double from_cpu = cpu_s();
  const double step_m = 0.5e-3;
  const int steps = options.is_quick ? 6 : 20;
  for (int i = 1; i <= steps; ++i) {
    contact.set_sphere({0.05, 0.05, 0.055 - i * step_m}, 0.005);
    for (int round = 0; round < 3; ++round) {
      static_cast<void>(
          find_rest(search, factor, &contact, {.tolerance_m = 1e-6, .most_iterations = 60}, x));
      contact.update_multipliers(x.data(), body.pattern());
    }
    const double force = contact.force_on_sphere_newton().z();
    for (const auto& [at, newton, name] : {std::tuple{2, 37.7e-3, "press 1 mm"},
                                           {6, 189.4e-3, "press 3 mm"},
                                           {20, 859e-3, "press 10 mm"}}) {
      if (i != at) continue;
      std::printf("%s: %.1f mN on %zu points, %zu nodes, %.1f s of CPU time so far\n", name,
                  1e3 * force, contact.touching(), body.node_count(), cpu_s() - from_cpu);
      rows.push_back({.figures = {.problem = name,
                                  .mesh = "2,593 nodes",
                                  .solver = "palpate NH, quadratic",
                                  .total_s = cpu_s() - from_cpu,
                                  .error_ratio = force / newton - 1.0},
                      .peak_mb = memory.megabytes()});
    }
  }
}

// The sphere goes in at 10 mm/s in steps of 1 ms. The whole body is looked at every 20 ms, and what
// that tells arrives 20 ms later. Beside it the full contact solution with all points of the
// surface, and the condensed contact that only knows the undeformed body.
void condensed_rows(const BenchOptions& options, std::vector<Row>& rows) {
  const Body body(bench::standing_block(
      options.is_quick ? block_mesh(8, 10, 0.8e-3) : block_mesh(14, 14, 0.8e-3),
      Law::kStableNeoHookean));
  const std::vector<SurfacePoint> points = bench::top_points(body.mesh(), 0.006, 1);
  std::vector<std::uint32_t> surface;
  {
    std::vector<bool> is_surface(body.node_count(), false);
    for (const Face& face : surface_of(body.mesh())) {
      for (std::size_t k = 0; k < 3; ++k) is_surface[face.nodes[k]] = true;
    }
    for (std::uint32_t i = 0; i < is_surface.size(); ++i) {
      if (is_surface[i]) surface.push_back(i);
    }
    const Vector3d middle(0.05, 0.05, 0.05);
    std::sort(surface.begin(), surface.end(), [&](std::uint32_t a, std::uint32_t b) {
      return (body.mesh().nodes_m[a] - middle).norm() < (body.mesh().nodes_m[b] - middle).norm();
    });
    surface.resize(std::min<std::size_t>(surface.size(), 2000));
  }
  const auto sphere_at = [](double depth_m) { return Vector3d(0.05, 0.05, 0.055 - depth_m); };
  constexpr int kSteps = 200;  // of 10 µm
  constexpr int kCompared = 10;
  std::vector<double> full_newton;
  {
    SphereContact contact(points, 4e8);
    EquilibriumSearch search(body);
    WarpedFactor factor(body, Precision::kDouble);
    VectorXd x = body.rest_m();
    for (int i = kCompared; i <= kSteps; i += kCompared) {
      contact.set_sphere(sphere_at(1e-5 * i), 0.005);
      for (int round = 0; round < 4; ++round) {
        static_cast<void>(find_rest(search, factor, &contact, {.tolerance_m = 1e-7}, x));
        contact.update_multipliers(x.data(), body.pattern());
      }
      full_newton.push_back(contact.force_on_sphere_newton().z());
    }
  }
  const PeakMemory memory;
  const double from_s = cpu_s();
  WarpedFactor factor(body, Precision::kFloat);
  SurfaceCompliance compliance(body, factor, surface);
  CondensedContact condensed(compliance, 0.0, CondensedContact::kStiffness_pa_per_m, true);
  condensed.prepare(points, body.rest_m(), {}, sphere_at(0.0), 30);
  const double prepare_s = cpu_s() - from_s;
  std::vector<float> moved(condensed.surface_size());
  Samples wall;
  Samples cpu;
  double worst_ratio = 0.0;  // down to 1 mm
  double end_ratio = NAN;
  int most_touching = 0;
  for (int i = 1; i <= kSteps; ++i) {
    CondensedReport report;
    // some more for the percentiles; the same sphere again changes little
    for (int again = 0; again < 5; ++again) {
      const double start_wall = wall_s();
      const double start_cpu = cpu_s();
      const CondensedReport now = condensed.step(sphere_at(1e-5 * i), 0.005, 40, 1e-8);
      condensed.move_surface(moved.data());
      cpu.values.push_back(1e6 * (cpu_s() - start_cpu));
      wall.values.push_back(1e6 * (wall_s() - start_wall));
      if (again == 0) report = now;
    }
    most_touching = std::max(most_touching, report.touching);
    if (i % kCompared != 0) continue;
    const double full = full_newton[static_cast<std::size_t>(i / kCompared - 1)];
    end_ratio = report.force_on_sphere_newton.z() / full - 1.0;
    if (i <= 100) worst_ratio = std::max(worst_ratio, std::abs(end_ratio));
  }
  std::printf(
      "condensed, from the undeformed body: %d points, up to %d touch, %zu surface nodes, prepared"
      " in %.2f s of CPU time; error at most %.2f %% down to 1 mm, %+.2f %% at 2 mm\n",
      condensed.point_count(), most_touching, surface.size(), prepare_s, 1e2 * worst_ratio,
      1e2 * end_ratio);
  rows.push_back({.figures = {.problem = "condensed to 1 mm",
                              .mesh = options.is_quick ? "12,800 tets" : "54,880 tets",
                              .solver = "palpate, from the undeformed body",
                              .median_us = wall.at(0.5),
                              .p99_us = wall.at(0.99),
                              .error_ratio = worst_ratio},
                  .cpu_median_us = cpu.at(0.5),
                  .cpu_p99_us = cpu.at(0.99),
                  .peak_mb = memory.megabytes()});
}

// Error of the static tip against the time to it: a line over the meshes of each solver of this
// run, points for recorded ones. What the reference cannot tell apart is drawn at its uncertainty.
void draw_work_precision(const std::filesystem::path& folder, const std::vector<Row>& rows) {
  std::filesystem::create_directories(folder);
  constexpr double kUncertainty_percent = 0.09;
  std::map<std::pair<bool, std::string>, std::string> series;  // by origin and solver: points
  for (const Row& row : rows) {
    const PeerRow& figures = row.figures;
    if (std::string_view(figures.problem) != "static" || !std::isfinite(figures.error_ratio)) {
      continue;
    }
    series[{row.is_recorded, figures.solver}] +=
        fmt::format("{:g} {:g}\n", figures.total_s,
                    std::max(kUncertainty_percent, 100.0 * std::abs(figures.error_ratio)));
  }
  constexpr const char* kColours[] = {"#7d3c98", "#1e8449", "#2e86c1", "#d68910", "#922b21"};
  std::string points;
  std::string plots;
  int index = 0;
  int recorded = 0;  // of them
  for (const auto& [key, text] : series) {
    const auto& [is_recorded, solver] = key;
    points += text + "\n\n";
    plots += fmt::format(
        ", \\\n $points index {} {} title '{}{}'", index,
        is_recorded ? fmt::format("with points pt {} lc rgb '#444444'", 2 * recorded + 4)
                    : fmt::format("with linespoints pt 7 ps 0.6 lw 1.5 lc rgb '{}'",
                                  kColours[static_cast<std::size_t>(index) % std::size(kColours)]),
        solver, is_recorded ? ", recorded" : "");
    ++index;
    recorded += is_recorded ? 1 : 0;
  }
  bench::draw_figure(folder, "elastic_work_precision",
                     fmt::format(R"($points << END
{}END
set terminal svg size 1000,520 dynamic background rgb 'white' font 'sans,11'
set output 'elastic_work_precision.svg'
set title 'Beam at rest under its weight, E 100 kPa, ν 0.45: down and to the left is better'
set logscale xy
set yrange [0.05:100]
set grid
set key outside right Left reverse
set xlabel 'CPU time to the answer, s'
set ylabel 'error of the tip, %'
plot {} with lines dt 3 lw 1.5 lc rgb '#888888' title 'uncertainty of the reference'{}
)",
                                 points, kUncertainty_percent, plots));
}

void run(const BenchOptions& options) {
  std::vector<Row> rows;
  for (const BeamSize& size : bench::kBeams) {
    if (options.is_quick && size.along > 32) continue;
    step_rows(size, options.is_quick || size.along > 32 ? 300 : 1000, rows);
  }
  static_rows(options, rows);
#ifndef PALPATE_HAS_BULLET
  std::printf("no Bullet beside ours: libbullet-dev was not installed when this was built\n");
#endif
  released_rows(rows);
  press_rows(options, rows);
  condensed_rows(options, rows);
  for (const PeerRow& peer : bench::kPeers) rows.push_back({.figures = peer, .is_recorded = true});
  std::stable_sort(rows.begin(), rows.end(), [](const Row& a, const Row& b) {
    return std::string_view(a.figures.problem) < std::string_view(b.figures.problem);
  });

  Table table({{"problem", "problem", ""},
               {"mesh", "mesh", ""},
               {"solver", "solver", ""},
               {"source", "source", ""},
               {"median_us", "step [us]", "{:.0f}"},
               {"p99_us", "p99 [us]", "{:.0f}"},
               {"cpu_median_us", "CPU [us]", "{:.0f}"},
               {"cpu_p99_us", "CPU p99 [us]", "{:.0f}"},
               {"total_s", "total CPU [s]", "{:.3g}"},
               {"error_ratio", "error", "{:+.4f}"},
               {"kept_ratio", "kept", "{:.3f}"},
               {"peak_mb", "peak [MB]", "{:.1f}"}});
  const char* last = "";
  for (const Row& row : rows) {
    if (std::string_view(last) != row.figures.problem && *last != 0) table.add_gap();
    last = row.figures.problem;
    table.add({row.figures.problem, row.figures.mesh, row.figures.solver, source_of(row),
               row.figures.median_us, row.figures.p99_us, row.cpu_median_us, row.cpu_p99_us,
               row.figures.total_s, row.figures.error_ratio, row.figures.kept_ratio, row.peak_mb});
  }
  table.publish(options);
  std::printf("%s\n", bench::machine_load().c_str());
  if (!options.plot_folder.empty()) draw_work_precision(options.plot_folder, rows);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Elastic bodies: run time against error, beside Bullet where it is installed and other "
      "programs' recorded figures.",
      "elastic_bench");
  BenchOptions options;
  return bench::run_bench(app, options, argc, argv, [&] { run(options); });
}
