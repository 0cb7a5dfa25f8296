// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <limits>
#include <set>
#include <string>
#include <utility>

#include "common/session/file/convert.h"
#include "palpate/v1/session.pb.h"

namespace palpate {

namespace {

constexpr std::size_t kLongestBriefing = 1000;
constexpr std::size_t kLongestName = 64;
constexpr double kLeastCoverageRadius_m = 0.005;

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

struct Ball {
  Vector3 center_m = Vector3::Zero();
  double radius_m = 0.0;
};

std::size_t lesions_of(const TissueConfig& tissue) {
  if (const auto* elastic = std::get_if<ElasticMaterial>(&tissue.material)) {
    return elastic->parts.size();
  }
  return std::get<KelvinVoigtMaterial>(tissue.material).inclusions.size();
}

/// @pre  index < lesions_of(tissue)
std::optional<Ball> lesion_of(const TissueConfig& tissue, std::size_t index) {
  if (const auto* elastic = std::get_if<ElasticMaterial>(&tissue.material)) {
    const auto* ball = std::get_if<SphereGeometry>(&elastic->parts[index].where);
    if (ball == nullptr) return std::nullopt;
    return Ball{ball->center_m, ball->radius_m};
  }
  const auto& ball = std::get<KelvinVoigtMaterial>(tissue.material).inclusions[index];
  return Ball{ball.center_m, ball.radius_m};
}

TaskTarget to_target(const Fields& fields, const TissueConfig& tissue, std::size_t index) {
  TaskTarget target;
  target.name = fields.text("name");
  if (target.name.empty()) target.name = "lesion " + std::to_string(index + 1);
  if (target.name.size() > kLongestName || target.name != one_line(target.name)) {
    fields.problem("name", "must be one line of at most 64 bytes");
  }
  target.palpable_newton = fields.number("palpable_newton", kUnknown);
  target.contrast_ratio = fields.number("contrast_ratio", kUnknown);
  if (!fields.has_required("lesion")) return target;
  target.lesion = static_cast<std::uint32_t>(fields.integer("lesion"));
  const std::size_t count = lesions_of(tissue);
  if (target.lesion >= count) {
    fields.problem("lesion", "tissue " + one_line(tissue.name) + " has " + std::to_string(count) +
                                 " parts or inclusions; give one of them, counted from 0");
    return target;
  }
  if (const auto ball = lesion_of(tissue, target.lesion)) {
    target.center_m = ball->center_m;
    target.radius_m = ball->radius_m;
  } else {
    fields.problem("lesion",
                   "must be a ball, whose place and size are known; give its part as "
                   "where { sphere { … } }");
  }
  return target;
}

void add_targets(const Fields& fields, const TissueConfig& tissue, PalpationTask& task) {
  std::set<std::string> names;
  std::set<std::uint32_t> lesions;
  for (const Fields& one : fields.messages("target")) {
    TaskTarget target = to_target(one, tissue, task.targets.size());
    if (!names.insert(target.name).second) {
      one.problem("name", "another target has this name too; give each its own name");
    }
    if (!lesions.insert(target.lesion).second && one.has("lesion")) {
      one.problem("lesion", "another target is this one too; take one of them out");
    }
    task.targets.push_back(std::move(target));
  }
}

std::optional<RegionGeometry> to_area(const Fields& palpation) {
  if (!palpation.has("area")) return std::nullopt;
  const Fields area = palpation.message("area");
  const std::string kind = area.given_member("place");
  if (kind == "tag" || kind == "near") {
    area.problem(kind.c_str(), "an area is given by half_space, sphere or box");
    return std::nullopt;
  }
  return to_region(area);
}

PalpationTask to_palpation(const Fields& fields, const SceneConfig& scene) {
  PalpationTask task;
  task.least_force_newton = fields.number("least_force_newton");
  task.coverage_radius_m =
      fields.number("coverage_radius_m", std::max(scene.tip_radius_m, kLeastCoverageRadius_m));
  task.mark_tolerance_m = fields.number("mark_tolerance_m");
  task.area = to_area(fields);
  if (!fields.has_required("tissue")) return task;
  const std::string name = fields.text("tissue");
  const auto tissue = std::find_if(scene.tissues.begin(), scene.tissues.end(),
                                   [&](const TissueConfig& one) { return one.name == name; });
  if (tissue == scene.tissues.end()) {
    fields.problem("tissue", "the scene has no tissue of this name; give one of scene.tissue");
    return task;
  }
  task.tissue = static_cast<std::uint32_t>(tissue - scene.tissues.begin());
  if (!tissue->motion.amplitude_m.isZero()) {
    fields.problem("tissue", "moves; a tissue that is searched must be at rest, without motion");
  }
  add_targets(fields, *tissue, task);
  return task;
}

}  // namespace

TaskConfig to_task(const Fields& fields, const SceneConfig& scene) {
  TaskConfig task;
  task.briefing = fields.text("briefing");
  if (task.briefing.size() > kLongestBriefing) {
    fields.problem("briefing", "must be at most 1000 bytes; give a shorter text");
  }
  task.is_started_by_person = fields.enumerator("start") == v1::Task::by_person;
  if (fields.has("time_s")) task.time_s = fields.number("time_s");
  if (fields.has("most_force_newton")) {
    task.most_force_newton = fields.number("most_force_newton");
  }
  if (fields.has("mark_button")) {
    task.mark_button = static_cast<std::uint32_t>(fields.integer("mark_button"));
  }
  const std::string kind = fields.given_member("kind");
  if (kind.empty()) {
    fields.problem("a kind is required; give palpation { tissue: … target { … } } or free {}");
  }
  if (kind == "palpation") task.kind = to_palpation(fields.message("palpation"), scene);
  return task;
}

}  // namespace palpate
