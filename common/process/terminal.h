// SPDX-License-Identifier: Apache-2.0
// terminal.h — what is shown to a person at a terminal, and only there: progress, colour, width.
#pragma once

#include <termios.h>
#include <unistd.h>

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <thread>

#include "common/core/clock.h"
#include "common/core/user/utf8.h"

namespace palpate {

/// A terminal that can rewrite a line and has colours: one with TERM=dumb counts as a file.
[[nodiscard]] bool is_terminal(int descriptor);

/// Columns of the terminal at this descriptor; 0: not a terminal.
[[nodiscard]] std::size_t terminal_columns(int descriptor);

/// What begins a line at this descriptor: on a terminal it removes a status line or progress that
/// is there, which is written again below.
[[nodiscard]] std::string line_start(int descriptor);

enum class Colour { kGood, kFair, kBad };
/// The text in green, yellow or red if the descriptor is a terminal and $NO_COLOR is not set.
[[nodiscard]] std::string coloured(const std::string& text, Colour colour,
                                   int descriptor = STDOUT_FILENO);

/// The text without the characters that do not fit, the last one kept is "…".
[[nodiscard]] std::string fitted(const std::string& text, std::size_t columns);

/// The lines of a text broken between words so that none is longer than `columns`, where words
/// allow it; continued below the beginning of a line's text, or of its second column of text. 0
/// columns: as it is.
[[nodiscard]] std::string wrapped(const std::string& text, std::size_t columns);

/// The progress of long work in one line, rewritten in place: "loopback: 34 %, 12 s left". Nothing
/// is written before 2 s, without a terminal or if it is quiet; the destructor removes the line.
class Progress {
 public:
  static constexpr Duration kPatience = std::chrono::seconds(2);
  static constexpr Duration kInterval = std::chrono::milliseconds(250);

  explicit Progress(std::string what, bool is_quiet = false, int descriptor = STDERR_FILENO,
                    const Clock& clock = steady_clock());
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// @param ratio  done so far, 0 … 1; any other value: not known, only the time is shown
  void show(double ratio);

 private:
  [[nodiscard]] static const Clock& steady_clock();

  std::string what_;
  int descriptor_;
  bool is_shown_;
  bool has_line_ = false;
  const Clock& clock_;
  TimePoint begin_;
  TimePoint next_;
};

/// Progress of work that cannot say how far it is: the time that has passed, "reading: 4 s", by a
/// thread of its own.
class BusyLine {
 public:
  explicit BusyLine(std::string what, bool is_quiet = false);

 private:
  std::jthread thread_;
};

/// Single keys of the terminal at standard input, without Enter and without echo, while an object
/// exists; one at a time. Without a terminal, or in the background, there are none. Ctrl-C keeps
/// its meaning.
class TerminalKeys {
 public:
  explicit TerminalKeys(int descriptor = STDIN_FILENO);
  /// Restores the terminal.
  ~TerminalKeys();
  TerminalKeys(const TerminalKeys&) = delete;
  TerminalKeys& operator=(const TerminalKeys&) = delete;

  [[nodiscard]] bool is_on() const { return before_.has_value(); }
  /// The next key that was pressed; 0: none. Does not block.
  [[nodiscard]] char take();

 private:
  int descriptor_;
  std::optional<termios> before_;  // settings of the terminal; empty: not used
};

/// Ctrl-C, SIGTERM and SIGHUP as a request while an object exists: the first one is noted, a second
/// one has its default effect and kills. One object at a time.
class StopSignal {
 public:
  StopSignal();
  ~StopSignal();
  StopSignal(const StopSignal&) = delete;
  StopSignal& operator=(const StopSignal&) = delete;

  [[nodiscard]] static bool is_requested();
};

}  // namespace palpate
