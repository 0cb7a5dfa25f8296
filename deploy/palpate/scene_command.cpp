// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "common/process/terminal.h"
#include "common/session/session_file.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/options.h"
#include "deploy/palpate/session_warnings.h"
#include "physics_node/elastic_tissue/elastic_body.h"

namespace palpate {
namespace {

int check_scene(const SessionOptions& options, const Verbosity& verbosity) {
  const Session session = options.load(verbosity);
  std::vector<std::string> reports;  // of elastic bodies
  std::vector<std::string> warnings;
  try {
    const BusyLine loading("reading the geometry", verbosity.is_quiet);
    warnings = session_warnings(session);
    for (const auto& body : physics::elastic_bodies_of(session.scene)) {
      reports.push_back(session.scene.tissues[body->tissue].name + ": " +
                        physics::mesh_report(*body));
    }
  } catch (const SetupError& error) {
    throw SetupError(with_place(session, error.what()));
  }
  for (const std::string& warning : warnings) say("warning: " + warning);
  for (const Side& side : session.sides) {
    std::printf("%s: ok (%s%s%zu tissues, device %g Hz, physics %g Hz, controller %s)\n",
                options.file.c_str(),
                warnings.empty() ? ""
                                 : (std::to_string(warnings.size()) +
                                    (warnings.size() == 1 ? " warning, " : " warnings, "))
                                       .c_str(),
                side.name.empty() ? "" : (side.name + ", ").c_str(), session.scene.tissues.size(),
                side.device.rate_hz, session.physics.rate_hz, controller_text(side.mofc).c_str());
  }
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
