// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "common/core/check.h"
#include "common/process/terminal.h"
#include "common/session/materials.h"
#include "common/session/session_file.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/options.h"
#include "deploy/palpate/session_warnings.h"
#include "physics_node/elastic_tissue/ablation/ablated_body.h"
#include "physics_node/elastic_tissue/elastic_body.h"
#include "physics_node/elastic_tissue/jaw.h"
#include "physics_node/elastic_tissue/scene_report.h"

namespace palpate {
namespace {

/// What an elastic tissue is made of, a line each: value, range and source of what has a name, and
/// how it relaxes.
std::vector<std::string> material_lines(const ElasticMaterial& material) {
  std::vector<std::string> lines;
  const auto add = [&](const std::string& of, const std::string& tissue, double young_pa) {
    const TissueMaterial* known = material_named(tissue);
    char value[60];  // NOLINT: for snprintf
    std::snprintf(value, sizeof value, "%s%.4g kPa%s", of.c_str(), 1e-3 * young_pa,
                  material.branches.empty() ? "" : " at rest");
    lines.push_back(value +
                    (known == nullptr ? ", given in the session" : "; " + source_of(*known)));
  };
  add("body: ", material.tissue, material.young_pa);
  for (std::size_t i = 0; i < material.parts.size(); ++i) {
    add("part " + std::to_string(i) + ": ", material.parts[i].tissue, material.parts[i].young_pa);
  }
  if (material.branches.empty()) return lines;
  std::string relaxes = "relaxes:";
  for (const ElasticMaterial::Branch& branch : material.branches) {
    char one[60];  // NOLINT: for snprintf
    std::snprintf(one, sizeof one, " %.3g %% in %.3g s,", 100.0 * branch.share, branch.tau_s);
    relaxes += one;
  }
  relaxes.pop_back();
  if (material.fit_error_ratio) {
    char error[120];  // NOLINT: for snprintf
    std::snprintf(error, sizeof error,
                  "; fitted to the power law, complex modulus within %.2g %% from 0.1 to 10 Hz",
                  100.0 * *material.fit_error_ratio);
    relaxes += error;
  }
  lines.push_back(relaxes);
  return lines;
}

/// How many points of an elastic tissue jaws, a needle or a blade take; a warning too, if that is
/// none in places.
/// @param kind  gripper, needle, blade
std::vector<std::size_t> points_taken(const physics::ElasticBody& body, const Session& session,
                                      const char* kind, std::vector<std::string>& warnings) {
  const GripperConfig holder = *session.scene.holder();
  const std::vector<std::size_t> points =
      physics::points_in_reach(body, holder, session.scene.tip_radius_m);
  const auto none = static_cast<double>(std::count(points.begin(), points.end(), 0U));
  if (none > 0.0) {
    char text[240];  // NOLINT: for snprintf
    std::snprintf(text, sizeof text,
                  "tissue \"%s\": the %s takes nothing at %.2g %% of the surface: make "
                  "scene.tool.%s.reach_m (%.3g m) longer, or the mesh finer",
                  session.scene.tissues[body.tissue].name.c_str(), kind,
                  100.0 * none / static_cast<double>(points.size()), kind, holder.reach_m);
    warnings.emplace_back(text);
  }
  return points;
}

/// What a needle does to an elastic tissue.
std::string needle_line(const physics::ElasticBody& body, const Session& session,
                        std::vector<std::string>& warnings) {
  if (!body.pierced) return "needle: does not go in, because it is not `pierced`";
  const std::vector<std::size_t> points = points_taken(body, session, "needle", warnings);
  if (points.empty()) return "needle: there is no surface";
  const double cuts = body.pierced->toughness_joule_per_m2 * session.scene.needle->width_m;
  const double spreads = body.pierced->spreading_ratio * cuts;
  const double in_newton = std::max(body.pierced->membrane_newton, cuts + spreads);
  char text[320];  // NOLINT: for snprintf
  std::snprintf(
      text, sizeof text,
      "needle: goes in at %.3g N, when it has indented the surface by about %.2g mm; then "
      "cuts with %.3g N, spreads with %.3g N and rubs with %.3g N per cm; holds %zu to "
      "%zu points of the surface, median %zu",
      in_newton, std::pow(in_newton / body.hertz_newton, 2.0 / 3.0), cuts, spreads,
      0.01 * body.pierced->friction_newton_per_m, points.front(), points.back(),
      points[points.size() / 2]);
  return text;
}

/// What a blade does to an elastic tissue.
std::string blade_line(const physics::ElasticBody& body, const Session& session,
                       std::vector<std::string>& warnings) {
  if (!body.pierced) return "blade: does not cut it, because it is not `pierced`";
  const std::vector<std::size_t> points = points_taken(body, session, "blade", warnings);
  if (points.empty()) return "blade: there is no surface";
  const BladeConfig& blade = *session.scene.blade;
  const double edge_mm = 1e3 * blade.length_m;
  const double cuts_per_mm = 1e-3 * body.pierced->toughness_joule_per_m2;
  const double entering_m = session.scene.holder()->needle_width_m;
  const double in_newton = std::max(
      body.pierced->membrane_newton,
      (1.0 + body.pierced->spreading_ratio) * body.pierced->toughness_joule_per_m2 * entering_m);
  const elastic::MeshQuality quality = elastic::quality_of(body.body->mesh());
  char text[400];  // NOLINT: for snprintf
  std::snprintf(
      text, sizeof text,
      "blade: goes in at %.3g N; then cuts with %.3g N, spreads with %.3g N and rubs with "
      "%.3g N per mm of its edge in the tissue, %.3g mm at most; separates faces between "
      "elements with edges of %.2g to %.2g mm; holds %zu to %zu points of the surface, "
      "median %zu",
      in_newton, cuts_per_mm, body.pierced->spreading_ratio * cuts_per_mm,
      1e-3 * body.pierced->friction_newton_per_m, edge_mm, 1e3 * quality.shortest_edge_m,
      1e3 * quality.longest_edge_m, points.front(), points.back(), points[points.size() / 2]);
  return text;
}

/// What the jaws take of an elastic tissue.
std::string gripper_line(const physics::ElasticBody& body, const Session& session,
                         std::vector<std::string>& warnings) {
  const GripperConfig& gripper = *session.scene.gripper;
  const std::vector<std::size_t> points = points_taken(body, session, "gripper", warnings);
  if (points.empty()) return "gripper: there is no surface";
  char text[240];  // NOLINT: for snprintf
  std::snprintf(text, sizeof text,
                "gripper: takes %zu to %zu points of the surface where a tip lies on it, median "
                "%zu; slips above %.3g N, tears above %.3g N",
                points.front(), points.back(), points[points.size() / 2], gripper.slip_newton(),
                gripper.tear_newton);
  return text;
}

/// How much of the surface the electrode reaches; a warning too, if that is not all of it.
std::string electrode_line(const physics::ElasticBody& body, const Session& session,
                           std::vector<std::string>& warnings) {
  const ElectrodeConfig& electrode = *session.scene.electrode;
  const double percent =
      100.0 * physics::share_in_reach(body, electrode, session.scene.tip_radius_m);
  char text[240];  // NOLINT: for snprintf
  if (percent < 99.0) {
    std::snprintf(text, sizeof text,
                  "tissue \"%s\": the electrode ablates nothing at %.2g %% of the surface: make "
                  "scene.tool.electrode.reach_m (%.3g m) longer, or the mesh finer",
                  session.scene.tissues[body.tissue].name.c_str(), 100.0 - percent,
                  electrode.reach_m);
    warnings.emplace_back(text);
  }
  std::snprintf(text, sizeof text,
                "electrode: %.3g W, at most %.3g mm³/s; reaches elements at %.3g %% of the surface "
                "where a tip lies on it",
                electrode.power_watt,
                1e9 * electrode.power_watt /
                    (electrode.energy_joule_per_kg *
                     body.body->description().materials.front().density_kg_per_m3),
                percent);
  return text;
}

int check_scene(const SessionOptions& options, const Verbosity& verbosity) {
  const Session session = options.load(verbosity);
  std::vector<std::string> reports;  // of elastic bodies
  std::vector<std::string> warnings;
  try {
    const BusyLine loading("reading the geometry", verbosity.is_quiet);
    warnings = session_warnings(session);
    const auto bodies = physics::elastic_bodies_of(session.scene);
    for (const auto& body : bodies) {
      reports.push_back(session.scene.tissues[body->tissue].name + ": " +
                        physics::mesh_report(*body));
      const auto& tissue = session.scene.tissues[body->tissue];
      for (const std::string& idle : body->idle_places) {
        warnings.push_back("tissue \"" + tissue.name + "\": " + idle);
      }
      const auto& material = std::get<ElasticMaterial>(tissue.material);
      for (const std::string& doubt : physics::tearing_warnings(*body, material)) {
        warnings.push_back("tissue \"" + tissue.name + "\": " + doubt);
      }
      for (const std::string& line : material_lines(material)) reports.push_back("  " + line);
      for (const std::string& line : physics::touching_lines(bodies, *body, session.scene)) {
        reports.push_back("  " + line);
      }
      if (session.scene.gripper) {
        reports.push_back("  " + gripper_line(*body, session, warnings));
      }
      if (session.scene.needle) {
        reports.push_back("  " + needle_line(*body, session, warnings));
      }
      if (session.scene.blade) {
        reports.push_back("  " + blade_line(*body, session, warnings));
      }
      if (session.scene.electrode) {
        reports.push_back("  " + electrode_line(*body, session, warnings));
      }
    }
  } catch (const SetupError& error) {
    throw SetupError(with_place(session, error.what()));
  }
  for (const std::string& warning : warnings) say("warning: " + warning);
  const std::string count =
      warnings.empty()
          ? ""
          : std::to_string(warnings.size()) + (warnings.size() == 1 ? " warning, " : " warnings, ");
  std::printf("%s: ok (%s%zu tissues, physics %g Hz", options.file.c_str(), count.c_str(),
              session.scene.tissues.size(), session.physics.rate_hz);
  for (const Side& side : session.sides) {
    const std::string label = side.name.empty() ? ", " : "; " + side.name + ": ";
    std::printf("%sdevice %g Hz, controller %s", label.c_str(), side.device.rate_hz,
                controller_text(side.mofc).c_str());
  }
  std::printf(")\n");
  for (const std::string& report : reports) std::printf("%s\n", report.c_str());
  return 0;
}

}  // namespace

Command add_scene_check_command(CLI::App& app) {
  CLI::App& scene = *app.add_subcommand("scene", "check a session without running it");
  scene.require_subcommand(1);
  CLI::App& check = *scene.add_subcommand(
      "check",
      "validate a session and its files, and warn of likely mistakes; exit status 0 if valid, "
      "2 if not");
  auto options = std::make_shared<SessionOptions>();
  options->add_to(check);
  return {&check,
          [options](const Verbosity& verbosity) { return check_scene(*options, verbosity); }};
}

}  // namespace palpate
