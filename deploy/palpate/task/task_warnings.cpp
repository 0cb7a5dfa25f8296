// SPDX-License-Identifier: Apache-2.0
#include "deploy/palpate/task/task_warnings.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <limits>
#include <variant>

#include "common/task/searched_surface.h"
#include "physics_node/display/display_mesh.h"
#include "physics_node/files/surface_files.h"

namespace palpate {
namespace {

constexpr double kFarthestPull_m = 0.1;  // from the surface: more than tissue stretches

void examine_target(const PalpationTask& task, const TaskTarget& target,
                    const physics::Shape& shape, std::vector<std::string>& warnings) {
  const SurfaceView view = shape.view(target.center_m);
  const auto warn = [&](const std::string& what) {
    warnings.push_back(fmt::format("task: target \"{}\": {}", target.name, what));
  };
  if (view.distance_m > 0.0) {
    warn(fmt::format(
        "the centre of its lesion lies {:.2g} mm outside the tissue; nobody can feel it there: "
        "give another centre, in metres in W",
        1e3 * view.distance_m));
    return;
  }
  const Vector3 above_m = target.center_m - view.distance_m * view.normal;
  if (!task.area || contains(*task.area, above_m)) return;
  warn(fmt::format(
      "the place on the surface above it, ({:.4g}, {:.4g}, {:.4g}) m, is not in the area that is "
      "searched; make task.palpation.area larger, or move the lesion",
      above_m.x(), above_m.y(), above_m.z()));
}

void examine(const PalpationTask& task, const Session& session,
             std::vector<std::string>& warnings) {
  const TissueConfig& tissue = session.scene.tissues[task.tissue];
  const physics::Shape shape = physics::to_shape(tissue.geometry);
  if (shape.is_sheet()) return;  // has no inside
  for (const TaskTarget& target : task.targets) examine_target(task, target, shape, warnings);
  if (!task.area) return;
  const SearchedSurface surface(physics::display_mesh(shape, physics::display_area_of(session)),
                                task.area, task.coverage_radius_m);
  if (surface.area_m2() > 0.0) return;
  warnings.push_back(
      fmt::format("task.palpation.area: contains nothing of the surface of tissue \"{}\": what was "
                  "searched cannot be told; give a place in metres in W that does",
                  tissue.name));
}

void examine(const TractionTask& task, const Session& session, std::vector<std::string>& warnings) {
  double nearest_m = std::numeric_limits<double>::infinity();
  for (const TissueConfig& tissue : session.scene.tissues) {
    if (!std::holds_alternative<ElasticMaterial>(tissue.material)) continue;
    const physics::Shape shape = physics::to_shape(tissue.geometry);
    nearest_m = std::min(nearest_m, shape.view(task.target_m).distance_m);
  }
  if (nearest_m <= kFarthestPull_m) return;
  warnings.push_back(
      fmt::format("task.traction.target_m: is {:.3g} m from the tissue that can be held; no tissue "
                  "comes as far: give a place in metres in W",
                  nearest_m));
}

}  // namespace

std::vector<std::string> task_warnings(const Session& session) {
  std::vector<std::string> warnings;
  if (!session.task || !session.physics_command.empty()) return warnings;
  if (const PalpationTask* palpation = session.task->palpation()) {
    examine(*palpation, session, warnings);
  } else if (const TractionTask* traction = session.task->traction()) {
    examine(*traction, session, warnings);
  }
  return warnings;
}

}  // namespace palpate
