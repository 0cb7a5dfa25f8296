// SPDX-License-Identifier: Apache-2.0
// An elastic tissue whose body is replaced by what is left of it.
#include <utility>

#include "physics_node/elastic_tissue/elastic_tissue.h"

namespace palpate::physics {

/// On the thread of the steps of a tool.
void ElasticTissue::follow_body(Tool& own) noexcept {
  const std::shared_ptr<const ElasticBody>* const newest = own.body.newest();
  if (newest == nullptr || newest->get() == own.surface_of) return;
  own.surface_of = newest->get();
  own.side.change_to(own.surface_of->shape);
  if (own.surface_of == whole_.get() && can_be_cut()) own.piercing = {};  // its cuts are closed
}

/// After a full solution: what the tools have done to the body.
void ElasticTissue::wear() {
  ablation_->tear(simulation_->tearing(), simulation_->has_torn());
  figures_.torn = simulation_->tearing().torn();
  figures_.torn_joule = simulation_->tearing().taken_joule();
  for (std::size_t i = 0; i < tools_.size(); ++i) {
    const Tip tip = tools_[i]->tip.load();
    if (!tips_[i] || !tip.is_known) continue;
    const double before_s = std::exchange(tools_[i]->slow_energised_s, tip.energised_s);
    ablation_->heat(i, simulation_->x_m(), tips_[i]->tip_m, tip.energised_s - before_s);
  }
  figures_.ablation = ablation_->figures();
}

/// Before a full solution: of the next body, if it is ready. The state goes on, or begins anew if
/// it is whole again; what the steps of the tools have of the body before, they use until
/// publish().
void ElasticTissue::change_body(double step_s) {
  const bool is_whole = is_restore_due_.exchange(false);
  const std::shared_ptr<const AblatedBody> next =
      is_whole ? ablation_->restore() : ablation_->advance(step_s, simulation_->x_m());
  if (next == nullptr) return;
  simulation_ = is_whole
                    ? std::make_unique<ElasticSimulation>(*next->body(), *simulation_, is_folded_)
                    : std::make_unique<ElasticSimulation>(*next->body(), *simulation_, next->change,
                                                          is_folded_);
  for (std::size_t i = 0; i < tools_.size(); ++i) {
    Tool& tool = *tools_[i];
    tool.last.reset();
    tool.last_newton = 0.0;
    tool.last_forces_newton.clear();
    if (makers_[i])
      makers_[i].emplace(*next->body(), next->shared->compliance(), PatchMaker(*makers_[i]));
    if (gripper_) {
      tool.held.change_body(*simulation_, i, next->shared->compliance(),
                            is_whole ? nullptr : &*gripper_);
    }
    tool.body.draft() = next->body();
  }
  shared_ = next->shared;
  body_ = shared_->body();
  is_body_new_ = has_moved_ = true;
}

}  // namespace palpate::physics
