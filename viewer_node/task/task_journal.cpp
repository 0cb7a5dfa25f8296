// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/task/task_journal.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <span>
#include <type_traits>

namespace palpate::viewer {
namespace {

constexpr std::size_t kRowsPerBlock = 4096;
constexpr Duration kWriteInterval = std::chrono::milliseconds(200);

/// Read by the same program on the same machine alone.
struct Entry {
  std::uint64_t session_id;
  std::uint64_t sequence;
  std::int64_t sampled_ns;
  double tip_m[3];
  double force_newton[3];
  double orientation_wxyz[4];
  std::uint32_t buttons;
  std::uint8_t has_mofc;
  std::uint8_t grip;
  std::uint16_t rest;
};
static_assert(std::is_trivially_copyable_v<Entry>);

Entry entry_of(const TickRow& row) {
  const DeviceTick& tick = row.device;
  const Vector3& tip_m = tick.measured_tool_position_world_m;
  const Vector3& newton = tick.force_on_hand_newton;
  const Quaternion& q = tick.measured_tool_orientation_world;
  return {.session_id = row.device_session_id,
          .sequence = tick.sequence,
          .sampled_ns = tick.sampled_at.time_since_epoch().count(),
          .tip_m = {tip_m.x(), tip_m.y(), tip_m.z()},
          .force_newton = {newton.x(), newton.y(), newton.z()},
          .orientation_wxyz = {q.w(), q.x(), q.y(), q.z()},
          .buttons = tick.buttons,
          .has_mofc = row.mofc ? std::uint8_t{1} : std::uint8_t{0},
          .grip = row.mofc ? static_cast<std::uint8_t>(row.mofc->grip) : std::uint8_t{0},
          .rest = 0};
}

TickRow row_of(const Entry& entry) {
  TickRow row;
  row.device_session_id = entry.session_id;
  row.device.sequence = entry.sequence;
  row.device.sampled_at = TimePoint(Duration(entry.sampled_ns));
  row.device.measured_tool_position_world_m = {entry.tip_m[0], entry.tip_m[1], entry.tip_m[2]};
  row.device.force_on_hand_newton = {entry.force_newton[0], entry.force_newton[1],
                                     entry.force_newton[2]};
  row.device.measured_tool_orientation_world =
      Quaternion(entry.orientation_wxyz[0], entry.orientation_wxyz[1], entry.orientation_wxyz[2],
                 entry.orientation_wxyz[3]);
  row.device.buttons = entry.buttons;
  if (entry.has_mofc != 0) row.mofc.emplace().grip = static_cast<GripState>(entry.grip);
  return row;
}

/// @return how many rows from `first` on were read: fewer than wanted after an error
std::size_t read_rows(int descriptor, std::size_t first, std::span<Entry> rows) {
  const std::span<std::byte> bytes = std::as_writable_bytes(rows);
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t got = pread(descriptor, bytes.data() + done, bytes.size() - done,
                              static_cast<off_t>(first * sizeof(Entry) + done));
    if (got <= 0) break;
    done += static_cast<std::size_t>(got);
  }
  return done / sizeof(Entry);
}

}  // namespace

TaskJournal::TaskJournal(const std::filesystem::path& file) : file_(file) {
  descriptor_ = open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (descriptor_ >= 0 && flock(descriptor_, LOCK_EX | LOCK_NB) != 0) close();
}

TaskJournal::~TaskJournal() {
  if (descriptor_ < 0) return;
  unlink(file_.c_str());
  close();
}

void TaskJournal::close() {
  if (descriptor_ >= 0) ::close(descriptor_);
  descriptor_ = -1;
}

bool TaskJournal::continues(const TickRow& next) {
  struct stat status {};
  if (descriptor_ < 0 || fstat(descriptor_, &status) != 0) return false;
  // a process may have been killed within a row
  kept_rows_ = static_cast<std::size_t>(status.st_size) / sizeof(Entry);
  Entry last{};
  const bool is_before =
      kept_rows_ > 0 && read_rows(descriptor_, kept_rows_ - 1, {&last, 1}) == 1 &&
      last.session_id == next.device_session_id && last.sequence < next.device.sequence;
  if (!is_before) {
    clear();
    return false;
  }
  cut(kept_rows_ * sizeof(Entry));
  return true;
}

void TaskJournal::replay(const std::function<void(const TickRow&)>& take) const {
  std::vector<Entry> block(kRowsPerBlock);
  for (std::size_t first = 0; first < kept_rows_; first += block.size()) {
    block.resize(std::min(kRowsPerBlock, kept_rows_ - first));
    const std::size_t count = read_rows(descriptor_, first, block);
    for (std::size_t i = 0; i < count; ++i) take(row_of(block[i]));
    if (count < block.size()) return;
  }
}

void TaskJournal::append(const TickRow& row) {
  if (descriptor_ < 0 || size_bytes_ + sizeof(Entry) > kMostBytes) return;
  const Entry entry = entry_of(row);
  const auto* const bytes = reinterpret_cast<const std::byte*>(&entry);
  buffer_.insert(buffer_.end(), bytes, bytes + sizeof(Entry));
  size_bytes_ += sizeof(Entry);
  const Duration waited = row.device.sampled_at - written_at_;
  if (waited >= kWriteInterval || waited < Duration(0)) {
    written_at_ = row.device.sampled_at;
    write();
  }
}

void TaskJournal::clear() {
  buffer_.clear();
  kept_rows_ = 0;
  cut(0);
}

/// What follows is written there.
void TaskJournal::cut(std::size_t size_bytes) {
  size_bytes_ = size_bytes;
  const auto size = static_cast<off_t>(size_bytes);
  if (descriptor_ >= 0 &&
      (ftruncate(descriptor_, size) != 0 || lseek(descriptor_, size, SEEK_SET) < 0)) {
    close();
  }
}

void TaskJournal::write() {
  std::size_t done = 0;
  while (descriptor_ >= 0 && done < buffer_.size()) {
    const ssize_t written = ::write(descriptor_, buffer_.data() + done, buffer_.size() - done);
    if (written > 0) {
      done += static_cast<std::size_t>(written);
    } else {
      close();
    }
  }
  buffer_.clear();
}

}  // namespace palpate::viewer
