// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "common/core/user/output_file.h"
#include "common/process/options.h"
#include "common/process/run_node.h"
#include "common/process/terminal.h"
#include "common/task/score.h"
#include "common/task/score_table.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/options.h"
#include "viewer_node/recording/recording_file.h"
#include "viewer_node/task/class_page.h"
#include "viewer_node/task/recorded_score.h"

namespace palpate {
namespace {

struct ScoreCommand {
  std::vector<std::string> files;
  std::string csv_file;
  std::string regions_file;
  std::string json_file;
  std::string html_file;
  bool is_compared = false;
  bool may_overwrite = false;

  void add_to(CLI::App& app) {
    app.add_option("FILE", files, "recordings (*.mcap) of sessions with a task")
        ->required()
        ->type_name("");
    app.add_flag("--compare", is_compared,
                 "print the figures of the runs beside each other, one column a run");
    app.add_option("--csv", csv_file, "write one row a run to this file; - for standard output")
        ->type_name("FILE");
    app.add_option(
           "--regions", regions_file,
           "write one row for each lesion or layer of each run, with its difficulty and the "
           "forces over it, to this file; - for standard output")
        ->type_name("FILE");
    app.add_option("--json", json_file, "write the scores to this file; - for standard output")
        ->type_name("FILE");
    app.add_option("--html", html_file,
                   "write all of it to this file as one page that loads nothing; - for standard "
                   "output")
        ->type_name("FILE");
    add_overwrite_flag(app, may_overwrite);
  }

  int run(const Verbosity& verbosity) const {
    check_outputs({{"--csv", csv_file},
                   {"--regions", regions_file},
                   {"--json", json_file},
                   {"--html", html_file}},
                  files, may_overwrite);
    std::set<std::filesystem::path> runs;
    for (const std::string& file : files) {
      if (!runs.insert(std::filesystem::weakly_canonical(file)).second) {
        throw SetupError("recording " + file +
                         ": it is given twice, and would count twice; give each once");
      }
    }
    OutputOptions output;
    output.json_file = json_file;
    output.may_overwrite = may_overwrite;
    JsonOutput json(output);
    std::vector<NamedScore> scores;
    int status = 0;
    Progress progress("score", verbosity.is_quiet);
    for (const std::string& file : files) {
      try {
        RecordingFile recording(file);
        recording.choose_side("");
        const auto done = static_cast<double>(scores.size());
        const auto all = static_cast<double>(files.size());
        scores.push_back({file, score_of(recording, [&](double ratio) {
                            progress.show((done + ratio) / all);
                          })});
        status = std::max(status, status_of_damage(recording));
      } catch (const SetupError& error) {  // the others of a class count all the same
        if (files.size() == 1) throw;
        say(std::string("not scored: ") + error.what());
        status = kExitSetupError;
      }
    }
    if (scores.empty()) throw SetupError("no recording could be scored; see above");
    const bool prints = csv_file != kStandardOutput && regions_file != kStandardOutput &&
                        json_file != kStandardOutput && html_file != kStandardOutput;
    if (prints && !verbosity.is_quiet) std::fputs(text_of(scores).c_str(), stdout);
    if (!csv_file.empty()) write_file("csv file", csv_file, table_csv(scores), may_overwrite);
    if (!regions_file.empty()) {
      write_file("csv file", regions_file, regions_csv(scores), may_overwrite);
    }
    if (!html_file.empty()) write_file("html file", html_file, class_html(scores), may_overwrite);
    json.write(table_json(scores));
    say_written({csv_file, regions_file, json_file, html_file}, verbosity);
    return status;
  }

 private:
  [[nodiscard]] std::string text_of(const std::vector<NamedScore>& scores) const {
    if (is_compared) return compared_text(scores);
    if (scores.size() == 1) return score_text(scores.front().score);
    return table_text(scores);
  }
};

}  // namespace

Command add_score_command(CLI::App& app) {
  return add_command<ScoreCommand>(app, "score",
                                   "score the task of a recording, or of many in one table");
}

}  // namespace palpate
