// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/dynamics.h"

#include <algorithm>
#include <cmath>
#include <functional>

namespace palpate::elastic {
namespace {

// A body sleeps after this many steps in which no node moved faster than the limit below and
// nothing touched it.
constexpr int kQuietSteps = 50;
constexpr double kQuiet_m_per_s = 1e-6;
// Or, where it lies on something, in which no node has moved farther than this altogether.
constexpr double kQuiet_m = 1e-5;
// A body that rests this near to its undeformed shape is not tangled.
constexpr double kTangled_m = 1e-3;
// A part of a step becomes longer when it could have been twice as long for so many parts.
constexpr int kCoarseSteps = 100;
// A body whose branches hold less than this has relaxed.
constexpr double kRelaxed_m = 1e-6;
// Energy that rounding and the tolerance of the search may add in a step, relative.
constexpr double kEnergyRounding = 1e-12;

bool is_same(const Body::Shift& a, const Body::Shift& b) {
  return std::abs(a.per_mass - b.per_mass) <= 1e-9 * std::abs(b.per_mass);
}

bool is_similar(const Body::Shift& a, const Body::Shift& b, double step_ratio) {
  const double ratio2 = step_ratio * step_ratio * (1.0 + 1e-9);
  return a.per_mass <= ratio2 * b.per_mass && b.per_mass <= ratio2 * a.per_mass;
}

}  // namespace

Dynamics::Dynamics(const Body& body, const DynamicsSettings& settings)
    : body_(body),
      settings_(settings),
      search_(body),
      factor_(std::make_unique<WarpedFactor>(body, Precision::kFloat, settings.is_folded)),
      x_(body.rest_m()),
      relaxation_(body.description().branches, body.rest_m().size()),
      start_relaxation_(relaxation_) {
  if (relaxation_.is_there()) spring_newton_ = spring_change_newton_ = VectorXd::Zero(x_.size());
  v_ = VectorXd::Zero(x_.size());
  acceleration_ = v_;
  start_ = inertial_ = found_ = next_ = x_;
  if (!settings_.is_exact) {
    next_factor_ = std::make_unique<WarpedFactor>(body, Precision::kFloat);
    order_.x_m = x_;
    order_.rotations = search_.rotations();
    worker_ = std::jthread([this](const std::stop_token& stop) { work(stop); });
  }
}

Dynamics::~Dynamics() {
  if (worker_.joinable()) {
    worker_.request_stop();
    ordered_.notify_all();
  }
}

void Dynamics::set_state(const VectorXd& x_m, const VectorXd& v_m_per_s) {
  x_ = x_m;
  v_ = v_m_per_s;
  for (const std::uint32_t node : body_.description().fixed_nodes) {
    v_.segment<3>(3 * Eigen::Index{node}).setZero();
  }
  acceleration_.setZero();
  is_energy_known_ = false;
  is_spring_known_ = false;
  is_asleep_ = false;
  quiet_steps_ = 0;
}

void Dynamics::fold() {
  start_ = inertial_ = found_ = next_ = {};
  search_.fold();
  factor_->fold();
}

void Dynamics::continue_as(const Dynamics& other) {
  search_.continue_as(other.search_);
  factor_->continue_as(*other.factor_);
  x_ = other.x_;
  v_ = other.v_;
  acceleration_ = other.acceleration_;
  relaxation_ = other.relaxation_;
  spring_newton_ = other.spring_newton_;
  is_spring_known_ = other.is_spring_known_;
  energy_joule_ = other.energy_joule_;
  is_energy_known_ = other.is_energy_known_;
  is_asleep_ = other.is_asleep_;
  quiet_steps_ = other.quiet_steps_;
  quiet_m_ = other.quiet_m_;
  substeps_ = other.substeps_;
  coarse_steps_ = other.coarse_steps_;
  acceleration_change_m_per_s2_ = other.acceleration_change_m_per_s2_;
  counters_ = other.counters_;
}

double Dynamics::kinetic_joule(const VectorXd& v_m_per_s) const {
  double sum = 0.0;
  const VectorXd& mass = body_.mass_kg();
  for (Eigen::Index i = 0; i < mass.size(); ++i) {
    sum += mass[i] * v_m_per_s.segment<3>(3 * i).squaredNorm();
  }
  return 0.5 * sum;
}

bool Dynamics::make_factor(const VectorXd& x_m, const Body::Shift& shift,
                           const Obstacle* obstacle) {
  ++counters_.factorisations;
  return factor_->factor(x_m, search_.rotations(), shift, obstacle);
}

void Dynamics::work(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (ordered_.wait(lock, stop, [this] { return stage_ == Stage::kOrdered; })) {
    lock.unlock();
    const bool is_made =
        next_factor_->factor(order_.x_m, order_.rotations, order_.shift, order_.obstacle);
    lock.lock();
    stage_ = is_made ? Stage::kMade : Stage::kFailed;
  }
}

void Dynamics::ask_for_factor(const Body::Shift& shift, const Obstacle* obstacle) {
  std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock || stage_ == Stage::kOrdered || stage_ == Stage::kMade) return;
  order_.x_m = x_;
  order_.rotations = search_.rotations();
  order_.shift = shift;
  order_.obstacle = obstacle;
  stage_ = Stage::kOrdered;
  lock.unlock();
  ordered_.notify_one();
}

void Dynamics::take_factor() {
  std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock) return;
  if (stage_ == Stage::kMade) {
    std::swap(factor_, next_factor_);
    ++counters_.factorisations;
    stage_ = Stage::kIdle;
  } else if (stage_ == Stage::kFailed) {
    stage_ = Stage::kIdle;
  }
}

// From start_ and v_ to found_, where the forces balance after h.
SearchReport Dynamics::balance(double h_s, Obstacle* obstacle) {
  inertial_ = start_ + h_s * v_;
  found_ = inertial_ + (h_s * h_s) * acceleration_;
  relaxation_.begin(h_s, spring_newton_);
  const bool has_branches = relaxation_.is_there();
  const Goal goal{.step_s = h_s,
                  .inertial_m = inertial_.data(),
                  .before_m = start_.data(),
                  .obstacle = obstacle,
                  .stiffening = relaxation_.stiffening(),
                  .pull_newton = has_branches ? &relaxation_.pull_newton() : nullptr};
  const bool is_other_step =
      !is_similar(goal.shift(), factor_->shift(), settings_.other_step_ratio);
  if (!factor_->is_ready() || (is_other_step && settings_.is_exact)) {
    search_.update_rotations(start_);
    static_cast<void>(make_factor(start_, goal.shift(), obstacle));
  } else if (settings_.is_folded) {
    factor_->unfold();
  }
  factor_->turn_to(search_.rotations());
  SearchLimits limits{.tolerance_m = settings_.tolerance_m,
                      .most_iterations = settings_.is_exact ? settings_.most_exact_iterations
                                                            : settings_.most_iterations,
                      .slow_ratio = settings_.slow_ratio,
                      .slow_iterations = settings_.slow_iterations};
  int factors = 0;
  const auto refactor = [&](const VectorXd& at_m) {
    if (!settings_.is_exact || ++factors > settings_.most_factors) return false;
    search_.update_rotations(at_m);
    return make_factor(at_m, goal.shift(), obstacle);
  };
  // by reference: a copy of what it captures would be allocated
  SearchReport report = search_.search(goal, limits, *factor_, found_, std::ref(refactor));
  for (int round = 1; round < settings_.most_rounds && obstacle != nullptr && report.is_converged &&
                      obstacle->begin_round(found_.data(), body_.pattern());
       ++round) {
    factors = 0;
    const int iterations = report.iterations;
    report = search_.search(goal, limits, *factor_, found_, std::ref(refactor));
    report.iterations += iterations;
  }
  return report;
}

StepReport Dynamics::step(double dt_s, Obstacle* obstacle) {
  ++counters_.steps;
  StepReport report;
  if (is_asleep_ && (obstacle == nullptr || obstacle->is_still())) {
    ++counters_.skipped;
    report.search.is_converged = true;
    report.elastic_joule = energy_joule_;
    return report;
  }
  is_asleep_ = false;
  if (!settings_.is_exact) take_factor();
  const int parts = substeps_;
  const double h = dt_s / parts;
  for (int part = 0; part < parts; ++part) {
    report = single_step(h, obstacle);
    report.substeps = parts;
    choose_substeps(h);
  }
  return report;
}

// What inertia alone does not explain is the acceleration that was found, so that the search begins
// where the last one ended.
StepReport Dynamics::step_again(double dt_s, Obstacle* obstacle) {
  x_ = start_;
  v_ = inertial_;
  if (relaxation_.is_there()) {
    relaxation_ = start_relaxation_;
    is_spring_known_ = false;
  }
  quiet_steps_ = start_quiet_steps_;
  is_asleep_ = false;
  is_energy_known_ = false;
  return single_step(dt_s, obstacle);
}

void Dynamics::choose_substeps(double h_s) {
  if (!(settings_.accuracy_m > 0.0)) return;
  const double error = h_s * h_s * acceleration_change_m_per_s2_ / 12.0;
  // the error of a part goes with the third power of its length
  const double wanted = substeps_ * std::cbrt(error / settings_.accuracy_m);
  coarse_steps_ = wanted < 0.5 * substeps_ ? coarse_steps_ + 1 : 0;
  // another length needs another factor: not for a passing reason
  if (wanted > 1.1 * substeps_) {
    substeps_ = static_cast<int>(std::min<double>(std::ceil(wanted), settings_.most_substeps));
  } else if (coarse_steps_ > kCoarseSteps) {
    substeps_ = std::max(1, substeps_ / 2);
    coarse_steps_ = 0;
  }
}

StepReport Dynamics::single_step(double dt_s, Obstacle* obstacle) {
  StepReport report;
  if (settings_.is_folded) search_.unfold();
  if (!is_energy_known_) {
    const Goal here{};
    energy_joule_ = search_.evaluate(here, x_) + kinetic_joule(v_);
    search_.update_rotations(x_);
    is_energy_known_ = true;
  }
  start_ = x_;
  start_quiet_steps_ = quiet_steps_;
  if (relaxation_.is_there()) start_relaxation_ = relaxation_;
  if (!is_spring_known_) read_springs();
  remember(search_.batches(), x_.data());

  double theta = obstacle == nullptr ? settings_.theta : 1.0;
  while (true) {
    const double h = theta * dt_s;
    report.search = balance(h, obstacle);
    counters_.iterations += static_cast<std::uint64_t>(report.search.iterations);
    // x and v where the forces balance, and on to the end of the step
    next_ = start_ + (found_ - start_) / theta;
    const double per_h2 = 1.0 / (h * h);
    double change = 0.0;
    for (Eigen::Index i = 0; settings_.accuracy_m > 0.0 && i < body_.mass_kg().size(); ++i) {
      const Vector3d now = per_h2 * (found_.segment<3>(3 * i) - inertial_.segment<3>(3 * i));
      change += body_.mass_kg()[i] * (now - acceleration_.segment<3>(3 * i)).squaredNorm();
    }
    acceleration_change_m_per_s2_ = std::sqrt(change / body_.mass_kg().sum());
    acceleration_ = per_h2 * (found_ - inertial_);
    inertial_ = v_ + dt_s * acceleration_;  // the velocity at the end
    const Goal here{};
    report.kinetic_joule = kinetic_joule(inertial_);
    report.gravity_joule = body_.load_newton().size() > 0 ? -body_.load_newton().dot(next_) : 0.0;
    if (theta < 1.0 || body_.is_viscous()) {
      search_.evaluate(here, next_);
      report.elastic_joule = search_.elastic_joule();
    } else {
      report.elastic_joule = report.search.elastic_joule;
    }
    if (obstacle != nullptr || relaxation_.is_there()) break;  // they may do work
    const double gain = report.energy_joule() - energy_joule_;
    const double scale =
        report.kinetic_joule + report.elastic_joule + std::abs(report.gravity_joule);
    if (gain <= kEnergyRounding * scale) break;
    // What is too much is taken from the motion; if that is not enough the step is made again. With
    // θ = 1 it is always enough: V(x₁) is at most the energy before.
    if (theta == 1.0 || gain < 0.05 * report.kinetic_joule) {
      const double left = std::max(0.0, report.kinetic_joule - gain);
      inertial_ *= report.kinetic_joule > 0.0 ? std::sqrt(left / report.kinetic_joule) : 0.0;
      report.kinetic_joule = left;
      break;
    }
    report.is_damped = true;
    ++counters_.damped;
    theta = 1.0;
  }
  if (!report.search.is_finite) {
    // nothing that is not a number enters the state
    next_ = start_;
    inertial_.setZero();
    acceleration_.setZero();
  }
  std::swap(x_, next_);
  std::swap(v_, inertial_);
  energy_joule_ = report.energy_joule();
  counters_.unconverged += report.search.is_converged ? 0 : 1;

  if (relaxation_.is_there()) {
    spring_change_newton_ = -spring_newton_;
    read_springs();
    spring_change_newton_ += spring_newton_;
    next_ = x_ - start_;
    relaxation_.end(dt_s, spring_change_newton_, next_);
  }
  search_.update_rotations(x_);
  if (!settings_.is_exact) {
    const Goal goal{.step_s = theta * dt_s};
    report.is_factor_due =
        report.search.is_factor_stale || !is_same(goal.shift(), factor_->shift());
    if (report.is_factor_due) ask_for_factor(goal.shift(), nullptr);
  }
  if (obstacle == nullptr || obstacle->is_still()) {
    watch_for_rest(report, dt_s, obstacle != nullptr);
  } else {
    quiet_steps_ = 0;
  }
  if (obstacle != nullptr) is_energy_known_ = false;
  return report;
}

void Dynamics::read_springs() {
  is_spring_known_ = true;
  if (!relaxation_.is_there()) return;
  spring_newton_.setZero();
  add_gradient(search_.batches(), x_.data(), 0.0, spring_newton_.data());
  body_.add_attachments(x_.data(), nullptr, 0.0, spring_newton_.data());
}

bool Dynamics::reset_if_inverted_at_rest(double energy_joule) {
  next_ = body_.rest_m();
  for (const std::uint32_t node : body_.description().fixed_nodes) {
    next_.segment<3>(3 * Eigen::Index{node}) = x_.segment<3>(3 * Eigen::Index{node});
  }
  if ((x_ - next_).cwiseAbs().maxCoeff() < kTangled_m) return false;
  const Goal here{};
  if (!(search_.evaluate(here, next_) < energy_joule)) return false;
  const VectorXd& rest = next_;
  set_state(rest, VectorXd::Zero(rest.size()));
  search_.rotations() = no_rotations(body_.node_count());
  ++counters_.untangled;
  return true;
}

void Dynamics::watch_for_rest(const StepReport& report, double dt_s, bool is_held_off) {
  const double fastest = v_.cwiseAbs().maxCoeff();
  bool is_quiet = report.search.is_converged && fastest < kQuiet_m_per_s &&
                  dt_s * acceleration_.cwiseAbs().maxCoeff() < kQuiet_m_per_s;
  if (is_held_off) {
    // nodes that hardly press come and go by the tolerance of the search
    is_quiet = report.search.is_converged && quiet_m_.size() == x_.size() &&
               (x_ - quiet_m_).cwiseAbs().maxCoeff() < kQuiet_m;
    if (!is_quiet) quiet_m_ = x_;
  }
  quiet_steps_ = is_quiet ? quiet_steps_ + 1 : 0;
  if (quiet_steps_ < kQuietSteps) return;
  if (relaxation_.is_there()) {
    if (relaxation_.creep_m().cwiseAbs().maxCoeff() > kRelaxed_m) return;
    relaxation_.forget();
  }
  if (!is_held_off && reset_if_inverted_at_rest(report.energy_joule())) return;
  is_asleep_ = true;
  v_.setZero();
  acceleration_.setZero();
  is_energy_known_ = false;
}

}  // namespace palpate::elastic
