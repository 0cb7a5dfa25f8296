/* SPDX-License-Identifier: Apache-2.0 */
/* Stands in for libHD and libdhd: a device that its own force displaces, in the frames and units of
 * these libraries. */
#include <pthread.h>
#include <stdatomic.h>
#include <string.h>
#include <unistd.h>

static double force_newton[3];
static const double kRest_mm[3] = {1.0, 2.0, 3.0};

/* --- libdhd: metres, x to the person, y to the right, z up -------------------------------------
 */

int dhdOpen(void) { return 0; }
int dhdClose(char id) { return id; }
int dhdEnableForce(unsigned char on, char id) { return on == 1 ? id : -1; }
unsigned int dhdGetButtonMask(char id) { return 1u + (unsigned int)id; }
int dhdSetWatchdog(unsigned char value, char id) { return value > 0 ? id : -1; }
int dhdSetForce(double x, double y, double z, char id) {
  force_newton[0] = x;
  force_newton[1] = y;
  force_newton[2] = z;
  return id;
}
int dhdGetPosition(double* x, double* y, double* z, char id) {
  *x = 1e-3 * kRest_mm[0] + 0.01 * force_newton[0];
  *y = 1e-3 * kRest_mm[1] + 0.01 * force_newton[1];
  *z = 1e-3 * kRest_mm[2] + 0.01 * force_newton[2];
  return id;
}

/* --- libHD: millimetres, x to the right, y up, z to the person ---------------------------------
 */

typedef struct {
  unsigned int code;
  int internal_code;
  unsigned int device;
} hd_error;

static unsigned int (*on_frame)(void*);
static void* frame_context;
static atomic_int is_running;
static pthread_t scheduler;

unsigned int hdInitDevice(const char* name) {
  return name != NULL && strcmp(name, "absent") == 0 ? 0xFFFFFFFFu : 0;
}
void hdDisableDevice(unsigned int id) { (void)id; }
void hdBeginFrame(unsigned int id) { (void)id; }
void hdEndFrame(unsigned int id) { (void)id; }
void hdEnable(unsigned int name) { (void)name; }
hd_error hdGetError(void) { return (hd_error){0, 0, 0}; }
void hdGetIntegerv(unsigned int name, int* values) { *values = name == 0x2000 ? 2 : -1; }
void hdSetDoublev(unsigned int name, const double* values) {
  if (name == 0x2700) memcpy(force_newton, values, sizeof(force_newton));
}
void hdGetDoublev(unsigned int name, double* values) {
  static const double kWorkspace_mm[6] = {-80.0, -50.0, -30.0, 80.0, 70.0, 30.0};
  if (name == 0x2551) memcpy(values, kWorkspace_mm, sizeof(kWorkspace_mm));
  if (name == 0x2603) *values = 3.3;
  if (name == 0x2604) *values = 0.88;
  for (int i = 0; name == 0x2050 && i < 3; ++i) values[i] = kRest_mm[i] + 10.0 * force_newton[i];
}
unsigned long hdScheduleAsynchronous(unsigned int (*function)(void*), void* context,
                                     unsigned short priority) {
  on_frame = function;
  frame_context = context;
  return priority;
}
void hdUnschedule(unsigned long task) { (void)task; }
static void* run(void* context) {
  (void)context;
  while (atomic_load(&is_running) && on_frame(frame_context) == 1) usleep(1000);
  return NULL;
}
void hdStartScheduler(void) {
  atomic_store(&is_running, 1);
  pthread_create(&scheduler, NULL, run, NULL);
}
void hdStopScheduler(void) {
  atomic_store(&is_running, 0);
  pthread_join(scheduler, NULL);
}
