// SPDX-License-Identifier: Apache-2.0
// flight_recorder.h — keeps the last ticks of a node and writes them to a file after a fault or
// on SIGUSR1. Runs on the telemetry thread; the tick thread pushes its records to a RingSink and is
// not affected.
#pragma once

#include <spdlog/spdlog.h>

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <ostream>
#include <string>
#include <vector>

#include "common/telemetry/telemetry.h"

namespace palpate {

/// 4 s at 1 kHz.
inline constexpr std::size_t kFlightRecorderTicks = 4096;

/// Faults latched so far; each one triggers a file.
[[nodiscard]] inline std::uint64_t faults(const DeviceCounters& c) { return c.device_faults; }
[[nodiscard]] inline std::uint64_t faults(const MofcCounters&) { return 0; }
[[nodiscard]] inline std::uint64_t faults(const PhysicsCounters&) { return 0; }

/// What is worth a file without being a fault: commands that the monitor reduced, that were not
/// finite, or whose clamp counts on too much.
[[nodiscard]] inline std::uint64_t incidents(const DeviceCounters& c) {
  return c.monitor_reductions + c.non_finite_commands + c.ledger_excesses;
}
[[nodiscard]] inline std::uint64_t incidents(const MofcCounters&) { return 0; }
[[nodiscard]] inline std::uint64_t incidents(const PhysicsCounters&) { return 0; }

/// CSV: columns are the fields of the record, vectors as _x, _y, _z, times as _ns on the clock of
/// the node that the field names, "nan" where the value is unknown.
void write_flight_header(std::ostream& out, const DeviceTick&);
void write_flight_header(std::ostream& out, const MofcTick&);
void write_flight_header(std::ostream& out, const PhysicsTick&);
void write_flight_row(std::ostream& out, const DeviceTick& tick);
void write_flight_row(std::ostream& out, const MofcTick& tick);
void write_flight_row(std::ostream& out, const PhysicsTick& tick);

/// Requests by signal since the start; counted, so that none is lost.
struct SignalRequests {
  std::atomic<std::uint32_t> recordings{0};    ///< SIGUSR1: write the flight recorder's file
  std::atomic<std::uint32_t> fault_resets{0};  ///< SIGUSR2: reset a latched fault
};
inline const SignalRequests kNoRequests;

/// Where a flight recorder writes, and when.
struct FlightFiles {
  std::filesystem::path folder;  ///< created if absent; normally the parent of the run folder
  std::string node;              ///< "device"
  std::string session;           ///< name of the session
  const SignalRequests& requests;
  spdlog::logger& log;
};
/// A new file `flight-NODE-SESSION-YYYYMMDDTHHMMSS.mmmZ.csv` (UTC), readable by this user only;
/// "" and a log line if it cannot be created. Never replaces a file.
[[nodiscard]] std::string new_flight_file(const FlightFiles& files);
void report_flight_file(const FlightFiles& files, const std::string& file, const char* reason,
                        std::size_t ticks, bool is_written);

template <class Record>
class FlightRecorder {
 public:
  explicit FlightRecorder(FlightFiles files, std::size_t capacity = kFlightRecorderTicks)
      : files_(std::move(files)), capacity_(capacity) {
    ring_.reserve(capacity);
  }

  /// Adds lines to each file, after the records. Optional.
  std::function<void(std::ostream& out)> append;

  /// Replaces the oldest record when full.
  void keep(const Record& record) {
    ++kept_;
    if (ring_.size() < capacity_) {
      ring_.push_back(record);
    } else {
      ring_[oldest_] = record;
      oldest_ = (oldest_ + 1) % capacity_;
    }
  }

  /// Call after the records up to these counters are kept: writes the file if a fault was latched
  /// or SIGUSR1 arrived since the previous call. Incidents write at most one file for each
  /// `capacity` records, and kMostIncidentFiles in all.
  template <class Counters>
  void write_if_due(const Counters& counters) {
    const bool has_fault = faults(counters) != faults_;
    const bool is_asked = files_.requests.recordings != recordings_;
    const bool has_incident = incidents(counters) != incidents_ && kept_ >= next_incident_at_ &&
                              incident_files_ < kMostIncidentFiles;
    faults_ = faults(counters);
    incidents_ = incidents(counters);
    recordings_ = files_.requests.recordings;
    if (has_incident) {
      next_incident_at_ = kept_ + capacity_;
      ++incident_files_;
    }
    if (has_fault || has_incident || is_asked) {
      write(has_fault ? "fault" : has_incident ? "monitor" : "signal");
    }
  }

 private:
  static constexpr int kMostIncidentFiles = 16;

  void write(const char* reason) {
    const std::string file = new_flight_file(files_);
    if (file.empty()) return;
    std::ofstream out(file);
    write_flight_header(out, Record{});
    for (std::size_t i = 0; i < ring_.size(); ++i) {
      write_flight_row(out, ring_[(oldest_ + i) % ring_.size()]);
    }
    if (append) append(out);
    out.close();
    report_flight_file(files_, file, reason, ring_.size(), out.good());
  }

  FlightFiles files_;
  std::size_t capacity_;
  std::vector<Record> ring_;
  std::size_t oldest_ = 0;
  std::uint64_t kept_ = 0;
  std::uint64_t faults_ = 0;
  std::uint64_t incidents_ = 0;
  std::uint64_t next_incident_at_ = 0;  // of kept_
  int incident_files_ = 0;
  std::uint32_t recordings_ = 0;
};

}  // namespace palpate
