// SPDX-License-Identifier: Apache-2.0
// bullet_physics_node — a soft block in Bullet as the physics of a session: physics { command:
// ["bullet_physics_node"] }. deploy/sessions/engines/bullet_block.txtpb runs it.
#include <charconv>
#include <string>

#include "physics_node/engines/bullet/bullet_engine.h"

namespace {

using palpate::engines::BlockMaterial;
using palpate::sdk::SetupError;

double number(const std::string& text, const std::string& name, double least, double most) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc{} && end == text.data() + text.size() && value >= least && value <= most) {
    return value;
  }
  throw SetupError(name + " = " + text + ": must be a number from " + std::to_string(least) +
                   " to " + std::to_string(most));
}

BlockMaterial material_of(const std::vector<std::string>& arguments) {
  if (arguments.size() > 2) {
    throw SetupError("bullet_physics_node takes Young's modulus and Poisson's ratio at most");
  }
  BlockMaterial material;
  if (!arguments.empty()) {
    material.young_pascal = number(arguments[0], "Young's modulus in Pa", 1e3, 1e6);
  }
  if (arguments.size() > 1) {
    material.poisson_ratio = number(arguments[1], "Poisson's ratio", 0.0, 0.49);
  }
  return material;
}

}  // namespace

int main(int argc, char** argv) {
  return palpate::sdk::run(
      argc, argv,
      {.name = "bullet_physics_node",
       .description = "Physics in Bullet: a soft block of 100 x 100 x 50 mm below z = 0.",
       .arguments = "Young's modulus in Pa (10000), Poisson's ratio (0.4)"},
      [](const palpate::sdk::Setup& setup) {
        return std::make_unique<palpate::engines::BulletEngine>(setup,
                                                                material_of(setup.arguments));
      });
}
