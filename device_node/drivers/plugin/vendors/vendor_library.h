/* SPDX-License-Identifier: Apache-2.0 */
/* vendor_library.h — what the plug-ins of this folder share: options and functions of a library
 * that is loaded as the device is opened. */
#ifndef PALPATE_VENDOR_LIBRARY_H
#define PALPATE_VENDOR_LIBRARY_H

#include <dlfcn.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "palpate_device.h"

/* The value of `key` in "key=value key=value": copied to `out`. 0: not there, or too long. */
static int option_text(const char* options, const char* key, char* out, size_t size) {
  const size_t length = strlen(key);
  for (const char* at = options; *at != '\0';) {
    at += strspn(at, " ");
    const size_t word = strcspn(at, " ");
    if (word > length && strncmp(at, key, length) == 0 && at[length] == '=') {
      const size_t value = word - length - 1;
      if (value == 0 || value >= size) return 0;
      memcpy(out, at + length + 1, value);
      out[value] = '\0';
      return 1;
    }
    at += word;
  }
  return 0;
}

/* A number > 0; 0 if it is not there or none. */
static double option_number(const char* options, const char* key) {
  char text[32];
  char* end = text;
  if (!option_text(options, key, text, sizeof(text))) return 0.0;
  const double value = strtod(text, &end);
  return *end == '\0' && value > 0.0 ? value : 0.0;
}

/* The option held_force_ratio, from what the vendor says of its motors while nothing tells them
 * anything; without it none is known. */
static double held_force_ratio(const char* options) {
  const double ratio = option_number(options, "held_force_ratio");
  return ratio > 0.0 ? ratio : INFINITY;
}

/* Loads the option `library` or else `name`, and `count` functions of it. NULL with the reason. */
static void* load_library(const char* options, const char* name, const char* const* functions,
                          void** out, size_t count, char* error, size_t error_size) {
  char library[256];
  if (!option_text(options, "library", library, sizeof(library))) {
    snprintf(library, sizeof(library), "%s", name);
  }
  void* handle = dlopen(library, RTLD_NOW | RTLD_LOCAL);
  if (handle == NULL) {
    snprintf(error, error_size,
             "%s; install the vendor's library, or name it: options \"library=…\"", dlerror());
    return NULL;
  }
  for (size_t i = 0; i < count; ++i) {
    out[i] = dlsym(handle, functions[i]);
    if (out[i] != NULL) continue;
    snprintf(error, error_size, "%s has no function %s", library, functions[i]);
    dlclose(handle);
    return NULL;
  }
  return handle;
}

/* The force that acts: none without a lease, limited to the peak with its direction kept. */
static void limit_force(const double force_newton[3], int has_lease, double peak_newton,
                        double out[3]) {
  const double* f = force_newton;
  const double norm = sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
  const double share = !has_lease ? 0.0 : norm > peak_newton ? peak_newton / norm : 1.0;
  for (int i = 0; i < 3; ++i) out[i] = share * f[i];
}

/* Exports the functions open_device, close_device, read_device, apply_force and release_device, and
 * `reopen_device` or NULL. */
#define PALPATE_VENDOR_DRIVER(reopen_device)                                        \
  static void specify(const palpate_device* d, palpate_device_specification* out) { \
    const uint32_t size = out->size;                                                \
    memcpy(out, &d->specification, size < sizeof(*out) ? size : sizeof(*out));      \
    out->size = size;                                                               \
  }                                                                                 \
  const palpate_device_driver* palpate_device_driver_of(uint32_t abi) {             \
    static const palpate_device_driver kDriver = {sizeof(palpate_device_driver),    \
                                                  PALPATE_DEVICE_ABI,               \
                                                  open_device,                      \
                                                  close_device,                     \
                                                  specify,                          \
                                                  read_device,                      \
                                                  apply_force,                      \
                                                  release_device,                   \
                                                  NULL,                             \
                                                  reopen_device};                   \
    return abi == PALPATE_DEVICE_ABI ? &kDriver : NULL;                             \
  }

#endif
