/* SPDX-License-Identifier: Apache-2.0 */
/* Force Dimension devices (omega, delta, sigma; Novint Falcon) by the vendor's library libdhd,
 * which is loaded as the device is opened. NEVER RUN ON HARDWARE: tested against a stand-in of the
 * library.
 *
 *   cc -shared -fPIC -o force_dimension.so -I device_node/drivers/plugin \
 *      device_node/drivers/plugin/vendors/force_dimension.c -ldl
 *   device { plugin { library: "force_dimension.so"
 *     options: "peak_newton=12 continuous_newton=12 half_extent_m=0.05 resolution_m=1e-5" } }
 *
 * All four options are needed: the library does not tell them. held_force_ratio=R
 * (palpate_device.h) is known for no device: without it no force acts that the session does not
 * accept. Even with it turning_joule stays 0, because the Jacobian of the arm is unknown: the work
 * that held currents do while the arm turns is in no account. Force and position are separate
 * calls: skew_ns is the time of both. The firmware's watchdog ends a force 10 ms after the last
 * command: later than a lease may end, so the guarantee is reported as not available while the
 * process is stopped. Gravity compensation stays with the device. */
#include "vendor_library.h"

enum { kWatchdog = 80 }; /* of 125 µs */

struct palpate_device {
  const palpate_device_host* host;
  void* library;
  char id;
  palpate_device_specification specification;
  double force_newton[3]; /* acting, D */
  int64_t lease_end_ns;
  /* the library */
  int (*open)(void);
  int (*close)(char id);
  int (*enable_force)(unsigned char on, char id);
  int (*get_position)(double* x, double* y, double* z, char id);
  int (*set_force)(double x, double y, double z, char id);
  unsigned int (*get_buttons)(char id);
  int (*set_watchdog)(unsigned char value, char id);
};

/* Its x points to the person, y to the right, z up. */
static int send_force(palpate_device* d, const double force_newton[3], int64_t lease_ns) {
  limit_force(force_newton, lease_ns > 0, d->specification.peak_force_newton, d->force_newton);
  d->lease_end_ns = d->host->clock_ns(d->host->context) + (lease_ns > 0 ? lease_ns : 0);
  const int result =
      d->set_force(-d->force_newton[1], d->force_newton[0], d->force_newton[2], d->id);
  return result >= 0 ? PALPATE_DEVICE_OK : PALPATE_DEVICE_FAILED; /* > 0: motors saturated */
}

static void release_device(palpate_device* d) {
  const double none[3] = {0.0, 0.0, 0.0};
  (void)send_force(d, none, 0);
}

/* `began_ns`: before the force was sent, or the position asked for. */
static int sample(palpate_device* d, int64_t began_ns, palpate_device_reading* out) {
  double x = 0.0;
  double y = 0.0;
  double z = 0.0;
  if (d->get_position(&x, &y, &z, d->id) < 0) {
    release_device(d);
    return PALPATE_DEVICE_UNPLUGGED;
  }
  out->sampled_at_ns = d->host->clock_ns(d->host->context);
  if (PALPATE_DEVICE_KNOWS(palpate_device_reading, out, skew_ns)) {
    out->skew_ns = out->sampled_at_ns - began_ns;
  }
  out->position_m[0] = y;
  out->position_m[1] = -x;
  out->position_m[2] = z;
  out->buttons = d->get_buttons(d->id);
  memcpy(out->applied_force_newton, d->force_newton, sizeof(d->force_newton));
  return PALPATE_DEVICE_OK;
}

static int read_device(palpate_device* d, palpate_device_reading* out) {
  const int64_t began_ns = d->host->clock_ns(d->host->context);
  if (began_ns >= d->lease_end_ns) release_device(d);
  return sample(d, began_ns, out);
}

static int apply_force(palpate_device* d, const double force_newton[3], int64_t lease_ns,
                       palpate_device_reading* at_switch) {
  const int64_t began_ns = d->host->clock_ns(d->host->context);
  const int error = send_force(d, force_newton, lease_ns);
  return error != PALPATE_DEVICE_OK ? error : sample(d, began_ns, at_switch);
}

static void close_device(palpate_device* d) {
  release_device(d);
  d->close(d->id);
  dlclose(d->library);
  free(d);
}

static palpate_device* open_device(const char* options, const palpate_device_host* host,
                                   char* error, size_t error_size) {
  static const char* const kFunctions[] = {"dhdOpen",        "dhdClose",    "dhdEnableForce",
                                           "dhdGetPosition", "dhdSetForce", "dhdGetButtonMask",
                                           "dhdSetWatchdog"};
  palpate_device* d = calloc(1, sizeof(*d));
  if (d == NULL) return NULL;
  d->host = host;
  palpate_device_specification* s = &d->specification;
  snprintf(s->model_name, sizeof(s->model_name), "Force Dimension");
  s->peak_force_newton = option_number(options, "peak_newton");
  s->continuous_force_newton = option_number(options, "continuous_newton");
  s->position_resolution_m = option_number(options, "resolution_m");
  s->held_force_ratio = held_force_ratio(options);
  for (int i = 0; i < 3; ++i)
    s->workspace_half_extent_m[i] = option_number(options, "half_extent_m");
  s->button_count = 1;
  if (s->peak_force_newton == 0.0 || s->continuous_force_newton == 0.0 ||
      s->position_resolution_m == 0.0 || s->workspace_half_extent_m[0] == 0.0) {
    snprintf(
        error, error_size,
        "give peak_newton, continuous_newton, half_extent_m and resolution_m in the options, from "
        "the device's data sheet");
    free(d);
    return NULL;
  }
  d->library = load_library(options, "libdhd.so", kFunctions, (void**)&d->open,
                            sizeof(kFunctions) / sizeof(kFunctions[0]), error, error_size);
  if (d->library == NULL) {
    free(d);
    return NULL;
  }
  const int id = d->open();
  if (id >= 0) {
    d->id = (char)id;
    release_device(d);
    if (d->set_watchdog(kWatchdog, d->id) < 0) {
      host->prompt(host->context,
                   "the device has no watchdog: its last force goes on when messages stop");
    }
    if (d->enable_force(1, d->id) >= 0) return d;
    d->close(d->id);
  }
  snprintf(error, error_size,
           "libdhd opens no device: is it connected, calibrated, and may you use it?");
  dlclose(d->library);
  free(d);
  return NULL;
}

PALPATE_VENDOR_DRIVER(NULL)
