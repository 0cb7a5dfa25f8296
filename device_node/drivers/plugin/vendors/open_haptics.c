/* SPDX-License-Identifier: Apache-2.0 */
/* 3D Systems Touch and PHANToM devices by the vendor's library libHD (OpenHaptics), which is loaded
 * as the device is opened. NEVER RUN ON HARDWARE: tested against a stand-in of the library.
 *
 *   cc -shared -fPIC -o open_haptics.so -I device_node/drivers/plugin \
 *      device_node/drivers/plugin/vendors/open_haptics.c -ldl
 *   device { rate_hz: 500 reply_us: 1500
 *            plugin { library: "open_haptics.so" options: "resolution_m=55e-6" } }
 *
 * The library switches forces in a thread of its own, 1000 times a second: a switch waits for that,
 * which is why the tick is slower. That thread ends a force with its lease; nothing does while the
 * process is stopped, and the guarantee is reported as not available then. Options device=NAME, of
 * several devices, and held_force_ratio=R (palpate_device.h), which is known for no device: without
 * it no force acts that the session does not accept. */
#include "servo_exchange.h"
#include "vendor_library.h"

enum { kButtons = 0x2000, kPosition = 0x2050, kUsableWorkspace = 0x2551 };
enum { kMaxForce = 0x2603, kMaxContinuous = 0x2604, kForce = 0x2700, kForceOutput = 0x4000 };
static const unsigned int kNoDevice = 0xFFFFFFFFu;

typedef struct {
  unsigned int code;
  int internal_code;
  unsigned int device;
} hd_error;

struct palpate_device {
  const palpate_device_host* host;
  void* library;
  unsigned int id;
  palpate_device_specification specification;
  double middle_mm[3]; /* of the workspace; the library's x is right, y up, z to the person */
  servo_exchange servo;
  /* the library */
  unsigned int (*init_device)(const char* name);
  void (*disable_device)(unsigned int id);
  void (*begin_frame)(unsigned int id), (*end_frame)(unsigned int id);
  void (*get_doubles)(unsigned int name, double* values);
  void (*get_integers)(unsigned int name, int* values);
  void (*set_doubles)(unsigned int name, const double* values);
  void (*enable)(unsigned int name);
  hd_error (*get_error)(void);
  unsigned long (*schedule)(unsigned int (*run)(void*), void* context, unsigned short priority);
  void (*unschedule)(unsigned long task);
  void (*start_scheduler)(void), (*stop_scheduler)(void);
  unsigned long task;
};

static int64_t now_ns(const palpate_device* d) { return d->host->clock_ns(d->host->context); }

/* In the library's thread. */
static unsigned int on_frame(void* context) {
  palpate_device* d = context;
  palpate_device_reading frame = {0};
  double at_mm[3];
  int buttons = 0, has_lease = 0;
  d->begin_frame(d->id);
  d->get_doubles(kPosition, at_mm);
  d->get_integers(kButtons, &buttons);
  frame.sampled_at_ns = now_ns(d);
  double* f = frame.applied_force_newton;
  const double* given = servo_force(&d->servo, frame.sampled_at_ns, &has_lease);
  limit_force(given, has_lease, d->specification.peak_force_newton, f);
  const double force[3] = {f[0], f[2], -f[1]};
  d->set_doubles(kForce, force);
  d->end_frame(d->id);
  if (d->get_error().code != 0) atomic_store(&d->servo.has_failed, 1);
  frame.position_m[0] = 1e-3 * (at_mm[0] - d->middle_mm[0]);
  frame.position_m[1] = 1e-3 * (d->middle_mm[2] - at_mm[2]);
  frame.position_m[2] = 1e-3 * (at_mm[1] - d->middle_mm[1]);
  frame.orientation_wxyz[0] = 1.0;
  frame.buttons = (uint32_t)buttons;
  servo_publish(&d->servo, &frame);
  return 1; /* once more */
}

static int read_device(palpate_device* d, palpate_device_reading* out) {
  return servo_read(&d->servo, now_ns(d), out);
}

static int apply_force(palpate_device* d, const double force_newton[3], int64_t lease_ns,
                       palpate_device_reading* at_switch) {
  return servo_apply(&d->servo, d->host, force_newton, lease_ns, at_switch);
}

static void release_device(palpate_device* d) {
  const double none[3] = {0.0, 0.0, 0.0};
  palpate_device_reading passed = {0};
  (void)apply_force(d, none, 0, &passed);
}

static void close_device(palpate_device* d) {
  if (d->task != 0) {
    release_device(d);
    d->stop_scheduler();
    d->unschedule(d->task);
  }
  if (d->id != kNoDevice) d->disable_device(d->id);
  if (d->library != NULL) dlclose(d->library);
  free(d);
}

static palpate_device* open_device(const char* options, const palpate_device_host* host,
                                   char* error, size_t error_size) {
  static const char* const kFunctions[] = {
      "hdInitDevice",  "hdDisableDevice",  "hdBeginFrame",   "hdEndFrame", "hdGetDoublev",
      "hdGetIntegerv", "hdSetDoublev",     "hdEnable",       "hdGetError", "hdScheduleAsynchronous",
      "hdUnschedule",  "hdStartScheduler", "hdStopScheduler"};
  palpate_device* d = calloc(1, sizeof(*d));
  if (d == NULL) return NULL;
  d->host = host;
  d->id = kNoDevice;
  palpate_device_specification* s = &d->specification;
  snprintf(s->model_name, sizeof(s->model_name), "OpenHaptics");
  s->button_count = 2;
  s->position_resolution_m = option_number(options, "resolution_m");
  s->held_force_ratio = held_force_ratio(options);
  if (s->position_resolution_m == 0.0) {
    snprintf(error, error_size, "give resolution_m in the options, from the device's data sheet");
  } else {
    d->library = load_library(options, "libHD.so", kFunctions, (void**)&d->init_device,
                              sizeof(kFunctions) / sizeof(kFunctions[0]), error, error_size);
  }
  if (d->library == NULL) {
    close_device(d);
    return NULL;
  }
  char name[64];
  d->id = d->init_device(option_text(options, "device", name, sizeof(name)) ? name : NULL);
  if (d->id == kNoDevice || d->get_error().code != 0) {
    snprintf(error, error_size,
             "libHD opens no device: is it set up in the vendor's program, and may you use it?");
    close_device(d);
    return NULL;
  }
  double workspace_mm[6]; /* least x, y, z, largest x, y, z */
  d->get_doubles(kUsableWorkspace, workspace_mm);
  for (int i = 0; i < 3; ++i) {
    const double half_mm = 0.5 * (workspace_mm[i + 3] - workspace_mm[i]);
    d->middle_mm[i] = workspace_mm[i] + half_mm;
    s->workspace_half_extent_m[i == 0 ? 0 : 3 - i] = 1e-3 * half_mm;
  }
  d->get_doubles(kMaxForce, &s->peak_force_newton);
  d->get_doubles(kMaxContinuous, &s->continuous_force_newton);
  d->enable(kForceOutput);
  d->task = d->schedule(on_frame, d, 500);
  d->start_scheduler();
  release_device(d); /* until the first frames are there */
  return d;
}

PALPATE_VENDOR_DRIVER(NULL)
