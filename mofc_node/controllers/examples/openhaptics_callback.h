// SPDX-License-Identifier: Apache-2.0
// openhaptics_callback.h — the servo callback of OpenHaptics, as the drivers of SOFA schedule it,
// with the force limited on its way: hdScheduleAsynchronous(servo, &loop,
// HD_MAX_SCHEDULER_PRIORITY). Compiled here against stubs/HD/hd.h, not against OpenHaptics.
#pragma once

#include <HD/hd.h>
#include <palpate_controllers.h>

struct Loop {
  palpate_controller* controller = nullptr;
  /// Of the scene, at this place [m]; it may take its time elsewhere and answer from a copy here.
  void (*force_newton)(const double position_m[3], double force_newton[3]) = nullptr;
  palpate_input input = {};
  palpate_stretch last = {};
};

inline HDCallbackCode HDCALLBACK servo(void* user) {
  Loop& loop = *static_cast<Loop*>(user);
  hdBeginFrame(hdGetCurrentDevice());
  HDint rate_hz = 1000;
  double position_mm[3];
  hdGetIntegerv(HD_INSTANTANEOUS_UPDATE_RATE, &rate_hz);
  hdGetDoublev(HD_CURRENT_POSITION, position_mm);
  for (int i = 0; i < 3; ++i) {
    loop.last.hand_position_at_end_m[i] = loop.input.hand_position_m[i] = 1e-3 * position_mm[i];
  }
  loop.last.duration_s = 1.0 / rate_hz;
  loop.force_newton(loop.input.hand_position_m, loop.input.requested_force_on_hand_newton);

  palpate_output output;
  palpate_controller_step(loop.controller, &loop.input, &output);  // no force if it fails
  hdSetDoublev(HD_CURRENT_FORCE, output.force_on_hand_newton);
  for (int i = 0; i < 3; ++i) loop.last.force_on_hand_newton[i] = output.force_on_hand_newton[i];
  loop.input.applied = &loop.last;
  loop.input.applied_count = 1;
  hdEndFrame(hdGetCurrentDevice());
  return HD_CALLBACK_CONTINUE;
}
