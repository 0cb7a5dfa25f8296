// SPDX-License-Identifier: Apache-2.0
// elastic_tissue.h — one elastic body for all tools: full solutions on a slow thread, and between
// them the force on each tool at the physics rate from a condensed model.
//
//   slow thread   solve()   the body as a whole (elastic_simulation.h); then for each tool the
//                           compliance of the points of the surface near its tip, handed over
//   tool's step   touch()   contact of the sphere with these points, whatever the size of the mesh
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "common/core/handover.h"
#include "common/core/messages.h"
#include "common/core/snapshot.h"
#include "physics_node/elastic/condensed/condensed_contact.h"
#include "physics_node/elastic/condensed/stated_error.h"
#include "physics_node/elastic_tissue/ablation/ablation.h"
#include "physics_node/elastic_tissue/blade/blade_sweep.h"
#include "physics_node/elastic_tissue/body_compliance.h"
#include "physics_node/elastic_tissue/elastic_contact.h"
#include "physics_node/elastic_tissue/elastic_simulation.h"
#include "physics_node/elastic_tissue/jaw.h"
#include "physics_node/elastic_tissue/needle/piercing.h"
#include "physics_node/elastic_tissue/patch/patch_maker.h"
#include "physics_node/elastic_tissue/touching/carried.h"

namespace palpate::physics {

inline constexpr double kUnknownNewton = std::numeric_limits<double>::quiet_NaN();

/// What the slow thread knows; @see PhysicsCounters.
struct ElasticFigures {
  std::uint64_t solves = 0;
  std::uint64_t skipped = 0;
  std::uint64_t late = 0;
  std::uint64_t failed = 0;
  std::uint64_t repaired = 0;
  std::uint64_t appeared = 0;
  std::uint64_t bounds_checked = 0;
  std::uint64_t bound_violations = 0;
  std::uint32_t points_held = 0;
  AblationFigures ablation;
  std::uint64_t torn = 0;  ///< attachments
  double torn_joule = 0.0;
  double residual_ratio = 0.0;
  double error_newton = kUnknownNewton;
};

class ElasticTissue {
 public:
  /// @param shared  of all simulations of the body   @param is_folded  @see ElasticPace::kFolded
  /// @param gripper, electrode  of every tool; none: they only touch
  /// @param is_in_background  @see Ablation
  ElasticTissue(std::shared_ptr<BodyCompliance> shared, std::size_t tools, double tip_radius_m,
                bool is_folded = false, const std::optional<GripperConfig>& gripper = {},
                const std::optional<ElectrodeConfig>& electrode = {},
                bool is_in_background = false);
  ~ElasticTissue() = default;
  ElasticTissue(const ElasticTissue&) = delete;
  ElasticTissue& operator=(const ElasticTissue&) = delete;

  /// Continues as the other would, to the bit; what hop 3 carries begins anew. While no other
  /// thread uses the two. @pre  of the same body, as many tools
  void continue_as(const ElasticTissue& other);

  // --- the thread of the steps of a tool: no allocation, lock or throw ---

  /// Where the tip is, for the next full solution and touch().
  /// @param reach_m  bodies this near are described before they are touched
  /// @param time_s   not before that of the last call
  /// @param is_energised  its electrode, since the last call
  void note(std::size_t tool, const Vector3& tip_m, double reach_m, double time_s,
            bool is_energised = false) noexcept;
  /// From the tip where note() put it to the untouched surface; infinite: out of reach.
  [[nodiscard]] double distance_m(std::size_t tool) const noexcept {
    const TipSide& side = tools_[tool]->side;
    return side.is_known() ? side.view().distance_m : std::numeric_limits<double>::infinity();
  }
  /// What the jaws do, for the next full solution and touch().
  /// @param closing  number of the closing around this body, ascending; 0: they are open
  /// @param report   of that closing, where mofc_node decides how they slip; null: this does
  /// @param velocity_m_per_s  of the tool
  void set_jaw(std::size_t tool, std::uint32_t closing, const GripReport* report,
               const Vector3& velocity_m_per_s) noexcept;
  /// What a needle does: it goes in by itself where it presses.
  /// @param may_pierce  it is in no other body
  void set_needle(std::size_t tool, const JawInput& input, bool may_pierce) noexcept;
  /// A needle has gone in, and is not out.
  [[nodiscard]] bool is_pierced(std::size_t tool) const noexcept {
    return tools_[tool]->jaw.is_closed();
  }
  /// The contact of the tip where note() put it, or of what the jaws hold; false if the surface is
  /// not within reach.
  bool touch(std::size_t tool, Contact& contact) noexcept;
  /// mofc_node solves the contact itself: from now on solutions come with a patch of the surface.
  /// @param age_s  of the loop, from a DeviceState to the first use of its answer
  void describe_ahead(std::size_t tool, const Vector3& velocity_m_per_s, double age_s) noexcept;
  /// The newest, until the next call; null: none.
  [[nodiscard]] const ElasticPatch* patch(std::size_t tool) noexcept {
    return tools_[tool]->patch.newest();
  }
  /// Stated bound of the error of the last contact's force, from the errors measured since the tip
  /// came near [N]. NaN: unknown. No error has been measured, or nothing is known of the place but
  /// its material.
  [[nodiscard]] double bound_newton(std::size_t tool) const noexcept {
    return tools_[tool]->bound_newton;
  }

  /// With the next full solution the body is again as in the session, untouched and at rest.
  /// @pre  an electrode, or it can tear or be cut
  void restore() noexcept { is_restore_due_ = true; }

  // --- the slow thread ---

  /// One full solution for where the tools are now. What the tools' steps may use of it is kept
  /// until publish().
  /// @param step_s   since the last one, in [least_step_s(), longest_step_s()]
  /// @param ahead_s  ≥ 0, until it is used: it is that of where tips that touch will be by then
  void solve(double step_s, double ahead_s = 0.0);
  /// solve() in two parts, between which the body is stepped with those that it touches.
  void begin_solve(double step_s, double ahead_s);
  void end_solve(double step_s, bool has_stepped);
  [[nodiscard]] ElasticSimulation& simulation() noexcept { return *simulation_; }
  [[nodiscard]] const std::vector<std::optional<TipState>>& tips() const noexcept { return tips_; }
  [[nodiscard]] elastic::SurfaceCompliance& compliance() const { return shared_->compliance(); }
  /// Where the body leans on others and is tied to them in this solution.
  void set_leaning(std::vector<elastic::Support> supports, std::vector<elastic::TiePoint> ties) {
    leaning_ = std::move(supports);
    ties_ = std::move(ties);
  }
  /// At the body's solve rate.
  [[nodiscard]] double longest_step_s() const noexcept { return 1.0 / body_->solve_rate_hz; }
  /// Where a tip moves fast.
  [[nodiscard]] double least_step_s() const noexcept {
    return longest_step_s() / kMostSolvesPerPeriod;
  }
  /// A tip near the surface has moved so far since the last solution, or did so a moment ago, that
  /// another one is due before the period is over.
  [[nodiscard]] bool is_fast() const;
  void publish();
  void note_late();
  /// The body as it is now, of what it is in the session. @pre  an electrode, or it can tear or
  /// be cut
  [[nodiscard]] const Ablation& ablation() const { return *ablation_; }

  // --- any thread ---

  /// As it is in the session.
  [[nodiscard]] const ElasticBody& body() const noexcept { return *whole_; }
  [[nodiscard]] const std::shared_ptr<const ElasticBody>& whole() const noexcept { return whole_; }
  [[nodiscard]] ElasticFigures figures() const noexcept { return figures_out_.load(); }

  /// Columns of the compliance, and those of them that were computed here. Only while nothing
  /// solves.
  struct Columns {
    std::size_t all = 0;
    std::size_t computed = 0;
  };
  [[nodiscard]] Columns columns() const noexcept;

  /// Replaces these by the newest places of the shown nodes and their strain, and asks for the
  /// next. @return  the body of which they are; null: there is none since the last call
  std::shared_ptr<const ElasticBody> take_surface(std::vector<float>& vertices_m,
                                                  std::vector<float>& strain);
  /// The same of the last full solution, on the slow thread.
  std::shared_ptr<const ElasticBody> read_surface(std::vector<float>& vertices_m,
                                                  std::vector<float>& strain) const;

  static constexpr int kMostSolvesPerPeriod = 4;

 private:
  struct Tip {
    double x_m = 0.0;
    double y_m = 0.0;
    double z_m = 0.0;
    double place_x_m = 0.0;  // of its proxy
    double place_y_m = 0.0;
    double place_z_m = 0.0;
    double normal_x = 0.0;  // of the surface there
    double normal_y = 0.0;
    double normal_z = 1.0;
    double distance_m = 0.0;         // of it, from the tip
    double friction_x_newton = 0.0;  // on the tool
    double friction_y_newton = 0.0;
    double friction_z_newton = 0.0;
    double x_m_per_s = 0.0;  // lately
    double y_m_per_s = 0.0;
    double z_m_per_s = 0.0;
    double time_s = 0.0;
    double energised_s = 0.0;  // near the body, so far
    bool is_known = false;
  };
  /// Where mofc_node will use the next solution.
  struct Ahead {
    double x_m_per_s = 0.0;
    double y_m_per_s = 0.0;
    double z_m_per_s = 0.0;
    double age_s = 0.0;
    bool is_wanted = false;
  };
  /// What a full solution leaves to the steps of a tool.
  struct Prepared {
    std::shared_ptr<BodyCompliance> of;  // which the contacts refer to
    std::optional<elastic::CondensedContact> contact;
    std::optional<elastic::CondensedContact> probe;  // at rest, as deep as the law must be known
    Vector3 centre_m = Vector3::Zero();              // of the sphere in the full solution
    Vector3 patch_m = Vector3::Zero();               // the points are the nearest to this place
    double time_s = 0.0;                             // of the tip there
    /// Unit; the sphere waits at centre_m and goes no further this way; zero: it does not wait.
    Vector3 waiting = Vector3::Zero();
    [[nodiscard]] Vector3 reachable_m(const Vector3& tip_m) const noexcept {
      return tip_m - std::max(0.0, waiting.dot(tip_m - centre_m)) * waiting;
    }
    Vector3 force_outside_patch_newton =
        Vector3::Zero();  // on the tool, from points that are not among these
    double surface_offset_by_other_tools_m =
        0.0;                     // of the surface by other tools, along its normal
    elastic::StatedError error;  // of the force, by the way from that centre
    Carried carried;             // the surface, since then
  };
  struct Tool {
    Snapshot<Tip> tip;
    Handover<Prepared> prepared;
    Snapshot<Ahead> ahead;
    Snapshot<JawCommand> jaw_command;
    Handover<GripModel> grip;
    Handover<ElasticPatch> patch;
    Handover<std::shared_ptr<const ElasticBody>> body;  // as it is now; none: the session's
    // of the steps
    const ElasticBody* surface_of = nullptr;  // the body whose surface is followed
    double energised_s = 0.0;
    const Prepared* stepped = nullptr;  // the last one,
    double stepped_s = 0.0;             // then
    Vector3 stepped_m = Vector3::Zero();
    Vector3 tip_m = Vector3::Zero();
    double time_s = 0.0;
    double step_s = 0.0;  // to the last time
    // the last places of the tip, a ring
    struct Passed {
      Vector3 tip_m = Vector3::Zero();
      double time_s = 0.0;
    };
    std::array<Passed, 64> passed{};
    std::size_t last_passed = 0;
    [[nodiscard]] Vector3 recent_velocity_m_per_s() const noexcept;
    double reach_m = 0.0;
    Vector3 carried_m = Vector3::Zero();  // of the surface, now
    TipSide side{};                       // of the tip less that
    double stiffness_newton_per_m = 0.0;
    Vector3 normal = Vector3::UnitZ();
    double bound_newton = kUnknownNewton;
    Rubbing rubbing{};
    SlippingJaw jaw{};
    bool is_jaw_led = false;         // by mofc_node
    bool is_felt_elsewhere = false;  // JawInput
    Vector3 jaw_m_per_s = Vector3::Zero();
    bool is_holding = false;
    Piercing piercing{};
    Vector3 inward = -Vector3::UnitZ();  // of the needle or blade
    Vector3 edge = Vector3::UnitZ();     // of the blade
    bool may_pierce = false;
    bool is_leaving = false;  // a blade that is through; its tip is still in the body
    std::uint32_t punctures = 0;
    // of the slow thread
    Jaw held{};
    BladeSweep sweep{};
    bool is_grip_new = false;                // a draft waits to be published
    Vector3 slow_normal = Vector3::UnitZ();  // of the untouched surface, on the tip's side
    Vector3 slow_tip_m = Vector3::Zero();
    double slow_time_s = 0.0;
    double ahead_s = 0.0;  // so much later than that is the last solution
    double slow_energised_s = 0.0;
    Vector3 velocity_m_per_s = Vector3::Zero();  // of the tip between the last two solutions
    elastic::VectorXd last_m;                    // the last solution
    elastic::VectorXd last_m_per_s;
    elastic::VectorXd last_creep_m;
    std::vector<std::pair<std::size_t, elastic::Vector3d>> last_forces_newton;  // on the points
    double last_newton = 0.0;
    bool is_prepared = false;                        // a draft waits to be published
    double slow_distance_m = 0.0;                    // from the tip to it
    Vector3 patch_tip_m = Vector3::Constant(1e9);    // of the last patch
    bool is_patched = false;                         // a draft waits to be published
    Carried carried;                                 // in the last one that was prepared
    Vector3 carried_since_last_m = Vector3::Zero();  // between that and the one before it
    std::optional<elastic::CondensedContact> last;
    Vector3 last_centre_m = Vector3::Zero();
    Vector3 last_force_outside_patch_newton = Vector3::Zero();
    elastic::StatedError error;
  };

  [[nodiscard]] bool is_among(const Prepared& prepared, const Vector3& tip_m,
                              const Vector3& normal) const noexcept;
  Vector3 press(Tool& own, Prepared& prepared) const noexcept;
  [[nodiscard]] bool is_close(const Tip& tip) const;
  [[nodiscard]] bool is_fast(const Tool& tool) const;
  [[nodiscard]] bool is_hasty(const Tool& tool) const;
  void add_equilibria(Tool& tool, const ElasticSimulation::Touch& touch,
                      elastic::CondensedContact& contact);
  void compare(elastic::StatedError& stated, double error_newton, double way_m);
  void measure(Tool& tool, const ElasticSimulation::Touch& touch, double step_s);
  void prepare(std::size_t tool, double step_s);
  [[nodiscard]] Carried carried_now(std::size_t tool, const elastic::CondensedContact& contact,
                                    const Carried& before) const;
  void lean_or_swing(elastic::CondensedContact& contact, const Vector3& centre_m) const;
  [[nodiscard]] bool can_be_pierced() const noexcept;
  [[nodiscard]] bool can_be_cut() const noexcept;
  [[nodiscard]] bool is_blade_through(const Tool& own, const GripModel& model) const noexcept;
  [[nodiscard]] bool is_leaving(Tool& own) const noexcept;
  [[nodiscard]] EdgeInTissue entering() const noexcept;
  void sweep_blades();
  void pierce(Tool& own, const Contact& contact) const noexcept;
  [[nodiscard]] bool stays_in(Tool& own, const GripModel& model) const noexcept;
  [[nodiscard]] std::optional<bool> hold(Tool& own, Contact& contact) const noexcept;
  [[nodiscard]] Vector3 pulled_by_others_newton(const GripModel& model) const noexcept;
  void close_jaws();
  void read_jaws(double step_s);
  void describe_patch(std::size_t tool, bool has_stepped);
  [[nodiscard]] bool is_alone(std::size_t tool) const;
  [[nodiscard]] double surface_offset_by_other_tools_m(std::size_t tool, std::size_t nearest_point,
                                                       const Vector3& normal);
  void show();
  void fold();
  void wear();
  void change_body(double step_s);
  void follow_body(Tool& own) noexcept;

  std::shared_ptr<const ElasticBody> whole_;
  // as it is now; slow thread
  std::shared_ptr<BodyCompliance> shared_;
  std::shared_ptr<const ElasticBody> body_;
  double tip_radius_m_;
  bool is_folded_;
  std::optional<GripperConfig> gripper_;
  std::unique_ptr<Ablation> ablation_;  // null: nothing changes the body
  std::atomic<bool> is_restore_due_ = false;
  bool is_body_new_ = false;  // not published yet
  std::unique_ptr<ElasticSimulation> simulation_;
  std::vector<std::unique_ptr<Tool>> tools_;
  std::vector<std::optional<PatchMaker>> makers_;  // of the tools
  std::vector<std::optional<TipState>> tips_;
  std::vector<elastic::Support> leaning_;
  std::vector<elastic::TiePoint> ties_;  // likewise
  std::atomic<double> noted_s_ = 0.0;    // by the tools' steps, last
  double solved_s_ = 0.0;                // of the last solution
  ElasticFigures figures_;
  std::uint64_t without_compliance_ = 0;  // contacts that could not be prepared
  int hasty_solves_ = 0;                  // that follow a fast motion, still to be made
  Snapshot<ElasticFigures> figures_out_;

  std::mutex shown_mutex_;
  bool is_wanted_ = false;
  bool is_new_ = false;
  bool has_moved_ = true;  // since it was last shown; slow thread
  std::vector<float> vertices_m_;
  std::vector<float> strain_;
  std::shared_ptr<const ElasticBody> shown_body_;
};

}  // namespace palpate::physics
