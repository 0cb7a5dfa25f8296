// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic_tissue/ablation/ablation.h"

#include <algorithm>
#include <chrono>
#include <exception>
#include <utility>

#include "physics_node/elastic_tissue/ablation/heat.h"

namespace palpate::physics {
namespace {

// The columns of nodes this near to an electrode are made with the next body.
constexpr double kNearRadii = 2.5;
constexpr std::size_t kMostNear = 192;
constexpr double kBesideReaches = 1.5;  // and so near to the edge of a blade
// The next body is made when an attachment holds by so much less than in the present one, relative
// to the intact one, or holds nothing any more; and for all that has changed when nothing has torn
// for so many solutions.
constexpr double kTornRatio = 0.25;
constexpr int kQuietSolutions = 10;

}  // namespace

Ablation::Ablation(std::shared_ptr<BodyCompliance> whole,
                   const std::optional<ElectrodeConfig>& electrode, double tip_radius_m,
                   std::size_t tools, bool is_in_background, bool can_be_cut)
    : whole_(std::make_shared<AblatedBody>(whole_body(std::move(whole)))),
      present_(whole_),
      electrode_(electrode),
      tip_radius_m_(tip_radius_m),
      is_in_background_(is_in_background),
      doses_(whole_->elements.size(), 0.0),
      stages_(doses_.size(), 0),
      heated_m_(tools, Vector3::Constant(1e9)),
      edges_(tools) {
  if (can_be_cut) {
    opposite_ = std::make_shared<const std::vector<std::int32_t>>(
        elastic::opposite_sides(whole_->body()->body->mesh()));
  }
  for (const elastic::Attachment& one : whole_->body()->body->description().attachments) {
    if (one.tears()) attached_.push_back(1.0);
  }
}

void Ablation::continue_as(const Ablation& other) {
  present_ = other.present_;
  doses_ = other.doses_;
  stages_ = other.stages_;
  heated_m_ = other.heated_m_;
  attached_ = other.attached_;
  edges_ = other.edges_;
  is_cut_ = other.is_cut_;
  quiet_solutions_ = other.quiet_solutions_;
  is_changed_ = other.is_changed_;
  is_ordered_ = other.is_ordered_;
  next_ = other.next_;
  clock_s_ = other.clock_s_;
  is_order_void_ = other.is_order_void_;
  ready_s_ = other.ready_s_;
  figures_ = other.figures_;
}

void Ablation::heat(std::size_t tool, const elastic::VectorXd& x_m, const Vector3& tip_m,
                    double energised_s) {
  if (!(energised_s > 0.0) || !tip_m.allFinite()) return;
  heated_m_[tool] = tip_m;
  const elastic::Mesh& mesh = present_->body()->body->mesh();
  const std::vector<elastic::Material>& materials = present_->body()->body->description().materials;
  for (std::size_t i = 0; i < present_->elements.size(); ++i) {
    Vector3 centroid_m = Vector3::Zero();
    for (const std::uint32_t corner : mesh.element(i).first(4)) {
      centroid_m += 0.25 * x_m.segment<3>(3 * Eigen::Index{corner});
    }
    const double watt_per_m3 =
        power_density_watt_per_m3(*electrode_, tip_radius_m_, (centroid_m - tip_m).norm());
    if (!(watt_per_m3 > 0.0)) continue;
    const std::uint32_t element = present_->elements[i];
    const double joule_per_m3 =
        electrode_->energy_joule_per_kg * materials[mesh.regions[i]].density_kg_per_m3;
    doses_[element] += watt_per_m3 * energised_s / joule_per_m3;
    const std::uint8_t stage = heat_stage(doses_[element]);
    is_changed_ = is_changed_ || stage != stages_[element];
    stages_[element] = stage;
  }
}

void Ablation::cut(std::size_t tool, const Sweep& sweep, double reach_m) {
  edges_[tool] = {.from_m = sweep.from_m, .to_m = sweep.to_m, .reach_m = reach_m};
  figures_.cut_joule += sweep.joule;
  figures_.swept_m2 += sweep.swept_m2;
  figures_.separated_m2 += sweep.cut_m2;
  if (is_cut_.empty()) is_cut_.resize(opposite_->size(), 0);
  for (const elastic::FaceSide side : sweep.cut) {
    if (std::exchange(is_cut_[side], 1) != 0) continue;
    is_cut_[static_cast<std::size_t>((*opposite_)[side])] = 1;
    ++figures_.faces_cut;
    is_changed_ = true;
  }
}

void Ablation::tear(const elastic::Tearing& tearing, bool has_torn) {
  quiet_solutions_ = has_torn ? 0 : quiet_solutions_ + 1;
  bool is_changed = quiet_solutions_ == kQuietSolutions && !tearing.is_idle();
  for (const elastic::Tearing::One& one : tearing.attachments()) {
    const double ordered = attached_[one.attachment.index];
    const bool is_off = ordered > 0.0 && !(one.ratio() > 0.0);
    is_changed = is_changed || is_off || ordered - one.ratio() > kTornRatio;
  }
  if (!is_changed) return;
  is_changed_ = true;
  for (const elastic::Tearing::One& one : tearing.attachments()) {
    attached_[one.attachment.index] = one.ratio();
  }
}

/// The next body, from what is heated and torn now.
void Ablation::order(const elastic::VectorXd& x_m) {
  std::vector<std::uint32_t> near;
  for (std::size_t i = 0; i < present_->nodes.size() && near.size() < kMostNear; ++i) {
    const Vector3 node_m = x_m.segment<3>(3 * static_cast<Eigen::Index>(i));
    const bool is_near = std::any_of(heated_m_.begin(), heated_m_.end(), [&](const Vector3& tip_m) {
      return (node_m - tip_m).norm() < kNearRadii * tip_radius_m_;
    });
    const Vector3 start_m =
        whole_->body()->start_m.segment<3>(3 * Eigen::Index{present_->nodes[i]});
    const bool is_at_edge = std::any_of(edges_.begin(), edges_.end(), [&](const Edge& edge) {
      return elastic::distance_to_edge_m(start_m, {edge.from_m, edge.to_m}) <
             kBesideReaches * edge.reach_m;
    });
    const bool is_known = !near.empty() && near.back() == present_->nodes[i];  // another copy
    if ((is_near || is_at_edge) && !is_known) near.push_back(present_->nodes[i]);
  }
  const auto make = [whole = whole_, before = present_, stages = stages_, near = std::move(near),
                     attached = attached_, opposite = opposite_, is_cut = is_cut_,
                     softest_ratio = electrode_ ? electrode_->softest_ratio : 1.0]() -> Made {
    try {
      elastic::FaceCuts cuts;
      if (opposite) cuts = {.opposite = *opposite, .is_cut = is_cut};
      return ablated_body(*whole->body(), *before, stages, softest_ratio, near, attached, cuts);
    } catch (const std::exception&) {  // the one before goes on
      return nullptr;
    }
  };
  is_changed_ = false;
  is_ordered_ = true;
  if (is_in_background_) {
    under_way_ = std::async(std::launch::async, make);
  } else {
    next_ = make();
    ready_s_ = clock_s_ + kLatency_s;
  }
}

Ablation::Made Ablation::received() {
  if (!is_ordered_) return nullptr;
  if (is_in_background_) {
    if (under_way_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return nullptr;
    next_ = under_way_.get();
  } else if (clock_s_ < ready_s_) {
    return nullptr;
  }
  is_ordered_ = false;
  Made made = std::exchange(next_, nullptr);
  if (std::exchange(is_order_void_, false)) return nullptr;
  if (made == nullptr) {
    ++figures_.refused;
    return nullptr;
  }
  ++figures_.remade;
  figures_.removed += present_->elements.size() - made->elements.size();
  figures_.loose += made->loose;
  present_ = made;
  return made;
}

std::shared_ptr<const AblatedBody> Ablation::advance(double step_s, const elastic::VectorXd& x_m) {
  clock_s_ += step_s;
  Made made = received();
  // the order that follows a change waits for the state of the new body
  if (made == nullptr && is_changed_ && !is_ordered_) order(x_m);
  return made;
}

std::shared_ptr<const AblatedBody> Ablation::restore() {
  std::fill(doses_.begin(), doses_.end(), 0.0);
  std::fill(stages_.begin(), stages_.end(), 0);
  std::fill(attached_.begin(), attached_.end(), 1.0);
  is_cut_.clear();
  is_changed_ = false;
  is_order_void_ = is_ordered_;
  ++figures_.restored;
  present_ = whole_;
  return present_;
}

}  // namespace palpate::physics
