// SPDX-License-Identifier: Apache-2.0
#include "common/process/terminal.h"

#include <spdlog/fmt/fmt.h>
#include <sys/ioctl.h>

#include <algorithm>
#include <array>
#include <condition_variable>
#include <csignal>
#include <cstdlib>
#include <mutex>
#include <utility>

namespace palpate {
namespace {

constexpr std::size_t kUsualColumns = 80;
constexpr double kUnknown = -1.0;  // share of the work
constexpr std::array kStopSignals{SIGINT, SIGTERM, SIGHUP};

volatile std::sig_atomic_t is_stop_requested = 0;

std::string time_text(double seconds) {
  if (seconds < 60.0) return fmt::format("{:.0f} s", seconds);
  const auto minutes = static_cast<int>(seconds / 60.0);
  if (minutes < 60) return fmt::format("{} min {:02.0f} s", minutes, seconds - 60.0 * minutes);
  return fmt::format("{} h {:02} min", minutes / 60, minutes % 60);
}

}  // namespace

bool is_terminal(int descriptor) {
  // NOLINTNEXTLINE(concurrency-mt-unsafe): nothing sets the environment
  const char* kind = std::getenv("TERM");
  return isatty(descriptor) == 1 && (kind == nullptr || std::string(kind) != "dumb");
}

std::size_t terminal_columns(int descriptor) {
  if (!is_terminal(descriptor)) return 0;
  winsize size{};
  if (ioctl(descriptor, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return kUsualColumns;
  return size.ws_col;
}

std::string line_start(int descriptor) { return is_terminal(descriptor) ? "\r\033[K" : ""; }

std::string coloured(const std::string& text, Colour colour, int descriptor) {
  // NOLINTNEXTLINE(concurrency-mt-unsafe): nothing sets the environment
  const char* refusal = std::getenv("NO_COLOR");
  if (!is_terminal(descriptor) || (refusal != nullptr && *refusal != '\0')) return text;
  const char* const begin = colour == Colour::kGood   ? "\033[32m"
                            : colour == Colour::kFair ? "\033[33m"
                                                      : "\033[31m";
  return begin + text + "\033[0m";
}

std::string fitted(const std::string& text, std::size_t columns) {
  if (columns_of(text) <= columns) return text;
  if (columns == 0) return {};
  std::size_t kept = 0;
  std::size_t bytes = 0;
  for (; bytes < text.size(); ++bytes) {
    if (begins_character(text[bytes]) && ++kept == columns) break;
  }
  return text.substr(0, bytes) + "…";
}

namespace {

/// Where the text of a line begins: behind two spaces or more that follow its first word, else
/// behind its indentation.
std::size_t text_column(const std::string& line) {
  const std::size_t first = std::min(line.find_first_not_of(' '), line.size());
  const std::size_t gap = line.find("  ", first);
  const std::size_t second = gap == std::string::npos ? gap : line.find_first_not_of(' ', gap);
  return second == std::string::npos ? first : columns_of(line.substr(0, second));
}

void append_wrapped(const std::string& line, std::size_t columns, std::string& text) {
  if (columns_of(line) <= columns) {
    text += line;
    return;
  }
  constexpr std::size_t kNarrowIndent = 4;
  std::size_t indent = text_column(line);
  if (3 * indent > 2 * columns) indent = kNarrowIndent;  // no room for words beside it
  std::string rest = line;
  while (columns_of(rest) > columns) {
    // the last space at which what is before it fits
    std::size_t cut = std::string::npos;
    for (std::size_t at = rest.find(' ', indent); at != std::string::npos;
         at = rest.find(' ', at + 1)) {
      if (columns_of(rest.substr(0, at)) > columns && cut != std::string::npos) break;
      if (rest.find_first_not_of(' ') < at) cut = at;
    }
    if (cut == std::string::npos) break;
    text += rest.substr(0, cut) + "\n";
    rest = std::string(indent, ' ') + rest.substr(cut + 1);
  }
  text += rest;
}

}  // namespace

std::string wrapped(const std::string& text, std::size_t columns) {
  if (columns == 0) return text;
  std::string result;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    append_wrapped(text.substr(at, end - at), columns, result);
    if (end < text.size()) result += '\n';
    at = end + 1;
  }
  return result;
}

const Clock& Progress::steady_clock() {
  static const SteadyClock clock;
  return clock;
}

Progress::Progress(std::string what, bool is_quiet, int descriptor, const Clock& clock)
    : what_(std::move(what)),
      descriptor_(descriptor),
      is_shown_(!is_quiet && is_terminal(descriptor)),
      clock_(clock),
      begin_(clock.now()),
      next_(begin_ + kPatience) {}

Progress::~Progress() {
  if (has_line_) static_cast<void>(!::write(descriptor_, "\r\033[K", 4));
}

void Progress::show(double ratio) {
  if (!is_shown_) return;
  const TimePoint now = clock_.now();
  if (now < next_) return;
  next_ = now + kInterval;
  const double elapsed_s = to_seconds(now - begin_);
  std::string line = what_ + ": ";
  if (ratio > 0.0 && ratio <= 1.0) {
    line += fmt::format("{:.0f} %, {} left", 100.0 * ratio,
                        time_text(elapsed_s * (1.0 - ratio) / ratio));
  } else {
    line += time_text(elapsed_s);
  }
  const std::size_t columns = terminal_columns(descriptor_);
  const std::string text = "\r\033[K" + fitted(line, columns > 1 ? columns - 1 : 0);
  // a terminal that went away ends the display, not the work
  is_shown_ = ::write(descriptor_, text.data(), text.size()) >= 0;
  has_line_ = is_shown_;
}

BusyLine::BusyLine(std::string what, bool is_quiet) {
  if (is_quiet || !is_terminal(STDERR_FILENO)) return;
  thread_ = std::jthread([what = std::move(what)](const std::stop_token& stop) {
    Progress progress(what);
    std::mutex mutex;
    std::condition_variable_any stopped;
    std::unique_lock lock(mutex);
    while (!stopped.wait_for(lock, stop, Progress::kInterval, [] { return false; }) &&
           !stop.stop_requested()) {
      progress.show(kUnknown);
    }
  });
}

TerminalKeys::TerminalKeys(int descriptor) : descriptor_(descriptor) {
  termios settings{};
  if (isatty(descriptor) != 1 || tcgetpgrp(descriptor) != getpgrp() ||
      tcgetattr(descriptor, &settings) != 0) {
    return;
  }
  before_ = settings;
  settings.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
  settings.c_cc[VMIN] = 0;  // read() returns at once
  settings.c_cc[VTIME] = 0;
  if (tcsetattr(descriptor, TCSANOW, &settings) != 0) before_.reset();
}

TerminalKeys::~TerminalKeys() {
  if (is_on() && tcgetpgrp(descriptor_) == getpgrp()) tcsetattr(descriptor_, TCSANOW, &*before_);
}

char TerminalKeys::take() {
  char key = 0;
  // a program in the background would be stopped by reading
  if (!is_on() || tcgetpgrp(descriptor_) != getpgrp()) return 0;
  return read(descriptor_, &key, 1) == 1 ? key : '\0';
}

StopSignal::StopSignal() {
  is_stop_requested = 0;
  struct sigaction action {};
  action.sa_handler = [](int) {
    is_stop_requested = 1;
    for (const int signal : kStopSignals) std::signal(signal, SIG_DFL);
  };
  action.sa_flags = SA_RESTART;
  for (const int signal : kStopSignals) {
    struct sigaction before {};
    sigaction(signal, nullptr, &before);
    if (before.sa_handler != SIG_IGN) sigaction(signal, &action, nullptr);  // nohup stays
  }
}

StopSignal::~StopSignal() {
  for (const int signal : kStopSignals) {
    struct sigaction now {};
    sigaction(signal, nullptr, &now);
    if (now.sa_handler != SIG_IGN) std::signal(signal, SIG_DFL);
  }
}

bool StopSignal::is_requested() { return is_stop_requested != 0; }

}  // namespace palpate
