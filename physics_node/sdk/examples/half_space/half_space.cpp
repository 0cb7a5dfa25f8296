// SPDX-License-Identifier: Apache-2.0
// half_space — a soft half-space below z = 0: `palpate launch half_space.txtpb` renders it.
#include <palpate/physics.h>

namespace {

class HalfSpace final : public palpate::sdk::Engine {
  palpate::sdk::Answer step(const palpate::sdk::Motion& motion) override {
    return {.contacts = {{.normal = {0.0, 0.0, 1.0},
                          .penetration_m = -motion.position_m.z(),
                          .stiffness_newton_per_m = 400.0,
                          .damping_newton_s_per_m = 1.0}}};
  }
  std::vector<palpate::sdk::Surface> surfaces() override {
    return {{.name = "half-space",
             .vertices_m = {-0.1F, -0.1F, 0, 0.1F, -0.1F, 0, 0.1F, 0.1F, 0, -0.1F, 0.1F, 0},
             .triangles = {0, 1, 2, 0, 2, 3}}};
  }
};

}  // namespace

int main(int argc, char** argv) {
  return palpate::sdk::run(
      argc, argv, {.name = "half_space", .description = "A soft half-space."},
      [](const palpate::sdk::Setup&) { return std::make_unique<HalfSpace>(); });
}
