// SPDX-License-Identifier: Apache-2.0
#include "deploy/launch/trust.h"

#include <fcntl.h>
#include <grp.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <fstream>
#include <set>
#include <system_error>
#include <variant>

#include "common/core/check.h"
#include "common/core/user/files.h"
#include "common/core/user/sha256.h"
#include "common/session/session_file.h"
#include "deploy/launch/physics_command.h"

namespace palpate {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kMaxCodeBytes = std::uintmax_t{1} << 30U;

fs::path absolute_of(const fs::path& path) {
  std::error_code error;
  return fs::absolute(path, error).lexically_normal();
}

/// Users who decide already what this program does.
std::set<uid_t> own_users() {
  std::set<uid_t> users{0, geteuid()};
  if (geteuid() == 0) {
    // NOLINTNEXTLINE(concurrency-mt-unsafe): nothing sets it
    if (const char* caller = std::getenv("SUDO_UID"); caller != nullptr) {
      char* end = nullptr;
      const unsigned long uid = std::strtoul(caller, &end, 10);
      if (*caller != '\0' && *end == '\0') users.insert(static_cast<uid_t>(uid));
    }
  }
  std::error_code error;
  for (fs::path at = fs::read_symlink("/proc/self/exe", error); at.has_relative_path();
       at = at.parent_path()) {
    struct stat status {};
    if (lstat(at.c_str(), &status) == 0) users.insert(status.st_uid);
  }
  return users;
}

/// The group of a user's own: of that name, without other members.
bool is_private_group(gid_t group, const std::set<uid_t>& users) {
  // NOLINTBEGIN(concurrency-mt-unsafe): called before any other thread uses them
  const struct group* entry = getgrgid(group);
  if (entry == nullptr) return false;
  const std::string name = entry->gr_name;
  for (char** member = entry->gr_mem; *member != nullptr; ++member) {
    if (name != *member) return false;
  }
  const struct passwd* user = getpwnam(name.c_str());
  return user != nullptr && user->pw_gid == group && users.contains(user->pw_uid);
  // NOLINTEND(concurrency-mt-unsafe)
}

std::string why_not_own(const fs::path& path, bool is_above, const std::set<uid_t>& users) {
  struct stat status {};
  if (lstat(path.c_str(), &status) != 0) {
    return path.string() + ": " + std::generic_category().message(errno);
  }
  if (!users.contains(status.st_uid)) return path.string() + " belongs to another user";
  if (S_ISLNK(status.st_mode)) return {};
  // what lies in a sticky folder can be replaced by its owner only
  if (is_above && (status.st_mode & S_ISVTX) != 0) return {};
  const bool is_open = (status.st_mode & S_IWOTH) != 0 ||
                       ((status.st_mode & S_IWGRP) != 0 && !is_private_group(status.st_gid, users));
  return is_open ? "other users may write " + path.string() : std::string();
}

/// Of a file and of every folder on the way, as written and where links lead.
std::string why_strange(const fs::path& file, const std::set<uid_t>& users) {
  std::error_code error;
  for (const fs::path& way : {absolute_of(file), fs::canonical(file, error)}) {
    bool is_above = false;
    for (fs::path at = way; at.has_relative_path(); at = at.parent_path(), is_above = true) {
      if (std::string why = why_not_own(at, is_above, users); !why.empty()) return why;
    }
  }
  return {};
}

/// By its content and that of what it runs, and by their places.
std::string hash_of(const Session& session, const std::vector<ForeignCode>& code) {
  std::string all;
  const auto add = [&](const fs::path& file) {
    const FileContent content = read_regular_file(file, kMaxCodeBytes);
    if (!content.complaint.empty()) throw SetupError(file.string() + ": " + content.complaint);
    all += absolute_of(file).string() + '\0' + sha256_hex(content.bytes) + '\n';
  };
  add(session.file);
  for (const std::string& word : session.physics_command) all += word + '\0';
  for (const ForeignCode& one : code) {
    all += one.field + '\0';
    if (one.file.is_absolute()) add(one.file);
  }
  return sha256_hex(all);
}

fs::path trusted_file() {
  const fs::path folder = state_folder();
  return folder.empty() ? fs::path() : folder / "trusted_sessions";
}

bool is_remembered(const std::string& hash) {
  const fs::path file = trusted_file();
  if (file.empty() || !why_exposed(file, false).empty()) return false;
  std::ifstream lines(file);
  for (std::string line; std::getline(lines, line);) {
    if (line.substr(0, line.find(' ')) == hash) return true;
  }
  return false;
}

void remember(const std::string& hash, const Session& session) {
  const fs::path file = trusted_file();
  if (file.empty()) return;  // without a home the option is given each time
  if (const std::string why = make_private_folder(file.parent_path()); !why.empty()) {
    throw SetupError("--trust: " + why + ", with PALPATE_STATE_DIR");
  }
  if (is_remembered(hash)) return;
  const int to =
      open(file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_NOFOLLOW | O_CLOEXEC, S_IRUSR | S_IWUSR);
  std::string place = absolute_of(session.file).string();
  std::replace(place.begin(), place.end(), '\n', '?');
  const std::string line = hash + " " + place + "\n";
  const bool is_written =
      to >= 0 && ::write(to, line.data(), line.size()) == static_cast<ssize_t>(line.size());
  const int why = errno;
  if (to >= 0) ::close(to);
  if (!is_written) {
    throw SetupError("--trust: " + file.string() + ": " + std::generic_category().message(why));
  }
}

}  // namespace

std::vector<ForeignCode> foreign_code_of(const Session& session, bool has_physics,
                                         bool has_device) {
  std::vector<ForeignCode> code;
  if (has_physics && !session.physics_command.empty()) {
    code.push_back({"physics.command", absolute_of(program_of(session))});
    // scripts, models: the program runs in the folder of the session
    const fs::path folder = absolute_of(session.file).parent_path();
    for (std::size_t i = 1; i < session.physics_command.size(); ++i) {
      const fs::path file = folder / session.physics_command[i];
      std::error_code error;
      if (fs::is_regular_file(file, error)) {
        code.push_back({"physics.command", file.lexically_normal()});
      }
    }
  }
  for (const Side& side : session.sides) {
    if (!has_device) break;
    const auto* plugin = std::get_if<PluginConfig>(&side.driver);
    if (plugin == nullptr) continue;
    const bool is_known = std::any_of(code.begin(), code.end(), [&](const ForeignCode& one) {
      return one.file == plugin->library;
    });
    if (!is_known) code.push_back({"device.plugin.library", plugin->library});
  }
  return code;
}

std::vector<std::string> foreign_code_lines(const Session& session,
                                            const std::vector<ForeignCode>& code) {
  std::vector<std::string> lines;
  bool is_first = true;
  for (const ForeignCode& one : code) {
    if (one.field == "device.plugin.library") {
      lines.push_back(one.field + " loads " + one.file.string());
    } else if (std::exchange(is_first, false)) {
      std::string line = one.field + " runs " + one.file.string();
      for (std::size_t i = 1; i < session.physics_command.size(); ++i) {
        line += " " + session.physics_command[i];
      }
      lines.push_back(std::move(line));
    }
  }
  return lines;
}

void require_trust(const Session& session, const std::vector<ForeignCode>& code, bool is_trusted) {
  if (code.empty()) return;
  const std::set<uid_t> users = own_users();
  std::string why = why_strange(session.file, users);
  for (const ForeignCode& one : code) {
    if (why.empty() && one.file.is_absolute()) why = why_strange(one.file, users);
  }
  if (why.empty()) return;
  const std::string hash = hash_of(session, code);
  if (is_trusted) return remember(hash, session);
  if (is_remembered(hash)) return;
  std::string text = session.file + ": runs what somebody else may have put there: " + why;
  for (const std::string& line : foreign_code_lines(session, code)) text += "\n  " + line;
  throw SetupError(text +
                   "\nlook at these files; then give --trust once (it is remembered until one of "
                   "them changes), or copy them into a folder that only you may write");
}

}  // namespace palpate
