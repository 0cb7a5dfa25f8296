// SPDX-License-Identifier: Apache-2.0
#include "common/core/user/output_file.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <random>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "common/core/check.h"

namespace palpate {
namespace {

namespace fs = std::filesystem;

constexpr int kFailure = 1;            // exit status
constexpr mode_t kModeOfFiles = 0666;  // less the umask
constexpr mode_t kWritable = S_IWUSR | S_IWGRP | S_IWOTH;
constexpr int kReaderPoll_ms = 20;

std::string in_words(int error) { return std::generic_category().message(error); }

/// Same path, also if nothing is there yet, or the same file under another name.
bool is_same(const std::string& a, const std::string& b) {
  std::error_code error;
  const auto whole = [&](const std::string& file) {
    return fs::weakly_canonical(fs::absolute(file, error), error);
  };
  if (whole(a) == whole(b)) return true;
  return fs::equivalent(a, b, error);
}

/// The file itself; of a folder the files in it.
std::vector<std::string> files_at(const std::string& input) {
  std::error_code error;
  if (!fs::is_directory(input, error)) return {input};
  std::vector<std::string> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(input, error)) {
    files.push_back(entry.path().string());
  }
  return files;
}

std::string why_exists(const std::string& what, const std::string& file) {
  return what + " " + file + ": exists; give another name, or --overwrite";
}

}  // namespace

void check_outputs(const std::vector<NamedOutput>& outputs, const std::vector<std::string>& inputs,
                   bool may_overwrite) {
  for (auto output = outputs.begin(); output != outputs.end(); ++output) {
    if (output->file.empty()) continue;
    for (auto other = std::next(output); other != outputs.end(); ++other) {
      if (other->file.empty() || !is_same(output->file, other->file)) continue;
      throw SetupError(output->option + " and " + other->option + ": both name " + output->file +
                       "; give each a file of its own");
    }
    if (output->file == kStandardOutput) continue;
    for (const std::string& input : inputs) {
      if (input.empty()) continue;
      for (const std::string& file : files_at(input)) {
        if (!is_same(output->file, file)) continue;
        throw SetupError(output->option + " " + output->file + ": is read by this command" +
                         (file == output->file ? "" : " (" + file + ")") +
                         " and would be destroyed; give another name");
      }
    }
    std::error_code error;
    if (!may_overwrite && fs::is_regular_file(output->file, error)) {
      throw SetupError(why_exists(output->option, output->file));
    }
  }
}

OutputFile::OutputFile(std::string what, std::string path, Kind kind, bool may_overwrite)
    : what_(std::move(what)), path_(std::move(path)), may_overwrite_(may_overwrite) {
  if (path_ == kStandardOutput) {
    take_standard_output();
    return;
  }

  struct stat status {};
  const bool exists = stat(path_.c_str(), &status) == 0;
  const bool is_regular = !exists || S_ISREG(status.st_mode);
  if (exists && S_ISDIR(status.st_mode)) refuse("is a folder; give a file in it");
  if (exists && S_ISBLK(status.st_mode)) refuse("is a disk; give a file");
  if (exists && is_regular) {
    if (!may_overwrite_) throw SetupError(why_exists(what_, path_));
    if ((status.st_mode & kWritable) == 0 || access(path_.c_str(), W_OK) != 0) {
      refuse("is read-only; give another name, or make it writable");
    }
  }
  if (kind == Kind::kWhole && is_regular) {
    prepare_whole(exists);
  } else {
    open_stream(is_regular, exists && S_ISFIFO(status.st_mode));
  }
}

OutputFile::~OutputFile() {
  if (!partial_.empty()) unlink(partial_.c_str());
  release();
}

void OutputFile::refuse(const std::string& why) const {
  throw SetupError(what_ + " " + path_ + ": " + why);
}

void OutputFile::take_standard_output() {
  std::fflush(stdout);
  std::cout.flush();
  file_ = fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, STDERR_FILENO + 1);
  if (file_ < 0) refuse(in_words(errno));
  dup2(STDERR_FILENO, STDOUT_FILENO);
  is_standard_output_ = true;
}

void OutputFile::give_standard_output_back() {
  std::fflush(stdout);
  std::cout.flush();
  dup2(file_, STDOUT_FILENO);
}

void OutputFile::open_stream(bool is_regular, bool is_pipe) {
  int flags = O_WRONLY | O_CLOEXEC | O_NOCTTY;
  if (is_regular) flags |= O_CREAT | (may_overwrite_ ? O_TRUNC : O_EXCL);
  if (is_pipe) flags |= O_NONBLOCK;  // without a reader, open() then fails instead of waiting
  file_ = open(path_.c_str(), flags, kModeOfFiles);
  if (file_ < 0 && errno == ENXIO && is_pipe) {
    std::fprintf(stderr, "%s %s: waiting for a reader of this pipe\n", what_.c_str(),
                 path_.c_str());
    while (file_ < 0 && errno == ENXIO) {
      poll(nullptr, 0, kReaderPoll_ms);
      file_ = open(path_.c_str(), flags);
    }
  }
  if (file_ < 0) {
    if (errno == EEXIST) throw SetupError(why_exists(what_, path_));
    refuse(in_words(errno) + ": give a path in a folder that exists and is writable");
  }
  if (is_pipe) fcntl(file_, F_SETFL, fcntl(file_, F_GETFL) & ~O_NONBLOCK);
}

void OutputFile::prepare_whole(bool exists) {
  std::error_code error;
  target_ = path_;
  if (exists) {
    target_ = fs::canonical(path_, error).string();
  } else if (fs::is_symlink(path_, error)) {
    refuse("is a link to a file that does not exist; give the file itself");
  }
  const fs::path parent = fs::path(target_).parent_path();
  const std::string folder = parent.empty() ? "." : parent.string();
  if (!fs::path(target_).has_filename()) refuse("is a folder; give a file in it");
  if (!fs::is_directory(folder, error) || access(folder.c_str(), W_OK | X_OK) != 0) {
    refuse(in_words(fs::is_directory(folder, error) ? errno : ENOENT) +
           ": give a path in a folder that exists and is writable");
  }
}

/// Without a name, so that nothing is left if the process is killed; where the file system has no
/// such files, under a temporary name.
bool OutputFile::create_whole() {
  const std::string folder = fs::path(target_).parent_path().string();
  file_ =
      open(folder.empty() ? "." : folder.c_str(), O_WRONLY | O_TMPFILE | O_CLOEXEC, kModeOfFiles);
  if (file_ >= 0) return true;
  std::string partial = temporary_name();
  file_ = open(partial.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, kModeOfFiles);
  if (file_ < 0) {
    fail(errno);
    return false;
  }
  partial_ = std::move(partial);
  return true;
}

std::string OutputFile::temporary_name() const {
  std::random_device random;
  return target_ + "." + std::to_string(random()) + ".partial";
}

bool OutputFile::write(std::string_view bytes) {
  if (!is_open_) return !has_reader_;
  if (file_ < 0 && !create_whole()) return false;
  while (!bytes.empty()) {
    const ssize_t written = ::write(file_, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0 && errno == EPIPE && is_standard_output_) {
      has_reader_ = false;
      release();
      return true;
    }
    if (written < 0) {
      fail(errno);
      return false;
    }
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

bool OutputFile::close() {
  if (!is_open_) return complaint_.empty();
  if (!target_.empty() && file_ < 0 && !create_whole()) return false;  // an empty file
  if (!target_.empty() && !give_name()) {
    fail(errno);
    return false;
  }
  if (is_standard_output_) give_standard_output_back();
  is_open_ = false;
  if (::close(std::exchange(file_, -1)) != 0) fail(errno);
  return complaint_.empty();
}

/// Replaces a file that appeared meanwhile only if it may. Sets errno.
bool OutputFile::give_name() {
  if (partial_.empty()) {
    std::string partial = temporary_name();
    const std::string nameless = "/proc/self/fd/" + std::to_string(file_);
    if (linkat(AT_FDCWD, nameless.c_str(), AT_FDCWD, partial.c_str(), AT_SYMLINK_FOLLOW) != 0) {
      return false;
    }
    partial_ = std::move(partial);
  }
  int renamed = renameat2(AT_FDCWD, partial_.c_str(), AT_FDCWD, target_.c_str(),
                          may_overwrite_ ? 0 : RENAME_NOREPLACE);
  if (renamed != 0 && errno == EINVAL && access(target_.c_str(), F_OK) != 0) {
    renamed = rename(partial_.c_str(), target_.c_str());  // a file system without RENAME_NOREPLACE
  }
  if (renamed != 0) return false;
  partial_.clear();
  return true;
}

void OutputFile::fail(int error) {
  if (complaint_.empty()) complaint_ = what_ + " " + path_ + ": " + in_words(error);
  release();
  if (!partial_.empty()) unlink(std::exchange(partial_, {}).c_str());
}

void OutputFile::release() {
  if (file_ >= 0 && is_standard_output_ && is_open_) give_standard_output_back();
  if (file_ >= 0) ::close(std::exchange(file_, -1));
  is_open_ = false;
}

void write_file(const std::string& what, const std::string& path, std::string_view text,
                bool may_overwrite) {
  OutputFile file(what, path, OutputFile::Kind::kWhole, may_overwrite);
  if (!file.write(text) || !file.close()) throw std::runtime_error(file.complaint());
}

int status_with_output(int status, const std::string& program) {
  errno = 0;
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0 && std::cout.flush()) return status;
  // the reader has what it wanted: palpate info run.mcap | head
  pollfd reader{.fd = STDOUT_FILENO, .events = POLLOUT, .revents = 0};
  const bool has_left = poll(&reader, 1, 0) == 1 && (reader.revents & POLLERR) != 0;
  if (errno == EPIPE || has_left) return status;
  const std::string why = errno != 0 ? in_words(errno) : "a write failed";
  std::fprintf(stderr, "%s: standard output: %s: its text is incomplete\n", program.c_str(),
               why.c_str());
  return status == 0 ? kFailure : status;
}

}  // namespace palpate
