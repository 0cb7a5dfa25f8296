/* SPDX-License-Identifier: Apache-2.0 */
/* A driver in a shared library, in C: a device that is pushed about by its own force only. Build it
 * with `cc -shared -fPIC -o example_device.so example_device.c`, name it in the session:
 * device { plugin { library: "example_device.so" } }. See palpate_device.h. With options:
 * "no watchdog" its motors go on until they are told, as those of most boards do. Its handle turns
 * about fixed axes, pushed by their torque only: device { wrist {} }. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "palpate_device.h"

struct palpate_device {
  const palpate_device_host* host;
  double position_m[3], force_newton[3];
  double angle_rad[3], torque_newton_m[3], next_newton_m[3]; /* of the wrist */
  int64_t moved_until_ns, lease_end_ns;
  int has_watchdog;
};

static const double kPeakNewton = 3.0, kNewtonSecondPerMetre = 20.0;
static const double kPeakNewtonMetre = 0.1, kNewtonMetreSecond = 0.05;

static void move(palpate_device* d) {
  const int64_t now = d->host->clock_ns(d->host->context);
  /* without a watchdog a force acts until this call, which ends it if its lease is over */
  const int64_t end = now < d->lease_end_ns || !d->has_watchdog ? now : d->lease_end_ns;
  for (int i = 0; i < 3; ++i) {
    if (end > d->moved_until_ns) {
      d->position_m[i] +=
          d->force_newton[i] / kNewtonSecondPerMetre * 1e-9 * (double)(end - d->moved_until_ns);
      d->angle_rad[i] +=
          d->torque_newton_m[i] / kNewtonMetreSecond * 1e-9 * (double)(end - d->moved_until_ns);
    }
    if (now >= d->lease_end_ns) d->force_newton[i] = d->torque_newton_m[i] = 0.0;
  }
  d->moved_until_ns = now;
}

static void fill(const palpate_device* d, palpate_device_reading* out) {
  out->buttons = 0;
  memcpy(out->position_m, d->position_m, sizeof(d->position_m));
  memcpy(out->applied_force_newton, d->force_newton, sizeof(d->force_newton));
  out->orientation_wxyz[0] = 1.0;
  out->orientation_wxyz[1] = out->orientation_wxyz[2] = out->orientation_wxyz[3] = 0.0;
  out->sampled_at_ns = d->moved_until_ns;
  /* a real one takes this from its current sensors; an older Palpate does not know the member */
  if (PALPATE_DEVICE_KNOWS(palpate_device_reading, out, measured_force_newton)) {
    memcpy(out->measured_force_newton, d->force_newton, sizeof(d->force_newton));
  }
  if (PALPATE_DEVICE_KNOWS(palpate_device_reading, out, wrist_torque_newton_m)) {
    memcpy(out->wrist_angle_rad, d->angle_rad, sizeof(d->angle_rad));
    memcpy(out->wrist_torque_newton_m, d->torque_newton_m, sizeof(d->torque_newton_m));
    for (int i = 0; i < 3; ++i) out->wrist_axes[i][i] = 1.0;
  }
}

static palpate_device* open_device(const char* options, const palpate_device_host* host,
                                   char* error, size_t error_size) {
  const int has_watchdog = strcmp(options, "") == 0;
  if (!has_watchdog && strcmp(options, "no watchdog") != 0) {
    snprintf(error, error_size, "knows no option \"%s\"; \"no watchdog\" is one", options);
    return NULL;
  }
  palpate_device* d = calloc(1, sizeof(*d));
  d->host = host;
  d->has_watchdog = has_watchdog;
  d->moved_until_ns = d->lease_end_ns = host->clock_ns(host->context);
  return d;
}

static void close_device(palpate_device* d) { free(d); }

static void specify(const palpate_device* d, palpate_device_specification* out) {
  strcpy(out->model_name, "example plug-in");
  for (int i = 0; i < 3; ++i) out->workspace_half_extent_m[i] = 0.1;
  out->peak_force_newton = out->continuous_force_newton = kPeakNewton;
  out->flags = (d->has_watchdog ? PALPATE_DEVICE_HAS_WATCHDOG : 0) | PALPATE_DEVICE_MEASURES_FORCE;
  if (PALPATE_DEVICE_KNOWS(palpate_device_specification, out, peak_torque_newton_m)) {
    out->flags |= PALPATE_DEVICE_HAS_WRIST;
    for (int i = 0; i < 3; ++i) out->peak_torque_newton_m[i] = kPeakNewtonMetre;
  }
}

static int read_device(palpate_device* d, palpate_device_reading* out) {
  move(d);
  fill(d, out);
  return PALPATE_DEVICE_OK;
}

static int apply_force(palpate_device* d, const double force_newton[3], int64_t lease_ns,
                       palpate_device_reading* at_switch) {
  move(d);
  for (int i = 0; i < 3; ++i) {
    d->force_newton[i] = lease_ns > 0 ? force_newton[i] : 0.0;
    d->torque_newton_m[i] = lease_ns > 0 ? d->next_newton_m[i] : 0.0;
    d->next_newton_m[i] = 0.0;
  }
  d->lease_end_ns = d->moved_until_ns + (lease_ns > 0 ? lease_ns : 0);
  fill(d, at_switch);
  return PALPATE_DEVICE_OK;
}

static void release_device(palpate_device* d) {
  move(d);
  memset(d->force_newton, 0, sizeof(d->force_newton));
  memset(d->torque_newton_m, 0, sizeof(d->torque_newton_m));
}

static void set_wrist_torque(palpate_device* d, const double torque_newton_m[3]) {
  memcpy(d->next_newton_m, torque_newton_m, sizeof(d->next_newton_m));
}

const palpate_device_driver* palpate_device_driver_of(uint32_t abi) {
  static const palpate_device_driver kDriver = {sizeof(palpate_device_driver),
                                                PALPATE_DEVICE_ABI,
                                                open_device,
                                                close_device,
                                                specify,
                                                read_device,
                                                apply_force,
                                                release_device,
                                                NULL,
                                                NULL,
                                                set_wrist_torque};
  return abi == PALPATE_DEVICE_ABI ? &kDriver : NULL;
}
