// SPDX-License-Identifier: Apache-2.0
#include "deploy/campaign/result_log.h"

#include <fcntl.h>
#include <spdlog/fmt/fmt.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <fstream>
#include <stdexcept>
#include <system_error>

#include "common/core/check.h"
#include "common/core/random.h"
#include "common/core/time.h"

namespace palpate::campaign {
namespace {

constexpr Duration kFlushInterval = std::chrono::seconds(1);
constexpr std::size_t kMostLineBytes = 1U << 16U;
constexpr std::size_t kSumDigits = 16;

[[noreturn]] void fail(const std::filesystem::path& file) {
  throw std::runtime_error(file.string() + ": " + std::generic_category().message(errno));
}

/// Of a line and the campaign that it belongs to.
std::string check_sum(std::uint64_t fingerprint, std::string_view line) {
  return fmt::format("{:016x}", fnv1a(fmt::format("{:x} {}", fingerprint, line)));
}

/// As the logs have it: the same whatever the number of runs of a cell.
std::uint64_t number_in_log(const Campaign& campaign, std::uint64_t run) {
  return run % campaign.runs_per_cell * campaign.cells() + run / campaign.runs_per_cell;
}

}  // namespace

// --- writing ------------------------------------------------------------------------------------

ResultLog::ResultLog(std::filesystem::path file, const Campaign& campaign)
    : file_(std::move(file)),
      campaign_(campaign),
      descriptor_(
          ::open(file_.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC | O_NOFOLLOW, 0644)),
      flushed_at_(clock_.now()) {
  if (descriptor_ < 0) fail(file_);
  if (::flock(descriptor_, LOCK_EX | LOCK_NB) != 0) {
    ::close(descriptor_);
    throw std::runtime_error(file_.string() + ": another process writes it");
  }
  // a line that was cut stays alone
  char last = '\n';
  const off_t size = ::lseek(descriptor_, 0, SEEK_END);
  if (size > 0 && ::pread(descriptor_, &last, 1, size - 1) == 1 && last != '\n' &&
      ::write(descriptor_, "\n", 1) != 1) {
    ::close(descriptor_);
    fail(file_);
  }
}

ResultLog::~ResultLog() {
  flush();
  ::close(descriptor_);
}

void ResultLog::add(std::uint64_t run, std::span<const double> figures) {
  std::string line = std::to_string(number_in_log(campaign_, run));
  for (const double figure : figures) line += fmt::format(" {}", figure);
  line += fmt::format(" {}\n", check_sum(campaign_.fingerprint, line));
  if (::write(descriptor_, line.data(), line.size()) != static_cast<ssize_t>(line.size())) {
    fail(file_);
  }
  if (clock_.now() - flushed_at_ >= kFlushInterval) flush();
}

void ResultLog::flush() {
  ::fdatasync(descriptor_);
  flushed_at_ = clock_.now();
}

// --- reading ------------------------------------------------------------------------------------

Results::Results(const Campaign& campaign)
    : campaign_(campaign),
      width_(campaign.quantities.size()),
      figures_(campaign.run_count() * width_, kNaN),
      is_known_(campaign.run_count()),
      needed_(campaign.run_count()) {}

void Results::refresh(const std::filesystem::path& folder) {
  std::string line(kMostLineBytes, '\0');
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() != ".log" || entry.is_symlink() || !entry.is_regular_file()) {
      continue;
    }
    std::uint64_t& begin = read_[entry.path()];
    std::ifstream in(entry.path(), std::ios::binary);
    if (!in.seekg(static_cast<std::streamoff>(begin))) continue;
    while (in.getline(line.data(), static_cast<std::streamsize>(line.size())) && !in.eof()) {
      begin += static_cast<std::uint64_t>(in.gcount());
      take(std::string_view(line.data(), static_cast<std::size_t>(in.gcount()) - 1));
    }
    // the end of the file is in a line that is not complete yet; any other failure is of its length
    if (in.fail() && !in.eof()) {
      throw SetupError(entry.path().string() +
                       ": has a line that is too long for a result; remove "
                       "the file, or give another folder with --folder");
    }
  }
}

void Results::take(std::string_view line) {
  const std::size_t end = line.rfind(' ');
  const auto refuse = [this] { ++damaged_; };
  if (end == std::string_view::npos || line.size() - end - 1 != kSumDigits ||
      line.substr(end + 1) != check_sum(campaign_.fingerprint, line.substr(0, end))) {
    return refuse();
  }
  const char* at = line.data();
  const char* const last = line.data() + end;
  std::uint64_t number = 0;
  auto result = std::from_chars(at, last, number);
  if (result.ec != std::errc()) return refuse();
  std::vector<double> figures(width_);
  for (double& figure : figures) {
    at = result.ptr + 1;
    if (at >= last) return refuse();
    result = std::from_chars(at, last, figure);
    if (result.ec != std::errc()) return refuse();
  }
  if (result.ptr != last) return refuse();
  const std::uint64_t cells = campaign_.cells();
  const std::uint64_t of_cell = number / cells;
  if (of_cell >= campaign_.runs_per_cell) return;  // of a call for more runs
  const std::uint64_t run = number % cells * campaign_.runs_per_cell + of_cell;
  if (is_known_[run]) {
    ++repeated_;
    return;
  }
  is_known_[run] = true;
  std::copy(figures.begin(), figures.end(),
            figures_.begin() + static_cast<std::ptrdiff_t>(run * width_));
  if (campaign_.stops_at_violation && campaign_.is_violated(figures)) {
    needed_ = std::min(needed_, run + 1);
  }
}

std::uint64_t Results::known() const {
  return static_cast<std::uint64_t>(std::count(
      is_known_.begin(), is_known_.begin() + static_cast<std::ptrdiff_t>(needed_), true));
}

std::vector<std::uint64_t> Results::missing(std::uint64_t share, std::uint64_t shares) const {
  std::vector<std::uint64_t> missing;
  for (std::uint64_t run = share; run < needed_; run += shares) {
    if (!is_known_[run]) missing.push_back(run);
  }
  return missing;
}

}  // namespace palpate::campaign
