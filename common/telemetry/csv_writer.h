// csv_writer.h — the run as a table: one row per device tick, as the command line's --csv promises.
// Shared by the lockstep harness and the viewer.
#pragma once

#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>

#include "common/telemetry/tick_row.h"

namespace palpate {

/// "run.csv"; of a side "run.left.csv".
[[nodiscard]] std::string csv_file_of(const std::string& file, const std::string& side);

/// Columns, in this order; SI units, forces on the hand, nan where a figure is not known:
///
///   t_s                  t_k, device's clock
///   x_m y_m z_m          tool, true position, W           xm_m ym_m zm_m  as measured, W
///   fe_x fe_y fe_z       force asked, before fade and clamp
///   fs_x fs_y fs_z       force acting from this tick's switch to the next
///   fi_x fi_y fi_z       ideal force
///   f_max_x …            bound of the clamp; nan where there is none
///   energy_j             the controller's ledger          true_energy_j   of a simulated device
///   force_age_s          of the force asked; nan while physics has said nothing
///   in_contact clamped fallback peak_limited    1 or 0
///
/// `clamped`: by mofc only. `fallback`: the device let less act than was asked for want of an
/// answer or for a fault (fallback, fading, limp or fault), after it had been answered before in
/// this device session.
///
/// Numbers are the shortest text that reads back to the same double, whatever the locale.
class CsvWriter {
 public:
  /// Creates or overwrites `path` and writes the header row. Throws SetupError if it cannot.
  explicit CsvWriter(const std::string& path);
  /// Writes what is still buffered; call close() first to learn whether that worked.
  ~CsvWriter();
  CsvWriter(const CsvWriter&) = delete;
  CsvWriter& operator=(const CsvWriter&) = delete;

  /// Buffered. After an error nothing more is written.
  void write(const TickRow& row);
  /// Hands the buffer to the operating system, so that a reader sees every row so far.
  void flush();
  /// Flushes and closes; nothing is written after it.
  void close();

  /// What went wrong with the file, once; nullopt if nothing did or it was told already.
  [[nodiscard]] std::optional<std::string> take_error();

 private:
  void fail();

  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  std::string path_;
  std::unique_ptr<std::FILE, Close> file_;  // null after an error or close()
  std::string buffer_;
  std::optional<std::string> error_;
  std::uint64_t device_session_id_ = 0;
  bool was_answered_ = false;  // in that session
};

}  // namespace palpate
