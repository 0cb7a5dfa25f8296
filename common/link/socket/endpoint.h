// SPDX-License-Identifier: Apache-2.0
// endpoint.h — the endpoint of a socket, and the exclusive use of an ipc path.
#pragma once

#include <string>

namespace palpate {

/// One end of a link. One end of every link binds, the others connect, in any order of starting.
struct Attachment {
  enum class Role { kBind, kConnect };
  Role role = Role::kConnect;
  std::string endpoint;  ///< ipc://PATH, tcp://HOST:PORT or inproc://NAME
  std::string setting;   ///< the session field, for error messages: "links.exchange"
};
[[nodiscard]] inline Attachment bind_to(std::string endpoint, std::string setting) {
  return {Attachment::Role::kBind, std::move(endpoint), std::move(setting)};
}
[[nodiscard]] inline Attachment connect_to(std::string endpoint, std::string setting) {
  return {Attachment::Role::kConnect, std::move(endpoint), std::move(setting)};
}

enum class Scheme { kIpc, kTcp, kInproc };
/// Throws SetupError if the endpoint has none of the three forms, or if its ipc path is longer than
/// a Unix socket allows.
[[nodiscard]] Scheme scheme_of(const Attachment& attachment);
/// For tcp only: 127.0.0.0/8, [::1] and localhost; other names are not resolved.
[[nodiscard]] bool is_on_loopback(const Attachment& attachment);

/// For ipc only: creates the folder of the path if it is missing. Throws SetupError unless only
/// this user can replace what is in it; see make_private_folder(). Needed before connecting too: in
/// a folder that does not exist yet, somebody else could listen first.
void require_private_folder(const Attachment& attachment);

/// libzmq silently takes over an ipc path in use and never removes the socket file. Therefore the
/// binding process holds a lock on PATH.lock. Files left by a dead process are replaced; both files
/// are removed at the end.
class IpcClaim {
 public:
  /// Throws SetupError if another process uses the path, or if it is a file other than a socket.
  explicit IpcClaim(const Attachment& attachment);
  ~IpcClaim();
  IpcClaim(const IpcClaim&) = delete;
  IpcClaim& operator=(const IpcClaim&) = delete;

 private:
  std::string path_;
  std::string lock_path_;
  int lock_ = -1;
};

}  // namespace palpate
