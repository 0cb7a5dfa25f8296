// SPDX-License-Identifier: Apache-2.0
#include <spdlog/fmt/fmt.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "common/core/user/output_file.h"
#include "common/process/options.h"
#include "common/process/run_node.h"
#include "common/process/terminal.h"
#include "common/session/session_file.h"
#include "common/task/score.h"
#include "deploy/lockstep/loopback.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/options.h"
#include "deploy/palpate/study/simulated_participant.h"
#include "deploy/palpate/study/trial_launch.h"
#include "deploy/study/folder.h"
#include "deploy/study/plan.h"
#include "deploy/study/study_report.h"
#include "viewer_node/recording/recording_file.h"
#include "viewer_node/task/recorded_score.h"

namespace palpate {
namespace {

using study::Folder;
using study::Plan;
using study::Trial;

/// What `palpate study` and `palpate study report` share.
struct StudyOptions {
  std::string file;
  std::string folder;

  void add_to(CLI::App& app, bool is_required) {
    CLI::Option* const option = app.add_option("PLAN", file, "plan of a study (*.txtpb)");
    option->type_name("");
    if (is_required) option->required();
    app.add_option("--folder", folder,
                   "where the results are kept and found again (default: NAME.study here)")
        ->type_name("DIR");
  }
  [[nodiscard]] std::string folder_of(const Plan& plan) const {
    return folder.empty() ? plan.name + ".study" : folder;
  }
};

void say_of_older_key(const Folder& folder) {
  if (folder.key().is_square_dealt) return;
  say(folder.path().string() +
      ": was made by an older version, whose order of conditions follows the plan: who knows the "
      "plan can tell the codes from it; it goes on as it began, and a new folder is blind");
}

/// @return  whether there are none
bool said_what_is_left_out(const Folder& folder) {
  const std::vector<study::LeftOut> all = folder.left_out();
  for (const study::LeftOut& one : all) {
    say(fmt::format(
        "{} is missing, so what follows of that participant does not count: trial{} {}; "
        "put it back, or remove the folders of the trials behind it",
        one.missing.string(), one.trials.size() > 1 ? "s" : "", fmt::join(one.trials, ", ")));
  }
  return all.empty();
}

struct StudyReportCommand {
  StudyOptions study;
  std::string csv_file;
  bool is_open = false;
  bool is_simulated = false;
  bool may_overwrite = false;

  void add_to(CLI::App& app) {
    study.add_to(app, true);
    app.add_option("--csv", csv_file, "write one row a trial to this file; - for standard output")
        ->type_name("FILE");
    app.add_flag("--simulated", is_simulated,
                 "of the participants of --loopback instead of people");
    app.add_flag("--unblind", is_open, "name the conditions instead of their codes");
    add_overwrite_flag(app, may_overwrite);
  }

  [[nodiscard]] int run(const Verbosity& verbosity) const {
    const Plan plan = study::load_plan(study.file);
    const std::string path = study.folder_of(plan);
    if (!std::filesystem::exists(path)) {
      throw SetupError(path +
                       ": no results yet; make some with `palpate study`, or name their "
                       "folder with --folder");
    }
    const Folder folder(path, plan, is_simulated);
    std::vector<std::string> inputs = folder.files();
    inputs.insert(inputs.end(), plan.files.begin(), plan.files.end());
    inputs.push_back(study.file);
    check_outputs({{"--csv", csv_file}}, inputs, may_overwrite);
    if (!verbosity.is_quiet) say_of_older_key(folder);
    if (csv_file != kStandardOutput && !verbosity.is_quiet) {
      std::fputs(summary_text(plan, folder, is_open).c_str(), stdout);
    }
    if (!csv_file.empty()) {
      write_file("csv file", csv_file, table_csv(plan, folder, is_open), may_overwrite);
    }
    say_written({csv_file}, verbosity);
    return said_what_is_left_out(folder) ? 0 : kExitFailure;
  }
};

struct StudyCommand {
  StudyOptions study;
  std::uint64_t participant = 0;
  std::uint64_t most_trials = 0;
  bool is_loopback = false;
  SimulatedParticipant simulated;

  void add_to(CLI::App& app) {
    study.add_to(app, false);
    app.add_option("--participant", participant, "a number: who does the trials")
        ->type_name("N")
        ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{999}));
    app.add_option("--trials", most_trials, "do at most so many trials now")
        ->type_name("N")
        ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{100'000}));
    auto* const loopback = app.add_flag("--loopback", is_loopback,
                                        "with the simulated hand of the session, in lockstep; kept "
                                        "apart from the trials of people");
    app.add_option("--weber", simulated.weber_ratio,
                   "of a simulated participant of a staircase: he compares the largest force over "
                   "the target and elsewhere, each with noise of this share of it")
        ->type_name("SHARE")
        ->check(CLI::Range(0.0, 10.0))
        ->needs(loopback);
    app.add_option("--hand-noise-mm", simulated.hand_noise_mm,
                   "of a simulated hand with a recorded path: noise of its points, mm")
        ->type_name("MM")
        ->check(CLI::Range(0.0, 50.0))
        ->needs(loopback);
  }

  [[nodiscard]] int run(const Verbosity& verbosity) const {
    if (study.file.empty()) throw SetupError("palpate study: give a plan (*.txtpb)");
    if (participant == 0) {
      throw SetupError("palpate study: give --participant N, a number and no name");
    }
    const Plan plan = study::load_plan(study.file);
    if (simulated.weber_ratio > 0.0 && !plan.staircase) {
      throw SetupError(
          "--weber: the plan has no staircase, so nothing is compared; leave it out, or give "
          "staircase { … }");
    }
    const Folder folder(study.folder_of(plan), plan, is_loopback);
    const study::ParticipantLock lock(folder, participant);
    if (!verbosity.is_quiet) {
      for (const std::string& note : plan.notes) say(note);
      say_of_older_key(folder);
      said_what_is_left_out(folder);
    }
    study::Series series(plan, folder.key().square, participant);
    for (const study::TrialRow& row : folder.rows(participant)) series.take(row.is_right);
    const StopSignal stop;
    std::uint64_t done = 0;
    while (const auto trial = series.next()) {
      if (most_trials > 0 && done == most_trials) return said_to_go_on(*trial, verbosity);
      if (!verbosity.is_quiet) {
        say(fmt::format("participant {}, trial {}", participant, trial->number));
      }
      std::optional<Answer> answer;
      try {
        answer = do_trial(plan, folder, *trial, verbosity);
      } catch (const SetupError&) {
        throw;
      } catch (const std::runtime_error& error) {
        say(error.what());
        say("so the trial does not count: make room if the disk is full, and do it again");
      }
      if (!answer) {
        said_to_go_on(*trial, verbosity);
        return kExitFailure;
      }
      series.take(answer->is_right);
      ++done;
    }
    if (!verbosity.is_quiet) {
      std::printf("%sparticipant %llu has done all trials\n", is_loopback ? "simulated " : "",
                  static_cast<unsigned long long>(participant));
    }
    return 0;
  }

 private:
  struct Answer {
    std::optional<bool> is_right{};
  };

  int said_to_go_on(const Trial& trial, const Verbosity& verbosity) const {
    if (!verbosity.is_quiet) {
      say(fmt::format("{}participant {} goes on with trial {}: the same command",
                      is_loopback ? "simulated " : "", participant, trial.number));
    }
    return 0;
  }

  /// None: it was cut off and is to be done again.
  [[nodiscard]] std::optional<Answer> do_trial(const Plan& plan, const Folder& folder,
                                               const Trial& trial,
                                               const Verbosity& verbosity) const {
    const std::filesystem::path place = folder.begin(trial);
    const std::string recording = (place / "run.mcap").string();
    const std::string messages = (place / "messages.txt").string();
    const std::vector<std::string> overrides = trial.overrides(plan);
    if (is_loopback) {
      if (!run_in_lockstep(plan, trial, overrides, recording)) return std::nullopt;
    } else if (!launch_trial({.session_file = plan.session_file.string(),
                              .overrides = overrides,
                              .seconds = plan.seconds,
                              .recording = recording,
                              .messages = messages,
                              .is_quiet = verbosity.is_quiet})) {
      if (!StopSignal::is_requested()) {
        for (const std::string& cause : harmless_causes(place, messages)) say(cause);
        say("the trial failed and does not count; what it said, which can tell the condition, is "
            "in " +
            messages);
      }
      return std::nullopt;
    }
    RecordingFile file(recording);
    file.choose_side("");
    const TaskScore score = score_of(file);
    const bool has_ended =
        score.end == TaskScore::End::kStopped || score.end == TaskScore::End::kTimeUp ||
        (score.end == TaskScore::End::kRunEnded && (is_loopback || plan.seconds.has_value()));
    if (!has_ended) {
      say("the task was not done, so the trial does not count");
      return std::nullopt;
    }
    Answer answer;
    if (plan.staircase) {
      answer.is_right = is_loopback && simulated.weber_ratio > 0.0
                            ? simulated.is_right(score, trial.seed(plan))
                            : first_mark_is_right(score);
    }
    folder.keep(trial, score, answer.is_right);
    return answer;
  }

  /// False: it was stopped.
  [[nodiscard]] bool run_in_lockstep(const Plan& plan, const Trial& trial,
                                     const std::vector<std::string>& overrides,
                                     const std::string& recording) const {
    Session session = load_session(plan.session_file, overrides);
    simulated.move_hand(session, trial.seed(plan));
    LoopbackOptions options{.seconds = plan.seconds};
    options.record.file = recording;
    options.lockstep.has_ideal = false;
    options.may_go_on = [](double) { return !StopSignal::is_requested(); };
    static_cast<void>(run_loopback(session, options));
    return !StopSignal::is_requested();
  }
};

}  // namespace

Command add_study_command(CLI::App& app) {
  CLI::App& parser = *app.add_subcommand(
      "study", "do the trials of a study: conditions in balanced order, blind, resumable");
  auto command = std::make_shared<StudyCommand>();
  command->add_to(parser);
  refuse_empty_files(parser);
  CLI::App& report = *parser.add_subcommand("report", "what a study has measured so far");
  auto report_command = std::make_shared<StudyReportCommand>();
  report_command->add_to(report);
  refuse_empty_files(report);
  return {&parser, [&report, command, report_command](const Verbosity& verbosity) {
            return report.parsed() ? report_command->run(verbosity) : command->run(verbosity);
          }};
}

}  // namespace palpate
