// SPDX-License-Identifier: Apache-2.0
// condensed_contact.h — contact forces at the device's rate, whatever the size of the mesh.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "common/core/tissue.h"
#include "physics_node/elastic/condensed/slow_modes.h"
#include "physics_node/elastic/relaxation.h"
#include "physics_node/elastic/sphere_contact.h"
#include "physics_node/elastic/warped_factor.h"

namespace palpate::elastic {

/// How the surface of a body gives way to forces at a few of its points, without its interior:
/// u = C f for nodes of the surface, C = the rows and columns of the inverse stiffness [Cotin99,
/// James99]. Columns are made when their node is first touched and can be kept in a file
/// (compliance_file.h). C is that of the undeformed body: it does not turn with it, and simulations
/// of the body share it. A column is the same to the bit whoever makes it, with whichever others.
/// Thread-safe, except all_columns() and set_columns().
class SurfaceCompliance {
 public:
  /// @param factor  of the static stiffness; require() uses it, and factorises the undeformed body
  ///     if it is not ready   @param surface_nodes  of C's rows
  /// @param most_floats  that the columns may take; beyond it those required longest ago go
  SurfaceCompliance(const Body& body, WarpedFactor& factor,
                    std::vector<std::uint32_t> surface_nodes,
                    std::size_t most_floats = kMostFloats);

  static constexpr std::size_t kMostFloats = 64UL << 20U;  // 256 MiB

  using Column = std::shared_ptr<const std::vector<float>>;  ///< of a node: 9 per surface node
  using Columns = std::map<std::uint32_t, Column>;
  /// Columns of some nodes, for as long as this is there.
  class Required {
   public:
    /// Displacement of surface node `row` (an index of surface_nodes()) under a unit force at
    /// `node` along each axis, 3 × 3 row-major at the returned place + 9 × row. @pre it is required
    [[nodiscard]] const float* of(std::uint32_t node) const { return columns_.at(node)->data(); }

   private:
    friend class SurfaceCompliance;
    Columns columns_;
  };
  /// Makes the columns of nodes unless they are there, several together. These stay, whatever
  /// memory they take, until others are required. Allocates.
  /// @throws std::runtime_error  the stiffness could not be factorised; it is tried once
  Required require(std::span<const std::uint32_t> nodes);
  /// Displacement of a point of the surface under a unit force on another one along each axis, at
  /// rest. @pre the columns of `under` are there
  [[nodiscard]] Eigen::Matrix3d give(const SurfacePoint& at, const SurfacePoint& under,
                                     const Required& columns) const;
  /// What forces on `points` move a point of the surface. Makes the columns it needs.
  [[nodiscard]] Vector3d moved_m(const SurfacePoint& at, const std::vector<SurfacePoint>& points,
                                 const std::vector<Vector3d>& forces_newton);
  [[nodiscard]] const std::vector<std::uint32_t>& surface_nodes() const noexcept { return nodes_; }
  /// Index in surface_nodes(), −1: none.
  [[nodiscard]] std::int32_t row_of(std::uint32_t node) const { return row_of_[node]; }
  /// By solutions, since construction.
  [[nodiscard]] std::size_t columns_made() const;
  [[nodiscard]] bool has_columns(std::uint32_t node) const;

  [[nodiscard]] const Body& body() const noexcept { return body_; }
  [[nodiscard]] const Columns& all_columns() const noexcept { return columns_; }
  /// Whether the columns of these up to WarpedFactor::kMostColumns nodes, computed again, are
  /// those. Factorises if need be; allocates. @pre  all are among them
  [[nodiscard]] bool confirms(const Columns& columns, std::span<const std::uint32_t> nodes);
  /// Columns made earlier of the same body, in the same configuration.
  void set_columns(Columns columns) { columns_ = std::move(columns); }

 private:
  [[nodiscard]] bool has_factor();
  void make_room(std::uint64_t since);

  const Body& body_;
  WarpedFactor& factor_;
  std::vector<std::uint32_t> nodes_;
  std::vector<std::int32_t> row_of_;
  mutable std::mutex mutex_;  // of what follows, and of the factor
  Columns columns_;
  std::map<std::uint32_t, std::uint64_t> required_;  // when each was required last
  std::uint64_t requires_ = 0;
  std::size_t most_floats_;
  std::size_t made_ = 0;
  bool has_no_factor_ = false;
};

/// Where a body leans on something else.
struct Support {
  SurfacePoint point;
  Vector3d direction = Vector3d::UnitZ();  ///< unit; in others the point moves freely
  /// What it leans on: a point of another body, which gives way too; null: it does not.
  SurfaceCompliance* other = nullptr;
  SurfacePoint other_point = {};
  palpate::TissueMotionConfig motion = {};  ///< of what it leans on; amplitude 0: it stands still
};

/// Where a spring ties a body to another one.
struct TiePoint {
  SurfacePoint point;  ///< of this body
  SurfaceCompliance* other = nullptr;
  SurfacePoint other_point = {};
  double newton_per_m = 0.0;
  /// This body has the spring in its own stiffness, as if the other stood still; else that one has.
  bool is_in_body = false;
};

struct CondensedReport {
  Vector3d force_on_sphere_newton = Vector3d::Zero();
  int touching = 0;
  int sweeps = 0;
  double deepest_m = 0.0;  ///< penetration that is left
};

/// Contact of a rigid sphere, quasi-static but for swing(), with at most kMostPoints points of a
/// surface, from one or several full solutions with the forces in them: unilateral, Coulomb
/// friction. Copies are independent of one another.
class CondensedContact {
 public:
  static constexpr int kMostPoints = 128;
  static constexpr int kUsualPoints = 64;
  static constexpr double kStiffness_pa_per_m = 1e10;

  /// @param stiffness_pa_per_m  > 0: the penalty of points that are held @see SphereContact
  /// @param moves_surface  move_surface() will be called: needs the compliance of the whole surface
  CondensedContact(SurfaceCompliance& compliance, double friction_coefficient,
                   double stiffness_pa_per_m = kStiffness_pa_per_m, bool moves_surface = false);

  /// The points that carry a force and those nearest to the sphere, their compliance among one
  /// another; the full solution x_m with the forces of `points` in it. On the
  /// slow thread. Allocates.
  /// @param most_points  of them kUsualPoints, and more only as far as they are
  /// @param within_m     of the centre
  /// @param along        unit normal of the surface; zero: it is not known @see SphereSweep
  void prepare(const std::vector<SurfacePoint>& points, const VectorXd& x_m,
               const std::vector<Vector3d>& forces_on_body_newton, const Vector3d& centre_m,
               int most_points, double within_m = 0.0, const Vector3d& along = Vector3d::Zero());

  /// After prepare(), before relax(), instead of swing(): in the full solution the body leans on
  /// these, which give way only so much. As long as this is used it goes on to do so. The
  /// compliance C among the points becomes
  ///
  ///   C − B (W + D)⁻¹ Bᵀ
  ///
  /// with B what forces at the supports move the points, W what they move the supports, D what
  /// these give way. Of more than kMostSupports directions those nearest to the sphere of prepare()
  /// count. What moves of these carries the points: @see carried(). move_surface() does not know of
  /// it. Allocates. @throws std::runtime_error  @see require()
  /// @param ties  what it is tied to gives way too, of the nearest kMostTies; what the two bodies
  ///     lean on besides is not known to the other one
  void lean_on(std::vector<Support> supports, const std::vector<SurfacePoint>& points,
               const VectorXd& x_m, const Vector3d& centre_m, std::vector<TiePoint> ties = {});
  static constexpr std::size_t kMostSupports = 128;
  static constexpr std::size_t kMostTies = 48;
  /// Of the place that is pressed, or else of the point nearest to the sphere: how much more it
  /// would give way if the body leant on nothing, fᵀ C f over fᵀ (C − B (W + D)⁻¹ Bᵀ) f. 1: it does
  /// lean on nothing.
  [[nodiscard]] double leaning_ratio() const noexcept { return leaning_ratio_; }
  /// How what the body leans on carries the place that is pressed, or else the point nearest to the
  /// sphere: B (W + D)⁻¹ times the amplitude of each motion, quasi-static. step() does not know of
  /// it: its sphere is there less how far this has gone since the full solution.
  [[nodiscard]] const std::vector<palpate::TissueMotionConfig>& carried() const noexcept {
    return carried_;
  }

  /// After prepare(), before relax(): in steps of some length these modes of the body move as their
  /// inertia lets them, from the full solution of prepare() on; in steps of no length they are at
  /// rest. move_surface() does not know of it. Allocates.
  /// @param from_m  must outlive this, as the modes: the undeformed or untouched body
  /// @param x_m, v_m_per_s, a_m_per_s2  of all nodes in the full solution
  void swing(const SlowModes& modes, const std::vector<SurfacePoint>& points,
             const VectorXd& from_m, const VectorXd& x_m, const VectorXd& v_m_per_s,
             const VectorXd& a_m_per_s2);

  /// After prepare(), before add_equilibrium(): the body is viscous, so that its forces balance
  /// K x + relaxation_s K₀ ẋ [Rayleigh's β], and in the full solution of prepare() it moved like
  /// this. In a step of some length the points then follow at the rate of this filter, and the
  /// viscous part of a force is not taken for a deformation. Where the compliance is scaled, K is
  /// another than K₀, which the viscosity keeps. The branches of the body act on the ways of the
  /// points as on its forces: in a step they give way by 1/(1 + Σ γ b) of C at once.
  /// @param v_m_per_s  of all nodes   @param relaxation_s  ≥ 0
  /// @param memory     of the body then; null: it has no branches
  void relax(const std::vector<SurfacePoint>& points, const VectorXd& v_m_per_s,
             double relaxation_s, const Relaxation* memory = nullptr);

  /// One more equilibrium, with its forces, beside that of prepare(): a step starts from between
  /// the two whose sums of forces are the nearest, and the compliance is scaled so that it gives
  /// the work between the last two. On the slow thread, after prepare(). Allocates. Left out if it
  /// has a force on a point that was not chosen, as much force as one that is there, or if the
  /// compliance would have to change by more than a factor of two: then the body moves.
  /// @param v_m_per_s  of all nodes in it; null: at rest
  /// @param creep_m    of all nodes in it @see Relaxation; null or empty: all has relaxed
  /// @return  whether it is there now
  bool add_equilibrium(const std::vector<SurfacePoint>& points, const VectorXd& x_m,
                       const std::vector<Vector3d>& forces_on_body_newton,
                       const VectorXd* v_m_per_s = nullptr, const VectorXd* creep_m = nullptr);

  /// Forces for the sphere there; warm start from the last call. No allocation, lock or throw.
  /// @param step_s  since the last call, for the motion of relax(); 0: at rest
  CondensedReport step(const Vector3d& centre_m, double radius_m, int most_sweeps,
                       double tolerance_m, double step_s = 0.0) noexcept;

  /// Frees what the next step makes again; that step allocates.
  void fold();

  /// Displacements of the surface nodes since the full solution, 3 per node, from the forces of the
  /// last step; the place is surface_size() long. No allocation. @pre moves_surface
  void move_surface(float* displacements_m) const noexcept;

  [[nodiscard]] std::size_t surface_size() const noexcept { return surface_stride_; }
  [[nodiscard]] int point_count() const noexcept { return count_; }
  /// Of the points in prepare()'s list.
  [[nodiscard]] const std::vector<std::size_t>& chosen() const noexcept { return chosen_; }

 private:
  SurfaceCompliance* compliance_;
  double friction_coefficient_;
  double stiffness_pa_per_m_;
  bool moves_surface_;
  // A full solution: the points and the surface in it.
  struct Equilibrium {
    double sum_newton = 0.0;  // of the forces' sizes
    std::vector<Vector3d> positions_m;
    std::vector<Vector3d> rates_m;        // relaxation_s ẋ; empty: at rest
    std::vector<Vector3d> creeps_m = {};  // of the branches; empty: all has relaxed
    std::vector<Vector3d> forces_newton;  // on the body
    std::vector<float> surface_m;         // moved since that of prepare(); moves_surface_
  };
  [[nodiscard]] bool is_usable(const std::vector<Vector3d>& forces_on_body_newton) const;
  [[nodiscard]] double sum_of_forces_newton() const noexcept;
  void start_between(double sum_newton) noexcept;
  [[nodiscard]] std::vector<Vector3d> rates_of(const std::vector<SurfacePoint>& points,
                                               const VectorXd& v_m_per_s) const;
  void begin_swing(double step_s, double pace) noexcept;
  void add_swing(double pace) noexcept;
  void stand_still() noexcept;
  [[nodiscard]] bool scale_compliance();
  using Motions = std::vector<std::pair<palpate::TissueMotionConfig, Eigen::VectorXd>>;
  void be_tied(std::vector<TiePoint> ties, const std::vector<Support>& supports,
               const Eigen::MatrixXd& supports_give, const Motions& motions,
               const std::vector<SurfacePoint>& points, const VectorXd& x_m,
               const Vector3d& centre_m);
  void be_carried(const palpate::TissueMotionConfig& motion, const Eigen::VectorXd& pushed_m);
  void take(const Eigen::MatrixXd& taken);
  [[nodiscard]] double ratio_with(const Eigen::MatrixXd& less) const;
  [[nodiscard]] std::vector<float>& own_among();
  [[nodiscard]] const std::vector<float>& in_step() const noexcept {
    return modal_.is_empty() ? *among_ : stepped_;
  }
  // Where the body of this equilibrium would come to rest under its forces.
  [[nodiscard]] Vector3d rest_of(const Equilibrium& one, std::size_t point) const noexcept {
    Vector3d rest_m = one.positions_m[point];
    if (!one.rates_m.empty()) rest_m += scale_ * one.rates_m[point];
    if (!one.creeps_m.empty()) rest_m += one.creeps_m[point];
    return rest_m;
  }

  int count_ = 0;
  std::size_t stride_ = 0;  // floats per column of among_
  std::vector<std::size_t> chosen_;
  std::vector<Equilibrium> equilibria_;  // by ascending sum
  VectorXd first_m_;                     // all nodes in that of prepare(); moves_surface_
  std::size_t lower_ = 0;                // the step is between this one and the next,
  double share_ = 0.0;                   // so far from it to the next
  std::vector<Vector3d> positions_m_;    // there, without what the compliance adds
  std::vector<double> rigid_give_;       // of the penalty at each point [m/N]
  std::vector<char> is_held_;
  std::vector<Vector3d> base_forces_newton_;
  std::vector<Vector3d> forces_newton_;  // on the body
  std::vector<Vector3d> axes_;           // of what is pressed in prepare()'s @see SphereSweep
  std::vector<Vector3d> still_m_;        // the points between the equilibria @see SphereSweep
  Vector3d along_ = Vector3d::Zero();
  std::vector<Vector3d> reached_m_;     // the points at the end of the last step
  std::vector<float> displacements_m_;  // that the compliance adds, 3 each
  /// Column-major 3n × 3n, without the modes of modal_; of all copies.
  std::shared_ptr<std::vector<float>> among_ = std::make_shared<std::vector<float>>();
  ModalMotion modal_;
  std::vector<float> stepped_;       // among_ and what the modes give way in a step of this pace
  double stepped_pace_ = 0.0;        // 0: among_ was changed
  std::vector<Vector3d> bases_m_;    // positions_m_, and where the modes go under the base forces
  std::vector<float> onto_surface_;  // column-major, 3 rows per surface node; moves_surface_
  std::size_t surface_stride_ = 0;
  std::array<Vector3d, kMostPoints> normals_;  // of the sphere at the points, in a step
  Vector3d centre_m_ = Vector3d::Zero();
  bool has_centre_ = false;
  double relaxation_s_ = 0.0;
  std::vector<Branch> branches_;
  std::vector<std::vector<Vector3d>> ways_m_;  // h of each branch, of each point
  std::vector<Vector3d> held_m_;               // positions_m_ less what the branches hold
  double scale_ = 1.0;                         // of the compliance
  std::vector<palpate::TissueMotionConfig> carried_;
  double leaning_ratio_ = 1.0;
};

}  // namespace palpate::elastic
