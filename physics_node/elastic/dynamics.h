// SPDX-License-Identifier: Apache-2.0
// dynamics.h — the motion of an elastic body over time, one implicit step after the other.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <thread>

#include "physics_node/elastic/equilibrium.h"
#include "physics_node/elastic/relaxation.h"

namespace palpate::elastic {

struct DynamicsSettings {
  /// In [½, 1]. Over a step dt the forces balance at t + θ dt (backward Euler over θ dt, the rest
  /// extrapolated). ½ keeps the energy of small oscillations, 1 damps strongly (backward Euler).
  double theta = 0.51;
  /// Of the remaining correction of any node in a step.
  double tolerance_m = 2e-6;
  /// Most iterations of a step that must be ready in time; what is left is reported.
  int most_iterations = 8;
  /// True: a step is iterated until it converges, and new factors are made within it:
  /// deterministic. False: factors are made on a thread of their own.
  bool is_exact = true;
  int most_exact_iterations = 300;  ///< of an exact step
  int most_factors = 300;           ///< made within an exact step
  double slow_ratio = 0.3;          ///< see SearchLimits
  int slow_iterations = 0;          ///< see SearchLimits
  /// An exact step of another length keeps the factor if it is at most so many times longer or
  /// shorter than that for which the factor was made; then slow_ratio tells whether it is good.
  double other_step_ratio = 1.0;
  /// Step control: a step is divided, at most into most_substeps, so that the estimated error of a
  /// part, h²|Δa|/12 (root mean square over the mass), stays below this. 0: steps are never
  /// divided.
  double accuracy_m = 0.0;
  int most_substeps = 8;
  /// A step goes on while Obstacle::begin_round() says so, at most so many rounds.
  int most_rounds = 1;
  bool is_folded = false;  ///< fold() will be called
};

struct StepReport {
  SearchReport search;
  bool is_damped = false;  ///< the step gained energy and was made again with θ = 1
  int substeps = 1;
  bool is_factor_due = false;  ///< the factor is no longer good: a new one has been asked for
  double kinetic_joule = 0.0;
  double elastic_joule = 0.0;
  double gravity_joule = 0.0;  ///< −gravity·x
  [[nodiscard]] double energy_joule() const noexcept {
    return kinetic_joule + elastic_joule + gravity_joule;
  }
};

/// Counts since construction.
struct DynamicsCounters {
  std::uint64_t steps = 0;
  std::uint64_t skipped = 0;  ///< steps of a body at rest that nothing touches
  std::uint64_t iterations = 0;
  std::uint64_t unconverged = 0;
  std::uint64_t damped = 0;
  /// Times that a body came to rest where it has more energy than undeformed: folded or inside out,
  /// because it was started so. It begins again from its undeformed shape.
  std::uint64_t untangled = 0;
  std::uint64_t factorisations = 0;
};

/// Unconditionally stable: every step ends at a lower value of its function than where its search
/// began, and without obstacle and branches no step ends with more energy than it began with
/// (branches give back what they hold). One thread calls it. step() allocates only where it
/// factorises on its own (is_exact).
class Dynamics {
 public:
  Dynamics(const Body& body, const DynamicsSettings& settings);
  ~Dynamics();
  Dynamics(const Dynamics&) = delete;
  Dynamics& operator=(const Dynamics&) = delete;

  /// Continues as the other would, to the bit. @pre  both of the same body, with is_exact
  void continue_as(const Dynamics& other);

  /// Frees what only a step needs, and a factor that nobody shares: the next step makes it again,
  /// to the bit. @pre  is_folded, is_exact
  void fold();

  /// @param dt_s > 0   @param obstacle  may be null
  StepReport step(double dt_s, Obstacle* obstacle = nullptr);

  /// The last step once more, under another obstacle: from where it began, searched from where it
  /// ended. @pre  is_exact, the last step was of this length, not divided and not skipped, and
  /// nothing else was called since
  StepReport step_again(double dt_s, Obstacle* obstacle);

  /// A body that sleeps makes the next step; it sleeps again at once if nothing moves it.
  void wake() noexcept { is_asleep_ = false; }

  [[nodiscard]] const VectorXd& x_m() const noexcept { return x_; }
  [[nodiscard]] const VectorXd& v_m_per_s() const noexcept { return v_; }
  /// In the last step; zero after set_state().
  [[nodiscard]] const VectorXd& acceleration_m_per_s2() const noexcept { return acceleration_; }
  /// A new state; fixed nodes stay where the positions say.
  /// What had not relaxed stays as it is.
  void set_state(const VectorXd& x_m, const VectorXd& v_m_per_s);
  /// What the branches remember; with a state from earlier, that of then belongs to it.
  [[nodiscard]] const Relaxation& relaxation() const noexcept { return relaxation_; }
  void set_relaxation(const Relaxation& relaxation) { relaxation_ = relaxation; }
  [[nodiscard]] bool is_asleep() const noexcept { return is_asleep_; }
  [[nodiscard]] const DynamicsCounters& counters() const noexcept { return counters_; }
  [[nodiscard]] const Body& body() const noexcept { return body_; }
  [[nodiscard]] EquilibriumSearch& search() noexcept { return search_; }

 private:
  void read_springs();
  StepReport single_step(double dt_s, Obstacle* obstacle);
  void choose_substeps(double h_s);
  SearchReport balance(double h_s, Obstacle* obstacle);
  [[nodiscard]] bool make_factor(const VectorXd& x_m, const Body::Shift& shift,
                                 const Obstacle* obstacle);
  void ask_for_factor(const Body::Shift& shift, const Obstacle* obstacle);
  void take_factor();
  void work(const std::stop_token& stop);
  [[nodiscard]] double kinetic_joule(const VectorXd& v_m_per_s) const;
  [[nodiscard]] bool reset_if_inverted_at_rest(double energy_joule);
  void watch_for_rest(const StepReport& report, double dt_s, bool is_held_off);

  const Body& body_;
  DynamicsSettings settings_;
  EquilibriumSearch search_;
  std::unique_ptr<WarpedFactor> factor_;
  VectorXd x_;
  VectorXd v_;
  VectorXd acceleration_;
  VectorXd start_;     // positions at the start of the step
  VectorXd inertial_;  // where inertia alone would lead
  VectorXd found_;     // positions where the forces balance
  VectorXd next_;
  Relaxation relaxation_;
  // at the start of the step, for step_again(); its velocity is in inertial_
  Relaxation start_relaxation_;
  int start_quiet_steps_ = 0;
  VectorXd spring_newton_;  // of the springs alone where the body is, as a gradient
  VectorXd spring_change_newton_;
  bool is_spring_known_ = false;
  double energy_joule_ = 0.0;
  bool is_energy_known_ = false;
  bool is_asleep_ = false;
  int quiet_steps_ = 0;
  VectorXd quiet_m_;  // where those began, of a body that lies on something
  int substeps_ = 1;
  int coarse_steps_ = 0;  // in which half as many would have done
  double acceleration_change_m_per_s2_ = 0.0;
  DynamicsCounters counters_;

  // The factor that is being made.
  struct Order {
    VectorXd x_m;
    std::vector<double> rotations;
    Body::Shift shift;
    const Obstacle* obstacle = nullptr;
  };
  enum class Stage : std::uint8_t { kIdle, kOrdered, kMade, kFailed };
  std::mutex mutex_;
  std::condition_variable_any ordered_;
  Stage stage_ = Stage::kIdle;
  Order order_;
  std::unique_ptr<WarpedFactor> next_factor_;
  std::jthread worker_;
};

}  // namespace palpate::elastic
