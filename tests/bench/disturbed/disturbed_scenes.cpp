// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/disturbed/disturbed_scenes.h"

#include <spdlog/fmt/fmt.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <numbers>
#include <utility>

#include "common/core/random.h"
#include "common/session/session_file.h"
#include "physics_node/files/surface_files.h"
#include "physics_node/surfaces/subdivision.h"
#include "tests/bench/tissue_scenes.h"
#include "tests/support/machine/places.h"

namespace palpate::bench {
namespace {

using physics::TriangleMesh;

// --- surfaces -------------------------------------------------------------------------------

struct Surface {
  std::string name;
  std::string geometry;               ///< of the tissue, in the text of a session
  Vector3 top_m;                      ///< its highest point
  double side_hz = 0.07;              ///< of the hand's way to and fro along x, ± 15 mm
  Vector3 right_m = Vector3::Zero();  ///< its point of largest x
};

Vector3 farthest(const std::vector<Vector3>& points_m, int axis) {
  return *std::max_element(
      points_m.begin(), points_m.end(),
      [axis](const Vector3& a, const Vector3& b) { return a[axis] < b[axis]; });
}

/// An icosahedron, subdivided, each vertex at its radius from the origin: 20 · 4ⁿ facets.
TriangleMesh star_body(int subdivisions, const std::function<double(const Vector3&)>& radius_m) {
  physics::DirectionMesh sphere = physics::icosahedron();
  for (int level = 0; level < subdivisions; ++level) subdivide(sphere);
  TriangleMesh mesh{.vertices_m = {}, .triangles = sphere.triangles};
  for (const Vector3& direction : sphere.directions) {
    mesh.vertices_m.emplace_back(radius_m(direction) * direction);
  }
  return mesh;
}

/// A plate of 100 × 60 × 20 mm; across its top run ribs 2 mm high, one every 10 mm, with flanks of
/// 45° and edges.
TriangleMesh ribbed_plate() {
  constexpr double kHalfWidth = 0.03;
  constexpr double kBottom = -0.02;
  std::vector<std::array<double, 2>> top;  // x, z
  for (int rib = -5; rib < 5; ++rib) {
    const double x = 0.01 * rib;
    top.insert(top.end(), {{x, 0.0}, {x + 0.003, 0.0}, {x + 0.005, 0.002}, {x + 0.008, 0.002}});
  }
  top.push_back({0.05, 0.0});
  TriangleMesh mesh;
  for (const auto& [x, z] : top) {
    for (const double height : {z, kBottom}) {
      for (const double y : {-kHalfWidth, kHalfWidth}) mesh.vertices_m.emplace_back(x, y, height);
    }
  }
  const auto quad = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
    mesh.triangles.push_back({a, b, c});
    mesh.triangles.push_back({a, c, d});
  };
  const auto count = static_cast<std::uint32_t>(top.size());
  for (std::uint32_t i = 0; i + 1 < count; ++i) {  // of each column: top −y, +y, bottom −y, +y
    const std::uint32_t a = 4 * i;
    const std::uint32_t b = a + 4;
    quad(a, b, b + 1, a + 1);
    quad(a + 2, a + 3, b + 3, b + 2);
    quad(a, a + 2, b + 2, b);
    quad(a + 1, b + 1, b + 3, a + 3);
  }
  quad(0, 1, 3, 2);
  const std::uint32_t last = 4 * (count - 1);
  quad(last, last + 2, last + 3, last + 1);
  return mesh;
}

/// 100 × 60 mm in cells of 5 mm, facing up at z = 0; closed with a bottom and sides if it has a
/// thickness, else an open sheet.
TriangleMesh plate(double thickness_m) {
  constexpr std::uint32_t kColumns = 20;
  constexpr std::uint32_t kRows = 12;
  constexpr double kCell = 0.005;
  TriangleMesh mesh;
  const auto vertex = [](std::uint32_t layer, std::uint32_t row, std::uint32_t column) {
    return (layer * (kRows + 1) + row) * (kColumns + 1) + column;
  };
  const auto quad = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
    mesh.triangles.push_back({a, b, c});
    mesh.triangles.push_back({a, c, d});
  };
  const std::uint32_t layers = thickness_m > 0.0 ? 2 : 1;
  for (std::uint32_t layer = 0; layer < layers; ++layer) {
    for (std::uint32_t row = 0; row <= kRows; ++row) {
      for (std::uint32_t column = 0; column <= kColumns; ++column) {
        mesh.vertices_m.emplace_back(kCell * column - 0.05, kCell * row - 0.03,
                                     -thickness_m * layer);
      }
    }
  }
  for (std::uint32_t row = 0; row < kRows; ++row) {
    for (std::uint32_t column = 0; column < kColumns; ++column) {
      quad(vertex(0, row, column), vertex(0, row, column + 1), vertex(0, row + 1, column + 1),
           vertex(0, row + 1, column));
      if (layers == 1) continue;
      quad(vertex(1, row, column), vertex(1, row + 1, column), vertex(1, row + 1, column + 1),
           vertex(1, row, column + 1));
    }
  }
  const auto side = [&](std::uint32_t row, std::uint32_t column, std::uint32_t to_row,
                        std::uint32_t to_column) {
    quad(vertex(0, to_row, to_column), vertex(0, row, column), vertex(1, row, column),
         vertex(1, to_row, to_column));
  };
  for (std::uint32_t i = 0; layers == 2 && i < kColumns; ++i) {
    side(0, i, 0, i + 1);
    side(kRows, i + 1, kRows, i);
  }
  for (std::uint32_t i = 0; layers == 2 && i < kRows; ++i) {
    side(i + 1, 0, i, 0);
    side(i, kColumns, i + 1, kColumns);
  }
  return mesh;
}

Surface of_triangles(const test::TempFolder& folder, const std::string& name,
                     const TriangleMesh& mesh, double side_hz) {
  std::string text;
  for (const Vector3& v : mesh.vertices_m) {
    text += fmt::format("v {:.9g} {:.9g} {:.9g}\n", v.x(), v.y(), v.z());
  }
  for (const auto& [a, b, c] : mesh.triangles) {
    text += fmt::format("f {} {} {}\n", a + 1, b + 1, c + 1);
  }
  const std::string file = folder.write(fmt::format("{}.obj", mesh.triangles.size()), text);
  return {.name = fmt::format("{}, {} facets", name, mesh.triangles.size()),
          .geometry = fmt::format("triangle_surface {{ file: \"{}\" }}", file),
          .top_m = farthest(mesh.vertices_m, 2),
          .side_hz = side_hz,
          .right_m = farthest(mesh.vertices_m, 0)};
}

Surface of_tetrahedra(const std::string& file, const std::string& name, bool is_scaled) {
  FileGeometry geometry{.kind = FileGeometry::Kind::kTetrahedralMesh, .file = file};
  std::vector<Vector3> nodes_m;
  if (is_scaled) {
    geometry.unit_m = 1e-3;  // small enough to be accepted, whatever the unit of the file
    const auto mesh = physics::load_tetrahedral_mesh(geometry);
    Eigen::AlignedBox3d box;
    for (const Vector3& node : mesh.nodes_m) box.extend(node);
    geometry.unit_m *= 0.12 / box.sizes().maxCoeff();
  }
  const auto mesh = physics::load_tetrahedral_mesh(geometry);
  return {.name = fmt::format("{}, {} facets", name, physics::surface_of(mesh).triangles.size()),
          .geometry = fmt::format("tetrahedral_mesh {{ file: \"{}\" }} unit_m: {:.17g}",
                                  std::filesystem::absolute(file).string(), geometry.unit_m),
          .top_m = farthest(mesh.nodes_m, 2),
          .right_m = farthest(mesh.nodes_m, 0)};
}

/// 20 480 facets, about 100 mm long and 70 mm high.
double organ_radius_m(const Vector3& d) {
  return 0.05 * (1.0 + 0.15 * d.x() * d.x() - 0.3 * d.z() * d.z() +
                 0.06 * std::sin(5.0 * d.x()) * std::cos(4.0 * d.y()));
}
TriangleMesh fine_organ() { return star_body(5, organ_radius_m); }

/// The same organ in 97,200 facets: a cube of 90 × 90 cells a side, each of two, blown up.
TriangleMesh dense_organ() {
  constexpr std::uint32_t kCells = 90;
  TriangleMesh mesh;
  std::map<std::array<std::uint32_t, 3>, std::uint32_t> vertices;
  const auto vertex = [&](const std::array<std::uint32_t, 3>& place) {
    const auto [found, is_new] =
        vertices.try_emplace(place, static_cast<std::uint32_t>(mesh.vertices_m.size()));
    if (is_new) {
      const Vector3 cell(place[0], place[1], place[2]);
      const Vector3 angle = std::numbers::pi / 4.0 * (2.0 / kCells * cell - Vector3::Ones());
      const Vector3 direction = angle.array().tan().matrix().normalized();
      mesh.vertices_m.emplace_back(organ_radius_m(direction) * direction);
    }
    return found->second;
  };
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (const std::uint32_t side : {0U, kCells}) {
      const auto corner = [&](std::uint32_t a, std::uint32_t b) {
        std::array<std::uint32_t, 3> place{};
        place[axis] = side;
        place[(axis + 1) % 3] = a;
        place[(axis + 2) % 3] = b;
        return vertex(place);
      };
      for (std::uint32_t i = 0; i < kCells; ++i) {
        for (std::uint32_t k = 0; k < kCells; ++k) {
          const std::uint32_t a = corner(i, k);
          std::uint32_t b = corner(i + 1, k);
          const std::uint32_t c = corner(i + 1, k + 1);
          std::uint32_t d = corner(i, k + 1);
          if (side == 0) std::swap(b, d);
          mesh.triangles.push_back({a, b, c});
          mesh.triangles.push_back({a, c, d});
        }
      }
    }
  }
  return mesh;
}

// --- scenes ---------------------------------------------------------------------------------

constexpr const char* kMaterial =
    "kelvin_voigt { stiffness_newton_per_m: 300 damping_newton_s_per_m: 1 }";
constexpr const char* kBlock = "box { center_m { z: -0.02 } size_m { x: 0.12 y: 0.12 z: 0.04 } }";
constexpr const char* kTip = "tip_radius_m: 0.003";
const std::string kOrganCloud =
    "point_cloud { file: \"" + test::source_dir() + "/deploy/sessions/organ.ply\" }";
constexpr double kOrganCloudTop_m[] = {0.012, 0.004, 0.024};

struct Hand {
  Vector3 center_m;
  Vector3 amplitude_m;
  Vector3 hz;
  Vector3 phase_rad;
};

/// Presses 16 mm to and fro at 0.7 Hz, 2 mm above the top, while it moves sideways.
Hand press_on(const Vector3& top_m, double side_hz) {
  return {.center_m = top_m + Vector3(0.0, 0.0, 0.002),
          .amplitude_m = {0.015, 0.004, 0.016},
          .hz = {side_hz, 0.03, 0.7},
          .phase_rad = {-0.94, 0.0, 1.57}};
}

std::string vector_text(const Vector3& v) {
  return fmt::format("{{ x: {} y: {} z: {} }}", v.x(), v.y(), v.z());
}

DisturbedScene scene_of(const test::TempFolder& folder, const std::string& name,
                        const std::string& tool, const std::string& tissues, const Hand& hand,
                        bool has_all_disturbances = false) {
  const std::string text = fmt::format(
      "name: \"bench\" device {{ simulated {{}} }} hand {{ sinusoid {{ "
      "center_m {} amplitude_m {} frequency_hz {} phase_rad {} }} }} "
      "scene {{ tool {{ {} }} {} }}",
      vector_text(hand.center_m), vector_text(hand.amplitude_m), vector_text(hand.hz),
      vector_text(hand.phase_rad), tool, tissues);
  return {.name = name,
          .session =
              [&folder, text](const std::vector<std::string>& overrides) {
                return load_session(folder.write("bench.txtpb", text), overrides);
              },
          .has_all_disturbances = has_all_disturbances};
}

std::string tissue(const std::string& geometry, const std::string& material = kMaterial,
                   const std::string& more = "") {
  return fmt::format("tissue {{ {} {} {} }} ", geometry, material, more);
}

/// The material with further fields.
std::string with(const std::string& fields) {
  return fmt::format("kelvin_voigt {{ stiffness_newton_per_m: 300 damping_newton_s_per_m: 1 {} }}",
                     fields);
}

}  // namespace

std::vector<DisturbedScene> disturbed_scenes(const test::TempFolder& folder,
                                             const std::vector<std::string>& meshes) {
  const std::string sessions = test::source_dir() + "/deploy/sessions/";
  const Vector3 cloud_top_m(kOrganCloudTop_m[0], kOrganCloudTop_m[1], kOrganCloudTop_m[2]);
  const Surface organ = of_tetrahedra(sessions + "organ.msh", "organ (liver)", false);
  const Surface fine = of_triangles(folder, "fine organ", fine_organ(), 0.07);
  Random random(1);
  std::vector<Surface> surfaces{
      {.name = "block (box)", .geometry = kBlock, .top_m = Vector3::Zero()},
      organ,
      {.name = "organ (cloud)", .geometry = kOrganCloud, .top_m = cloud_top_m},
      fine,
      of_triangles(folder, "rock",
                   star_body(1, [&](const Vector3&) { return random.uniform(0.034, 0.04); }), 0.5),
      of_triangles(folder, "ribbed plate", ribbed_plate(), 0.5)};
  for (const std::string& file : meshes) {
    surfaces.push_back(of_tetrahedra(file, std::filesystem::path(file).stem().string(), true));
  }
  std::vector<DisturbedScene> scenes;
  for (const Surface& surface : surfaces) {
    scenes.push_back(scene_of(folder, surface.name, kTip, tissue(surface.geometry),
                              press_on(surface.top_m, surface.side_hz), true));
  }
  const auto add = [&](const std::string& name, const std::string& tissues, const Hand& hand,
                       const std::string& tool = kTip) {
    scenes.push_back(scene_of(folder, name, tool, tissues, hand));
  };

  // thin: the hand reaches 12 mm below
  const Hand on_plane = press_on(Vector3::Zero(), 0.07);
  add("thin plate (2 mm)", tissue(of_triangles(folder, "plate", plate(0.002), 0.0).geometry),
      on_plane);
  add("open sheet", tissue(of_triangles(folder, "sheet", plate(0.0), 0.0).geometry), on_plane);

  // a shaft that leans on a rod or an organ beside it, above the tip
  const std::string with_shaft = fmt::format("{} shaft_length_m: 0.1 shaft_radius_m: 0.002", kTip);
  const auto lean = [](const Vector3& side_m) {
    return Hand{.center_m = side_m + Vector3(0.004, 0.0, -0.035),
                .amplitude_m = {0.012, 0.004, 0.004},
                .hz = {0.7, 0.03, 0.07},
                .phase_rad = {1.57, 0.0, 0.0}};
  };
  add("shaft on a capsule",
      tissue("capsule { from_m { y: -0.05 } to_m { y: 0.05 } radius_m: 0.02 }"),
      lean({0.02, 0.0, 0.0}), with_shaft);
  add("shaft on the organ (liver)", tissue(organ.geometry), lean(organ.right_m), with_shaft);
  add("shaft on the fine organ", tissue(fine.geometry), lean(fine.right_m), with_shaft);
  scenes.back().is_in_excerpt = false;  // takes as long as all others

  // fast, and far away: descriptions that have to keep up; each begins outside the tissue
  const Surface dense = of_triangles(folder, "dense organ", dense_organ(), 0.0);
  const auto far = [](double delay_ms, double rate_hz) {
    return OwnDisturbance{fmt::format("{:g} ms each way, {:g} Hz", delay_ms, rate_hz),
                          {fmt::format("faults.tool_motion.delay_ms={}", delay_ms),
                           fmt::format("faults.interaction.delay_ms={}", delay_ms),
                           fmt::format("physics.rate_hz={}", rate_hz)}};
  };
  const auto add_far = [&](const std::string& name, const std::string& tissues, const Hand& hand,
                           const std::vector<OwnDisturbance>& rows,
                           const std::string& tool = kTip) {
    add(name, tissues, hand, tool);
    scenes.back().is_in_excerpt = false;
    scenes.back().own_disturbances = rows;
  };
  OwnDisturbance bad = far(80.0, 30.0);
  bad.name = "80 … 110 ms, 10 % lost, bursts, 30 Hz";
  for (const char* hop : {"tool_motion", "interaction"}) {
    for (const char* fault :
         {"jitter_ms=30", "loss_ratio=0.1", "burst_ratio=0.01", "burst_length=10"}) {
      bad.overrides.push_back(fmt::format("faults.{}.{}", hop, fault));
    }
  }
  Hand slide{.center_m = dense.top_m - Vector3(dense.top_m.x(), dense.top_m.y(), 0.004),
             .amplitude_m = {0.03, 0.02, 0.0062},
             .hz = {0.8, 0.11, 0.3},
             .phase_rad = {0.0, 0.0, 1.57}};
  add_far("slide at 150 mm/s, " + dense.name, tissue(dense.geometry), slide,
          {far(55.0, 90.0), far(55.0, 250.0), far(55.0, 1000.0), bad});
  slide.hz.x() = 1.6;
  add_far("slide at 300 mm/s, " + dense.name, tissue(dense.geometry), slide, {far(55.0, 90.0)});
  add_far("shaft on the " + dense.name, tissue(dense.geometry), lean(dense.right_m),
          {far(55.0, 90.0)}, with_shaft);
  add_far("scrub at 4 Hz, organ (cloud)", tissue(kOrganCloud),
          {.center_m = cloud_top_m - Vector3(0.0, 0.0, 0.002),
           .amplitude_m = {0.015, 0.004, 0.0035},
           .hz = {4.0, 0.1, 0.3},
           .phase_rad = {0.0, 0.0, 1.57}},
          {far(40.0, 60.0)});

  // laws and motions that are hard to render, each beside the run without a controller
  const auto add_hard = [&](const std::string& name, const std::string& tissues, const Hand& hand,
                            const std::vector<OwnDisturbance>& rows = {}) {
    add(name, tissues, hand);
    scenes.back().is_in_excerpt = false;
    scenes.back().own_disturbances = rows;
    scenes.back().has_uncontrolled = true;
  };
  // 15 mm to each side of the centre while the hand sinks from `high_m` to `low_m` within 5 s
  const auto circle = [](double high_m, double low_m) {
    constexpr double kQuarter = 0.5 * std::numbers::pi;
    return Hand{.center_m = {0.0, 0.0, 0.5 * (high_m + low_m)},
                .amplitude_m = {0.015, 0.015, 0.5 * (high_m - low_m)},
                .hz = {0.7, 0.7, 0.1},
                .phase_rad = {0.0, kQuarter, kQuarter}};
  };
  const auto taps = [](double center_m, double amplitude_m, double hz) {
    return Hand{.center_m = {0.0, 0.0, center_m},
                .amplitude_m = {0.0, 0.0, amplitude_m},
                .hz = {0.0, 0.0, hz},
                .phase_rad = {0.0, 0.0, 0.5 * std::numbers::pi}};
  };
  const auto power_law = [](double k, double b, double n) {
    return fmt::format(
        "hunt_crossley {{ stiffness_newton_per_m: {} damping_newton_s_per_m: {} exponent: {} }}", k,
        b, n);
  };
  const std::string rubs = with("friction_coefficient: 0.5");
  add_hard("circle with friction 0.5 (box)", tissue(kBlock, rubs), circle(0.008, -0.016));
  add_hard("circle with friction 0.5, begun in the tissue", tissue(kBlock, rubs),
           {.center_m = {0.0, 0.0, -0.01},
            .amplitude_m = {0.015, 0.015, 0.001},
            .hz = {0.7, 0.7, 0.3},
            .phase_rad = {0.0, 0.5 * std::numbers::pi, 0.0}});
  const std::string ball = "sphere { radius_m: 0.05 }";
  add_hard("circle on a sphere, Hunt-Crossley n 2.2", tissue(ball, power_law(300, 5, 2.2)),
           circle(0.059, 0.041));
  add_hard("taps at 5 Hz, Hunt-Crossley n 1.5", tissue(kBlock, power_law(500, 1, 1.5)),
           taps(0.002, 0.008, 5.0));
  add_hard("taps at 5 Hz, Hunt-Crossley n 2.2", tissue(kBlock, power_law(300, 10, 2.2)),
           taps(0.002, 0.008, 5.0));
  const std::string viscous =
      "kelvin_voigt { stiffness_newton_per_m: 300 damping_newton_s_per_m: 80 }";
  for (const double hz : {1.0, 2.0, 3.0}) {
    add_hard(fmt::format("taps at {:g} Hz, 80 N s/m", hz), tissue(kBlock, viscous),
             taps(0.002, 0.012, hz));
  }
  add_hard("puncture at 1.5 N", tissue(kBlock, with("puncture_newton: 1.5")), on_plane);
  add_hard("puncture of the organ (liver)", tissue(organ.geometry, with("puncture_newton: 1.4")),
           press_on(organ.top_m, 0.07), {far(60.0, 60.0)});
  const std::string breath = "motion { amplitude_m { z: 0.003 } frequency_hz: 0.25 }";
  const std::vector<OwnDisturbance> unequal{
      {"80 ms there, 0 ms back", {"faults.tool_motion.delay_ms=80"}},
      {"0 ms there, 80 ms back", {"faults.interaction.delay_ms=80"}},
      bad};
  add_hard("breathing organ (liver)", tissue(organ.geometry, kMaterial, breath),
           press_on(organ.top_m, 0.07), unequal);
  add_hard("breathing wall", tissue("half_space {}", kMaterial, breath), on_plane, unequal);
  Hand slow = press_on(Vector3::Zero(), 0.07);
  slow.hz.z() = 0.2;  // the first touch comes after the first description
  const OwnDisturbance farthest{
      "500 ms each way, 10 % lost, 50 Hz",
      {"faults.tool_motion.delay_ms=500", "faults.interaction.delay_ms=500",
       "faults.tool_motion.loss_ratio=0.1", "faults.interaction.loss_ratio=0.1",
       "physics.rate_hz=50"}};
  add_hard("block (box), slowly", tissue(kBlock), slow, {farthest});
  slow.center_m += organ.top_m;
  add_hard("organ (liver), slowly", tissue(organ.geometry), slow, {farthest});
  slow.center_m += cloud_top_m - organ.top_m;
  add_hard("organ (cloud), slowly", tissue(kOrganCloud), slow, {farthest});

  add("several tissues",
      tissue(kBlock) + tissue("sphere { center_m { x: -0.012 z: -0.004 } radius_m: 0.01 }") +
          tissue("capsule { from_m { x: 0.01 y: -0.02 z: -0.003 } to_m { x: 0.014 y: 0.02 "
                 "z: -0.003 } radius_m: 0.006 }") +
          tissue(organ.geometry, kMaterial,
                 fmt::format("position_m {}", vector_text(-organ.top_m))),
      press_on(Vector3(0.0, 0.0, 0.003), 0.5));
  add("puncture", tissue(kBlock, with("puncture_newton: 1.2 cutting_newton: 0.4")), on_plane);
  add("friction", tissue(kBlock, with("friction_coefficient: 0.5")),
      press_on(Vector3::Zero(), 0.5));
  add("relaxation",
      tissue(kBlock, with("relaxing_stiffness_newton_per_m: 300 relaxation_time_ms: 200")),
      on_plane);
  add("inclusion",
      tissue(kBlock, with("inclusion { center_m { x: 0.005 z: -0.008 } radius_m: 0.008 "
                          "stiffness_newton_per_m: 1200 }")),
      on_plane);
  add("stiffness map (cloud)", tissue(kOrganCloud, with("stiffness_property: \"stiffness_ratio\"")),
      press_on(cloud_top_m, 0.07));
  for (const TissueScene& one : tissue_scenes()) {
    const std::string name = one.name;
    if (name != "soft/stiff edge" && name != "moves, relaxes") continue;
    scenes.push_back({.name = name,
                      .session = [one](const auto& more) { return session_of(one, more); },
                      .has_all_disturbances = false,
                      .seconds = one.seconds});
  }
  return scenes;
}

}  // namespace palpate::bench
