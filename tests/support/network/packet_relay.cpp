// SPDX-License-Identifier: Apache-2.0
#include "tests/support/network/packet_relay.h"

#include <fcntl.h>
#include <linux/if_tun.h>
#include <net/if.h>
#include <poll.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstring>
#include <queue>
#include <vector>

#include "common/core/clock.h"
#include "common/core/random.h"

namespace palpate::test {
namespace {

/// In the network of the calling process; −1 if that is not permitted.
int open_tun(const char* name) {
  const int device = open("/dev/net/tun", O_RDWR | O_NONBLOCK | O_CLOEXEC);
  if (device < 0) return -1;
  ifreq request{};
  request.ifr_flags = IFF_TUN | IFF_NO_PI;
  std::strncpy(request.ifr_name, name, IFNAMSIZ - 1);
  if (ioctl(device, TUNSETIFF, &request) == 0) return device;
  close(device);
  return -1;
}

/// One direction.
class Lane {
 public:
  Lane(int from, int to, const PacketDisturbance& disturbance, std::uint64_t seed)
      : from_(from), to_(to), disturbance_(disturbance), random_(seed) {}

  void take(TimePoint now) {
    std::array<char, 65536> packet;
    for (ssize_t n = 0; (n = read(from_, packet.data(), packet.size())) > 0;) {
      if (random_.chance(disturbance_.loss_ratio)) continue;
      const double jitter_s = to_seconds(disturbance_.jitter);
      const Duration delay =
          disturbance_.delay + from_seconds(random_.uniform(-jitter_s, jitter_s));
      waiting_.push({now + std::max(delay, Duration::zero()), {packet.data(), packet.data() + n}});
    }
  }
  /// Writes what is due; returns when the next packet is.
  TimePoint deliver(TimePoint now) {
    while (!waiting_.empty() && waiting_.top().due <= now) {
      const std::vector<char>& bytes = waiting_.top().bytes;
      if (write(to_, bytes.data(), bytes.size()) < 0) {
        // the device is down: lost
      }
      waiting_.pop();
    }
    return waiting_.empty() ? TimePoint::max() : waiting_.top().due;
  }

 private:
  struct Packet {
    TimePoint due;
    std::vector<char> bytes;
    bool operator<(const Packet& other) const { return due > other.due; }
  };
  int from_;
  int to_;
  PacketDisturbance disturbance_;
  Random random_;
  std::priority_queue<Packet> waiting_;
};

[[noreturn]] void copy_packets(int near, int far, const PacketDisturbance& disturbance) {
  // above ordinary work, below the nodes' ticks; where it is not permitted, a busy machine adds
  // delay
  const sched_param parameters{.sched_priority = 50};
  static_cast<void>(sched_setscheduler(0, SCHED_FIFO, &parameters));
  const SteadyClock clock;
  Lane there(near, far, disturbance, 1);
  Lane back(far, near, disturbance, 2);
  for (;;) {
    const TimePoint now = clock.now();
    there.take(now);
    back.take(now);
    const TimePoint next = std::min(there.deliver(now), back.deliver(now));
    const Duration left =
        std::clamp(next - clock.now(), Duration::zero(), Duration(std::chrono::seconds(1)));
    const timespec timeout{.tv_sec = left.count() / 1'000'000'000,
                           .tv_nsec = left.count() % 1'000'000'000};
    pollfd devices[] = {{.fd = near, .events = POLLIN, .revents = 0},
                        {.fd = far, .events = POLLIN, .revents = 0}};
    ppoll(devices, 2, &timeout, nullptr);
  }
}

}  // namespace

std::string PacketRelay::start(const char* near, int far_network, const char* far,
                               const PacketDisturbance& disturbance) {
  int ready[2];
  if (pipe2(ready, O_CLOEXEC) != 0) return "no pipe";
  pid_ = fork();
  if (pid_ == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    const int near_device = open_tun(near);
    const bool is_there = setns(far_network, CLONE_NEWNET) == 0;
    const int far_device = is_there ? open_tun(far) : -1;
    const char answer = near_device >= 0 && far_device >= 0 ? 'y' : 'n';
    if (write(ready[1], &answer, 1) != 1 || answer == 'n') _exit(1);
    copy_packets(near_device, far_device, disturbance);
  }
  char answer = 'n';
  const bool is_answered = read(ready[0], &answer, 1) == 1;
  close(ready[0]);
  close(ready[1]);
  return is_answered && answer == 'y' ? "" : "/dev/net/tun is not permitted";
}

PacketRelay::~PacketRelay() {
  if (pid_ <= 0) return;
  kill(pid_, SIGKILL);
  waitpid(pid_, nullptr, 0);
}

}  // namespace palpate::test
