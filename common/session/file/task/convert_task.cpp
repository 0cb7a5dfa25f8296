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

/// The tissue of that name; nullptr: there is none.
const TissueConfig* tissue_of(const SceneConfig& scene, const std::string& name) {
  const auto tissue = std::find_if(scene.tissues.begin(), scene.tissues.end(),
                                   [&](const TissueConfig& one) { return one.name == name; });
  return tissue == scene.tissues.end() ? nullptr : &*tissue;
}

constexpr const char* kNoTissue = "the scene has no tissue of this name; give one of scene.tissue";

PalpationTask to_palpation(const Fields& fields, const SceneConfig& scene) {
  PalpationTask task;
  task.least_force_newton = fields.number("least_force_newton");
  task.coverage_radius_m =
      fields.number("coverage_radius_m", std::max(scene.tip_radius_m, kLeastCoverageRadius_m));
  task.mark_tolerance_m = fields.number("mark_tolerance_m");
  task.area = to_area(fields);
  if (!fields.has_required("tissue")) return task;
  const TissueConfig* tissue = tissue_of(scene, fields.text("tissue"));
  if (tissue == nullptr) {
    fields.problem("tissue", kNoTissue);
    return task;
  }
  task.tissue = static_cast<std::uint32_t>(tissue - scene.tissues.data());
  if (!tissue->motion.amplitude_m.isZero()) {
    fields.problem("tissue", "moves; a tissue that is searched must be at rest, without motion");
  }
  add_targets(fields, *tissue, task);
  return task;
}

/// What is wrong with a tissue as a layer of a needle; "": nothing.
std::string layer_complaint(const TissueConfig* tissue) {
  if (tissue == nullptr) return kNoTissue;
  const auto* material = std::get_if<KelvinVoigtMaterial>(&tissue->material);
  if (material == nullptr || !(material->puncture_newton > 0.0)) {
    return "cannot be punctured; give it kelvin_voigt or hunt_crossley with a puncture_newton";
  }
  if (std::holds_alternative<FileGeometry>(tissue->geometry)) {
    return "must be a half_space, sphere, box or capsule, whose far side is known";
  }
  if (!tissue->motion.amplitude_m.isZero()) {
    return "moves; a layer of a needle must be at rest, without motion";
  }
  return "";
}

void add_layers(const Fields& fields, const SceneConfig& scene, NeedleTask& task) {
  const std::vector<std::string> names = fields.texts("layer");
  if (names.empty()) {
    fields.problem("layer", "required; name the tissues on the way of the needle, from outside");
  }
  for (std::size_t i = 0; i < names.size(); ++i) {
    const TissueConfig* tissue = tissue_of(scene, names[i]);
    std::string complaint = layer_complaint(tissue);
    if (std::find(names.begin(), names.begin() + static_cast<std::ptrdiff_t>(i), names[i]) !=
        names.begin() + static_cast<std::ptrdiff_t>(i)) {
      complaint = "stands here twice; take one of them out";
    }
    if (!complaint.empty()) {
      fields.problem_at("layer", static_cast<int>(i), one_line(names[i]) + ": " + complaint);
      continue;
    }
    task.layers.push_back({.tissue = static_cast<std::uint32_t>(tissue - scene.tissues.data()),
                           .name = tissue->name,
                           .geometry = tissue->geometry,
                           .material = std::get<KelvinVoigtMaterial>(tissue->material)});
  }
}

/// How far along the direction a layer begins, from the origin of W.
double begin_m(const Geometry& geometry, const Vector3& direction) {
  struct Begin {
    Vector3 direction;
    double operator()(const HalfSpaceGeometry& shape) const { return shape.point_m.dot(direction); }
    double operator()(const SphereGeometry& shape) const {
      return shape.center_m.dot(direction) - shape.radius_m;
    }
    double operator()(const BoxGeometry& shape) const {
      return shape.center_m.dot(direction) - 0.5 * shape.size_m.dot(direction.cwiseAbs());
    }
    double operator()(const CapsuleGeometry& shape) const {
      return std::min(shape.from_m.dot(direction), shape.to_m.dot(direction)) - shape.radius_m;
    }
    double operator()(const FileGeometry& /*shape*/) const { return 0.0; }  // is refused
  };
  return std::visit(Begin{direction}, geometry);
}

/// A needle meets the layers one after the other.
void check_order(const Fields& fields, const NeedleTask& task) {
  for (std::size_t i = 0; i < task.layers.size(); ++i) {
    const NeedleLayer& layer = task.layers[i];
    const auto* const half = std::get_if<HalfSpaceGeometry>(&layer.geometry);
    if (half != nullptr && !(half->normal.dot(task.direction) < 0.0)) {
      fields.problem_at("layer", static_cast<int>(i),
                        one_line(layer.name) + ": direction leads out of it; turn it round");
      return;
    }
    if (i == 0) continue;
    const NeedleLayer& before = task.layers[i - 1];
    if (begin_m(layer.geometry, task.direction) < begin_m(before.geometry, task.direction)) {
      fields.problem_at("layer", static_cast<int>(i),
                        one_line(layer.name) + ": begins before " + one_line(before.name) +
                            " on the way along direction; give the layers from outside");
    }
  }
}

NeedleTask to_needle(const Fields& fields, const SceneConfig& scene) {
  NeedleTask task;
  task.direction = fields.direction("direction");
  if (fields.has("most_overshoot_m")) task.most_overshoot_m = fields.number("most_overshoot_m");
  const bool has_membrane = fields.has_required("membrane");
  add_layers(fields, scene, task);
  if (task.layers.size() < fields.texts("layer").size() || task.layers.empty()) return task;
  check_order(fields, task);
  const auto place_of = [&](const std::string& name) {
    return static_cast<std::size_t>(
        std::find_if(task.layers.begin(), task.layers.end(),
                     [&](const NeedleLayer& one) { return one.name == name; }) -
        task.layers.begin());
  };
  const std::size_t membrane = place_of(fields.text("membrane"));
  if (membrane < task.layers.size()) {
    task.membrane = membrane;
    if (std::holds_alternative<HalfSpaceGeometry>(task.layers[membrane].geometry)) {
      fields.problem("membrane", "has no far side; give a sphere, box or capsule");
    }
  } else if (has_membrane) {
    fields.problem("membrane", "is none of the layers; give one of them");
  }
  const std::vector<std::string> spared = fields.texts("spared");
  for (std::size_t i = 0; i < spared.size(); ++i) {
    const std::size_t place = place_of(spared[i]);
    if (place < task.layers.size() && place > task.membrane) {
      task.layers[place].is_spared = true;
    } else {
      fields.problem_at("spared", static_cast<int>(i),
                        one_line(spared[i]) + ": must be a layer behind the membrane");
    }
  }
  return task;
}

TractionTask to_traction(const Fields& fields, const SceneConfig& scene) {
  TractionTask task;
  task.tolerance_m = fields.number("tolerance_m");
  task.hold_s = fields.number("hold_s");
  if (fields.has("target_m")) {
    task.target_m = fields.vector("target_m");
  } else {
    fields.problem("target_m",
                   "required; give the place in W to which the tissue is to be brought");
  }
  if (!scene.gripper) {
    fields.problem("needs a tool that can take hold; give scene { tool { gripper { … } } }");
  }
  const bool has_elastic =
      std::any_of(scene.tissues.begin(), scene.tissues.end(), [](const TissueConfig& one) {
        return std::holds_alternative<ElasticMaterial>(one.material);
      });
  if (!has_elastic) {
    fields.problem("needs tissue that can be held; give a tissue of the scene elastic { … }");
  }
  return task;
}

void add_limits(const Fields& fields, const SceneConfig& scene, TaskConfig& task) {
  for (const Fields& one : fields.messages("tissue_limit")) {
    TissueLimit limit{.most_force_newton = one.number("most_force_newton", kUnknown)};
    static_cast<void>(one.has_required("most_force_newton"));
    if (one.has("most_damage_newton_s")) {
      limit.most_damage_newton_s = one.number("most_damage_newton_s");
    }
    if (!one.has_required("tissue")) continue;
    limit.name = one.text("tissue");
    const TissueConfig* tissue = tissue_of(scene, limit.name);
    if (tissue == nullptr) {
      one.problem("tissue", kNoTissue);
      continue;
    }
    if (!tissue->motion.amplitude_m.isZero()) {
      one.problem("tissue", "moves; a tissue with a limit must be at rest, without motion");
    }
    limit.tissue = static_cast<std::size_t>(tissue - scene.tissues.data());
    if (std::any_of(task.tissue_limits.begin(), task.tissue_limits.end(),
                    [&](const TissueLimit& other) { return other.tissue == limit.tissue; })) {
      one.problem("tissue", "has a limit already; give one for each tissue");
    }
    task.tissue_limits.push_back(std::move(limit));
  }
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
  add_limits(fields, scene, task);
  if (fields.has("mark_button")) {
    task.mark_button = static_cast<std::uint32_t>(fields.integer("mark_button"));
  }
  const std::string kind = fields.given_member("kind");
  if (kind.empty()) {
    fields.problem(
        "a kind is required; give palpation { tissue: … target { … } }, needle { layer: "
        "… membrane: … }, traction { target_m { … } } or free {}");
  }
  if (kind == "palpation") task.kind = to_palpation(fields.message("palpation"), scene);
  if (kind == "needle") task.kind = to_needle(fields.message("needle"), scene);
  if (kind == "traction") {
    task.kind = to_traction(fields.message("traction"), scene);
    if (task.mark_button) {
      fields.problem("mark_button", "marks nothing with traction; leave it out");
    }
  }
  return task;
}

}  // namespace palpate
