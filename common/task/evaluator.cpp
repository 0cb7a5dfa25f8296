// SPDX-License-Identifier: Apache-2.0
#include "common/task/evaluator.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate {
namespace {

constexpr double kLag_s = 1.0;           // of a tick, for marks that arrive late
constexpr double kSurfaceWait_s = 10.0;  // then it is scored without a surface
constexpr double kTouch_newton = 0.05;   // a smaller force is no touch: the floor of the force JND
constexpr double kMarkMemory_s = 3.0;  // a mark is where the tip has touched last, within this time
constexpr double kGap_s = 0.1;         // of the telemetry: what the hand did in it is not known
constexpr double kSameFoot_m = 1e-4;   // a place so near is searched already

constexpr double kDepthBin_m = 2e-5;
constexpr std::size_t kDepthBins = 5'000;

TaskState::Kind kind_of(const TaskConfig& task) {
  if (task.palpation() != nullptr) return TaskState::Kind::kPalpation;
  if (task.traction() != nullptr) return TaskState::Kind::kTraction;
  return task.needle() != nullptr ? TaskState::Kind::kNeedle : TaskState::Kind::kFree;
}

}  // namespace

TaskEvaluator::TaskEvaluator(const TaskConfig& task, const ToolShape& tool, Options options)
    : task_(task),
      tool_(tool),
      options_(options),
      watch_(task.tissue_limits, tool.tip_radius_m),
      depths_(kDepthBin_m, kDepthBins),
      foot_(tool.tip_radius_m) {
  score_.kind = kind_of(task_);
  score_.limit_s = task_.time_s.value_or(kNotKnown);
  score_.most_force_newton = task_.most_force_newton.value_or(kNotKnown);
  if (task_.most_force_newton) {
    score_.overshoot_newton = score_.beyond_s = score_.damage_newton_s = 0.0;
  }
  if (const NeedleTask* needle = task_.needle()) needle_.emplace(*needle, tool);
  if (const TractionTask* traction = task.traction()) traction_.emplace(*traction);
  if (palpation() == nullptr) return;
  score_.least_force_newton = palpation()->least_force_newton;
  for (const TaskTarget& target : palpation()->targets) {
    score_.targets.push_back({.name = target.name,
                              .palpable_newton = target.palpable_newton,
                              .contrast_ratio = target.contrast_ratio});
    regions_.push_back({.within_m = std::max(target.radius_m, palpation()->coverage_radius_m)});
  }
  regions_.emplace_back();
}

void TaskEvaluator::take(const SceneState& scene) {
  if (needle_) needle_->take(scene);
  watch_.take(scene);
  if (surface_ || palpation() == nullptr || palpation()->tissue >= scene.tissues.size()) return;
  const auto& mesh = scene.tissues[palpation()->tissue].mesh;
  auto surface =
      std::make_unique<SearchedSurface>(mesh, palpation()->area, palpation()->coverage_radius_m);
  score_.is_area_empty = !mesh.triangles.empty() && !(surface->area_m2() > 0.0);
  if (surface->empty()) return;
  surface_ = std::move(surface);
  score_.area_m2 = surface_->area_m2();
  for (std::size_t i = 0; i < palpation()->targets.size(); ++i) {
    const TaskTarget& target = palpation()->targets[i];
    regions_[i].above = surface_->foot_of(target.center_m, SearchedSurface::kFar_m);
  }
}

void TaskEvaluator::take(const std::vector<Marker>& markers) {
  for (const Marker& marker : markers) {
    if (marker.at_ns <= newest_marker_ns_) continue;
    newest_marker_ns_ = marker.at_ns;
    markers_.push_back(marker);
    if (marker.kind == Marker::Kind::kNote) ++notes_waiting_;
  }
  process_due(false);
}

void TaskEvaluator::take(const TickRow& row) {
  if (has_ended()) return;
  const DeviceTick& tick = row.device;
  const bool is_same = row.device_session_id == newest_session_;
  if (is_same && tick.sequence <= newest_sequence_) return;
  newest_session_ = row.device_session_id;
  newest_sequence_ = tick.sequence;
  pending_.push_back({.session_id = row.device_session_id,
                      .sequence = tick.sequence,
                      .t_s = to_seconds(tick.sampled_at.time_since_epoch()),
                      .tip_m = tick.measured_tool_position_world_m,
                      .newton = tick.force_on_hand_newton.norm(),
                      .buttons = tick.buttons,
                      .shaft = tick.measured_tool_orientation_world * Vector3::UnitZ(),
                      .grip = row.mofc ? std::optional(row.mofc->grip) : std::nullopt});
  process_due(false);
}

void TaskEvaluator::finish(bool is_cut) {
  process_due(true);
  score_.is_cut = is_cut && phase_ != TaskState::Phase::kEnded;
  if (phase_ == TaskState::Phase::kRunning) end(TaskScore::End::kRunEnded);
  phase_ = TaskState::Phase::kEnded;
}

void TaskEvaluator::process_due(bool is_last) {
  // a stop needs no patience: every mark before it has arrived with it
  const bool has_stop = std::any_of(markers_.begin(), markers_.end(), [](const Marker& one) {
    return one.kind == Marker::Kind::kTaskStop;
  });
  while (!pending_.empty() && !has_ended()) {
    const bool has_period = last_ || pending_.size() > 1;  // of who comes after the start
    const double waited_s = pending_.back().t_s - pending_.front().t_s;
    const bool is_known = has_surfaces() || waited_s > kSurfaceWait_s;
    const bool is_due =
        is_last || (is_known && ((has_stop && has_period) || std::abs(waited_s) > kLag_s));
    if (!is_due) return;
    process(pending_.front());
    if (!pending_.empty()) pending_.pop_front();
  }
}

/// Of all that is judged by where the tip is on it.
bool TaskEvaluator::has_surfaces() const {
  return (palpation() == nullptr || surface_) && watch_.has_all();
}

void TaskEvaluator::process(const Sample& sample) {
  if (last_ && last_->session_id != sample.session_id) {
    past_.insert(last_->session_id);
    if (needle_) needle_->reset();
    if (traction_) traction_->reset();
    if (phase_ == TaskState::Phase::kRunning) ++score_.device_restarts;
  }
  if (needle_) {
    needle_->follow({.tip_m = sample.tip_m, .shaft = sample.shaft, .time_s = sample.t_s});
  }
  if (traction_) traction_->follow(sample.grip, sample.tip_m);
  if (phase_ == TaskState::Phase::kWaiting && !task_.is_started_by_person) {
    begin(sample, sample.sequence);  // the device counts from 0
  }
  const bool follows = last_ && last_->session_id == sample.session_id;
  const double gap_s = last_ ? std::abs(sample.t_s - last_->t_s)
                             : static_cast<double>(sample.sequence) * period_from(sample);
  if (gap_s > kGap_s) gap_end_s_ = sample.t_s;
  if (surface_) foot_.follow(*surface_, sample.tip_m, sample.newton >= kTouch_newton);
  apply_markers(sample);
  if (phase_ != TaskState::Phase::kRunning) {
    last_ = sample;
    return;
  }
  if (task_.time_s && sample.t_s - begin_s_ >= *task_.time_s) {
    set_time(*task_.time_s, period_from(sample));
    end(TaskScore::End::kTimeUp);
    return;
  }
  double elapsed_s = period_s_;
  if (follows && score_.ticks > 0) {
    const std::uint64_t missing = sample.sequence - last_->sequence - 1;
    score_.missing_ticks += missing;
    if (missing == 0) elapsed_s = period_s_ = sample.t_s - last_->t_s;
  }
  ++score_.ticks;
  score_.time_s = sample.t_s - begin_s_;
  score_.trace.add(score_.time_s, sample.newton);
  motion_.add(sample.t_s, sample.tip_m);
  if (needle_) {
    const double newton = sample.newton >= kTouch_newton ? sample.newton : 0.0;
    needle_->count(score_.time_s, newton, elapsed_s);
  }
  if (traction_) traction_->count(score_.time_s, sample.newton, elapsed_s);
  if (sample.newton >= kTouch_newton) {
    press(sample, elapsed_s);
    watch_.count(sample.tip_m, sample.newton, elapsed_s);
  }
  judge_force(sample.newton, elapsed_s);
  if (has_marks() && task_.mark_button) {
    const std::uint32_t bit = 1U << *task_.mark_button;
    const bool was_held = last_ && (last_->buttons & bit) != 0;
    if ((sample.buttons & bit) != 0 && !was_held) mark(sample.t_s, "button");
  }
  last_ = sample;
}

/// Those that were set before this tick.
void TaskEvaluator::apply_markers(const Sample& sample) {
  const auto is_past = [&](const Marker& marker) {
    if (marker.device_session_id == 0) return true;
    if (marker.device_session_id == sample.session_id || options_.ignores_sessions) {
      return marker.device_sequence < sample.sequence;
    }
    return past_.contains(marker.device_session_id);
  };
  while (!markers_.empty() && is_past(markers_.front())) {
    const Marker marker = markers_.front();
    markers_.erase(markers_.begin());
    switch (marker.kind) {
      case Marker::Kind::kNote:
        --notes_waiting_;
        if (phase_ == TaskState::Phase::kRunning && has_marks()) {
          const std::uint64_t ago = ticks_since(marker, sample);
          const bool is_unseen = ago > 0 && (!last_ || last_->session_id != sample.session_id);
          const double t_s = last_ ? last_->t_s : sample.t_s;
          mark(is_unseen ? sample.t_s - static_cast<double>(ago) * period_from(sample) : t_s,
               marker.origin);
        }
        break;
      case Marker::Kind::kTaskStart:
        if (phase_ == TaskState::Phase::kWaiting) {
          const std::uint64_t ago = ticks_since(marker, sample);
          begin(sample, ago > 0 ? ago - 1 : 0);
        }
        break;
      case Marker::Kind::kTaskStop:
        if (phase_ == TaskState::Phase::kRunning) {
          if (const std::uint64_t ago = ticks_since(marker, sample); score_.ticks == 0 && ago > 0) {
            const double period_s = period_from(sample);
            set_time(sample.t_s - static_cast<double>(ago - 1) * period_s - begin_s_, period_s);
          }
          end(TaskScore::End::kStopped);
          return;
        }
        break;
    }
  }
}

/// How many ticks of the device a marker was set before this one; 0: of another process.
std::uint64_t TaskEvaluator::ticks_since(const Marker& marker, const Sample& sample) const {
  const bool is_same = marker.device_session_id != 0 &&
                       (options_.ignores_sessions || marker.device_session_id == sample.session_id);
  return is_same && marker.device_sequence < sample.sequence
             ? sample.sequence - marker.device_sequence
             : 0;
}

/// Of the ticks from this one on; 0 if no other has arrived.
double TaskEvaluator::period_from(const Sample& first) const {
  const Sample& newest = pending_.back();
  if (newest.session_id != first.session_id || newest.sequence <= first.sequence) return 0.0;
  return (newest.t_s - first.t_s) / static_cast<double>(newest.sequence - first.sequence);
}

/// @param ticks_before  of the task before its first one that was received
void TaskEvaluator::begin(const Sample& first, std::uint64_t ticks_before) {
  phase_ = TaskState::Phase::kRunning;
  score_.end = TaskScore::End::kRunning;
  begin_s_ = first.t_s - static_cast<double>(ticks_before) * period_from(first);
  score_.missing_ticks = ticks_before;
}

/// Of a task that ends: the ticks of one that was over before the first that was received are
/// missing.
void TaskEvaluator::set_time(double time_s, double period_s) {
  score_.time_s = time_s;
  if (score_.ticks > 0 || !(period_s > 0.0)) return;
  score_.missing_ticks = static_cast<std::uint64_t>(std::llround(time_s / period_s));
}

void TaskEvaluator::end(TaskScore::End how) {
  phase_ = TaskState::Phase::kEnded;
  score_.end = how;
  complete_score();
}

double TaskEvaluator::depth_m(const SearchedSurface::Foot& foot, const Vector3& tip_m) const {
  const Vector3 from_foot_m = tip_m - foot.point_m;
  const double height_m = foot.normal.dot(from_foot_m);
  // beside an edge the nearest place is not below
  return std::max(0.0, tool_.tip_radius_m - (height_m > 0.0 ? from_foot_m.norm() : height_m));
}

/// From the place above a target; none: it has none, or that is on another side of the tissue.
std::optional<double> TaskEvaluator::distance_m(const Region& region,
                                                const SearchedSurface::Foot& foot) {
  if (!region.above || !SearchedSurface::is_same_side(region.above->normal, foot.normal)) {
    return std::nullopt;
  }
  return (foot.point_m - region.above->point_m).norm();
}

/// @param elapsed_s  that the tick stands for
void TaskEvaluator::press(const Sample& sample, double elapsed_s) {
  forces_.add(sample.newton, elapsed_s);
  if (!surface_ || !foot_.foot()) return;
  const SearchedSurface::Foot& foot = *foot_.foot();
  touch_ = Touch{sample.t_s, foot};
  depths_.add(depth_m(foot, sample.tip_m));
  const bool is_elsewhere_now = !((foot.point_m - searched_m_).norm() < kSameFoot_m);
  if (sample.newton >= palpation()->least_force_newton && is_elsewhere_now) {
    surface_->search(foot.point_m, foot.normal);
    searched_m_ = foot.point_m;
  }
  bool is_over = false;
  for (Region& region : regions_) {
    const bool is_elsewhere = &region == &regions_.back();
    const bool is_here =
        is_elsewhere ? !is_over : distance_m(region, foot).value_or(kNotKnown) <= region.within_m;
    if (!is_here) continue;
    is_over = true;
    region.forces.add(sample.newton, elapsed_s);
  }
}

void TaskEvaluator::judge_force(double newton, double elapsed_s) {
  if (!task_.most_force_newton) return;
  const double beyond_newton = newton - *task_.most_force_newton;
  if (!(beyond_newton > 0.0)) return;
  score_.overshoot_newton = std::max(score_.overshoot_newton, beyond_newton);
  score_.beyond_s += elapsed_s;
  score_.damage_newton_s += beyond_newton * elapsed_s;
}

void TaskEvaluator::mark(double t_s, const std::string& origin) {
  MarkScore mark{.t_s = t_s - begin_s_, .origin = origin};
  if (!is_seen(t_s)) {
    mark.outcome = MarkScore::Outcome::kNotSeen;
  } else if (needle_) {
    mark_loss_of_resistance(mark);
  } else {
    mark_find(mark, t_s);
  }
  score_.marks.push_back(std::move(mark));
}

/// Whether the telemetry shows what a mark is about.
bool TaskEvaluator::is_seen(double t_s) const {
  if (needle_) return !(t_s < gap_end_s_);
  const bool has_place = touch_ && std::abs(t_s - touch_->t_s) <= kMarkMemory_s;
  return has_place || !(t_s - gap_end_s_ <= kMarkMemory_s);
}

void TaskEvaluator::mark_loss_of_resistance(MarkScore& mark) {
  switch (needle_->mark(mark.t_s)) {
    case NeedleInsertion::Mark::kTooEarly:
      mark.outcome = MarkScore::Outcome::kFalseAlarm;
      return;
    case NeedleInsertion::Mark::kFirst:
      mark.outcome = MarkScore::Outcome::kFind;
      break;
    case NeedleInsertion::Mark::kRepeated:
      mark.outcome = MarkScore::Outcome::kRepeated;
      break;
  }
  const NeedleScore& score = needle_->score();
  mark.target = score.layers[score.membrane].name;
}

/// @param t_s  of the sample
void TaskEvaluator::mark_find(MarkScore& mark, double t_s) {
  const bool has_place = touch_ && t_s - touch_->t_s <= kMarkMemory_s;
  const auto can_be_felt = [&](std::size_t i) {
    const double palpable_newton = score_.targets[i].palpable_newton;
    return !std::isfinite(palpable_newton) || regions_[i].forces.most_newton() >= palpable_newton;
  };
  // of lesions that overlap one that this mark can find, then one that is found, then one that was
  // not felt; of those the nearest
  const auto rank = [&](std::size_t i) {
    const bool is_found = score_.targets[i].outcome == TargetScore::Outcome::kFound;
    return is_found ? 1 : can_be_felt(i) ? 0 : 2;
  };
  std::size_t best = score_.targets.size();
  double best_m = 0.0;
  for (std::size_t i = 0; has_place && i < score_.targets.size(); ++i) {
    const auto away_m = distance_m(regions_[i], touch_->foot);
    if (!away_m || *away_m > palpation()->targets[i].radius_m + palpation()->mark_tolerance_m) {
      continue;
    }
    if (best < score_.targets.size() &&
        std::pair(rank(i), *away_m) >= std::pair(rank(best), best_m)) {
      continue;
    }
    best = i;
    best_m = *away_m;
  }
  mark.is_in_air = !has_place;
  if (best == score_.targets.size()) return;
  TargetScore& target = score_.targets[best];
  mark.target = target.name;
  if (target.outcome == TargetScore::Outcome::kFound) {
    mark.outcome = MarkScore::Outcome::kRepeated;
  } else if (can_be_felt(best)) {
    mark.outcome = MarkScore::Outcome::kFind;
    target.outcome = TargetScore::Outcome::kFound;
    target.found_after_s = mark.t_s;
    target.mark_distance_m = best_m;
  } else {
    mark.outcome = MarkScore::Outcome::kGuess;
    target.outcome = TargetScore::Outcome::kGuessed;
    target.guess_newton = regions_[best].forces.most_newton();
  }
}

void TaskEvaluator::complete_score() {
  motion_.finish();
  score_.path_m = motion_.path_m();
  score_.smoothness = motion_.log_dimensionless_jerk();
  score_.force = forces_.figures();
  if (needle_) {
    needle_->finish();
    score_.needle = needle_->score();
  }
  if (traction_) score_.traction = traction_->score();
  score_.tissues = watch_.figures();
  if (palpation() == nullptr) return;
  for (std::size_t i = 0; i < score_.targets.size(); ++i) {
    score_.targets[i].force = regions_[i].forces.figures();
  }
  score_.elsewhere = regions_.back().forces.figures();
  if (!surface_) return;
  score_.coverage_ratio = surface_->searched_ratio();
  score_.depth_p95_m = depths_.quantile(0.95);
  score_.depth_most_m = depths_.max();
}

bool TaskEvaluator::knows_area() const {
  return surface_ && palpation()->area && surface_->area_m2() > 0.0;
}

TaskMap TaskEvaluator::map() const {
  const PalpationTask* search = palpation();
  TaskMap map = surface_ && search != nullptr ? surface_->map(TaskMap::kMostPlaces) : TaskMap();
  if (!has_ended()) {
    map.is_searched.clear();
    return map;
  }
  for (std::size_t i = 0; search != nullptr && i < search->targets.size(); ++i) {
    const TaskTarget& target = search->targets[i];
    map.lesions.push_back({.name = target.name,
                           .center_m = target.center_m,
                           .radius_m = target.radius_m,
                           .is_found = score_.targets[i].outcome == TargetScore::Outcome::kFound});
  }
  map.slot_s = score_.trace.slot_s;
  map.most_newton = score_.trace.most_newton;
  for (const MarkScore& mark : score_.marks) map.marks_s.push_back(mark.t_s);
  if (task_.most_force_newton) map.limit_newton = *task_.most_force_newton;
  return map;
}

/// With the ticks that still wait for late marks, which change nothing of it.
Traction TaskEvaluator::newest_traction() const {
  Traction newest = *traction_;
  if (has_ended()) return newest;
  const Sample* before = last_ ? &*last_ : nullptr;
  for (const Sample& sample : pending_) {
    if (before != nullptr && before->session_id != sample.session_id) newest.reset();
    newest.follow(sample.grip, sample.tip_m);
    const double time_s = sample.t_s - begin_s_;
    if (task_.time_s && time_s >= *task_.time_s) break;
    const bool follows = before != nullptr && before->session_id == sample.session_id &&
                         sample.sequence == before->sequence + 1;
    if (phase_ == TaskState::Phase::kRunning) {
      newest.count(time_s, sample.newton, follows ? sample.t_s - before->t_s : period_s_);
    }
    before = &sample;
  }
  return newest;
}

TaskState TaskEvaluator::state() const {
  TaskState state{.phase = phase_,
                  .briefing = task_.briefing,
                  .kind = score_.kind,
                  .time_s = task_.time_s.value_or(0.0)};
  if (score_.end == TaskScore::End::kRunning) {
    const double newest_s = pending_.empty() ? begin_s_ + score_.time_s : pending_.back().t_s;
    state.elapsed_s = std::min(newest_s - begin_s_, task_.time_s.value_or(newest_s - begin_s_));
  } else {
    state.elapsed_s = score_.time_s;
  }
  state.is_started_by_person = task_.is_started_by_person;
  state.marks = static_cast<std::uint32_t>(score_.marks.size());
  if (phase_ == TaskState::Phase::kRunning) state.marks += notes_waiting_;
  if (traction_) state.traction = newest_traction().state();
  if (!has_ended()) return state;
  state.findings = findings_of(score_);
  state.figures = figures_of(score_);
  return state;
}

}  // namespace palpate
