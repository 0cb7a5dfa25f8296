// SPDX-License-Identifier: Apache-2.0
// import_bench: what `palpate import` makes of voxels, as a hand feels it. A ball of 30 mm radius
// (E 5.2 kPa, ν 0.45) is voxelised, smoothed and meshed, and a tip of 6 mm radius slides over it
// 3 mm deep, at rest at every place; beside it the ball itself, by a program that shares no mesh,
// no element and no contact with it (axisymmetric_ball.h). Then a stiff lesion in it: how much
// stiffer it feels than its surroundings.
#include <spdlog/fmt/fmt.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "tests/bench/bench_output.h"
#include "tests/bench/elastic/elastic_rows.h"
#include "tests/bench/import/axisymmetric_ball.h"
#include "tests/bench/import/touched_sphere.h"

namespace {

using namespace palpate;
using namespace palpate::bench;

constexpr double kYoung_pa = 5200.0;
constexpr double kLesionYoung_pa = 20'200.0;
constexpr double kSiteRadius_m = 0.010;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
const Ball kLesion{.centre_m = {0.0, 0.0, 0.019}, .radius_m = 0.007};
const Vector3 kVoxel_mm = Vector3::Constant(1.5);
constexpr AxisymmetricBall kBall{
    .radius_m = kBallRadius_m, .tip_radius_m = kTouchRadius_m, .young_pa = kYoung_pa};
constexpr double kReference_m = 0.4e-3;  // of elements below the tip
constexpr double kDeep_m = 0.006;        // a radius of the tip

struct Row {
  std::string name;
  std::size_t tetrahedra = 0;
  double cell_mm = kNaN;
  double mesh_s = kNaN;
  double solution_s = kNaN;
  double newton = kNaN;
  double deep_newton = kNaN;
  double deep_error_ratio = kNaN;
  Felt felt{.error_ratio = kNaN, .ripple_ratio = kNaN};
  double stiffer_ratio = kNaN;  ///< force above the lesion over that with no lesion there
};

class Rows {
 public:
  explicit Rows(const BenchOptions& options)
      : options_(options), directions_(slide_over_the_top(5, 0.12)) {}

  void run() {
    rows_.push_back(axisymmetric("ball itself", kBall, kReference_m));
    rows_.push_back(axisymmetric("ball itself, coarser", kBall, 2.0 * kReference_m));
    rows_[1].felt.error_ratio = rows_[1].newton / rows_[0].newton - 1.0;
    rows_[1].deep_error_ratio = rows_[1].deep_newton / rows_[0].deep_newton - 1.0;
    reference_newton_.assign(directions_.size(), rows_[0].newton);
    for (const double cell_mm : cells_mm()) {
      add({.name = "tetrahedra without voxels", .cell_mm = cell_mm},
          [&] { return analytic_ball({}, 1e-3 * cell_mm, kSiteRadius_m); });
    }
    for (const double cell_mm : cells_mm()) voxelised("voxels of 1.5 mm", kVoxel_mm, cell_mm, {});
    voxelised("voxels of 0.8 x 0.8 x 3 mm", {0.8, 0.8, 3.0}, cells_mm().back(), {});
    voxelised("voxels of 1.5 mm, not smoothed", kVoxel_mm, cells_mm().back(),
              {.width_m = 1e-4, .rounds = 1});
    lesions();
    publish();
  }

 private:
  /// As a session of `palpate import` has them.
  [[nodiscard]] static bool has_linear_elements(const physics::TetrahedralMesh& mesh) {
    return mesh.tetrahedra.size() > scan::kMostQuadratic;
  }
  [[nodiscard]] std::vector<double> cells_mm() const {
    if (options_.is_quick) return {4.0};
    return {4.0, 2.8, 2.0};
  }

  static Row axisymmetric(const std::string& name, const AxisymmetricBall& ball, double cell_m) {
    Row row{.name = name, .cell_mm = 1e3 * cell_m};
    const double from_s = cpu_s();
    AxisymmetricPress press(ball, cell_m);
    row.newton = press.newton_at(kTouchDepth_m);
    row.deep_newton = press.newton_at(kDeep_m);
    row.solution_s = cpu_s() - from_s;
    progress(row);
    return row;
  }

  /// Makes a mesh and slides over it.
  template <class Make>
  void add(Row row, const Make& make) {
    const double from_s = cpu_s();
    const physics::TetrahedralMesh mesh = make();
    row.mesh_s = cpu_s() - from_s;
    row.tetrahedra = mesh.tetrahedra.size();
    SlowTouch touch(mesh, kYoung_pa, kLesionYoung_pa, has_linear_elements(mesh));
    row.felt = felt_of(slide_newton(touch, directions_), reference_newton_);
    row.deep_error_ratio =
        touch.newton_at(Vector3::UnitZ(), kDeep_m).z() / rows_[0].deep_newton - 1.0;
    row.solution_s = (cpu_s() - from_s - row.mesh_s) / static_cast<double>(directions_.size());
    progress(row);
    rows_.push_back(row);
  }
  static void progress(const Row& row) {
    std::printf("%s, %zu tetrahedra: done\n", row.name.c_str(), row.tetrahedra);
    std::fflush(stdout);
  }

  void voxelised(const std::string& name, const Vector3& voxel_mm, double cell_mm,
                 const scan::Smoothing& smoothing) {
    add({.name = name, .cell_mm = cell_mm}, [&] {
      return imported_ball(
                 1e-3 * voxel_mm, {},
                 {.cell_m = 1e-3 * cell_mm, .smoothing = smoothing, .site_radius_m = kSiteRadius_m})
          .mesh;
    });
  }

  void lesions() {
    AxisymmetricBall lesion = kBall;
    lesion.lesion_young_pa = kLesionYoung_pa;
    lesion.lesion_radius_m = kLesion.radius_m;
    lesion.lesion_z_m = kLesion.centre_m.z();
    const auto stiffer = [&](const std::string& name, double cell_m, const Row& without) {
      const double newton = without.newton;
      rows_.push_back(axisymmetric(name, lesion, cell_m));
      return rows_.back().stiffer_ratio = rows_.back().newton / newton;
    };
    reference_stiffer_ = stiffer("lesion itself", kReference_m, rows_[0]);
    stiffer("lesion itself, coarser", 2.0 * kReference_m, rows_[1]);
    for (const double cell_mm : cells_mm()) {
      Row row{.name = "lesion, voxels of 1.5 mm", .cell_mm = cell_mm};
      const physics::TetrahedralMesh mesh =
          imported_ball(1e-3 * kVoxel_mm, kLesion,
                        {.cell_m = 1e-3 * cell_mm, .site_radius_m = kSiteRadius_m})
              .mesh;
      row.tetrahedra = mesh.tetrahedra.size();
      const auto newton = [&](double young_pa) {
        SlowTouch touch(mesh, kYoung_pa, young_pa, has_linear_elements(mesh));
        return touch.newton_at(Vector3::UnitZ(), kTouchDepth_m).z();
      };
      row.stiffer_ratio = newton(kLesionYoung_pa) / newton(kYoung_pa);
      progress(row);
      rows_.push_back(row);
    }
  }

  void publish() const {
    Table table({{"case", "ball of 30 mm radius", "{}"},
                 {"tetrahedra", "tetrahedra", "{:.0f}"},
                 {"cell_mm", "cell mm", "{:.1f}"},
                 {"mesh_s", "mesh, CPU s", "{:.2f}"},
                 {"solution_s", "solution, CPU s", "{:.2f}"},
                 {"force_error_percent", "force error %", "{:+.2f}"},
                 {"ripple_percent", "ripple %", "{:.2f}"},
                 {"deep_error_percent", "6 mm deep %", "{:+.2f}"},
                 {"stiffer_ratio", "above the lesion", "{:.3f}"},
                 {"stiffer_error_percent", "error %", "{:+.2f}"}});
    for (const Row& row : rows_) {
      table.add({row.name, static_cast<double>(row.tetrahedra), row.cell_mm, row.mesh_s,
                 row.solution_s, 100.0 * row.felt.error_ratio, 100.0 * row.felt.ripple_ratio,
                 100.0 * row.deep_error_ratio, row.stiffer_ratio,
                 100.0 * (row.stiffer_ratio / reference_stiffer_ - 1.0)});
    }
    table.publish(options_);
    if (!options_.plot_folder.empty()) draw();
  }

  /// Error of the contact force against tetrahedra and time.
  void draw() const {
    std::string points;
    for (const Row& row : rows_) {
      if (row.name != "voxels of 1.5 mm") continue;
      points += fmt::format("{} {:g} {:g} {:g}\n", row.tetrahedra, row.mesh_s + row.solution_s,
                            100.0 * std::abs(row.felt.error_ratio), 100.0 * row.felt.ripple_ratio);
    }
    draw_figure(options_.plot_folder, "import_error",
                fmt::format(R"($points << END
{}END
set terminal svg size 1000,420 dynamic background rgb 'white' font 'sans,11'
set output 'import_error.svg'
set multiplot layout 1,2 title 'Voxelised ball: error of the contact force against the ball itself'
set logscale xy
set grid
set ylabel '%'
set xlabel 'tetrahedra'
plot $points using 1:3 with linespoints pt 7 title 'mean force', \
 $points using 1:4 with linespoints pt 5 title 'ripple'
set xlabel 'mesh and one solution, CPU s'
plot $points using 2:3 with linespoints pt 7 title 'mean force', \
 $points using 2:4 with linespoints pt 5 title 'ripple'
unset multiplot
)",
                            points));
  }

  const BenchOptions& options_;
  std::vector<Vector3> directions_;
  std::vector<double> reference_newton_;
  double reference_stiffer_ = kNaN;
  std::vector<Row> rows_;
};

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"What the import of a label map does to what a hand feels."};
  BenchOptions options;
  return run_bench(app, options, argc, argv, [&] { Rows(options).run(); });
}
