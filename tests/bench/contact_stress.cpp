// contact_stress: contact under stiffness, damping, friction and motion far beyond tissue.
//
// First the law, for every geometry: random closed paths of the tip at up to 1 m/s with a physics
// period of 0.25 to 20 ms, and teleports. Counted: results that are not finite, forces above what
// the law allows for this penetration and speed, and the most energy that friction gave over a
// closed path (it should take: below 0).
//
// Then the loop, drawn as a map: a mass falls onto a floor whose force is computed once in a
// period, and either held or continued by the local model between. Shown is the energy with which
// it leaves over that with which it came: above 1 the sampling made energy. No controller acts; it
// is there for the cells above 1.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "common/core/contact_model.h"
#include "common/core/random.h"
#include "physics_node/ply.h"
#include "physics_node/scene.h"
#include "physics_node/tetrahedral_mesh.h"
#include "tests/bench/bench_output.h"
#include "tests/support/sampled_clouds.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/physics_node/test_meshes.h"

namespace {

using namespace palpate;
using bench::BenchOptions;
using bench::Table;
using physics::Scene;
using physics::SceneForce;
using physics::TissueMemory;

constexpr double kTip_m = 0.003;

double log_uniform(Random& random, double low, double high) {
  return low * std::pow(high / low, random.uniform());
}

/// Far outside every tissue.
Vector3 outside_m() { return {0.2, 0.2, 0.2}; }

struct Kind {
  std::string name;
  Geometry geometry;
};

std::vector<Kind> kinds(const test::TempFolder& folder) {
  Random random(1);
  return {
      {"half-space", HalfSpaceGeometry{}},
      {"sphere", SphereGeometry{.radius_m = 0.03}},
      {"box", BoxGeometry{.size_m = {0.06, 0.05, 0.04}}},
      {"capsule", CapsuleGeometry{.from_m = {-0.02, 0, 0}, .to_m = {0.02, 0, 0}, .radius_m = 0.02}},
      {"cloud",
       FileGeometry{.file = folder.write("ball.ply", physics::ply_text(test::sampled(
                                                         test::sphere_shape(0.03), 2e-3, 1e-4, true,
                                                         test::Sampling::kRandom, random)))}},
      {"mesh",
       FileGeometry{.kind = FileGeometry::Kind::kTetrahedralMesh,
                    .file = folder.write("cube.msh",
                                         physics::msh_text(physics::cube_of_tetrahedra(0.05)))}}};
}

struct Findings {
  std::size_t steps = 0;
  std::size_t touches = 0;
  std::size_t not_finite = 0;
  std::size_t above_law = 0;
  double largest_newton = 0.0;
  double most_friction_work_joule = -1e300;  // over closed paths
};

KelvinVoigtMaterial random_material(Random& random) {
  const double k = log_uniform(random, 1.0, 1e6);
  return {.stiffness_newton_per_m = k,
          .damping_newton_s_per_m = random.chance(0.3) ? 0.0 : log_uniform(random, 1e-2, 1e3),
          .is_damping_isotropic = random.chance(0.5),
          .is_adhesive = random.chance(0.5),
          .friction_coefficient = random.uniform(0.0, 2.0),
          .friction_stiffness_newton_per_m = k};
}

/// One closed path, from outside through the tissue to where it began.
void walk(const Geometry& geometry, const KelvinVoigtMaterial& material, Random& random,
          Findings& findings) {
  KelvinVoigtMaterial slippery = material;
  slippery.friction_coefficient = 0.0;
  const auto scene_of = [&](const KelvinVoigtMaterial& of) {
    return Scene({.tip_radius_m = kTip_m,
                  .tissues = {{.name = "tissue", .geometry = geometry, .material = of}}});
  };
  const Scene scene = scene_of(material);
  const Scene without_friction = scene_of(slippery);
  TissueMemory memory = scene.new_memory();
  const double period_s = log_uniform(random, 0.25e-3, 20e-3);

  Vector3 x = outside_m();
  scene.remember(memory, x, 0.0);
  double friction_work_joule = 0.0;
  constexpr int kLegs = 12;
  for (int leg = 0; leg < kLegs; ++leg) {
    const bool is_last = leg == kLegs - 1;
    const Vector3 to = is_last
                           ? outside_m()
                           : Vector3(0.04 * Vector3(random.uniform(-1, 1), random.uniform(-1, 1),
                                                    random.uniform(-1, 1)));
    const bool is_teleport = leg == 0 || is_last || random.chance(0.2);
    const double step_m = random.uniform(0.01, 1.0) * period_s;
    const int steps =
        is_teleport ? 1 : std::max(1, static_cast<int>(std::ceil((to - x).norm() / step_m)));
    const Vector3 step = (to - x) / steps;
    const Vector3 v = is_teleport ? Vector3(Vector3::Zero()) : Vector3(step / period_s);
    for (int i = 0; i < steps; ++i) {
      x = i + 1 == steps ? to : Vector3(x + step);
      scene.remember(memory, x, 0.0);
      const SceneForce force = scene.evaluate(x, v, 0.0, memory);
      const SceneForce smooth = without_friction.evaluate(x, v);
      ++findings.steps;
      if (force.contact_count == 0) continue;
      ++findings.touches;
      if (!force.force_on_tool_newton.allFinite() || !std::isfinite(force.stored_energy_joule)) {
        ++findings.not_finite;
        continue;
      }

      const double elastic_newton =
          material.stiffness_newton_per_m * force.contacts[0].penetration_m;
      const double most_newton = elastic_newton * (1.0 + material.friction_coefficient) +
                                 material.damping_newton_s_per_m * v.norm();
      const double newton = force.force_on_tool_newton.norm();
      if (newton > most_newton * (1.0 + 1e-9)) ++findings.above_law;
      findings.largest_newton = std::max(findings.largest_newton, newton);
      friction_work_joule += (force.force_on_tool_newton - smooth.force_on_tool_newton).dot(step);
    }
  }
  findings.most_friction_work_joule =
      std::max(findings.most_friction_work_joule, friction_work_joule);
}

void stress_law(const BenchOptions& options) {
  const test::TempFolder folder;
  Table table({{"geometry", "geometry", ""},
               {"steps", "steps", "{:.0f}"},
               {"touches", "touching", "{:.0f}"},
               {"not_finite", "not finite", "{:.0f}"},
               {"above_law", "above the law", "{:.0f}"},
               {"largest_newton", "largest [N]", "{:.3g}"},
               {"friction_joule", "most that friction gave [J]", "{:.3g}"}});
  for (const Kind& kind : kinds(folder)) {
    Random random(7);
    Findings findings;
    const int paths = options.is_quick ? 100 : 2000;
    for (int i = 0; i < paths; ++i) walk(kind.geometry, random_material(random), random, findings);
    table.add({kind.name, static_cast<double>(findings.steps),
               static_cast<double>(findings.touches), static_cast<double>(findings.not_finite),
               static_cast<double>(findings.above_law), findings.largest_newton,
               findings.most_friction_work_joule});
  }
  std::fputs(table.text().c_str(), stdout);
}

/// Energy with which a mass leaves the floor over that with which it came; 0: it stays.
double bounce(double k, double b, double mass_kg, double period_s, bool is_local) {
  const Scene floor({.tissues = {{.name = "floor",
                                  .geometry = HalfSpaceGeometry{},
                                  .material = KelvinVoigtMaterial{.stiffness_newton_per_m = k,
                                                                  .damping_newton_s_per_m = b}}}},
                    0.05);
  constexpr double kSpeed = 0.2;
  constexpr double kInner_s = 25e-6;
  const int inner = std::max(1, static_cast<int>(std::lround(period_s / kInner_s)));
  // the fall begins half a period's way above, so that the samples lie neither best nor worst
  Vector3 x(0, 0, 0.5 * kSpeed * period_s);
  Vector3 v(0, 0, -kSpeed);
  for (double time_s = 0.0; time_s < 5.0; time_s += period_s) {
    const SceneForce force = floor.evaluate(x, v);
    const Vector3 from = x;
    for (int i = 0; i < inner; ++i) {
      const Vector3 f =
          is_local ? palpate::evaluate(force.contacts[0], x - from, v, 0.0).force_on_tool_newton
                   : force.force_on_tool_newton;
      v += kInner_s / mass_kg * f;
      x += kInner_s * v;
    }
    if (!x.allFinite()) return HUGE_VAL;
    if (x.z() > 0.0 && v.z() > 0.0) return v.squaredNorm() / (kSpeed * kSpeed);
  }
  return 0.0;
}

void map_bounces(const BenchOptions& options) {
  Table table({{"mass_kg", "mass [kg]", "{:g}"},
               {"damping_newton_s_per_m", "b [N s/m]", "{:g}"},
               {"stiffness_newton_per_m", "k [N/m]", "{:.3g}"},
               {"period_ms", "T [ms]", "{:g}"},
               {"held", "held", "{:.3g}"},
               {"local", "local model", "{:.3g}"}});
  const double per_decade = options.is_quick ? 1.0 : 4.0;
  for (const double mass_kg : {0.05, 0.3}) {
    for (const double b : {0.0, 1.0, 1000.0}) {
      for (int i = 0; i <= static_cast<int>(6 * per_decade); ++i) {
        const double k = std::pow(10.0, i / per_decade);
        for (const double period_ms : {0.25, 1.0, 5.0, 20.0}) {
          table.add({mass_kg, b, k, period_ms, bounce(k, b, mass_kg, 1e-3 * period_ms, false),
                     bounce(k, b, mass_kg, 1e-3 * period_ms, true)});
        }
      }
    }
    table.add_gap();
  }
  table.publish(options);
  if (options.plot_folder.empty()) return;
  const std::filesystem::path folder = options.plot_folder;
  std::filesystem::create_directories(folder);
  bench::write_file(folder / "contact_stress.csv", table.csv());
  bench::draw_figure(
      folder, "contact_stress",
      "set datafile separator ','\nset terminal svg size 900,400 background 'white'\n"
      "set output 'contact_stress.svg'\nset logscale xy\nset cbrange [0:2]\nset grid\n"
      "set palette defined (0 'navy', 1 'white', 1.05 'orange', 2 'red')\n"
      "set xlabel 'k [N/m]'\nset ylabel 'T [ms]'\nset yrange [0.15:30]\n"
      "f = 'contact_stress.csv'\nset multiplot layout 1,2\n"
      "do for [c in '5 6'] { set title (c == 5 ? 'held' : 'local model').': energy out / in, "
      "0.05 kg, b = 0'\n"
      "plot f every ::1 using ($1 == 0.05 && $2 == 0 ? $3 : NaN):4:(column(int(c))) with points "
      "pt 5 ps 2 palette notitle }\nunset multiplot\n");
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Contact under stress: the law for every geometry, and a map of the sampled loop.",
               "contact_stress");
  BenchOptions options;
  return bench::run_bench(app, options, argc, argv, [&] {
    stress_law(options);
    map_bounces(options);
  });
}
