/* SPDX-License-Identifier: Apache-2.0 */
/* servo_exchange.h — between the tick and the thread in which a vendor's library reads the device
 * and switches its force. Neither waits for a lock: each writes the slot that the other does not
 * read. */
#ifndef PALPATE_SERVO_EXCHANGE_H
#define PALPATE_SERVO_EXCHANGE_H

#include <sched.h>
#include <stdatomic.h>

#include "palpate_device.h"

static const int64_t kServoPatienceNs = 20000000; /* for the library's thread */

typedef struct {
  double force_newton[3];
  int64_t lease_ns;
} servo_command;

/* The one of number n is in slot n % 2. */
typedef struct {
  servo_command command[2];        /* of the tick */
  palpate_device_reading frame[2]; /* of the library's thread */
  atomic_uint commands, frames;    /* newest numbers */
  atomic_uint shown;               /* the command that acts in the newest frame */
  atomic_uint has_failed;
  unsigned int taken; /* of the library's thread, like the next */
  int64_t lease_end_ns;
} servo_exchange;

/* In the library's thread, at `now_ns`: the force that acts in this frame; none after its lease. */
static const double* servo_force(servo_exchange* x, int64_t now_ns, int* has_lease) {
  const unsigned int number = atomic_load(&x->commands);
  const servo_command* newest = &x->command[number % 2];
  if (number != x->taken) x->lease_end_ns = now_ns + newest->lease_ns;
  *has_lease = now_ns < x->lease_end_ns;
  x->taken = number;
  return newest->force_newton;
}

/* In the library's thread: the frame is complete, its force acts. */
static void servo_publish(servo_exchange* x, const palpate_device_reading* frame) {
  const unsigned int number = atomic_load(&x->frames) + 1;
  x->frame[number % 2] = *frame;
  atomic_store(&x->frames, number);
  atomic_store(&x->shown, x->taken);
}

/* In the tick: the newest frame. */
static int servo_read(servo_exchange* x, int64_t now_ns, palpate_device_reading* out) {
  for (;;) {
    const unsigned int number = atomic_load(&x->frames);
    palpate_device_reading frame = x->frame[number % 2];
    if (atomic_load(&x->frames) != number) continue; /* perhaps overwritten meanwhile */
    frame.size = out->size;
    *out = frame;
    if (atomic_load(&x->has_failed) != 0) return PALPATE_DEVICE_FAILED;
    return now_ns - frame.sampled_at_ns > kServoPatienceNs ? PALPATE_DEVICE_TIMEOUT
                                                           : PALPATE_DEVICE_OK;
  }
}

/* In the tick: waits for the first frame in which the newest command acts. */
static int servo_wait(servo_exchange* x, const palpate_device_host* host) {
  const int64_t until = host->clock_ns(host->context) + kServoPatienceNs;
  while (atomic_load(&x->shown) != atomic_load(&x->commands)) {
    if (host->clock_ns(host->context) > until) return PALPATE_DEVICE_TIMEOUT;
    sched_yield();
  }
  return PALPATE_DEVICE_OK;
}

/* In the tick: gives a command and waits until it acts. */
static int servo_apply(servo_exchange* x, const palpate_device_host* host,
                       const double force_newton[3], int64_t lease_ns,
                       palpate_device_reading* at_switch) {
  if (servo_wait(x, host) != PALPATE_DEVICE_OK) return PALPATE_DEVICE_TIMEOUT;
  const unsigned int number = atomic_load(&x->commands) + 1;
  servo_command* next = &x->command[number % 2];
  for (int i = 0; i < 3; ++i) next->force_newton[i] = force_newton[i];
  next->lease_ns = lease_ns > 0 ? lease_ns : 0;
  atomic_store(&x->commands, number);
  if (servo_wait(x, host) != PALPATE_DEVICE_OK) return PALPATE_DEVICE_TIMEOUT;
  return servo_read(x, host->clock_ns(host->context), at_switch);
}

#endif
