/* SPDX-License-Identifier: Apache-2.0 */
/** @file
 * palpate_controllers.h - the force controllers of Palpate for C and whatever can call C (Unity,
 * Unreal, Rust, Python's ctypes). Link libpalpate_controllers_c; flags: pkg-config
 * palpate_controllers.
 *
 * SI units, one right-handed frame (the device's). Forces are on the hand. Arrays of three are x,
 * y, z. Structs filled with zeros are valid. No function throws, none but create, set and destroy
 * allocates; a handle is used by one thread at a time. The layout of the structs changes only with
 * the minor version while the major one is 0, then only with the major one. */
#ifndef PALPATE_CONTROLLERS_H
#define PALPATE_CONTROLLERS_H

#include <stddef.h>

/** Marks what the shared library exports. */
#if defined(_WIN32)
#define PALPATE_API
#else
#define PALPATE_API __attribute__((visibility("default")))
#endif

#ifdef __cplusplus
extern "C" {
#endif

/** One controller and its settings; made by palpate_controller_create. */
typedef struct palpate_controller palpate_controller;

/** What a call has come to. After anything but PALPATE_OK the call has changed no setting. */
typedef enum palpate_status {
  PALPATE_OK = 0,           /**< done */
  PALPATE_NULL_POINTER = 1, /**< an argument is NULL that must not be */
  PALPATE_UNKNOWN_NAME = 2, /**< no setting of that name */
  PALPATE_OUT_OF_RANGE = 3, /**< of a setting; palpate_controller_error says the rule */
  PALPATE_NOT_FINITE = 4,   /**< a number of an input is not finite, or a duration is below 0 */
  PALPATE_NO_MEMORY = 5     /**< memory is exhausted */
} palpate_status;

/** One force and what the hand did while it acted. */
typedef struct palpate_stretch {
  double duration_s;                /**< >= 0, measured */
  double force_on_hand_newton[3];   /**< that really acted, as the motors realised it */
  double hand_position_at_end_m[3]; /**< measured */
  int is_end_unknown;               /**< not 0: the position at the end was not read */
} palpate_stretch;

/** The tissue where the tool is not; for virtual coupling and Lyapunov. Called within step, for a
 * hand at this position, moving at this velocity, now. Allocates nothing, does not block. An answer
 * that is not finite counts as no tissue.
 * @param user  palpate_input::tissue_user
 * @param hand_position_m  3 numbers
 * @param hand_velocity_m_per_s  3 numbers
 * @param force_on_hand_newton  3 numbers to set; 0 before
 * @param stored_energy_joule  to set, >= 0: elastic energy that the hand would get back; 0 before
 */
typedef void (*palpate_tissue)(void* user, const double hand_position_m[3],
                               const double hand_velocity_m_per_s[3],
                               double force_on_hand_newton[3], double* stored_energy_joule);

/** One control step. Every number must be finite. */
typedef struct palpate_input {
  double hand_position_m[3];       /**< measured now */
  double hand_velocity_m_per_s[3]; /**< estimated; for the published methods that use it */
  /** What acted since the previous step, in time order, without gaps, up to hand_position_m; NULL
   * where there is none. */
  const palpate_stretch* applied;
  size_t applied_count; /**< 0 in the first step; more than 64 count as has_gap */
  int has_gap;          /**< not 0: it is not known what acted; credit is forfeited */
  double acting_force_on_hand_newton[3]; /**< acts now, until it is replaced */
  double acting_lease_s;                 /**< it ends by itself after this time; <= 0: not known */
  double requested_force_on_hand_newton[3]; /**< what the tissue, or the program, wants rendered */
  int is_request_held;        /**< not 0: the same evaluation of the tissue as in the last step */
  double stored_energy_joule; /**< elastic energy that the tissue may give back; 0: not known */
  double evaluated_at_m[3];   /**< where the hand was for the tissue at the request; for two_port
                                   and passivity_control_reference */
  double surface_normal[3];   /**< of the contact, unit, out of the tissue, or zeros; for
                                   memory_based */
  palpate_tissue tissue;      /**< NULL: virtual coupling and Lyapunov give the request */
  void* tissue_user;          /**< first argument of tissue */
} palpate_input;

/** What a controller answers. */
typedef struct palpate_output {
  double force_on_hand_newton[3]; /**< to apply from now on */
  double f_max_newton[3];         /**< bound per axis; NaN where the method has none */
  double ledger_energy_joule;     /**< credit of the hand; NaN where the method has none */
  double lease_s;  /**< longest time for which the force may act; 0: the setting lease_s */
  int is_clamped;  /**< 1: the force differs from the request */
  int is_too_fast; /**< 1: the hand moved faster than the controller assumes */
} palpate_output;

/** The version of the library, "0.1.0". */
PALPATE_API const char* palpate_controllers_version(void);

/** How many controllers there are. */
PALPATE_API size_t palpate_controller_count(void);
/** The name of a controller, index 0 .. count - 1; NULL beyond. */
PALPATE_API const char* palpate_controller_name(size_t index);
/** How many settings there are. */
PALPATE_API size_t palpate_setting_count(void);
/** The name of a setting, index 0 .. count - 1; NULL beyond. A controller ignores settings of
 * others. */
PALPATE_API const char* palpate_setting_name(size_t index);
/** The unit of a setting, UTF-8, "1" for a plain number; NULL beyond. */
PALPATE_API const char* palpate_setting_unit(size_t index);

/** Makes a controller with default settings; NULL if there is none of that name, or no memory. */
PALPATE_API palpate_controller* palpate_controller_create(const char* name);
/** Frees a controller. NULL is allowed. */
PALPATE_API void palpate_controller_destroy(palpate_controller* controller);

/** Changes a setting and begins anew: before the first step, not between steps. A refused value
 * changes nothing. Of two settings that must be in order, set the larger first. */
PALPATE_API palpate_status palpate_controller_set(palpate_controller* controller,
                                                  const char* setting, double value);
/** Reads a setting into `value`, which is left alone where the status is not PALPATE_OK. */
PALPATE_API palpate_status palpate_controller_get(const palpate_controller* controller,
                                                  const char* setting, double* value);

/** Back to the initial state, for a new session of the device. Allocates nothing. */
PALPATE_API palpate_status palpate_controller_reset(palpate_controller* controller);
/** The force for this step. If the status is not PALPATE_OK the output is all zeros, and what acts
 * until the next step counts as not known. Allocates nothing, does not block. */
PALPATE_API palpate_status palpate_controller_step(palpate_controller* controller,
                                                   const palpate_input* input,
                                                   palpate_output* output);

/** What the last set() complained about: setting, value, rule. "" if nothing. Valid until the next
 * set() or destroy(). */
PALPATE_API const char* palpate_controller_error(const palpate_controller* controller);

/* Mode guard for joints, a grip and axes of any units: for leader arms. Port i has a position and
 * an effort on the hand, in rad and N*m or in m and N. Arrays have PALPATE_MOST_PORTS numbers;
 * those beyond the last port are not read, and 0 in an answer. */

/** More ports has no clamp. */
#define PALPATE_MOST_PORTS 8

/** One clamp for several ports; made by palpate_ports_create. */
typedef struct palpate_ports palpate_ports;

/** A joint, a grip or an axis. Friction and resolution are promises: the true friction is never
 * less, a reading never further off. */
typedef struct palpate_port {
  double viscous;     /**< >= 0, friction, a lower bound [N*m*s/rad or N*s/m] */
  double coulomb;     /**< >= 0, friction, a lower bound [N*m or N] */
  double resolution;  /**< >= 0, of the position: readings are right to half of it [rad or m] */
  double v_max;       /**< > 0: the hand is never faster [rad/s or m/s] */
  double peak_effort; /**< >= 0, of the motor: cap and gate allow one hold of it [N*m or N] */
  int priority;       /**< ports of the lowest are reduced first, those of one by one factor */
} palpate_port;

/** One effort on each port, and what the hand did while it acted. */
typedef struct palpate_port_stretch {
  double duration_s;                          /**< >= 0, measured */
  double effort_on_hand[PALPATE_MOST_PORTS];  /**< that really acted, as the motors realised it */
  double position_at_end[PALPATE_MOST_PORTS]; /**< measured; angles do not wrap */
  int is_end_unknown;                         /**< not 0: the position at the end was not read */
} palpate_port_stretch;

/** One step of the clamp. Every number but the request must be finite, positions and efforts within
 * 1e9. A position that no hand explains (an angle that wraps, one that changes in no time) counts
 * as has_gap. A program that does not know where an effort begins to act, but no later than delay
 * after the reading, gives stretches from reading to reading, adds delay to each duration_s and
 * 2 * v_max * delay to each resolution. */
typedef struct palpate_port_input {
  double position[PALPATE_MOST_PORTS]; /**< measured now */
  /** What acted since the previous step, in time order, without gaps, up to position; NULL where
   * there is none. */
  const palpate_port_stretch* applied;
  size_t applied_count; /**< 0 in the first step; more than 64 count as has_gap */
  int has_gap;          /**< not 0: it is not known what acted; credit is forfeited */
  double acting_effort_on_hand[PALPATE_MOST_PORTS]; /**< acts now, until it is replaced */
  double acting_lease_s; /**< it ends by itself after this time; <= 0: not known */
  /** What the follower, or a program, wants rendered. One that is not finite, or beyond 1e9, counts
   * as none on any port. */
  double requested_effort_on_hand[PALPATE_MOST_PORTS];
  int is_request_held;        /**< not 0: the same evaluation as in the last step */
  double stored_energy_joule; /**< elastic energy that the request may give back; 0: not known */
} palpate_port_input;

/** What the clamp answers. */
typedef struct palpate_port_output {
  double effort_on_hand[PALPATE_MOST_PORTS]; /**< to apply from now on */
  double
      most_effort[PALPATE_MOST_PORTS]; /**< what all of the credit would cover on one port alone */
  double ledger_energy_joule;          /**< credit of the hand */
  double lease_s;                      /**< longest time for which the effort may act */
  double begins_within_s;              /**< longest time from the reading until it begins to act */
  int is_clamped;                      /**< 1: the effort differs from the request */
  int is_too_fast;                     /**< 1: the hand moved faster than v_max on some port */
} palpate_port_output;

/** Makes a clamp; NULL where a number is out of its range, for no port or more than
 * PALPATE_MOST_PORTS, or without memory. Settings are those of palpate_setting_name that guard
 * has: lease_s, longest_lease_s, delta_max_s, credit_cap_joule, gate_joule, gate_recovery_s. */
PALPATE_API palpate_ports* palpate_ports_create(const palpate_port* ports, size_t count);
/** Says why palpate_ports_create refuses these ports. Returns 1, or 0 where it does.
 * @param ports  as there   @param count  as there
 * @param error  receives port, field, value and rule; "" for 1   @param size  bytes of error */
PALPATE_API int palpate_ports_check(const palpate_port* ports, size_t count, char* error,
                                    size_t size);
/** Frees a clamp. NULL is allowed. */
PALPATE_API void palpate_ports_destroy(palpate_ports* ports);
/** Changes a setting and begins anew, as palpate_controller_set. longest_lease_s counts from
 * lease_s on: below it no effort outlives lease_s. */
PALPATE_API palpate_status palpate_ports_set(palpate_ports* ports, const char* setting,
                                             double value);
/** Back to the initial state, for a new session of the device. Allocates nothing. */
PALPATE_API palpate_status palpate_ports_reset(palpate_ports* ports);
/** The efforts for this step. If the status is not PALPATE_OK the output is all zeros, and what
 * acts until the next step counts as not known. Allocates nothing, does not block. */
PALPATE_API palpate_status palpate_ports_step(palpate_ports* ports, const palpate_port_input* input,
                                              palpate_port_output* output);
/** What the last palpate_ports_set or palpate_ports_step refused: field, value, rule. "" if
 * nothing. Valid until the next call for this handle. */
PALPATE_API const char* palpate_ports_error(const palpate_ports* ports);

#ifdef __cplusplus
}
#endif

#endif /* PALPATE_CONTROLLERS_H */
