// SPDX-License-Identifier: Apache-2.0
#include "physics_node/tissue_changes.h"

#include <variant>

namespace palpate::physics {
namespace {

constexpr std::size_t kMostWaiting = 64;  // far more than arrive between two steps

}  // namespace

TissueChanges::TissueChanges(const SceneConfig& scene, Source<TissueChange>& source)
    : source_(source), accepted_(kMostWaiting) {
  for (const TissueConfig& tissue : scene.tissues) {
    const auto* material = std::get_if<KelvinVoigtMaterial>(&tissue.material);
    is_changeable_.push_back(material != nullptr &&
                             material->stiffness_newton_per_m + material->damping_newton_s_per_m >
                                 0.0);
    is_restorable_.push_back(is_restorable(scene, tissue));
  }
}

void TissueChanges::receive(const std::function<void(const TissueChange&)>& on_accepted) {
  TissueChange change;
  TimePoint received_at;
  while (source_.receive(change, received_at)) {
    const std::vector<bool>& is_able = change.restores ? is_restorable_ : is_changeable_;
    const bool is_possible = change.tissue < is_able.size() && is_able[change.tissue];
    if (!is_possible || !accepted_.push(change)) {
      ++refused_;
      continue;
    }
    ++changes_;
    on_accepted(change);
  }
}

void TissueChanges::count_into(PhysicsCounters& counters) const {
  counters.tissue_changes = changes_;
  counters.tissue_changes_refused = refused_ + source_.rejected();
}

}  // namespace palpate::physics
