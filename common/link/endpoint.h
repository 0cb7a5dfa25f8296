// endpoint.h — where a socket attaches, and the sole right to an ipc path.
#pragma once

#include <string>

namespace palpate {

/// One end of a link. Every link has one end that binds; the others connect and find it, whichever
/// starts first.
struct Attachment {
  enum class Role { kBind, kConnect };
  Role role = Role::kConnect;
  std::string endpoint;  ///< ipc://PATH, tcp://HOST:PORT or inproc://NAME
  std::string setting;   ///< the session's field, for messages: "links.exchange"
};
[[nodiscard]] inline Attachment bind_to(std::string endpoint, std::string setting) {
  return {Attachment::Role::kBind, std::move(endpoint), std::move(setting)};
}
[[nodiscard]] inline Attachment connect_to(std::string endpoint, std::string setting) {
  return {Attachment::Role::kConnect, std::move(endpoint), std::move(setting)};
}

enum class Scheme { kIpc, kTcp, kInproc };
/// Throws SetupError if the endpoint is none of the three forms, or its ipc path is longer than a
/// Unix socket allows.
[[nodiscard]] Scheme scheme_of(const Attachment& attachment);
/// tcp only. 127.0.0.0/8, [::1] and localhost; other names are not asked for.
[[nodiscard]] bool is_on_loopback(const Attachment& attachment);

/// libzmq takes a live ipc path over without a word and never removes its file. So whoever binds
/// one holds a lock on PATH.lock. The parent folder is made if it is absent, for this user alone.
/// What a dead process left behind is taken over; both files are removed at the end.
class IpcClaim {
 public:
  /// Throws SetupError if another process has the path, if its folder belongs to another user, or
  /// if something that is no socket lies there.
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
