// SPDX-License-Identifier: Apache-2.0
// csv_writer.h — a run as a table, one row per device tick: the file of --csv.
// Used by lockstep runs and by the viewer.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "common/core/user/output_file.h"
#include "common/telemetry/tick_row.h"

namespace palpate {

/// "run.csv"; for a side "run.left.csv". Throws SetupError for a side and standard output.
[[nodiscard]] std::string csv_file_of(const std::string& file, const std::string& side);

/// A text as readers of a table get it: what is not UTF-8 replaced, and with an apostrophe before
/// it where a spreadsheet would take it for a formula: it begins with = + - @ and is no number.
[[nodiscard]] std::string csv_text(const std::string& text);

/// csv_text() as a cell of CSV: quoted where it has a comma, a quote or a line break.
[[nodiscard]] std::string csv_cell(const std::string& text);

/// Columns, in this order; SI units, forces on the hand, nan where a value is unknown:
///
///   t_s                  t_k, clock of the device
///   x_m y_m z_m          tool, true position, W           xm_m ym_m zm_m  as measured, W
///   fe_x fe_y fe_z       requested force, before fade and clamp
///   fs_x fs_y fs_z       force applied from this tick's switch to the next
///   fi_x fi_y fi_z       ideal force
///   f_max_x …            bound of the clamp; nan without one
///   energy_j             the controller's ledger          true_energy_j   of a simulated device
///   force_age_s          of the requested force; nan before physics reports
///   in_contact clamped fallback peak_limited    1 or 0
///   a_1 a_2 a_3 te_1 …   only with a wrist, per joint: true angle, then requested torque,
///   ts_1 … ti_1 …        applied torque and ideal torque, as fe, fs and fi
///
/// `clamped`: by mofc_node only. `fallback`: the device applied less than the commanded force
/// because an answer was missing or a fault was latched (fallback, fading, limp or fault), after at
/// least one answer in this device session.
///
/// Numbers are the shortest text that parses to the same double; independent of the locale.
class CsvWriter {
 public:
  /// Begins with the header row, once the first row shows whether there is a wrist. Throws
  /// SetupError like OutputFile.
  explicit CsvWriter(const std::string& path, bool may_overwrite = false,
                     OutputFile::Kind kind = OutputFile::Kind::kStream);
  /// Writes the rest of the buffer to a kStream; call close() first to detect errors.
  ~CsvWriter();
  CsvWriter(const CsvWriter&) = delete;
  CsvWriter& operator=(const CsvWriter&) = delete;

  /// Buffered. After an error nothing more is written.
  void write(const TickRow& row);
  /// Hands the buffer to the operating system, so that a reader sees every row so far.
  void flush();
  /// Flushes and closes; nothing is written after it.
  void close();

  /// See OutputFile::has_reader().
  [[nodiscard]] bool has_reader() const { return file_.has_reader(); }
  /// The file's error, reported once; nullopt without one.
  [[nodiscard]] std::optional<std::string> take_error();

 private:
  void begin(bool has_wrist);

  OutputFile file_;
  bool has_begun_ = false;
  bool has_wrist_ = false;
  std::string buffer_;
  bool has_given_error_ = false;
  std::uint64_t device_session_id_ = 0;
  bool was_answered_ = false;  // in that session
};

}  // namespace palpate
