// condensed_contact.h — contact forces at the device's rate, whatever the size of the mesh.
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "physics_node/elastic/sphere_contact.h"
#include "physics_node/elastic/warped_factor.h"

namespace palpate::elastic {

/// How the surface of a body gives way to forces at a few of its points, without its interior:
/// u = C f for nodes of the surface, C = the rows and columns of the inverse stiffness [Cotin99,
/// James99]. Columns are made when their node is first touched and turn with the body
/// [Saupin08].
class SurfaceCompliance {
 public:
  /// @param factor  of the static stiffness; is used by require()   @param surface_nodes  of C's
  /// rows
  SurfaceCompliance(const Body& body, WarpedFactor& factor,
                    std::vector<std::uint32_t> surface_nodes);

  /// Makes the columns of a node unless they are there: three solutions. Allocates.
  void require(std::uint32_t node);
  /// Forgets all columns: the factor is another one.
  void clear();

  /// Displacement of surface node `row` (an index of surface_nodes()) under a unit force at `node`
  /// along each axis, 3 × 3 row-major at the returned place + 9 × row. @pre require(node)
  [[nodiscard]] const float* columns(std::uint32_t node) const { return columns_.at(node).data(); }
  [[nodiscard]] const std::vector<std::uint32_t>& surface_nodes() const noexcept { return nodes_; }
  /// Index in surface_nodes(), −1: none.
  [[nodiscard]] std::int32_t row_of(std::uint32_t node) const { return row_of_[node]; }
  [[nodiscard]] std::size_t columns_made() const noexcept { return made_; }

 private:
  const Body& body_;
  WarpedFactor& factor_;
  std::vector<std::uint32_t> nodes_;
  std::vector<std::int32_t> row_of_;
  std::unordered_map<std::uint32_t, std::vector<float>> columns_;
  VectorXd load_;
  VectorXd answer_;
  std::size_t made_ = 0;
};

struct CondensedReport {
  Vector3d force_on_sphere_newton = Vector3d::Zero();
  int touching = 0;
  int sweeps = 0;
  double deepest_m = 0.0;  ///< penetration that is left
};

/// Quasi-static contact of a rigid sphere with at most kMostPoints points of a surface, from the
/// state of a full solution and the forces in it: unilateral, Coulomb friction.
class CondensedContact {
 public:
  static constexpr int kMostPoints = 64;

  CondensedContact(SurfaceCompliance& compliance, double friction_coefficient);

  /// The points nearest to the sphere, their compliance among one another and onto the surface; the
  /// full solution x_m with the forces of `points` in it. On the slow thread. Allocates.
  void prepare(const std::vector<SurfacePoint>& points, const VectorXd& x_m,
               const std::vector<Vector3d>& forces_on_body_newton, const Vector3d& centre_m,
               int most_points);

  /// Forces for the sphere there; warm start from the last call. No allocation, lock or throw.
  CondensedReport step(const Vector3d& centre_m, double radius_m, int most_sweeps,
                       double tolerance_m) noexcept;

  /// Displacements of the surface nodes since the full solution, 3 per node, from the forces of the
  /// last step; the place is surface_size() long. No allocation.
  void move_surface(float* displacements_m) const noexcept;

  [[nodiscard]] std::size_t surface_size() const noexcept { return surface_stride_; }
  [[nodiscard]] int point_count() const noexcept { return count_; }
  /// Of the points in prepare()'s list.
  [[nodiscard]] const std::vector<std::size_t>& chosen() const noexcept { return chosen_; }

 private:
  SurfaceCompliance& compliance_;
  double friction_coefficient_;
  int count_ = 0;
  std::size_t stride_ = 0;  // floats per column of among_
  std::vector<std::size_t> chosen_;
  std::vector<Vector3d> positions_m_;    // in the full solution
  std::vector<Vector3d> forces_newton_;  // on the body
  std::vector<Vector3d> full_forces_newton_;
  std::vector<float> displacements_m_;  // of the points, 3 each
  std::vector<float> among_;            // column-major 3n × 3n
  std::vector<float> onto_surface_;     // column-major, 3 rows per surface node
  std::size_t surface_stride_ = 0;
  Vector3d centre_m_ = Vector3d::Zero();
  bool has_centre_ = false;
};

}  // namespace palpate::elastic
