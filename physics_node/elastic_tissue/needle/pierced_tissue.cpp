// SPDX-License-Identifier: Apache-2.0
// An elastic tissue into which a needle or a blade goes.
#include "physics_node/elastic_tissue/elastic_tissue.h"

namespace palpate::physics {
namespace {

// The numbers of different tissues are different.
constexpr std::uint32_t kMostTissues = 256;

}  // namespace

bool ElasticTissue::can_be_pierced() const noexcept {
  return gripper_ && gripper_->is_needle() && whole_->pierced.has_value();
}

void ElasticTissue::set_needle(std::size_t tool, const JawInput& input, bool may_pierce) noexcept {
  Tool& own = *tools_[tool];
  own.jaw_m_per_s = input.velocity_m_per_s;
  own.inward = input.inward_world;
  own.edge = input.edge_world;
  own.may_pierce = may_pierce && can_be_pierced();
  own.is_felt_elsewhere = input.is_felt_elsewhere;
  own.is_jaw_led = own.jaw.is_closed() && input.report && input.report->number == own.jaw.number();
  if (own.is_jaw_led) own.jaw.follow(input.report->slip_m, input.report->has_let_go);
  own.jaw_command.store(own.jaw.command());
}

/// After a touch, which may be a puncture: the next solution holds the tissue.
void ElasticTissue::pierce(Tool& own, const Contact& contact) const noexcept {
  if (!own.may_pierce || own.jaw.is_closed()) return;
  const Piercing::Laws laws{.tissue = *whole_->pierced, .needle = *gripper_};
  Vector3 newton = contact.force_on_tool_newton;
  const Prepared* const prepared = own.prepared.newest();
  if (prepared != nullptr && !prepared->waiting.isZero(0.0)) {
    const Vector3 further_m =
        own.tip_m - prepared->carried.since_m(own.time_s) - prepared->centre_m;
    newton *= force_ratio_ahead(contact.penetration_m, -own.side.view().normal.dot(further_m));
  }
  if (!own.piercing.presses(laws, newton, own.side.place_m(), own.inward, tip_radius_m_)) return;
  own.jaw.set(kMostTissues * ++own.punctures + whole_->tissue % kMostTissues);
  NeedleLaw& law = own.jaw.start_needle();
  own.piercing.update(laws, 0.0, law);
  if (gripper_->is_blade()) fit_blade(laws.tissue, entering(), own.edge, law);
  own.jaw_command.store(own.jaw.command());
}

/// Before a step of a needle that is in. False: it is not in any more.
bool ElasticTissue::stays_in(Tool& own, const GripModel& model) const noexcept {
  // where nothing was in reach, or what was held has vanished, nothing holds it
  const bool has_nothing = model.number == own.jaw.number() && !model.is_holding();
  const bool is_through = is_blade_through(own, model);
  if (own.jaw.is_closed() && (has_nothing || is_through || own.jaw.is_lost())) {
    NeedleLaw& law = own.jaw.needle();
    if (gripper_->is_blade()) law.deepest_m = std::min(law.deepest_m, model.edge.deepest_m);
    own.piercing.leave(law);
    own.jaw.set(0);
    own.jaw_command.store(own.jaw.command());
    if (is_through) {  // it may be on another side of the body
      own.side = {};
      own.is_leaving = true;
    }
  }
  if (!own.jaw.holds(model)) return false;
  own.jaw.begin(model);
  own.piercing.update({.tissue = *whole_->pierced, .needle = *gripper_}, own.jaw.depth_m(),
                      own.jaw.needle());
  if (gripper_->is_blade()) {
    fit_blade(*whole_->pierced, model.edge, own.jaw.needle().edge_world, own.jaw.needle());
  }
  return true;
}

}  // namespace palpate::physics
