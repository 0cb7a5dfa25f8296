// What a person sees: the first screen of a launch, its status line, verdicts, warnings and help.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pty.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/port.h"
#include "tests/support/program.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"

namespace palpate {
namespace {

using test::Outcome;
using test::run_program;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;
using Arguments = std::vector<std::string>;

constexpr const char* kDefault = PALPATE_SOURCE_DIR "/deploy/sessions/default.txtpb";

/// Everything that palpate writes to a terminal of so many columns.
/// @param key     pressed once `prompt` was shown
std::string on_terminal(const Arguments& arguments, unsigned short columns,
                        const std::string& prompt = {}, char key = 0) {
  winsize size{.ws_row = 24, .ws_col = columns, .ws_xpixel = 0, .ws_ypixel = 0};
  const std::string program = PALPATE_BINARY_DIR "/palpate";
  std::vector<char*> argv{const_cast<char*>(program.c_str())};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  int terminal = -1;
  const pid_t child = forkpty(&terminal, nullptr, nullptr, &size);
  if (child == 0) {
    execv(argv[0], argv.data());
    _exit(127);
  }
  std::string text;
  std::array<char, 4096> bytes{};
  for (ssize_t got = 0; (got = read(terminal, bytes.data(), bytes.size())) > 0;) {
    text.append(bytes.data(), static_cast<std::size_t>(got));
    if (key != 0 && text.find(prompt) != std::string::npos) {
      EXPECT_EQ(write(terminal, &key, 1), 1);
      key = 0;
    }
  }
  close(terminal);
  int status = 0;
  EXPECT_EQ(waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0) << text;
  return text;
}

/// What remains of the text on the lines of a terminal: a line is begun anew by "\r\033[K".
std::vector<std::string> lines_shown(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    const std::size_t begin = line.rfind("\r\033[K");
    lines.push_back(begin == std::string::npos ? line : line.substr(begin + 4));
  }
  return lines;
}

std::size_t columns_of(const std::string& text) {
  return static_cast<std::size_t>(std::count_if(text.begin(), text.end(), [](char c) {
    return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U;
  }));
}

class Screen : public testing::Test {
 protected:
  test::RunFolder run_folder_;
};

TEST_F(Screen, OfALaunchBeginsWithThePageAndItsStatusFits) {
  const std::string text = on_terminal(
      {"launch", kDefault, "--no-realtime", "--seconds", "2", "--set", "viewer.web.port=0"}, 60);
  const std::vector<std::string> lines = lines_shown(text);
  ASSERT_GT(lines.size(), 5u) << text;
  EXPECT_THAT(lines[0], testing::MatchesRegex("http://127.0.0.1:[0-9]+/"));
  bool has_status = false;
  for (std::size_t at = 0; (at = text.find("\r\033[K", at)) != std::string::npos;) {
    at += 4;
    const std::string part = text.substr(at, text.find_first_of("\r\n", at) - at);
    if (part.find(" Hz") == std::string::npos || part.find("event=") != std::string::npos) continue;
    has_status = true;
    EXPECT_LT(columns_of(part), 60u) << part;
  }
  EXPECT_TRUE(has_status) << text;
  // no log line is glued to a status line
  for (const std::string& line : lines) {
    if (line.find("event=") == std::string::npos) continue;
    EXPECT_THAT(line, StartsWith("20")) << "a log line begins with its date";
  }
}

TEST_F(Screen, OfALaunchTakesMarkers) {
  const test::TempFolder folder;
  const std::string file = (folder.path() / "run.mcap").string();
  const std::string text = on_terminal(
      {"launch", kDefault, "--no-realtime", "--no-viewer", "--seconds", "3", "--record", file}, 80,
      "press m to set a marker in the run", 'm');
  EXPECT_THAT(text, HasSubstr("marker set: marker 1"));
  EXPECT_THAT(run_program("palpate", {"info", file}).out, HasSubstr(": marker 1 (terminal)"));
}

TEST_F(Screen, OfALaunchNamesAnotherPageIfThePortIsInUse) {
  std::optional<test::HeldPort> busy(std::in_place);
  const std::string port = busy->endpoint().substr(busy->endpoint().rfind(':') + 1);
  const std::string setting = "viewer.web.port=" + port;

  const Outcome launch = run_program(
      "palpate", {"launch", kDefault, "--no-realtime", "--seconds", "1", "--set", setting});
  EXPECT_EQ(launch.status, 0) << launch.err;
  const std::string url = launch.out.substr(0, launch.out.find('\n'));
  EXPECT_THAT(url, AllOf(StartsWith("http://127.0.0.1:"), Not(HasSubstr(port))));
  EXPECT_THAT(launch.err,
              AllOf(HasSubstr("port " + port + " is in use"), HasSubstr("event=web url=" + url)));

  const Outcome doctor = run_program("palpate", {"doctor", kDefault, "--set", setting});
  EXPECT_EQ(doctor.status, 1);
  EXPECT_THAT(doctor.out, HasSubstr("127.0.0.1:" + port + " is in use: end the program"));
  busy.reset();
  EXPECT_THAT(run_program("palpate", {"doctor", kDefault, "--set", setting}).out,
              HasSubstr("127.0.0.1:" + port + " is free"));
}

TEST_F(Screen, OfARunSaysWhatIsGoodAndWhatIsBad) {
  const Outcome good = run_program("palpate", {"loopback", kDefault, "--seconds", "3"});
  EXPECT_THAT(good.out,
              AllOf(HasSubstr("good  the hand extracted no energy"), Not(HasSubstr("  bad "))));

  const Outcome bad =
      run_program("palpate", {"loopback", PALPATE_SOURCE_DIR "/deploy/sessions/paper_rigid.txtpb",
                              "--set", "mofc.controller=none", "--set", "physics.rate_hz=50",
                              "--set", "hand.v.free_motion_s=0", "--seconds", "3"});
  EXPECT_THAT(bad.out, HasSubstr("bad   the hand extracted"));
}

TEST_F(Screen, OfARunThatStartsInTissueExplainsIt) {
  const Arguments press{"loopback",
                        kDefault,
                        "--no-ideal",
                        "--seconds",
                        "0.1",
                        "--set",
                        "hand.hold={ position_m { z: -0.01 } }"};
  EXPECT_THAT(run_program("palpate", press).err,
              AllOf(HasSubstr("the tool is in tissue at the first step"), HasSubstr("-10.0) mm"),
                    HasSubstr("start outside")));
  EXPECT_EQ(run_program("palpate", {"loopback", kDefault, "--seconds", "0.1"}).err, "");

  Arguments launch{"launch",    kDefault, "--no-realtime", "--no-viewer",
                   "--seconds", "1",      "--set",         "hand.hold={ position_m { z: -0.01 } }"};
  EXPECT_THAT(run_program("palpate", launch).err,
              HasSubstr("palpate: the tool is in tissue at the first step"));
}

// --- help ---------------------------------------------------------------------------------------

/// Words that begin with -- in a text.
std::vector<std::string> options_in(const std::string& text) {
  std::vector<std::string> options;
  for (std::size_t at = 0; (at = text.find("--", at)) != std::string::npos;) {
    const std::size_t end = text.find_first_not_of("abcdefghijklmnopqrstuvwxyz-", at);
    const bool is_value = at > 0 && text[at - 1] == '=';  // "--sbatch=--partition=long"
    if (end - at > 3 && !is_value) options.push_back(text.substr(at, end - at));
    at = end;
  }
  return options;
}

TEST(Help, OfACommandIsItsHelpOption) {
  EXPECT_EQ(run_program("palpate", {"help", "launch"}).out,
            run_program("palpate", {"launch", "--help"}).out);
  EXPECT_EQ(run_program("palpate", {"help"}).out, run_program("palpate", {"--help"}).out);
  const Outcome wrong = run_program("palpate", {"help", "lunch"});
  EXPECT_EQ(wrong.status, 2);
  EXPECT_THAT(wrong.err, HasSubstr("did you mean launch?"));
}

TEST(Help, SuggestsCommandsOptionsAndValues) {
  EXPECT_THAT(run_program("palpate", {"lopback"}).err, HasSubstr("did you mean loopback?"));
  EXPECT_THAT(run_program("palpate", {"loopback", kDefault, "--secnds", "1"}).err,
              HasSubstr("--secnds: did you mean --seconds?"));
  EXPECT_THAT(run_program("palpate", {"loopback", kDefault, "--set", "mofc.mode=gaurd"}).err,
              HasSubstr("did you mean 'guard'?"));
  EXPECT_THAT(run_program("palpate", {"conform", "physics", "--"}).err,
              Not(HasSubstr("did you mean")));
}

TEST(Help, ExplainsTerms) {
  const Outcome clamp = run_program("palpate", {"explain", "clamp", "share"});
  EXPECT_EQ(clamp.status, 0);
  EXPECT_EQ(clamp.out,
            "clamp share  (Terms)\n    Clamped ticks / ticks in which a force was requested.\n");
  const Outcome wrong = run_program("palpate", {"explain", "transparancy"});
  EXPECT_EQ(wrong.status, 2);
  EXPECT_THAT(wrong.err, HasSubstr("did you mean \"transparency\"?"));
}

TEST(Help, IsCompletedAndPrintedAsPagesForEveryCommand) {
  const std::string bash = run_program("palpate", {"completion", "bash"}).out;
  std::vector<Arguments> commands{{"scene", "check"}, {"conform", "physics"}, {"sweep", "report"}};
  std::istringstream list(run_program("palpate", {"--help"}).out);
  for (std::string line; std::getline(list, line) && line != "Subcommands:";) {
  }
  for (std::string line; std::getline(list, line) && line.starts_with("  ");) {
    commands.push_back({line.substr(2, line.find(' ', 2) - 2)});
  }
  ASSERT_GE(commands.size(), 20u);
  for (const Arguments& command : commands) {
    SCOPED_TRACE(testing::PrintToString(command));
    Arguments with_help = command;
    with_help.push_back("--help");
    const std::string help = run_program("palpate", with_help).out;
    Arguments man{"man"};
    man.insert(man.end(), command.begin(), command.end());
    std::string page = run_program("palpate", man).out;
    std::erase(page, '\\');
    std::string file = PALPATE_BINARY_DIR "/../deploy/palpate/pages/palpate";
    for (const std::string& word : command) file += "-" + word;
    EXPECT_EQ(test::text_of(file + ".1"), run_program("palpate", man).out) << "of the package";
    for (const std::string& option : options_in(help.substr(help.find("Options:")))) {
      EXPECT_THAT(bash, HasSubstr(option));
      EXPECT_THAT(page, HasSubstr(option));
    }
  }
}

TEST(Help, CompletesInBash) {
  const std::string script =
      std::string("source <(") + PALPATE_BINARY_DIR +
      "/palpate completion bash); complete_it() { COMP_WORDS=(palpate \"$@\"); "
      "COMP_CWORD=$#; _palpate; printf '%s ' \"${COMPREPLY[@]}\"; }; ";
  const auto completed = [&](const std::string& words) {
    return run_program("/bin/bash", {"-c", script + "complete_it " + words}).out;
  };
  EXPECT_EQ(completed("loo"), "loopback ");
  EXPECT_EQ(completed("launch x --sec"), "--seconds ");
  EXPECT_EQ(completed("export --csv /etc/hostn"), "/etc/hostname ");
  EXPECT_EQ(completed("scene ch"), "check ");
}

}  // namespace
}  // namespace palpate
