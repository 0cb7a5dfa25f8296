// SPDX-License-Identifier: Apache-2.0
// post_mortem.h — what led to a fault: the last seconds of a journal, in the flight recorder's file
// and out of it again, and computed once more. Not for the tick.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <istream>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "device_node/journal.h"

namespace palpate::device {

/// The journal's last seconds: from a state that is at least kWindow old on, or from a later one
/// where there is more than fits.
class PostMortem {
 public:
  static constexpr Duration kWindow = std::chrono::seconds(2);
  /// Of the longest window, for the flight recorder.
  [[nodiscard]] static std::size_t ticks_of_window(double rate_hz) {
    return static_cast<std::size_t>(rate_hz * to_seconds(kWindow + Journal::kStateEvery)) + 1;
  }

  /// Empties the journal's rings. Call it more often than every 0.5 s.
  void take(Journal& journal);

  /// Lines that begin with '#', so that the file stays a table with comments.
  /// @param device  its name and what else a reader should know: one line
  void write(std::ostream& file, const std::string& device) const;

 private:
  void write_window(std::ostream& out) const;

  // of 2.5 s at 10 kHz, some calls a tick more than usual; a wire is never so fast
  static constexpr std::size_t kMostEntries = 262'144;
  static constexpr std::size_t kMostTransfers = 32'768;

  std::deque<JournalEntry> entries_;
  std::deque<JournalState> states_;
  std::deque<WireTransfer> transfers_;
};

/// What such a file says.
struct FaultFile {
  struct Transfer {
    TimePoint at{};
    bool is_sent = false;
    std::uint32_t size = 0;
    std::string bytes;  ///< hexadecimal; of long messages the beginning
  };

  std::string written_by;  ///< version
  std::string device;
  std::vector<std::string> columns;
  std::vector<std::vector<std::string>> ticks;  ///< of so many words each
  std::optional<JournalState> state;            ///< none: no window
  std::vector<JournalEntry> entries;            ///< after it
  std::vector<Transfer> transfers;
  bool is_whole = false;  ///< false: it ends before what was written last
};
/// Whether a file is meant as a flight recording: by its name, or by its first line as one of
/// device_node.
[[nodiscard]] bool is_fault_file(const std::string& file);
/// @throws SetupError  says which line of `file` breaks which rule
[[nodiscard]] FaultFile read_fault_file(const std::string& file);

/// Monitor, frozen watch and jump detection, from the state on.
struct Recomputed {
  std::size_t entries = 0;
  std::size_t different = 0;  ///< decided otherwise, or M differs in any bit
  bool is_whole = false;
  bool has_gap = false;                    ///< entries were lost: what follows is not compared
  std::size_t reductions = 0;              ///< of the monitor
  std::size_t ledgers = 0;                 ///< that came with answers of a clamp
  std::size_t ledger_excesses = 0;         ///< of them, above what the hand can have put in
  FaultReason fault = FaultReason::kNone;  ///< the last one in the file, compared or not
  /// It follows from the readings; false: the device, its wire or the machine reported it.
  bool is_computed = false;
  bool is_reproduced = false;
  /// All was compared, and nothing differs.
  [[nodiscard]] bool is_same() const {
    return is_whole && entries > 0 && !has_gap && different == 0 && is_reproduced == is_computed;
  }
};
[[nodiscard]] Recomputed recompute_fault(const FaultFile& file);

/// For people: the fault, the last ticks, the last transfers, and whether it is reproduced.
[[nodiscard]] std::string fault_text(const FaultFile& file, const Recomputed& recomputed);

}  // namespace palpate::device
