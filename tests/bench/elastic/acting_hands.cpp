// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/elastic/acting_hands.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "common/session/session_file.h"
#include "physics_node/elastic_tissue/elastic_tissues.h"
#include "physics_node/files/tetrahedral_files.h"
#include "tests/bench/elastic/delayed_force.h"
#include "tests/support/elastic/tetrahedra_of.h"
#include "tests/support/machine/places.h"
#include "tests/support/temp_folder.h"

namespace palpate::bench {
namespace {

constexpr double kTick_s = 1e-3;
constexpr double kWait_s = 0.3;   // before a hand moves, and as long as it takes to close jaws
constexpr double kAfter_s = 1.5;  // it has let go, or rests
constexpr double kReach_m = 0.05;
constexpr double kSpeeds_m_per_s[] = {0.02, 0.1, 0.3};

/// One of the tools of a row: on a straight way at a speed, its jaws closed meanwhile.
struct ToolWay {
  Vector3 from_m = Vector3::Zero();
  Vector3 to_m = Vector3::Zero();
  Vector3 facing = -Vector3::UnitZ();
  Vector3 edge = Vector3::UnitZ();

  [[nodiscard]] double length_m() const { return (to_m - from_m).norm(); }
  [[nodiscard]] Vector3 at_m(double way_m) const {
    return from_m + std::clamp(way_m / length_m(), 0.0, 1.0) * (to_m - from_m);
  }
};

/// What has come of a row.
struct Outcome {
  bool is_finite = true;
  int inverted_solutions = 0;  ///< most in a row
  double peak_newton = 0.0;
  double jump_newton = 0.0;  ///< largest change in a tick
  double last_newton = 0.0;
  std::size_t elements = 0;  ///< at the end
  physics::ElasticFigures figures;
};

struct HandRow {
  std::string name;
  SceneConfig scene;
  std::vector<ToolWay> tools;
  std::function<bool(const Outcome&)> is_done;  ///< what the hand came for
};

bool has_inverted_element(const physics::ElasticSimulation& simulation) {
  const elastic::Mesh& mesh = simulation.body().body->mesh();
  const elastic::VectorXd& x_m = simulation.x_m();
  for (std::size_t e = 0; e < mesh.element_count(); ++e) {
    const auto corners = mesh.element(e);
    const auto at = [&](std::size_t k) { return x_m.segment<3>(3 * Eigen::Index{corners[k]}); };
    const Vector3 a = at(1) - at(0);
    const Vector3 b = at(2) - at(0);
    const Vector3 c = at(3) - at(0);
    if (!(a.cross(b).dot(c) > 0.0)) return true;
  }
  return false;
}

Outcome outcome_of(const HandRow& row, double speed_m_per_s) {
  const auto tissues =
      physics::ElasticTissues::of(row.scene, row.tools.size(), physics::ElasticPace::kVirtual);
  physics::ElasticTissue& tissue = *tissues->tissues().front();
  Outcome outcome;
  std::vector<Vector3> newton(row.tools.size(), Vector3::Zero());
  const double moves_s = row.tools.front().length_m() / speed_m_per_s;
  std::uint64_t solves = 0;
  int inverted = 0;
  for (double time_s = 0.0; time_s < kWait_s + moves_s + kAfter_s; time_s += kTick_s) {
    const bool is_moving = time_s > kWait_s && time_s < kWait_s + moves_s;
    for (std::size_t i = 0; i < row.tools.size(); ++i) {
      const ToolWay& tool = row.tools[i];
      const physics::JawInput jaw{
          .is_closed = time_s > 0.5 * kWait_s && time_s < kWait_s + moves_s + 0.1,
          .velocity_m_per_s = is_moving
                                  ? Vector3(speed_m_per_s * (tool.to_m - tool.from_m).normalized())
                                  : Vector3(Vector3::Zero()),
          .inward_world = tool.facing,
          .edge_world = tool.edge};
      physics::SceneForce force;
      tissues->step(i, tool.at_m(speed_m_per_s * (time_s - kWait_s)), time_s, kReach_m, force, jaw);
      const Vector3 now = force.force_on_tool_newton;
      outcome.is_finite = outcome.is_finite && now.allFinite();
      outcome.peak_newton = std::max(outcome.peak_newton, now.norm());
      outcome.jump_newton = std::max(outcome.jump_newton, (now - newton[i]).norm());
      newton[i] = now;
    }
    outcome.figures = tissue.figures();
    if (outcome.figures.solves == solves) continue;
    solves = outcome.figures.solves;
    outcome.is_finite = outcome.is_finite && tissue.simulation().x_m().allFinite();
    inverted = has_inverted_element(tissue.simulation()) ? inverted + 1 : 0;
    outcome.inverted_solutions = std::max(outcome.inverted_solutions, inverted);
  }
  for (const Vector3& now : newton) outcome.last_newton = std::max(outcome.last_newton, now.norm());
  outcome.elements = tissue.simulation().body().body->mesh().element_count();
  return outcome;
}

/// A tissue like the first of a shipped session, from a box of so many cells.
SceneConfig box_scene(const char* session, const TempFolder& folder, const Vector3& low_m,
                      const Vector3& high_m, const std::array<int, 3>& cells) {
  SceneConfig scene = load_session(test::source_dir() + session).scene;
  const auto planes = [&](Eigen::Index axis) {
    return elastic::equal_planes(low_m[axis], high_m[axis], cells[static_cast<std::size_t>(axis)]);
  };
  const elastic::Mesh box = elastic::box_mesh(planes(0), planes(1), planes(2));
  FileGeometry& geometry = std::get<FileGeometry>(scene.tissues.front().geometry);
  geometry = {.kind = FileGeometry::Kind::kTetrahedralMesh,
              .file = folder.write("box.msh", physics::msh_text(test::tetrahedra_of(box)))};
  return scene;
}

ElasticMaterial& material_of(SceneConfig& scene) {
  return std::get<ElasticMaterial>(scene.tissues.front().material);
}

std::vector<HandRow> rows(const TempFolder& folder) {
  const auto has_cut = [](const Outcome& found) { return found.figures.ablation.faces_cut > 20; };
  std::vector<HandRow> all;

  const SceneConfig incision =
      load_session(test::source_dir() + "/deploy/sessions/tools/incision.txtpb").scene;
  all.push_back({"cut, through and out",
                 incision,
                 {{.from_m = {-0.036, 0.001, -0.008},
                   .to_m = {0.040, 0.001, -0.008},
                   .facing = Vector3::UnitX()}},
                 has_cut});

  // held at one end: what the blade goes across falls off
  SceneConfig island = incision;
  island.blade->length_m = 0.03;
  material_of(island).pierced->toughness_joule_per_m2 = 5.0;
  material_of(island).pierced->membrane_newton = 0.05;
  material_of(island).fixed = {
      HalfSpaceGeometry{.point_m = {-0.0299, 0, 0}, .normal = Vector3::UnitX()}};
  all.push_back({"cut into an island",
                 island,
                 {{.from_m = {0.001, -0.021, -0.019},
                   .to_m = {0.001, 0.040, -0.019},
                   .facing = Vector3::UnitY()}},
                 [](const Outcome& found) { return found.figures.ablation.loose > 0; }});

  SceneConfig support = incision;
  support.blade->length_m = 0.04;
  all.push_back({"cut along a support",
                 support,
                 {{.from_m = {-0.036, -0.0145, -0.0185},
                   .to_m = {0.036, -0.0145, -0.0185},
                   .facing = Vector3::UnitX(),
                   .edge = Vector3::UnitY()}},
                 has_cut});

  // 60 × 40 × 4 mm, held at one end
  SceneConfig plate = box_scene("/deploy/sessions/retract.txtpb", folder, {-0.03, -0.02, -0.004},
                                {0.03, 0.02, 0.0}, {15, 10, 1});
  material_of(plate).fixed = {
      HalfSpaceGeometry{.point_m = {-0.0299, 0, 0}, .normal = Vector3::UnitX()}};
  plate.gripper->tear_newton = plate.gripper->jaw_newton = 100.0;
  const auto has_held = [](const Outcome& found) { return found.peak_newton > 0.02; };
  all.push_back({"a thin rim, pulled up",
                 plate,
                 {{.from_m = {0.030, 0, 0.005}, .to_m = {0.030, 0, 0.035}}},
                 has_held});
  all.push_back({"a thin rim, pulled away",
                 plate,
                 {{.from_m = {0.030, 0, 0.005}, .to_m = {0.060, 0, 0.005}}},
                 has_held});
  all.push_back({"a thin rim, pushed in",
                 plate,
                 {{.from_m = {0.030, 0, 0.005}, .to_m = {0.005, 0, 0.005}}},
                 has_held});

  SceneConfig flap = plate;
  flap.gripper->tear_newton = 0.3;
  all.push_back({"two hands, one flap, until it is lost",
                 flap,
                 {{.from_m = {0.030, -0.012, 0.005}, .to_m = {0.030, -0.052, 0.005}},
                  {.from_m = {0.030, 0.012, 0.005}, .to_m = {0.030, 0.052, 0.005}}},
                 [](const Outcome& found) { return found.peak_newton > 0.2; }});

  SceneConfig bed =
      load_session(test::source_dir() + "/deploy/sessions/tools/gallbladder.txtpb").scene;
  const auto has_torn = [](const Outcome& found) { return found.figures.torn > 10; };
  all.push_back({"one hand tears an organ off",
                 bed,
                 {{.from_m = {0.030, 0, 0.014}, .to_m = {0.030, 0, 0.064}}},
                 has_torn});
  all.push_back({"two hands tear an organ off",
                 bed,
                 {{.from_m = {0.030, -0.008, 0.014}, .to_m = {0.030, -0.038, 0.054}},
                  {.from_m = {0.030, 0.008, 0.014}, .to_m = {0.030, 0.038, 0.054}}},
                 has_torn});
  return all;
}

/// The jaws open while nothing comes from the physics: the force on the hand ends at once.
struct Release {
  bool is_finite = true;
  double held_newton = 0.0;   // a tick before
  double after_newton = 0.0;  // most, from that tick on
};
Release release_in_silence(const SceneConfig& scene) {
  constexpr double kOpen_s = 1.8;  // 50 ms into a stall of 150 ms, with a delay of 50 ms
  const Network network{
      .delay_s = 0.05, .loss_ratio = 0.2, .stall_s = 0.15, .is_closed = [](double t_s) {
        return t_s > 0.2 && t_s < kOpen_s;
      }};
  const auto tip_m = [&](double t_s) {
    const double up = std::clamp((t_s - 0.4) / 0.3, 0.0, 1.0);
    return Vector3(0.003, 0.002, scene.tip_radius_m - 2e-4 + 0.03 * up);
  };
  const DelayedForces found = delayed_forces(scene, tip_m, 3.0, 300, network);
  Release release;
  const auto open = static_cast<std::size_t>(std::lround(kOpen_s / kTick_s));
  for (std::size_t i = 0; i < found.newton.size(); ++i) {
    release.is_finite = release.is_finite && found.newton[i].allFinite();
    if (i == open - 1) release.held_newton = found.newton[i].norm();
    if (i > open) release.after_newton = std::max(release.after_newton, found.newton[i].norm());
  }
  return release;
}

}  // namespace

void acting_hands(const BenchOptions& options) {
  const TempFolder folder;
  Table table({{"hand", "hand", ""},
               {"speed_m_per_s", "speed m/s", "{:.2f}"},
               {"state", "state", ""},
               {"inverted_solutions", "inside out, solutions in a row", "{:.0f}"},
               {"peak_newton", "peak N", "{:.2f}"},
               {"jump_newton", "largest change in 1 ms N", "{:.2f}"},
               {"last_newton", "at the end N", "{:.3f}"},
               {"solves", "solutions", "{:.0f}"},
               {"failed", "failed", "{:.0f}"},
               {"repaired", "repaired", "{:.0f}"},
               {"faces_cut", "faces cut", "{:.0f}"},
               {"torn", "points torn off", "{:.0f}"},
               {"loose", "elements fallen off", "{:.0f}"},
               {"elements", "elements left", "{:.0f}"}});
  int right = 0;
  int runs = 0;
  for (const HandRow& row : rows(folder)) {
    for (const double speed_m_per_s : kSpeeds_m_per_s) {
      const Outcome found = outcome_of(row, speed_m_per_s);
      const bool is_right = found.is_finite && found.inverted_solutions <= 1 && row.is_done(found);
      ++runs;
      right += is_right ? 1 : 0;
      const auto n = [](auto count) { return static_cast<double>(count); };
      table.add({row.name, speed_m_per_s,
                 !found.is_finite               ? "NOT FINITE"
                 : found.inverted_solutions > 1 ? "INSIDE OUT"
                 : !row.is_done(found)          ? "not done"
                                                : "right",
                 n(found.inverted_solutions), found.peak_newton, found.jump_newton,
                 found.last_newton, n(found.figures.solves), n(found.figures.failed),
                 n(found.figures.repaired), n(found.figures.ablation.faces_cut),
                 n(found.figures.torn), n(found.figures.ablation.loose), n(found.elements)});
    }
  }
  table.publish(options);
  std::printf("hands that act: %d of %d right\n", right, runs);
  const Release release =
      release_in_silence(load_session(test::source_dir() + "/deploy/sessions/retract.txtpb").scene);
  std::printf("jaws opened while the physics is silent: %s, %.2f N before, at most %.3f N after\n",
              release.is_finite ? "finite" : "NOT FINITE", release.held_newton,
              release.after_newton);
}

}  // namespace palpate::bench
