// SPDX-License-Identifier: Apache-2.0
// No session makes a node send what the next node refuses: every shipped session, and every number
// of the schema at the limits of its own range, through the codecs.
#include <google/protobuf/descriptor.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "common/core/check.h"
#include "common/session/session_file.h"
#include "deploy/lockstep/lockstep.h"
#include "palpate/v1/session.pb.h"
#include "tests/support/machine/places.h"

namespace palpate {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

/// Runs the session through encoded links and expects that each node accepts all it receives.
void expect_understood(Session session, Duration length) {
  // another driver or another path would follow from these
  session.faults = {};
  for (std::size_t i = 0; i < session.sides.size(); ++i) {
    SCOPED_TRACE(testing::Message() << "side " << i);
    Session one = session;
    one.sides = {session.sides[i]};
    Lockstep lockstep(one, {.links = LockstepLinks::kInproc}, {});
    lockstep.run_until(length);
    const auto expect_all = [](const LinkCounters& link, const char* name) {
      EXPECT_EQ(link.rejected, 0u) << name;
      EXPECT_GT(link.accepted, 0u) << name;
      EXPECT_EQ(link.ahead, 0u) << name;
    };
    expect_all(lockstep.device_counters().force_command, "force_command");
    expect_all(lockstep.mofc_counters().device_state, "device_state");
    expect_all(lockstep.mofc_counters().interaction, "interaction");
    expect_all(lockstep.physics_counters().tool_motion, "tool_motion");
  }
}

TEST(Ranges, NoShippedSessionIsRefused) {
  for (const char* const folder : {"/deploy/sessions", "/deploy/sessions/tools"}) {
    for (const auto& entry : fs::directory_iterator(test::source_dir() + folder)) {
      if (entry.path().extension() != ".txtpb") continue;
      SCOPED_TRACE(entry.path().filename());
      const Session session = load_session(entry.path());
      // elastic tissue is solved in full in each step of the ideal
      const bool is_elastic =
          std::any_of(session.scene.tissues.begin(), session.scene.tissues.end(),
                      [](const TissueConfig& tissue) {
                        return std::holds_alternative<ElasticMaterial>(tissue.material);
                      });
      expect_understood(session, is_elastic ? Duration(200ms) : Duration(1s));
    }
  }
}

/// In contact with everything that a tissue may have.
constexpr const char* kRich = R"(
name: "rich"
device { start_ramp_ms: 0 }
hand { hold { position_m { z: -0.004 } } }
scene {
  tool { tip_radius_m: 0.002 shaft_length_m: 0.1 }
  tissue {
    GEOMETRY
    MATERIAL
    motion { amplitude_m { z: 0.001 } frequency_hz: 2 }
  }
}
)";
const std::map<std::string, std::string> kGeometries = {
    {"half_space", "half_space {}"},
    {"sphere", "sphere { center_m { z: -0.05 } radius_m: 0.05 }"},
    {"box", "box { center_m { z: -0.05 } size_m { x: 0.1 y: 0.1 z: 0.1 } }"},
    {"capsule", "capsule { from_m { x: -0.1 z: -0.05 } to_m { x: 0.1 z: -0.05 } radius_m: 0.05 }"}};
const std::map<std::string, std::string> kMaterials = {{"kelvin_voigt", R"(kelvin_voigt {
        stiffness_newton_per_m: 400 damping_newton_s_per_m: 5 stiffening_newton_per_m3: 1e6
        relaxing_stiffness_newton_per_m: 200 friction_coefficient: 0.3
        inclusion { center_m { z: -0.005 } radius_m: 0.004 stiffness_newton_per_m: 900 } })"},
                                                       {"hunt_crossley", R"(hunt_crossley {
        stiffness_newton_per_m: 400 damping_newton_s_per_m: 5 friction_coefficient: 0.3 })"}};

std::string rich(const std::string& geometry, const std::string& material) {
  std::string text = kRich;
  text.replace(text.find("GEOMETRY"), 8, kGeometries.at(geometry));
  text.replace(text.find("MATERIAL"), 8, kMaterials.at(material));
  return text;
}

std::optional<Session> parsed(const std::string& text, const std::vector<std::string>& overrides) {
  try {
    return parse_session(text, "rich.txtpb", overrides);
  } catch (const SetupError&) {
    return std::nullopt;
  }
}

/// The paths of all numbers below a message of the session.
void collect(const google::protobuf::Descriptor& type, const std::string& path,
             std::vector<std::string>& numbers) {
  for (int i = 0; i < type.field_count(); ++i) {
    const auto& field = *type.field(i);
    const std::string child = path + "." + field.name() + (field.is_repeated() ? "[0]" : "");
    if (field.message_type() != nullptr) collect(*field.message_type(), child, numbers);
    if (field.cpp_type() == google::protobuf::FieldDescriptor::CPPTYPE_DOUBLE) {
      numbers.push_back(child);
    }
  }
}

/// What the session accepts of it at the ends of its range, to a factor: largest, smallest positive
/// and lowest.
std::vector<std::string> extremes(const std::string& text, const std::string& path) {
  std::vector<std::string> overrides;
  const auto first_accepted = [&](const auto& candidates) {
    for (const char* value : candidates) {
      const std::string one = path + "=" + value;
      if (!parsed(text, {one})) continue;
      overrides.push_back(one);
      return;
    }
  };
  first_accepted(std::array{"1e9", "1e6", "1e4", "1e3", "100", "50", "20", "10", "5", "2", "1",
                            "0.5", "0.1", "0.01"});
  first_accepted(std::array{"1e-300", "1e-9", "1e-6", "1e-4", "1e-3", "0.01", "0.1", "1"});
  first_accepted(std::array{"-1e9", "-1e6", "-1e4", "-1e3", "-100", "-10", "-1", "-0.1", "0"});
  return overrides;
}

void expect_understood_at_extremes(const std::string& text, const std::vector<std::string>& paths) {
  std::size_t runs = 0;
  for (const std::string& path : paths) {
    for (const std::string& extreme : extremes(text, path)) {
      // at the surface, and as deep as a hand may go
      for (const char* depth : {"hand.hold.position_m.z=-0.004", "hand.hold.position_m.z=-10"}) {
        std::vector<std::string> overrides{depth, extreme};
        SCOPED_TRACE(extreme + ", " + depth);
        const std::optional<Session> session = parsed(text, overrides);
        if (!session) continue;
        expect_understood(*session, 30ms);
        ++runs;
      }
    }
  }
  EXPECT_GT(runs, 2 * paths.size());
}

TEST(Ranges, NoTissueOfASessionIsRefused) {
  for (const auto& [name, unused] : kMaterials) {
    const std::string tissue = "scene.tissue[0].";
    std::vector<std::string> paths;
    collect(name == "kelvin_voigt" ? *v1::Scene::KelvinVoigt::descriptor()
                                   : *v1::Scene::HuntCrossley::descriptor(),
            tissue + name, paths);
    collect(*v1::Scene::Motion::descriptor(), tissue + "motion", paths);
    expect_understood_at_extremes(rich("half_space", name), paths);
  }
}

TEST(Ranges, NoShapeOrToolOfASessionIsRefused) {
  for (const auto& [name, unused] : kGeometries) {
    std::vector<std::string> paths;
    const std::string path = "scene.tissue[0]." + name;
    if (name == "half_space") collect(*v1::Scene::HalfSpace::descriptor(), path, paths);
    if (name == "sphere") collect(*v1::Scene::Sphere::descriptor(), path, paths);
    if (name == "box") collect(*v1::Scene::Box::descriptor(), path, paths);
    if (name == "capsule") collect(*v1::Scene::Capsule::descriptor(), path, paths);
    collect(*v1::Scene::Tool::descriptor(), "scene.tool", paths);
    // what acts on elastic tissue alone, of which there is none here
    std::erase_if(paths, [](const std::string& number) {
      return number.starts_with("scene.tool.needle") || number.starts_with("scene.tool.blade") ||
             number.starts_with("scene.tool.electrode");
    });
    expect_understood_at_extremes(rich(name, "kelvin_voigt"), paths);
  }
}

TEST(Ranges, NoWorkspaceOrLimitOfASessionIsRefused) {
  std::vector<std::string> paths;
  collect(*v1::Device::Workspace::descriptor(), "device.workspace", paths);
  for (const char* path :
       {"device.peak_force_newton", "device.simulated.peak_force_newton",
        "device.slew_newton_per_s", "device.longest_lease_us", "hand.stiffness_newton_per_m",
        "hand.damping_newton_s_per_m", "physics.reach_m", "mofc.handover_newton_per_s"}) {
    paths.emplace_back(path);
  }
  expect_understood_at_extremes(rich("half_space", "kelvin_voigt"), paths);
}

// All at once, and metres deep.
TEST(Ranges, TheStiffestTissueMetresDeepIsNotRefused) {
  const std::vector<std::string> hard = {"stiffness_newton_per_m=1e6",
                                         "damping_newton_s_per_m=1e4",
                                         "stiffening_newton_per_m3=1e9",
                                         "relaxing_stiffness_newton_per_m=1e6",
                                         "relaxation_time_ms=1",
                                         "friction_coefficient=10",
                                         "inclusion[0].stiffness_newton_per_m=1e6",
                                         "inclusion[0].transition_m=1e-9",
                                         "isotropic_damping=true"};
  const std::vector<std::string> power = {"stiffness_newton_per_m=1e6",
                                          "damping_newton_s_per_m=1e4", "exponent=5",
                                          "depth_m=1e-4", "friction_coefficient=10"};
  for (const char* depth_m : {"-0.004", "-0.1", "-10"}) {
    for (const auto& [name, fields] :
         {std::pair{"kelvin_voigt", hard}, std::pair{"hunt_crossley", power}}) {
      SCOPED_TRACE(std::string(name) + " at " + depth_m);
      std::vector<std::string> overrides{std::string("hand.hold.position_m.z=") + depth_m,
                                         "device.workspace.scale_ratio=50"};
      for (const std::string& field : fields) {
        overrides.push_back(std::string("scene.tissue[0].") + name + "." + field);
      }
      expect_understood(parse_session(rich("half_space", name), "rich.txtpb", overrides), 100ms);
    }
  }
}

}  // namespace
}  // namespace palpate
