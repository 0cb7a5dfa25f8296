// SPDX-License-Identifier: Apache-2.0
#include "deploy/ros/device/device_server.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "common/core/check.h"

namespace palpate::ros {
namespace {

/// @throws SetupError  too long
sockaddr_un address_of(const std::string& path) {
  sockaddr_un address{.sun_family = AF_UNIX, .sun_path = {}};
  if (path.empty() || path.size() >= sizeof(address.sun_path)) {
    throw SetupError("socket " + path + ": a path of 1 to 107 characters is needed");
  }
  path.copy(static_cast<char*>(address.sun_path), path.size());
  return address;
}

const sockaddr* plain(const sockaddr_un& address) {
  return reinterpret_cast<const sockaddr*>(&address);
}

int make_socket() { return socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0); }

}  // namespace

DeviceServer::DeviceServer(const std::string& path) : path_(path) {
  const sockaddr_un address = address_of(path);
  const auto fail = [&](const std::string& why) {
    if (listener_ >= 0) close(listener_);
    if (lock_ >= 0) close(lock_);
    throw SetupError("socket " + path + ": " + why);
  };
  const std::string elsewhere =
      "; name another file in the options of the plug-in, in a folder of your own";
  lock_ = open((path + ".lock").c_str(), O_CREAT | O_RDWR | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (lock_ < 0) fail(path + ".lock: " + std::strerror(errno) + elsewhere);
  if (flock(lock_, LOCK_EX | LOCK_NB) != 0) {
    fail("another program serves it; end that `palpate ros device`");
  }
  // only what nobody serves any more is replaced
  const int other = make_socket();
  const bool is_served = connect(other, plain(address), sizeof(address)) == 0;
  const int answer = errno;
  close(other);
  if (is_served) fail("another program serves it" + elsewhere);
  if (answer == ECONNREFUSED) {
    struct stat status {};
    if (lstat(path.c_str(), &status) == 0 && S_ISSOCK(status.st_mode)) unlink(path.c_str());
  } else if (answer != ENOENT) {
    fail(std::strerror(answer) + elsewhere);
  }
  listener_ = make_socket();
  const mode_t mask = umask(0177);
  const bool is_bound = bind(listener_, plain(address), sizeof(address)) == 0;
  const int why = errno;
  umask(mask);
  if (!is_bound) fail(std::strerror(why) + elsewhere);
  if (listen(listener_, 1) != 0) fail(std::strerror(errno));
}

DeviceServer::~DeviceServer() {
  hang_up();
  close(listener_);
  unlink(path_.c_str());
  close(lock_);  // the file stays: who waits for its lock has it open
}

std::optional<ros_device_force> DeviceServer::receive(Duration wait) {
  // only this thread changes peer_
  std::array<pollfd, 2> both{pollfd{.fd = listener_, .events = POLLIN, .revents = 0},
                             pollfd{.fd = peer_, .events = POLLIN, .revents = 0}};
  const timespec limit{.tv_sec = 0, .tv_nsec = std::clamp<long>(wait.count(), 0, 999'999'999)};
  if (ppoll(both.data(), both.size(), &limit, nullptr) <= 0) return std::nullopt;
  if (both[1].revents == 0) {
    accept_peer();
    return std::nullopt;
  }
  std::optional<ros_device_force> newest;
  constexpr int kMost = 256;
  for (int i = 0; i < kMost; ++i) {
    ros_device_force force{};
    const ssize_t got = recv(both[1].fd, &force, sizeof(force), MSG_DONTWAIT | MSG_TRUNC);
    if (got < 0 && (errno == EAGAIN || errno == EINTR)) break;
    if (got == static_cast<ssize_t>(sizeof(force)) && force.wire == ROS_DEVICE_WIRE) {
      newest = force;
      continue;
    }
    if (got > 0) refusal_ = "it speaks otherwise: the plug-in is of another version";
    hang_up();
    break;
  }
  return newest;
}

void DeviceServer::accept_peer() {
  const int asking = accept4(listener_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
  if (asking < 0) return;
  ucred who{};
  socklen_t size = sizeof(who);
  const bool is_known = getsockopt(asking, SOL_SOCKET, SO_PEERCRED, &who, &size) == 0 &&
                        (who.uid == geteuid() || who.uid == 0);
  if (!is_known || peer_ >= 0) {
    refusal_ = is_known ? "another one is served" : "it is of another user";
    close(asking);
    return;
  }
  const std::scoped_lock lock(mutex_);
  peer_ = asking;
}

void DeviceServer::hang_up() {
  const std::scoped_lock lock(mutex_);
  if (peer_ >= 0) close(peer_);
  peer_ = -1;
}

void DeviceServer::send(const ros_device_pose& pose) noexcept {
  const std::scoped_lock lock(mutex_);
  if (peer_ >= 0) ::send(peer_, &pose, sizeof(pose), MSG_DONTWAIT | MSG_NOSIGNAL);
}

bool DeviceServer::has_peer() const {
  const std::scoped_lock lock(mutex_);
  return peer_ >= 0;
}

}  // namespace palpate::ros
