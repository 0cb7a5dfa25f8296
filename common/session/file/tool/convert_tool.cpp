// SPDX-License-Identifier: Apache-2.0
// convert_tool.cpp — scene.tool: what acts on elastic tissue.
#include <algorithm>
#include <cmath>
#include <variant>

#include "common/session/file/convert.h"

namespace palpate {
namespace {

GripperConfig to_gripper(const Fields& fields, double tip_radius_m) {
  return {.button = static_cast<std::uint32_t>(fields.integer("button")),
          .reach_m = fields.number("reach_m", 1.5 * tip_radius_m),
          .most_points = static_cast<std::uint32_t>(fields.integer("most_points")),
          .stiffness_newton_per_m = fields.number("stiffness_newton_per_m"),
          .jaw_newton = fields.number("jaw_newton"),
          .friction_coefficient = fields.number("friction_coefficient"),
          .tear_newton = fields.number("tear_newton")};
}

NeedleConfig to_needle(const Fields& fields, double tip_radius_m) {
  return {.width_m = fields.number("width_m", 2.0 * tip_radius_m),
          .reach_m = fields.number("reach_m", 1.5 * tip_radius_m),
          .most_points = static_cast<std::uint32_t>(fields.integer("most_points")),
          .stiffness_newton_per_m = fields.number("stiffness_newton_per_m")};
}

BladeConfig to_blade(const Fields& fields, double tip_radius_m) {
  constexpr double kAcross = 1e-3;  // of a unit vector
  BladeConfig config{.length_m = fields.number("length_m"),
                     .facing = fields.direction("facing"),
                     .reach_m = fields.number("reach_m", 1.5 * tip_radius_m),
                     .most_points = static_cast<std::uint32_t>(fields.integer("most_points")),
                     .stiffness_newton_per_m = fields.number("stiffness_newton_per_m")};
  if (std::abs(config.facing.z()) > kAcross) {
    fields.problem("facing",
                   "must be at a right angle to z, along which the edge goes; leave z out");
  }
  config.facing.z() = 0.0;
  config.facing.normalize();
  return config;
}

ElectrodeConfig to_electrode(const Fields& fields, double tip_radius_m) {
  const ElectrodeConfig config{.button = static_cast<std::uint32_t>(fields.integer("button")),
                               .power_watt = fields.number("power_watt"),
                               .reach_m = fields.number("reach_m", 1.5 * tip_radius_m),
                               .energy_joule_per_kg = fields.number("energy_joule_per_kg"),
                               .softest_ratio = fields.number("softest_ratio")};
  if (config.reach_m > 0.0 && config.reach_m <= tip_radius_m) {
    fields.problem("reach_m",
                   "must be > scene.tool.tip_radius_m, or it ends inside the tip; give more, or "
                   "leave it out for 1.5 × tip_radius_m");
  }
  return config;
}

bool is_elastic(const TissueConfig& tissue) {
  return std::holds_alternative<ElasticMaterial>(tissue.material);
}

bool is_pierced(const TissueConfig& tissue) {
  const auto* const elastic = std::get_if<ElasticMaterial>(&tissue.material);
  return elastic != nullptr && elastic->pierced.has_value();
}

/// What a blade cuts does not tear off: @see AblatedBody.
bool is_cut_and_torn(const TissueConfig& tissue) { return is_pierced(tissue) && can_tear(tissue); }

void add_blade(const Fields& tool, SceneConfig& config) {
  config.blade = to_blade(tool.message("blade"), config.tip_radius_m);
  if (config.gripper || config.needle) {
    tool.problem("blade", "a tool has a gripper, a needle or a blade; leave the others out");
  }
  if (std::none_of(config.tissues.begin(), config.tissues.end(), is_pierced)) {
    tool.problem("blade",
                 "cuts elastic tissue, and no tissue lets it; give one elastic { pierced { "
                 "toughness_joule_per_m2: … } }, or leave this out");
  }
  if (std::any_of(config.tissues.begin(), config.tissues.end(), is_cut_and_torn)) {
    tool.problem("blade",
                 "cuts no body that tears off; leave out its elastic.pierced, or "
                 "attached.toughness_joule_per_m2");
  }
}

}  // namespace

void add_holders(const Fields& tool, SceneConfig& config) {
  const bool has_elastic = std::any_of(config.tissues.begin(), config.tissues.end(), is_elastic);
  if (tool.has("gripper") && has_elastic) {
    config.gripper = to_gripper(tool.message("gripper"), config.tip_radius_m);
  } else if (tool.has("gripper")) {
    tool.problem("gripper",
                 "holds elastic tissue, and the scene has none; give a tissue elastic { … }, or "
                 "leave this out");
  }
  if (tool.has("needle")) {
    config.needle = to_needle(tool.message("needle"), config.tip_radius_m);
    if (config.gripper) {
      tool.problem("needle", "a tool has a gripper or a needle; leave one of them out");
    }
    if (std::none_of(config.tissues.begin(), config.tissues.end(), is_pierced)) {
      tool.problem("needle",
                   "goes into elastic tissue, and no tissue lets it; give one elastic { pierced { "
                   "toughness_joule_per_m2: … } }, or leave this out");
    }
  }
  if (tool.has("blade")) add_blade(tool, config);
  if (tool.has("electrode") && has_elastic) {
    config.electrode = to_electrode(tool.message("electrode"), config.tip_radius_m);
  } else if (tool.has("electrode")) {
    tool.problem("electrode",
                 "ablates elastic tissue, and the scene has none; give a tissue elastic { … }, or "
                 "leave this out");
  }
  if (config.gripper && config.electrode && config.gripper->button == config.electrode->button) {
    tool.message("electrode")
        .problem("button",
                 "must be another button than scene.tool.gripper.button, or what the jaws hold "
                 "is ablated");
  }
}

}  // namespace palpate
