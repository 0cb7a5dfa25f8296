/* palpate_device.h — the C interface of a driver in a shared library, for vendors and labs that add
 * a device without building Palpate. The library exports one function,
 *
 *     const palpate_device_driver* palpate_device_driver_of(uint32_t abi);
 *
 * which returns a driver for PALPATE_DEVICE_ABI, or NULL for an `abi` that it does not know.
 *
 * Frame D, SI units, right-handed: x to the right, y away from the person, z up, origin in the
 * middle of the workspace. The driver converts its own axes, units and origin.
 *
 * All functions are called by one thread. read, apply, take_latched and release are called in every
 * tick: they do not allocate, lock, log or wait longer than a transfer takes.
 */
#ifndef PALPATE_DEVICE_H
#define PALPATE_DEVICE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Grows when a function or a member changes its meaning. New members are appended to the structs,
 * whose first member is their size as the one who fills them in knows it. */
#define PALPATE_DEVICE_ABI 1u

typedef struct palpate_device palpate_device; /* the driver's own */

enum palpate_device_error {
  PALPATE_DEVICE_OK = 0,
  PALPATE_DEVICE_FAILED = 1,    /* no more is known */
  PALPATE_DEVICE_TIMEOUT = 2,   /* no answer in time */
  PALPATE_DEVICE_UNPLUGGED = 3, /* the device, or the program that owns it, is gone */
  PALPATE_DEVICE_CORRUPT = 4,   /* the answer breaks the rules of the wire */
  PALPATE_DEVICE_NOT_READY = 5  /* it has no supply or no calibration */
};

enum palpate_device_flags {
  /* The motors end each force by themselves when its lease runs out, even if this process stops.
   * Without it a force above the device's friction needs an acceptance in the session; it must not
   * end before its lease, and ends with the first call after it. */
  PALPATE_DEVICE_HAS_WATCHDOG = 1u << 0,
  /* The watchdog stores the position at that moment: take_latched gives it. */
  PALPATE_DEVICE_HAS_LATCH = 1u << 1
};

typedef struct palpate_device_specification {
  uint32_t size; /* sizeof(palpate_device_specification), set by the caller */
  uint32_t flags;
  char model_name[64];               /* ends with 0 */
  double workspace_half_extent_m[3]; /* box around the origin */
  double peak_force_newton;          /* |F| for moments */
  double continuous_force_newton;    /* |F| without a time limit */
  double position_resolution_m;      /* per axis; 0: exact */
  uint32_t button_count;             /* 0 … 32 */
  uint32_t reserved;
} palpate_device_specification;

typedef struct palpate_device_reading {
  uint32_t size;                  /* sizeof(palpate_device_reading), set by the caller */
  uint32_t buttons;               /* bit i: button i is held */
  double position_m[3];           /* of the hand */
  double orientation_wxyz[4];     /* D from tool, unit */
  int64_t sampled_at_ns;          /* by the clock given to open */
  double applied_force_newton[3]; /* of a switch: what acts from now on, limited and quantised */
} palpate_device_reading;

typedef struct palpate_device_host {
  uint32_t size;
  uint32_t reserved;
  void* context;
  int64_t (*clock_ns)(void* context);              /* never goes back */
  void (*prompt)(void* context, const char* text); /* what the person should do; open only */
  int (*is_stopped)(void* context);                /* open should give up */
  double start_limit_s;                            /* open gives up after this time */
} palpate_device_host;

typedef struct palpate_device_driver {
  uint32_t size; /* sizeof(palpate_device_driver) */
  uint32_t abi;  /* PALPATE_DEVICE_ABI */

  /* Opens the device: ready to be read, motors limp. `options` is the session's text. NULL on
   * failure, with the reason in `error`. `host` outlives the device. */
  palpate_device* (*open)(const char* options, const palpate_device_host* host, char* error,
                          size_t error_size);
  /* Motors limp, closed. */
  void (*close)(palpate_device* device);
  void (*specification)(const palpate_device* device, palpate_device_specification* out);

  /* Each returns a palpate_device_error. After an error the motors are limp. */
  int (*read)(palpate_device* device, palpate_device_reading* out);
  /* The force on the hand from now on, for at most `lease_ns`; ≤ 0: no force. Larger forces are
   * limited to the peak with their direction kept. */
  int (*apply)(palpate_device* device, const double force_newton[3], int64_t lease_ns,
               palpate_device_reading* at_switch);

  /* Motors limp, at once. An apply with a lease of 0 follows: PALPATE_DEVICE_OK confirms that no
   * force acts; after anything else both are called again. */
  void (*release)(palpate_device* device);
  /* 1: the reading that the watchdog stored when a force ended by itself, once; 0: there is none.
   * May be NULL. */
  int (*take_latched)(palpate_device* device, palpate_device_reading* at_end);
  /* After a fault: opens the device once more if it has to be, within a second. 1: ready. May be
   * NULL. */
  int (*reopen)(palpate_device* device);
} palpate_device_driver;

typedef const palpate_device_driver* (*palpate_device_driver_of_function)(uint32_t abi);
#define PALPATE_DEVICE_ENTRY "palpate_device_driver_of"

#ifdef __cplusplus
}
#endif
#endif
