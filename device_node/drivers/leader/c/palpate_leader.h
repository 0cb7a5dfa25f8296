/* SPDX-License-Identifier: Apache-2.0 */
/** @file
 * palpate_leader.h - a motorised leader arm on a Dynamixel bus for C and whatever can call C. In
 * libpalpate_controllers_c, beside the clamp that belongs between the follower and its motors.
 * Never run on hardware: tested against the emulator, `palpate emulate --leader`.
 *
 * SI units. Torques are on the hand. Arrays have PALPATE_MOST_JOINTS numbers, one a joint. No
 * function throws; open, error and description allocate, the others do not. A handle is used by one
 * thread at a time. */
#ifndef PALPATE_LEADER_H
#define PALPATE_LEADER_H

#include <stddef.h>

/** Marks what the shared library exports. */
#ifndef PALPATE_API
#if defined(_WIN32)
#define PALPATE_API
#else
#define PALPATE_API __attribute__((visibility("default")))
#endif
#endif

#ifdef __cplusplus
extern "C" {
#endif

/** More joints has no leader. */
#define PALPATE_MOST_JOINTS 8

/** One arm; made by palpate_leader_open. */
typedef struct palpate_leader palpate_leader;

/** One servo and the joint that it drives: angle = sign * p / gear + offset_rad, with p the
 * position of the servo's horn. */
typedef struct palpate_leader_joint {
  int id;                            /**< 0 ... 252, of the servo */
  double sign;                       /**< 1 or -1 */
  double offset_rad;                 /**< the angle where the servo says 0 */
  double gear;                       /**< > 0: turns of the horn per turn of the joint */
  double torque_newton_m_per_ampere; /**< of the horn, measured; 0: the manual's stall torque */
  double current_limit_ampere;       /**< > 0: no more is commanded */
  double lowest_rad;                 /**< of the joint's range, less than a turn of the horn */
  double highest_rad;                /**< > lowest_rad */
  double fastest_rad_per_s;          /**< > 0: the hand is never faster (v_max of the clamp) */
  double play_rad;                   /**< >= 0: between motor and encoder, end to end */
} palpate_leader_joint;

/** The line, and what the loop may take. */
typedef struct palpate_leader_settings {
  const char* port;         /**< of the line, such as /dev/ttyUSB0 */
  unsigned bits_per_second; /**< of the bus */
  int watchdog_units;       /**< 1 ... 127: each servo ends its torque after so many times 20 ms */
  double answer_limit_s;    /**< > 0: for an answer, beside the time of its bytes */
  double longest_delay_s;   /**< > 0.003: from an angle's sampling to the current that answers */
  double longest_cycle_s;   /**< > 0: from one write to the next; a longer one is limp */
  int may_write_eeprom;     /**< not 0: mode and return delay in the servos may be changed */
} palpate_leader_settings;

/** One reading of all joints. */
typedef struct palpate_leader_reading {
  double position_rad[PALPATE_MOST_JOINTS];       /**< angles, without jumps */
  double velocity_rad_per_s[PALPATE_MOST_JOINTS]; /**< as the servos say */
  double current_ampere[PALPATE_MOST_JOINTS];     /**< present, as the servos say */
  double elapsed_s;            /**< for the clamp: since the switch to the last torques, or more */
  int is_known;                /**< 0: the clamp is told of a gap */
  unsigned long long repeated; /**< reads so far that were answered the second time only */
} palpate_leader_reading;

/** Opens an arm: every torque off, then each servo's model, firmware and settings are checked.
 * NULL if anything is wrong.
 * @param joints  1 ... PALPATE_MOST_JOINTS   @param count  of joints
 * @param settings  the line
 * @param error  receives what is wrong, with the remedy   @param size  bytes of error */
PALPATE_API palpate_leader* palpate_leader_open(const palpate_leader_joint* joints, size_t count,
                                                const palpate_leader_settings* settings,
                                                char* error, size_t size);
/** Current 0, torque off, and frees the handle. NULL is allowed. */
PALPATE_API void palpate_leader_close(palpate_leader* leader);

/** The person holds the arm: watchdogs, then torque, with current 0. From now on the watchdog
 * counts. Returns 1, or 0 for a fault. */
PALPATE_API int palpate_leader_enable(palpate_leader* leader);
/** Reads every joint. Returns 1, or 0 for a fault, and then the arm is limp. */
PALPATE_API int palpate_leader_read(palpate_leader* leader, palpate_leader_reading* reading);
/** Sends these torques, and says what they become: rounded towards 0, cut off at the limits, 0
 * without palpate_leader_enable. Returns 1, or 0 for a fault, and then the arm is limp.
 * @param leader  an arm
 * @param torque_newton_m  PALPATE_MOST_JOINTS numbers
 * @param made_newton_m  PALPATE_MOST_JOINTS numbers to receive */
PALPATE_API int palpate_leader_write(palpate_leader* leader, const double* torque_newton_m,
                                     double* made_newton_m);
/** Current 0, then torque off. */
PALPATE_API void palpate_leader_release(palpate_leader* leader);

/** What made the arm limp; "" if nothing did. Valid until the next call for this handle. */
PALPATE_API const char* palpate_leader_error(palpate_leader* leader);
/** The servos, one line each. Valid until the next call for this handle. */
PALPATE_API const char* palpate_leader_description(palpate_leader* leader);
/** The longest time for which a torque acts: lease_s of the clamp. */
PALPATE_API double palpate_leader_lease_s(const palpate_leader* leader);
/** The resolution of the clamp's port. @param leader  an arm   @param joint  0 ... */
PALPATE_API double palpate_leader_resolution_rad(const palpate_leader* leader, size_t joint);
/** What the current limit makes. @param leader  an arm   @param joint  0 ... */
PALPATE_API double palpate_leader_largest_torque_newton_m(const palpate_leader* leader,
                                                          size_t joint);

#ifdef __cplusplus
}
#endif

#endif /* PALPATE_LEADER_H */
