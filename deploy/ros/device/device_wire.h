/* SPDX-License-Identifier: Apache-2.0 */
/* device_wire.h — what `palpate ros device` and the plug-in in device_node tell each other: packets
 * of a Unix socket (SOCK_SEQPACKET), in the byte order of the machine. */
#ifndef PALPATE_ROS_DEVICE_WIRE_H
#define PALPATE_ROS_DEVICE_WIRE_H

#include <stdint.h>

#define ROS_DEVICE_WIRE 0x52440002u /* changes with the packets */

/* An older pose is a fault, unless patience_ms of the plug-in says otherwise. */
#define ROS_DEVICE_PATIENCE_MS 5.0

/* To the plug-in, for every pose that counts. */
typedef struct {
  uint32_t wire;  /* ROS_DEVICE_WIRE */
  uint32_t force; /* number of a force that was published before this pose came */
  uint32_t buttons;
  uint32_t is_ready;          /* 0: its operating_state is another than ENABLED and homed */
  double position_m[3];       /* of the hand, D */
  double orientation_wxyz[4]; /* into D */
  int64_t received_ns;        /* CLOCK_MONOTONIC */
} ros_device_pose;

/* To the bridge. Without a next one it publishes no force from `expires_ns` on. */
typedef struct {
  uint32_t wire;
  uint32_t number;        /* 1, 2, …; never 0 */
  double force_newton[3]; /* on the hand, D */
  int64_t expires_ns;     /* CLOCK_MONOTONIC */
} ros_device_force;

#endif
