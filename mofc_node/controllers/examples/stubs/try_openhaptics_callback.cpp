// SPDX-License-Identifier: Apache-2.0
// try_openhaptics_callback [CONTROLLER] — the callback on a shaking hand; status 1 if it extracts
// energy.
#include <openhaptics_callback.h>

#include "shaking_hand.h"

static ShakingHand hand;

HHD hdGetCurrentDevice() { return 0; }
void hdBeginFrame(HHD) {}
void hdEndFrame(HHD) {}
void hdGetIntegerv(unsigned int, HDint* value) { *value = 1000; }
void hdGetDoublev(unsigned int, double* values) {
  values[0] = values[1] = 0.0;
  values[2] = 1e3 * hand.z();
}
void hdSetDoublev(unsigned int, const double* values) { hand.move(values[2]); }

static void wall(const double position_m[3], double force_newton[3]) {
  force_newton[2] = ShakingHand::wall_newton(position_m[2]);
}

int main(int argc, char** argv) {
  Loop loop;
  loop.controller = palpate_controller_create(argc > 1 ? argv[1] : "guard");
  loop.force_newton = wall;
  for (int k = 0; k < 2000; ++k) {
    if (servo(&loop) != HD_CALLBACK_CONTINUE) return 2;
  }
  palpate_controller_destroy(loop.controller);
  return hand.verdict();
}
