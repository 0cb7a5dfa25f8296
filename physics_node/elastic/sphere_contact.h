// sphere_contact.h — a rigid sphere against points spread over the surface of an elastic body.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "physics_node/elastic/body.h"
#include "physics_node/elastic/obstacle.h"

namespace palpate::elastic {

/// A point of the surface: at Σ weightsᵢ x(nodesᵢ).
struct SurfacePoint {
  std::array<std::uint32_t, 6> nodes{};
  std::array<double, 6> weights{};
  int count = 0;         ///< of nodes
  double area_m2 = 0.0;  ///< of the undeformed surface that it stands for

  [[nodiscard]] Vector3d position_m(const double* x_m) const noexcept {
    Vector3d sum = Vector3d::Zero();
    for (std::size_t a = 0; a < static_cast<std::size_t>(count); ++a) {
      sum += weights[a] * Eigen::Map<const Vector3d>(x_m + 3 * std::size_t{nodes[a]});
    }
    return sum;
  }
};

/// `per_edge`² points on every face.
[[nodiscard]] std::vector<SurfacePoint> surface_points(const Mesh& mesh,
                                                       const std::vector<Face>& faces,
                                                       int per_edge);

/// Frictionless and unilateral: every point may press on the sphere, none may pull. Augmented
/// Lagrangian: pressure = max(0, multiplier − stiffness × gap), and after update_multipliers() the
/// multiplier is that pressure, so that the penetration goes to zero at a finite stiffness.
class SphereContact : public Obstacle {
 public:
  /// @param stiffness_pa_per_m  > 0
  SphereContact(std::vector<SurfacePoint> points, double stiffness_pa_per_m);

  void set_sphere(const Vector3d& centre_m, double radius_m) noexcept {
    centre_m_ = centre_m;
    radius_m_ = radius_m;
  }
  /// From now on only points this near to the sphere may touch it; others lose their multipliers.
  /// At first all may.
  void choose_near(const double* x_m, double margin_m);
  double add_gradient(const double* x_m, double* gradient) const override;
  void add_stiffness(const double* x_m, const BlockPattern& pattern,
                     BlockValues& values) const override;
  void add_exact_stiffness(const double* x_m, const BlockPattern& pattern,
                           BlockValues& values) const override;
  [[nodiscard]] double longest_correction_m() const override { return 0.2 * radius_m_; }

  [[nodiscard]] std::size_t near_count() const noexcept { return near_.size(); }
  /// Returns the deepest penetration [m].
  double update_multipliers(const double* x_m);
  [[nodiscard]] Vector3d force_on_sphere_newton(const double* x_m) const;
  /// Of every point, on the body.
  [[nodiscard]] std::vector<Vector3d> forces_on_body_newton(const double* x_m) const;
  [[nodiscard]] std::size_t touching(const double* x_m) const;
  [[nodiscard]] const std::vector<SurfacePoint>& points() const noexcept { return points_; }

 private:
  struct Touch {
    Vector3d normal;  // out of the sphere
    double gap_m;
    double distance_m;  // from the centre
    double pressure_pa;
  };
  void add_blocks(const double* x_m, const BlockPattern& pattern, bool is_exact,
                  BlockValues& values) const;
  [[nodiscard]] Touch touch(std::size_t point, const double* x_m) const noexcept;

  std::vector<SurfacePoint> points_;
  std::vector<double> multipliers_pa_;
  std::vector<std::uint32_t> near_;  // points that may touch
  double stiffness_pa_per_m_;
  Vector3d centre_m_ = Vector3d::Zero();
  double radius_m_ = 0.0;
};

}  // namespace palpate::elastic
