/* SPDX-License-Identifier: Apache-2.0 */
/* The example plug-in with one fault, which its options name. */
#define palpate_device_driver_of right_driver_of
#include "example_device.c" /* NOLINT(bugprone-suspicious-include) */
#undef palpate_device_driver_of

#include <unistd.h>

static char fault[32];
static int readings;
static palpate_device_driver wrong;
static int64_t soft_end_ns; /* of "lease in software": it claims a watchdog, and has none */

static palpate_device* open_wrong(const char* options, const palpate_device_host* host, char* error,
                                  size_t error_size) {
  snprintf(fault, sizeof(fault), "%s", options);
  readings = 0;
  soft_end_ns = INT64_MAX;
  if (strncmp(fault, "wrist", 5) == 0) wrong.size = sizeof(wrong);
  if (strcmp(fault, "control characters") == 0) {
    snprintf(error, error_size, "no board\nat \x1b[31mport 3");
    return NULL;
  }
  return open_device("", host, error, error_size);
}

static void measure_wrong(palpate_device_reading* out) {
  if (strcmp(fault, "measures another force") == 0) out->measured_force_newton[2] = 9.0;
  if (strcmp(fault, "measures no number") == 0) out->measured_force_newton[0] = NAN;
  if (strcmp(fault, "measures too much") == 0) out->measured_force_newton[0] = 31.0;
  if (strcmp(fault, "held currents") == 0)
    out->turning_joule = 0.25, out->turned_newton[1] = 0.5, out->skew_ns = 300000;
  if (strcmp(fault, "turns no number") == 0) out->turning_joule = NAN;
  if (strcmp(fault, "skew of the past") == 0) out->skew_ns = -1;
  if (strcmp(fault, "skew of hours") == 0) out->skew_ns = INT64_MAX;
  if (strcmp(fault, "wrist turns endlessly") == 0) out->wrist_angle_rad[2] = 1001.0;
  if (strcmp(fault, "wrist angle is no number") == 0) out->wrist_angle_rad[0] = NAN;
  if (strcmp(fault, "wrist axis is short") == 0) out->wrist_axes[1][1] = 0.5;
  if (strcmp(fault, "wrist axis is no number") == 0) out->wrist_axes[2][0] = NAN;
  if (strcmp(fault, "wrist is too strong") == 0) out->wrist_torque_newton_m[1] = -0.11;
}

static void specify_wrong(const palpate_device* d, palpate_device_specification* out) {
  specify(d, out);
  /* as a library does that was made before the flag and its member */
  if (strcmp(fault, "older") == 0) out->flags &= ~(uint32_t)PALPATE_DEVICE_MEASURES_FORCE;
  if (strcmp(fault, "held currents") == 0) out->held_force_ratio = 2.5, out->turning_per_m = 21.0;
  if (strcmp(fault, "turns endlessly") == 0) out->turning_per_m = INFINITY;
  if (strcmp(fault, "held less") == 0) out->held_force_ratio = 0.5;
  if (strcmp(fault, "held no number") == 0) out->held_force_ratio = NAN;
  if (strcmp(fault, "no wrist") == 0) out->flags &= ~(uint32_t)PALPATE_DEVICE_HAS_WRIST;
  if (strcmp(fault, "wrist without motors") == 0) out->peak_torque_newton_m[2] = 0.0;
}

/* the newest of the readings so far that is so old */
static void age(palpate_device_reading* out) {
  enum { kKept = 64 };
  static palpate_device_reading kept[kKept];
  kept[readings % kKept] = *out;
  for (int i = readings; i > 0 && i > readings - kKept; --i) {
    const palpate_device_reading* const old = &kept[i % kKept];
    memcpy(out->position_m, old->position_m, sizeof(out->position_m));
    if (old->sampled_at_ns <= out->sampled_at_ns - 3000000) return;
  }
}

/* the force ends in the next call after its lease, if there is one */
static void end_in_software(palpate_device* d) {
  if (d->host->clock_ns(d->host->context) >= soft_end_ns) release_device(d);
}

static int read_wrong(palpate_device* d, palpate_device_reading* out) {
  end_in_software(d);
  const int error = read_device(d, out);
  ++readings;
  if (strcmp(fault, "exits") == 0) _exit(0);
  if (strcmp(fault, "crashes") == 0) abort();
  measure_wrong(out);
  if (strcmp(fault, "positions 3 ms old") == 0) age(out);
  if (strcmp(fault, "not finite") == 0 && readings > 100) out->position_m[1] = NAN;
  return error;
}

static int apply_wrong(palpate_device* d, const double force_newton[3], int64_t lease_ns,
                       palpate_device_reading* at_switch) {
  end_in_software(d);
  if (strcmp(fault, "lease in software") == 0 && lease_ns > 0) {
    soft_end_ns = d->host->clock_ns(d->host->context) + lease_ns;
    lease_ns = INT64_MAX / 4;
  }
  if (lease_ns > 0 && strcmp(fault, "late") == 0) lease_ns += 50000000;
  if (lease_ns > 0 && strcmp(fault, "no watchdog") == 0) lease_ns = INT64_MAX / 4;
  /* confirms that no force acts, while it goes on until its lease ends */
  const int goes_on = lease_ns <= 0 && strcmp(fault, "does not release") == 0;
  const int error =
      goes_on ? read_device(d, at_switch) : apply_force(d, force_newton, lease_ns, at_switch);
  if (goes_on) memset(at_switch->applied_force_newton, 0, sizeof(at_switch->applied_force_newton));
  measure_wrong(at_switch);
  return error;
}

static void release_wrong(palpate_device* d) {
  if (strcmp(fault, "does not release") != 0) release_device(d);
}

const palpate_device_driver* palpate_device_driver_of(uint32_t abi) {
  wrong = *right_driver_of(PALPATE_DEVICE_ABI);
  /* as a library has it that was made before wrists; open_wrong() knows better where there is one
   */
  wrong.size = offsetof(palpate_device_driver, set_wrist_torque);
  wrong.open = open_wrong;
  wrong.specification = specify_wrong;
  wrong.read = read_wrong;
  wrong.apply = apply_wrong;
  wrong.release = release_wrong;
  return abi == PALPATE_DEVICE_ABI ? &wrong : NULL;
}
