// SPDX-License-Identifier: Apache-2.0
// mujoco_physics_node — the physics of a session in MuJoCo: physics { command:
// ["mujoco_physics_node", "scene.xml"] }. deploy/sessions/engines/ has two scenes.
#include <cstdio>
#include <cstdlib>

#include "physics_node/engines/mujoco/mujoco_engine.h"

namespace {

/// Without these two MuJoCo would write a log file into the folder of the session.
void warn(const char* text) { std::fprintf(stderr, "MuJoCo: %s\n", text); }
void fail(const char* text) {
  warn(text);
  std::_Exit(EXIT_FAILURE);
}

}  // namespace

int main(int argc, char** argv) {
  mju_user_warning = warn;
  mju_user_error = fail;
  return palpate::sdk::run(
      argc, argv,
      {.name = "mujoco_physics_node",
       .description = "Physics in MuJoCo: an MJCF scene, the tool as its mocap body \"tool\".",
       .arguments = "the scene, an MJCF file"},
      [](const palpate::sdk::Setup& setup) {
        if (setup.arguments.size() != 1) {
          throw palpate::sdk::SetupError("mujoco_physics_node takes one scene; give an MJCF file");
        }
        return std::make_unique<palpate::engines::MujocoEngine>(setup, setup.arguments.front());
      });
}
