// SPDX-License-Identifier: Apache-2.0
// sphere_contact.h — a rigid sphere against points spread over the surface of an elastic body.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
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
  /// Unit normal of its face.
  [[nodiscard]] Vector3d outward(const double* x_m) const noexcept {
    const Eigen::Map<const Vector3d> a(x_m + 3 * std::size_t{nodes[0]});
    const Eigen::Map<const Vector3d> b(x_m + 3 * std::size_t{nodes[1]});
    const Eigen::Map<const Vector3d> c(x_m + 3 * std::size_t{nodes[2]});
    return (b - a).cross(c - a).normalized();
  }
  /// Of the point, to the body's at its nodes.   @param stiffness  symmetric [N/m]
  void add_stiffness(const Eigen::Matrix3d& stiffness, const BlockPattern& pattern,
                     BlockValues& values) const;
  void add_nodes_to(std::vector<std::uint32_t>& all) const {
    all.insert(all.end(), nodes.begin(), nodes.begin() + count);
  }
  /// A node of it is fixed: it gives way to the contact's penalty, whatever the body does.
  [[nodiscard]] bool is_held(const BlockPattern& pattern) const noexcept {
    for (std::size_t a = 0; a < static_cast<std::size_t>(count); ++a) {
      if (pattern.row_of[nodes[a]] < 0) return true;
    }
    return false;
  }
};

/// `per_edge`² points on every face.
[[nodiscard]] std::vector<SurfacePoint> surface_points(const Mesh& mesh,
                                                       const std::vector<Face>& faces,
                                                       int per_edge);

/// Frictionless and unilateral: every point may press on the sphere, none may pull. Augmented
/// Lagrangian: pressure = max(0, multiplier − stiffness × gap), and after update_multipliers() the
/// multiplier is that pressure, so that the penetration goes to zero at a finite stiffness.
///
/// From choose_near() on each point remembers from which side the sphere came: only points whose
/// face looks at the sphere may touch it, and the normal at a point turns by at most 60° in a step.
/// gap = max u·(point − centre) − radius over the unit u of that cone, which is the distance from
/// the sphere while the point is where it belongs, and leads back to its side from everywhere else.
class SphereContact : public Obstacle {
 public:
  /// @param stiffness_pa_per_m  > 0
  /// @param pattern  of the body: which points are held; null: none
  SphereContact(std::vector<SurfacePoint> points, double stiffness_pa_per_m,
                const BlockPattern* pattern = nullptr);

  void set_sphere(const Vector3d& centre_m, double radius_m) noexcept {
    centre_m_ = centre_m;
    radius_m_ = radius_m;
  }
  [[nodiscard]] double radius_m() const noexcept { return radius_m_; }
  /// Before a step: from now on only points this near to the sphere that face it may touch it;
  /// others lose their multipliers. At first all may.
  /// @param margin_m  at least the way of the sphere to the next call, so that every point is seen
  ///     before it is inside
  void choose_near(const double* x_m, double margin_m);
  /// The tool is elsewhere: as if new.
  void forget() noexcept;
  /// As that of another body, the points of which are these where they are still there.
  /// @param old_points  by point: its index there, −1: none
  void continue_as(const SphereContact& other, const std::vector<std::int32_t>& old_points);
  double add_gradient(const double* x_m, double* gradient) const override;
  void add_stiffness(const double* x_m, const BlockPattern& pattern,
                     BlockValues& values) const override;
  void add_exact_stiffness(const double* x_m, const BlockPattern& pattern,
                           BlockValues& values) const override;
  [[nodiscard]] double longest_correction_m() const override { return 0.2 * radius_m_; }
  /// Until the pressed points are within kClose radii of where they belong.
  bool begin_round(const double* x_m, const BlockPattern& pattern) override;
  static constexpr double kClose = 0.002;

  [[nodiscard]] std::size_t near_count() const noexcept { return near_.size(); }
  /// From the centre to the nearest point, at the last choose_near(); a lower bound where none is
  /// within its reach.
  [[nodiscard]] double nearest_m() const noexcept { return nearest_m_; }

  /// Ends a round with the body there: the pressures become the multipliers, except at points that
  /// are held, whose multipliers would grow without limit: they keep the penalty alone. None
  /// exceeds stiffness × diameter. What follows is said of this state.
  /// @return  the deepest penetration [m]
  double update_multipliers(const double* x_m, const BlockPattern& pattern);

  // --- of the last update_multipliers(); nothing before it ---

  [[nodiscard]] Vector3d force_on_sphere_newton() const;
  /// Of every point, on the body.
  [[nodiscard]] std::vector<Vector3d> forces_on_body_newton() const;
  [[nodiscard]] std::size_t touching() const;
  /// Mean of −(direction of the force on the body)·(…on the face's outward normal), weighted by
  /// force: 1 where the surface lies on the sphere, below 0 where the sphere has passed through it.
  /// 1 without force.
  [[nodiscard]] double facing() const;
  [[nodiscard]] const std::vector<SurfacePoint>& points() const noexcept { return *points_; }

 private:
  struct Touch {
    Vector3d normal;  // out of the sphere
    double gap_m;
    double distance_m;  // from the centre; 0: the normal is at the border of the cone
    double pressure_pa;
  };
  [[nodiscard]] bool is_still() const noexcept;
  static constexpr double kNoRound = std::numeric_limits<double>::infinity();
  enum class Side : std::uint8_t { kUnknown, kFacing, kHidden };
  void add_blocks(const double* x_m, const BlockPattern& pattern, bool is_exact,
                  BlockValues& values) const;
  [[nodiscard]] Touch touch(std::size_t point, const double* x_m) const noexcept;
  [[nodiscard]] double multiplier_after(const Touch& at, std::uint32_t point,
                                        const BlockPattern& pattern) const;
  [[nodiscard]] bool look_at(std::size_t point, const Vector3d& at_m,
                             const Vector3d& face_normal) noexcept;

  std::shared_ptr<const std::vector<SurfacePoint>> points_;  // of all copies
  std::shared_ptr<const std::vector<char>> is_held_;         // by point; of all copies
  std::vector<double> multipliers_pa_;
  std::vector<double> stiffnesses_pa_per_m_;  // by point: raised where rounds come no nearer
  std::optional<Vector3d> settled_from_m_;    // the centre at the end of the last step
  double last_worst_m_ = kNoRound;            // at the round before, in this step
  std::vector<std::uint32_t> near_;           // points that may touch
  // since the first choose_near()
  std::vector<Side> sides_;
  std::vector<Vector3d> cones_;  // axis, out of the sphere; zero: any direction
  std::optional<Vector3d> seen_from_m_;
  double nearest_m_ = std::numeric_limits<double>::infinity();
  // of the last update_multipliers(), of the points in near_ then
  struct Settled {
    std::uint32_t point = 0;
    Vector3d force_on_body_newton;
    double facing = 1.0;
  };
  std::vector<Settled> settled_;
  double stiffness_pa_per_m_;
  Vector3d centre_m_ = Vector3d::Zero();
  double radius_m_ = 0.0;
};

}  // namespace palpate::elastic
