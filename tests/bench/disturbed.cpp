#include "tests/bench/disturbed.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>

#include "common/core/random.h"
#include "common/session/session_file.h"
#include "deploy/lockstep/loopback.h"
#include "physics_node/files/surface_files.h"
#include "physics_node/surfaces/subdivision.h"
#include "tests/support/temp_folder.h"

namespace palpate::bench {
namespace {

using physics::TriangleMesh;

// --- surfaces -------------------------------------------------------------------------------

struct Surface {
  std::string name;
  std::string geometry;   ///< of the tissue, in the text of a session
  Vector3 top_m;          ///< its highest point
  double side_hz = 0.07;  ///< of the hand's way to and fro along x, ± 15 mm
};

Vector3 highest(const std::vector<Vector3>& points_m) {
  return *std::max_element(points_m.begin(), points_m.end(),
                           [](const Vector3& a, const Vector3& b) { return a.z() < b.z(); });
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
  return {fmt::format("{}, {} facets", name, mesh.triangles.size()),
          fmt::format("triangle_surface {{ file: \"{}\" }}", file), highest(mesh.vertices_m),
          side_hz};
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
  return {fmt::format("{}, {} facets", name, physics::surface_of(mesh).triangles.size()),
          fmt::format("tetrahedral_mesh {{ file: \"{}\" }} unit_m: {:.17g}",
                      std::filesystem::absolute(file).string(), geometry.unit_m),
          highest(mesh.nodes_m)};
}

std::vector<Surface> surfaces(const test::TempFolder& folder,
                              const std::vector<std::string>& meshes) {
  const std::string sessions = PALPATE_SOURCE_DIR "/deploy/sessions/";
  Random random(1);
  std::vector<Surface> all{
      {.name = "block (box)",
       .geometry = "box { center_m { z: -0.02 } size_m { x: 0.12 y: 0.12 z: 0.04 } }",
       .top_m = Vector3::Zero()},
      of_tetrahedra(sessions + "organ.msh", "organ (liver)", false),
      {.name = "organ (cloud)",
       .geometry = "point_cloud { file: \"" + sessions + "organ.ply\" }",
       .top_m = {0.012, 0.004, 0.024}},
      of_triangles(folder, "fine organ",
                   star_body(5,
                             [](const Vector3& d) {
                               return 0.05 * (1.0 + 0.15 * d.x() * d.x() - 0.3 * d.z() * d.z() +
                                              0.06 * std::sin(5.0 * d.x()) * std::cos(4.0 * d.y()));
                             }),
                   0.07),
      of_triangles(folder, "rock",
                   star_body(1, [&](const Vector3&) { return random.uniform(0.034, 0.04); }), 0.5),
      of_triangles(folder, "ribbed plate", ribbed_plate(), 0.5)};
  for (const std::string& file : meshes) {
    all.push_back(of_tetrahedra(file, std::filesystem::path(file).stem().string(), true));
  }
  return all;
}

// --- disturbances ---------------------------------------------------------------------------

struct Disturbance {
  std::string name;
  std::vector<std::string> overrides{};
  std::vector<FaultWindow> windows{};  ///< of hops 2 and 3
};

std::vector<std::string> on_both_hops(const std::string& field, double value) {
  return {fmt::format("faults.tool_motion.{}={}", field, value),
          fmt::format("faults.interaction.{}={}", field, value)};
}

/// Stalls as the Wi-Fi hop of a campus makes them. Every 100 ms the latency of the hop is drawn
/// from the log-normal distribution whose 90th and 99th percentiles are 20 and 250 ms
/// (docs/theory.md §8, [Sui16]); its median is 0.9 ms. Messages of that time wait in order until it
/// is over.
std::vector<FaultWindow> wifi_stalls(double seconds) {
  constexpr double kNormal90 = 1.2816;  // quantiles of the standard normal distribution
  constexpr double kNormal99 = 2.3263;
  const double sigma = std::log(250.0 / 20.0) / (kNormal99 - kNormal90);
  const double mu = std::log(0.020) - kNormal90 * sigma;
  Random random(16);
  std::vector<FaultWindow> windows;
  for (double at_s = 0.1; at_s < seconds;) {
    const double latency_s = std::min(std::exp(mu + sigma * random.normal()), 1.0);
    windows.push_back({.kind = FaultWindow::Kind::kStall,
                       .from = from_seconds(at_s),
                       .until = from_seconds(at_s + latency_s)});
    at_s += std::max(0.1, latency_s);
  }
  return windows;
}

std::vector<Disturbance> disturbances(double seconds) {
  std::vector<Disturbance> all;
  for (const double delay_ms : {20.0, 50.0, 100.0}) {
    all.push_back({fmt::format("{:g} ms each way", delay_ms), on_both_hops("delay_ms", delay_ms)});
  }
  for (const double delay_ms : {0.0, 20.0, 50.0, 100.0}) {
    Disturbance one{fmt::format("{:g} ms, 20 % lost, 50 Hz", delay_ms),
                    on_both_hops("delay_ms", delay_ms)};
    for (const std::string& loss : on_both_hops("loss_ratio", 0.2)) one.overrides.push_back(loss);
    one.overrides.emplace_back("physics.rate_hz=50");
    all.push_back(one);
  }
  Disturbance jitter{"20 … 40 ms, jitter", on_both_hops("delay_ms", 20)};
  for (const std::string& more : on_both_hops("jitter_ms", 20)) jitter.overrides.push_back(more);
  all.push_back(jitter);
  for (const auto& [hop, field] : {std::pair{2, "tool_motion"}, {3, "interaction"}}) {
    all.push_back({fmt::format("bursts of 20, 1 %, hop {}", hop),
                   {fmt::format("faults.{}.burst_ratio=0.01", field),
                    fmt::format("faults.{}.burst_length=20", field)}});
  }
  all.push_back({"stalls of 50 ms, 5/s, hop 3",
                 {"faults.interaction.stall={from_s: 0.1 until_s: 0.15 every_s: 0.2}"}});
  all.push_back({"Wi-Fi of a campus", {}, wifi_stalls(seconds)});
  // the packet delay budget (50 ms) and error rate (10⁻³) of 5QI 3, "real time gaming", used up
  Disturbance mobile{"mobile, limits of 5QI 3", on_both_hops("delay_ms", 20)};
  for (const auto& [field, value] : {std::pair{"jitter_ms", 30.0}, {"loss_ratio", 1e-3}}) {
    for (const std::string& more : on_both_hops(field, value)) mobile.overrides.push_back(more);
  }
  all.push_back(mobile);
  for (const int ms : {2, 4, 6}) {
    all.push_back({fmt::format("answers missing {} ms, 20/s", ms),
                   {fmt::format("faults.force_command.outage={{from_s: 0.02 until_s: {} "
                                "every_s: 0.05}}",
                                0.02 + 1e-3 * ms)}});
  }
  all.push_back(
      {"5 % of the answers 2 ms late",
       {"faults.force_command.reorder_ratio=0.05", "faults.force_command.reorder_delay_ms=2"}});
  for (const double percent : {1.0, 5.0, 20.0}) {
    all.push_back({fmt::format("{:g} % of hop 1 lost", percent),
                   {fmt::format("faults.device_state.loss_ratio={}", 0.01 * percent)}});
  }
  return all;
}

/// The hand presses 16 mm to and fro at 0.7 Hz, 2 mm above the top, while it moves sideways.
RunStatistics run(const test::TempFolder& folder, const Surface& surface,
                  const Disturbance& disturbance, double seconds) {
  const std::string text = fmt::format(
      "name: \"bench\" device {{ simulated {{}} }} hand {{ sinusoid {{ "
      "center_m {{ x: {} y: {} z: {} }} amplitude_m {{ x: 0.015 y: 0.004 z: 0.016 }} "
      "frequency_hz {{ x: {} y: 0.03 z: 0.7 }} phase_rad {{ x: -0.94 z: 1.57 }} }} }} "
      "scene {{ tool {{ tip_radius_m: 0.003 }} tissue {{ {} "
      "kelvin_voigt {{ stiffness_newton_per_m: 300 damping_newton_s_per_m: 1 }} }} }}",
      surface.top_m.x(), surface.top_m.y(), surface.top_m.z() + 0.002, surface.side_hz,
      surface.geometry);
  Session session = load_session(folder.write("bench.txtpb", text), disturbance.overrides);
  for (LinkFaults* faults : {&session.faults.tool_motion, &session.faults.interaction}) {
    faults->windows.insert(faults->windows.end(), disturbance.windows.begin(),
                           disturbance.windows.end());
  }
  return run_loopback(session, {.seconds = seconds}).statistics;
}

}  // namespace

void run_disturbed(const BenchOptions& options, const std::vector<std::string>& meshes,
                   const std::string& only) {
  const test::TempFolder folder;
  const double seconds = options.is_quick ? 4.0 : 10.0;
  Table table({{"surface", "surface", ""},
               {"disturbance", "disturbance", ""},
               {"capped_transparency", "transp.", "{:.3f}"},
               {"transparency_change", "change", "{:+.3f}"},
               {"force_error_percent", "error %", "{:.1f}"},
               {"force_error_change_percent", "change", "{:+.1f}"},
               {"path_rms_mm", "path mm", "{:.3f}"},
               {"path_rms_change_mm", "change", "{:+.3f}"},
               {"path_peak_mm", "peak mm", "{:.2f}"},
               {"excess_reversals", "exc. rev.", "{:.0f}"},
               {"excess_reversals_change", "change", "{:+.0f}"},
               {"min_true_energy_uj", "min energy µJ", "{:.1f}"}});
  std::vector<Disturbance> all = disturbances(seconds);
  all.insert(all.begin(), {"none"});
  for (const Surface& surface : surfaces(folder, meshes)) {
    if (surface.name.find(only) == std::string::npos) continue;
    std::optional<RunStatistics> undisturbed;
    for (const Disturbance& disturbance : all) {
      const RunStatistics s = run(folder, surface, disturbance, seconds);
      if (!undisturbed) undisturbed = s;
      const auto reversals = static_cast<double>(s.excess_reversals());
      table.add({surface.name, disturbance.name, s.ideal_transparency(),
                 s.ideal_transparency() - undisturbed->ideal_transparency(),
                 100.0 * s.force_error_rms_ratio(),
                 100.0 * (s.force_error_rms_ratio() - undisturbed->force_error_rms_ratio()),
                 1e3 * s.path_deviation_rms_m(),
                 1e3 * (s.path_deviation_rms_m() - undisturbed->path_deviation_rms_m()),
                 1e3 * s.path_deviation_peak_m(), reversals,
                 reversals - static_cast<double>(undisturbed->excess_reversals()),
                 1e6 * s.minimum_true_energy_joule()});
    }
    table.add_gap();
  }
  table.publish(options);
  std::printf(
      "\nThe hand presses 16 mm to and fro, 0.7 times a second for %g s, on 300 N/m and 1 N s/m; "
      "on "
      "rock and ribs it\nalso slides at up to 47 mm/s. Physics at 1 kHz unless stated; delay, loss "
      "and jitter on hops 2 and 3 each.\nChange: against the first row of the surface. Wi-Fi: "
      "log-normal latency with 20 ms at 90 %% and 250 ms at\n99 %% [Sui16], drawn anew every 100 "
      "ms. Mobile: 20 … 50 ms and 0.1 %% loss each way.\n",
      seconds);
}

}  // namespace palpate::bench
