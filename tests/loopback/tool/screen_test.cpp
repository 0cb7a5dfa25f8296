// SPDX-License-Identifier: Apache-2.0
// What a person sees: the first screen of a launch, its status line, verdicts, warnings and help.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <pty.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "common/session/session_file.h"
#include "tests/support/machine/machine.h"
#include "tests/support/machine/places.h"
#include "tests/support/port.h"
#include "tests/support/program.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"
#include "tests/support/watcher.h"

namespace palpate {
namespace {

using test::Outcome;
using test::run_program;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;
using Arguments = std::vector<std::string>;

const std::string kDefault = test::source_dir() + "/deploy/sessions/default.txtpb";

constexpr char kNoKey = 0;
constexpr char kCtrlC = '\x03';

struct KeyPress {
  std::string prompt;  ///< once this was shown
  char key;
};

/// Everything that palpate writes to a terminal of so many columns.
/// @param keys  pressed one after the other
/// @param kind  what TERM says
std::string on_terminal(const Arguments& arguments, unsigned short columns,
                        const std::vector<KeyPress>& keys, const char* kind = "xterm") {
  winsize size{.ws_row = 24, .ws_col = columns, .ws_xpixel = 0, .ws_ypixel = 0};
  const std::string program = test::binary_dir() + "/palpate";
  std::vector<char*> argv{const_cast<char*>(program.c_str())};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  int terminal = -1;
  const pid_t child = forkpty(&terminal, nullptr, nullptr, &size);
  if (child == 0) {
    setenv("TERM", kind, 1);
    execv(argv[0], argv.data());
    _exit(127);
  }
  std::string text;
  std::array<char, 4096> bytes{};
  auto next = keys.begin();
  const auto deadline = std::chrono::steady_clock::now() + test::patience(test::Program::kAmple);
  for (;;) {
    const auto left =
        std::chrono::ceil<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now());
    pollfd output{.fd = terminal, .events = POLLIN, .revents = 0};
    if (left.count() <= 0 || poll(&output, 1, static_cast<int>(left.count())) == 0) {
      ADD_FAILURE() << "it still runs";
      kill(child, SIGKILL);
      break;
    }
    const ssize_t got = read(terminal, bytes.data(), bytes.size());
    if (got <= 0) break;
    text.append(bytes.data(), static_cast<std::size_t>(got));
    for (; next != keys.end() && text.find(next->prompt) != std::string::npos; ++next) {
      if (next->key == kCtrlC) {
        kill(child, SIGINT);  // as a terminal does, which also discards what was not read yet
      } else if (next->key != kNoKey) {
        EXPECT_EQ(write(terminal, &next->key, 1), 1);
      }
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
  const std::string text =
      on_terminal({"launch", kDefault, "--no-realtime", "--set", "viewer.web.port=0"}, 60,
                  {{" Hz  jitter", kCtrlC}});
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
  // the address, the key for markers, then figures
  const std::string before = text.substr(0, text.find(" Hz"));
  std::istringstream before_figures(before);
  int shown = 0;
  for (std::string line; std::getline(before_figures, line);) {
    shown += line.find(" warning ") == std::string::npos ? 1 : 0;  // of a busy machine
  }
  EXPECT_LE(shown, 4) << text;  // with the line of the figures
  // no log line is glued to a status line
  for (const std::string& line : lines) {
    if (line.find("event=") == std::string::npos) continue;
    EXPECT_THAT(line, StartsWith("20")) << "a log line begins with its date";
  }
}

TEST_F(Screen, OfALaunchHasNoEventsOfTheLogThoughTheTerminalIsDumb) {
  const std::string text = on_terminal(
      {"launch", kDefault, "--no-realtime", "--no-viewer", "--seconds", "1"}, 80, {}, "dumb");
  EXPECT_THAT(text, HasSubstr("in real time"));
  EXPECT_THAT(text, Not(HasSubstr("event=node_started")));
}

TEST_F(Screen, OfALaunchTakesMarkers) {
  const test::TempFolder folder;
  const std::string file = (folder.path() / "run.mcap").string();
  const std::string text =
      on_terminal({"launch", kDefault, "-v", "--no-realtime", "--no-viewer", "--record", file}, 80,
                  {{"event=peer_up link=interaction", kNoKey},
                   {"press m to set a marker in the run", 'm'},
                   {"marker set", kCtrlC}});
  EXPECT_THAT(text, HasSubstr("marker set: marker 1"));
  EXPECT_THAT(run_program("palpate", {"info", file}).out, HasSubstr(": marker 1 (terminal)"));
}

TEST_F(Screen, OfALaunchNamesAnotherPageIfThePortIsInUse) {
  std::optional<test::HeldPort> busy(std::in_place);
  const std::string port = busy->endpoint().substr(busy->endpoint().rfind(':') + 1);
  const std::string setting = "viewer.web.port=" + port;

  test::Program launch("palpate", {"launch", kDefault, "--no-realtime", "--set", setting});
  launch.await_err("event=web url=");
  launch.send_signal(SIGINT);
  EXPECT_EQ(launch.wait(), 0) << launch.err();
  const std::string url = launch.out().substr(0, launch.out().find('\n'));
  EXPECT_THAT(url, AllOf(StartsWith("http://127.0.0.1:"), Not(HasSubstr(port))));
  EXPECT_THAT(launch.err(),
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

  const std::string rigid = test::source_dir() + "/deploy/sessions/paper_rigid.txtpb";
  const Outcome bad = run_program(
      "palpate", {"loopback", rigid, "--set", "mofc.controller=none", "--set", "physics.rate_hz=50",
                  "--set", "hand.v.free_motion_s=0", "--seconds", "3"});
  EXPECT_THAT(bad.out, HasSubstr("bad   the hand extracted"));
}

// a hand that no hand is: 10 m/s and more
TEST_F(Screen, OfALaunchWithALatchedFaultSaysSoAndItsStatusIsNotZero) {
  const test::TempFolder folder;
  const std::string json = (folder.path() / "run.json").string();
  const std::string session = test::source_dir() + "/deploy/sessions/paper_soft.txtpb";
  const Outcome launch = run_program(
      "palpate", {"launch", session, "--no-realtime", "--no-viewer", "--seconds", "3", "--json",
                  json, "--set", "device.v_fault_m_per_s=5", "--set",
                  "hand.sinusoid={ amplitude_m { z: 0.2 } frequency_hz { z: 8 } }", "--set",
                  "hand.stiffness_newton_per_m=5000", "--set", "hand.damping_newton_s_per_m=60"});
  EXPECT_EQ(launch.status, 1) << launch.err;
  EXPECT_THAT(launch.out, HasSubstr("bad   device fault: position jumped"));
  EXPECT_THAT(launch.out, Not(HasSubstr("check the hand's path")));
  const auto figures = nlohmann::json::parse(test::text_of(json));
  EXPECT_EQ(figures["device_faults"], 1);
  EXPECT_EQ(figures["last_fault"], "position jumped");
  EXPECT_EQ(figures["verdict"]["grade"], "bad");
  EXPECT_EQ(figures["verdict"]["cause"], "device_fault");
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

  // again if launch did not hear the first step
  const test::QuietMachine machine;
  bool is_explained = false;
  for (int attempt = 0; attempt < 10 && !is_explained; ++attempt) {
    test::Program launch("palpate", {"launch", kDefault, "--no-realtime", "--no-viewer", "--set",
                                     "hand.hold={ position_m { z: -0.01 } }"});
    ProcessLinks links({.priority = 0, .cpu = -1});
    test::Watcher watcher(load_session(kDefault), links);
    ASSERT_TRUE(watcher.until([&] {
      return watcher.mirror().physics_counters().contact_steps > 100;
    })) << launch.err();
    launch.send_signal(SIGINT);
    EXPECT_EQ(launch.wait(), 0) << launch.err();
    is_explained =
        launch.err().find("palpate: the tool is in tissue at the first step") != std::string::npos;
  }
  EXPECT_TRUE(is_explained || !machine.may_check("a start in tissue is explained"));
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

TEST(Help, IsQuietWhenItsReaderHasEnough) {
  const Outcome head =
      run_program("/bin/bash", {"-c", std::string("set -o pipefail; ") + test::binary_dir() +
                                          "/palpate explain | head -n 1"});
  EXPECT_EQ(head.status, 0) << head.err;
  EXPECT_EQ(head.err, "");
}

TEST(Help, ExplainsTheVerdictWithItsLimits) {
  const Outcome verdict = run_program("palpate", {"explain", "verdict"});
  EXPECT_EQ(verdict.status, 0);
  EXPECT_THAT(verdict.out, AllOf(HasSubstr("fair from 10 %"), HasSubstr("bad from 30 %"),
                                 HasSubstr("bad from 3")));
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
    std::string file = test::binary_dir() + "/../deploy/palpate/pages/palpate";
    for (const std::string& word : command) file += "-" + word;
    EXPECT_EQ(test::text_of(file + ".1"), run_program("palpate", man).out) << "of the package";
    if (command == Arguments{"ros"}) continue;  // its help is that of palpate_ros
    for (const std::string& option : options_in(help.substr(help.find("Options:")))) {
      EXPECT_THAT(bash, HasSubstr(option));
      EXPECT_THAT(page, HasSubstr(option));
    }
  }
}

TEST(Help, CompletesInBash) {
  const std::string script =
      std::string("source <(") + test::binary_dir() +
      "/palpate completion bash); complete_it() { COMP_WORDS=(palpate \"$@\"); "
      "COMP_CWORD=$#; _palpate; printf '%s ' \"${COMPREPLY[@]}\"; }; ";
  const auto completed = [&](const std::string& words) {
    return run_program("/bin/bash", {"-c", script + "complete_it " + words}).out;
  };
  EXPECT_EQ(completed("loo"), "loopback ");
  EXPECT_EQ(completed("launch x --sec"), "--seconds ");
  EXPECT_EQ(completed("export --csv /etc/hostn"), "/etc/hostname ");
  EXPECT_EQ(completed("scene ch"), "check ");
  // bash takes the = as a word of its own, unless COMP_WORDBREAKS leaves it out
  EXPECT_EQ(completed("launch x --set mofc.mod"), "mofc.mode= ");
  EXPECT_EQ(completed("launch x --set device.rate_h"), "device.rate_hz= ");
  EXPECT_EQ(completed("launch x --set mofc.mode = g"), "guard ");
  EXPECT_EQ(completed("launch x --set mofc.mode ="), "paper vector guard ");
  EXPECT_EQ(completed("launch x --set mofc.mode=v"), "mofc.mode=vector ");
  EXPECT_EQ(completed("launch x --set viewer.control ="), "false true ");
  EXPECT_EQ(completed("launch x --nodes v"), "viewer ");
  EXPECT_EQ(completed("launch x --nodes device,mo"), "device,mofc ");
  EXPECT_EQ(completed("launch x --together ''"), "device mofc ");
  EXPECT_EQ(completed("emulate x --fault unpl"), "unplugged ");
  EXPECT_EQ(completed("explain transparency"), "transparency transparency_s ");
  EXPECT_EQ(completed("explain clamp sha"), "share ");
  EXPECT_EQ(completed("help loo"), "loopback ");
  EXPECT_EQ(completed("man la"), "launch ");
  EXPECT_THAT(completed("completion ''"), testing::StartsWith("bash zsh fish -"));
}

TEST(Help, CompletesInFish) {
  if (std::system("command -v fish > /dev/null 2>&1") != 0) GTEST_SKIP() << "fish is not installed";
  const auto completed = [](const std::string& line) {
    const std::string script = test::binary_dir() +
                               "/palpate completion fish | source; complete -C '" + line +
                               "' | string replace -r '\\t.*' ''";
    return run_program("/usr/bin/fish", {"--no-config", "-c", script}).out;
  };
  EXPECT_EQ(completed("palpate launch x --set mofc.mod"), "mofc.mode=\n");
  EXPECT_EQ(completed("palpate launch x --set mofc.mode=g"), "mofc.mode=guard\n");
  EXPECT_EQ(completed("palpate loopback x --set viewer.control="),
            "viewer.control=false\nviewer.control=true\n");
  EXPECT_EQ(completed("palpate launch x --nodes device,mo"), "device,mofc\n");
  EXPECT_EQ(completed("palpate emulate x --fault unpl"), "unplugged\n");
  EXPECT_EQ(completed("palpate explain transparency_"), "transparency_s\n");
  EXPECT_EQ(completed("palpate completion "), "bash\nfish\nzsh\n");
}

// the two builtins of the completion system are stood in for: they work at a prompt only
TEST(Help, CompletesInZsh) {
  if (std::system("command -v zsh > /dev/null 2>&1") != 0) GTEST_SKIP() << "zsh is not installed";
  const auto completed = [](const std::string& word) {
    const std::string script =
        "_arguments() { :; }\n"
        "compset() { [[ $PREFIX == *=* ]] || return 1; IPREFIX=${PREFIX%%=*}=; "
        "PREFIX=${PREFIX#*=}; }\n"
        "compadd() { print -rn -- \"${@[(r)--,-1][2,-1]} \"; }\n"
        "source <(" +
        test::binary_dir() + "/palpate completion zsh)\nPREFIX='" + word + "'\n_palpate_settings";
    return run_program("/usr/bin/zsh", {"-f", "-c", script}).out;
  };
  EXPECT_THAT(completed("mofc.mod"), HasSubstr(" mofc.mode= "));
  EXPECT_EQ(completed("mofc.mode="), "paper vector guard ");
  EXPECT_EQ(completed("viewer.control="), "false true ");
}

}  // namespace
}  // namespace palpate
