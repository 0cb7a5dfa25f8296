// SPDX-License-Identifier: Apache-2.0
#include "common/process/terminal.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pty.h>
#include <sys/ioctl.h>

#include <array>
#include <csignal>
#include <cstdlib>

namespace palpate {
namespace {

/// A terminal of so many columns: what is written to `screen` is read back.
class TestTerminal {
 public:
  explicit TestTerminal(unsigned short columns = 80) {
    winsize size{.ws_row = 24, .ws_col = columns, .ws_xpixel = 0, .ws_ypixel = 0};
    EXPECT_EQ(openpty(&reader_, &screen, nullptr, nullptr, &size), 0);
    fcntl(reader_, F_SETFL, O_NONBLOCK);
    setenv("TERM", "xterm", 1);
  }
  ~TestTerminal() {
    close(reader_);
    close(screen);
  }
  TestTerminal(const TestTerminal&) = delete;
  TestTerminal& operator=(const TestTerminal&) = delete;

  /// What was written since the last call.
  [[nodiscard]] std::string text() const {
    std::array<char, 4096> bytes{};
    const ssize_t got = read(reader_, bytes.data(), bytes.size());
    return got > 0 ? std::string(bytes.data(), static_cast<std::size_t>(got)) : "";
  }
  int screen = -1;

 private:
  int reader_ = -1;
};

TEST(Progress, IsShownAfterTwoSecondsWithTheTimeLeft) {
  const TestTerminal terminal;
  ManualClock clock;
  {
    Progress progress("loopback", false, terminal.screen, clock);
    clock.advance(std::chrono::milliseconds(1900));
    progress.show(0.19);
    EXPECT_EQ(terminal.text(), "");
    clock.advance(std::chrono::milliseconds(600));
    progress.show(0.25);  // 2.5 s for a quarter: 7.5 s for the rest
    EXPECT_EQ(terminal.text(), "\r\033[Kloopback: 25 %, 8 s left");
    clock.advance(std::chrono::milliseconds(100));
    progress.show(0.26);
    EXPECT_EQ(terminal.text(), "") << "too soon";
    clock.advance(std::chrono::milliseconds(997'400));
    progress.show(0.5);
    EXPECT_EQ(terminal.text(), "\r\033[Kloopback: 50 %, 16 min 40 s left");
    clock.advance(std::chrono::seconds(1));
    progress.show(-1.0);
    EXPECT_EQ(terminal.text(), "\r\033[Kloopback: 16 min 41 s");
  }
  EXPECT_EQ(terminal.text(), "\r\033[K") << "the line is removed";
}

TEST(Progress, IsSilentWithoutATerminalOrOnRequest) {
  const TestTerminal terminal;
  std::array<int, 2> pipe_ends{};
  ASSERT_EQ(pipe2(pipe_ends.data(), O_NONBLOCK), 0);
  ManualClock clock;
  {
    Progress quiet("loopback", true, terminal.screen, clock);
    Progress piped("loopback", false, pipe_ends[1], clock);
    clock.advance(std::chrono::seconds(10));
    quiet.show(0.5);
    piped.show(0.5);
  }
  EXPECT_EQ(terminal.text(), "");
  char byte = 0;
  EXPECT_EQ(read(pipe_ends[0], &byte, 1), -1);
  for (const int end : pipe_ends) close(end);
}

TEST(Progress, IsNoWiderThanTheTerminal) {
  const TestTerminal terminal(12);
  ManualClock clock;
  Progress progress("loopback", false, terminal.screen, clock);
  clock.advance(std::chrono::seconds(10));
  progress.show(0.5);
  EXPECT_EQ(terminal.text(), "\r\033[Kloopback: …");
}

TEST(Terminal, HasAWidthThatIsKnown) {
  EXPECT_EQ(terminal_columns(TestTerminal(57).screen), 57u);
  const int file = open("/dev/null", O_RDONLY);
  EXPECT_EQ(terminal_columns(file), 0u);
  close(file);
}

TEST(Terminal, TextIsCutBetweenCharacters) {
  EXPECT_EQ(fitted("µµµµ", 4), "µµµµ");
  EXPECT_EQ(fitted("µµµµ", 3), "µµ…");
  EXPECT_EQ(fitted("abc", 1), "…");
  EXPECT_EQ(fitted("abc", 0), "");
  EXPECT_EQ(columns_of("42 µs"), 5u);
}

TEST(Terminal, ColourIsForTerminalsWithoutNoColor) {
  const TestTerminal terminal;
  unsetenv("NO_COLOR");
  EXPECT_EQ(coloured("ok", Colour::kGood, terminal.screen), "\033[32mok\033[0m");
  EXPECT_EQ(coloured("so", Colour::kFair, terminal.screen), "\033[33mso\033[0m");
  const int file = open("/dev/null", O_WRONLY);
  EXPECT_EQ(coloured("ok", Colour::kGood, file), "ok");
  close(file);
  setenv("NO_COLOR", "1", 1);
  EXPECT_EQ(coloured("ok", Colour::kGood, terminal.screen), "ok");
  unsetenv("NO_COLOR");
}

// such as the shell of an editor: no colour, nothing rewritten
TEST(Terminal, ThatIsDumbCountsAsAFile) {
  const TestTerminal terminal(132);
  unsetenv("NO_COLOR");
  const char* const before = std::getenv("TERM");
  const std::string kind = before == nullptr ? "" : before;
  setenv("TERM", "dumb", 1);
  EXPECT_FALSE(is_terminal(terminal.screen));
  EXPECT_EQ(terminal_columns(terminal.screen), 0u);
  EXPECT_EQ(line_start(terminal.screen), "");
  EXPECT_EQ(coloured("ok", Colour::kGood, terminal.screen), "ok");
  setenv("TERM", "xterm", 1);
  EXPECT_TRUE(is_terminal(terminal.screen));
  EXPECT_EQ(terminal_columns(terminal.screen), 132u);
  EXPECT_EQ(line_start(terminal.screen), "\r\033[K");
  if (before == nullptr) {
    unsetenv("TERM");
  } else {
    setenv("TERM", kind.c_str(), 1);
  }
}

TEST(Terminal, TextIsWrappedBelowItsBeginning) {
  EXPECT_EQ(wrapped("a long line of words", 12), "a long line\nof words");
  EXPECT_EQ(wrapped("  --option FILE   what it is for, in words\n", 28),
            "  --option FILE   what it is\n                  for, in\n                  words\n");
  EXPECT_EQ(wrapped("short\nlines\n", 12), "short\nlines\n");
  EXPECT_EQ(wrapped("a_word_that_is_longer_than_the_line", 12),
            "a_word_that_is_longer_than_the_line");
  EXPECT_EQ(wrapped("µµµµ µµµµ", 9), "µµµµ µµµµ") << "columns, not bytes";
  EXPECT_EQ(wrapped("as it is", 0), "as it is");
}

TEST(StopSignal, NotesTheFirstAndLeavesTheSecondItsEffect) {
  {
    const StopSignal stop;
    EXPECT_FALSE(StopSignal::is_requested());
    ASSERT_EQ(std::raise(SIGTERM), 0);
    EXPECT_TRUE(StopSignal::is_requested());
    EXPECT_EQ(std::signal(SIGTERM, SIG_DFL), SIG_DFL);
  }
  EXPECT_EXIT(
      {
        const StopSignal stop;
        static_cast<void>(std::raise(SIGINT));
        static_cast<void>(std::raise(SIGINT));
      },
      testing::KilledBySignal(SIGINT), "");
}

TEST(StopSignal, LeavesAnIgnoredSignalIgnored) {
  std::signal(SIGHUP, SIG_IGN);  // as nohup does
  {
    const StopSignal stop;
    ASSERT_EQ(std::raise(SIGHUP), 0);
    EXPECT_FALSE(StopSignal::is_requested());
  }
  EXPECT_EQ(std::signal(SIGHUP, SIG_DFL), SIG_IGN);
}

}  // namespace
}  // namespace palpate
