// SPDX-License-Identifier: Apache-2.0
// touched_sphere.h — balls as label maps and as they are, their meshes by the importer's mesher,
// and the force on a tip in them at rest, by the full solutions of a session: what smoothing and
// mesh do to what a hand feels.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/core/check.h"
#include "common/core/user/temp_folder.h"
#include "deploy/scan/organ_mesh.h"
#include "deploy/scan/stuffing.h"
#include "physics_node/elastic_tissue/elastic_body.h"
#include "physics_node/elastic_tissue/elastic_contact.h"
#include "physics_node/elastic_tissue/elastic_simulation.h"
#include "physics_node/files/tetrahedral_files.h"

namespace palpate::bench {

inline constexpr double kBallRadius_m = 0.03;
inline constexpr double kTouchRadius_m = 0.006;
inline constexpr double kTouchDepth_m = 0.003;

/// A ball around the origin of W, or one in it.
struct Ball {
  Vector3 centre_m = Vector3::Zero();
  double radius_m = kBallRadius_m;
  [[nodiscard]] double inside_m(const Vector3& place_m) const {
    return radius_m - (place_m - centre_m).norm();
  }
};

/// Voxels of the ball as label 1, of the lesion as label 2; the grid is oblique to W, and no centre
/// of a voxel lies at that of the ball.
inline scan::LabelMap ball_of_voxels(const Vector3& voxel_m, const std::optional<Ball>& lesion) {
  scan::LabelMap map;
  const Matrix3 turned = Eigen::AngleAxisd(0.4, Vector3(3, 1, 2).normalized()).toRotationMatrix();
  const Vector3 half_m = Vector3::Constant(kBallRadius_m) + 3.3 * voxel_m;
  for (std::size_t a = 0; a < 3; ++a) {
    const auto axis = static_cast<Eigen::Index>(a);
    map.size[a] = static_cast<std::uint32_t>(2.0 * half_m[axis] / voxel_m[axis]) + 1;
  }
  map.ras_of_index_m.linear() = turned * Matrix3(voxel_m.asDiagonal());
  map.ras_of_index_m.translation() = turned * -half_m;
  map.segments = {{.value = 1, .name = "organ"}};
  if (lesion) map.segments.push_back({.value = 2, .name = "lesion"});
  for (std::uint32_t k = 0; k < map.size[2]; ++k) {
    for (std::uint32_t j = 0; j < map.size[1]; ++j) {
      for (std::uint32_t i = 0; i < map.size[0]; ++i) {
        const Vector3 place_m = map.ras_of_index_m * Vector3(i, j, k);
        const bool is_lesion = lesion && lesion->inside_m(place_m) > 0.0;
        map.voxels.push_back(Ball{}.inside_m(place_m) <= 0.0 ? 0 : is_lesion ? 2 : 1);
        if (map.voxels.back() != 0) ++map.segments[map.voxels.back() - 1U].voxels;
      }
    }
  }
  return map;
}

/// By the mesher of `palpate import`, fine at the top and at the lesion.
inline scan::OrganMesh imported_ball(const Vector3& voxel_m, const std::optional<Ball>& lesion,
                                     scan::OrganMeshing meshing) {
  scan::LabelMap map = ball_of_voxels(voxel_m, lesion);
  std::vector<std::uint32_t> segments{0};
  if (lesion) segments.push_back(1);
  std::vector<scan::Region> regions = scan::keep_largest_part(map, segments);
  if (lesion) meshing.fine = {1};
  meshing.site_m = Vector3(0.0, 0.0, kBallRadius_m);
  return scan::organ_mesh_of(map, std::move(regions), meshing);
}

/// The ball itself, without voxels. A region by the centre of each element.
/// @param cell_m  of the lattice within `site_radius_m` of the top and at the lesion's boundary
inline physics::TetrahedralMesh analytic_ball(const std::optional<Ball>& lesion, double cell_m,
                                              double site_radius_m) {
  scan::Stuffing stuffing{
      .bounds = {Vector3::Constant(-1.1 * kBallRadius_m), Vector3::Constant(1.1 * kBallRadius_m)},
      .cell_m = cell_m,
      .coarsest = 2};
  stuffing.inside = [](const Vector3& place_m) { return Ball{}.inside_m(place_m); };
  stuffing.coarsest_at = [=](const Vector3& place_m) {
    return lesion && std::abs(lesion->inside_m(place_m)) < cell_m ? 0 : 2;
  };
  stuffing.coarsest_at_surface = [=](const Vector3& place_m) {
    const double distance_m = (place_m - Vector3(0.0, 0.0, kBallRadius_m)).norm();
    return distance_m < site_radius_m ? 0 : distance_m < 2.0 * site_radius_m ? 1 : 2;
  };
  std::vector<std::uint32_t> kept;
  physics::TetrahedralMesh mesh = scan::one_solid(scan::stuffed(stuffing), kept);
  for (const auto& corners : mesh.tetrahedra) {
    Vector3 centre_m = Vector3::Zero();
    for (const std::uint32_t corner : corners) centre_m += 0.25 * mesh.nodes_m[corner];
    mesh.regions.push_back(lesion && lesion->inside_m(centre_m) > 0.0 ? 1 : 0);
  }
  mesh.region_names = {"organ"};
  if (lesion) mesh.region_names.emplace_back("lesion");
  return mesh;
}

/// A body of a session in which one tip is moved slowly, by full solutions at 50 Hz: at every place
/// it is at rest.
class SlowTouch {
 public:
  /// The lower half is held.
  /// @param lesion_young_pa  of the region "lesion", if there is one
  SlowTouch(const physics::TetrahedralMesh& mesh, double young_pa, double lesion_young_pa,
            bool has_linear_elements) {
    const TempFolder folder;
    ElasticMaterial material{.young_pa = young_pa, .is_linear = has_linear_elements};
    material.fixed = {HalfSpaceGeometry{.point_m = Vector3::Zero(), .normal = Vector3::UnitZ()}};
    const auto& names = mesh.region_names;
    if (std::find(names.begin(), names.end(), "lesion") != names.end()) {
      material.parts = {{.where = MeshTag{"lesion"},
                         .young_pa = lesion_young_pa,
                         .poisson_ratio = material.poisson_ratio,
                         .density_kg_per_m3 = material.density_kg_per_m3}};
    }
    const TissueConfig tissue{
        .name = "ball",
        .geometry = FileGeometry{.kind = FileGeometry::Kind::kTetrahedralMesh,
                                 .file = folder.write("ball.msh", physics::msh_text(mesh))},
        .material = material};
    body_ = physics::make_elastic_body(tissue, 0, kTouchRadius_m);
    simulation_.emplace(*body_, 1, kTouchRadius_m, kStep_s);
  }

  /// The force on the tip, at this depth below the sphere, in this direction (unit) from its
  /// centre.
  Vector3 newton_at(const Vector3& direction, double depth_m) {
    const auto centre_m = [&](double below_m) -> Vector3 {
      return (kBallRadius_m + kTouchRadius_m - below_m) * direction;
    };
    if (!last_m_) go_to(centre_m(0.0));
    const Vector3 from_m = *last_m_;
    const Vector3 way_m = centre_m(depth_m) - from_m;
    const int parts = std::max(1, static_cast<int>(std::ceil(way_m.norm() / kWay_m)));
    for (int part = 1; part <= parts; ++part) go_to(from_m + way_m * part / parts);
    for (int step = 0; step < kMostRestSteps; ++step) {
      const Vector3 before_newton = simulation_->touch(0).force_on_tool_newton;
      go_to(centre_m(depth_m));
      const Vector3& newton = simulation_->touch(0).force_on_tool_newton;
      if ((newton - before_newton).norm() < kAtRest * newton.norm()) return newton;
    }
    throw SetupError("a touched ball does not come to rest");
  }

  [[nodiscard]] const physics::ElasticBody& body() const { return *body_; }

 private:
  static constexpr double kStep_s = 0.02;
  static constexpr double kWay_m = 1e-3;   // of a step: 50 mm/s
  static constexpr double kAtRest = 2e-4;  // of the force, in a step
  static constexpr int kMostRestSteps = 200;

  void go_to(const Vector3& tip_m) {
    time_s_ += kStep_s;
    if (!side_.follow(body_->shape, body_->bounds, kTouchRadius_m, kTouchRadius_m, tip_m,
                      time_s_)) {
      throw SetupError("a touched ball is out of reach");
    }
    const std::vector<std::optional<physics::TipState>> tips{
        physics::TipState{.tip_m = tip_m, .place_m = side_.place_m()}};
    simulation_->step(tips);
    last_m_ = tip_m;
  }

  std::shared_ptr<const physics::ElasticBody> body_;
  std::optional<physics::ElasticSimulation> simulation_;
  physics::TipSide side_;
  double time_s_ = 0.0;
  std::optional<Vector3> last_m_;
};

/// Directions of a slide over the top, askew to all axes.
inline std::vector<Vector3> slide_over_the_top(int places, double half_angle_rad) {
  std::vector<Vector3> directions;
  const Vector3 along = Vector3(1.0, 0.37, 0.0).normalized();
  for (int i = 0; i < places; ++i) {
    const double angle = half_angle_rad * (2.0 * i / (places - 1) - 1.0);
    directions.emplace_back(std::sin(angle) * along + std::cos(angle) * Vector3::UnitZ());
  }
  return directions;
}

struct Felt {
  double error_ratio = 0.0;   ///< of the mean force of the slide
  double ripple_ratio = 0.0;  ///< largest deviation of force over reference from its mean
};

/// @param reference_newton  at the same places
inline Felt felt_of(const std::vector<double>& newton,
                    const std::vector<double>& reference_newton) {
  double mean = 0.0;
  for (std::size_t i = 0; i < newton.size(); ++i) {
    mean += newton[i] / reference_newton[i] / static_cast<double>(newton.size());
  }
  Felt felt{.error_ratio = mean - 1.0};
  for (std::size_t i = 0; i < newton.size(); ++i) {
    felt.ripple_ratio =
        std::max(felt.ripple_ratio, std::abs(newton[i] / reference_newton[i] / mean - 1.0));
  }
  return felt;
}

inline std::vector<double> slide_newton(SlowTouch& touch, const std::vector<Vector3>& directions) {
  std::vector<double> newton;
  for (const Vector3& direction : directions) {
    newton.push_back(touch.newton_at(direction, kTouchDepth_m).dot(direction));
  }
  return newton;
}

}  // namespace palpate::bench
