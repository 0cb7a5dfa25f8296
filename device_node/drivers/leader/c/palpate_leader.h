/* SPDX-License-Identifier: Apache-2.0 */
/** @file
 * palpate_leader.h - a motorised leader arm for C and whatever can call C, on a Dynamixel bus or of
 * Damiao motors on a CAN bus (OpenArm). In libpalpate_controllers_c, beside the clamp that belongs
 * between the follower and its motors. Never run on hardware: tested against the emulators,
 * `palpate emulate --leader`.
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

/** One arm; made by palpate_leader_open_dynamixel or palpate_leader_open_damiao. */
typedef struct palpate_leader palpate_leader;

/** How a joint lies to its motor: angle = sign * p / gear + offset_rad, with p the position of the
 * motor's shaft, behind its own gears. */
typedef struct palpate_joint_place {
  double sign;              /**< 1 or -1 */
  double offset_rad;        /**< the angle where the motor says 0; within one turn */
  double gear;              /**< > 0: turns of the shaft per turn of the joint */
  double lowest_rad;        /**< of the joint's range, less than a turn of the shaft */
  double highest_rad;       /**< > lowest_rad */
  double fastest_rad_per_s; /**< > 0: the hand is never faster (v_max of the clamp) */
  double play_rad;          /**< >= 0: between motor and encoder, end to end */
} palpate_joint_place;

/** What the loop may take. */
typedef struct palpate_leader_times {
  double answer_limit_s;  /**< > 0: for an answer, beside the time of its bytes */
  double longest_delay_s; /**< from an angle's sampling to the torque that answers it */
  double longest_cycle_s; /**< > 0: from one write to the next; a longer one is limp */
} palpate_leader_times;

/** One Dynamixel servo and the joint that it drives. */
typedef struct palpate_dynamixel_joint {
  int id;                            /**< 0 ... 252, of the servo */
  palpate_joint_place place;         /**< of the joint */
  double torque_newton_m_per_ampere; /**< of the horn, measured, within a factor of 3 of the
                                          manual's stall torque; 0: that */
  double current_limit_ampere;       /**< > 0: no more is commanded */
} palpate_dynamixel_joint;

/** The serial line. longest_delay_s is above 0.003. */
typedef struct palpate_dynamixel_settings {
  const char* port;           /**< of the line, such as /dev/ttyUSB0 */
  palpate_leader_times times; /**< of the loop */
  unsigned bits_per_second;   /**< of the bus */
  int watchdog_units;   /**< 1 ... 127: each servo ends its torque after so many times 20 ms */
  int may_write_eeprom; /**< not 0: mode and return delay in the servos may be changed */
} palpate_dynamixel_settings;

/** One Damiao motor and the joint that it drives. */
typedef struct palpate_damiao_joint {
  int id;                       /**< 1 ... 15, of the motor (CAN ID) */
  palpate_joint_place place;    /**< of the joint */
  int feedback_id;              /**< of the frames that it sends (Master ID); 0: id + 16 */
  const char* model;            /**< DM4310, DM4340, DM8009 ... */
  double torque_limit_newton_m; /**< > 0: no more is commanded, at the shaft */
  double torque_ratio;          /**< 1/3 ... 3: true torque per N m commanded, measured; 1: as it
                                   says */
} palpate_damiao_joint;

/** The CAN bus. longest_delay_s is above 0.001. */
typedef struct palpate_damiao_settings {
  const char* port;           /**< of the interface, such as can0; a path: an emulator's socket */
  palpate_leader_times times; /**< of the loop */
  int is_fd;                  /**< not 0: CAN FD */
  double timeout_s;           /**< 0.002 ... 1: each motor ends its torque by itself after this */
} palpate_damiao_settings;

/** One reading of all joints. */
typedef struct palpate_leader_reading {
  double position_rad[PALPATE_MOST_JOINTS];       /**< angles, without jumps */
  double velocity_rad_per_s[PALPATE_MOST_JOINTS]; /**< as the motors say */
  double torque_newton_m[PALPATE_MOST_JOINTS];    /**< as the motors say of their currents */
  double elapsed_s;            /**< for the clamp: since the switch to the last torques, or more */
  int is_known;                /**< 0: the clamp is told of a gap */
  unsigned long long repeated; /**< reads so far that were answered the second time only */
} palpate_leader_reading;

/** Opens an arm on a Dynamixel bus: every torque off, then each servo's model, firmware and
 * settings are checked. NULL if anything is wrong.
 * @param joints  1 ... PALPATE_MOST_JOINTS   @param count  of joints
 * @param settings  the line
 * @param error  receives what is wrong, with the remedy   @param size  bytes of error */
PALPATE_API palpate_leader* palpate_leader_open_dynamixel(
    const palpate_dynamixel_joint* joints, size_t count, const palpate_dynamixel_settings* settings,
    char* error, size_t size);
/** The same for Damiao motors on a CAN bus, such as OpenArm: their ranges, mode and state are
 * checked.
 * @param joints  1 ... PALPATE_MOST_JOINTS   @param count  of joints
 * @param settings  the bus
 * @param error  receives what is wrong, with the remedy   @param size  bytes of error */
PALPATE_API palpate_leader* palpate_leader_open_damiao(const palpate_damiao_joint* joints,
                                                       size_t count,
                                                       const palpate_damiao_settings* settings,
                                                       char* error, size_t size);
/** No torque, motors off, and frees the handle. NULL is allowed. */
PALPATE_API void palpate_leader_close(palpate_leader* leader);

/** The person holds the arm: watchdogs, then torque, with none requested. From now on the watchdog
 * counts. Returns 1, or 0 for a fault. */
PALPATE_API int palpate_leader_enable(palpate_leader* leader);
/** Reads every joint. Returns 1, or 0 for a fault, and then the arm is limp. */
PALPATE_API int palpate_leader_read(palpate_leader* leader, palpate_leader_reading* reading);
/** Sends these torques, and says what is commanded: rounded towards 0, cut off at the limits, 0
 * without palpate_leader_enable. Returns 1, or 0 for a fault, and then the arm is limp.
 * @param leader  an arm
 * @param torque_newton_m  PALPATE_MOST_JOINTS numbers
 * @param made_newton_m  PALPATE_MOST_JOINTS numbers to receive */
PALPATE_API int palpate_leader_write(palpate_leader* leader, const double* torque_newton_m,
                                     double* made_newton_m);
/** No torque, then the motors off. */
PALPATE_API void palpate_leader_release(palpate_leader* leader);

/** What made the arm limp; "" if nothing did. Valid until the next call for this handle. */
PALPATE_API const char* palpate_leader_error(palpate_leader* leader);
/** The motors, one line each. Valid until the next call for this handle. */
PALPATE_API const char* palpate_leader_description(palpate_leader* leader);
/** The longest time for which a torque acts: lease_s of the clamp. */
PALPATE_API double palpate_leader_lease_s(const palpate_leader* leader);
/** The resolution of the clamp's port. @param leader  an arm   @param joint  0 ... */
PALPATE_API double palpate_leader_resolution_rad(const palpate_leader* leader, size_t joint);
/** What the limit makes. @param leader  an arm   @param joint  0 ... */
PALPATE_API double palpate_leader_largest_torque_newton_m(const palpate_leader* leader,
                                                          size_t joint);

#ifdef __cplusplus
}
#endif

#endif /* PALPATE_LEADER_H */
