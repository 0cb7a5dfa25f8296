// SPDX-License-Identifier: Apache-2.0
// jaw.h — the jaws of one tool, a needle or a blade on one elastic body: what they hold in the full
// solution, and what that leaves to the steps between two solutions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "common/core/messages.h"
#include "common/session/scene_config.h"
#include "physics_node/elastic/condensed/stated_error.h"
#include "physics_node/elastic/grip/held_points.h"
#include "physics_node/elastic_tissue/blade/blade_place.h"
#include "physics_node/elastic_tissue/elastic_body.h"
#include "physics_node/elastic_tissue/elastic_simulation.h"

namespace palpate::physics {

/// What a step of the tool knows of its jaws.
struct JawInput {
  bool is_closed = false;                      ///< the button is held
  Vector3 velocity_m_per_s = Vector3::Zero();  ///< of the tool
  std::optional<GripReport> report{};          ///< of mofc_node, to this physics
  Vector3 inward_world = -Vector3::UnitZ();    ///< where the tip points, or a blade faces; unit
  Vector3 edge_world = Vector3::UnitZ();       ///< of a blade, from the tip on; unit
  /// mofc_node decides how it slips as soon as it knows of it, and the hand feels nothing before.
  bool is_felt_elsewhere = false;
};

/// What the jaws shall do on one body, as a step of the tool knows it.
struct JawCommand {
  std::uint32_t number = 0;  ///< of the closing, from 1; 0: never closed
  bool is_closed = false;    ///< around this body, and has not lost it
  double inward_x = 0.0;     ///< of a needle or a blade
  double inward_y = 0.0;
  double inward_z = 0.0;
  double edge_x = 0.0;  ///< of a blade
  double edge_y = 0.0;
  double edge_z = 0.0;
  double deepest_m = 0.0;   ///< of its cut
  double paid_joule = 0.0;  ///< by the hand, since that closing
  bool is_felt = false;     ///< by the hand
  double slip_x_m = 0.0;    ///< of the tool since that closing
  double slip_y_m = 0.0;
  double slip_z_m = 0.0;

  [[nodiscard]] Vector3 inward() const noexcept { return {inward_x, inward_y, inward_z}; }
  [[nodiscard]] Vector3 edge() const noexcept { return {edge_x, edge_y, edge_z}; }
  [[nodiscard]] Vector3 slip_m() const noexcept { return {slip_x_m, slip_y_m, slip_z_m}; }
};

/// What a full solution says of the tissue in the jaws, with K the stiffness of the held points at
/// rest, corrected by how the force changed from solution to solution
/// (elastic::updated_stiffness):
///
///   F = f₀ − K (a − a₀) − τ K v   a the place of the tool less its slip, v its velocity
///
/// as a viscous body balances K x + β K ẋ; τ is more than its β where the tissue at the jaws is
/// stretched far. What other tools hold of the body moves it too.
struct GripModel {
  /// What another tool holds in the solution: the force on this one falls with
  /// Kᵢⱼ (aⱼ − aⱼ₀ + τ (vⱼ − vⱼ₀)).
  struct Other {
    std::size_t tool = 0;
    std::uint32_t number = 0;  ///< of its closing
    Matrix3 stiffness_newton_per_m = Matrix3::Zero();
    Vector3 place_m = Vector3::Zero();
    Vector3 velocity_m_per_s = Vector3::Zero();

    [[nodiscard]] Vector3 pull_newton(const Vector3& at_m, const Vector3& v_m_per_s,
                                      double relaxation_s) const noexcept {
      return -stiffness_newton_per_m *
             (at_m - place_m + relaxation_s * (v_m_per_s - velocity_m_per_s));
    }
  };
  std::uint32_t number = 0;                    ///< of the closing
  std::uint32_t points = 0;                    ///< 0: they hold nothing
  Vector3 place_m = Vector3::Zero();           ///< of the tool in the solution, less its slip
  Vector3 velocity_m_per_s = Vector3::Zero();  ///< in the solution
  Vector3 elastic_force_on_tool_newton = Vector3::Zero();  ///< f₀
  Matrix3 stiffness_newton_per_m = Matrix3::Identity();
  double relaxation_s = 0.0;         ///< τ
  double stored_energy_joule = 0.0;  ///< in the body, since they closed
  /// Of a needle or a blade, how deep it was when they closed: its tip was so far below the surface
  /// that was there, less the way of what it holds.
  double start_m = 0.0;
  EdgeInTissue edge{};  ///< of a blade
  std::vector<Other> others{};
  elastic::StatedError error{};  ///< by the way from `place_m`

  [[nodiscard]] bool is_holding() const noexcept { return points > 0; }
  /// @param by_others_newton  what the others have added since the solution
  [[nodiscard]] Vector3 force_at(const Vector3& at_m, const Vector3& v_m_per_s,
                                 const Vector3& by_others_newton) const noexcept {
    return elastic_force_on_tool_newton + by_others_newton -
           stiffness_newton_per_m * (at_m - place_m + relaxation_s * v_m_per_s);
  }
};

/// The contact of hop 3. No allocation.
/// @param at_m              the tool, less its slip
/// @param by_others_newton  what other tools have added since the solution
[[nodiscard]] Contact grip_contact(const GripModel& model, const GripperConfig& gripper,
                                   std::uint32_t tissue, const Vector3& at_m,
                                   const Vector3& v_m_per_s, const Vector3& slip_m,
                                   const Vector3& by_others_newton = Vector3::Zero(),
                                   const NeedleLaw& needle = {}) noexcept;

/// How many points of the untouched surface the jaws take, where a tip lies on it: at up to some
/// 2,000 places, sorted.
[[nodiscard]] std::vector<std::size_t> points_in_reach(const ElasticBody& body,
                                                       const GripperConfig& gripper,
                                                       double tip_radius_m);

/// Takes hold, follows and lets go in full solutions. One thread; allocates.
class Jaw {
 public:
  /// Before a step of the body. A blade that cannot be held goes out again.
  void prepare(ElasticSimulation& simulation, std::size_t tool,
               elastic::SurfaceCompliance& compliance, const GripperConfig& gripper,
               const JawCommand& command, const std::optional<TipState>& tip);
  /// The body has been replaced by what is left of it: whatever the jaws still hold is held. A
  /// blade takes the points that are beside its edge now, and pushes them as it has pushed those
  /// before.
  /// @param compliance  of the new body
  /// @param gripper  null: it holds nothing any more
  void change_body(ElasticSimulation& simulation, std::size_t tool,
                   elastic::SurfaceCompliance& compliance, const GripperConfig* gripper);
  /// Of a blade that is in: where it went in, and how far it goes in a cut of before.
  [[nodiscard]] const BladePlace& blade() const noexcept { return blade_; }
  [[nodiscard]] double deepest_m() const noexcept { return deepest_m_; }
  void set_edge(const EdgeInTissue& edge) noexcept;
  /// Of its slip, what has cut: the rest is slip that the solutions do not explain. @see
  /// follow_slip
  /// @param slip_m  as the steps of the tool say, since the closing
  [[nodiscard]] Vector3 slip_in_tissue_m(const Vector3& slip_m) const noexcept {
    return slip_m - (behind_m_ + unpaid_m_) * blade_.facing;
  }
  /// After it, and after all tools have been prepared. Makes the stiffness, where the grips of the
  /// body are others than before.
  /// @param step_s    of the step
  /// @param changes   of the grips of the body so far
  /// @param is_alone  no other tool acts on the body
  /// @throws std::runtime_error  it cannot be made; the jaws have let go
  void read(ElasticSimulation& simulation, std::size_t tool, elastic::SurfaceCompliance& compliance,
            double step_s, std::uint64_t changes, bool is_alone);
  /// After read() of all jaws of the body: what the others hold.
  void note_other(std::size_t tool, const GripModel& other);
  [[nodiscard]] const GripModel& model() const noexcept { return model_; }
  /// How far the last solution was from what the model before it says for the same places.
  struct Measured {
    double error_newton = 0.0;
    double way_m = 0.0;
  };
  /// None: it held nothing then, or the grips of the body have changed.
  [[nodiscard]] const std::optional<Measured>& measured() const noexcept { return measured_; }
  [[nodiscard]] elastic::StatedError& error() noexcept { return model_.error; }
  /// Closings and openings that changed what is held.
  [[nodiscard]] std::uint64_t changes() const noexcept { return changes_; }

 private:
  /// What a solution says of the jaws.
  struct Seen {
    Vector3 place_m = Vector3::Zero();
    Vector3 velocity_m_per_s = Vector3::Zero();
    Vector3 force_on_tool_newton = Vector3::Zero();
    double stored_joule = 0.0;
    double kinetic_joule = 0.0;

    /// Of the spring alone, from `before` until this, if viscosity acts for τ.
    [[nodiscard]] Vector3 way_m(const Seen& before, double tau_s) const {
      return place_m - before.place_m + tau_s * (velocity_m_per_s - before.velocity_m_per_s);
    }
  };
  void let_go(ElasticSimulation& simulation, std::size_t tool);
  [[nodiscard]] std::size_t hold_beside(ElasticSimulation& simulation, std::size_t tool,
                                        const GripperConfig& gripper, const Vector3& at_m,
                                        const Vector3& slip_m, const Vector3& origin_m) const;
  void move_beside(ElasticSimulation& simulation, std::size_t tool,
                   elastic::SurfaceCompliance& compliance, const GripperConfig& gripper);
  void begin_blade(ElasticSimulation& simulation, std::size_t tool,
                   elastic::SurfaceCompliance& compliance, const GripperConfig& gripper,
                   const JawCommand& command, const TipState& tip);
  void follow_slip(ElasticSimulation& simulation, std::size_t tool, const JawCommand& command,
                   const TipState& tip);
  [[nodiscard]] double regain(double step_s);
  [[nodiscard]] double explained_m(const ElasticSimulation& simulation, std::size_t tool,
                                   const Vector3& at_m) const noexcept;
  void keep_books(const Seen& now, double step_s, bool is_alone) noexcept;
  [[nodiscard]] double twice_joule(const Vector3& way_m, std::size_t tool) const;
  void hold_around(ElasticSimulation& simulation, std::size_t tool, const GripperConfig& gripper,
                   const JawCommand& command, const TipState& tip);
  [[nodiscard]] Measured measure(const ElasticSimulation& simulation, const Seen& now,
                                 double step_s) const;
  void watch_losses(const Seen& now, double beta_s, double step_s);

  GripModel model_;
  BladePlace blade_;
  double deepest_m_ = 0.0;
  /// Of a blade since it went in, as the solutions have it.
  struct BladeBooks {
    double home_m = 0.0;               // of the surface where it went in, along its direction
    Vector3 slip_m = Vector3::Zero();  // as the steps of the tool say
    double deepest_m = 0.0;            // that it has cut, by slip_in_tissue_m()
    Vector3 tip_m = Vector3::Zero();
    Vector3 tip_before_m = Vector3::Zero();  // in the solution before
    double rest_joule = 0.0;                 // in the body, without the blade
    double lost_joule = 0.0;  // work − stored − cut: where it is < 0, it has cut unpaid
    double left_joule = 0.0;  // of the work that the hand has felt, after cuts and friction
    double paid_joule = 0.0;  // by the hand, now
    double paid_before_joule = 0.0;
    double short_m = 0.0;         // that since a next body it pushes less far than it is
    double released_joule = 0.0;  // by next bodies, that it has not pushed with again
    // in this step: by the cut, by spreading and friction, and by what it has pushed with again
    double cut_joule = 0.0;
    double rubbed_joule = 0.0;
    double pushed_joule = 0.0;
    double released_s = 0.0;   // that a next body still has to come to rest
    std::size_t elements = 0;  // of the body
    bool is_known = false;     // what was stored in the solution before
    bool is_alone = true;
  };
  [[nodiscard]] bool is_blade() const noexcept { return blade_.length_m > 0.0; }
  /// The first solutions of a next body: they change the force more than the blade does.
  [[nodiscard]] bool is_coming_to_rest() const noexcept {
    return books_.released_s > 0.6 * kReleased_s;
  }
  static constexpr double kReleased_s = 0.2;
  BladeBooks books_;
  double behind_m_ = 0.0;                // of its slip, what has not cut, but pushes
  double unpaid_m_ = 0.0;                // of its slip, what has neither cut nor pushes
  std::vector<Matrix3> stiffness_with_;  // of each tool of the body, at rest
  std::optional<Measured> measured_;
  Vector3 across_m_ = Vector3::Zero();  // that a needle still slides to where it would be at rest
  double closed_joule_ = 0.0;           // in the body, when they closed
  bool is_body_new_ = false;            // since the last read()
  Seen last_;                           // the solution before
  Seen explained_;  // one that K has been made for, or in which the tool stood still
  // of late: what the body has dissipated, and what β K v would have
  double lost_joule_ = 0.0;
  double expected_joule_ = 0.0;
  std::uint64_t changes_ = 0;
  std::optional<std::uint64_t> known_;  // changes of the body for which the stiffness was made
};

/// Within a factor in every direction: changes from solution to solution may have other causes.
[[nodiscard]] bool is_like_at_rest(const Matrix3& stiffness_newton_per_m,
                                   const Matrix3& at_rest_newton_per_m);

/// The grip without its place: for the slip, and for hop 3.
[[nodiscard]] Grip grip_of(const GripperConfig& gripper, std::uint32_t number,
                           const Vector3& slip_m, const NeedleLaw& needle) noexcept;

/// The jaws of a tool whose slip nobody else decides: they slip by Coulomb's law, tear, and lose
/// what has slipped out of them. Or a needle, which slips along itself until it is out. No
/// allocation.
class SlippingJaw {
 public:
  /// @param closing  number of the closing; 0: they are open
  void set(std::uint32_t closing) noexcept;
  /// The force on the tool there, after it has slipped, if the model is of this closing.
  /// @param viscous_ratio     β over the length of a step, where a slip counts for the velocity,
  /// too
  /// @param by_others_newton  what other tools have added since the solution
  [[nodiscard]] Vector3 act(const GripModel& model, const GripperConfig& gripper,
                            const Vector3& tip_m, const Vector3& v_m_per_s,
                            double viscous_ratio = 0.0,
                            const Vector3& by_others_newton = Vector3::Zero()) noexcept;
  /// Somebody else decides.
  void follow(const Vector3& slip_m, bool has_let_go) noexcept;
  /// After that or act(): the work of the hand on a blade.
  /// @param is_felt  by the hand
  void note_work(const Vector3& force_on_tool_newton, const Vector3& tip_m, bool is_felt) noexcept;
  /// Of what mofc_node renders: against its way at most that at which the blade yields.
  [[nodiscard]] Vector3 yielding_newton(const Vector3& force_on_tool_newton) const noexcept;
  [[nodiscard]] JawCommand command() const noexcept;
  /// Of hop 3: of a needle since it was at the surface.
  [[nodiscard]] const Vector3& slip_m() const noexcept { return slip_m_; }
  /// Since the closing.
  [[nodiscard]] Vector3 slip_since_m() const noexcept {
    return slip_m_ - start_m_ * needle_.inward_world;
  }
  /// A needle is as deep as the first solution says that holds it.
  void begin(const GripModel& model) noexcept {
    if (!holds(model) || std::exchange(has_begun_, true)) return;
    start_m_ = model.start_m;
    slip_m_ += start_m_ * needle_.inward_world;
  }
  [[nodiscard]] std::uint32_t number() const noexcept { return number_; }
  [[nodiscard]] bool is_closed() const noexcept { return is_closed_; }
  [[nodiscard]] bool is_lost() const noexcept { return is_lost_; }
  /// There is none with jaws.
  [[nodiscard]] NeedleLaw& needle() noexcept { return needle_; }
  /// Another one: a hole without depth. After set().
  [[nodiscard]] NeedleLaw& start_needle() noexcept {
    has_begun_ = false;
    start_m_ = 0.0;
    return needle_ = {};
  }
  [[nodiscard]] double depth_m() const noexcept { return slip_m_.dot(needle_.inward_world); }
  /// Closed around what they took.
  [[nodiscard]] bool holds(const GripModel& model) const noexcept {
    return is_closed_ && !is_lost_ && model.is_holding() && model.number == number_;
  }

 private:
  std::uint32_t number_ = 0;
  bool is_closed_ = false;
  bool is_lost_ = false;
  Vector3 slip_m_ = Vector3::Zero();
  NeedleLaw needle_{};
  bool has_begun_ = false;
  double start_m_ = 0.0;
  double paid_joule_ = 0.0;
  bool is_felt_ = false;  // in the last note_work()
  Vector3 felt_newton_ = Vector3::Zero();
  Vector3 felt_at_m_ = Vector3::Zero();
};

}  // namespace palpate::physics
