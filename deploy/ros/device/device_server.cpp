// SPDX-License-Identifier: Apache-2.0
#include "deploy/ros/device/device_server.h"

#include <poll.h>
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
  const int other = make_socket();
  const bool is_served = other >= 0 && connect(other, plain(address), sizeof(address)) == 0;
  if (other >= 0) close(other);
  if (is_served) {
    throw SetupError("socket " + path +
                     ": another program serves it; end that `palpate ros device`");
  }
  struct stat status {};
  if (lstat(path.c_str(), &status) == 0 && S_ISSOCK(status.st_mode)) unlink(path.c_str());
  listener_ = make_socket();
  const mode_t mask = umask(0177);
  const bool is_bound = listener_ >= 0 && bind(listener_, plain(address), sizeof(address)) == 0;
  const int why = errno;
  umask(mask);
  if (is_bound && listen(listener_, 1) == 0) return;
  if (listener_ >= 0) close(listener_);
  throw SetupError("socket " + path + ": " + std::strerror(why) +
                   "; name another file in the options of the plug-in, in a folder of your own");
}

DeviceServer::~DeviceServer() {
  hang_up();
  close(listener_);
  unlink(path_.c_str());
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
  ros_device_force force{};
  const ssize_t got = recv(both[1].fd, &force, sizeof(force), MSG_DONTWAIT);
  if (got == static_cast<ssize_t>(sizeof(force)) && force.wire == ROS_DEVICE_WIRE) return force;
  if (got < 0 && (errno == EAGAIN || errno == EINTR)) return std::nullopt;
  if (got > 0) refusal_ = "it speaks otherwise: the plug-in is of another version";
  hang_up();
  return std::nullopt;
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
