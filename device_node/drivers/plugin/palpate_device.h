/* SPDX-License-Identifier: Apache-2.0 */
/** @file
 * palpate_device.h — the C interface of a driver in a shared library, for vendors and labs that add
 * a device without building Palpate. The library exports one function,
 *
 *     const palpate_device_driver* palpate_device_driver_of(uint32_t abi);
 *
 * which returns a driver for PALPATE_DEVICE_ABI, or NULL for an `abi` that it does not know.
 *
 * Frame D, the device's: right-handed, x to the right, y away from the person, z up, origin in the
 * middle of the workspace. SI units. The driver converts its own axes, units and origin. Forces are
 * forces on the hand.
 *
 * All functions are called by one thread. read, apply, take_latched and release are called in every
 * tick: they do not allocate, lock, log or wait longer than a transfer takes. No function lets a
 * C++ exception out.
 */
#ifndef PALPATE_DEVICE_H
#define PALPATE_DEVICE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Version of this interface. Grows when a function or a member changes its meaning. New members
 * are appended to the structs, whose first member is their size as the one who made them knows it.
 */
#define PALPATE_DEVICE_ABI 1u

/** Whether the one who made the struct behind `pointer` knows its member: to be asked before a
 * member is used that this header had not from the start. */
#define PALPATE_DEVICE_KNOWS(type, pointer, member) \
  ((pointer)->size >= offsetof(type, member) + sizeof((pointer)->member))

/** One open device. Its contents are the driver's own. */
typedef struct palpate_device palpate_device;

/** What read and apply return. Any other value counts as PALPATE_DEVICE_FAILED. */
enum palpate_device_error {
  PALPATE_DEVICE_OK = 0,        /**< done */
  PALPATE_DEVICE_FAILED = 1,    /**< no more is known */
  PALPATE_DEVICE_TIMEOUT = 2,   /**< no answer in time */
  PALPATE_DEVICE_UNPLUGGED = 3, /**< the device, or the program that owns it, is gone */
  PALPATE_DEVICE_CORRUPT = 4,   /**< the answer breaks the rules of the wire */
  PALPATE_DEVICE_NOT_READY = 5  /**< it has no supply or no calibration */
};

/** Bits of palpate_device_specification::flags. */
enum palpate_device_flags {
  /** The motors end each force by themselves when its lease runs out, even if this process stops.
   * Without it a force above the device's friction needs an acceptance in the session; it must not
   * end before its lease, and ends with the first call after it. */
  PALPATE_DEVICE_HAS_WATCHDOG = 1u << 0,
  /** The watchdog stores the position at that moment: take_latched gives it. */
  PALPATE_DEVICE_HAS_LATCH = 1u << 1,
  /** Current or torque sensors tell what the motors do: every reading has measured_force_newton.
   * Forces that are not those applied are a fault. */
  PALPATE_DEVICE_MEASURES_FORCE = 1u << 2,
  /** The handle turns about the hand's point in three joints with motors: every reading has
   * wrist_angle_rad and wrist_axes, and the driver set_wrist_torque. */
  PALPATE_DEVICE_HAS_WRIST = 1u << 3
};

/** What the device is. Asked once, after open; constant until close. Refused, with the rule, unless
 * every extent is > 0, 0 < continuous force ≤ peak force, the resolution is in 0 … 0.01 m, there
 * are at most 32 buttons and held_force_ratio is 0 or at least 1, turning_per_m at least 0, with a
 * wrist the peak torques > 0; all others finite. */
typedef struct palpate_device_specification {
  uint32_t size;                     /**< sizeof(palpate_device_specification), set by the caller */
  uint32_t flags;                    /**< bits of palpate_device_flags */
  char model_name[64];               /**< UTF-8, ends with 0; empty: "plug-in" */
  double workspace_half_extent_m[3]; /**< box around the origin, D */
  double peak_force_newton;          /**< |F| for moments */
  double continuous_force_newton;    /**< |F| without a time limit */
  double position_resolution_m;      /**< per axis; 0: exact */
  uint32_t button_count;             /**< 0 … 32 */
  uint32_t reserved;                 /**< 0 */
  /** Of motors that hold their currents while the arm turns, so that the force changes: how many
   * times the force of one place of the workspace the same currents can be at another one; infinite
   * where no bound is known. 0 or 1: the motors hold the force. Without a watchdog no force exceeds
   * the device's friction divided by it, unless the session accepts more. Added later: ask
   * PALPATE_DEVICE_KNOWS before writing it. */
  double held_force_ratio;
  /** Of the same motors: by what share the force of the same currents changes per metre of the
   * hand's way, at most; 0: the motors hold the force, or no bound is known. Added later, as above.
   */
  double turning_per_m;
  /** Of each joint of a wrist, the limit of its motor. Looked at with PALPATE_DEVICE_HAS_WRIST
   * only. Added later, as above. */
  double peak_torque_newton_m[3];
} palpate_device_specification;

/** One reading. The caller sets size, buttons 0, an identity orientation and zeros elsewhere. A
 * stamp in the future, an orientation of a norm outside 0.5 … 2, a force that is not finite or
 * above the peak (measured: ten times the peak), a turning that is not finite, a skew outside 0 … 1
 * s, an angle outside ±1000, an axis that is no unit vector or a torque above the peak of its joint
 * releases the motors and counts as PALPATE_DEVICE_CORRUPT. */
typedef struct palpate_device_reading {
  uint32_t size; /**< sizeof(palpate_device_reading), set by the caller */
  /** Bit i: button i is held. 0 where the grip is gone or its state is old: one of them may be the
   * dead-man button, which a hand that has let go would seem to hold. */
  uint32_t buttons;
  double position_m[3];       /**< of the hand, D */
  double orientation_wxyz[4]; /**< rotation into D from the tool's frame; is normalised */
  int64_t sampled_at_ns;      /**< of the position, by palpate_device_host::clock_ns */
  /** Of a switch: what acts on the hand from now on [N], D, limited and quantised as the motors
   * realise it. The energy is counted with it. */
  double applied_force_newton[3];
  /** What the motors do on the hand now [N], D, by sensors, never by the command. Looked at with
   * PALPATE_DEVICE_MEASURES_FORCE only. Added later: ask PALPATE_DEVICE_KNOWS before writing it. */
  double measured_force_newton[3];
  /** Of motors that hold their currents: the work that they did since the last reading beyond that
   * of the force reported then, τ·Δθ − F·Δx [J]. Added later, as above. */
  double turning_joule;
  /** Position and switch may be apart, and older than sampled_at_ns, by so much: the time of the
   * transfer. 0: they are one instant. Added later, as above. */
  int64_t skew_ns;
  /** Of motors that hold their currents: what the arm's turning has made of their force since the
   * last reading [N], D. The currents that this message sets change the force at this place by
   * applied_force_newton − the last one − this, J⁻ᵀ Δτ. Added later, as above. */
  double turned_newton[3];
  /** How far each joint of the wrist has turned, without jumps by turns, at the instant of the
   * position. These are looked at with PALPATE_DEVICE_HAS_WRIST only. Added later, as above. */
  double wrist_angle_rad[3];
  /** About which axis each joint turns the tool now: unit, D. */
  double wrist_axes[3][3];
  /** Of a switch: what the motor of each joint does on the hand from now on [N m], limited and
   * quantised as it realises it. The energy is counted with it. */
  double wrist_torque_newton_m[3];
} palpate_device_reading;

/** What the library may use of the program that loads it. Valid until close has returned. */
typedef struct palpate_device_host {
  uint32_t size;     /**< sizeof(palpate_device_host) */
  uint32_t reserved; /**< 0 */
  void* context;     /**< first argument of the functions below */
  /** Monotonic time [ns], from an arbitrary origin; may be called at any time. */
  int64_t (*clock_ns)(void* context);
  /** Shows what the person should do, UTF-8; in open only. */
  void (*prompt)(void* context, const char* text);
  /** Not 0: open should give up, the program ends; in open only. */
  int (*is_stopped)(void* context);
  double start_limit_s; /**< open gives up after this time */
} palpate_device_host;

/** A driver. Every function must be there but take_latched, reopen and set_wrist_torque, which may
 * be NULL. Constant, and valid as long as the library is loaded. */
typedef struct palpate_device_driver {
  uint32_t size; /**< sizeof(palpate_device_driver) */
  uint32_t abi;  /**< PALPATE_DEVICE_ABI */

  /** Opens the device: ready to be read, motors limp. `options` is the session's text. `host`
   * outlives the device. NULL on failure, with the reason in `error`: at most `error_size` bytes,
   * UTF-8, ended with 0. May wait for a person, up to start_limit_s. */
  palpate_device* (*open)(const char* options, const palpate_device_host* host, char* error,
                          size_t error_size);
  /** Motors limp, closed; `device` is not used again. */
  void (*close)(palpate_device* device);
  /** Fills in `out`, whose size is set. */
  void (*specification)(const palpate_device* device, palpate_device_specification* out);

  /** Takes one reading. A palpate_device_error; after an error the motors are limp. */
  int (*read)(palpate_device* device, palpate_device_reading* out);
  /** Applies a force on the hand [N], D, from now on, for at most `lease_ns`; ≤ 0: no force. Larger
   * forces are limited to the peak with their direction kept. `at_switch` is the reading at which
   * the force changed. A palpate_device_error; after an error the motors are limp. */
  int (*apply)(palpate_device* device, const double force_newton[3], int64_t lease_ns,
               palpate_device_reading* at_switch);

  /** Motors limp, at once. An apply with a lease of 0 follows: PALPATE_DEVICE_OK confirms that no
   * force acts; after anything else both are called again. */
  void (*release)(palpate_device* device);
  /** 1: the reading that the watchdog stored when a force ended by itself, once; 0: there is none.
   * May be NULL. */
  int (*take_latched)(palpate_device* device, palpate_device_reading* at_end);
  /** After a fault: opens the device once more if it has to be, within a second. 1: ready; anything
   * else: the fault stays. May be NULL, for a device that needs no opening again. */
  int (*reopen)(palpate_device* device);
  /** What the motors of the wrist are to do on the hand, per joint [N m], from the next apply on
   * and for its lease. Called before every apply, in a session with device.wrist; otherwise never,
   * and there is no torque. Larger ones are limited to the peak of the joint. release ends torques
   * too. Needed with PALPATE_DEVICE_HAS_WRIST; else may be NULL. Added later: drivers that were
   * made before are smaller. */
  void (*set_wrist_torque)(palpate_device* device, const double torque_newton_m[3]);
} palpate_device_driver;

/** Type of the function that the library exports under the name PALPATE_DEVICE_ENTRY. */
typedef const palpate_device_driver* (*palpate_device_driver_of_function)(uint32_t abi);
/** Name of the function that the library exports. */
#define PALPATE_DEVICE_ENTRY "palpate_device_driver_of"

#ifdef __cplusplus
}
#endif
#endif
