// SPDX-License-Identifier: Apache-2.0
// task_support.h — a tip that moves over a plane as a test says, and the score of it.
#pragma once

#include <chrono>
#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/task/evaluator.h"

namespace palpate::test {

inline constexpr double kTip_m = 0.006;
inline constexpr ToolShape kTool{.tip_radius_m = kTip_m};
inline constexpr double kRate_hz = 1000.0;
inline constexpr std::uint64_t kDevice = 77;

/// A plane of 100 × 100 mm around the origin, of 2 · 5² triangles, its normal +z.
inline SceneState plane_scene() {
  constexpr std::uint32_t kCells = 5;
  SceneState scene;
  TissueSurface& tissue = scene.tissues.emplace_back();
  for (std::uint32_t j = 0; j <= kCells; ++j) {
    for (std::uint32_t i = 0; i <= kCells; ++i) {
      tissue.mesh.vertices_m.insert(tissue.mesh.vertices_m.end(),
                                    {0.1F * static_cast<float>(i) / kCells - 0.05F,
                                     0.1F * static_cast<float>(j) / kCells - 0.05F, 0.0F});
    }
  }
  for (std::uint32_t j = 0; j < kCells; ++j) {
    for (std::uint32_t i = 0; i < kCells; ++i) {
      const std::uint32_t at = j * (kCells + 1) + i;
      for (const std::uint32_t index :
           {at, at + 1, at + kCells + 2, at, at + kCells + 2, at + kCells + 1}) {
        tissue.mesh.triangles.push_back(index);
      }
    }
  }
  return scene;
}

/// Where the tip's centre is, and the force on the hand.
struct Tip {
  Vector3 at_m = Vector3(0, 0, kTip_m + 0.01);
  double newton = 0.0;
  std::uint32_t buttons = 0;
  std::optional<GripState> grip{};  // none: mofc_node's part of the tick is missing
};

/// Pressed so deep at a place of the plane.
inline Tip pressed(double x_m, double y_m, double depth_m, double newton) {
  return {.at_m = {x_m, y_m, kTip_m - depth_m}, .newton = newton};
}

inline TickRow row_of(std::uint64_t sequence, const Tip& tip, std::uint64_t device = kDevice) {
  TickRow row;
  row.device_session_id = device;
  row.device.sequence = sequence;
  row.device.sampled_at = TimePoint(from_seconds(100.0 + static_cast<double>(sequence) / kRate_hz));
  row.device.measured_tool_position_world_m = tip.at_m;
  row.device.force_on_hand_newton = {0.0, 0.0, tip.newton};
  row.device.buttons = tip.buttons;
  if (tip.grip) row.mofc.emplace().grip = *tip.grip;
  return row;
}

/// Ticks from 0 s until `end_s`.
inline void run(TaskEvaluator& evaluator, double end_s,
                const std::function<Tip(double t_s)>& tip_at, std::uint64_t first = 0) {
  const auto end = static_cast<std::uint64_t>(std::lround(end_s * kRate_hz));
  for (std::uint64_t i = first; i < end; ++i) {
    evaluator.take(row_of(i, tip_at(static_cast<double>(i) / kRate_hz)));
  }
}

inline TaskScore score_of(const TaskConfig& task, double end_s,
                          const std::function<Tip(double t_s)>& tip_at) {
  TaskEvaluator evaluator(task, kTool);
  evaluator.take(plane_scene());
  run(evaluator, end_s, tip_at);
  evaluator.finish();
  return evaluator.score();
}

/// A search without lesions.
inline TaskConfig search(std::vector<TaskTarget> targets = {}) {
  TaskConfig task;
  task.kind = PalpationTask{.targets = std::move(targets), .coverage_radius_m = 0.005};
  return task;
}

/// 8 mm of radius, 12 mm below the plane, and felt from 2 N on.
inline TaskTarget lump(double x_m = 0.02) {
  return {.name = "lump", .center_m = {x_m, 0.0, -0.02}, .radius_m = 0.008, .palpable_newton = 2.0};
}

inline Marker marker(std::uint64_t at_ns, std::uint64_t sequence,
                     Marker::Kind kind = Marker::Kind::kNote, std::uint64_t device = kDevice) {
  return {.at_ns = at_ns,
          .text = "m",
          .origin = "page",
          .kind = kind,
          .device_session_id = device,
          .device_sequence = sequence};
}

}  // namespace palpate::test
