// SPDX-License-Identifier: Apache-2.0
// Presses a tool 2 mm into the first tissue of a session, and prints the force. In C++17.
//   press SESSION
#include <cstdio>
#include <palpate_tissue.hpp>

int main(int count, char** arguments) try {
  const auto scene = palpate::tissue::Scene::load(count > 1 ? arguments[1] : "");
  palpate::tissue::Batch batch(scene);
  for (int k = 0; k <= 200; ++k) {
    batch.tool().position_m[2] = scene.tip_radius_m() - 1e-5 * k;
    batch.step(0.001);
  }
  const palpate_tool_force& force = batch.force();
  std::printf("force: %.3f N, within %.3f N\n", force.force_on_tool_newton[2], force.error_newton);
  return 0;
} catch (const palpate::tissue::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 2;
}
