// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/tissue/elastic_patches.h"

#include <algorithm>
#include <cmath>

#include "common/contact/contact_model.h"
#include "common/contact/elastic/sphere_sweep.h"
#include "mofc_node/tissue/receipts.h"

namespace palpate::mofc {
namespace {

constexpr std::size_t kStride = 3 * kElasticSlots;
static_assert(kStride % kCompliancePadding == 0);
constexpr double kSweepTolerance_m = 1e-7;
constexpr double kStepShare = 0.25;       // of the tip's radius
constexpr double kLongestPeriod_s = 0.1;  // of full solutions, if one is late
// In the units of LocalTissues::work_in(), by descriptions_bench: to begin a model or a sweep of a
// sphere, for each time that it goes round the points, and for each force that changes.
constexpr std::uint32_t kWorkPerStep = 2000;
constexpr std::uint32_t kWorkPerSweep = 300;
constexpr std::uint32_t kWorkPerChange = 60;
// Where a point is that is not there.
constexpr double kNowhere_m = 1e9;

Vector3 times(double step, const std::array<std::int16_t, 3>& values) noexcept {
  return step / kElasticScale * Vector3(values[0], values[1], values[2]);
}

Vector3 away_of(const ElasticState& state, const std::array<std::int16_t, 3>& away) noexcept {
  return state.from_m + times(static_cast<double>(state.away_step_m), away);
}

}  // namespace

/// A state of the body, and the contact that continues from it.
struct ElasticPatches::Model {
  bool is_there = false;
  bool is_walking = false;   // from where the tip was in the state to where it is
  double left_s = 0.0;       // of the time that the tip took for that
  bool is_complete = false;  // every point that carries a force in the state has arrived
  ElasticState state;        // its places only for versions
  std::array<Vector3, kElasticSlots> missing_m;  // listed points that have not arrived
  std::size_t missing_count = 0;
  double sum_newton = 0.0;  // of the forces' sizes in the state
  std::array<bool, kElasticSlots> is_present{};
  std::array<Vector3, kElasticSlots> rest_m;
  std::array<Vector3, kElasticSlots> solved_m;  // where the forces of the state want the points
  std::array<Vector3, kElasticSlots> solved_newton;
  std::array<Vector3, kElasticSlots> axes;      // their directions @see SphereSweep
  std::array<Vector3, kElasticSlots> placed_m;  // where they are in the state
  std::array<Vector3, kElasticSlots> base_m;
  std::array<Vector3, kElasticSlots> still_m;     // see SphereSweep
  std::array<Vector3, kElasticSlots> reached_m;   // of a viscous body, in the last sweep,
  std::array<bool, kElasticSlots> has_reached{};  // if it is known
  std::array<Vector3, kElasticSlots> normals;
  std::array<Vector3, kElasticSlots> forces_newton;
  std::array<double, kElasticSlots> rigid_give;
  std::array<char, kElasticSlots> is_held;
  alignas(64) std::array<float, kStride> moved_m{};
  Vector3 at_m = Vector3::Zero();  // the tip in the last sweep
  Vector3 force_on_tool_newton = Vector3::Zero();
  double stored_energy_joule = 0.0;
  bool is_touching = false;

  /// The tip, there, touches no point that has not arrived.
  [[nodiscard]] bool covers(const Vector3& tip_m) const noexcept {
    const Vector3& n = state.normal;
    const double above_m = n.dot(tip_m - state.from_m);
    const Vector3 to_m = state.to_m - n * n.dot(state.to_m - state.from_m);
    const double away_m = elastic_distance_m(n, state.from_m, to_m, tip_m - above_m * n);
    if (away_m + state.tip_radius_m > state.radius_m) return false;
    if (std::abs(above_m) > 2.0 * state.radius_m) return false;
    return std::none_of(missing_m.begin(),
                        missing_m.begin() + static_cast<std::ptrdiff_t>(missing_count),
                        [&](const auto& m) {
                          const Vector3 there = m - tip_m;
                          return (there - n * n.dot(there)).norm() < state.tip_radius_m;
                        });
  }
  /// By the compliance, in the last sweep.
  [[nodiscard]] Vector3 moved_of(std::size_t slot) const noexcept {
    return Eigen::Map<const Eigen::Vector3f>(moved_m.data() + 3 * slot).cast<double>();
  }
  void clear_forces() noexcept {
    forces_newton.fill(Vector3::Zero());
    moved_m.fill(0.0F);
    force_on_tool_newton.setZero();
    stored_energy_joule = 0.0;
    is_touching = false;
  }
};

class ElasticPatches::Patch {
 public:
  Patch() : compliance_(kStride * kStride, 0.0F), models_(2) {}

  void empty() noexcept {
    for (Held& held : held_) held.version = 0;
    newest_number_ = 0;
    reset();
  }
  void reset() noexcept {
    for (Model& model : models_) model.is_there = false;
    is_crossing_ = false;
    has_tip_ = false;
    // the last state counts again
    has_state_ = newest_number_ > 0 && state_.radius_m > 0.0;
  }
  void take(const ElasticPoint& point) noexcept;
  void take(const ElasticState& state, double age_s) noexcept {
    if (state.number <= newest_number_) return;
    // physics_node sends it when the body is solved, by then the next solution is due
    state_age_s_ = age_s + (newest_number_ > 0 ? std::min(since_state_s_, kLongestPeriod_s) : 0.0);
    since_state_s_ = 0.0;
    newest_number_ = state.number;
    state_ = state;
    has_state_ = true;
    if (!(state.radius_m > 0.0)) reset();
  }
  /// @param budget  reduced by what this needs
  Result step(const Interaction& newest, const Vector3& tip_m, double dt_s, double scene_s,
              double most_newton, Budget& budget) noexcept;

 private:
  struct Held {
    std::uint32_t version = 0;  // 0: none
    Vector3 rest_m = Vector3::Zero();
    double rigid_give = 0.0;
    bool is_held = false;
  };

  [[nodiscard]] Model& current() noexcept { return models_[current_]; }
  [[nodiscard]] Model& next() noexcept { return models_[1 - current_]; }
  void set_block(std::size_t row, std::size_t column, const Matrix3& block) noexcept {
    for (std::size_t k = 0; k < 3; ++k) {
      float* to = compliance_.data() + (3 * column + k) * kStride + 3 * row;
      for (std::size_t i = 0; i < 3; ++i) {
        to[i] =
            static_cast<float>(block(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)));
      }
    }
  }
  void begin(Model& model) noexcept;
  void reach(Model& model) noexcept;
  void arrive(Model& model) noexcept;
  void sweep_to(const Vector3& tip_m, double step_s, Budget& budget, Model& model) noexcept;
  void walk_to(const Vector3& tip_m, double dt_s, int& left, Budget& budget, Model& model) noexcept;
  void rub(const Interaction& newest, const Vector3& tip_m, const ElasticState& state,
           ModelForce& force) noexcept;

  std::array<Held, kElasticSlots> held_{};
  std::vector<float> compliance_;
  bool has_state_ = false;  // that no model has yet
  std::uint32_t newest_number_ = 0;
  ElasticState state_;
  double state_age_s_ = 0.0;
  double since_state_s_ = 0.0;  // the newest one has arrived
  std::vector<Model> models_;
  std::size_t current_ = 0;
  bool is_crossing_ = false;  // to the next one,
  double share_ = 0.0;        // which has so much of the force
  // friction
  bool has_tip_ = false;
  Vector3 tip_m_ = Vector3::Zero();
  Vector3 surface_m_ = Vector3::Zero();  // has been carried
  Vector3 stretch_m_ = Vector3::Zero();
};

void ElasticPatches::Patch::take(const ElasticPoint& point) noexcept {
  Held& held = held_[point.slot];
  if (point.version <= held.version) return;  // a repetition, or overtaken
  held = {.version = point.version,
          .rest_m = point.rest_m,
          .rigid_give = static_cast<double>(point.rigid_give_m_per_newton),
          .is_held = point.is_held};
  const double step = static_cast<double>(point.step_m_per_newton) / kElasticScale;
  const auto& [xx, xy, xz, yy, yz, zz] = point.own;
  Matrix3 own;
  own << xx, xy, xz, xy, yy, yz, xz, yz, zz;
  set_block(point.slot, point.slot, step * own);
  for (std::size_t other = 0; other < kElasticSlots; ++other) {
    // a newer point brought what is between it and this one
    if (other == point.slot || held_[other].version > point.version) continue;
    Matrix3 block = Matrix3::Zero();
    if (point.has_other[other]) {
      for (std::size_t i = 0; i < 9; ++i) {
        block(static_cast<Eigen::Index>(i / 3), static_cast<Eigen::Index>(i % 3)) =
            step * point.others[other][i];
      }
    }
    set_block(other, point.slot, block);
    set_block(point.slot, other, block.transpose());
  }
  for (Model& model : models_) {
    if (model.is_there) arrive(model);
  }
}

/// A model of the newest state.
void ElasticPatches::Patch::begin(Model& model) noexcept {
  model.is_there = true;
  model.state = state_;
  model.sum_newton = 0.0;
  model.is_present.fill(false);
  model.rest_m.fill(Vector3::Constant(kNowhere_m));
  model.solved_m = model.base_m = model.reached_m = model.rest_m;
  model.placed_m = model.still_m = model.rest_m;
  model.has_reached.fill(false);
  model.solved_newton.fill(Vector3::Zero());
  model.axes.fill(Vector3::Zero());
  model.rigid_give.fill(1.0);
  model.is_held.fill(0);
  model.clear_forces();
  for (std::size_t slot = 0; slot < kElasticSlots; ++slot) {
    const ElasticPlace& place = state_.places[slot];
    if (place.version == 0) continue;
    model.solved_newton[slot] = times(static_cast<double>(state_.force_step_newton), place.force);
    model.axes[slot] = model.solved_newton[slot].stableNormalized();
    model.sum_newton += model.solved_newton[slot].norm();
  }
  arrive(model);
  model.is_walking = true;
  model.left_s = state_age_s_;
  model.at_m = state_.center_m;
  for (std::size_t slot = 0; slot < kElasticSlots; ++slot) {
    if (!model.is_present[slot]) continue;
    model.reached_m[slot] = away_of(state_, state_.places[slot].away);
    model.has_reached[slot] = true;
  }
}

/// Points have arrived, or have been replaced.
void ElasticPatches::Patch::arrive(Model& model) noexcept {
  const ElasticState& state = model.state;
  model.missing_count = 0;
  model.is_complete = true;
  for (std::size_t slot = 0; slot < kElasticSlots; ++slot) {
    const ElasticPlace& place = state.places[slot];
    if (place.version == 0) continue;
    const Held& held = held_[slot];
    const bool is_present = held.version == place.version;
    if (is_present && !model.is_present[slot]) {
      model.rest_m[slot] = held.rest_m;
      model.rigid_give[slot] = held.rigid_give;
      model.is_held[slot] = held.is_held ? 1 : 0;
      model.solved_m[slot] = model.base_m[slot] =
          away_of(state, state.relaxation_s > 0.0 ? place.rest : place.away);
      model.placed_m[slot] = model.still_m[slot] = away_of(state, place.away);
      model.has_reached[slot] = false;
      model.forces_newton[slot] = model.solved_newton[slot];
    }
    if (!is_present) {
      if (model.is_present[slot]) {
        model.rest_m[slot] = model.solved_m[slot] = Vector3::Constant(kNowhere_m);
        model.base_m[slot] = model.reached_m[slot] = model.rest_m[slot];
        model.forces_newton[slot].setZero();
      }
      model.is_complete = model.is_complete && !place.is_pressed();
      model.missing_m[model.missing_count++] = away_of(state, place.away);
    }
    model.is_present[slot] = is_present;
  }
}

/// A point of which it is not known where it is has had time to follow its forces.
void ElasticPatches::Patch::reach(Model& model) noexcept {
  for (std::size_t i = 0; i < kElasticSlots; ++i) {
    if (!model.is_present[i] || model.has_reached[i]) continue;
    model.has_reached[i] = true;
    model.reached_m[i] = model.base_m[i] + model.moved_of(i);
  }
}

/// @param step_s  since the last sweep; 0: the body comes to rest
void ElasticPatches::Patch::sweep_to(const Vector3& tip_m, double step_s, Budget& budget,
                                     Model& model) noexcept {
  SphereSweep sphere{
      .count = kElasticSlots,
      .compliance_m_per_newton = compliance_.data(),
      .stride = kStride,
      .compliance_ratio = model.state.compliance_ratio,
      .base_m = model.base_m.data(),
      .rigid_give_m_per_newton = model.rigid_give.data(),
      .is_held = model.is_held.data(),
      .normals = model.normals.data(),
      .forces_newton = model.forces_newton.data(),
      .moved_m = model.moved_m.data(),
      .center_m = tip_m,
      .radius_m = model.state.tip_radius_m,
      .still_m = model.still_m.data(),
      .along = model.state.normal,
      .axes = model.axes.data(),
      .reached_m = model.reached_m.data(),
      .pace = pace_of(model.state.compliance_ratio * model.state.relaxation_s, step_s)};
  // from between the untouched body and the state, where the forces are nearest
  double sum_newton = 0.0;
  for (const Vector3& force : model.forces_newton) sum_newton += force.norm();
  const bool is_between = model.state.has_rest && model.sum_newton > 0.0;
  const double share = is_between ? std::min(1.0, sum_newton / model.sum_newton) : 1.0;
  model.moved_m.fill(0.0F);
  std::uint32_t changes = 0;
  for (std::size_t i = 0; i < kElasticSlots; ++i) {
    if (!model.is_present[i]) continue;
    model.base_m[i] = (1.0 - share) * model.rest_m[i] + share * model.solved_m[i];
    model.still_m[i] = (1.0 - share) * model.rest_m[i] + share * model.placed_m[i];
    const Vector3 change = model.forces_newton[i] - share * model.solved_newton[i];
    if (change.isZero(0.0)) continue;
    add_columns(sphere, i, change, model.moved_m.data());
    ++changes;
  }
  const bool is_viscous = model.state.relaxation_s > 0.0;
  if (is_viscous) reach(model);
  const auto most = [&](int usual, std::uint32_t cost) {
    return static_cast<int>(
        std::min<std::uint32_t>(static_cast<std::uint32_t>(usual), budget.left / cost + 1));
  };
  const SweepEffort effort = sweep(sphere, most(kMostSweeps, kWorkPerSweep),
                                   most(kMostChanges, kWorkPerChange), kSweepTolerance_m);
  budget.take(kWorkPerStep + kWorkPerSweep * static_cast<std::uint32_t>(effort.sweeps) +
              kWorkPerChange * (changes + static_cast<std::uint32_t>(effort.changes)));
  model.at_m = tip_m;

  Vector3 sum = Vector3::Zero();
  double work_joule = 0.0;
  model.is_touching = false;
  for (std::size_t i = 0; i < kElasticSlots; ++i) {
    const Vector3& force = model.forces_newton[i];
    const Vector3 at_m = is_viscous ? place_of(sphere, i) : model.base_m[i] + model.moved_of(i);
    if (model.is_present[i]) model.reached_m[i] = at_m;
    if (force.isZero(0.0)) continue;
    model.is_touching = true;
    sum -= force;
    work_joule += 0.5 * force.dot(at_m - model.rest_m[i]);
  }
  model.force_on_tool_newton = model.is_touching
                                   ? Vector3(sum + model.state.force_outside_patch_newton)
                                   : Vector3(Vector3::Zero());
  model.stored_energy_joule = std::clamp(work_joule, 0.0, kMaxStoredEnergyJoule);
  // in doubt there is no force
  if (!sum.allFinite() || !std::isfinite(work_joule) ||
      sum.cwiseAbs().maxCoeff() > kMaxTissueForceNewton) {
    model.clear_forces();
    model.is_complete = false;
  }
}

/// At most `left` steps, less those made, in the time that the tip took for its way.
void ElasticPatches::Patch::walk_to(const Vector3& tip_m, double dt_s, int& left, Budget& budget,
                                    Model& model) noexcept {
  const double longest_m = kStepShare * model.state.tip_radius_m;
  const double steps = std::max(1.0, std::ceil((tip_m - model.at_m).norm() / longest_m));
  model.left_s += dt_s;
  const double step_s = model.left_s / steps;
  while (left > 0 && budget.left > 0) {
    --left;
    const Vector3 way_m = tip_m - model.at_m;
    const double length_m = way_m.norm();
    if (length_m <= longest_m) {
      sweep_to(tip_m, step_s, budget, model);
      model.is_walking = false;
      model.left_s = 0.0;
      return;
    }
    sweep_to(model.at_m + longest_m / length_m * way_m, step_s, budget, model);
    model.left_s = std::max(0.0, model.left_s - step_s);
  }
  model.is_walking = true;
}

ElasticPatches::Result ElasticPatches::Patch::step(const Interaction& newest, const Vector3& tip_m,
                                                   double dt_s, double scene_s, double most_newton,
                                                   Budget& budget) noexcept {
  const auto there_m = [&](const Model& model) {
    return Vector3(tip_m - model.state.carried_by_m(scene_s));
  };
  since_state_s_ += dt_s;
  if (has_state_) state_age_s_ += dt_s;
  // a new state waits for the end of a crossing, and of the way of a model to the tip
  const auto is_usable = [](const Model& model) { return model.is_there && model.is_complete; };
  const bool is_used = is_usable(current());
  const bool is_walking =
      is_used && (current().is_walking || (is_usable(next()) && next().is_walking));
  if (has_state_ && !is_crossing_ && !is_walking) {
    has_state_ = false;
    const bool is_next = is_used && current().state.tissue == state_.tissue;
    if (!is_next) next().is_there = false;
    begin(is_next ? next() : current());
    budget.take(kWorkPerStep);
  }
  if (!current().is_there) return {};

  Result result{.is_stepped = true, .tissue = current().state.tissue};
  if (!current().is_complete) return {};
  const bool has_next = is_usable(next());
  int left = has_next ? kMostSteps - 1 : kMostSteps;
  walk_to(there_m(current()), dt_s, left, budget, current());
  const bool is_there = !current().is_walking;
  const Model* model = &current();
  result.force = {model->force_on_tool_newton, model->stored_energy_joule, model->is_touching};
  if (has_next) {
    ++left;
    walk_to(there_m(next()), dt_s, left, budget, next());
  }
  if (has_next && is_there && !is_crossing_ && !next().is_walking &&
      next().covers(there_m(next()))) {
    is_crossing_ = true;
    share_ = 0.0;
  }
  if (is_crossing_) {
    const Vector3 difference = next().force_on_tool_newton - model->force_on_tool_newton;
    const double newton = difference.norm();
    share_ = newton > most_newton ? std::min(1.0, share_ + most_newton / newton) : 1.0;
    result.force.force_on_tool_newton += share_ * difference;
    result.force.stored_energy_joule =
        std::min(result.force.stored_energy_joule, next().stored_energy_joule);
    result.force.is_touching = result.force.is_touching || next().is_touching;
    if (share_ >= 1.0) {
      is_crossing_ = false;
      current().is_there = false;
      current_ = 1 - current_;
      model = &current();
      result.force = {model->force_on_tool_newton, model->stored_energy_joule, model->is_touching};
    }
  }
  const bool is_pushed_out = result.force.force_on_tool_newton.dot(model->state.normal) >= 0.0;
  result.is_valid =
      is_there && model->is_complete && model->covers(there_m(*model)) && is_pushed_out;
  if (!is_pushed_out) result.force = {};
  surface_m_ += dt_s * model->state.carried_m_per_s;
  rub(newest, tip_m - surface_m_, model->state, result.force);
  return result;
}

/// Coulomb friction: a spring along the surface that slips.
void ElasticPatches::Patch::rub(const Interaction& newest, const Vector3& tip_m,
                                const ElasticState& state, ModelForce& force) noexcept {
  const double newton = force.force_on_tool_newton.norm();
  if (!(state.friction_coefficient > 0.0) || !(newton > 0.0)) {
    has_tip_ = false;
    stretch_m_.setZero();
    return;
  }
  const Vector3 normal = force.force_on_tool_newton / newton;
  if (!has_tip_) {
    for (std::uint32_t i = 0; i < newest.listed_count; ++i) {
      const Contact& contact = newest.contacts[i];
      if (contact.tissue == state.tissue && contact.penetration_m > 0.0) {
        stretch_m_ = contact.stretch_m;
      }
    }
  }
  const Vector3 moved_m = has_tip_ ? Vector3(tip_m - tip_m_) : Vector3(Vector3::Zero());
  const double k = state.friction_stiffness_newton_per_m;
  stretch_m_ = rubbed_stretch(stretch_m_, moved_m, normal, state.friction_coefficient, k, newton);
  has_tip_ = true;
  tip_m_ = tip_m;
  force.force_on_tool_newton -= k * stretch_m_;
  force.stored_energy_joule += 0.5 * k * stretch_m_.squaredNorm();
}

// --- all patches ---------------------------------------------------------------------------------

ElasticPatches::ElasticPatches(double newton_per_s)
    : newton_per_s_(newton_per_s), patches_(kMaxElasticPatches) {}
ElasticPatches::~ElasticPatches() = default;

void ElasticPatches::take(const Interaction& interaction, std::uint64_t store_id,
                          double age_s) noexcept {
  if (store_id != store_id_) {
    store_id_ = store_id;
    receipts_ = {};
    for (Patch& patch : patches_) patch.empty();
  }
  const ElasticNews& news = interaction.elastic;
  if (news.store_id != store_id_ || news.number == 0) return;
  note_receipt(news.number, receipts_.newest, receipts_.received);
  if (news.has_point) {
    patches_[news.point.patch].take(news.point);
  } else {
    patches_[news.state.patch].take(news.state, age_s);
  }
}

void ElasticPatches::reset() noexcept {
  for (Patch& patch : patches_) patch.reset();
  results_ = {};
}

void ElasticPatches::step(const Interaction& newest, const Vector3& tip_m, double dt_s,
                          double scene_s, std::uint32_t most_work) noexcept {
  Budget budget{.left = most_work};
  for (std::size_t i = 0; i < kMaxElasticPatches; ++i) {
    results_[i] = patches_[i].step(newest, tip_m, dt_s, scene_s, newton_per_s_ * dt_s, budget);
  }
  work_ = budget.used;
}

}  // namespace palpate::mofc
