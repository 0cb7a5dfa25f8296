// SPDX-License-Identifier: Apache-2.0
// contact_stress: contact under stiffness, damping, friction and motion far beyond tissue.
//
// First the law, for every geometry: random closed paths of the tool at up to 1 m/s with a physics
// period of 0.25 to 20 ms, and teleports; a tip, a tip with a shaft, and a needle that punctures.
// Counted: results that are not finite, forces above what the law allows for the penetrations and
// the speed, and the most energy that friction and drag gave over a closed path (they should take:
// below 0).
//
// Then thin tissue, poked at up to 1 m/s: how often the tool popped through; and slides over edges,
// through grooves and over facets: the largest step of the force beside the bound of
// common/contact/proxy.h.
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

#include "common/contact/contact_model.h"
#include "common/core/check.h"
#include "common/core/random.h"
#include "physics_node/files/ply.h"
#include "physics_node/files/surface_files.h"
#include "physics_node/files/tetrahedral_files.h"
#include "physics_node/scene/scene.h"
#include "tests/bench/bench_output.h"
#include "tests/support/sampled_clouds.h"
#include "tests/support/temp_folder.h"
#include "tests/support/tool_motion.h"
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

enum class Tool { kTip, kShaft, kNeedle };

struct Findings {
  std::size_t steps = 0;
  std::size_t touches = 0;
  std::size_t not_finite = 0;
  std::size_t above_law = 0;
  double largest_newton = 0.0;
  double most_friction_work_joule = -1e300;  // over closed paths
};

KelvinVoigtMaterial random_material(Tool tool, Random& random) {
  const double k = log_uniform(random, 1.0, 1e6);
  KelvinVoigtMaterial material{
      .stiffness_newton_per_m = k,
      .damping_newton_s_per_m = random.chance(0.3) ? 0.0 : log_uniform(random, 1e-2, 1e3),
      .is_damping_isotropic = random.chance(0.5),
      .is_adhesive = tool != Tool::kNeedle && random.chance(0.5),
      .friction_coefficient = random.uniform(0.0, 2.0),
      .friction_stiffness_newton_per_m = k};
  if (tool == Tool::kNeedle) {
    material.puncture_newton = log_uniform(random, 0.1, 100.0);
    material.cutting_newton = random.uniform() * material.puncture_newton;
  }
  return material;
}

/// The most that the law allows one contact. Only what has been punctured pulls here: a needle's
/// tissue is not adhesive.
double most_newton(const Contact& contact, const KelvinVoigtMaterial& material, Tool tool,
                   double speed_m_per_s) {
  if (tool == Tool::kNeedle && contact.is_adhesive) return material.cutting_newton;
  return material.stiffness_newton_per_m * contact.penetration_m *
             (1.0 + material.friction_coefficient) +
         material.damping_newton_s_per_m * speed_m_per_s;
}

/// Of friction, or of the drag of what has been punctured.
Vector3 friction_newton(const Contact& contact, Tool tool) {
  if (tool == Tool::kNeedle && contact.is_adhesive) return contact.elastic_force_on_tool_newton;
  return -contact.friction_stiffness_newton_per_m * contact.stretch_m;
}

/// One closed path, from outside through the tissue to where it began.
void walk(const Geometry& geometry, Tool tool, Random& random, Findings& findings) {
  const KelvinVoigtMaterial material = random_material(tool, random);
  const bool has_shaft = tool != Tool::kTip;
  const Scene scene({.tip_radius_m = tool == Tool::kNeedle ? 0.0 : kTip_m,
                     .shaft_length_m = has_shaft ? 0.1 : 0.0,
                     .shaft_radius_m = has_shaft ? 0.001 : 0.0,
                     .tissues = {{.name = "tissue", .geometry = geometry, .material = material}}});
  TissueMemory memory = scene.new_memory();
  const double period_s = log_uniform(random, 0.25e-3, 20e-3);
  const Vector3 shaft = random.direction();

  Vector3 x = outside_m();
  double time_s = 0.0;
  scene.step(memory, x, Vector3::Zero(), time_s, shaft);
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
      time_s += period_s;
      const SceneForce force = scene.step(memory, x, v, time_s, shaft);
      ++findings.steps;
      if (force.contact_count == 0) continue;
      ++findings.touches;
      if (!force.force_on_tool_newton.allFinite() || !std::isfinite(force.stored_energy_joule)) {
        ++findings.not_finite;
        continue;
      }

      double bound_newton = 0.0;
      for (std::size_t c = 0; c < force.contact_count; ++c) {
        bound_newton += most_newton(force.contacts[c], material, tool, v.norm());
        friction_work_joule += friction_newton(force.contacts[c], tool).dot(step);
      }
      const double newton = force.force_on_tool_newton.norm();
      if (newton > bound_newton * (1.0 + 1e-9)) ++findings.above_law;
      findings.largest_newton = std::max(findings.largest_newton, newton);
    }
  }
  findings.most_friction_work_joule =
      std::max(findings.most_friction_work_joule, friction_work_joule);
}

void stress_law(const BenchOptions& options) {
  const test::TempFolder folder;
  Table table({{"geometry", "geometry", ""},
               {"tool", "tool", ""},
               {"steps", "steps", "{:.0f}"},
               {"touches", "touching", "{:.0f}"},
               {"not_finite", "not finite", "{:.0f}"},
               {"above_law", "above the law", "{:.0f}"},
               {"largest_newton", "largest [N]", "{:.3g}"},
               {"friction_joule", "most that friction gave [J]", "{:.3g}"}});
  for (const Kind& kind : kinds(folder)) {
    const physics::Shape keep = physics::to_shape(kind.geometry);  // its file is read once
    for (const auto& [tool, name] : {std::pair{Tool::kTip, "tip of 3 mm"},
                                     {Tool::kShaft, "and a shaft"},
                                     {Tool::kNeedle, "needle"}}) {
      Random random(7);
      Findings findings;
      const int paths = options.is_quick ? 100 : 1000;
      for (int i = 0; i < paths; ++i) walk(kind.geometry, tool, random, findings);
      table.add({kind.name, name, static_cast<double>(findings.steps),
                 static_cast<double>(findings.touches), static_cast<double>(findings.not_finite),
                 static_cast<double>(findings.above_law), findings.largest_newton,
                 findings.most_friction_work_joule});
    }
  }
  std::fputs(table.text().c_str(), stdout);
}

void poke_thin_tissue(const BenchOptions& options) {
  const test::TempFolder folder;
  Table table({{"thin", "thin tissue", ""},
               {"pokes", "pokes", "{:.0f}"},
               {"popped_through", "popped through", "{:.0f}"},
               {"largest_step_over_bound", "largest step of the force / bound", "{:.3f}"}});
  for (const test::ThinThing& thing : test::thin_things(folder)) {
    const physics::Shape keep = physics::to_shape(thing.geometry);
    Random random(1);
    const test::PokeFindings findings = test::poke(thing, options.is_quick ? 2000 : 20000, random);
    table.add({thing.name, static_cast<double>(findings.pokes),
               static_cast<double>(findings.popped_through), findings.largest_step_over_bound});
  }
  std::fputs(("\n" + table.text()).c_str(), stdout);
}

void slide_over_edges() {
  const test::TempFolder folder;
  Table table({{"way", "500 N/m, slid over", ""},
               {"tip_radius_m", "tip [m]", "{:g}"},
               {"speed_m_per_s", "m/s", "{:g}"},
               {"period_ms", "T [ms]", "{:g}"},
               {"largest_step_newton", "largest step [N]", "{:.3f}"},
               {"bound_newton", "bound [N]", "{:.3f}"},
               {"largest_step_over_bound", "largest step / its bound", "{:.3f}"}});
  for (const test::Slide& slide : test::slides(folder)) {
    for (const double tip_radius_m : {0.0, 0.003}) {
      for (const auto& [speed_m_per_s, dt_s] : {std::pair{0.08, 1e-3}, {1.0, 1e-3}, {0.2, 1e-2}}) {
        constexpr double kStiffness = 500.0;
        const Scene scene(
            {.tip_radius_m = tip_radius_m,
             .tissues = {{.name = slide.name,
                          .geometry = slide.geometry,
                          .material = KelvinVoigtMaterial{.stiffness_newton_per_m = kStiffness}}}});
        test::LedTool tool(scene, kStiffness);
        tool.go_to(slide.way_m[0], dt_s);
        for (const Vector3& to_m : slide.way_m) tool.lead_to(to_m, speed_m_per_s, dt_s);
        table.add({slide.name, tip_radius_m, speed_m_per_s, 1e3 * dt_s, tool.largest_step_newton(),
                   kStiffness * (kMostForcePerMotion * speed_m_per_s + kCreep_m_per_s) * dt_s,
                   tool.largest_step_over_bound()});
      }
    }
  }
  std::fputs(("\n" + table.text() + "\n").c_str(), stdout);
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
  CLI::App app(
      "Contact under stress: the law for every geometry and tool, thin tissue, edges, and a "
      "map of the sampled loop.",
      "contact_stress");
  BenchOptions options;
  return bench::run_bench(app, options, argc, argv, [&] {
    stress_law(options);
    poke_thin_tissue(options);
    slide_over_edges();
    map_bounces(options);
  });
}
