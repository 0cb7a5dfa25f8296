/* SPDX-License-Identifier: Apache-2.0 */
/* plain_loop - a loop of one's own in C: a wall of 3000 N/m below z = 0 and a hand that shakes.
 *   plain_loop_c [CONTROLLER]    prints the work of the hand; status 1 if it extracts energy */
#include <math.h>
#include <palpate_controllers.h>
#include <stdio.h>

int main(int argc, char** argv) {
  const double T = 0.001, f_d = 0.1, f_co = 0.1, K = 3000.0; /* period, friction, wall */
  palpate_controller* controller = palpate_controller_create(argc > 1 ? argv[1] : "guard");
  if (palpate_controller_set(controller, "rate_hz", 1.0 / T) != PALPATE_OK ||
      palpate_controller_set(controller, "lease_s", T) != PALPATE_OK ||
      palpate_controller_set(controller, "viscous_newton_s_per_m", f_d) != PALPATE_OK ||
      palpate_controller_set(controller, "coulomb_newton", f_co) != PALPATE_OK) {
    fprintf(stderr, "%s\n", palpate_controller_error(controller));
    return 2;
  }
  double work_joule = 0.0;
  palpate_stretch last = {.duration_s = T};
  palpate_input input = {.applied = &last};
  palpate_output output = {0};
  for (int k = 0; k < 2000; ++k) {
    const double z = 0.003 * cos(0.1257 * k); /* here the position is read */
    const double d = k == 0 ? 0.0 : z - last.hand_position_at_end_m[2];
    const double depth = z < 0.0 ? -z : 0.0;
    work_joule += f_d * d * d / T + f_co * fabs(d) - last.force_on_hand_newton[2] * d;
    last.hand_position_at_end_m[2] = input.hand_position_m[2] = z;
    input.applied_count = k > 0;
    input.requested_force_on_hand_newton[2] = K * depth;
    input.stored_energy_joule = 0.5 * K * depth * depth;
    if (palpate_controller_step(controller, &input, &output) != PALPATE_OK) return 2;
    last.force_on_hand_newton[2] = output.force_on_hand_newton[2]; /* here it is commanded */
  }
  palpate_controller_destroy(controller);
  printf("work of the hand: %.3f mJ\n", 1e3 * work_joule);
  return work_joule < -1e-6;
}
