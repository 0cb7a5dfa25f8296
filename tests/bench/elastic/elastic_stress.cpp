// SPDX-License-Identifier: Apache-2.0
// elastic_stress: elastic bodies far from comfort. A map over stiffness, step, law and mesh: the
// beam of elastic_bench gets its weight at once and must come to rest, within 1 % of the static
// answer of the same mesh. Then single cases: nearly incompressible, flat elements, started inside
// out or scrambled, a sphere that appears within the body or hits it at 1 m/s.
#include <spdlog/fmt/fmt.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "physics_node/elastic/dynamics.h"
#include "tests/bench/bench_output.h"
#include "tests/bench/elastic/acting_hands.h"
#include "tests/bench/elastic/elastic_problems.h"

namespace {

using namespace palpate;
using namespace palpate::elastic;
using bench::BenchOptions;
using bench::Table;

constexpr Law kLaws[] = {Law::kCorotational, Law::kStVenantKirchhoff, Law::kStableNeoHookean};

constexpr const char* kElements[] = {"160 linear", "160 quadratic"};

const char* name_of(Law law) {
  if (law == Law::kCorotational) return "corotational";
  return law == Law::kStVenantKirchhoff ? "StVK" : "neo-Hookean";
}

struct Outcome {
  bool is_finite = true;
  double error_ratio = NAN;
  double worst_residual_ratio = 0.0;
  double unconverged_ratio = 0.0;
};

// The damping is critical for the first bending mode: 26 rad/s at 100 kPa.
double critical_damping_per_s(double young_modulus_pa) {
  return 2.0 * 26.0 * std::sqrt(young_modulus_pa / 100e3);
}

double static_way_m(const Body& body) {
  EquilibriumSearch search(body);
  WarpedFactor factor(body, Precision::kDouble);
  VectorXd x = body.rest_m();
  const SearchReport report =
      find_rest(search, factor, nullptr, {.tolerance_m = 1e-7, .most_iterations = 1000}, x);
  const Eigen::Index tip = bench::tip_of(body.mesh());
  return report.is_converged ? x[tip] - body.rest_m()[tip] : NAN;
}

Outcome come_to_rest(const Body& body, const VectorXd& start_m, double dt_s, double end_s,
                     double wanted_m) {
  Dynamics dynamics(body, {.theta = 1.0});
  dynamics.set_state(start_m, VectorXd::Zero(start_m.size()));
  Outcome outcome;
  const int steps = static_cast<int>(std::ceil(end_s / dt_s));
  for (int i = 0; i < steps; ++i) {
    const StepReport report = dynamics.step(dt_s);
    outcome.is_finite = outcome.is_finite && report.search.is_finite && dynamics.x_m().allFinite();
    outcome.worst_residual_ratio =
        std::max(outcome.worst_residual_ratio, report.search.residual_ratio);
    if (!outcome.is_finite) return outcome;
  }
  outcome.unconverged_ratio =
      static_cast<double>(dynamics.counters().unconverged) / std::max(1, steps);
  const Eigen::Index tip = bench::tip_of(body.mesh());
  outcome.error_ratio = (dynamics.x_m()[tip] - body.rest_m()[tip]) / wanted_m - 1.0;
  return outcome;
}

bool is_right(const Outcome& outcome) {
  return outcome.is_finite && std::abs(outcome.error_ratio) < 0.01;
}

void add_row(Table& table, const std::string& what, const char* law, double young_modulus_pa,
             double dt_s, const Outcome& outcome, int& right, int& runs) {
  ++runs;
  right += is_right(outcome) ? 1 : 0;
  table.add({what, law, young_modulus_pa, 1e3 * dt_s,
             is_right(outcome)   ? "right"
             : outcome.is_finite ? "off"
                                 : "NOT FINITE",
             outcome.error_ratio, outcome.worst_residual_ratio, outcome.unconverged_ratio});
}

constexpr double kYoung_pa[] = {1e3, 1e4, 1e5, 1e6, 1e7};
constexpr double kSteps_s[] = {1e-3, 5e-3, 10e-3, 20e-3};

// A panel per element and law, a cell per stiffness and step, in it the error.
void draw_map(const std::filesystem::path& folder, const Table& map) {
  std::filesystem::create_directories(folder);
  bench::write_file(folder / "elastic_map.csv", map.csv());
  std::string script = R"(set datafile separator ','
set terminal svg size 1000,600 dynamic background rgb 'white' font 'sans,11'
set output 'elastic_map.svg'
set multiplot layout 2,3 title 'Error at rest, %; good (green): finite and within 1 % of the static answer'
unset key
set style fill solid
set xrange [-0.5:3.5]
set yrange [-0.5:4.5]
set xlabel 'step, ms'
set ylabel 'E, Pa'
set xtics ()";
  const char* comma = "";
  for (std::size_t i = 0; i < std::size(kSteps_s); ++i) {
    script += fmt::format("{}'{:g}' {}", comma, 1e3 * kSteps_s[i], i);
    comma = ", ";
  }
  script += ")\nset ytics (";
  comma = "";
  for (std::size_t i = 0; i < std::size(kYoung_pa); ++i) {
    script += fmt::format("{}'{:.0e}' {}", comma, kYoung_pa[i], i);
    comma = ", ";
  }
  script += ")\n";
  for (const char* const element : kElements) {
    for (const Law law : kLaws) {
      script += fmt::format(
          "set title '{0}, {1}'\nplot 'elastic_map.csv' using (strcol('case') eq '{0}' && "
          "strcol('law') eq '{1}' ? column('step') : NaN):'stiffness':(0.48):(0.46):"
          "(column('good') > 0 ? 0xa9dfbf : 0xe74c3c) with boxxyerror lc rgb variable, '' using "
          "(strcol('case') eq '{0}' && strcol('law') eq '{1}' ? column('step') : NaN):"
          "'stiffness':'label' with labels font 'sans,9'\n",
          element, name_of(law));
    }
  }
  bench::draw_figure(folder, "elastic_map", script + "unset multiplot\n");
}

void map_grid(const BenchOptions& options, Table& table) {
  Table map({{"case", "", ""},
             {"law", "", ""},
             {"step", "", "{:g}"},
             {"stiffness", "", "{:g}"},
             {"good", "", "{:g}"},
             {"label", "", ""}});
  for (const char* const element : kElements) {
    const Mesh coarse = beam_mesh(8, 2);
    const Mesh mesh = element == kElements[1] ? quadratic(coarse) : coarse;
    for (const Law law : kLaws) {
      int right = 0;
      int runs = 0;
      for (std::size_t stiffness = 0; stiffness < std::size(kYoung_pa); ++stiffness) {
        const double E = kYoung_pa[stiffness];
        BodyDescription beam = bench::hanging_beam(mesh, law, E, 0.45);
        beam.materials[0].mass_damping_per_s = critical_damping_per_s(E);
        const Body body(beam);
        const double wanted_m = static_way_m(body);
        for (std::size_t step = 0; step < std::size(kSteps_s); ++step) {
          const double dt_s = kSteps_s[step];
          if (options.is_quick && dt_s != 20e-3 && dt_s != 5e-3) continue;
          const double end_s = std::max(24.0 / critical_damping_per_s(E), 40.0 * dt_s);
          const Outcome outcome = come_to_rest(body, body.rest_m(), dt_s, end_s, wanted_m);
          add_row(table, element, name_of(law), E, dt_s, outcome, right, runs);
          const double percent = 100.0 * std::abs(outcome.error_ratio);
          map.add({element, name_of(law), static_cast<double>(step), static_cast<double>(stiffness),
                   is_right(outcome) ? 1.0 : 0.0,
                   !outcome.is_finite ? "not finite"
                   : percent < 0.01   ? "< 0.01"
                                      : fmt::format("{:.2g}", percent)});
        }
      }
      std::printf("%s, %s: %d of %d right\n", element, name_of(law), right, runs);
    }
  }
  if (!options.plot_folder.empty()) draw_map(options.plot_folder, map);
}

void single_cases(Table& table) {
  int right = 0;
  int runs = 0;
  for (const Law law : kLaws) {
    const auto run = [&](const char* what, const Mesh& mesh, double nu, auto start) {
      BodyDescription beam = bench::hanging_beam(mesh, law, 100e3, nu);
      beam.materials[0].mass_damping_per_s = critical_damping_per_s(100e3);
      const Body body(beam);
      VectorXd x = body.rest_m();
      start(x);
      add_row(table, what, name_of(law), 100e3, 10e-3,
              come_to_rest(body, x, 10e-3, 3.0, static_way_m(body)), right, runs);
    };
    const auto nothing = [](VectorXd&) {};
    run("nu 0.49", quadratic(beam_mesh(8, 2)), 0.49, nothing);
    std::vector<double> thin = equal_planes(0.0, 0.1, 8);
    thin.insert(thin.begin() + 4, thin[3] + 2e-5);
    const std::vector<double> across = equal_planes(0.0, 0.025, 2);
    run("slivers", box_mesh(thin, across, across), 0.45, nothing);
    run("inside out", beam_mesh(8, 2), 0.45, [](VectorXd& x) {
      for (Eigen::Index i = 0; i < x.size(); i += 3) x[i] = -x[i];
    });
    run("scrambled", beam_mesh(8, 2), 0.45, [](VectorXd& x) {
      std::mt19937 random(1);
      std::uniform_real_distribution<double> anywhere(-0.02, 0.02);
      for (Eigen::Index i = 0; i < x.size(); i += 3) {
        if (x[i] < 1e-9) continue;
        for (Eigen::Index k = i; k < i + 3; ++k) x[k] += anywhere(random);
      }
    });
  }
  std::printf("single cases: %d of %d right\n", right, runs);
}

// A sphere that is there from one step to the next, or comes at 1 m/s; the block must stay finite
// and, when the sphere has gone, come back.
void spheres(Table& table) {
  int right = 0;
  int runs = 0;
  for (const Law law : kLaws) {
    for (const bool is_sudden : {true, false}) {
      BodyDescription block = bench::standing_block(block_mesh(4, 6, 2.5e-3), law);
      block.materials[0].mass_damping_per_s = 50.0;
      const Body body(block);
      SphereContact contact(bench::top_points(body.mesh(), 0.02, 2), 1e7);
      Dynamics dynamics(body, {.theta = 1.0});
      Outcome outcome;
      for (int i = 0; i < 20; ++i) {
        const double depth_m = is_sudden ? 4e-3 : std::min(10e-3, 1e-3 * i);
        contact.set_sphere({0.05, 0.05, 0.055 - depth_m}, 0.005);
        const StepReport report = dynamics.step(1e-3, &contact);
        outcome.is_finite = outcome.is_finite && report.search.is_finite;
        outcome.worst_residual_ratio =
            std::max(outcome.worst_residual_ratio, report.search.residual_ratio);
      }
      for (int i = 0; i < 200; ++i) dynamics.step(10e-3);
      outcome.is_finite = outcome.is_finite && dynamics.x_m().allFinite();
      outcome.error_ratio = (dynamics.x_m() - body.rest_m()).cwiseAbs().maxCoeff() / 0.05;
      outcome.unconverged_ratio = static_cast<double>(dynamics.counters().unconverged) / 220.0;
      add_row(table, is_sudden ? "sphere appears, 4 mm" : "sphere at 1 m/s, 10 mm", name_of(law),
              10e3, 1e-3, outcome, right, runs);
    }
  }
  std::printf("spheres: %d of %d finite and back at rest\n", right, runs);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Elastic bodies: which stiffness, step, law and mesh stay finite and end right.",
               "elastic_stress");
  BenchOptions options;
  bool has_hands = false;
  app.add_flag("--hands", has_hands, "Instead: tools that cut, hold, pull and tear");
  return bench::run_bench(app, options, argc, argv, [&] {
    if (has_hands) return bench::acting_hands(options);
    Table table({{"case", "case", ""},
                 {"law", "law", ""},
                 {"young_modulus_pa", "E [Pa]", "{:g}"},
                 {"dt_ms", "dt [ms]", "{:g}"},
                 {"state", "state", ""},
                 {"error_ratio", "error", "{:+.4f}"},
                 {"worst_residual_ratio", "worst residual", "{:.1e}"},
                 {"unconverged_ratio", "unconverged", "{:.3f}"}});
    map_grid(options, table);
    single_cases(table);
    spheres(table);
    table.publish(options);
  });
}
