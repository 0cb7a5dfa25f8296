/* SPDX-License-Identifier: Apache-2.0 */
/* The example plug-in without a watchdog, whose motors outlive the program: the file that the
 * options name ("KIND:FILE") has the force that they were last told, and the largest ever. */
#define palpate_device_driver_of example_driver_of
#include "example_device.c" /* NOLINT(bugprone-suspicious-include) */
#undef palpate_device_driver_of

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

struct board {
  double force_newton, largest_newton;
};

static char kind[32];
static struct board* board;

static int is(const char* wanted) { return strcmp(kind, wanted) == 0; }

static palpate_device* open_board(const char* options, const palpate_device_host* host, char* error,
                                  size_t error_size) {
  const char* const colon = strchr(options, ':');
  const int file = colon == NULL ? -1 : open(colon + 1, O_RDWR | O_CREAT, 0600);
  if (file < 0 || ftruncate(file, sizeof(*board)) != 0) {
    snprintf(error, error_size, "no file in \"%s\"", options);
    return NULL;
  }
  snprintf(kind, sizeof(kind), "%.*s", (int)(colon - options), options);
  board = mmap(NULL, sizeof(*board), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  close(file);
  return open_device("", host, error, error_size);
}

static void specify_board(const palpate_device* d, palpate_device_specification* out) {
  specify(d, out);
  out->flags = 0;
}

static void tell(const palpate_device* d) {
  const double* const f = d->force_newton;
  board->force_newton = sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
  if (board->force_newton > board->largest_newton) board->largest_newton = board->force_newton;
}

static int read_board(palpate_device* d, palpate_device_reading* out) {
  const int error = read_device(d, out);
  tell(d);
  return error;
}

static int apply_board(palpate_device* d, const double force_newton[3], int64_t lease_ns,
                       palpate_device_reading* at_switch) {
  const int is_none =
      lease_ns <= 0 || (force_newton[0] == 0.0 && force_newton[1] == 0.0 && force_newton[2] == 0.0);
  double told_newton[3];
  if (is("deaf") && is_none && board->largest_newton > 0.0) return PALPATE_DEVICE_TIMEOUT;
  if (is("hangs") && board->largest_newton > 0.1) pause();
  for (int i = 0; i < 3; ++i) told_newton[i] = is("reversed") ? -force_newton[i] : force_newton[i];
  const int error = apply_force(d, told_newton, lease_ns, at_switch);
  for (int i = 0; i < 3; ++i) at_switch->applied_force_newton[i] = is_none ? 0.0 : force_newton[i];
  tell(d);
  return error;
}

static void release_board(palpate_device* d) {
  if (is("deaf")) return;
  release_device(d);
  tell(d);
}

const palpate_device_driver* palpate_device_driver_of(uint32_t abi) {
  static palpate_device_driver driver;
  driver = *example_driver_of(PALPATE_DEVICE_ABI);
  driver.open = open_board;
  driver.specification = specify_board;
  driver.read = read_board;
  driver.apply = apply_board;
  driver.release = release_board;
  return abi == PALPATE_DEVICE_ABI ? &driver : NULL;
}
