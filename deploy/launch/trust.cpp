// SPDX-License-Identifier: Apache-2.0
#include "deploy/launch/trust.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <set>
#include <system_error>
#include <variant>

#include "common/core/check.h"
#include "common/core/user/files.h"
#include "common/core/user/sha256.h"
#include "common/session/session_file.h"
#include "deploy/launch/ownership.h"
#include "deploy/launch/physics_command.h"

namespace palpate {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kMaxCodeBytes = std::uintmax_t{1} << 30U;

fs::path absolute_of(const fs::path& path) {
  std::error_code error;
  return fs::absolute(path, error).lexically_normal();
}

/// Where a word of the command may lead: "model.py", "--model=model.py", the module after "-m".
std::vector<fs::path> files_of_word(const std::vector<std::string>& command, std::size_t i,
                                    const fs::path& folder) {
  const std::string& word = command[i];
  std::vector<fs::path> files{folder / word};
  if (const auto equals = word.find('='); equals != std::string::npos) {
    files.push_back(folder / word.substr(equals + 1));
  }
  if (command[i - 1] == "-m") {
    std::string module = word;
    std::replace(module.begin(), module.end(), '.', '/');
    files.push_back(folder / module);
    files.push_back(folder / (module + ".py"));
  }
  return files;
}

/// By its content and that of what it runs, and by their places; of a folder, by its files.
std::string hash_of(const Session& session, const std::vector<ForeignCode>& code) {
  std::string all;
  const auto add_file = [&](const fs::path& file) {
    const FileContent content = read_regular_file(file, kMaxCodeBytes);
    if (!content.complaint.empty()) throw SetupError(file.string() + ": " + content.complaint);
    all += absolute_of(file).string() + '\0' + sha256_hex(content.bytes) + '\n';
  };
  const auto add = [&](const fs::path& file) {
    std::error_code error;
    if (!fs::is_directory(file, error)) return add_file(file);
    std::set<fs::path> files;
    for (const auto& entry : fs::directory_iterator(file, error)) {
      if (entry.is_regular_file(error)) files.insert(entry.path());
    }
    for (const fs::path& one : files) add_file(one);
  };
  add(session.file);
  for (const std::string& word : session.physics_command) all += word + '\0';
  for (const ForeignCode& one : code) {
    all += one.field + '\0';
    if (one.file.is_absolute()) add(one.file);
  }
  return sha256_hex(all);
}

/// Of the session, or what it runs; empty: nothing is.
std::string why_strange(const Session& session, const std::vector<ForeignCode>& code) {
  if (code.empty()) return {};
  const OwnUsers users;
  std::error_code error;
  // as written, and as its folder is handed to the program
  const fs::path file = fs::absolute(session.file, error);
  std::string why = users.why_strange(file);
  if (why.empty()) why = users.why_strange(file.lexically_normal());
  for (const ForeignCode& one : code) {
    if (why.empty() && one.file.is_absolute()) why = users.why_strange(one.file);
  }
  return why;
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
      for (const fs::path& file : files_of_word(session.physics_command, i, folder)) {
        std::error_code error;
        if (fs::is_regular_file(file, error) || fs::is_directory(file, error)) {
          code.push_back({"physics.command", file});
        }
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

std::string require_trust(const Session& session, const std::vector<ForeignCode>& code,
                          bool is_trusted) {
  const std::string why = why_strange(session, code);
  if (why.empty()) return {};
  std::string hash = hash_of(session, code);
  if (is_trusted) remember(hash, session);
  if (is_trusted || is_remembered(hash)) return hash;
  std::string text = session.file + ": runs what somebody else may have put there: " + why;
  for (const std::string& line : foreign_code_lines(session, code)) text += "\n  " + line;
  throw SetupError(text +
                   "\nlook at these files; then give --trust once (it is remembered until one of "
                   "them changes), or copy them into a folder that only you may write");
}

void require_same_trust(const Session& session, const std::vector<ForeignCode>& code,
                        const std::string& trusted) {
  const std::string why = why_strange(session, code);
  if (why.empty() || (!trusted.empty() && hash_of(session, code) == trusted)) return;
  throw SetupError(session.file +
                   ": not started again, as somebody else may have changed what it " +
                   "runs since: " + why);
}

}  // namespace palpate
