// SPDX-License-Identifier: Apache-2.0
// force_half_space — 400 N/m below z = 0, as an engine that tells only a force.
#include <algorithm>
#include <memory>

#include "physics_node/sdk/physics.h"

namespace {

class ForceHalfSpace final : public palpate::sdk::Engine {
  palpate::sdk::Answer step(const palpate::sdk::Motion& motion) override {
    return {.force_on_tool_newton =
                palpate::sdk::Vector3(0.0, 0.0, 400.0 * std::max(0.0, -motion.position_m.z()))};
  }
};

}  // namespace

int main(int argc, char** argv) {
  return palpate::sdk::run(
      argc, argv, {.name = "force_half_space", .description = "A half-space that tells its force."},
      [](const palpate::sdk::Setup&) { return std::make_unique<ForceHalfSpace>(); });
}
