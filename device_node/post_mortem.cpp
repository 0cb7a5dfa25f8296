// SPDX-License-Identifier: Apache-2.0
#include "device_node/post_mortem.h"

#include <algorithm>
#include <boost/crc.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>
#include <utility>

#include "common/core/check.h"
#include "common/core/version.h"
#include "device_node/monitor/state_text.h"

namespace palpate::device {
namespace {

constexpr const char* kFirstColumn = "sequence,sampled_at_ns,";
constexpr const char* kDevice = "#device ";
constexpr const char* kState = "#state ";
constexpr const char* kEntry = "#entry ";
constexpr const char* kWire = "#wire ";
constexpr const char* kVersion = "#version ";
constexpr const char* kEnd = "#end ";  // and the checksum of all lines with # before it
constexpr std::size_t kTicksShown = 12;
constexpr std::size_t kTransfersShown = 12;

using Checksum = boost::crc_32_type;

template <class Value>
std::string text_of(Value value) {
  StateWriter writer;
  value.list(writer);
  return writer.text();
}

JournalState any_state() {
  return {.monitor = ForceMonitor(DeviceConfig{}),
          .frozen = FrozenWatch(DeviceConfig{}),
          .judge = ReadingJudge(0.0, 0.0)};
}

/// What follows `prefix` in the line, if it begins so.
std::optional<std::string> after(const std::string& line, const std::string& prefix) {
  if (line.compare(0, prefix.size(), prefix) != 0) return std::nullopt;
  return line.substr(prefix.size());
}

std::vector<std::string> words_of(const std::string& line) {
  std::vector<std::string> words;
  std::istringstream in(line);
  for (std::string word; std::getline(in, word, ',');) words.push_back(word);
  return words;
}

bool is_hexadecimal(const std::string& text) {
  return text.size() % 2 == 0 && text.find_first_not_of("0123456789abcdef") == std::string::npos;
}

std::string milliseconds(Duration time) {
  char text[40];
  std::snprintf(text, sizeof(text), "%.3f", 1e3 * to_seconds(time));
  return text;
}

/// The instant to which the text relates all others: of the last fault, or of the last entry.
TimePoint end_of(const FaultFile& file) {
  TimePoint end{};
  for (const JournalEntry& entry : file.entries) {
    end = std::max(end, entry.at);
  }
  for (const JournalEntry& entry : file.entries) {
    if (entry.kind == JournalKind::kFault) end = entry.at;
  }
  return end;
}

/// One call again.
/// @return  whether it decided as the entry says
bool repeat(JournalState& state, const JournalEntry& entry, bool& is_good) {
  ForceMonitor& monitor = state.monitor;
  is_good = true;
  switch (entry.kind) {
    case JournalKind::kJudge:
      is_good = state.judge.read(entry.at, entry.position_m, entry.lease);
      break;
    case JournalKind::kFrozen:
      is_good = state.frozen.read(entry.at, entry.position_m, entry.force_newton);
      break;
    case JournalKind::kRead:
      monitor.read(entry.at, entry.position_m, entry.details);
      break;
    case JournalKind::kEnded:
      monitor.ended(entry.position_m);
      break;
    case JournalKind::kCover: {
      const ForceMonitor::Covered covered = monitor.cover(entry.force_newton, entry.lease);
      is_good = !covered.is_reduced;
      if (covered.force_on_hand_newton != entry.covered_newton ||
          covered.lease != entry.covered_lease) {
        return false;
      }
      break;
    }
    case JournalKind::kWithin:
      monitor.begins_within(entry.lease);
      break;
    case JournalKind::kSwitched:
      monitor.switched(entry.at, entry.position_m, entry.force_newton, entry.lease, entry.details);
      break;
    case JournalKind::kFailed:
      monitor.failed(entry.force_newton);
      break;
    case JournalKind::kReleased:
      monitor.released(entry.at);
      break;
    case JournalKind::kSlept:
      monitor.slept(entry.lease);
      break;
    case JournalKind::kLost:
      state.judge.begin();
      monitor.lost();
      break;
    case JournalKind::kBegin:
      state.frozen.begin();
      break;
    case JournalKind::kFault:
      break;
    case JournalKind::kLedger:
      is_good = monitor.is_ledger_plausible(entry.ledger_joule);
      break;
  }
  return is_good == entry.is_good && monitor.joule() == entry.monitor_joule;
}

}  // namespace

// --- kept while it runs ---------------------------------------------------------------------

void PostMortem::take(Journal& journal) {
  std::optional<JournalState> state;
  while (journal.take(state)) {
    if (state) states_.push_back(*state);
  }
  for (JournalEntry entry; journal.take(entry);) entries_.push_back(entry);
  for (WireTransfer transfer; journal.take(transfer);) transfers_.push_back(transfer);
  if (states_.empty()) return;

  const TimePoint since = states_.back().at - kWindow;
  while (states_.size() > 1 && states_[1].at <= since) states_.pop_front();
  while (!entries_.empty() &&
         (entries_.front().index < states_.front().index || entries_.size() > kMostEntries)) {
    entries_.pop_front();
  }
  // a state is worth nothing without the first entry after it
  while (states_.size() > 1 && !entries_.empty() &&
         states_.front().index < entries_.front().index) {
    states_.pop_front();
  }
  while (!entries_.empty() && entries_.front().index < states_.front().index) entries_.pop_front();
  while (!transfers_.empty() &&
         (transfers_.front().at < states_.front().at || transfers_.size() > kMostTransfers)) {
    transfers_.pop_front();
  }
}

void PostMortem::write(std::ostream& file, const std::string& device) const {
  std::ostringstream out;
  out << kVersion << version() << '\n' << kDevice << device << '\n';
  if (!states_.empty()) write_window(out);
  const std::string text = std::move(out).str();
  Checksum sum;
  sum.process_bytes(text.data(), text.size());
  file << text << kEnd << sum.checksum() << '\n';
}

void PostMortem::write_window(std::ostream& out) const {
  out << kState << text_of(states_.front()) << '\n';
  for (const JournalEntry& entry : entries_) out << kEntry << text_of(entry) << '\n';
  constexpr char kDigits[] = "0123456789abcdef";
  for (const WireTransfer& transfer : transfers_) {
    out << kWire << transfer.at.time_since_epoch().count() << (transfer.is_sent ? " > " : " < ")
        << transfer.size << ' ';
    const std::size_t kept = std::min<std::size_t>(transfer.size, transfer.bytes.size());
    for (std::size_t i = 0; i < kept; ++i) {
      const auto byte = std::to_integer<unsigned>(transfer.bytes[i]);
      out << kDigits[byte >> 4U] << kDigits[byte & 15U];
    }
    out << '\n';
  }
}

// --- and read again -------------------------------------------------------------------------

bool is_fault_file(const std::string& file) {
  if (std::filesystem::path(file).filename().string().starts_with("flight-")) return true;
  std::ifstream in(file);
  std::string line;
  return std::getline(in, line) && after(line, kFirstColumn).has_value();
}

FaultFile read_fault_file(const std::string& file) {
  std::ifstream in(file);
  if (!in) throw SetupError(file + ": cannot be read; give a file flight-device-….csv");
  FaultFile read;
  std::string line;
  int number = 0;
  Checksum sum;
  const auto refuse = [&](const std::string& rule) {
    throw SetupError(file + ":" + std::to_string(number) + ": " + rule +
                     "; the file is damaged, or of another version" +
                     (read.written_by.empty() ? "" : ": " + read.written_by) + ", this is " +
                     version());
  };
  while (std::getline(in, line)) {
    ++number;
    if (read.is_whole) refuse("nothing follows the end");
    const auto end = after(line, kEnd);
    if (!end && !line.empty() && line.front() == '#') {
      sum.process_bytes(line.data(), line.size());
      sum.process_byte('\n');
    }
    if (number == 1) {
      if (!after(line, kFirstColumn))
        refuse("not the columns of a flight recording of device_node (sequence,sampled_at_ns,…)");
      read.columns = words_of(line);
    } else if (line.empty() || line.front() != '#') {
      read.ticks.push_back(words_of(line));
      if (read.ticks.back().size() != read.columns.size()) {
        refuse(std::to_string(read.ticks.back().size()) + " values, not one for each of the " +
               std::to_string(read.columns.size()) + " columns");
      }
    } else if (end) {
      if (*end != std::to_string(sum.checksum())) {
        refuse("the lines with # are not those that were written: their checksum is another one");
      }
      read.is_whole = true;
    } else if (const auto written_by = after(line, kVersion)) {
      read.written_by = *written_by;
    } else if (const auto device = after(line, kDevice)) {
      read.device = *device;
    } else if (const auto state = after(line, kState)) {
      if (read.state) refuse("a second state; a file has one, at the start of its window");
      read.state = any_state();
      StateReader words(*state);
      read.state->list(words);
      if (!words.is_done()) refuse("the state is not complete");
    } else if (const auto entry = after(line, kEntry)) {
      JournalEntry& next = read.entries.emplace_back();
      StateReader words(*entry);
      next.list(words);
      if (!words.is_done() || static_cast<int>(next.kind) >= kJournalKinds ||
          next.fault > FaultReason::kMotorsDiffer) {
        refuse("the entry is not complete");
      }
    } else if (const auto wire = after(line, kWire)) {
      FaultFile::Transfer& next = read.transfers.emplace_back();
      std::istringstream words(*wire);
      std::int64_t at_ns = 0;
      std::string direction;
      words >> at_ns >> direction >> next.size;
      if (!words || (direction != ">" && direction != "<")) {
        refuse("a transfer has a time in ns, > or <, its size, and its bytes");
      }
      words >> next.bytes;
      if (!is_hexadecimal(next.bytes)) refuse("the bytes of a transfer are not hexadecimal");
      next.at = TimePoint(Duration(at_ns));
      next.is_sent = direction == ">";
    } else {
      refuse("begins with # and is none of version, device, state, entry, wire, end");
    }
  }
  if (number == 0) throw SetupError(file + ": empty; give a file flight-device-….csv");
  return read;
}

Recomputed recompute_fault(const FaultFile& file) {
  Recomputed out;
  out.is_whole = file.is_whole;
  JournalState state = file.state.value_or(any_state());
  std::uint64_t index = state.index;
  // the last of the calls that judge readings: as computed here, and as the file says
  bool was_good = true;
  bool was_noted_good = true;
  bool was_plausible = true;  // M, after the last reading
  for (const JournalEntry& entry : file.entries) {
    out.has_gap = out.has_gap || (file.state && entry.index != index++);
    bool is_good = true;
    if (file.state && !out.has_gap) {
      if (!repeat(state, entry, is_good)) ++out.different;
      ++out.entries;
      if (entry.kind == JournalKind::kCover && !is_good) ++out.reductions;
      if (entry.kind == JournalKind::kLedger) {
        ++out.ledgers;
        if (!is_good) ++out.ledger_excesses;
      }
      if (entry.kind == JournalKind::kRead) was_plausible = state.monitor.is_account_plausible();
    }
    if (entry.kind == JournalKind::kJudge || entry.kind == JournalKind::kFrozen) {
      was_good = is_good;
      was_noted_good = entry.is_good;
    }
    if (entry.kind == JournalKind::kFault) {
      out.fault = entry.fault;
      // the check of the motors has a rule of its own for positions that stand still
      out.is_computed = entry.fault == FaultReason::kPositionJumped ||
                        entry.fault == FaultReason::kAccountWrong ||
                        (entry.fault == FaultReason::kPositionFrozen && !was_noted_good);
      const bool was_right = entry.fault == FaultReason::kAccountWrong ? was_plausible : was_good;
      out.is_reproduced = out.is_computed && !was_right;
      was_good = was_noted_good = true;
    }
  }
  return out;
}

namespace {

/// What a reader learns of the window computed again.
std::string recomputed_text(const FaultFile& file, const Recomputed& recomputed) {
  if (!file.state) return "not possible: the file has no state at the start of a window\n";
  if (recomputed.entries == 0) {
    return "nothing: the first entry after the state at the start of the window is missing\n";
  }
  std::string text = std::to_string(recomputed.entries) + " entries: ";
  text += recomputed.different == 0 ? "monitor and checks decide the same, to the bit"
                                    : std::to_string(recomputed.different) + " differ";
  text += "; " + std::to_string(recomputed.reductions) + " commands reduced by the monitor, " +
          std::to_string(recomputed.ledger_excesses) + " of " + std::to_string(recomputed.ledgers) +
          " ledgers above what the hand can have put in";
  if (recomputed.has_gap) text += "; then entries were lost: what follows is not compared";
  text += '\n';
  if (recomputed.has_gap || recomputed.fault == FaultReason::kNone) return text;
  text += "            the fault ";
  if (recomputed.is_reproduced) return text + "follows from the readings: reproduced\n";
  if (recomputed.is_computed) {
    return text + "does not follow from the readings: not reproduced\n";
  }
  return text +
         "was reported by the device, its wire, a check or the machine: see the last transfers\n";
}

}  // namespace

std::string fault_text(const FaultFile& file, const Recomputed& recomputed) {
  std::ostringstream out;
  const TimePoint end = end_of(file);
  out << "device      " << file.device << '\n';
  if (file.written_by != version()) {
    out << "version     " << file.written_by << ", this is " << version()
        << ": they may decide otherwise\n";
  }
  out << "fault       "
      << (recomputed.fault == FaultReason::kNone ? "none in the window" : name(recomputed.fault))
      << '\n';
  out << "window      " << file.ticks.size() << " ticks, " << file.entries.size() << " entries and "
      << file.transfers.size() << " transfers";
  if (file.state) out << " since " << milliseconds(end - file.state->at) << " ms before it";
  out << '\n';

  out << "recomputed  " << recomputed_text(file, recomputed);
  if (!file.is_whole) {
    out << "            the file ends too early: what was written after its last line is missing\n";
  }

  // M at each of the last readings, which the ticks of the table do not have
  out << "\nlast readings, ms before the fault, monitor's energy µJ, force N, clamp's ledger µJ\n";
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  struct Read {
    const JournalEntry* entry;
    double ledger_joule;  // that came with the answer before a switch
  };
  std::vector<Read> reads;
  double ledger_joule = kNone;
  for (const JournalEntry& entry : file.entries) {
    if (entry.kind == JournalKind::kLedger) ledger_joule = entry.ledger_joule;
    if (entry.kind == JournalKind::kRead) reads.push_back({&entry, kNone});
    if (entry.kind == JournalKind::kSwitched) {
      reads.push_back({&entry, std::exchange(ledger_joule, kNone)});
    }
  }
  for (std::size_t i = reads.size() - std::min(reads.size(), kTicksShown); i < reads.size(); ++i) {
    const JournalEntry& entry = *reads[i].entry;
    char line[120];
    std::snprintf(line, sizeof(line), "%12s  %-8s %12.1f", milliseconds(end - entry.at).c_str(),
                  entry.kind == JournalKind::kRead ? "reading" : "switch",
                  1e6 * entry.monitor_joule);
    out << line;
    if (entry.kind == JournalKind::kSwitched) {
      std::snprintf(line, sizeof(line), "  %.3f", entry.force_newton.norm());
      out << line;
    }
    if (!std::isnan(reads[i].ledger_joule)) {
      std::snprintf(line, sizeof(line), " %12.1f", 1e6 * reads[i].ledger_joule);
      out << line;
    }
    out << '\n';
  }
  if (file.transfers.empty()) return out.str();
  out << "\nlast transfers, ms before the fault, > sent, < received, bytes\n";
  for (std::size_t i = file.transfers.size() - std::min(file.transfers.size(), kTransfersShown);
       i < file.transfers.size(); ++i) {
    const FaultFile::Transfer& transfer = file.transfers[i];
    char line[80];
    std::snprintf(line, sizeof(line), "%12s  %c %5u  ", milliseconds(end - transfer.at).c_str(),
                  transfer.is_sent ? '>' : '<', transfer.size);
    out << line << (transfer.size == 0 ? "no answer" : transfer.bytes.substr(0, 96))
        << (transfer.bytes.size() > 96 ? "…" : "") << '\n';
  }
  return out.str();
}

}  // namespace palpate::device
