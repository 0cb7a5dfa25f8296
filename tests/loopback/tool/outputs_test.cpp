// SPDX-License-Identifier: Apache-2.0
// Every command × every file that it writes × what may be in the way: nothing is replaced by
// accident, and nothing is lost without an error.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "tests/support/machine/places.h"
#include "tests/support/program.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"

namespace palpate {
namespace {

namespace fs = std::filesystem;
using test::Outcome;
using test::Program;
using test::run_program;
using test::text_of;
using testing::AnyOf;
using testing::ContainsRegex;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;
using Arguments = std::vector<std::string>;

constexpr const char* kPrecious = "precious";

/// One file that a command writes.
struct OutputCase {
  std::string program;
  Arguments arguments;
  std::string option;
  std::string input;      ///< a file that the command reads; empty: it reads none
  bool is_whole = false;  ///< it appears complete or not at all
  Arguments last{};       ///< behind all other arguments
  int success = 0;        ///< exit status with nothing in the way

  [[nodiscard]] std::string name() const {
    return program + " " + (arguments.empty() ? "" : arguments.front() + " ") + option;
  }
  [[nodiscard]] Arguments with(const std::string& file, const Arguments& more = {}) const {
    Arguments all = arguments;
    if (option != "OUT") all.push_back(option);
    all.push_back(file);
    all.insert(all.end(), more.begin(), more.end());
    all.insert(all.end(), last.begin(), last.end());
    return all;
  }
};

/// Reads a pipe from before its writer opens it until after its end.
class PipeReader {
 public:
  explicit PipeReader(const std::string& pipe)
      : file_(open(pipe.c_str(), O_RDONLY | O_NONBLOCK)), thread_([this] { read_all(); }) {}
  ~PipeReader() { static_cast<void>(text()); }
  PipeReader(const PipeReader&) = delete;
  PipeReader& operator=(const PipeReader&) = delete;

  /// Call it when the writer has ended.
  std::string text() {
    has_writer_ended_ = true;
    if (thread_.joinable()) {
      thread_.join();
      close(file_);
    }
    return text_;
  }

 private:
  void read_all() {
    std::vector<char> chunk(65536);
    for (;;) {
      const bool is_last = has_writer_ended_;
      const ssize_t got = read(file_, chunk.data(), chunk.size());
      if (got > 0) {
        text_.append(chunk.data(), static_cast<std::size_t>(got));
      } else if (is_last) {
        return;
      } else {
        std::this_thread::yield();
      }
    }
  }

  std::string text_;
  int file_;
  std::atomic<bool> has_writer_ended_ = false;
  std::thread thread_;
};

class Outputs : public testing::Test {
 protected:
  Outputs() {
    files_.write("omni.txtpb",
                 "device { profile { viscous_newton_s_per_m: 0.1 coulomb_newton: 0.1 "
                 "position_resolution_m: 5e-5 } }\n");
    session_ = files_.write("session.txtpb", R"(
      name: "outputs"
      duration_s: 0.05
      device { profile_file: "omni.txtpb" start_ramp_ms: 0 simulated {} }
      hand { hold { position_m { z: 0.1 } } }
      viewer { web { disabled: true } }
      scene { tissue {
        name: "organ" tetrahedral_mesh { file: "organ.msh" }
        kelvin_voigt { stiffness_newton_per_m: 300 } } })");
    EXPECT_EQ(
        run_program("palpate", {"make-organ", "--mesh", path("organ.msh"), "--subdivisions", "0"})
            .status,
        0);
    EXPECT_EQ(run_program("palpate", {"loopback", session_, "--record", path("run.mcap")}).status,
              0);
    const std::string campaign = files_.write("campaign.txtpb", R"(
      name: "outputs" session: "session.txtpb"
      vary { name: "stiffness" field: "scene.tissue[0].kelvin_voigt.stiffness_newton_per_m"
             values { value: "300" value: "400" } }
      report: "max_force_n")");
    const Arguments sweep{"sweep", campaign, "--folder", path("sweep")};
    const Arguments sweep_report{"sweep", "report", campaign, "--folder", path("sweep")};
    EXPECT_EQ(run_program("palpate", sweep).status, 0);
    const Arguments loopback{"loopback", session_, "--no-ideal"};
    const Arguments viewer{"--session", session_, "--seconds", "0.1"};
    lockstep_ = {
        {"palpate", loopback, "--json", session_, true},
        {"palpate", loopback, "--csv", path("organ.msh"), false},
        {"palpate", loopback, "--record", path("omni.txtpb"), false},
        {"palpate", loopback, "--post-mortem", session_, true},
        {"palpate", {"export", path("run.mcap")}, "--csv", path("run.mcap"), true},
        {"palpate", {"report", path("run.mcap")}, "--output", path("run.mcap"), true},
        {"palpate", {"report", path("run.mcap")}, "-o", path("run.mcap"), true},
        {"palpate", {"export", path("run.mcap")}, "--foxglove", path("run.mcap"), true},
        {"palpate", {"export", path("run.mcap")}, "--ros", path("run.mcap"), true},
        {"palpate", {"cut", path("run.mcap")}, "OUT", path("run.mcap"), true},
        {"palpate", {"recover", path("run.mcap")}, "OUT", path("run.mcap"), true},
        {"palpate", {"merge", path("run.mcap"), path("run.mcap")}, "OUT", path("run.mcap"), true},
        {"palpate", {"identify", session_}, "--output", path("organ.msh"), true},
        {"palpate", {"make-organ", "--points", "50"}, "--cloud", "", true},
        {"palpate", {"make-organ", "--subdivisions", "0"}, "--mesh", "", true},
        {"palpate", sweep, "--csv", path("organ.msh"), true},
        {"palpate", sweep, "--json", campaign, true},
        {"palpate", sweep_report, "--svg", path("sweep/campaign.txt"), true},
        // a program that never answers: it does not take long to find that out
        {.program = "palpate",
         .arguments = {"conform", "physics", "--session", session_},
         .option = "--json",
         .input = path("omni.txtpb"),
         .is_whole = true,
         .last = {"--", "/bin/true"},
         .success = 1},
        {"viewer_node", viewer, "--csv", session_, false},
        {"viewer_node", viewer, "--record", path("omni.txtpb"), false}};
    const Arguments launch{"launch", session_, "--no-realtime", "--seconds", "0.3", "--no-viewer"};
    with_files_ = {{"palpate", launch, "--json", session_, true},
                   {"palpate", launch, "--csv", path("organ.msh"), false},
                   {"palpate", launch, "--record", path("omni.txtpb"), false}};
    files_.write("corner.obj",
                 "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\n"
                 "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
    with_files_.insert(with_files_.begin(), {"palpate",
                                             {"mesh", path("corner.obj"), "--edge-m", "0.01"},
                                             "--output",
                                             path("corner.obj"),
                                             true});
    all_ = lockstep_;
    all_.insert(all_.end(), with_files_.begin(), with_files_.end());
  }

  [[nodiscard]] std::string path(const std::string& name) const {
    return (files_.path() / name).string();
  }
  /// Files of the folder, to find those that a command leaves.
  [[nodiscard]] std::size_t file_count() const {
    return static_cast<std::size_t>(
        std::distance(fs::directory_iterator(files_.path()), fs::directory_iterator()));
  }
  static Outcome run(const OutputCase& output, const std::string& file,
                     const Arguments& more = {}) {
    return run_program(output.program, output.with(file, more));
  }

  test::RunFolder run_folder_;
  test::TempFolder files_;
  std::string session_;
  std::vector<OutputCase> lockstep_;    ///< without nodes, so fast
  std::vector<OutputCase> with_files_;  ///< which write others on the way
  std::vector<OutputCase> all_;
};

TEST_F(Outputs, AnExistingFileStaysAsItIs) {
  for (const OutputCase& output : all_) {
    SCOPED_TRACE(output.name());
    const std::string file = files_.write("old", kPrecious);
    const Outcome outcome = run(output, file);
    EXPECT_EQ(outcome.status, 2);
    EXPECT_THAT(outcome.err, HasSubstr("exists; give another name, or --overwrite"));
    EXPECT_EQ(text_of(file), kPrecious);
  }
}

TEST_F(Outputs, AnExistingFileIsReplacedOnRequest) {
  for (const OutputCase& output : all_) {
    SCOPED_TRACE(output.name());
    const std::string file = files_.write("old", kPrecious);
    const std::size_t files = file_count();
    const Outcome outcome = run(output, file, {"--overwrite"});
    EXPECT_EQ(outcome.status, output.success) << outcome.err;
    const std::string text = text_of(file);
    EXPECT_NE(text, "");
    EXPECT_NE(text.substr(0, std::string(kPrecious).size()), kPrecious);
    EXPECT_EQ(file_count(), files);
  }
}

TEST_F(Outputs, AFileThatIsReadIsNeverReplaced) {
  for (const OutputCase& output : all_) {
    if (output.input.empty()) continue;
    SCOPED_TRACE(output.name());
    const std::string before = text_of(output.input);
    const std::string second_name = path("second_name");
    fs::remove(second_name);
    fs::create_hard_link(output.input, second_name);
    const std::string link = path("link");
    fs::remove(link);
    fs::create_symlink(output.input, link);
    for (const std::string& file : {output.input, second_name, link}) {
      const Outcome outcome = run(output, file, {"--overwrite"});
      EXPECT_EQ(outcome.status, 2) << file;
      EXPECT_THAT(outcome.err, HasSubstr("is read by this command"));
    }
    EXPECT_EQ(text_of(output.input), before);
  }
}

TEST_F(Outputs, AReadOnlyFileStaysAsItIs) {
  for (const OutputCase& output : all_) {
    SCOPED_TRACE(output.name());
    const std::string file = files_.write("old", kPrecious);
    ASSERT_EQ(chmod(file.c_str(), 0444), 0);
    const Outcome outcome = run(output, file, {"--overwrite"});
    EXPECT_EQ(outcome.status, 2);
    EXPECT_THAT(outcome.err, HasSubstr("is read-only"));
    EXPECT_EQ(text_of(file), kPrecious);
    ASSERT_EQ(chmod(file.c_str(), 0644), 0);
  }
}

// A limit of 0 bytes per file stands for the full disk. Standard output is a pipe, without limit.
TEST_F(Outputs, AFullDiskIsAnErrorWithAReason) {
  for (const OutputCase& output : lockstep_) {
    SCOPED_TRACE(output.name());
    const std::string file = files_.write("old", kPrecious);
    const std::size_t files = file_count();
    Arguments arguments{"-c", "set -o pipefail; (ulimit -f 0; exec \"$0\" \"$@\") 2>&1 | cat",
                        test::binary_dir() + "/" + output.program};
    for (const std::string& argument : output.with(file, {"--overwrite"})) {
      arguments.push_back(argument);
    }
    const Outcome outcome = run_program("/bin/bash", arguments);
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.out, HasSubstr(file + ": File too large"));
    if (output.is_whole) {
      EXPECT_EQ(text_of(file), kPrecious);
    }
    EXPECT_EQ(file_count(), files);
  }
}

// The nodes of a launch need files of their own, so here the disk is really full.
TEST_F(Outputs, AFullDiskIsAnErrorOfProgramsWithOtherFilesToo) {
  const std::string disk = path("disk");
  fs::create_directory(disk);
  if (mount("tmpfs", disk.c_str(), "tmpfs", 0, "size=16k") != 0) {
    GTEST_SKIP() << "no file system may be mounted";
  }
  const std::string file = files_.write("disk/old", kPrecious);
  {
    std::ofstream filler(path("disk/filler"));
    while (filler << 'x' << std::flush) {
    }
  }
  for (const OutputCase& output : with_files_) {
    SCOPED_TRACE(output.name());
    const Outcome outcome = run(output, file, {"--overwrite"});
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, HasSubstr(file + ": No space left on device"));
    if (output.is_whole) {
      EXPECT_EQ(text_of(file), kPrecious);
    }
  }
  EXPECT_EQ(umount2(disk.c_str(), MNT_DETACH), 0);
}

TEST_F(Outputs, AFullDeviceIsAnErrorWithAReason) {
  for (const OutputCase& output : all_) {
    SCOPED_TRACE(output.name());
    const Outcome outcome = run(output, "/dev/full");
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, HasSubstr("/dev/full: No space left on device"));
  }
}

TEST_F(Outputs, OneThatFailsCostsNoOther) {
  const std::string session = test::source_dir() + "/deploy/sessions/default.txtpb";
  for (const char* lost : {"--record", "--csv"}) {
    SCOPED_TRACE(lost);
    const std::string json = path(std::string(lost) + ".json");
    const std::string other = path(std::string(lost) + ".other");
    const Outcome outcome = run_program(
        "palpate", {"loopback", session, "--seconds", "0.2", lost, "/dev/full", "--overwrite",
                    std::string(lost) == "--csv" ? "--record" : "--csv", other, "--json", json});
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, HasSubstr("/dev/full: No space left on device"));
    EXPECT_THAT(outcome.out, HasSubstr("least true energy"));
    EXPECT_THAT(text_of(json), HasSubstr("min_true_energy_j"));
    EXPECT_GT(fs::file_size(other), 1000U);
  }
}

TEST_F(Outputs, AnEmptyNameIsRefused) {
  const std::string session = test::source_dir() + "/deploy/sessions/default.txtpb";
  for (const char* option : {"--csv", "--json", "--record"}) {
    const Outcome outcome =
        run_program("palpate", {"loopback", session, "--seconds", "0.2", option, ""});
    EXPECT_EQ(outcome.status, 2) << option;
    EXPECT_THAT(outcome.err, HasSubstr(option)) << option;
    EXPECT_THAT(outcome.err, HasSubstr("is empty")) << option;
  }
}

TEST_F(Outputs, APipeIsWrittenAndKeepsItsName) {
  const std::string pipe = path("pipe");
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  for (const OutputCase& output : all_) {
    SCOPED_TRACE(output.name());
    PipeReader reader(pipe);
    const Outcome outcome = run(output, pipe);
    EXPECT_EQ(outcome.status, output.success) << outcome.err;
    EXPECT_NE(reader.text(), "");
    EXPECT_TRUE(fs::is_fifo(pipe));
  }
}

TEST_F(Outputs, AMinusIsStandardOutputAndNothingElseIsPrintedThere) {
  for (const OutputCase& output : all_) {
    SCOPED_TRACE(output.name());
    const std::string file = path("file");
    fs::remove(file);
    ASSERT_EQ(run(output, file).status, output.success);
    const Outcome outcome = run(output, "-");
    EXPECT_EQ(outcome.status, output.success) << outcome.err;
    // the first bytes: times differ from run to run
    EXPECT_EQ(outcome.out.substr(0, 16), text_of(file).substr(0, 16));
    EXPECT_EQ(outcome.out.back(), text_of(file).back());
    EXPECT_FALSE(fs::exists("-"));
  }
}

TEST_F(Outputs, AFolderThatDoesNotExistIsRefusedBeforeTheRun) {
  for (const OutputCase& output : all_) {
    SCOPED_TRACE(output.name());
    for (const char* file : {"/nonexistent/file", "/tmp"}) {
      EXPECT_EQ(run(output, file).status, 2);
    }
  }
}

TEST_F(Outputs, APipeWithoutAReaderIsAnnounced) {
  const std::string pipe = path("pipe");
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  Program loopback("palpate", {"loopback", session_, "--csv", pipe});
  loopback.await_err("pipe: waiting for a reader of this pipe");
  PipeReader reader(pipe);
  EXPECT_EQ(loopback.wait(), 0);
  EXPECT_THAT(reader.text(), HasSubstr("t_s,x_m"));
}

TEST_F(Outputs, TextThatStandardOutputLosesIsAnError) {
  const std::string palpate = test::binary_dir() + "/palpate";
  for (const char* arguments : {"--help", "--version", "doctor", "launch --help"}) {
    SCOPED_TRACE(arguments);
    const Outcome outcome =
        run_program("/bin/bash", {"-c", palpate + " " + arguments + " > /dev/full"});
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, HasSubstr("standard output"));
  }
  for (const Arguments& arguments : {Arguments{"loopback", session_},
                                     {"scene", "check", session_},
                                     {"info", path("run.mcap")},
                                     {"loopback", session_, "--csv", "-"},
                                     {"export", path("run.mcap"), "--csv", "-"},
                                     {"make-organ", "--points", "50", "--cloud", "-"}}) {
    SCOPED_TRACE(arguments.front());
    Arguments words{"-c", "exec \"$0\" \"$@\" > /dev/full", palpate};
    words.insert(words.end(), arguments.begin(), arguments.end());
    const Outcome outcome = run_program("/bin/bash", words);
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, HasSubstr("No space left on device"));
  }
}

// As of `| head` once it has enough. The pipe has no reader from the start.
TEST_F(Outputs, AReaderOfStandardOutputMayLeave) {
  const std::string pipe = path("pipe");
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  for (const OutputCase& output : all_) {
    SCOPED_TRACE(output.name());
    Arguments words{"-c", "exec 3<>\"$0\" 4>\"$0\" 3>&-; exec \"$@\" >&4 4>&-", pipe,
                    test::binary_dir() + "/" + output.program};
    const Arguments arguments = output.with("-");
    words.insert(words.end(), arguments.begin(), arguments.end());
    const Outcome outcome = run_program("/bin/bash", words);
    EXPECT_EQ(outcome.status, output.success);
    EXPECT_THAT(outcome.err,
                Not(AnyOf(HasSubstr("roken pipe"), HasSubstr("missing"), HasSubstr("incomplete"))));
  }
}

TEST_F(Outputs, ARunWithoutOtherOutputEndsWhenItsReaderLeaves) {
  Program loopback("/bin/bash", {"-c",
                                 "set -o pipefail; \"$0\" loopback \"$1\" --seconds 1e6 --no-ideal "
                                 "--csv - | head -n 1",
                                 test::binary_dir() + "/palpate", session_});
  EXPECT_EQ(loopback.wait(), 0);
  EXPECT_EQ(loopback.err(), "");
  EXPECT_THAT(loopback.out(), StartsWith("t_s,x_m"));
}

TEST_F(Outputs, EachFileIsNamed) {
  for (const OutputCase& output : all_) {
    const std::string& command = output.arguments.front();
    if (output.program != "palpate" || command == "conform" || command == "mesh") continue;
    SCOPED_TRACE(output.name());
    const std::string file = path("new");
    fs::remove(file);
    const Outcome outcome = run(output, file);
    ASSERT_EQ(outcome.status, output.success) << outcome.err;
    EXPECT_THAT(outcome.out + outcome.err,
                AnyOf(HasSubstr("palpate: " + file + ": written\n"), HasSubstr("wrote " + file),
                      ContainsRegex(file + ": [0-9]+ messages written")));
  }
}

TEST_F(Outputs, TwoOutputsNeedTwoFiles) {
  for (const std::string& file : {path("both"), std::string("-")}) {
    const Outcome outcome =
        run_program("palpate", {"loopback", session_, "--csv", file, "--json", file});
    EXPECT_EQ(outcome.status, 2);
    EXPECT_THAT(outcome.err, HasSubstr("both name"));
  }
}

// --- Ctrl-C -------------------------------------------------------------------------------------

TEST_F(Outputs, CtrlCKeepsWhatThereIs) {
  Program loopback(
      "palpate", {"loopback", session_, "--seconds", "1e6", "--no-ideal", "--csv", path("part.csv"),
                  "--json", path("part.json"), "--record", path("part.mcap")});
  ASSERT_TRUE(test::await([&] {
    std::error_code error;
    return fs::file_size(path("part.csv"), error) > 100'000 && !error;
  }));
  loopback.send_signal(SIGINT);

  EXPECT_EQ(loopback.wait(), 0) << loopback.err();
  EXPECT_THAT(loopback.err(), HasSubstr("palpate: stopped after"));
  EXPECT_THAT(loopback.out(), HasSubstr("transparency"));
  EXPECT_THAT(text_of(path("part.json")), HasSubstr("\"transparency\""));
  EXPECT_EQ(text_of(path("part.csv")).back(), '\n');
  EXPECT_THAT(run_program("palpate", {"info", path("part.mcap"), "--json"}).out,
              HasSubstr("\"is_whole\": true"));
}

TEST_F(Outputs, QuietRunsPrintNothing) {
  const Outcome loopback = run_program("palpate", {"loopback", session_, "-q"});
  EXPECT_EQ(loopback.status, 0);
  EXPECT_EQ(loopback.out + loopback.err, "");

  const Outcome launch =
      run_program("palpate", {"-q", "launch", session_, "--no-realtime", "--seconds", "0.5"});
  EXPECT_EQ(launch.status, 0);
  EXPECT_EQ(launch.out, "");
  EXPECT_THAT(launch.err, testing::Not(HasSubstr(" info ")));
}

TEST_F(Outputs, VerboseRunsNameTheFilesTheyRead) {
  const Outcome loopback = run_program("palpate", {"loopback", session_, "--verbose"});
  for (const std::string& file : {session_, path("omni.txtpb"), path("organ.msh")}) {
    EXPECT_THAT(loopback.err, HasSubstr("reads " + file));
  }
}

}  // namespace
}  // namespace palpate
