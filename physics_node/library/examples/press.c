/* SPDX-License-Identifier: Apache-2.0
 * Presses a tool 2 mm into the first tissue of a session, and prints the force. In C.
 *   press_c SESSION */
#include <palpate_tissue.h>
#include <stdio.h>

int main(int count, char** arguments) {
  palpate_scene* scene = palpate_scene_load(count > 1 ? arguments[1] : "", NULL, 0);
  palpate_batch* batch = scene != NULL ? palpate_batch_create(scene, 1, 1, 1) : NULL;
  palpate_tissue_status status = batch != NULL ? PALPATE_TISSUE_OK : PALPATE_TISSUE_FAILED;
  const double top_m = palpate_scene_tip_radius_m(scene);
  for (int k = 0; k <= 200 && status == PALPATE_TISSUE_OK; ++k) {
    palpate_batch_tools(batch)->position_m[2] = top_m - 1e-5 * k;
    status = palpate_batch_step(batch, 0.001, 1);
  }
  if (status == PALPATE_TISSUE_OK) {
    const palpate_tool_force* force = palpate_batch_forces(batch);
    printf("force: %.3f N, within %.3f N\n", force->force_on_tool_newton[2], force->error_newton);
  } else {
    fprintf(stderr, "%s\n", palpate_tissue_error());
  }
  palpate_batch_destroy(batch);
  palpate_scene_destroy(scene);
  return status == PALPATE_TISSUE_OK ? 0 : 2;
}
