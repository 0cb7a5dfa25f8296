// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/server/recording_shelf.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>
#include <vector>

#include "common/core/user/utf8.h"

namespace palpate::viewer {
namespace {

// -20261128-010203.mcap
constexpr std::string_view kForm = "-dddddddd-dddddd.mcap";
constexpr std::size_t kMostListed = 200;

struct Entry {
  std::string name;
  std::uint64_t bytes = 0;
  std::int64_t modified_s = 0;
};

}  // namespace

OpenFile::OpenFile(OpenFile&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)), size_(other.size_), left_(other.left_) {}

OpenFile& OpenFile::operator=(OpenFile&& other) noexcept {
  std::swap(descriptor_, other.descriptor_);
  size_ = other.size_;
  left_ = other.left_;
  return *this;
}

OpenFile::~OpenFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

std::string_view OpenFile::read(char* buffer, std::size_t most) {
  const auto wanted = static_cast<std::size_t>(std::min<std::uint64_t>(most, left_));
  for (;;) {
    const ssize_t bytes = ::read(descriptor_, buffer, wanted);
    if (bytes < 0 && errno == EINTR) continue;
    const auto count = static_cast<std::size_t>(std::max<ssize_t>(bytes, 0));
    left_ -= count;
    return {buffer, count};
  }
}

bool RecordingShelf::is_name(std::string_view name) const {
  if (session_.empty() || !name.starts_with(session_)) return false;
  name.remove_prefix(session_.size());
  return std::equal(name.begin(), name.end(), kForm.begin(), kForm.end(), [](char c, char form) {
    return form == 'd' ? c >= '0' && c <= '9' : c == form;
  });
}

std::optional<OpenFile> RecordingShelf::open(std::string_view name) const {
  if (!may_be_read_ || !exists() || !is_name(name) || name == written_) return std::nullopt;
  const std::string file = folder_ + "/" + std::string(name);
  // a pipe would make the server wait, a link leads elsewhere
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
  if (descriptor < 0) return std::nullopt;
  struct stat status {};
  if (::fstat(descriptor, &status) != 0 || !S_ISREG(status.st_mode)) {
    ::close(descriptor);
    return std::nullopt;
  }
  return OpenFile(descriptor, static_cast<std::uint64_t>(status.st_size));
}

std::string RecordingShelf::list_json() const {
  std::vector<Entry> entries;
  std::error_code error;
  if (may_be_read_ && exists()) {
    for (std::filesystem::directory_iterator it(folder_, error), end; !error && it != end;
         it.increment(error)) {
      const std::string name = it->path().filename().string();
      struct stat status {};
      if (!is_name(name) || name == written_ || ::lstat(it->path().c_str(), &status) != 0 ||
          !S_ISREG(status.st_mode)) {
        continue;
      }
      entries.push_back({name, static_cast<std::uint64_t>(status.st_size), status.st_mtim.tv_sec});
    }
  }
  // the date is in the name
  std::sort(entries.begin(), entries.end(),
            [](const Entry& a, const Entry& b) { return a.name > b.name; });
  entries.resize(std::min(entries.size(), kMostListed));
  auto json = nlohmann::ordered_json::array();
  for (const Entry& one : entries) {
    json.push_back({{"name", one.name}, {"bytes", one.bytes}, {"modified_s", one.modified_s}});
  }
  return json_text(json) + "\n";
}

}  // namespace palpate::viewer
