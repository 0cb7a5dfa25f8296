#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "common/process/terminal.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/options.h"
#include "physics_node/elastic_tissue/elastic_body.h"
#include "physics_node/scene/scene.h"

namespace palpate {
namespace {

int check_scene(const SessionOptions& options, const Verbosity& verbosity) {
  const Session session = options.load(verbosity);
  std::vector<std::string> reports;  // of elastic bodies
  {
    const BusyLine loading("reading the geometry", verbosity.is_quiet);
    static_cast<void>(physics::Scene(session.scene));
    for (const auto& body : physics::elastic_bodies_of(session.scene)) {
      reports.push_back(session.scene.tissues[body->tissue].name + ": " +
                        physics::mesh_report(*body));
    }
  }
  for (const Side& side : session.sides) {
    std::printf("%s: ok (%s%zu tissues, device %g Hz, physics %g Hz, controller %s)\n",
                options.file.c_str(), side.name.empty() ? "" : (side.name + ", ").c_str(),
                session.scene.tissues.size(), side.device.rate_hz, session.physics.rate_hz,
                controller_text(side.mofc).c_str());
  }
  for (const std::string& report : reports) std::printf("%s\n", report.c_str());
  return 0;
}

}  // namespace

Command add_scene_check_command(CLI::App& app) {
  CLI::App& scene = *app.add_subcommand("scene", "check a session without running it");
  scene.require_subcommand(1);
  CLI::App& check = *scene.add_subcommand(
      "check", "validate a session and its files; exit status 0 if valid, 2 if not");
  auto options = std::make_shared<SessionOptions>();
  options->add_to(check);
  return {&check,
          [options](const Verbosity& verbosity) { return check_scene(*options, verbosity); }};
}

}  // namespace palpate
