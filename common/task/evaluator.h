// SPDX-License-Identifier: Apache-2.0
// evaluator.h — scores a task from the telemetry of the device, the surface of the tissue and the
// marks of the person: while the session runs, in lockstep and from a recording, with the same
// result if the same ticks are seen. It observes; nothing of it reaches the hand.
//
// A tick is taken into account up to a second later, so that a mark that arrives after its tick is
// still at its place, and not before the surface has arrived.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "common/core/scene_messages.h"
#include "common/core/tissue.h"
#include "common/session/task_config.h"
#include "common/task/force_figures.h"
#include "common/task/hand_motion.h"
#include "common/task/histogram.h"
#include "common/task/needle_insertion.h"
#include "common/task/score.h"
#include "common/task/searched_surface.h"
#include "common/task/tissue_damage.h"
#include "common/task/traction.h"
#include "common/telemetry/run_messages.h"
#include "common/telemetry/tick_row.h"

namespace palpate {

class TaskEvaluator {
 public:
  struct Options {
    /// Marks and ticks name different processes, as in a replay: only their numbers count.
    bool ignores_sessions = false;
  };

  TaskEvaluator(const TaskConfig& task, const ToolShape& tool, Options options);
  TaskEvaluator(const TaskConfig& task, const ToolShape& tool)
      : TaskEvaluator(task, tool, Options()) {}

  /// Options::ignores_sessions from now on.
  void ignore_sessions() { options_.ignores_sessions = true; }

  /// Rows in order. After the end they change nothing.
  void take(const TickRow& row);
  /// Of a search the first one with triangles counts. @param scene  not one of which lesions are
  /// hidden
  void take(const SceneState& scene);
  /// All markers of the run so far, oldest first, as in RunState.
  void take(const std::vector<Marker>& markers);
  /// Call it at the end of the run: takes what is left into account.
  /// @param is_cut  what came after is missing, as of a recording without its end
  void finish(bool is_cut = false);

  [[nodiscard]] bool has_begun() const { return phase_ != TaskState::Phase::kWaiting; }
  [[nodiscard]] bool has_ended() const { return phase_ == TaskState::Phase::kEnded; }
  /// Complete after the end.
  [[nodiscard]] const TaskScore& score() const { return score_; }
  /// For a page: up to the newest tick, but for the score.
  [[nodiscard]] TaskState state() const;
  /// Whether a part of the surface is to be searched, and where that is.
  [[nodiscard]] bool knows_area() const;
  /// For a page. Before the end it tells what is to be searched, and nothing else.
  [[nodiscard]] TaskMap map() const;

 private:
  struct Sample {
    std::uint64_t session_id = 0;
    std::uint64_t sequence = 0;
    double t_s = 0.0;
    Vector3 tip_m = Vector3::Zero();
    double newton = 0.0;
    std::uint32_t buttons = 0;
    Vector3 shaft = Vector3::UnitZ();  // from the tip to the handle
    std::optional<GripState> grip{};   // none: mofc_node's part of the tick is missing
  };
  struct Touch {
    double t_s = 0.0;
    SearchedSurface::Foot foot{};
  };
  struct Region {
    std::optional<SearchedSurface::Foot> above{};  // of a target: above its centre
    double within_m = 0.0;
    ForceCount forces{};
  };

  void process_due(bool is_last);
  void process(const Sample& sample);
  void apply_markers(const Sample& sample);
  void begin(const Sample& first, std::uint64_t ticks_before);
  void set_time(double time_s, double period_s);
  void end(TaskScore::End how);
  [[nodiscard]] std::uint64_t ticks_since(const Marker& marker, const Sample& sample) const;
  [[nodiscard]] double period_from(const Sample& first) const;
  void mark(double t_s, const std::string& origin);
  [[nodiscard]] bool has_surfaces() const;
  [[nodiscard]] bool is_seen(double t_s) const;
  void mark_find(MarkScore& mark, double t_s);
  void mark_loss_of_resistance(MarkScore& mark);
  void press(const Sample& sample, double elapsed_s);
  [[nodiscard]] static std::optional<double> distance_m(const Region& region,
                                                        const SearchedSurface::Foot& foot);
  [[nodiscard]] double depth_m(const SearchedSurface::Foot& foot, const Vector3& tip_m) const;
  void judge_force(double newton, double elapsed_s);
  void complete_score();
  [[nodiscard]] Traction newest_traction() const;

  /// Null: nothing is looked for.
  [[nodiscard]] const PalpationTask* palpation() const { return task_.palpation(); }
  /// A mark of the person says something.
  [[nodiscard]] bool has_marks() const { return palpation() != nullptr || needle_.has_value(); }

  TaskConfig task_;
  ToolShape tool_;
  Options options_;
  std::unique_ptr<SearchedSurface> surface_;
  std::vector<Region> regions_;  // of the targets, then elsewhere
  std::optional<NeedleInsertion> needle_{};
  std::optional<Traction> traction_{};
  TissueWatch watch_;
  ForceCount forces_;
  Histogram depths_;
  HandMotion motion_;

  std::deque<Sample> pending_;
  std::uint64_t newest_session_ = 0;  // of what was taken
  std::uint64_t newest_sequence_ = 0;
  std::vector<Marker> markers_;  // not applied yet
  std::uint64_t newest_marker_ns_ = 0;
  std::uint32_t notes_waiting_ = 0;  // of these

  TaskState::Phase phase_ = TaskState::Phase::kWaiting;
  TaskScore score_;
  std::optional<Sample> last_;    // processed
  std::set<std::uint64_t> past_;  // sessions of the device before that of last_
  double begin_s_ = 0.0;
  double period_s_ = 0.0;         // of the newest two ticks that follow each other
  std::optional<Touch> touch_;    // newest
  double gap_end_s_ = kNotKnown;  // of the newest gap in the telemetry
  TipFoot foot_;                  // on surface_
  Vector3 searched_m_ = Vector3::Constant(kNotKnown);  // newest place that was searched
};

}  // namespace palpate
