// SPDX-License-Identifier: Apache-2.0
#include "common/link/socket/endpoint.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>

#include "common/core/check.h"
#include "common/core/user/files.h"

namespace palpate {
namespace {

constexpr std::string_view kIpc = "ipc://";
constexpr std::string_view kTcp = "tcp://";
constexpr std::string_view kInproc = "inproc://";

[[noreturn]] void refuse(const Attachment& a, const std::string& why) {
  throw SetupError(a.setting + " = " + a.endpoint + ": " + why);
}

std::string last_error() { return std::strerror(errno); }

/// The process id that the holder of the lock wrote into the file, or "?".
std::string holder(int lock) {
  char text[16] = {};
  const ssize_t n = pread(lock, text, sizeof(text) - 1, 0);
  return n > 0 ? std::string(text, static_cast<std::size_t>(n)) : "?";
}

}  // namespace

Scheme scheme_of(const Attachment& a) {
  const std::string_view endpoint = a.endpoint;
  if (endpoint.starts_with(kTcp) && endpoint.size() > kTcp.size()) return Scheme::kTcp;
  if (endpoint.starts_with(kInproc) && endpoint.size() > kInproc.size()) return Scheme::kInproc;
  if (endpoint.starts_with(kIpc) && endpoint.size() > kIpc.size()) {
    const std::string_view path = endpoint.substr(kIpc.size());
    if (path.front() == '@' || path == "*" || path.back() == '/') {
      refuse(a, "ipc needs the path of a file, such as ipc:///run/user/1000/palpate/exchange");
    }
    constexpr std::size_t kMaxPath = sizeof(sockaddr_un::sun_path) - 1;
    if (path.size() > kMaxPath) {
      refuse(a, "path of " + std::to_string(path.size()) + " bytes; a Unix socket allows " +
                    std::to_string(kMaxPath) + "; give a shorter one");
    }
    return Scheme::kIpc;
  }
  refuse(a, "is not an endpoint; give ipc://PATH, tcp://HOST:PORT or inproc://NAME");
}

bool is_on_loopback(const Attachment& a) {
  const std::string_view address = std::string_view(a.endpoint).substr(kTcp.size());
  const std::string host(address.substr(0, address.rfind(':')));
  in_addr v4{};
  if (inet_pton(AF_INET, host.c_str(), &v4) == 1) return (ntohl(v4.s_addr) >> 24) == 127;
  return host == "localhost" || host == "[::1]";
}

void require_private_folder(const Attachment& a) {
  const std::filesystem::path path(a.endpoint.substr(kIpc.size()));
  const std::string why =
      make_private_folder(std::filesystem::absolute(path).lexically_normal().parent_path());
  if (!why.empty()) refuse(a, why);
}

IpcClaim::IpcClaim(const Attachment& a)
    : path_(a.endpoint.substr(kIpc.size())), lock_path_(path_ + ".lock") {
  // take the lock; repeat if its last holder removed the file between opening and locking
  for (;;) {
    lock_ = open(lock_path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
    if (lock_ < 0) refuse(a, "cannot open " + lock_path_ + " (" + last_error() + ")");
    if (flock(lock_, LOCK_EX | LOCK_NB) != 0) {
      const std::string process = holder(lock_);
      close(lock_);
      refuse(a, "in use by process " + process + "; stop it or give " + a.setting +
                    " another endpoint");
    }
    struct stat ours {};
    struct stat present {};
    if (fstat(lock_, &ours) == 0 && stat(lock_path_.c_str(), &present) == 0 &&
        ours.st_ino == present.st_ino && ours.st_dev == present.st_dev) {
      break;
    }
    close(lock_);
  }
  const std::string process = std::to_string(getpid());
  if (ftruncate(lock_, 0) != 0 || pwrite(lock_, process.data(), process.size(), 0) < 0) {
    const std::string why = "cannot write " + lock_path_ + " (" + last_error() + ")";
    close(lock_);
    refuse(a, why);
  }

  // remove a stale socket, but no other file
  struct stat status {};
  if (lstat(path_.c_str(), &status) == 0) {
    if (!S_ISSOCK(status.st_mode)) {
      unlink(lock_path_.c_str());
      close(lock_);
      refuse(a, "this path is a file that is not a socket; remove it or give " + a.setting +
                    " another endpoint");
    }
    unlink(path_.c_str());
  }
}

IpcClaim::~IpcClaim() {
  unlink(path_.c_str());
  unlink(lock_path_.c_str());  // before closing the descriptor releases the lock
  close(lock_);
}

}  // namespace palpate
