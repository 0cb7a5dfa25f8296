// SPDX-License-Identifier: Apache-2.0
// contact_bench: run time against error of contact with point clouds, beside the k-d trees of
// nanoflann and CGAL where they are installed.
//
// Errors are those of views from places up to 3 mm below the surface of shapes whose distance has a
// closed form; the error of the force is in percent of the force at 3 mm, at any stiffness. Whole
// steps, and what they skip: contact_steps.cpp. Times are of single calls, on the machine's clock.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <numbers>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "common/core/random.h"
#include "physics_node/surfaces/cloud_surface.h"
#include "tests/bench/bench_output.h"
#include "tests/bench/contact_rows.h"
#include "tests/support/sampled_clouds.h"

#ifdef PALPATE_HAS_NANOFLANN
#include <nanoflann.hpp>
#endif
#ifdef PALPATE_HAS_CGAL
#include <CGAL/Orthogonal_k_neighbor_search.h>
#include <CGAL/Search_traits_3.h>
#include <CGAL/Simple_cartesian.h>
#endif

namespace {

using namespace palpate;
using bench::BenchClock;
using bench::BenchOptions;
using bench::Row;
using bench::seconds_since;
using bench::sink;
using bench::Table;
using bench::time_each;
using physics::CloudSurface;
using physics::Octree;
using test::Sampling;
using test::Shape;

constexpr std::size_t kNeighbors = 20;
constexpr double kRadius_m = 0.05;

// --- time against error -------------------------------------------------------------------------

void measure_errors(const BenchOptions& options, Table& table) {
  constexpr double kDepth_m = 3e-3;
  const std::vector<double> spacings =
      options.is_quick ? std::vector{2e-3, 1e-3} : std::vector{4e-3, 2e-3, 1e-3, 5e-4};
  const std::vector<double> noises_m =
      options.is_quick ? std::vector{0.0, 1e-4} : std::vector{0.0, 3e-5, 1e-4, 3e-4};
  for (const Shape& shape : {test::plane_shape(0.05), test::sphere_shape(kRadius_m),
                             test::torus_shape(0.05, 0.02), test::saddle_shape(0.1, 0.05)}) {
    for (const double spacing_m : spacings) {
      for (const double noise_m : noises_m) {
        for (const bool has_normals : {true, false}) {
          Random random(1);
          const auto cloud =
              test::sampled(shape, spacing_m, noise_m, has_normals, Sampling::kRandom, random);
          const BenchClock::time_point start = BenchClock::now();
          const CloudSurface surface(cloud);
          Row row{.group = "error",
                  .name = shape.name,
                  .method = has_normals ? "normals given" : "estimated",
                  .points = static_cast<double>(cloud.points_m.size()),
                  .spacing_m = spacing_m,
                  .noise_m = noise_m,
                  .build_s = seconds_since(start)};

          std::vector<Vector3> places;
          while (places.size() < (options.is_quick ? 2000U : 20000U)) {
            const Vector3 on_surface = shape.point(random.uniform(), random.uniform());
            if (!shape.is_inside_border(on_surface)) continue;
            places.push_back(on_surface -
                             random.uniform(0, kDepth_m) * shape.view(on_surface).normal);
          }
          std::vector<SurfaceView> seen(places.size());
          row.times =
              time_each(places.size(), [&](std::size_t i) { seen[i] = surface.view(places[i]); });
          double distance = 0.0;
          double most = 0.0;
          double normal = 0.0;
          double curvature = 0.0;
          double true_curvature = 0.0;
          for (std::size_t i = 0; i < places.size(); ++i) {
            const SurfaceView truth = shape.view(places[i]);
            const double error = seen[i].distance_m - truth.distance_m;
            distance += error * error;
            most = std::max(most, std::abs(error));
            normal += std::pow(std::acos(std::min(1.0, seen[i].normal.dot(truth.normal))), 2);
            curvature += (seen[i].curvature_per_m - truth.curvature_per_m).squaredNorm();
            true_curvature += truth.curvature_per_m.squaredNorm();
          }
          const auto count = static_cast<double>(places.size());
          row.force_rms_percent = 100.0 * std::sqrt(distance / count) / kDepth_m;
          row.force_max_percent = 100.0 * most / kDepth_m;
          row.normal_rms_deg = std::sqrt(normal / count) * 180.0 / std::numbers::pi;
          if (true_curvature > 0.0) row.curvature_rms_ratio = std::sqrt(curvature / true_curvature);
          row.add_to(table);
        }
      }
    }
    table.add_gap();
  }
}

// --- other trees --------------------------------------------------------------------------------

#ifdef PALPATE_HAS_NANOFLANN
struct NanoflannCloud {
  std::vector<Octree::Point> points;
  [[nodiscard]] std::size_t kdtree_get_point_count() const { return points.size(); }
  [[nodiscard]] float kdtree_get_pt(std::size_t i, std::size_t axis) const {
    const Octree::Point& p = points[i];
    return axis == 0 ? p.x : axis == 1 ? p.y : p.z;
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using NanoflannTree =
    nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, NanoflannCloud>,
                                        NanoflannCloud, 3, std::uint32_t>;
#endif

/// The squared distance of the `kNeighbors`-th nearest point, by brute force.
float true_kth_squared(const std::vector<Octree::Point>& points, const Eigen::Vector3f& center) {
  std::vector<float> squared;
  squared.reserve(points.size());
  for (const Octree::Point& p : points) {
    const float x = center.x() - p.x;
    const float y = center.y() - p.y;
    const float z = center.z() - p.z;
    squared.push_back(x * x + y * y + z * z);
  }
  std::nth_element(squared.begin(), squared.begin() + kNeighbors - 1, squared.end());
  return squared[kNeighbors - 1];
}

/// The 20 nearest neighbours, without a hint, of random places near a sphere of random points.
void measure_neighbors(const BenchOptions& options, Table& table) {
  const std::size_t most = options.is_quick ? 1'000'000 : 10'000'000;
  for (std::size_t count = 1000; count <= most; count *= 10) {
    Random random(2);
    const double spacing_m =
        kRadius_m * std::sqrt(4 * std::numbers::pi / static_cast<double>(count));
    std::vector<Octree::Point> points(count);
    for (Octree::Point& p : points) {
      const Eigen::Vector3f place = (kRadius_m * random.direction()).cast<float>();
      p = {.x = place.x(), .y = place.y(), .z = place.z()};
    }
    std::vector<Eigen::Vector3f> places(options.is_quick ? 20000 : 100000);
    for (Eigen::Vector3f& place : places) {
      place = ((kRadius_m + spacing_m * random.uniform(-3, 3)) * random.direction()).cast<float>();
    }
    constexpr std::size_t kChecked = 20;
    std::vector<float> truth;
    for (std::size_t i = 0; i < kChecked; ++i) truth.push_back(true_kth_squared(points, places[i]));
    // tolerance: trees may add the squares in different order
    const auto wrong = [&](const auto& kth_squared) {
      double result = 0.0;
      for (std::size_t i = 0; i < kChecked; ++i) {
        if (std::abs(kth_squared(places[i]) - truth[i]) > 1e-5F * truth[i]) result += 1.0;
      }
      return result;
    };
    Row row{.group = "20 nearest, cold",
            .name = "sphere, random places",
            .method = "octree",
            .points = static_cast<double>(count),
            .spacing_m = spacing_m};
    const auto per_point = [&](std::size_t bytes) {
      return static_cast<double>(bytes) / static_cast<double>(count);
    };
    {
      const BenchClock::time_point start = BenchClock::now();
      Octree tree(points);
      row.build_s = seconds_since(start);
      tree.forget_order();
      row.bytes_per_point = per_point(tree.bytes());
      const auto kth = [&](const Eigen::Vector3f& place) {
        std::array<Octree::Neighbor, kNeighbors> found;
        Octree::Hint none;
        tree.nearest(place, found, none);
        return found[kNeighbors - 1].squared_distance;
      };
      row.times = time_each(places.size(),
                            [&](std::size_t i) { sink = static_cast<double>(kth(places[i])); });
      row.wrong_neighbors = wrong(kth);
      row.add_to(table);
    }
#ifdef PALPATE_HAS_NANOFLANN
    for (const bool is_sorted : {false, true}) {
      NanoflannCloud cloud{points};
      if (is_sorted) {
        const Octree tree(points);
        cloud.points.assign(tree.points().begin(), tree.points().end());
      }
      row.method = is_sorted ? "nanoflann, points presorted" : "nanoflann";
      const BenchClock::time_point start = BenchClock::now();
      NanoflannTree tree(3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(10));
      tree.buildIndex();
      row.build_s = seconds_since(start);
      row.bytes_per_point = per_point(tree.usedMemory(tree)) + sizeof(Octree::Point);
      const auto kth = [&](const Eigen::Vector3f& place) {
        std::array<std::uint32_t, kNeighbors> index;
        std::array<float, kNeighbors> squared;
        tree.knnSearch(place.data(), kNeighbors, index.data(), squared.data());
        return squared[kNeighbors - 1];
      };
      row.times = time_each(places.size(),
                            [&](std::size_t i) { sink = static_cast<double>(kth(places[i])); });
      row.wrong_neighbors = wrong(kth);
      row.add_to(table);
    }
#endif
#ifdef PALPATE_HAS_CGAL
    if (count <= 1'000'000) {  // more takes too long
      using Kernel = CGAL::Simple_cartesian<double>;
      using Search = CGAL::Orthogonal_k_neighbor_search<CGAL::Search_traits_3<Kernel>>;
      row.method = "CGAL Kd_tree";
      const BenchClock::time_point start = BenchClock::now();
      std::vector<Kernel::Point_3> copies;
      for (const Octree::Point& p : points) copies.emplace_back(p.x, p.y, p.z);
      Search::Tree tree(copies.begin(), copies.end());
      tree.build();
      row.build_s = seconds_since(start);
      row.bytes_per_point = kNaN;  // not reported
      const auto kth = [&](const Eigen::Vector3f& place) {
        Search search(tree, Kernel::Point_3(place.x(), place.y(), place.z()), kNeighbors);
        double last = 0.0;
        for (const auto& found : search) last = std::max(last, found.second);
        return static_cast<float>(last);
      };
      row.times = time_each(places.size() / 4,
                            [&](std::size_t i) { sink = static_cast<double>(kth(places[i])); });
      row.wrong_neighbors = wrong(kth);
      row.add_to(table);
    }
#endif
    table.add_gap();
  }
}

// --- distance, normal and curvature along a path ------------------------------------------------

/// A tool that moves a tenth of the spacing a step, up to three spacings deep.
void measure_views(const BenchOptions& options, Table& table) {
  const std::size_t most = options.is_quick ? 1'000'000 : 10'000'000;
  const Shape shape = test::sphere_shape(kRadius_m);
  for (std::size_t count = 1000; count <= most; count *= 10) {
    Random random(3);
    const double spacing_m = std::sqrt(shape.area_m2 / (static_cast<double>(count) + 0.5));
    const auto cloud =
        test::sampled(shape, spacing_m, 0.1 * spacing_m, true, Sampling::kRandom, random);
    Row row{.group = "view along a path",
            .name = "sphere, noise 0.1 spacing",
            .method = "octree",
            .points = static_cast<double>(cloud.points_m.size()),
            .spacing_m = spacing_m,
            .noise_m = 0.1 * spacing_m};
    const BenchClock::time_point start = BenchClock::now();
    const CloudSurface surface(cloud);
    row.build_s = seconds_since(start);
    row.bytes_per_point =
        static_cast<double>(surface.bytes()) / static_cast<double>(surface.tree().points().size());

    const std::size_t steps = options.is_quick ? 20000 : 100000;
    std::vector<Vector3> places(steps);
    for (std::size_t i = 0; i < steps; ++i) {
      const double angle = 0.1 * spacing_m / kRadius_m * static_cast<double>(i);
      const double depth_m = spacing_m * (1.5 + 1.5 * std::sin(0.01 * static_cast<double>(i)));
      const double tilt = 0.3 * std::sin(0.37 * angle);
      places[i] = (kRadius_m - depth_m) * Vector3(std::cos(angle) * std::cos(tilt),
                                                  std::sin(angle) * std::cos(tilt), std::sin(tilt));
    }
    SurfaceHint hint;
    row.times = time_each(
        steps, [&](std::size_t i) { sink = surface.view(places[i], hint).curvature_per_m(0, 0); });
    row.add_to(table);

    row.method = "octree, no hint";
    row.times = time_each(steps, [&](std::size_t i) { sink = surface.view(places[i]).distance_m; });
    row.add_to(table);

    // random places, so that nothing is in the caches
    row.method = "octree, random places";
    for (Vector3& place : places) place = place.norm() * random.direction();
    std::vector<Vector3> anywhere = places;
    row.times =
        time_each(steps, [&](std::size_t i) { sink = surface.view(anywhere[i]).distance_m; });
    row.add_to(table);
    for (std::size_t i = 0; i < steps; ++i) {
      const double angle = 0.1 * spacing_m / kRadius_m * static_cast<double>(i);
      const double tilt = 0.3 * std::sin(0.37 * angle);
      places[i] = places[i].norm() * Vector3(std::cos(angle) * std::cos(tilt),
                                             std::sin(angle) * std::cos(tilt), std::sin(tilt));
    }
#ifdef PALPATE_HAS_NANOFLANN
    // the same surface with a search by nanoflann: the points within the longest reach
    NanoflannCloud points;
    points.points.assign(surface.tree().points().begin(), surface.tree().points().end());
    float reach = 0.0F;
    for (const Octree::Point& point : points.points) reach = std::max(reach, point.reach);
    const BenchClock::time_point nanoflann_start = BenchClock::now();
    NanoflannTree tree(3, points, nanoflann::KDTreeSingleIndexAdaptorParams(10));
    tree.buildIndex();
    row.method = "nanoflann, same fit";
    row.build_s = seconds_since(nanoflann_start);
    row.bytes_per_point = kNaN;
    std::vector<std::pair<std::uint32_t, float>> found;
    found.reserve(1000);
    nanoflann::SearchParams unsorted;
    unsorted.sorted = false;
    const auto nearest = [&](const Vector3& place) {
      const Eigen::Vector3f center = place.cast<float>();
      std::uint32_t index = 0;
      float squared = 0.0F;
      tree.knnSearch(center.data(), 1, &index, &squared);
      return index;
    };
    const auto gather = [&](const Vector3& place, const auto& visit) {
      const Eigen::Vector3f center = place.cast<float>();
      tree.radiusSearch(center.data(), reach * reach, found, unsorted);
      for (const auto& [index, squared] : found) visit(index);
    };
    double largest_difference_m = 0.0;
    for (std::size_t i = 0; i < steps; i += 97) {
      largest_difference_m = std::max(
          largest_difference_m, std::abs(surface.view_with(places[i], nearest, gather).distance_m -
                                         surface.view(places[i]).distance_m));
    }
    PALPATE_REQUIRE(largest_difference_m < 1e-6 * kRadius_m);  // it is the same surface
    row.times = time_each(steps, [&](std::size_t i) {
      sink = surface.view_with(places[i], nearest, gather).curvature_per_m(0, 0);
    });
    row.add_to(table);
#endif
    table.add_gap();
  }
}

// --- figures ------------------------------------------------------------------------------------

void plot(const BenchOptions& options, const Table& table) {
  const std::filesystem::path folder = options.plot_folder;
  std::filesystem::create_directories(folder);
  bench::write_file(folder / "contact_bench.csv", table.csv());
  bench::draw_figure(
      folder, "contact_bench",
      "set datafile separator ','\nset terminal svg size 800,500 background 'white'\n"
      "set logscale xy\nset grid\nset key top left\n"
      "match(g, m, v) = (strcol(1) eq g && strcol(3) eq m) ? v : NaN\n"
      "set output 'time_size.svg'\nset xlabel 'points'\nset ylabel 'median [µs]'\n"
      "set title 'Time against size: 20 nearest (cold), and distance, normal and curvature'\n"
      "f = 'contact_bench.csv'\n"
      "plot f every ::1 using 4:(match('20 nearest, cold','octree',$11)) with lp title '20-NN "
      "octree',"
      " f every ::1 using 4:(match('20 nearest, cold','nanoflann',$11)) with lp title '20-NN "
      "nanoflann', f every ::1 using 4:(match('view along a path','octree',$11)) with lp title "
      "'view, octree', f every ::1 using 4:(match('view along a path','nanoflann, same fit',$11)) "
      "with lp title 'view, nanoflann'\n"
      "set output 'time_error.svg'\nset xlabel 'force error, rms [% of the force at 3 mm]'\n"
      "set title 'Time against error, spacing 4 … 0.5 mm, normals given'\n"
      "err(s, n, v) = (strcol(1) eq 'error' && strcol(2) eq s && strcol(3) eq 'normals given' && "
      "$6 == n) ? v : NaN\n"
      "plot for [s in 'plane sphere torus saddle'] f every ::1 using 7:(err(s, 1e-4, $11)) with lp "
      "title s.', noise 0.1 mm', for [s in 'sphere torus saddle'] f every ::1 using "
      "7:(err(s, 0, $11)) with lp title s\n");
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Run time against error of contact with point clouds.", "contact_bench");
  BenchOptions options;
  return bench::run_bench(app, options, argc, argv, [&] {
    Table table = bench::make_table();
    measure_errors(options, table);
    measure_neighbors(options, table);
    measure_views(options, table);
    bench::measure_steps(options, table);
    table.publish(options);
    if (!options.plot_folder.empty()) plot(options, table);
  });
}
