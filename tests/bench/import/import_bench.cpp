// SPDX-License-Identifier: Apache-2.0
// import_bench: what `palpate import` makes of voxels, as a hand feels it. A ball of 30 mm radius
// (E 5.2 kPa, ν 0.45) is voxelised, smoothed and meshed, and a tip of 6 mm radius slides over it
// 3 mm deep, at rest at every place; beside it the ball itself, which never saw a voxel, on a finer
// mesh. Then a stiff lesion in it: how much stiffer it feels than its surroundings.
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

struct Row {
  std::string name;
  std::size_t tetrahedra = 0;
  double cell_mm = kNaN;
  double mesh_s = kNaN;
  double solution_s = kNaN;
  Felt felt{.error_ratio = kNaN, .ripple_ratio = kNaN};
  double stiffer_ratio = kNaN;  ///< force above the lesion over that with no lesion there
};

class Rows {
 public:
  explicit Rows(const BenchOptions& options)
      : options_(options), directions_(slide_over_the_top(5, 0.12)) {}

  void run() {
    // quadratic elements, or many linear ones
    const double reference_m = options_.is_quick ? 1.6e-3 : 2.4e-3;
    Row reference{.name = "ball itself", .cell_mm = 1e3 * reference_m};
    reference_newton_ = slide(timed(reference, [&] { return analytic(reference_m); }), reference);
    reference.felt = {};
    rows_.push_back(reference);
    coarser(1.4 * reference_m);
    for (const double cell_mm : {4.0, 2.8, 2.0}) {
      if (options_.is_quick && cell_mm < 2.0) continue;
      voxelised("voxels of 1.5 mm", kVoxel_mm, cell_mm, {});
    }
    voxelised("voxels of 0.8 x 0.8 x 3 mm", {0.8, 0.8, 3.0}, 2.0, {});
    voxelised("voxels of 1.5 mm, not smoothed", kVoxel_mm, 2.0, {.width_m = 1e-4, .rounds = 1});
    lesions(reference_m);
    publish();
  }

 private:
  [[nodiscard]] bool is_linear() const { return options_.is_quick; }

  template <class Make>
  static physics::TetrahedralMesh timed(Row& row, const Make& make) {
    const double from_s = cpu_s();
    physics::TetrahedralMesh mesh = make();
    row.mesh_s = cpu_s() - from_s;
    row.tetrahedra = mesh.tetrahedra.size();
    return mesh;
  }
  static physics::TetrahedralMesh analytic(double cell_m) {
    return analytic_ball({}, cell_m, kSiteRadius_m);
  }

  std::vector<double> slide(const physics::TetrahedralMesh& mesh, Row& row) {
    const double from_s = cpu_s();
    SlowTouch touch(mesh, kYoung_pa, kLesionYoung_pa, is_linear());
    std::vector<double> newton = slide_newton(touch, directions_);
    row.solution_s = (cpu_s() - from_s) / static_cast<double>(directions_.size());
    progress(row);
    return newton;
  }
  static void progress(const Row& row) {
    std::printf("%s, %zu tetrahedra: done\n", row.name.c_str(), row.tetrahedra);
    std::fflush(stdout);
  }

  /// How far the reference has converged.
  void coarser(double cell_m) {
    Row row{.name = "ball itself, coarser", .cell_mm = 1e3 * cell_m};
    row.felt = felt_of(slide(timed(row, [&] { return analytic(cell_m); }), row), reference_newton_);
    rows_.push_back(row);
  }

  void voxelised(const std::string& name, const Vector3& voxel_mm, double cell_mm,
                 const scan::Smoothing& smoothing) {
    Row row{.name = name, .cell_mm = cell_mm};
    const auto mesh = timed(row, [&] {
      return imported_ball(
                 1e-3 * voxel_mm, {},
                 {.cell_m = 1e-3 * cell_mm, .smoothing = smoothing, .site_radius_m = kSiteRadius_m})
          .mesh;
    });
    row.felt = felt_of(slide(mesh, row), reference_newton_);
    rows_.push_back(row);
  }

  void lesions(double reference_m) {
    const auto add = [&](const std::string& name, double cell_m, const auto& make) {
      Row row{.name = name, .cell_mm = 1e3 * cell_m};
      const physics::TetrahedralMesh mesh = timed(row, make);
      const auto newton = [&](double young_pa) {
        SlowTouch touch(mesh, kYoung_pa, young_pa, is_linear());
        return touch.newton_at(Vector3::UnitZ(), kTouchDepth_m).z();
      };
      row.stiffer_ratio = newton(kLesionYoung_pa) / newton(kYoung_pa);
      progress(row);
      rows_.push_back(row);
    };
    add("lesion itself", reference_m,
        [&] { return analytic_ball(kLesion, reference_m, kSiteRadius_m); });
    reference_stiffer_ = rows_.back().stiffer_ratio;
    for (const double cell_mm : {4.0, 2.8, 2.0}) {
      add("lesion, voxels of 1.5 mm", 1e-3 * cell_mm, [&] {
        return imported_ball(1e-3 * kVoxel_mm, kLesion,
                             {.cell_m = 1e-3 * cell_mm, .site_radius_m = kSiteRadius_m})
            .mesh;
      });
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
                 {"stiffer_ratio", "above the lesion", "{:.3f}"},
                 {"stiffer_error_percent", "error %", "{:+.2f}"}});
    for (const Row& row : rows_) {
      table.add({row.name, static_cast<double>(row.tetrahedra), row.cell_mm, row.mesh_s,
                 row.solution_s, 100.0 * row.felt.error_ratio, 100.0 * row.felt.ripple_ratio,
                 row.stiffer_ratio, 100.0 * (row.stiffer_ratio / reference_stiffer_ - 1.0)});
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
