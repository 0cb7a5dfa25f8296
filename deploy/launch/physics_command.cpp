// SPDX-License-Identifier: Apache-2.0
#include "deploy/launch/physics_command.h"

#include <unistd.h>

#include <boost/process/search_path.hpp>
#include <nlohmann/json.hpp>
#include <system_error>

#include "common/core/check.h"

namespace palpate {
namespace {

namespace fs = std::filesystem;

/// The fields of SceneState that follow from the session.
nlohmann::json scene_json(const Session& session) {
  constexpr std::size_t kLongestText = 64 << 10;  // Linux allows 128 KiB for one variable
  const Side& side = session.side();
  nlohmann::json scene{{"session_name", session.name},
                       {"session_text", session.text.size() > kLongestText ? "" : session.text},
                       {"controller", controller_text(side.mofc)},
                       {"device_rate_hz", side.device.rate_hz},
                       {"physics_rate_hz", session.physics.rate_hz},
                       {"peak_force_newton", side.device.peak_force_newton},
                       {"tip_radius_m", session.scene.tip_radius_m},
                       {"shaft_length_m", session.scene.shaft_length_m},
                       {"shaft_radius_m", session.scene.shaft_radius_m},
                       {"workspace_scale_ratio", side.device.workspace.scale_ratio}};
  if (const auto& pointer = side.hand.pointer) {
    const Vector3& center_m = pointer->center_m;
    scene["pointer"] = {
        {"center_m", {{"x", center_m.x()}, {"y", center_m.y()}, {"z", center_m.z()}}},
        {"reach_m", pointer->reach_m},
        {"speed_m_per_s", pointer->speed_m_per_s},
        {"holder_timeout_ns", pointer->holder_timeout.count()}};
  }
  return scene;
}

/// What a physics from elsewhere has to know, as docs/extending.md describes it.
std::string environment_of(const Session& session, const fs::path& session_file,
                           const std::vector<std::string>& overrides, bool is_insecure) {
  nlohmann::json sides = nlohmann::json::array();
  for (const Side& side : session.sides) {
    sides.push_back({{"name", side.name},
                     {"tool_motion", side.links.tool_motion},
                     {"interaction", side.links.interaction}});
  }
  nlohmann::json json{{"session", fs::absolute(session_file).lexically_normal().string()},
                      {"overrides", overrides},
                      {"rate_hz", session.physics.rate_hz},
                      {"sides", sides},
                      {"physics_telemetry", session.physics_telemetry},
                      {"insecure", is_insecure},
                      {"scene", scene_json(session)}};
  if (!session.security.key_folder.empty()) {
    json["key_folder"] = fs::absolute(session.security.key_folder).lexically_normal().string();
  }
  return json.dump();
}

}  // namespace

std::string program_of(const Session& session) {
  const std::string& name = session.physics_command.front();
  std::error_code error;
  const fs::path folder = fs::read_symlink("/proc/self/exe", error).parent_path();
  std::string program = name;
  if (name.find('/') == std::string::npos) {
    program = fs::is_regular_file(folder / name, error)
                  ? (folder / name).string()
                  : boost::process::search_path(name).string();
  }
  if (program.empty() || fs::is_directory(program, error) || access(program.c_str(), X_OK) != 0) {
    throw SetupError(session.file + ": physics.command: " +
                     (program.empty()
                          ? name + ": no program of that name in PATH or in " + folder.string()
                          : program + ": is not a program that you may run") +
                     "; install it, or give the path of its file");
  }
  return program;
}

ChildSpec physics_from_elsewhere(const Session& session, const fs::path& session_file,
                                 const std::vector<std::string>& overrides, bool is_insecure) {
  const std::vector<std::string>& command = session.physics_command;
  return {.name = "physics",
          .program = program_of(session),
          .arguments = {command.begin() + 1, command.end()},
          .environment = {{"PALPATE_PHYSICS",
                           environment_of(session, session_file, overrides, is_insecure)}},
          .folder = fs::absolute(session_file).lexically_normal().parent_path()};
}

}  // namespace palpate
