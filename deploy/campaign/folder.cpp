// SPDX-License-Identifier: Apache-2.0
#include "deploy/campaign/folder.h"

#include <fcntl.h>
#include <spdlog/fmt/fmt.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>
#include <thread>

#include "common/core/check.h"
#include "common/core/clock.h"
#include "common/core/user/files.h"
#include "common/core/user/output_file.h"

namespace palpate::campaign {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kMostMarkBytes = 1000;
/// Workers of a sweep that was killed have this long to end.
constexpr Duration kPatience = std::chrono::seconds(5);

std::string content_of(const Campaign& campaign) {
  return fmt::format("campaign {}\nfingerprint {:016x}\n", campaign.name, campaign.fingerprint);
}

/// A link would have the sweep write a file elsewhere, a pipe would have it wait for ever.
void refuse_strange(const fs::path& folder) {
  for (const auto& entry : fs::directory_iterator(folder)) {
    const fs::file_type type = entry.symlink_status().type();
    if (type == fs::file_type::regular || type == fs::file_type::directory) continue;
    throw SetupError(entry.path().string() + ": is " +
                     (type == fs::file_type::symlink ? "a link" : "a pipe, socket or device") +
                     "; a folder of results holds files only: remove it, or give another folder "
                     "with --folder");
  }
}

}  // namespace

fs::path default_folder(const Campaign& campaign) { return campaign.name + ".sweep"; }

Folder::Folder(fs::path path, const Campaign& campaign, bool is_shared) : path_(std::move(path)) {
  std::error_code error;
  fs::create_directories(path_, error);
  if (!error) refuse_strange(path_);
  const fs::path lock = path_ / "lock";
  lock_ = error ? -1 : ::open(lock.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0644);
  if (lock_ < 0) {
    throw SetupError(path_.string() + ": " +
                     (error ? error.message() : std::generic_category().message(errno)) +
                     "; give another folder with --folder");
  }
  const SteadyClock clock;
  const TimePoint begin = clock.now();
  while (!is_shared && ::flock(lock_, LOCK_EX | LOCK_NB) != 0) {
    if (clock.now() - begin > kPatience) {
      ::close(lock_);
      throw SetupError(path_.string() +
                       ": another sweep uses this folder; wait for it, or give another one with "
                       "--folder");
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }

  const fs::path mark = path_ / "campaign.txt";
  const FileContent known = fs::exists(mark) ? read_text_file(mark, kMostMarkBytes) : FileContent{};
  if (!known.complaint.empty()) {
    ::close(lock_);
    throw SetupError(mark.string() + ": " + known.complaint +
                     "; a sweep has not written it: give another folder with --folder");
  }
  if (known.bytes == content_of(campaign)) return;
  if (!known.bytes.empty()) {
    ::close(lock_);
    throw SetupError(path_.string() +
                     ": has the results of another campaign, or of this one before the campaign, a "
                     "file of its session or the program changed; remove the folder, or give "
                     "another one with --folder");
  }
  write_file("mark", mark.string(), content_of(campaign), true);
}

Folder::~Folder() { ::close(lock_); }

}  // namespace palpate::campaign
