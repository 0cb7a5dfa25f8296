// keys.h — who may talk to whom over tcp: key pairs (CURVE), the list of the allowed, and the
// folder that holds them.
//
//   allowed.keys       public keys by role, the same file on every host; a line each: ROLE KEY
//   ROLE.key_secret    key pair of a role, readable by its owner only, on the hosts of that role;
//                      CZMQ's certificate format, so pyzmq's zmq.auth.load_certificate reads it
//
// Keys are Z85 text. Messages never contain one.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace palpate {

/// What a key may do. The device's side is device_node and mofc_node.
enum class KeyRole : std::uint8_t { kDevice, kPhysics, kViewer, kPointer };
inline constexpr std::size_t kKeyRoles = 4;
/// "device", "physics", "viewer", "pointer".
[[nodiscard]] const char* name_of(KeyRole role);

/// Who binds a link and who may connect to it.
struct LinkRoles {
  std::string_view link;  ///< the session's field
  KeyRole server;
  KeyRole client;
};
inline constexpr std::array<LinkRoles, 7> kLinkRoles{{
    {"links.exchange", KeyRole::kDevice, KeyRole::kDevice},
    {"links.tool_motion", KeyRole::kPhysics, KeyRole::kDevice},
    {"links.interaction", KeyRole::kPhysics, KeyRole::kDevice},
    {"links.device_telemetry", KeyRole::kDevice, KeyRole::kViewer},
    {"links.mofc_telemetry", KeyRole::kDevice, KeyRole::kViewer},
    {"links.physics_telemetry", KeyRole::kPhysics, KeyRole::kViewer},
    {"links.hand_target", KeyRole::kDevice, KeyRole::kPointer},
}};
/// nullptr for what is no link of a session.
[[nodiscard]] const LinkRoles* roles_of(std::string_view link);

/// Z85, 40 characters each.
struct KeyPair {
  std::string public_key;
  std::string secret_key;
};
/// Throws SetupError if libzmq was built without CURVE.
[[nodiscard]] KeyPair new_key_pair();

/// Public keys by role. Exactly one of the device's side and one of physics, which the connecting
/// ends expect at the other end; any number of viewers and pointers.
class AllowedKeys {
 public:
  /// nullopt: a stranger's.
  [[nodiscard]] std::optional<KeyRole> role_of(std::string_view public_key) const;
  /// @param role  kDevice or kPhysics
  [[nodiscard]] const std::string& server_key(KeyRole role) const;

 private:
  friend AllowedKeys parse_allowed_keys(std::string_view text, const std::string& file);
  std::vector<std::pair<KeyRole, std::string>> keys_;
};

/// Lines `ROLE KEY`, empty lines, and comments that begin with '#'.
/// @throws SetupError with all problems, a line each: "FILE:3: …; remedy"
[[nodiscard]] AllowedKeys parse_allowed_keys(std::string_view text, const std::string& file);
/// @throws SetupError as parse_allowed_keys, also if the two keys are no pair
[[nodiscard]] KeyPair parse_key_pair(std::string_view text, const std::string& file);
[[nodiscard]] std::string key_pair_text(KeyRole role, const KeyPair& pair);

/// What one program knows.
struct LinkKeys {
  AllowedKeys allowed;
  std::array<std::optional<KeyPair>, kKeyRoles> own{};

  [[nodiscard]] const std::optional<KeyPair>& of(KeyRole role) const {
    return own[static_cast<std::size_t>(role)];
  }
};
/// Reads allowed.keys and the key pairs of these roles; of `optional`, those that are there.
/// @throws SetupError  also if others may change the list or read a secret, or if a pair's public
///     key is not listed for its role
[[nodiscard]] LinkKeys load_link_keys(const std::filesystem::path& folder,
                                      std::span<const KeyRole> roles,
                                      std::span<const KeyRole> optional = {});

/// A key pair for each role and the list of them. @return the files written.
/// @throws SetupError if one of the files is there already; nothing is written then
std::vector<std::filesystem::path> make_key_folder(const std::filesystem::path& folder);

}  // namespace palpate
