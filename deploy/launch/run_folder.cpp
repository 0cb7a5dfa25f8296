// SPDX-License-Identifier: Apache-2.0
#include "deploy/launch/run_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>
#include <vector>

#include "common/core/check.h"
#include "common/core/user/files.h"
#include "common/session/session_file.h"

namespace palpate {
namespace {

namespace fs = std::filesystem;

bool is_held(const fs::path& lock) {
  const int file = open(lock.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return false;
  const bool is_held = flock(file, LOCK_EX | LOCK_NB) != 0;
  close(file);
  return is_held;
}

}  // namespace

RunFolder::RunFolder(const std::string& session_name) : path_(run_folder(session_name)) {
  // again if the launch that held the folder removed it between opening and locking
  do {
    if (folder_ >= 0) close(folder_);
    hold(session_name);
  } while (!is_present());
}

void RunFolder::hold(const std::string& session_name) {
  folder_ = -1;
  if (const std::string why = make_private_folder(path_); !why.empty()) {
    refuse(why + ", with PALPATE_RUN_DIR");
  }
  folder_ = open(path_.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
  if (folder_ < 0) {
    if (errno == ENOENT) return;  // removed in this moment
    refuse("cannot be opened: " + std::generic_category().message(errno));
  }
  if (flock(folder_, LOCK_EX | LOCK_NB) != 0) {
    refuse("is in use: session \"" + session_name +
           "\" is already launched; stop that launch, or rename this one with "
           "--set name=OTHER");
  }
}

bool RunFolder::is_present() const {
  struct stat held {};
  struct stat present {};
  return fstat(folder_, &held) == 0 && stat(path_.c_str(), &present) == 0 &&
         held.st_ino == present.st_ino && held.st_dev == present.st_dev;
}

RunFolder::~RunFolder() {
  if (is_present()) {  // else it is that of another launch
    remove_left_files();
    std::error_code not_empty;
    fs::remove(path_, not_empty);
  }
  close(folder_);  // releases the lock
}

void RunFolder::refuse(const std::string& why) {
  if (folder_ >= 0) close(folder_);
  throw SetupError(path_.string() + ": " + why);
}

void RunFolder::remove_left_files() const {
  std::error_code error;
  std::vector<fs::path> left;
  for (const fs::directory_entry& entry : fs::directory_iterator(path_, error)) {
    const bool is_lock = entry.path().extension() == ".lock";
    fs::path lock = entry.path();
    if (!is_lock) lock += ".lock";
    if ((is_lock || entry.is_socket(error)) && !is_held(lock)) left.push_back(entry.path());
  }
  for (const fs::path& file : left) fs::remove(file, error);
}

}  // namespace palpate
