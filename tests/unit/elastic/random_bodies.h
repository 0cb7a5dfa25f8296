// SPDX-License-Identifier: Apache-2.0
// random_bodies.h — bodies that nobody drew, a place on each, and the force of a slow press there.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "physics_node/elastic_tissue/elastic_simulation.h"
#include "physics_node/elastic_tissue/elastic_tissues.h"
#include "physics_node/files/tetrahedral_files.h"
#include "tests/support/temp_folder.h"

namespace palpate::physics {

inline constexpr double kTip_m = 0.005;
inline constexpr double kReach_m = 0.05;

struct RandomBody {
  std::mt19937_64 random;
  std::string file;
  SceneConfig scene;

  RandomBody(std::uint64_t seed, const test::TempFolder& folder) : random(seed) {
    file = (folder.path() / ("body_" + std::to_string(seed) + ".msh")).string();
    std::ofstream(file) << msh_text(mesh());
    ElasticMaterial material{.young_pa = std::pow(10.0, between(3.0, 5.0)),
                             .poisson_ratio = between(0.2, 0.49),
                             .viscosity_s = one_of({0.0, 0.005, 0.02})};
    material.is_linear = true;
    const int supports = static_cast<int>(between(1.0, 3.999));
    for (int i = 0; i < supports; ++i) material.fixed.push_back(support());
    scene = {.tip_radius_m = kTip_m,
             .tissues = {{.name = "body",
                          .geometry = FileGeometry{.kind = FileGeometry::Kind::kTetrahedralMesh,
                                                   .file = file},
                          .material = material}}};
  }

  double between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  }
  double one_of(std::initializer_list<double> values) {
    return *(values.begin() +
             static_cast<std::ptrdiff_t>(between(0.0, static_cast<double>(values.size()) - 1e-9)));
  }

 private:
  std::array<double, 3> size_m_{};

  TetrahedralMesh mesh() {
    const double cell_m = between(0.006, 0.012);
    std::array<std::vector<double>, 3> planes;
    for (std::size_t k = 0; k < 3; ++k) {
      const int cells = static_cast<int>(between(1.0, 5.999));
      size_m_[k] = cells * cell_m;
      planes[k] = elastic::equal_planes(-0.5 * size_m_[k], 0.5 * size_m_[k], cells);
    }
    const elastic::Mesh box = elastic::box_mesh(planes[0], planes[1], planes[2]);
    const double shake_m = one_of({0.0, 0.1, 0.15}) * cell_m;
    const double left_out = one_of({0.0, 0.0, 0.1, 0.4});
    const bool is_doubled = one_of({0, 0, 0, 0, 0, 0, 0, 1}) > 0.5;
    std::vector<std::array<std::uint32_t, 4>> elements;
    for (std::size_t e = 0; e < box.element_count(); ++e) {
      if (between(0.0, 1.0) < left_out && e > 0) continue;
      const auto corners = box.element(e);
      elements.push_back({corners[0], corners[1], corners[2], corners[3]});
    }
    if (is_doubled) elements.push_back(elements.front());
    // nodes that no element has any more are left out
    TetrahedralMesh mesh;
    std::map<std::uint32_t, std::uint32_t> kept;
    for (auto& element : elements) {
      for (std::uint32_t& node : element) {
        const auto [at, is_new] =
            kept.try_emplace(node, static_cast<std::uint32_t>(mesh.nodes_m.size()));
        if (is_new) {
          mesh.nodes_m.emplace_back(box.nodes_m[node] + Vector3(between(-shake_m, shake_m),
                                                                between(-shake_m, shake_m),
                                                                between(-shake_m, shake_m)));
        }
        node = at->second;
      }
      mesh.tetrahedra.push_back(element);
    }
    return mesh;
  }

  RegionGeometry support() {
    Vector3 at;
    Vector3 normal;
    for (Eigen::Index k = 0; k < 3; ++k) {
      const double half_m = 0.5 * size_m_[static_cast<std::size_t>(k)];
      at[k] = between(-half_m, half_m);
      normal[k] = between(-1.0, 1.0);
    }
    const double kind = between(0.0, 1.0);
    if (kind < 0.2) return SphereGeometry{.center_m = at, .radius_m = between(0.002, 0.015)};
    if (kind < 0.3) {
      return BoxGeometry{.center_m = at, .size_m = Vector3::Constant(between(0.004, 0.03))};
    }
    // below a side
    const auto axis = static_cast<Eigen::Index>(between(0.0, 2.999));
    normal.setZero();
    normal[axis] = between(0.0, 1.0) < 0.5 ? 1.0 : -1.0;
    return HalfSpaceGeometry{
        .point_m = (between(0.3, 0.499) * size_m_[static_cast<std::size_t>(axis)]) * -normal,
        .normal = normal};
  }
};

/// A place of the surface, and the outward normal there.
struct Place {
  Vector3 at_m;
  Vector3 outward;
};

/// Every other time one where nothing is fixed, if there is one.
inline Place place_on(const ElasticBody& body, RandomBody& random) {
  std::vector<std::array<std::uint32_t, 3>> faces = triangles_of(body);
  const auto is_fixed = [&](const auto& face) {
    return std::any_of(face.begin(), face.end(),
                       [&](std::uint32_t node) { return body.body->pattern().row_of[node] < 0; });
  };
  if (random.between(0.0, 1.0) < 0.5 && !std::all_of(faces.begin(), faces.end(), is_fixed)) {
    std::erase_if(faces, is_fixed);
  }
  const auto& face = faces[static_cast<std::size_t>(
      random.between(0.0, static_cast<double>(faces.size()) - 1e-9))];
  const auto node = [&](std::size_t k) -> Vector3 {
    return body.start_m.segment<3>(3 * Eigen::Index{face[k]});
  };
  return {.at_m = (node(0) + node(1) + node(2)) / 3.0,
          .outward = (node(1) - node(0)).cross(node(2) - node(0)).normalized()};
}

/// The full solution under a tip that comes down there and stays.
class FullPress {
 public:
  FullPress(const ElasticBody& body, const Place& place, double depth_m)
      : simulation_(body, 1, kTip_m, kStep_s) {
    TipSide side;
    const double speed_m = depth_m / 20.0;  // a step
    for (int step = -20; step < 60; ++step) {
      const Vector3 tip_m =
          place.at_m + (kTip_m - std::min(depth_m, speed_m * step)) * place.outward;
      std::array<std::optional<TipState>, 1> tips;
      if (side.follow(body.shape, body.bounds, kTip_m, kReach_m, tip_m, kStep_s * (step + 20))) {
        tips[0] = {.tip_m = tip_m, .place_m = side.place_m()};
      }
      simulation_.step(tips);
    }
  }
  [[nodiscard]] const ElasticSimulation::Touch& touch() const { return simulation_.touch(0); }
  [[nodiscard]] bool has_failed() const { return simulation_.failed_steps() > 0; }
  /// Of the points that are pressed, from the sphere, but for those that are held.
  [[nodiscard]] double largest_gap_m() const {
    const ElasticBody& body = simulation_.body();
    double largest_m = 0.0;
    for (std::size_t p = 0; p < touch().forces_on_body_newton.size(); ++p) {
      const elastic::SurfacePoint& point = body.points[p];
      if (touch().forces_on_body_newton[p].isZero(0.0) || point.is_held(body.body->pattern())) {
        continue;
      }
      const Vector3 at_m = point.position_m(simulation_.x_m().data());
      largest_m = std::max(largest_m, std::abs((at_m - touch().centre_m).norm() - kTip_m));
    }
    return largest_m;
  }

 private:
  static constexpr double kStep_s = 0.02;
  ElasticSimulation simulation_;
};

inline constexpr double kTick_s = 1e-3;
inline constexpr double kStart_s = 0.06;
inline constexpr double kHold_s = 0.3;

/// In a session: a tip that comes down there, stays, and goes back.
struct Cycle {
  Vector3 rest_newton = Vector3::Zero();  // at the end of the hold
  double error_newton = 0.0;              // of the condensed contact, by physics itself, then
  double most_newton = 0.0;
  double against_newton = 0.0;  // the largest pull, ≤ 0
  bool is_finite = true;
  Vector3 last_newton = Vector3::Zero();
  double work_joule = 0.0;  // by the tip, on the body
};

inline Cycle press_and_leave(const std::shared_ptr<const ElasticBody>& body, const Place& place,
                             double depth_m, double speed_m_per_s) {
  Cycle cycle;
  ElasticTissues tissues({body}, 1, kTip_m, ElasticPace::kVirtual);
  const double down_s = kStart_s + (depth_m + 0.004) / speed_m_per_s;
  Vector3 last_m = place.at_m;
  for (double time_s = 0.0; time_s < 2.0 * down_s + kHold_s + 0.1; time_s += kTick_s) {
    const double way_s =
        std::max(0.0, time_s < down_s + kHold_s ? std::min(time_s, down_s) - kStart_s
                                                : 2.0 * down_s + kHold_s - kStart_s - time_s);
    const Vector3 tip_m = place.at_m + (kTip_m + 0.004 - speed_m_per_s * way_s) * place.outward;
    SceneForce sum;
    tissues.step(0, tip_m, time_s, kReach_m, sum);
    const Vector3& newton = sum.force_on_tool_newton;
    cycle.is_finite = cycle.is_finite && newton.allFinite();
    cycle.against_newton = std::min(cycle.against_newton, newton.dot(place.outward));
    if (time_s > 0.0) {
      cycle.work_joule -= 0.5 * (newton + cycle.last_newton).dot(tip_m - last_m);
    }
    last_m = tip_m;
    cycle.last_newton = newton;
    cycle.most_newton = std::max(cycle.most_newton, newton.norm());
    if (time_s < down_s + kHold_s) {
      cycle.rest_newton = newton;
      cycle.error_newton = tissues.tissues().front()->figures().error_newton;
    }
  }
  return cycle;
}

}  // namespace palpate::physics
