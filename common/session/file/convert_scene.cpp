// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <variant>

#include "common/core/user/nearest.h"
#include "common/session/file/convert.h"
#include "common/session/materials.h"
#include "common/session/power_law.h"
#include "palpate/v1/session.pb.h"

namespace palpate {

namespace {

/// The geometry that `message` of the tissue takes from a file, which is not opened here.
FileGeometry to_file_geometry(const Fields& tissue, const char* message, FileGeometry::Kind kind,
                              const std::filesystem::path& base_dir) {
  FileGeometry geometry;
  geometry.kind = kind;
  const Fields fields = tissue.message(message);
  if (fields.has_required("file")) geometry.file = fields.file("file", base_dir).string();
  const std::string material = tissue.given_member("material");
  if (!material.empty() && material != "elastic") {
    geometry.stiffness_property = tissue.message(material.c_str()).text("stiffness_property");
  }
  geometry.unit_m = tissue.number("unit_m");
  geometry.position_m = tissue.vector("position_m");
  geometry.rotation = tissue.rotation("rotation_rad");
  return geometry;
}

Geometry to_geometry(const Fields& tissue, const std::filesystem::path& base_dir) {
  using Kind = FileGeometry::Kind;
  const std::string kind = tissue.given_member("geometry");
  const auto from_file = [&](Kind file) {
    return to_file_geometry(tissue, kind.c_str(), file, base_dir);
  };
  if (kind == "point_cloud") return from_file(Kind::kPointCloud);
  if (kind == "triangle_surface") return from_file(Kind::kTriangleSurface);
  if (kind == "tetrahedral_mesh") return from_file(Kind::kTetrahedralMesh);
  for (const char* name : {"position_m", "rotation_rad", "unit_m"}) {
    if (tissue.has(name)) {
      tissue.problem(name, "is for a geometry from a file only; place this one by its own fields");
    }
  }
  if (kind.empty()) {
    tissue.problem(
        "a geometry is required; give half_space { … }, sphere { … }, box { … }, capsule { … }, "
        "point_cloud { … }, triangle_surface { … } or tetrahedral_mesh { … }");
    return {};
  }
  const Fields fields = tissue.message(kind.c_str());
  if (kind == "sphere") {
    return SphereGeometry{.center_m = fields.vector("center_m"),
                          .radius_m = fields.number("radius_m")};
  }
  if (kind == "box") {
    return BoxGeometry{.center_m = fields.vector("center_m"), .size_m = fields.vector("size_m")};
  }
  if (kind == "capsule") {
    return CapsuleGeometry{.from_m = fields.vector("from_m"),
                           .to_m = fields.vector("to_m"),
                           .radius_m = fields.number("radius_m")};
  }
  return HalfSpaceGeometry{.point_m = fields.vector("point_m"),
                           .normal = fields.direction("normal")};
}

/// The modulus of a body or a part, given or that of its `material`.
double to_young_pa(const Fields& fields) {
  const std::string name = fields.text("material");
  const TissueMaterial* known = material_named(name);
  if (fields.has("material") && known == nullptr) {
    std::vector<std::string> names;
    std::string list;
    for (const TissueMaterial& one : tissue_materials()) {
      names.emplace_back(one.name);
      list += (list.empty() ? "\"" : ", \"") + names.back() + "\"";
    }
    const std::string meant = nearest(name, names);
    fields.problem("material", (meant.empty() ? "" : "did you mean \"" + meant + "\"? ") +
                                   "known are " + list + "; otherwise give young_pa");
  } else if (known != nullptr) {
    return fields.number("young_pa", known->young_pa);
  } else if (!fields.has("young_pa")) {
    fields.problem("young_pa", "required; give E in Pa, or the name of a tissue as `material`");
  }
  return fields.number("young_pa", std::numeric_limits<double>::quiet_NaN());
}

/// Relaxation, and the modulus at rest that goes with it.
void add_relaxation(const Fields& elastic, ElasticMaterial& material) {
  constexpr std::size_t kMostBranches = 8;
  if (!elastic.has("viscoelastic")) return;
  const Fields fields = elastic.message("viscoelastic");
  if (fields.has("power_law")) {
    if (fields.has("branch")) {
      fields.problem("power_law", "has branches of its own; leave out branch or power_law");
    }
    const Fields law = fields.message("power_law");
    const double exponent = law.number("exponent");
    const double at_hz = law.number("at_hz");
    if (std::isnan(exponent) || std::isnan(at_hz)) return;
    const PowerLawFit fit = fit_power_law(exponent, at_hz);
    material.branches = fit.branches;
    material.fit_error_ratio = fit.error_ratio;
    material.young_pa *= fit.rest_ratio;
    for (ElasticMaterial::Part& part : material.parts) part.young_pa *= fit.rest_ratio;
    return;
  }
  double shares = 0.0;
  for (const Fields& branch : fields.messages("branch")) {
    material.branches.push_back({.share = branch.number("share"), .tau_s = branch.number("tau_s")});
    shares += material.branches.back().share;
  }
  if (material.branches.empty()) {
    fields.problem("nothing relaxes; give branch { share: … tau_s: … } or power_law { … }");
  }
  if (material.branches.size() > kMostBranches) {
    fields.problem_at("branch", static_cast<int>(kMostBranches), "at most 8 branches");
  }
  if (shares > 0.99) {
    fields.problem("the shares of the branches sum to " + shown(shares) +
                   "; must be at most 0.99, because the rest is what holds the body at rest");
  }
}

/// How a needle or a blade goes into the body, after its parts.
void add_pierced(const Fields& elastic, ElasticMaterial& material) {
  const char* const name = "toughness_joule_per_m2";
  if (elastic.has("pierced")) {
    const Fields fields = elastic.message("pierced");
    material.pierced = {.toughness_joule_per_m2 = fields.number(name),
                        .spreading_ratio = fields.number("spreading_ratio"),
                        .friction_newton_per_m = fields.number("friction_newton_per_m"),
                        .membrane_newton = fields.number("membrane_newton", 0.0)};
  }
  std::size_t index = 0;
  for (const Fields& part : elastic.messages("part")) {
    const RegionGeometry& where = material.parts[index++].where;
    if (!part.has(name)) continue;
    if (!material.pierced) {
      part.problem(name, "needs that of the body; give pierced { … } too, or leave this out");
    } else if (std::holds_alternative<MeshTag>(where)) {
      part.problem(name, "needs a half_space, sphere or box as its place; leave it out");
    } else {
      material.pierced->parts.push_back(
          {.where = where, .toughness_joule_per_m2 = part.number(name)});
    }
  }
}

ElasticMaterial to_elastic(const Fields& tissue, double tip_radius_m) {
  constexpr double kSmallestTip_m = 1e-3;
  constexpr std::size_t kMostParts = 64;
  const Fields fields = tissue.message("elastic");
  if (tissue.given_member("geometry") != "tetrahedral_mesh") {
    fields.problem("needs the inside of the body; give tetrahedral_mesh { … } as its geometry");
  }
  if (tissue.has("motion")) {
    tissue.problem("motion", "an elastic body is held by its fixed places; leave it out");
  }
  if (tip_radius_m < kSmallestTip_m) {
    fields.problem(
        "is touched by a sphere of at least 1 mm; set scene.tool.tip_radius_m, which is " +
        shown(1e3 * tip_radius_m) + " mm");
  }
  ElasticMaterial material{.tissue = fields.has("young_pa") ? "" : fields.text("material"),
                           .young_pa = to_young_pa(fields),
                           .poisson_ratio = fields.number("poisson_ratio"),
                           .density_kg_per_m3 = fields.number("density_kg_per_m3"),
                           .viscosity_s = 1e-3 * fields.number("viscosity_ms"),
                           .mass_damping_per_s = fields.number("mass_damping_per_s"),
                           .gravity_m_per_s2 = fields.vector("gravity_m_per_s2"),
                           .scan_gravity_m_per_s2 = fields.vector("scan_gravity_m_per_s2"),
                           .solve_rate_hz = fields.number("solve_rate_hz"),
                           .is_linear = fields.flag("linear_elements"),
                           .friction_coefficient = fields.number("friction_coefficient")};
  if (fields.has("scan_gravity_m_per_s2") && !fields.has("gravity_m_per_s2")) {
    fields.problem("scan_gravity_m_per_s2",
                   "needs gravity_m_per_s2, the gravity in the session: the same for the posture "
                   "of the scan, { z: 0 } for none");
  }
  switch (fields.enumerator("law")) {
    case v1::Scene::Elastic::corotational:
      material.law = ElasticMaterial::Law::kCorotational;
      break;
    case v1::Scene::Elastic::st_venant_kirchhoff:
      material.law = ElasticMaterial::Law::kStVenantKirchhoff;
      break;
    default:
      break;
  }
  for (const Fields& place : fields.messages("fixed")) material.fixed.push_back(to_region(place));
  add_attached(fields, material);
  if (material.fixed.empty() && material.attached.empty()) {
    fields.problem(
        "fixed",
        "the body would fall; give where it is held, e.g. fixed { half_space { point_m { "
        "z: -0.04 } } }, or where springs hold it: attached { … }");
  }
  for (const Fields& part : fields.messages("part")) {
    material.parts.push_back(
        {.where = to_region(part.message("where")),
         .tissue = part.has("young_pa") ? "" : part.text("material"),
         .young_pa = to_young_pa(part),
         .poisson_ratio = part.number("poisson_ratio", material.poisson_ratio),
         .density_kg_per_m3 = part.number("density_kg_per_m3", material.density_kg_per_m3)});
  }
  if (material.parts.size() > kMostParts) {
    fields.problem_at("part", static_cast<int>(kMostParts),
                      "at most 64 parts; merge those of one material");
  }
  add_pierced(fields, material);
  add_relaxation(fields, material);
  return material;
}

Material to_material(const Fields& tissue, double tip_radius_m) {
  const std::string kind = tissue.given_member("material");
  if (kind.empty()) {
    tissue.problem("a material is required; give kelvin_voigt { stiffness_newton_per_m: … }");
    return {};
  }
  if (kind == "elastic") return to_elastic(tissue, tip_radius_m);
  const Fields fields = tissue.message(kind.c_str());
  if (fields.has("stiffness_property") && tissue.given_member("geometry") != "point_cloud") {
    fields.problem("stiffness_property", "only a point_cloud has one; leave it out");
  }
  KelvinVoigtMaterial material{.stiffness_newton_per_m = fields.number("stiffness_newton_per_m"),
                               .damping_newton_s_per_m = fields.number("damping_newton_s_per_m"),
                               .is_adhesive = fields.flag("adhesive")};
  if (kind == "hunt_crossley") {
    material.exponent = fields.number("exponent");
    material.exponent_depth_m = fields.number("depth_m");
  } else {
    material.is_damping_isotropic = fields.flag("isotropic_damping");
    material.stiffening_newton_per_m3 = fields.number("stiffening_newton_per_m3");
    material.relaxing_stiffness_newton_per_m = fields.number("relaxing_stiffness_newton_per_m");
    material.relaxation_time_s = 1e-3 * fields.number("relaxation_time_ms");
    for (const Fields& ball : fields.messages("inclusion")) {
      material.inclusions.push_back(
          {.center_m = ball.vector("center_m"),
           .radius_m = ball.number("radius_m"),
           .transition_m = ball.number("transition_m"),
           .stiffness_newton_per_m = ball.number("stiffness_newton_per_m"),
           .damping_newton_s_per_m =
               ball.number("damping_newton_s_per_m", material.damping_newton_s_per_m)});
    }
  }
  material.friction_coefficient = fields.number("friction_coefficient");
  material.friction_stiffness_newton_per_m =
      fields.number("friction_stiffness_newton_per_m", material.stiffness_newton_per_m);
  material.puncture_newton = fields.number("puncture_newton");
  if (material.friction_stiffness_newton_per_m == 0.0 &&
      (material.friction_coefficient > 0.0 || material.puncture_newton > 0.0)) {
    fields.problem("friction_stiffness_newton_per_m",
                   "required with friction or a puncture where stiffness_newton_per_m is 0; give "
                   "the tangential stiffness while the tip sticks");
  }
  material.cutting_newton = fields.number("cutting_newton", 0.25 * material.puncture_newton);
  if (material.cutting_newton < 0.0 || material.cutting_newton > material.puncture_newton) {
    fields.problem("cutting_newton", "must be 0 … " + shown(material.puncture_newton) +
                                         "; leave it out for a quarter of puncture_newton");
  }
  return material;
}

TissueMotionConfig to_motion(const Fields& tissue) {
  if (!tissue.has("motion")) return {};
  const Fields fields = tissue.message("motion");
  TissueMotionConfig motion{.amplitude_m = fields.vector("amplitude_m"),
                            .frequency_hz = fields.number("frequency_hz"),
                            .phase_rad = fields.number("phase_rad")};
  const double fastest_m_per_s =
      2.0 * std::numbers::pi * motion.frequency_hz * motion.amplitude_m.lpNorm<Eigen::Infinity>();
  if (fastest_m_per_s > kMaxTissueSpeedMPerS) {
    fields.problem("amplitude_m", "moves the tissue at up to " + shown(fastest_m_per_s) +
                                      " m/s: must be ≤ " + shown(kMaxTissueSpeedMPerS) +
                                      " m/s; give a smaller amplitude or frequency");
  }
  return motion;
}

/// It names that tissue too, and both give a friction, not the same.
bool is_named_otherwise(const TissueConfig& other, std::size_t tissue, bool has_friction,
                        double friction_coefficient) {
  const auto* const material = std::get_if<ElasticMaterial>(&other.material);
  return material != nullptr && has_friction &&
         std::any_of(material->touches.begin(), material->touches.end(), [&](const auto& one) {
           return one.tissue == tissue && one.friction_coefficient > 0.0 &&
                  one.friction_coefficient != friction_coefficient;
         });
}

/// What elastic tissues touch, by name, when all are known.
void add_touches(const Fields& scene, SceneConfig& config) {
  constexpr std::size_t kMostTouches = 16;
  constexpr double kMostCarried_m = 0.02;    // by what it touches
  constexpr double kMostCarriedShare = 0.1;  // of solve_rate_hz
  std::size_t index = 0;
  for (const Fields& tissue : scene.messages("tissue")) {
    const std::size_t own = index++;
    auto* const material = std::get_if<ElasticMaterial>(&config.tissues[own].material);
    if (material == nullptr) continue;
    const Fields elastic = tissue.message("elastic");
    std::set<std::size_t> touched;
    for (const Fields& touches : elastic.messages("touches")) {
      const double friction_coefficient = touches.number("friction_coefficient", 0.0);
      if (!touches.has_required("tissue")) continue;
      const std::string name = touches.text("tissue");
      std::vector<std::string> names;
      for (const TissueConfig& one : config.tissues) names.push_back(one.name);
      const auto found = std::find(names.begin(), names.end(), name);
      const auto other = static_cast<std::size_t>(found - names.begin());
      if (found == names.end()) {
        const std::string meant = nearest(name, names);
        touches.problem("tissue", (meant.empty() ? "" : "did you mean \"" + meant + "\"? ") +
                                      "no tissue of the scene has this name; give one a name and "
                                      "name it here");
      } else if (other == own) {
        touches.problem("tissue", "is this tissue itself; name another one");
      } else if (!touched.insert(other).second) {
        touches.problem("tissue", "is named twice; leave one out");
      } else if (other < own &&
                 is_named_otherwise(config.tissues[other], own, touches.has("friction_coefficient"),
                                    friction_coefficient)) {
        touches.problem("friction_coefficient",
                        "is another one than \"" + name + "\" gives for the two; leave one out");
      } else if (const auto* const elastic_other =
                     std::get_if<ElasticMaterial>(&config.tissues[other].material);
                 elastic_other != nullptr &&
                 elastic_other->solve_rate_hz != material->solve_rate_hz) {
        touches.problem("tissue", "is solved at " + shown(elastic_other->solve_rate_hz) +
                                      " Hz, this one at " + shown(material->solve_rate_hz) +
                                      " Hz; give both the same solve_rate_hz");
      } else if (const auto* const file =
                     std::get_if<FileGeometry>(&config.tissues[other].geometry);
                 file != nullptr && file->kind == FileGeometry::Kind::kPointCloud) {
        touches.problem("tissue",
                        "is a point_cloud, which has no inside; give it as a "
                        "triangle_surface");
      } else if (const TissueMotionConfig& motion = config.tissues[other].motion;
                 motion.amplitude_m.norm() > kMostCarried_m) {
        touches.problem("tissue", "moves by up to " + shown(1e3 * motion.amplitude_m.norm()) +
                                      " mm: must be at most 20 mm; give its motion a smaller "
                                      "amplitude_m");
      } else if (motion.frequency_hz > kMostCarriedShare * material->solve_rate_hz) {
        touches.problem("tissue", "oscillates at " + shown(motion.frequency_hz) +
                                      " Hz: must be at most a tenth of solve_rate_hz, " +
                                      shown(material->solve_rate_hz) +
                                      " Hz; give its motion a lower frequency_hz or raise "
                                      "solve_rate_hz");
      } else {
        material->touches.push_back(
            {.tissue = other, .friction_coefficient = friction_coefficient});
      }
    }
    if (touched.size() > kMostTouches) {
      elastic.problem_at("touches", static_cast<int>(kMostTouches),
                         "at most 16 tissues; make one of several that are rigid");
    }
  }
}

}  // namespace

RegionGeometry to_region(const Fields& place) {
  const std::string kind = place.given_member("place");
  const bool is_near = kind == "near";
  if (kind == "tag" || is_near) {
    const Fields fields = is_near ? place.message("near") : place;
    const std::string name = fields.text("tag");
    if (name.empty()) fields.problem("tag", "must name a region of the mesh");
    return MeshTag{.name = name, .within_m = is_near ? fields.number("within_m") : 0.0};
  }
  const Fields fields = place.message(kind.empty() ? "half_space" : kind.c_str());
  if (kind == "sphere") {
    return SphereGeometry{.center_m = fields.vector("center_m"),
                          .radius_m = fields.number("radius_m")};
  }
  if (kind == "box") {
    return BoxGeometry{.center_m = fields.vector("center_m"), .size_m = fields.vector("size_m")};
  }
  if (kind.empty()) {
    place.problem(
        "a place is required; give half_space { … }, sphere { … }, box { … }, tag: \"…\" "
        "or near { tag: \"…\" within_m: … }");
  }
  return HalfSpaceGeometry{.point_m = fields.vector("point_m"),
                           .normal = fields.direction("normal")};
}

PhysicsConfig to_physics(const Fields& physics) {
  PhysicsConfig config;
  config.rate_hz = physics.number("rate_hz");
  config.reach_m = physics.number("reach_m");
  if (physics.has("interaction_deadband")) {
    const Fields fields = physics.message("interaction_deadband");
    config.interaction_deadband =
        InteractionDeadband{.ratio = fields.number("ratio"),
                            .floor_newton = fields.number("floor_newton"),
                            .keep_alive = fields.milliseconds("keep_alive_ms")};
  }
  if (physics.has("standby")) {
    const Fields standby = physics.message("standby");
    config.standby.emplace();
    if (standby.has("silence_ms")) config.standby->silence = standby.milliseconds("silence_ms");
  }
  return config;
}

std::vector<std::string> to_physics_command(const Fields& physics,
                                            const std::filesystem::path& base_dir) {
  constexpr std::size_t kMostArguments = 64;
  constexpr std::size_t kLongestArgument = 4096;
  const char* const name = "command";
  std::vector<std::string> command = physics.texts(name);
  const auto problem = [&](int index, const std::string& rule) {
    physics.problem_at(name, index, rule);
    return std::vector<std::string>{};
  };
  if (command.empty()) return command;
  if (command.size() > kMostArguments) {
    return problem(static_cast<int>(kMostArguments),
                   "must be at most 64 words; put further arguments into a file");
  }
  for (std::size_t i = 0; i < command.size(); ++i) {
    const std::string& word = command[i];
    if (word.size() > kLongestArgument || word.find('\0') != std::string::npos) {
      return problem(static_cast<int>(i),
                     "must be at most 4096 bytes, none of them zero; give a shorter argument");
    }
  }
  if (command.front().empty()) {
    return problem(0, "must name a program; give its file or its name in PATH");
  }
  if (command.front().find('/') == std::string::npos) return command;
  if (base_dir.empty()) {
    return problem(0, "this session has no folder; give the name of a program in PATH");
  }
  command.front() = std::filesystem::absolute(base_dir / command.front()).lexically_normal();
  return command;
}

SceneConfig to_scene(const Fields& scene, const std::filesystem::path& base_dir) {
  SceneConfig config;
  const Fields tool = scene.message("tool");
  config.tip_radius_m = tool.number("tip_radius_m");
  config.shaft_length_m = tool.number("shaft_length_m");
  if (config.shaft_length_m > 0.0) {
    config.shaft_radius_m = tool.number("shaft_radius_m", config.tip_radius_m);
    if (config.shaft_radius_m == 0.0) {
      tool.problem("shaft_radius_m", "required with a point as tip; give the shaft's radius");
    }
  } else if (tool.has("shaft_radius_m")) {
    tool.problem("shaft_radius_m", "needs shaft_length_m > 0; give it, or leave this out");
  }
  std::set<std::string> names;
  for (const Fields& tissue : scene.messages("tissue")) {
    std::string name = tissue.text("name");
    if (name.empty()) name = "tissue" + std::to_string(config.tissues.size());
    if (!names.insert(name).second) {
      tissue.problem("name",
                     "another tissue is called " + one_line(name) + " too; give each its own name");
    }
    config.tissues.push_back({.name = std::move(name),
                              .geometry = to_geometry(tissue, base_dir),
                              .material = to_material(tissue, config.tip_radius_m),
                              .motion = to_motion(tissue)});
  }
  add_touches(scene, config);
  add_holders(tool, config);
  add_ties(scene, config);
  return config;
}

}  // namespace palpate
