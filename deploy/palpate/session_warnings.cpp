// SPDX-License-Identifier: Apache-2.0
#include "deploy/palpate/session_warnings.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <sstream>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>

#include "common/core/check.h"
#include "common/core/workspace_map.h"
#include "common/process/realtime.h"
#include "common/session/path_speed.h"
#include "deploy/launch/physics_command.h"
#include "deploy/palpate/task/task_warnings.h"
#include "device_node/simulation/hand.h"
#include "physics_node/scene/scene.h"

namespace palpate {
namespace {

constexpr double kLargestTip_m = 0.03;
constexpr double kSoftestTissue_pa = 200.0;  // brain: 500 to 3,000
constexpr double kSoftestSpring_newton_per_m = 5.0;
/// Of impedance and admittance displays that are sold.
constexpr double kStiffestDevice_newton_per_m = 50e3;
constexpr double kLikeliestFriction_ratio = 1.5;  // profile over simulated device
constexpr double kFrictionSpeed_m_per_s = 0.05;
constexpr double kPathStep_s = 2e-3;
constexpr double kLongestPath_s = 60.0;
constexpr double kNever_s = std::numeric_limits<double>::infinity();

/// The scene with springs in place of elastic bodies: what touches them is the same.
SceneConfig rigid(SceneConfig scene) {
  for (TissueConfig& tissue : scene.tissues) {
    if (std::holds_alternative<ElasticMaterial>(tissue.material)) {
      tissue.material = KelvinVoigtMaterial{};
    }
  }
  return scene;
}

/// When the path first touches tissue; infinity: never; NaN: unknown, as the path depends on the
/// force, or is too long to be followed. A pointer leads the hand away from it only now and then.
double first_touch_s(const physics::Scene& scene, const Side& side, double length_s) {
  return std::visit(
      [&](const auto& path) {
        if constexpr (std::is_same_v<std::decay_t<decltype(path)>, HostilePath>) {
          return kNaN;
        } else {
          const WorkspaceMap map(side.device.workspace);
          const physics::TissueMemory memory = scene.new_memory();
          for (double t_s = 0.0; t_s < std::min(length_s, kLongestPath_s); t_s += kPathStep_s) {
            const Vector3 tool_m =
                map.tool_position_world_m(device::target_on(path, t_s).position_m);
            if (scene.evaluate(tool_m, Vector3::Zero(), t_s, memory).contact_count > 0) return t_s;
          }
          return length_s > kLongestPath_s ? kNaN : kNever_s;
        }
      },
      side.hand.path);
}

double friction_newton(double viscous, double coulomb) {
  return coulomb + viscous * kFrictionSpeed_m_per_s;
}

void examine_side(const Session& session, const Side& side, const physics::Scene& scene,
                  std::vector<std::string>& warnings) {
  if (is_real(side.driver)) return;

  const double claimed = friction_newton(side.device.profile.viscous_newton_s_per_m,
                                         side.device.profile.coulomb_newton);
  const double has =
      friction_newton(side.simulated.viscous_newton_s_per_m, side.simulated.coulomb_newton);
  if (!side.simulated.per_axis && claimed > kLikeliestFriction_ratio * has) {
    warnings.push_back(
        fmt::format("device.profile: claims {:.3g} N of friction at {:g} m/s, the simulated "
                    "device has {:.3g} N: there is no guarantee; lower the profile, or let "
                    "`palpate identify` measure it",
                    claimed, kFrictionSpeed_m_per_s, has));
  }
  const double v_max = side.device.monitor.v_max_m_per_s;
  const PathSpeed fastest = top_speed_of(side.hand.path);
  if (fastest.m_per_s > v_max) {
    const std::string how =
        std::isfinite(fastest.m_per_s)
            ? fmt::format("moves at up to {:.3g} m/s, at {:.3g} s", fastest.m_per_s, fastest.at_s)
            : fmt::format("jumps from its end, at {:.3g} s, to its beginning", fastest.at_s);
    warnings.push_back(
        fmt::format("hand: its path {}; v_max is {:g} m/s: slow it down, or raise "
                    "mofc.guard_settings.v_max_m_per_s",
                    how, v_max));
  }
  if (session.scene.tissues.empty() || !session.physics_command.empty()) return;
  const double touch_s = first_touch_s(scene, side, session.duration_s);
  const bool is_led = side.hand.pointer && std::holds_alternative<HoldPath>(side.hand.path);
  if (touch_s == kNever_s && !is_led) {
    warnings.push_back(
        fmt::format("hand: its path touches no tissue within {:g} s; check the path, the places "
                    "of the tissues, and device.workspace",
                    session.duration_s));
  } else if (touch_s == 0.0) {
    warnings.push_back(
        "hand: its path begins inside tissue: which side it came from is not known, and the whole "
        "force begins at once; begin outside");
  }
}

/// A sampled wall of at most 2 b/T is passive with the device's viscous friction alone:
/// [Colgate97].
std::string limit_of_devices(const Session& session) {
  std::string text;
  for (const Side& side : session.sides) {
    const double limit = 2.0 * side.device.profile.viscous_newton_s_per_m * side.device.rate_hz;
    text += fmt::format("{}{}{:.3g} N/m", text.empty() ? "" : ", ",
                        side.name.empty() ? "" : side.name + ": ", limit);
  }
  return text;
}

void examine_tissue(const Session& session, const TissueConfig& tissue,
                    std::vector<std::string>& warnings) {
  const auto too_stiff = [&](const char* field, double value, const char* unit,
                             double newton_per_m) {
    if (newton_per_m <= kStiffestDevice_newton_per_m) return;
    warnings.push_back(fmt::format(
        "tissue \"{}\": {} = {:g} {}: {:.2g} N/m under the tool is beyond what any device renders, "
        "some {:g} N/m, and the clamp will hold most of it back; by the viscous friction of "
        "device.profile alone the limit is {} (2 b/T)",
        tissue.name, field, value, unit, newton_per_m, kStiffestDevice_newton_per_m,
        limit_of_devices(session)));
  };
  const auto soft = [&](const char* field, double value, const char* unit, const char* remedy) {
    warnings.push_back(fmt::format("tissue \"{}\": {} = {:g} {} is softer than any tissue; {}",
                                   tissue.name, field, value, unit, remedy));
  };
  if (const auto* elastic = std::get_if<ElasticMaterial>(&tissue.material)) {
    const char* const remedy = "give it in Pa: 15 kPa is 15000";
    // of a half space under a flat punch as wide as the tip: 2 a E/(1 − ν²)
    const double punch_m =
        2.0 * session.scene.tip_radius_m / (1.0 - elastic->poisson_ratio * elastic->poisson_ratio);
    too_stiff("elastic.young_pa", elastic->young_pa, "Pa", punch_m * elastic->young_pa);
    if (elastic->young_pa < kSoftestTissue_pa) {
      soft("elastic.young_pa", elastic->young_pa, "Pa", remedy);
    }
    for (const ElasticMaterial::Part& part : elastic->parts) {
      if (part.young_pa < kSoftestTissue_pa) {
        soft("elastic.part.young_pa", part.young_pa, "Pa", remedy);
      }
      too_stiff("elastic.part.young_pa", part.young_pa, "Pa", punch_m * part.young_pa);
    }
    return;
  }
  const auto& spring = std::get<KelvinVoigtMaterial>(tissue.material);
  too_stiff("stiffness_newton_per_m", spring.stiffness_newton_per_m, "N/m",
            spring.stiffness_newton_per_m);
  if (spring.stiffness_newton_per_m < kSoftestSpring_newton_per_m) {
    soft("stiffness_newton_per_m", spring.stiffness_newton_per_m, "N/m",
         "give it in N/m: 0.5 N/mm is 500");
  }
}

/// A name without '/' is looked up where the dynamic linker does. It is not opened: that would run
/// code of it.
bool is_library(const std::string& library) {
  namespace fs = std::filesystem;
  std::error_code error;
  if (library.find('/') != std::string::npos) return fs::is_regular_file(library, error);
  // NOLINTNEXTLINE(concurrency-mt-unsafe): nothing sets the environment
  const char* path = std::getenv("LD_LIBRARY_PATH");
  std::istringstream folders(std::string(path != nullptr ? path : "") +
                             ":/lib:/lib64:/usr/lib:/usr/lib64:/usr/local/lib");
  for (std::string folder; std::getline(folders, folder, ':');) {
    if (folder.empty()) continue;
    if (fs::exists(fs::path(folder) / library, error)) return true;
    for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
      const bool is_of_machine = it->path().filename().string().ends_with("-linux-gnu");
      if (is_of_machine && fs::exists(it->path() / library, error)) return true;
    }
  }
  return false;
}

}  // namespace

std::vector<std::string> session_warnings(const Session& session) {
  std::vector<std::string> warnings;
  if (const std::string spins = spin_warning(session.sides); !spins.empty()) {
    warnings.push_back(spins);
  }
  const auto too_large = [&](const char* field, double value) {
    if (value <= kLargestTip_m) return;
    warnings.push_back(fmt::format("{} = {:g}: is {:g} m; give it in metres: 3 mm are 0.003", field,
                                   value, value));
  };
  too_large("scene.tool.tip_radius_m", session.scene.tip_radius_m);
  too_large("scene.tool.shaft_radius_m", session.scene.shaft_radius_m);
  for (const TissueConfig& tissue : session.scene.tissues)
    examine_tissue(session, tissue, warnings);
  if (session.scene.tissues.empty() && session.physics_command.empty()) {
    warnings.push_back(
        "scene: has no tissue, so there is nothing to touch; add scene { tissue { … } }");
  }

  if (!session.physics_command.empty()) {
    try {
      static_cast<void>(program_of(session));
    } catch (const SetupError& error) {
      const std::string text = error.what();
      warnings.push_back(text.substr(session.file.size() + 2));
    }
  }
  std::error_code error;
  for (const Side& side : session.sides) {
    const auto* plugin = std::get_if<PluginConfig>(&side.driver);
    if (plugin == nullptr || is_library(plugin->library)) continue;
    const bool is_bare = plugin->library.find('/') == std::string::npos;
    warnings.push_back(
        "device.plugin.library: " + plugin->library +
        (is_bare
             ? ": in no folder of system libraries; one beside the session is ./" + plugin->library
             : ": no such library; build it, or give its path, relative to the folder of the "
               "session"));
  }
  const std::string& keys = session.security.key_folder;
  if (!keys.empty() && !std::filesystem::is_directory(keys, error)) {
    warnings.push_back("security.key_folder = \"" + keys +
                       "\": there is no such folder; palpate keygen makes one");
  }

  for (std::string& warning : task_warnings(session)) warnings.push_back(std::move(warning));
  const physics::Scene scene(rigid(session.scene));
  std::vector<std::pair<std::string, std::vector<std::string>>> of_sides;  // text, sides
  for (const Side& side : session.sides) {
    std::vector<std::string> texts;
    examine_side(session, side, scene, texts);
    for (const std::string& text : texts) {
      auto same = std::find_if(of_sides.begin(), of_sides.end(),
                               [&](const auto& known) { return known.first == text; });
      if (same == of_sides.end()) same = of_sides.insert(same, {text, {}});
      same->second.push_back(side.name);
    }
  }
  for (const auto& [text, names] : of_sides) {
    const bool is_of_all = names.size() == session.sides.size();
    warnings.push_back(is_of_all ? text : fmt::format("{}: {}", fmt::join(names, ", "), text));
  }
  return warnings;
}

}  // namespace palpate
