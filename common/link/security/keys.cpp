// SPDX-License-Identifier: Apache-2.0
#include "common/link/security/keys.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zmq.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "common/core/check.h"
#include "common/core/problems.h"
#include "common/core/user/files.h"

namespace palpate {
namespace {

namespace fs = std::filesystem;

constexpr const char* kAllowedFile = "allowed.keys";
constexpr std::size_t kKeyBytes = 32;
constexpr std::size_t kKeyText = 40;
constexpr std::uintmax_t kMaxFileBytes = 64 << 10;

constexpr std::size_t kMaxProblems = 20;
constexpr Place kWholeFile{.line = 0, .column = 0};

std::string secret_file(KeyRole role) { return std::string(name_of(role)) + ".key_secret"; }

bool is_key(std::string_view text) {
  std::array<std::uint8_t, kKeyBytes> bytes{};
  return text.size() == kKeyText && text.find('\0') == std::string_view::npos &&
         zmq_z85_decode(bytes.data(), std::string(text).c_str()) != nullptr;
}

/// The words of each line that is neither empty nor a comment.
template <class Take>
void for_each_line(std::string_view text, const Take& take) {
  constexpr std::string_view kBlank = " \t\r";
  for (int number = 1; !text.empty(); ++number) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    std::vector<std::string_view> words;
    for (;;) {
      line.remove_prefix(std::min(line.find_first_not_of(kBlank), line.size()));
      if (line.empty()) break;
      words.push_back(line.substr(0, line.find_first_of(kBlank)));
      line.remove_prefix(words.back().size());
    }
    if (!words.empty() && words.front().front() != '#') take(number, words);
  }
}

void require_curve() {
  if (zmq_has("curve") == 0) {
    throw SetupError("this libzmq was built without CURVE; install one with it, as Debian's is");
  }
}

/// Refuses files that other users may change or, with `is_secret`, read.
void check_rights(const fs::path& path, bool is_secret) {
  std::string why = why_exposed(path, is_secret);
  std::error_code error;
  if (!fs::exists(path, error)) {
    why += "; make keys with `palpate keygen FOLDER`, or check security.key_folder";
  }
  if (!why.empty()) throw SetupError(path.string() + ": " + why);
}

std::string read(const fs::path& path) {
  FileContent content = read_text_file(path, kMaxFileBytes);
  if (!content.complaint.empty()) throw SetupError(path.string() + ": " + content.complaint);
  return std::move(content.bytes);
}

/// Creates a file; never overwrites one.
void write_new(const fs::path& path, const std::string& text, mode_t mode) {
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, mode);
  const bool is_written =
      file >= 0 && write(file, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  const std::string why = std::strerror(errno);
  if (file >= 0) close(file);
  if (!is_written) throw SetupError(path.string() + ": cannot be written (" + why + ")");
}

}  // namespace

const char* name_of(KeyRole role) {
  switch (role) {
    case KeyRole::kDevice:
      return "device";
    case KeyRole::kPhysics:
      return "physics";
    case KeyRole::kViewer:
      return "viewer";
    case KeyRole::kStandby:
      return "standby";
    case KeyRole::kRelay:
      return "relay";
    case KeyRole::kAudience:
      return "audience";
    case KeyRole::kPointer:
      break;
  }
  return "pointer";
}

const LinkRoles* roles_of(std::string_view link) {
  const auto* found = std::find_if(kLinkRoles.begin(), kLinkRoles.end(),
                                   [&](const LinkRoles& roles) { return roles.link == link; });
  return found == kLinkRoles.end() ? nullptr : found;
}

KeyPair new_key_pair() {
  require_curve();
  std::array<char, kKeyText + 1> public_key{};
  std::array<char, kKeyText + 1> secret_key{};
  PALPATE_REQUIRE(zmq_curve_keypair(public_key.data(), secret_key.data()) == 0);
  return {.public_key = public_key.data(), .secret_key = secret_key.data()};
}

std::optional<KeyRole> AllowedKeys::role_of(std::string_view public_key) const {
  for (const auto& [role, key] : keys_) {
    if (key == public_key) return role;
  }
  return std::nullopt;
}

const std::string& AllowedKeys::server_key(KeyRole role) const {
  const auto found =
      std::find_if(keys_.begin(), keys_.end(), [&](const auto& key) { return key.first == role; });
  if (found == keys_.end()) {
    throw SetupError(std::string("no key of ") + name_of(role) +
                     " is listed among the allowed keys; make a new folder with `palpate keygen`");
  }
  return found->second;
}

AllowedKeys parse_allowed_keys(std::string_view text, const std::string& file) {
  Problems problems(file, {}, kMaxProblems);
  AllowedKeys allowed;
  std::array<int, kKeyRoles> count{};
  for_each_line(text, [&](int line, const std::vector<std::string_view>& words) {
    const auto* role = std::find_if(kAllKeyRoles.begin(), kAllKeyRoles.end(),
                                    [&](KeyRole r) { return words.front() == name_of(r); });
    if (role == kAllKeyRoles.end()) {
      problems.add({.line = line, .column = 0},
                   "must begin with device, physics, viewer, pointer, standby, relay or audience; "
                   "correct the role");
    } else if (words.size() != 2) {
      problems.add({.line = line, .column = 0},
                   "must be a role and a key; put comments on separate lines that begin with #");
    } else if (!is_key(words[1])) {
      problems.add({.line = line, .column = 0},
                   "the key must be 40 characters of Z85; copy the line of `palpate keygen`");
    } else if (allowed.role_of(words[1])) {
      problems.add({.line = line, .column = 0},
                   "this key is listed above; give each role and host its own");
    } else {
      ++count[static_cast<std::size_t>(*role)];
      allowed.keys_.emplace_back(*role, words[1]);
    }
  });
  for (const KeyRole role : {KeyRole::kDevice, KeyRole::kPhysics}) {
    if (count[static_cast<std::size_t>(role)] != 1) {
      problems.add(kWholeFile,
                   std::string("must list exactly one good key of ") + name_of(role) +
                       ": only one program may write forces; copy the file of `palpate keygen`");
    }
  }
  for (const KeyRole role : {KeyRole::kStandby, KeyRole::kRelay}) {
    if (count[static_cast<std::size_t>(role)] > 1) {
      problems.add(kWholeFile, std::string("must list at most one key of ") + name_of(role) +
                                   "; remove the others");
    }
  }
  problems.throw_if_any();
  return allowed;
}

KeyPair parse_key_pair(std::string_view text, const std::string& file) {
  Problems problems(file, {}, kMaxProblems);
  KeyPair pair;
  bool is_in_curve = false;
  for_each_line(text, [&](int line, const std::vector<std::string_view>& words) {
    if (words.size() == 1 && (words[0] == "metadata" || words[0] == "curve")) {
      is_in_curve = words[0] == "curve";
      return;
    }
    if (!is_in_curve) return;
    std::string* const key = words[0] == "public-key"   ? &pair.public_key
                             : words[0] == "secret-key" ? &pair.secret_key
                                                        : nullptr;
    if (key == nullptr || words.size() != 3 || words[1] != "=") {
      problems.add({.line = line, .column = 0},
                   "must be public-key = \"…\" or secret-key = \"…\"; copy the whole file");
    } else if (!key->empty()) {
      problems.add({.line = line, .column = 0}, "is given twice; remove one");
    } else if (words[2].size() != kKeyText + 2 || words[2].front() != '"' ||
               words[2].back() != '"' || !is_key(words[2].substr(1, kKeyText))) {
      problems.add({.line = line, .column = 0},
                   "the key must be 40 characters of Z85 in quotes; copy the whole file");
    } else {
      *key = words[2].substr(1, kKeyText);
    }
  });
  problems.throw_if_any();
  std::array<char, kKeyText + 1> public_key{};
  if (pair.public_key.empty() || pair.secret_key.empty()) {
    problems.add(kWholeFile,
                 "must give public-key and secret-key below `curve`; copy the whole file");
  } else if (zmq_curve_public(public_key.data(), pair.secret_key.c_str()) != 0 ||
             pair.public_key != public_key.data()) {
    problems.add(kWholeFile, "public-key is not that of secret-key; copy the whole file");
  }
  problems.throw_if_any();
  return pair;
}

std::string key_pair_text(KeyRole role, const KeyPair& pair) {
  return std::string("# Key pair of Palpate's ") + name_of(role) +
         ", made by palpate keygen. Secret: only on the hosts of that role.\nmetadata\n    role = "
         "\"" +
         name_of(role) + "\"\ncurve\n    public-key = \"" + pair.public_key +
         "\"\n    secret-key = \"" + pair.secret_key + "\"\n";
}

LinkKeys load_link_keys(const fs::path& folder, std::span<const KeyRole> roles,
                        std::span<const KeyRole> optional) {
  require_curve();
  check_rights(folder, false);
  const fs::path list = folder / kAllowedFile;
  check_rights(list, false);
  LinkKeys keys{.allowed = parse_allowed_keys(read(list), list.string())};
  const auto take = [&](KeyRole role) {
    const fs::path file = folder / secret_file(role);
    check_rights(file, true);
    KeyPair pair = parse_key_pair(read(file), file.string());
    if (keys.allowed.role_of(pair.public_key) != role) {
      throw SetupError(file.string() + ": its public key is not listed for " + name_of(role) +
                       " in " + list.string() + "; use the files of one run of `palpate keygen`");
    }
    keys.own[static_cast<std::size_t>(role)] = std::move(pair);
  };
  for (const KeyRole role : roles) take(role);
  for (const KeyRole role : optional) {
    if (fs::exists(folder / secret_file(role))) take(role);
  }
  return keys;
}

std::vector<fs::path> make_key_folder(const fs::path& folder) {
  std::string list =
      "# Keys with access to this deployment over tcp, the same file on every host. One line "
      "each:\n"
      "# ROLE KEY. To revoke a key, remove its line and restart the nodes.\n";
  std::vector<std::pair<fs::path, std::string>> secrets;
  for (const KeyRole role : kAllKeyRoles) {
    const KeyPair pair = new_key_pair();
    list += std::string(name_of(role)) + " " + pair.public_key + "\n";
    secrets.emplace_back(folder / secret_file(role), key_pair_text(role, pair));
  }
  if (mkdir(folder.c_str(), S_IRWXU) != 0 && errno != EEXIST) {
    throw SetupError(folder.string() + ": cannot be created (" + std::strerror(errno) +
                     "); give a folder in one that you may write");
  }
  std::vector<fs::path> files{folder / kAllowedFile};
  for (const auto& secret : secrets) files.push_back(secret.first);
  for (const fs::path& file : files) {
    if (fs::exists(fs::symlink_status(file))) {
      throw SetupError(file.string() +
                       ": exists already; keygen never overwrites keys: give another folder");
    }
  }
  for (const auto& [file, text] : secrets) write_new(file, text, 0600);
  write_new(files.front(), list, 0644);
  return files;
}

}  // namespace palpate
