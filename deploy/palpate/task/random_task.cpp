// SPDX-License-Identifier: Apache-2.0
#include "deploy/palpate/task/random_task.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <variant>

#include "common/core/check.h"
#include "common/core/random.h"
#include "deploy/lockstep/lockstep_recorder.h"
#include "deploy/palpate/task/contrast.h"
#include "physics_node/elastic_tissue/elastic_body.h"

namespace palpate {
namespace {

constexpr double kUnlimited_newton = 5.0;
constexpr int kMostTries = 2000;
constexpr int kMostDraws = 20;             // of lesions that can be felt
constexpr double kWall_m = 0.002;          // of the body around a lesion
constexpr std::size_t kLeastElements = 4;  // of the mesh in a lesion: fewer have no shape
constexpr double kWaiting_m = 0.02;        // of a hand, above the surface
constexpr double kDeepest_m = 0.02;        // of a press

// of the simulated search
constexpr double kClear_m = 0.006;  // of the tip above the surface, between two presses
constexpr double kMove_s = 0.25;
constexpr double kPress_s = 0.5;
constexpr double kHold_s = 0.4;
constexpr double kLift_s = 0.25;
constexpr double kButton_s = 0.1;

std::string refusal(const Session& session, const std::string& what) {
  return session.file + ": " + what;
}

std::size_t elements_in(const elastic::Mesh& mesh, const Vector3& center_m, double radius_m) {
  std::size_t count = 0;
  for (std::size_t e = 0; e < mesh.element_count(); ++e) {
    Vector3 centroid_m = Vector3::Zero();
    for (int corner = 0; corner < 4; ++corner) {
      centroid_m += 0.25 * mesh.nodes_m[mesh.element(e)[static_cast<std::size_t>(corner)]];
    }
    if ((centroid_m - center_m).norm() <= radius_m) ++count;
  }
  return count;
}

}  // namespace

RandomTask::RandomTask(const Session& session) : session_(session) {
  task_ = session.task ? session.task->palpation() : nullptr;
  if (task_ == nullptr) {
    throw SetupError(refusal(session,
                             "has no task { palpation { … } }; give one that names the "
                             "tissue to search"));
  }
  const auto* material = std::get_if<ElasticMaterial>(&tissue().material);
  if (material == nullptr) {
    throw SetupError(refusal(session,
                             "task.palpation.tissue: lesions are placed in an elastic "
                             "body only; name a tissue with elastic { … }"));
  }
  if (!task_->targets.empty()) {
    throw SetupError(refusal(session, "has targets already; take task.palpation.target out of it"));
  }
  const SurfaceMesh mesh = lockstep_scene(session).tissues.at(task_->tissue).mesh;
  double area_m2 = 0.0;
  for (std::size_t i = 0; i + 2 < mesh.triangles.size(); i += 3) {
    const std::array<Vector3, 3> corners{mesh.vertex_m(mesh.triangles[i]),
                                         mesh.vertex_m(mesh.triangles[i + 1]),
                                         mesh.vertex_m(mesh.triangles[i + 2])};
    area_m2 += 0.5 * (corners[1] - corners[0]).cross(corners[2] - corners[0]).norm();
    triangles_.push_back(corners);
    area_until_m2_.push_back(area_m2);
  }
}

Vector3 RandomTask::rest_m() const {
  Vector3 low_m = Vector3::Constant(std::numeric_limits<double>::infinity());
  Vector3 high_m = -low_m;
  for (const auto& corners : triangles_) {
    for (const Vector3& corner_m : corners) {
      low_m = low_m.cwiseMin(corner_m);
      high_m = high_m.cwiseMax(corner_m);
    }
  }
  Vector3 tool_m = 0.5 * (low_m + high_m);
  tool_m.z() = high_m.z() + session_.scene.tip_radius_m + kWaiting_m;
  const WorkspaceConfig& workspace = session_.side().device.workspace;
  return (tool_m - workspace.offset_m) / workspace.scale_ratio;
}

const TissueConfig& RandomTask::tissue() const { return session_.scene.tissues[task_->tissue]; }

double RandomTask::most_newton() const {
  return session_.task->most_force_newton.value_or(kUnlimited_newton);
}

TissueConfig RandomTask::tissue_with(const std::vector<Lesion>& lesions) const {
  TissueConfig with = tissue();
  auto& material = std::get<ElasticMaterial>(with.material);
  for (const Lesion& lesion : lesions) {
    material.parts.push_back(
        {.where = SphereGeometry{.center_m = lesion.center_m, .radius_m = lesion.radius_m},
         .young_pa = lesion.young_pa,
         .poisson_ratio = material.poisson_ratio,
         .density_kg_per_m3 = material.density_kg_per_m3});
  }
  return with;
}

std::vector<Lesion> RandomTask::lesions(const LesionRanges& ranges, std::uint64_t seed) const {
  Random random(seed);
  const auto body =
      physics::make_elastic_body(tissue(), task_->tissue, session_.scene.tip_radius_m);
  for (int draws = 0; draws < kMostDraws; ++draws) {
    std::vector<Lesion> lesions = placed(ranges, *body, random, seed);
    predict(lesions);
    const bool can_be_felt = std::all_of(lesions.begin(), lesions.end(), [](const Lesion& one) {
      return std::isfinite(one.palpable_newton);
    });
    if (can_be_felt) return lesions;
  }
  throw SetupError(refusal(
      session_, fmt::format("such lesions cannot be felt with {:.1f} N; give stiffer, larger or "
                            "less deep ones, or a larger task.most_force_newton",
                            most_newton())));
}

std::vector<Lesion> RandomTask::placed(const LesionRanges& ranges, const physics::ElasticBody& body,
                                       Random& random, std::uint64_t seed) const {
  const double young_pa = std::get<ElasticMaterial>(tissue().material).young_pa;
  const auto in = [&](const Range& range) { return random.uniform(range[0], range[1]); };
  const std::uint64_t count = ranges.count[0] + random.below(ranges.count[1] - ranges.count[0] + 1);
  std::vector<Lesion> lesions;
  for (int tries = 0; lesions.size() < count; ++tries) {
    if (tries == kMostTries) {
      throw SetupError(refusal(
          session_,
          fmt::format(
              "has no room for {} such lesions of seed {}; give fewer, smaller or less deep "
              "ones, a larger task.palpation.area, or a finer mesh",
              count, seed)));
    }
    const auto found = std::upper_bound(area_until_m2_.begin(), area_until_m2_.end(),
                                        random.uniform() * area_until_m2_.back());
    const auto& corners = triangles_[static_cast<std::size_t>(std::min<std::ptrdiff_t>(
        found - area_until_m2_.begin(), static_cast<std::ptrdiff_t>(triangles_.size()) - 1))];
    double a = random.uniform();
    double b = random.uniform();
    if (a + b > 1.0) {
      a = 1.0 - a;
      b = 1.0 - b;
    }
    const Vector3 normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalized();
    Lesion lesion{
        .radius_m = in(ranges.radius_m),
        .depth_m = in(ranges.depth_m),
        .young_pa = young_pa * in(ranges.stiffness_ratio),
        .above_m = corners[0] + a * (corners[1] - corners[0]) + b * (corners[2] - corners[0])};
    lesion.center_m = lesion.above_m - (lesion.depth_m + lesion.radius_m) * normal;
    if (task_->area && !contains(*task_->area, lesion.above_m)) continue;
    const double inside_m = -body.shape.view(lesion.center_m).distance_m;
    if (inside_m < lesion.radius_m + std::min(lesion.depth_m, kWall_m)) continue;
    if (elements_in(body.body->mesh(), lesion.center_m, lesion.radius_m) < kLeastElements) continue;
    const bool is_apart = std::all_of(lesions.begin(), lesions.end(), [&](const Lesion& other) {
      const double least_m = other.radius_m + lesion.radius_m + 2.0 * task_->mark_tolerance_m;
      return (other.center_m - lesion.center_m).norm() > least_m;
    });
    if (is_apart) lesions.push_back(lesion);
  }
  return lesions;
}

/// Each lesion against the body without it.
void RandomTask::predict(std::vector<Lesion>& lesions) const {
  const double tip_m = session_.scene.tip_radius_m;
  if (lesions.empty()) return;
  const auto with = physics::make_elastic_body(tissue_with(lesions), task_->tissue, tip_m);
  for (std::size_t i = 0; i < lesions.size(); ++i) {
    Lesion& lesion = lesions[i];
    std::vector<Lesion> others = lesions;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
    const auto without = physics::make_elastic_body(tissue_with(others), task_->tissue, tip_m);
    const Vector3 normal = (lesion.above_m - lesion.center_m).normalized();
    const auto curve = [&](const physics::ElasticBody& body) {
      return press_curve(body, tip_m, lesion.above_m, normal, most_newton(), kDeepest_m);
    };
    const Contrast contrast = contrast_of(curve(*with), curve(*without));
    lesion.palpable_newton = contrast.palpable_newton;
    lesion.contrast_ratio = contrast.ratio;
  }
}

std::vector<std::string> RandomTask::fields_of(const std::vector<Lesion>& lesions) const {
  const std::size_t parts = std::get<ElasticMaterial>(tissue().material).parts.size();
  std::vector<std::string> fields;
  for (std::size_t i = 0; i < lesions.size(); ++i) {
    const Lesion& lesion = lesions[i];
    fields.push_back(fmt::format(
        "scene.tissue[{}].elastic.part={{ where {{ sphere {{ center_m {{ x: {:.6f} y: {:.6f} z: "
        "{:.6f} }} radius_m: {:.6f} }} }} young_pa: {:.1f} }}",
        task_->tissue, lesion.center_m.x(), lesion.center_m.y(), lesion.center_m.z(),
        lesion.radius_m, lesion.young_pa));
    fields.push_back(fmt::format(
        "task.palpation.target={{ name: \"lesion {}\" lesion: {} "
        "palpable_newton: {:.3f} contrast_ratio: {:.3f} }}",
        i + 1, parts + i, lesion.palpable_newton, std::max(0.0, lesion.contrast_ratio)));
  }
  return fields;
}

/// Of the surface above a place of the plane z = 0; none: there is none.
std::optional<double> RandomTask::height_m(double x_m, double y_m) const {
  std::optional<double> highest_m;
  for (const auto& [a, b, c] : triangles_) {
    const double whole = (b.x() - a.x()) * (c.y() - a.y()) - (c.x() - a.x()) * (b.y() - a.y());
    if (std::abs(whole) < 1e-15) continue;
    const double u = ((x_m - a.x()) * (c.y() - a.y()) - (c.x() - a.x()) * (y_m - a.y())) / whole;
    const double v = ((b.x() - a.x()) * (y_m - a.y()) - (x_m - a.x()) * (b.y() - a.y())) / whole;
    if (u < -1e-9 || v < -1e-9 || u + v > 1.0 + 1e-9) continue;
    const double z_m = a.z() + u * (b.z() - a.z()) + v * (c.z() - a.z());
    highest_m = std::max(highest_m.value_or(z_m), z_m);
  }
  return highest_m;
}

RandomTask::Search RandomTask::search(const SearchHand& hand,
                                      const std::vector<Lesion>& lesions) const {
  const auto* box = task_->area ? std::get_if<BoxGeometry>(&*task_->area) : nullptr;
  if (box == nullptr) {
    throw SetupError(refusal(session_,
                             "task.palpation.area: a simulated hand searches a box; give "
                             "area { box { center_m { … } size_m { … } } }"));
  }
  const HandConfig& spring = session_.side().hand;
  const double tip_m = session_.scene.tip_radius_m;
  const Vector3& offset_m = session_.side().device.workspace.offset_m;
  if (!(spring.stiffness_newton_per_m > 0.0) ||
      session_.side().device.workspace.scale_ratio != 1.0) {
    throw SetupError(refusal(session_,
                             "a simulated hand searches with hand.stiffness_newton_per_m "
                             "> 0 and without a workspace scale; correct them"));
  }
  const auto plain = physics::make_elastic_body(tissue(), task_->tissue, tip_m);
  const auto middle_m = height_m(box->center_m.x(), box->center_m.y());
  if (!middle_m) {
    throw SetupError(
        refusal(session_, "task.palpation.area: there is no surface above its middle"));
  }
  const PressCurve curve =
      press_curve(*plain, tip_m, {box->center_m.x(), box->center_m.y(), *middle_m},
                  Vector3::UnitZ(), hand.newton, kDeepest_m);
  // the hand's spring is stretched by the force of the tissue
  const double reach_m = curve.depth_m(hand.newton) + hand.newton / spring.stiffness_newton_per_m;

  Search search;
  double t_s = 0.0;
  search.path_csv = "t,x,y,z\n";
  const auto go = [&](double duration_s, const Vector3& tool_m) {
    t_s += duration_s;
    const Vector3 hand_m = tool_m - offset_m;
    search.path_csv +=
        fmt::format("{:.3f},{:.6f},{:.6f},{:.6f}\n", t_s, hand_m.x(), hand_m.y(), hand_m.z());
  };
  std::vector<bool> is_marked(lesions.size(), false);
  const auto cells = [&](double length_m) {
    return std::max(1, static_cast<int>(std::ceil(length_m / hand.spacing_m - 1e-9)));
  };
  const int columns = cells(box->size_m.x());
  const int rows = cells(box->size_m.y());
  for (int row = 0; row < rows; ++row) {
    for (int step = 0; step < columns; ++step) {
      const int column = row % 2 == 0 ? step : columns - 1 - step;
      const double x_m = box->center_m.x() + box->size_m.x() * ((column + 0.5) / columns - 0.5);
      const double y_m = box->center_m.y() + box->size_m.y() * ((row + 0.5) / rows - 0.5);
      const auto z_m = height_m(x_m, y_m);
      if (!z_m) continue;
      const Vector3 on_m(x_m, y_m, *z_m + tip_m);
      go(t_s == 0.0 ? 0.0 : kMove_s, on_m + kClear_m * Vector3::UnitZ());
      if (t_s == 0.0) go(kMove_s, on_m + kClear_m * Vector3::UnitZ());
      go(kPress_s, on_m - reach_m * Vector3::UnitZ());
      go(kHold_s, on_m - reach_m * Vector3::UnitZ());
      for (std::size_t i = 0; i < lesions.size(); ++i) {
        const bool is_over = (Vector3(x_m, y_m, *z_m) - lesions[i].above_m).norm() <=
                             std::max(lesions[i].radius_m, task_->coverage_radius_m);
        if (is_marked[i] || !is_over || !(hand.newton >= lesions[i].palpable_newton)) continue;
        is_marked[i] = true;
        search.presses.push_back(
            fmt::format("hand.press={{ button: {} from_s: {:.3f} until_s: "
                        "{:.3f} }}",
                        session_.task->mark_button.value_or(0), t_s - kButton_s, t_s));
      }
      go(kLift_s, on_m + kClear_m * Vector3::UnitZ());
    }
  }
  search.length_s = t_s;
  return search;
}

}  // namespace palpate
