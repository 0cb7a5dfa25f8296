// SPDX-License-Identifier: Apache-2.0
// What elastic tissue is attached to: a place that stands still, or another elastic tissue.
#include <algorithm>
#include <string>
#include <variant>
#include <vector>

#include "common/core/user/nearest.h"
#include "common/session/file/convert.h"

namespace palpate {
namespace {

const ElasticMaterial* elastic_of(const TissueConfig& tissue) {
  return std::get_if<ElasticMaterial>(&tissue.material);
}

/// It is held by itself, whatever becomes of what it is tied to.
bool is_held(const ElasticMaterial& material) {
  return !material.fixed.empty() || std::any_of(material.attached.begin(), material.attached.end(),
                                                [](const auto& one) { return !one.tissue; });
}

/// Why the two cannot be tied, "": they can. @param own, other  tissues of the scene
std::string complaint_about_tie(const SceneConfig& scene, std::size_t own, std::size_t other) {
  if (other == own) return "is this tissue itself; name another one";
  const ElasticMaterial* const there = elastic_of(scene.tissues[other]);
  if (there == nullptr) {
    return "does not give way, as it is not elastic; name an elastic tissue, or leave this out "
           "and give where";
  }
  const ElasticMaterial& here = *elastic_of(scene.tissues[own]);
  const std::string& name = scene.tissues[other].name;
  if (there->solve_rate_hz != here.solve_rate_hz) {
    return "is solved at " + shown(there->solve_rate_hz) + " Hz, this one at " +
           shown(here.solve_rate_hz) + " Hz; give both the same solve_rate_hz";
  }
  if (!is_held(*there)) {
    return "is not held by itself, so that both would fall; give \"" + name +
           "\" elastic { fixed { … } } or attached without tissue";
  }
  if (std::any_of(there->attached.begin(), there->attached.end(),
                  [&](const auto& one) { return one.tissue == own; })) {
    return "is tied to this one already; leave one of the two out";
  }
  if (can_tear(scene.tissues[other])) {
    return "may tear off itself, which changes its body; leave out toughness_joule_per_m2 of \"" +
           name + "\"";
  }
  if (!there->scan_gravity_m_per_s2.isZero(0.0) || !here.scan_gravity_m_per_s2.isZero(0.0)) {
    return "needs both in the shape of their meshes; leave out scan_gravity_m_per_s2 of both";
  }
  if (scene.electrode) {
    return "does not go with scene.tool.electrode, which may ablate what holds the two together; "
           "leave one of them out";
  }
  if (scene.blade && (there->pierced || here.pierced)) {
    return "does not go with scene.tool.blade, which may cut what holds the two together; leave "
           "out elastic.pierced of both, or this";
  }
  return "";
}

}  // namespace

void add_attached(const Fields& elastic, ElasticMaterial& material) {
  for (const Fields& attached : elastic.messages("attached")) {
    ElasticMaterial::Attached one{
        .stiffness_pa_per_m = attached.number("stiffness_pa_per_m"),
        .toughness_joule_per_m2 = attached.number("toughness_joule_per_m2", 0.0),
        .gap_m = attached.number("gap_m"),
        .is_anywhere = attached.has("tissue") && !attached.has("where")};
    if (!one.is_anywhere) one.where = to_region(attached.message("where"));
    if (attached.has("gap_m") && !attached.has("tissue")) {
      attached.problem("gap_m",
                       "is that to another elastic tissue; give its name, or leave this out");
    }
    if (attached.has("tissue") && elastic.has("viscoelastic")) {
      attached.problem("tissue",
                       "springs to another tissue do not relax; leave this out or viscoelastic");
    }
    material.attached.push_back(one);
    if (!attached.has("toughness_joule_per_m2")) continue;
    if (material.fixed.empty()) {
      attached.problem("toughness_joule_per_m2",
                       "a body that is torn off entirely would fall; give fixed, where it is held "
                       "in the end, or leave the toughness out");
    }
    if (elastic.has("viscoelastic")) {
      attached.problem("toughness_joule_per_m2",
                       "springs that tear do not relax; leave out the toughness or viscoelastic");
    }
  }
}

void add_ties(const Fields& scene, SceneConfig& config) {
  std::vector<std::string> names;
  for (const TissueConfig& one : config.tissues) names.push_back(one.name);
  // what each names first: whether one is held by itself depends on it
  std::size_t own = 0;
  for (const Fields& tissue : scene.messages("tissue")) {
    auto* const material = std::get_if<ElasticMaterial>(&config.tissues[own++].material);
    if (material == nullptr) continue;
    std::size_t index = 0;
    for (const Fields& attached : tissue.message("elastic").messages("attached")) {
      auto& one = material->attached[index++];
      if (!attached.has("tissue")) continue;
      const std::string name = attached.text("tissue");
      const auto found = std::find(names.begin(), names.end(), name);
      one.tissue = static_cast<std::size_t>(found - names.begin());
      if (found != names.end()) continue;
      const std::string meant = nearest(name, names);
      attached.problem("tissue", (meant.empty() ? "" : "did you mean \"" + meant + "\"? ") +
                                     "no tissue of the scene has this name; give one a name and "
                                     "name it here");
    }
  }
  own = 0;
  for (const Fields& tissue : scene.messages("tissue")) {
    const std::size_t here = own++;
    const ElasticMaterial* const material = elastic_of(config.tissues[here]);
    if (material == nullptr) continue;
    std::size_t index = 0;
    for (const Fields& attached : tissue.message("elastic").messages("attached")) {
      const auto& one = material->attached[index++];
      if (!one.tissue || *one.tissue == names.size()) continue;
      const std::string complaint = complaint_about_tie(config, here, *one.tissue);
      if (!complaint.empty()) attached.problem("tissue", complaint);
    }
  }
}

}  // namespace palpate
