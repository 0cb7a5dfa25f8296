/* SPDX-License-Identifier: Apache-2.0 */
/* The plug-in of a device behind topics of ROS 2: it exchanges packets with `palpate ros device`,
 * which speaks DDS. Nothing of DDS is in device_node.
 *
 *   device { plugin { library: "palpate_ros_device.so" options: "socket=/run/user/1000/arm
 *     peak_newton=3 continuous_newton=1 half_extent_m=0.1 resolution_m=1e-4 buttons=1" } }
 *
 * All but buttons (0), patience_ms (5) and held_force_ratio are needed: topics do not tell them. A
 * pose older than patience_ms is a fault, so device.latency_us is to cover that and the way of the
 * force. Nobody tells that motors obey, and they go on when messages stop: a device without a motor
 * watchdog. Nor does anybody tell whether the arm then holds a force or currents: without
 * held_force_ratio=R (palpate_device.h) no force acts that the session does not accept. */
#define _GNU_SOURCE
#include <errno.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include "deploy/ros/device/device_wire.h"
#include "device_node/drivers/plugin/vendors/vendor_library.h"

struct palpate_device {
  const palpate_device_host* host;
  palpate_device_specification specification;
  struct sockaddr_un address;
  int64_t patience_ns;
  int socket; /* < 0: closed */
  ros_device_pose pose;
  int has_pose;
  uint32_t forces;        /* sent so far */
  uint32_t released_by;   /* number of the newest, if it is none; else 0 */
  double force_newton[3]; /* the newest */
  int64_t lease_end_ns;   /* of the host */
};

static int64_t monotonic_ns(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static void hang_up(palpate_device* d) {
  if (d->socket >= 0) close(d->socket);
  d->socket = -1;
  d->has_pose = 0;
}

/* Only a bridge of the same user is believed. 0 with the reason in errno. */
static int dial(palpate_device* d) {
  hang_up(d);
  d->socket = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (d->socket < 0) return 0;
  struct ucred peer;
  socklen_t size = sizeof(peer);
  errno = 0;
  if (connect(d->socket, (const struct sockaddr*)&d->address, sizeof(d->address)) == 0 &&
      getsockopt(d->socket, SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0) {
    if (peer.uid == geteuid() || peer.uid == 0) {
      d->forces = d->released_by = 0;
      return 1;
    }
    errno = EPERM;
  }
  const int why = errno;
  hang_up(d);
  errno = why;
  return 0;
}

/* Takes what has come, of a flood a part. 0: the bridge is gone, or speaks otherwise. */
static int take_poses(palpate_device* d) {
  enum { kMost = 256 };
  for (int i = 0; d->socket >= 0; ++i) {
    if (i == kMost) return 1;
    ros_device_pose next;
    const ssize_t got = recv(d->socket, &next, sizeof(next), MSG_DONTWAIT | MSG_TRUNC);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return 1;
    if (got != (ssize_t)sizeof(next) || next.wire != ROS_DEVICE_WIRE) {
      hang_up(d);
      break;
    }
    d->pose = next;
    d->has_pose = 1;
  }
  return 0;
}

/* A bridge that does not read has stopped: it ends the force as the lease runs out, or with it. */
static int send_force(palpate_device* d, const double force_newton[3], int64_t lease_ns) {
  if (d->socket < 0) return PALPATE_DEVICE_UNPLUGGED;
  const int64_t lasts_ns = lease_ns > 0 ? lease_ns : 0;
  ros_device_force out = {.wire = ROS_DEVICE_WIRE, .number = d->forces + 1};
  if (out.number == 0) out.number = 1;
  out.expires_ns = monotonic_ns() + lasts_ns;
  limit_force(force_newton, lease_ns > 0, d->specification.peak_force_newton, out.force_newton);
  if (send(d->socket, &out, sizeof(out), MSG_DONTWAIT | MSG_NOSIGNAL) != (ssize_t)sizeof(out)) {
    return errno == EAGAIN || errno == EWOULDBLOCK ? PALPATE_DEVICE_TIMEOUT
                                                   : PALPATE_DEVICE_UNPLUGGED;
  }
  d->forces = out.number;
  d->released_by = lease_ns > 0 ? 0 : out.number;
  memcpy(d->force_newton, out.force_newton, sizeof(d->force_newton));
  d->lease_end_ns = d->host->clock_ns(d->host->context) + lasts_ns;
  return PALPATE_DEVICE_OK;
}

static void release_device(palpate_device* d) {
  static const double kNone[3] = {0.0, 0.0, 0.0};
  if (d->released_by == 0) (void)send_force(d, kNone, 0);
}

static int fill(palpate_device* d, int must_be_ready, palpate_device_reading* out) {
  int error = PALPATE_DEVICE_OK;
  if (!take_poses(d)) {
    error = PALPATE_DEVICE_UNPLUGGED;
  } else if (!d->has_pose || monotonic_ns() - d->pose.received_ns > d->patience_ns) {
    error = PALPATE_DEVICE_TIMEOUT;
  } else if (must_be_ready && !d->pose.is_ready) {
    error = PALPATE_DEVICE_NOT_READY;
  }
  if (error != PALPATE_DEVICE_OK) {
    release_device(d);
    return error;
  }
  memcpy(out->position_m, d->pose.position_m, sizeof(out->position_m));
  memcpy(out->orientation_wxyz, d->pose.orientation_wxyz, sizeof(out->orientation_wxyz));
  out->buttons = d->pose.buttons;
  out->sampled_at_ns = d->host->clock_ns(d->host->context);
  memcpy(out->applied_force_newton, d->force_newton, sizeof(d->force_newton));
  return PALPATE_DEVICE_OK;
}

static int read_device(palpate_device* d, palpate_device_reading* out) {
  if (d->host->clock_ns(d->host->context) >= d->lease_end_ns) release_device(d);
  return fill(d, 1, out);
}

static int apply_force(palpate_device* d, const double force_newton[3], int64_t lease_ns,
                       palpate_device_reading* at_switch) {
  if (lease_ns > 0) {
    const int error = send_force(d, force_newton, lease_ns);
    return error != PALPATE_DEVICE_OK ? error : fill(d, 1, at_switch);
  }
  /* that there is no force counts as confirmed once a pose has come after it was published */
  release_device(d);
  static const int64_t kLongestWaitNs = 20000000;
  const int64_t until_ns =
      monotonic_ns() + (d->patience_ns < kLongestWaitNs ? d->patience_ns : kLongestWaitNs);
  while (take_poses(d) && (d->released_by == 0 || (int32_t)(d->pose.force - d->released_by) < 0)) {
    struct pollfd news = {.fd = d->socket, .events = POLLIN};
    const int64_t left_ns = until_ns - monotonic_ns();
    if (d->released_by == 0 || left_ns <= 0) return PALPATE_DEVICE_TIMEOUT;
    const struct timespec wait = {.tv_sec = left_ns / 1000000000, .tv_nsec = left_ns % 1000000000};
    (void)ppoll(&news, 1, &wait, NULL);
  }
  return fill(d, 0, at_switch);
}

/* Waits for a pose, since a release is confirmed by one. */
static int reopen_device(palpate_device* d) {
  static const int64_t kLongestNs = 500000000;
  const int64_t until_ns = monotonic_ns() + kLongestNs;
  if (d->socket < 0 && !dial(d)) return 0;
  while (take_poses(d) && !d->has_pose && monotonic_ns() < until_ns) {
    struct pollfd news = {.fd = d->socket, .events = POLLIN};
    (void)poll(&news, 1, 20);
  }
  return d->socket >= 0 && d->has_pose;
}

static void close_device(palpate_device* d) {
  release_device(d);
  hang_up(d); /* the bridge publishes no force then */
  free(d);
}

/* 0: some word is none of the options, or no number within its range; named in `error`. */
static int check_options(const char* options, char* error, size_t error_size) {
  static const struct {
    const char* key;
    double most;
  } kNumbers[] = {{"peak_newton", 1e3},        {"continuous_newton", 1e3}, {"half_extent_m", 10.0},
                  {"resolution_m", 0.01},      {"buttons", 32.0},          {"patience_ms", 1000.0},
                  {"held_force_ratio", 1000.0}};
  for (const char* at = options; *at != '\0';) {
    at += strspn(at, " ");
    const size_t length = strcspn(at, " ");
    if (length == 0) break;
    char word[160];
    snprintf(word, sizeof(word), "%.*s", (int)length, at);
    at += length;
    char* value = strchr(word, '=');
    int is_good = value != NULL && value[1] != '\0' && length < sizeof(word);
    if (value != NULL) *value++ = '\0';
    if (is_good && strcmp(word, "socket") != 0) {
      double most = 0.0;
      for (size_t i = 0; i < sizeof(kNumbers) / sizeof(kNumbers[0]); ++i) {
        if (strcmp(word, kNumbers[i].key) == 0) most = kNumbers[i].most;
      }
      char* end = value;
      const double number = strtod(value, &end);
      is_good = most > 0.0 && *end == '\0' && number > 0.0 && number <= most;
    }
    if (is_good) continue;
    snprintf(
        error, error_size,
        "option \"%s\": known are socket=PATH, peak_newton and continuous_newton (up to 1000), "
        "half_extent_m (10), resolution_m (0.01), buttons (32), patience_ms and held_force_ratio "
        "(1000), each > 0",
        word);
    return 0;
  }
  return 1;
}

static palpate_device* open_device(const char* options, const palpate_device_host* host,
                                   char* error, size_t error_size) {
  if (!check_options(options, error, error_size)) return NULL;
  palpate_device* d = calloc(1, sizeof(*d));
  if (d == NULL) return NULL;
  d->host = host;
  d->socket = -1;
  d->released_by = 1; /* nothing to end */
  palpate_device_specification* s = &d->specification;
  snprintf(s->model_name, sizeof(s->model_name), "device behind ROS");
  s->peak_force_newton = option_number(options, "peak_newton");
  s->continuous_force_newton = option_number(options, "continuous_newton");
  s->position_resolution_m = option_number(options, "resolution_m");
  for (int i = 0; i < 3; ++i)
    s->workspace_half_extent_m[i] = option_number(options, "half_extent_m");
  s->held_force_ratio = held_force_ratio(options);
  s->button_count = (uint32_t)option_number(options, "buttons");
  const double patience_ms = option_number(options, "patience_ms");
  d->patience_ns = (int64_t)(1e6 * (patience_ms > 0.0 ? patience_ms : ROS_DEVICE_PATIENCE_MS));
  d->address.sun_family = AF_UNIX;
  if (!option_text(options, "socket", d->address.sun_path, sizeof(d->address.sun_path)) ||
      s->peak_force_newton == 0.0 || s->continuous_force_newton == 0.0 ||
      s->position_resolution_m == 0.0 || s->workspace_half_extent_m[0] == 0.0) {
    snprintf(error, error_size,
             "give socket, peak_newton, continuous_newton, half_extent_m and resolution_m in the "
             "options: a path of at most 107 characters and, from the arm's manual, its limits");
    free(d);
    return NULL;
  }
  /* waits for the bridge, the first pose, and that the arm is ready */
  const int64_t end_ns = host->clock_ns(host->context) + (int64_t)(1e9 * host->start_limit_s);
  const char* is_missing = "";
  for (;;) {
    const int is_there = d->socket >= 0 || dial(d);
    const int why = is_there ? 0 : errno;
    if (is_there && take_poses(d) && d->has_pose && d->pose.is_ready) return d;
    const char* missing = !is_there ? "start `palpate ros device` with this session"
                          : !d->has_pose
                              ? "waiting for the first pose of the arm, or until another "
                                "device_node leaves the bridge"
                              : "waiting for the arm's operating_state: ENABLED, homed";
    if (host->is_stopped(host->context) || host->clock_ns(host->context) > end_ns) {
      snprintf(error, error_size, "%s: %s; %s", d->address.sun_path,
               is_there ? "the bridge answers" : strerror(why), missing);
      close_device(d);
      return NULL;
    }
    if (strcmp(missing, is_missing) != 0) host->prompt(host->context, missing);
    is_missing = missing;
    const struct timespec pause = {.tv_sec = 0, .tv_nsec = 20000000};
    nanosleep(&pause, NULL);
  }
}

PALPATE_VENDOR_DRIVER(reopen_device)
