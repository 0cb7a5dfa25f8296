// SPDX-License-Identifier: Apache-2.0
// touched_sphere.h — balls as label maps and as they are, their meshes by the importer's mesher,
// and the force on a tip in them at rest: what smoothing and mesh do to what a hand feels.
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
#include "physics_node/elastic/equilibrium.h"
#include "physics_node/elastic_tissue/elastic_body.h"
#include "physics_node/files/tetrahedral_files.h"

namespace palpate::bench {

inline constexpr double kBallRadius_m = 0.03;
inline constexpr double kTouchRadius_m = 0.006;
inline constexpr double kTouchDepth_m = 0.003;
inline constexpr int kPointsPerEdge = 3;

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

/// The ball itself, without voxels: the reference. A region by the centre of each element.
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

/// A body of a session in which one tip is moved slowly: at every place it is at rest.
class SlowTouch {
 public:
  /// The lower half is held.
  /// @param lesion_young_pa  of the region "lesion", if there is one
  /// @param has_few_points   of contact, as a session has
  SlowTouch(const physics::TetrahedralMesh& mesh, double young_pa, double lesion_young_pa,
            bool has_linear_elements, bool has_few_points = false) {
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
    std::vector<elastic::Face> faces;
    for (const elastic::Face& face : body_->faces) {
      const Vector3 corner_m = body_->body->mesh().nodes_m[face.nodes[0]];
      if (corner_m.z() > 0.5 * kBallRadius_m) faces.push_back(face);
    }
    contact_.emplace(has_few_points
                         ? body_->points
                         : elastic::surface_points(body_->body->mesh(), faces, kPointsPerEdge),
                     body_->contact_stiffness_pa_per_m);
    search_.emplace(*body_->body);
    factor_.emplace(*body_->body, elastic::Precision::kDouble);
    x_m_ = body_->body->rest_m();
  }

  /// The force on the tip, at this depth below the sphere, in this direction (unit) from its
  /// centre.
  Vector3 newton_at(const Vector3& direction, double depth_m) {
    const Vector3 centre_m = (kBallRadius_m + kTouchRadius_m - depth_m) * direction;
    if (!last_m_) last_m_ = (kBallRadius_m + kTouchRadius_m) * direction;
    const Vector3 from_m = *last_m_;
    // by at most a sixth of the radius at a time, so that points see the sphere before it is inside
    const int parts = std::max(1, static_cast<int>(std::ceil((centre_m - from_m).norm() / 0.001)));
    for (int part = 1; part <= parts; ++part) {
      contact_->choose_near(x_m_.data(), 0.002);
      contact_->set_sphere(from_m + (centre_m - from_m) * part / parts, kTouchRadius_m);
      const int rounds = part == parts ? 3 : 1;
      for (int round = 0; round < rounds; ++round) {
        const elastic::SearchReport report = elastic::find_rest(
            *search_, *factor_, &*contact_, {.tolerance_m = 1e-6, .slow_iterations = 8}, x_m_);
        if (!report.is_converged) throw SetupError("a touched ball does not come to rest");
        contact_->update_multipliers(x_m_.data(), body_->body->pattern());
      }
    }
    last_m_ = centre_m;
    return contact_->force_on_sphere_newton();
  }

  [[nodiscard]] const physics::ElasticBody& body() const { return *body_; }

 private:
  std::shared_ptr<const physics::ElasticBody> body_;
  std::optional<elastic::SphereContact> contact_;
  std::optional<elastic::EquilibriumSearch> search_;
  std::optional<elastic::WarpedFactor> factor_;
  elastic::VectorXd x_m_;
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
