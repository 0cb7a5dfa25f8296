// SPDX-License-Identifier: Apache-2.0
// keys.h — access to links over tcp: key pairs (CURVE), the list of allowed keys, and the folder
// that contains them.
//
//   allowed.keys       public keys by role, the same file on every host; one line each: ROLE KEY
//   ROLE.key_secret    key pair of a role, readable by its owner only, on the hosts of that role;
//                      in CZMQ's certificate format, as read by pyzmq's zmq.auth.load_certificate
//
// Keys are Z85 text. Error messages never contain a key.
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

/// The role of a key determines which links it may use. device_node and mofc_node share one.
enum class KeyRole : std::uint8_t {
  kDevice,
  kPhysics,
  kViewer,
  kPointer,
  kStandby,
  kRelay,
  kAudience,
};
inline constexpr std::array<KeyRole, 7> kAllKeyRoles{
    KeyRole::kDevice,  KeyRole::kPhysics, KeyRole::kViewer,  KeyRole::kPointer,
    KeyRole::kStandby, KeyRole::kRelay,   KeyRole::kAudience};
inline constexpr std::size_t kKeyRoles = kAllKeyRoles.size();
/// "device", "physics", "viewer", "pointer", "standby", "relay", "audience".
[[nodiscard]] const char* name_of(KeyRole role);

/// The roles of the end that binds a link and of those that may connect to it.
struct LinkRoles {
  std::string_view link;  ///< the session's field; of the relay, kRelayLink
  KeyRole server;
  KeyRole client;
};
/// From viewer_node --publish to viewer_node --follow; no session field.
inline constexpr std::string_view kRelayLink = "relay";
inline constexpr std::array<LinkRoles, 11> kLinkRoles{{
    {"links.exchange", KeyRole::kDevice, KeyRole::kDevice},
    {"links.tool_motion", KeyRole::kPhysics, KeyRole::kDevice},
    {"links.interaction", KeyRole::kPhysics, KeyRole::kDevice},
    {"links.device_telemetry", KeyRole::kDevice, KeyRole::kViewer},
    {"links.mofc_telemetry", KeyRole::kDevice, KeyRole::kViewer},
    {"links.physics_telemetry", KeyRole::kPhysics, KeyRole::kViewer},
    {"links.hand_target", KeyRole::kDevice, KeyRole::kPointer},
    {"links.standby_tool_motion", KeyRole::kStandby, KeyRole::kDevice},
    {"links.standby_interaction", KeyRole::kStandby, KeyRole::kDevice},
    {"links.standby_telemetry", KeyRole::kStandby, KeyRole::kViewer},
    {kRelayLink, KeyRole::kRelay, KeyRole::kAudience},
}};
/// nullptr if a session has no such link.
[[nodiscard]] const LinkRoles* roles_of(std::string_view link);

/// Z85, 40 characters each.
struct KeyPair {
  std::string public_key;
  std::string secret_key;
};
/// Throws SetupError if libzmq was built without CURVE.
[[nodiscard]] KeyPair new_key_pair();

/// Public keys by role: exactly one device key and one physics key, which connecting ends require
/// of the binding end, at most one standby key and one relay key, and any number of viewer, pointer
/// and audience keys.
class AllowedKeys {
 public:
  /// nullopt: the key is not listed.
  [[nodiscard]] std::optional<KeyRole> role_of(std::string_view public_key) const;
  /// @param role  kDevice, kPhysics, kStandby or kRelay. Throws SetupError if no key of it is
  /// listed.
  [[nodiscard]] const std::string& server_key(KeyRole role) const;

 private:
  friend AllowedKeys parse_allowed_keys(std::string_view text, const std::string& file);
  std::vector<std::pair<KeyRole, std::string>> keys_;
};

/// The text consists of lines `ROLE KEY`, empty lines, and comments that begin with '#'.
/// @throws SetupError with all problems, one per line: "FILE:3: …; remedy"
[[nodiscard]] AllowedKeys parse_allowed_keys(std::string_view text, const std::string& file);
/// @throws SetupError as parse_allowed_keys, also if the two keys do not form a pair
[[nodiscard]] KeyPair parse_key_pair(std::string_view text, const std::string& file);
[[nodiscard]] std::string key_pair_text(KeyRole role, const KeyPair& pair);

/// The keys of one program.
struct LinkKeys {
  AllowedKeys allowed;
  std::array<std::optional<KeyPair>, kKeyRoles> own{};

  [[nodiscard]] const std::optional<KeyPair>& of(KeyRole role) const {
    return own[static_cast<std::size_t>(role)];
  }
};
/// Reads allowed.keys, the key pairs of `roles` and those of `optional` that exist.
/// @throws SetupError  also if other users may change the list or read a secret, or if the public
///     key of a pair is not listed for its role
[[nodiscard]] LinkKeys load_link_keys(const std::filesystem::path& folder,
                                      std::span<const KeyRole> roles,
                                      std::span<const KeyRole> optional = {});

/// Writes a new key pair for each role and the list of them. @return the files written
/// @throws SetupError if one of the files exists; nothing is written then
std::vector<std::filesystem::path> make_key_folder(const std::filesystem::path& folder);

}  // namespace palpate
