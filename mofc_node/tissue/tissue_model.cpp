// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/tissue/tissue_model.h"

#include <algorithm>
#include <cmath>

#include "common/contact/tissue_motion.h"

namespace palpate::mofc {
namespace {

// A physics costs too much after this many steps in a row that need too much, or if more than a
// ninth of its steps do.
constexpr int kCostlySteps = 64;
constexpr int kCostPerStep = 8;

// What is left of a result that has ended fades within this time, the faster the more it is.
constexpr double kLongestPassage_s = 0.1;

/// What tissue that moves by itself does to a hand that holds against it, until it has moved as far
/// along the force as it ever does. The hand put as much in while it went the other way.
double energy_of_motion_joule(const ModelForce& force, const TissueMotionConfig& motion,
                              double time_s) noexcept {
  if (!is_moving(motion)) return 0.0;
  const Vector3& F = force.force_on_tool_newton;
  return std::abs(F.dot(motion.amplitude_m)) - F.dot(displacement(motion, time_s).position_m);
}

}  // namespace

TissueModel::TissueModel(bool has_store, double handover_newton_per_s, std::uint64_t session_id,
                         Duration period)
    : newton_per_s_(handover_newton_per_s),
      work_per_step_(LocalTissues::work_in(period)),
      handover_(handover_newton_per_s),
      held_(handover_newton_per_s),
      store_(has_store ? std::make_unique<TissueStore>(session_id) : nullptr),
      elastic_(has_store ? std::make_unique<ElasticPatches>(handover_newton_per_s) : nullptr) {}

void TissueModel::receive(const Interaction& interaction, const Header& state) noexcept {
  const bool is_of_this_session = interaction.device_session_id == state.session_id;
  const TimePoint now = state.sampled_at;
  if (interaction.header.session_id != costly_session_id_) costly_session_id_ = 0;
  if (store_ && !costs_too_much()) {
    store_->take(interaction,
                 is_of_this_session ? now - interaction.device_sampled_at : Duration::zero());
    elastic_->take(interaction, store_->receipts().store_id,
                   to_seconds(store_->receipts().loop_age));
  }
  if (is_of_this_session) clock_.note(interaction, now);
}

void TissueModel::reset() noexcept {
  handover_.reset();
  held_.reset();
  local_.reset();
  clock_.reset();
  if (elastic_) elastic_->reset();
  shares_ = {};
  elastic_shares_ = {};
  partings_ = {};
  holds_for_ = {};
}

void TissueModel::drop() noexcept {
  reset();
  if (store_) store_->drop();
}

void TissueModel::note_cost(std::uint64_t physics_session_id) noexcept {
  if (costs_too_much()) return;
  cost_ = local_.is_exhausted() ? cost_ + kCostPerStep : std::max(0, cost_ - 1);
  if (cost_ < kCostPerStep * kCostlySteps) return;
  cost_ = 0;
  costly_session_id_ = physics_session_id;
}

ModelForce TissueModel::step(const Interaction& newest, const DeviceState& state,
                             const Vector3& tool_position_world_m,
                             const ToolVelocity& tool_velocity_world, double dt_s,
                             std::uint32_t spent_work) noexcept {
  const TimePoint now = state.header.sampled_at;
  std::array<TissueShare, kMaxDescribed + kMaxElasticPatches> shares;
  std::size_t share_count = 0;
  ModelForce sum =
      held_.step(newest, state.buttons, tool_position_world_m, tool_velocity_world, dt_s);
  const bool is_holding = sum.is_touching;
  holds_for_ = store_ ? Duration::max() : Duration::zero();
  const auto add = [&](const LocalTissues::Result& local, double share, Duration law_holds_for) {
    if (!(share > 0.0)) return;
    shares[share_count++] = {.tissue = local.tissue, .share = share};
    sum.add(share, local.force);
    if (!local.force.is_touching) return;
    const bool is_known = local.is_valid && share == 1.0;
    holds_for_ = std::min(holds_for_, is_known ? law_holds_for : Duration::zero());
  };
  if (store_) {
    const ToolPose pose{.tip_m = tool_position_world_m,
                        .shaft = state.tool_orientation_world * Vector3::UnitZ(),
                        .time_s = clock_.now_s(now).value_or(0.0)};
    const std::uint32_t most_work = work_per_step_ - std::min(spent_work, work_per_step_);
    local_.step(store_->tissues(), newest, pose, tool_velocity_world, shares_, most_work);
    if (spent_work == 0) note_cost(newest.header.session_id);
    elastic_->step(newest, tool_position_world_m, dt_s, pose.time_s,
                   most_work - std::min(local_.work(), most_work));
    for (std::size_t i = 0; i < kMaxDescribed; ++i) {
      share_out(local_.results()[i], now, tool_position_world_m, tool_velocity_world, dt_s,
                shares_[i]);
      const TissueMotionConfig& motion = store_->tissues()[i].motion();
      add(local_.results()[i], shares_[i],
          is_moving(motion) ? from_seconds(1.0 / motion.frequency_hz) : Duration::max());
      sum.stored_energy_joule +=
          shares_[i] * energy_of_motion_joule(local_.results()[i].force, motion, pose.time_s);
    }
    for (std::size_t i = 0; i < kMaxElasticPatches; ++i) {
      const double share_before = elastic_shares_[i];
      share_out(elastic_->results()[i], now, tool_position_world_m, tool_velocity_world, dt_s,
                elastic_shares_[i]);
      add(elastic_->results()[i], elastic_shares_[i], Duration::zero());
      part(elastic_->results()[i], now, tool_position_world_m, tool_velocity_world, dt_s,
           share_before, elastic_shares_[i], partings_[i]);
      sum.force_on_tool_newton += partings_[i].left_newton;
    }
    if (costs_too_much() && share_count == 0) store_->drop();
  }
  const ModelForce rest = handover_.step(newest, tool_position_world_m, tool_velocity_world, dt_s,
                                         now, std::span(shares).first(share_count));
  sum.add(1.0, rest);
  if (rest.is_touching || is_holding) holds_for_ = {};
  return sum;
}

/// A step of the transition between a tissue's contact model and its local result.
void TissueModel::share_out(const LocalTissues::Result& local, TimePoint now,
                            const Vector3& position, const ToolVelocity& velocity, double dt_s,
                            double& share) noexcept {
  const double bound_newton = newton_per_s_ * dt_s;
  const bool counts = local.is_valid && !costs_too_much() && !held_.is_about(local.tissue);
  const double aim = counts ? 1.0 : 0.0;
  if (!local.is_stepped) share = 0.0;
  if (share == aim) return;
  const ModelForce model = handover_.of_tissue(local.tissue, position, velocity, now);
  const double newton = (local.force.force_on_tool_newton - model.force_on_tool_newton).norm();
  const double most = newton > bound_newton ? bound_newton / newton : 1.0;
  share += std::clamp(aim - share, -most, most);
}

void TissueModel::part(const LocalTissues::Result& local, TimePoint now, const Vector3& position,
                       const ToolVelocity& velocity, double dt_s, double share_before, double share,
                       Parting& parting) noexcept {
  // a force that ends while the tip does not go its way has not been left
  const Vector3& before = parting.local_newton;
  const bool is_lost = local.is_stepped && local.tissue == parting.tissue &&
                       local.force.force_on_tool_newton.isZero(0.0) &&
                       before.norm() > newton_per_s_ * dt_s &&
                       (position - parting.at_m).dot(before) <= 0.0;
  if ((!local.is_stepped || is_lost) && share_before > 0.0) {
    const ModelForce model = handover_.of_tissue(parting.tissue, position, velocity, now);
    parting.left_newton += share_before * (parting.local_newton - model.force_on_tool_newton);
    if (is_lost) parting.left_newton += share * model.force_on_tool_newton;
    if (!parting.left_newton.allFinite()) parting.left_newton.setZero();
    parting.newton_per_s = std::max(newton_per_s_, parting.left_newton.norm() / kLongestPassage_s);
  }
  const double bound_newton = parting.newton_per_s * dt_s;
  const double newton = parting.left_newton.norm();
  parting.left_newton *= newton > bound_newton ? 1.0 - bound_newton / newton : 0.0;
  if (local.is_stepped) {
    parting.tissue = local.tissue;
    parting.local_newton = local.force.force_on_tool_newton;
    parting.at_m = position;
  }
}

}  // namespace palpate::mofc
