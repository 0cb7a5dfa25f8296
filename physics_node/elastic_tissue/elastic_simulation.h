// SPDX-License-Identifier: Apache-2.0
// elastic_simulation.h — an elastic body in motion, touched by the tips of the tools: the full
// solution.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "physics_node/elastic/attached/tearing.h"
#include "physics_node/elastic/attached/tie.h"
#include "physics_node/elastic/contact/rigid_contact.h"
#include "physics_node/elastic/dynamics.h"
#include "physics_node/elastic/grip/held_points.h"
#include "physics_node/elastic_tissue/elastic_body.h"

namespace palpate::physics {

struct BodyChange;

/// Where a tip is, and the friction that acts on it.
struct TipState {
  Vector3 tip_m = Vector3::Zero();
  /// Of its proxy on the untouched surface: outside of the body, on the side from which it came.
  Vector3 place_m = Vector3::Zero();
  Vector3 friction_on_tool_newton = Vector3::Zero();
  Vector3 slip_m = Vector3::Zero();  ///< of its jaws, since they closed
};

/// One simulation of a body; deterministic. One thread calls it; allocates.
class ElasticSimulation {
 public:
  /// @param body  must outlive it   @param step_s  > 0: of a step, unless it says otherwise
  /// @param is_folded  fold() will be called
  ElasticSimulation(const ElasticBody& body, std::size_t tools, double tip_radius_m, double step_s,
                    bool is_folded = false);

  /// Begins anew, untouched and at rest; only the counts of the other one go on.
  ElasticSimulation(const ElasticBody& body, const ElasticSimulation& before, bool is_folded);

  /// Goes on as another one, of a body of which something has vanished since: the rest is where it
  /// was, moves as it did, and is held and touched as it was; @see AblatedBody.
  ElasticSimulation(const ElasticBody& body, const ElasticSimulation& before,
                    const BodyChange& change, bool is_folded);

  /// Continues as the other would, to the bit. @pre  of the same body, as many tools
  void continue_as(const ElasticSimulation& other);

  /// @see elastic::Dynamics::fold
  void fold() { dynamics_.fold(); }

  /// One step of backward Euler with the tips at these places; none: the tool is not there. Where a
  /// tip near the body has moved by more than half its radius, the step is made in up to kMostParts
  /// parts, on the straight way there. The sphere that the body meets comes from the tip's proxy
  /// and follows the tip, in contact by at most a radius a part. The friction acts on the points
  /// that were pressed in the last step, in proportion. False: skipped, at rest and untouched.
  ///
  /// A step after which the surface presses on a sphere from behind, or the centre of a sphere is
  /// inside the body, has failed and is not converged: the body goes back to where it was before,
  /// and the spheres wait there; if that fails too, the body stays there with its forces. After
  /// some such steps in a row (of a body that is near no other one), or a sphere's first step, it
  /// begins again from its untouched state, the spheres from their proxies, and goes as far as it
  /// can in up to kMostRepairSteps steps. Under a tip that appears inside the body this comes to
  /// rest at once: it did not move there.
  /// @param step_s  in [¼, 1] × that of the constructor; none: that
  bool step(std::span<const std::optional<TipState>> tips, std::optional<double> step_s = {});

  /// For the next steps: the time of what moves of what the body lies on, at the end of the step.
  /// In the first of them, and when the body begins again, it goes there in small parts that take
  /// no time.
  void set_time(double time_s) { time_s_ = time_s; }

  /// For the next steps: planes of other bodies that it may touch, and whether one of those moves.
  void set_neighbors(std::vector<elastic::ContactPlane> planes, bool is_moving) {
    tips_.neighbors = std::move(planes);
    is_neighbor_moving_ = is_moving;
  }
  /// For the next steps: what ties it to other bodies, and whether one of those moves.
  void set_ties(std::vector<elastic::Tie> ties, bool is_moving) {
    tips_.ties = std::move(ties);
    is_neighbor_moving_ = is_neighbor_moving_ || is_moving;
  }
  /// The end of a step of an island: a tie of this body has been so far apart.
  /// @param place  among tearing().attachments()
  void note_tie(std::size_t place, double apart_m) {
    has_torn_ = tips_.tearing.note(place, apart_m) || has_torn_;
  }
  /// What is stored in ties and in the bodies tied to this one.
  void set_stored_elsewhere(double joule) { elsewhere_joule_ = joule; }
  /// The last step once more under other planes, unless it was made in parts or has failed; then,
  /// or if it fails now, it stays as it is.
  void step_again();
  [[nodiscard]] bool is_asleep() const noexcept { return dynamics_.is_asleep(); }

  /// From now on a tool holds the nearest points within reach of that place, as the body is now,
  /// and does not touch it with its tip. @see elastic::HeldPoints::take  @return  their number
  /// @param is_as_at_rest  as they lie to each other in the untouched body
  std::size_t hold(std::size_t tool, const Vector3& at_m, double reach_m, std::size_t most,
                   double newton_per_m, bool is_as_at_rest = false);
  /// The same of the points beside an edge in the untouched body.
  /// @see elastic::HeldPoints::take_beside
  std::size_t hold_beside(std::size_t tool, const Vector3& at_m,
                          const std::array<Vector3, 2>& edge_m, double reach_m, std::size_t most,
                          double newton_per_m, const Vector3& origin_m);
  /// What it holds lies so much farther from the tool.
  void shift(std::size_t tool, const Vector3& by_m) { tips_.held[tool].shift(by_m); }
  /// @see elastic::HeldPoints::origin_m
  [[nodiscard]] Vector3 origin_m(std::size_t tool) const noexcept {
    return tips_.held[tool].origin_m(body_.start_m.data());
  }
  /// The mean way of the points that a tool holds, from the untouched body.
  [[nodiscard]] Vector3 moved_m(std::size_t tool) const noexcept {
    return tips_.held[tool].moved_m(dynamics_.x_m().data(), body_.start_m.data());
  }
  void let_go(std::size_t tool) { tips_.held[tool].let_go(); }
  /// By tool. @pre  one that holds has a TipState in every step
  [[nodiscard]] const std::vector<elastic::HeldPoints>& held() const noexcept { return tips_.held; }

  /// What it lies on.
  [[nodiscard]] const elastic::RigidContact& rigid() const noexcept { return tips_.rigid; }

  /// What of its attachments has torn.
  [[nodiscard]] const elastic::Tearing& tearing() const noexcept { return tips_.tearing; }
  [[nodiscard]] bool has_torn() const noexcept { return has_torn_; }  ///< further, in the last step

  /// Elastic, of weight and in jaws: what the body, with those tied to it, would give back if it
  /// were moved slowly.
  [[nodiscard]] double stored_joule() const noexcept;
  /// The same without jaws, ties and other bodies.
  [[nodiscard]] double own_joule() const noexcept {
    return report_.elastic_joule + report_.gravity_joule +
           tips_.tearing.stored_joule(dynamics_.x_m().data());
  }

  struct Touch {
    bool is_near = false;                 ///< the tip may touch within the next steps
    bool is_arriving = false;             ///< the tip appeared inside, the sphere is on its way
    bool has_failed = false;              ///< in the last step: there is no force
    int blocked_steps = 0;                ///< that the sphere will wait: the body cannot give way
    Vector3 blocked_m = Vector3::Zero();  ///< from the sphere to the tip when it began to wait
    Vector3 centre_m = Vector3::Zero();   ///< of the sphere in the last step
    Vector3 force_on_tool_newton = Vector3::Zero();        ///< by tip or jaws
    std::vector<elastic::Vector3d> forces_on_body_newton;  ///< of body.points; empty: none
  };
  [[nodiscard]] const Touch& touch(std::size_t tool) const { return touches_[tool]; }
  [[nodiscard]] const elastic::VectorXd& x_m() const noexcept { return dynamics_.x_m(); }
  [[nodiscard]] const elastic::VectorXd& v_m_per_s() const noexcept {
    return dynamics_.v_m_per_s();
  }
  [[nodiscard]] const elastic::Relaxation& relaxation() const noexcept {
    return dynamics_.relaxation();
  }
  [[nodiscard]] const elastic::VectorXd& acceleration_m_per_s2() const noexcept {
    return dynamics_.acceleration_m_per_s2();
  }
  [[nodiscard]] elastic::EquilibriumSearch& search() noexcept { return dynamics_.search(); }
  [[nodiscard]] const elastic::StepReport& report() const noexcept { return report_; }
  [[nodiscard]] const ElasticBody& body() const noexcept { return body_; }
  [[nodiscard]] double step_s() const noexcept { return step_s_; }  ///< of the constructor
  [[nodiscard]] double tip_radius_m() const noexcept { return tip_radius_m_; }
  /// Steps that failed, since construction.
  [[nodiscard]] std::uint64_t failed_steps() const noexcept { return failed_steps_; }
  /// Of these, those after which the body holds every sphere on the right side.
  [[nodiscard]] std::uint64_t repaired_steps() const noexcept { return repaired_steps_; }

  /// Tips that appeared inside the body, since construction.
  [[nodiscard]] std::uint64_t appeared() const noexcept { return appeared_; }

  static constexpr int kMostRepairSteps = 12;
  static constexpr int kMostParts = 4;

  /// Equivalent strain √(⅔ dev E : dev E) at the body's surface nodes, mean of their elements.
  void shown_strain(std::vector<float>& strain) const;

 private:
  /// The potential of all spheres that are near, of what is held, of what tears, of what the body
  /// is tied to, and of what it lies on.
  class Tips final : public elastic::Obstacle {
   public:
    explicit Tips(const ElasticBody& body) : tearing(*body.body), rigid(*body.resting) {}
    std::vector<elastic::SphereContact> contacts;
    std::vector<char> is_near;
    std::vector<elastic::HeldPoints> held;  // by tool
    elastic::Tearing tearing;
    elastic::RigidContact rigid;
    std::vector<elastic::ContactPlane> neighbors;
    std::vector<elastic::Tie> ties;
    std::vector<std::pair<std::uint32_t, Vector3>> rubbed_newton;  // by node of the body
    double add_gradient(const double* x_m, double* gradient) const override;
    void add_stiffness(const double* x_m, const elastic::BlockPattern& pattern,
                       elastic::BlockValues& values) const override;
    void add_exact_stiffness(const double* x_m, const elastic::BlockPattern& pattern,
                             elastic::BlockValues& values) const override;
    [[nodiscard]] double longest_correction_m() const override;
    bool begin_round(const double* x_m, const elastic::BlockPattern& pattern) override;
    [[nodiscard]] bool is_still() const override;
    [[nodiscard]] bool is_idle() const {
      return is_still() && rigid.is_idle() && neighbors.empty() && ties.empty();
    }
  };

  [[nodiscard]] int parts_of(std::span<const std::optional<TipState>> tips) const;
  bool step_part(std::span<const std::optional<TipState>> tips);
  void rub(const Touch& touch, const Vector3& friction_on_tool_newton);
  bool follow(std::size_t tool, const TipState& tip);
  [[nodiscard]] bool step_once(bool is_again = false);
  [[nodiscard]] bool settle();
  void be_carried();
  [[nodiscard]] bool is_wrong(std::size_t tool) const;
  void repair(std::span<const std::optional<TipState>> tips,
              const std::vector<Touch>& touches_before,
              const std::vector<elastic::SphereContact>& contacts_before);
  void begin_again(std::span<const std::optional<TipState>> tips,
                   const std::vector<std::size_t>& there);
  [[nodiscard]] elastic::Relaxation relaxed() const;
  void set_body(const elastic::VectorXd& x_m, const elastic::Relaxation& relaxation);
  [[nodiscard]] bool is_inside(const Vector3& place_m) const;

  const ElasticBody& body_;
  double tip_radius_m_;
  double step_s_;
  double this_step_s_;
  elastic::Dynamics dynamics_;
  Tips tips_;
  std::vector<Touch> touches_;
  std::vector<std::optional<TipState>> last_tips_;  // of the last step
  std::vector<std::optional<TipState>> part_tips_;
  std::vector<std::array<std::uint32_t, 3>> triangles_;
  elastic::VectorXd before_m_;          // the last step
  elastic::Relaxation before_relaxed_;  // and what the body remembered then
  elastic::RigidContact before_rigid_;  // and how it lay
  elastic::StepReport report_;
  std::uint64_t failed_steps_ = 0;
  std::uint64_t repaired_steps_ = 0;
  std::uint64_t appeared_ = 0;
  int failed_in_a_row_ = 0;
  // of what the body lies on
  std::optional<double> time_s_;
  double part_time_s_ = 0.0;
  std::optional<double> carried_s_;  // at the end of the last step
  bool has_torn_ = false;
  bool is_neighbor_moving_ = false;
  double elsewhere_joule_ = 0.0;
  bool can_step_again_ = false;
};

}  // namespace palpate::physics
