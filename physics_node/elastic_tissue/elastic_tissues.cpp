// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic_tissue/elastic_tissues.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <limits>
#include <mutex>
#include <utility>

#include "physics_node/scene/scene.h"

namespace palpate::physics {
namespace {

// A fast tip is looked ahead for so much of the time that its solution takes: to about a step of
// the tool before that is used.
constexpr double kAheadShare = 0.8;

/// Solves at the rate of its bodies until stopped, and more often while a tip is fast. A solution
/// that takes longer than its period delays the next one: the body's time then runs slower.
void solve_in_real_time(const std::stop_token& stop, TissueIsland& island) {
  using Clock = std::chrono::steady_clock;
  const auto ticks = [](double seconds) {
    return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
  };
  std::mutex mutex;
  std::condition_variable_any stopped;
  std::unique_lock lock(mutex);
  Clock::time_point last = Clock::now() - ticks(island.longest_step_s());
  Clock::duration solving{};  // took the last one
  while (!stop.stop_requested()) {
    const Clock::time_point begin = Clock::now();
    const double since_s = std::chrono::duration<double>(begin - last).count();
    const double takes_s = std::chrono::duration<double>(solving).count();
    island.solve(std::clamp(since_s, island.least_step_s(), island.longest_step_s()),
                 island.is_fast() ? kAheadShare * std::min(takes_s, island.longest_step_s()) : 0.0);
    last = begin;
    island.publish();
    solving = Clock::now() - begin;
    if (Clock::now() > begin + ticks(island.longest_step_s())) island.note_late();
    for (int part = 1; part <= ElasticTissue::kMostSolvesPerPeriod; ++part) {
      stopped.wait_until(lock, stop, begin + ticks(part * island.least_step_s()),
                         [] { return false; });
      if (stop.stop_requested() || island.is_fast()) break;
    }
  }
}

}  // namespace

std::shared_ptr<ElasticTissues> ElasticTissues::of(const SceneConfig& scene, std::size_t tools,
                                                   ElasticPace pace,
                                                   const std::filesystem::path& columns_folder) {
  const std::vector<std::shared_ptr<const ElasticBody>> bodies = elastic_bodies_of(scene);
  if (bodies.empty()) return nullptr;
  return std::make_shared<ElasticTissues>(bodies, tools, scene.tip_radius_m, pace, columns_folder,
                                          scene.holder(), scene.electrode);
}

std::vector<std::shared_ptr<BodyCompliance>> compliances_of(
    const std::vector<std::shared_ptr<const ElasticBody>>& bodies,
    const std::filesystem::path& columns_folder) {
  std::vector<std::shared_ptr<BodyCompliance>> made;
  made.reserve(bodies.size());
  for (const auto& body : bodies) {
    made.push_back(std::make_shared<BodyCompliance>(body, columns_folder));
  }
  return made;
}

ElasticTissues::ElasticTissues(const std::vector<std::shared_ptr<BodyCompliance>>& bodies,
                               std::size_t tools, double tip_radius_m, ElasticPace pace,
                               const std::optional<GripperConfig>& gripper,
                               const std::optional<ElectrodeConfig>& electrode)
    : pace_(pace), gripper_(gripper), electrode_(electrode), counts_(tools), closings_(tools) {
  for (const auto& body : bodies) {
    tissues_.push_back(std::make_unique<ElasticTissue>(body, tools, tip_radius_m,
                                                       pace_ == ElasticPace::kFolded, gripper_,
                                                       electrode_, pace_ == ElasticPace::kThread));
  }
  std::vector<ElasticTissue*> all;
  for (auto& tissue : tissues_) all.push_back(tissue.get());
  islands_ = TissueIsland::of(all);
  last_solve_s_.assign(islands_.size(), -std::numeric_limits<double>::infinity());
  ready_s_ = last_solve_s_;
  if (pace_ != ElasticPace::kThread) return;
  for (TissueIsland& island : islands_) {
    threads_.emplace_back(
        [&own = island](const std::stop_token& stop) { solve_in_real_time(stop, own); });
  }
}

ElasticTissues::~ElasticTissues() = default;

void ElasticTissues::continue_as(const ElasticTissues& other) {
  for (std::size_t i = 0; i < tissues_.size(); ++i) tissues_[i]->continue_as(*other.tissues_[i]);
  for (std::size_t i = 0; i < islands_.size(); ++i) islands_[i].continue_as(other.islands_[i]);
  counts_ = other.counts_;
  closings_ = other.closings_;
  last_solve_s_ = other.last_solve_s_;
  ready_s_ = other.ready_s_;
}

void ElasticTissues::step(std::size_t tool, const Vector3& tip_m, double time_s, double reach_m,
                          SceneForce& sum, const JawInput& jaw, bool is_energised) noexcept {
  const bool heats = electrode_ && is_energised;
  counts_[tool].energised += heats ? 1U : 0U;
  for (auto& tissue : tissues_) tissue->note(tool, tip_m, reach_m, time_s, heats);
  if (gripper_) close(tool, jaw);
  if (pace_ != ElasticPace::kThread) solve_until(time_s);
  Counts& counts = counts_[tool];
  bool is_in_contact = false;
  double bound_newton = 0.0;
  for (auto& tissue : tissues_) {
    Contact contact;
    if (!tissue->touch(tool, contact)) {
      ++counts.skipped;
      continue;
    }
    add_contact(contact, sum);
    if (!(contact.penetration_m > 0.0)) continue;
    is_in_contact = true;
    bound_newton += tissue->bound_newton(tool);
  }
  if (!is_in_contact) return;
  counts.bound_newton = bound_newton;
  ++counts.in_contact;
  counts.without_bound += std::isnan(bound_newton) ? 1U : 0U;
}

void ElasticTissues::restore(std::uint32_t tissue) noexcept {
  for (auto& one : tissues_) {
    if (one->body().tissue == tissue) one->restore();
  }
}

void ElasticTissues::close(std::size_t tool, const JawInput& jaw) noexcept {
  if (gripper_->is_needle()) {
    for (auto& tissue : tissues_) {
      const bool is_elsewhere = std::any_of(
          tissues_.begin(), tissues_.end(),
          [&](const auto& other) { return other != tissue && other->is_pierced(tool); });
      tissue->set_needle(tool, jaw, !is_elsewhere);
    }
    return;
  }
  Closing& closing = closings_[tool];
  if (jaw.is_closed && !closing.is_closed) {
    ++closing.number;
    for (std::size_t i = closing.tissue = 0; i < tissues_.size(); ++i) {
      const double least_m = tissues_[closing.tissue]->distance_m(tool);
      if (tissues_[i]->distance_m(tool) < least_m) closing.tissue = i;
    }
  }
  closing.is_closed = jaw.is_closed;
  const bool is_reported = jaw.report && jaw.report->number == closing.number;
  for (std::size_t i = 0; i < tissues_.size(); ++i) {
    const bool is_this = closing.is_closed && i == closing.tissue;
    tissues_[i]->set_jaw(tool, is_this ? closing.number : 0,
                         is_this && is_reported ? &*jaw.report : nullptr, jaw.velocity_m_per_s);
  }
}

void ElasticTissues::solve_until(double time_s) {
  for (std::size_t i = 0; i < islands_.size(); ++i) {
    TissueIsland& island = islands_[i];
    const double longest_s = island.longest_step_s();
    const double rounding_s = 1e-6 * longest_s;
    if (time_s < ready_s_[i] - rounding_s) continue;
    island.publish();
    const double since_s = time_s - last_solve_s_[i];
    const bool is_fast = island.is_fast();
    if (since_s < longest_s - rounding_s && !is_fast) continue;
    const double needs_s = is_fast ? island.least_step_s() : longest_s;
    island.solve(std::clamp(since_s, island.least_step_s(), longest_s),
                 is_fast ? kAheadShare * needs_s : 0.0);
    last_solve_s_[i] = time_s;
    ready_s_[i] = time_s + needs_s;
  }
}

void ElasticTissues::count_into(PhysicsCounters& counters) const noexcept {
  counters.elastic_solves = counters.elastic_solves_skipped = counters.elastic_solves_late = 0;
  counters.elastic_solves_failed = counters.elastic_solves_repaired = 0;
  counters.elastic_bounds_checked = counters.elastic_bound_violations = 0;
  counters.elastic_tips_appeared = 0;
  counters.elastic_points_held = 0;
  counters.elastic_bodies_remade = counters.elastic_bodies_refused = 0;
  counters.elastic_elements_removed = counters.elastic_elements_loose = 0;
  counters.elastic_bodies_restored = counters.elastic_attachments_torn = 0;
  counters.elastic_torn_joule = counters.elastic_cut_joule = 0.0;
  counters.elastic_faces_cut = 0;
  counters.elastic_residual_ratio = 0.0;
  counters.elastic_error_newton = kUnknownNewton;
  for (const auto& tissue : tissues_) {
    const ElasticFigures figures = tissue->figures();
    counters.elastic_solves += figures.solves;
    counters.elastic_solves_skipped += figures.skipped;
    counters.elastic_solves_late += figures.late;
    counters.elastic_solves_failed += figures.failed;
    counters.elastic_solves_repaired += figures.repaired;
    counters.elastic_tips_appeared += figures.appeared;
    counters.elastic_points_held += figures.points_held;
    counters.elastic_bodies_remade += figures.ablation.remade;
    counters.elastic_bodies_refused += figures.ablation.refused;
    counters.elastic_elements_removed += figures.ablation.removed;
    counters.elastic_elements_loose += figures.ablation.loose;
    counters.elastic_bodies_restored += figures.ablation.restored;
    counters.elastic_attachments_torn += figures.torn;
    counters.elastic_torn_joule += figures.torn_joule;
    counters.elastic_faces_cut += figures.ablation.faces_cut;
    counters.elastic_cut_joule += figures.ablation.cut_joule;
    counters.elastic_bounds_checked += figures.bounds_checked;
    counters.elastic_bound_violations += figures.bound_violations;
    counters.elastic_residual_ratio =
        std::max(counters.elastic_residual_ratio, figures.residual_ratio);
    counters.elastic_error_newton = std::fmax(counters.elastic_error_newton, figures.error_newton);
  }
}

void ElasticTissues::count_tool_into(std::size_t tool, PhysicsCounters& counters) const noexcept {
  counters.elastic_steps_skipped = counts_[tool].skipped;
  counters.elastic_bound_newton = counts_[tool].bound_newton;
  counters.elastic_contact_steps = counts_[tool].in_contact;
  counters.elastic_unknown_bound_steps = counts_[tool].without_bound;
  counters.elastic_energised_steps = counts_[tool].energised;
}

}  // namespace palpate::physics
