// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/recording/report.h"

#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "common/core/user/output_file.h"
#include "common/process/options.h"
#include "common/process/terminal.h"
#include "deploy/lockstep/recompute.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/options.h"
#include "device_node/post_mortem.h"
#include "viewer_node/recording/recording_file.h"
#include "viewer_node/task/recorded_score.h"

namespace palpate {
namespace {

struct ReportCommand {
  std::vector<std::string> files;  // one, or two to compare
  std::string side;
  std::string output;
  bool may_overwrite = false;
  bool is_recomputed = false;

  void add_to(CLI::App& app) {
    app.add_option(
           "FILE", files,
           "recording (*.mcap), two are shown side by side; or flight-device-*.csv of a "
           "fault, which is printed and computed again: status 1 if that is not the same, or "
           "if anything is missing")
        ->required()
        ->expected(1, 2)
        ->type_name("");
    add_side_option(app, side);
    app.add_option("-o,--output", output,
                   "write one self-contained HTML file; - for standard output")
        ->type_name("FILE");
    app.add_flag("--recompute", is_recomputed,
                 "compute energies and figures again from what acted, and print whether they are "
                 "as recorded; status 1 if not");
    add_overwrite_flag(app, may_overwrite);
  }
  int run(const Verbosity& verbosity) const {
    if (files.size() == 1 && device::is_fault_file(files.front())) return report_fault(verbosity);
    if (output.empty() && !is_recomputed) {
      throw SetupError("report: give --output FILE, --recompute, or both");
    }
    if (!output.empty()) check_outputs({{"--output", output}}, files, may_overwrite);
    std::vector<std::unique_ptr<RecordingFile>> recordings;
    for (const std::string& file : files) {
      recordings.push_back(std::make_unique<RecordingFile>(file));
      recordings.back()->choose_side(side);
    }
    int status = 0;
    for (const auto& recording : recordings) {
      if (is_recomputed) status = std::max(status, recompute_one(*recording, verbosity));
    }
    if (!output.empty()) {
      Progress progress("report", verbosity.is_quiet);
      std::vector<ReportSection> sections;
      sections.reserve(recordings.size());
      for (const auto& recording : recordings) sections.push_back(task_section(*recording));
      const std::string html = report_html(
          recordings, [&](double ratio) { progress.show(ratio); }, sections);
      write_file("report", output, html, may_overwrite);
      say_written({output}, verbosity);
    }
    for (const auto& recording : recordings) {
      status = std::max(status, status_of_damage(*recording));
    }
    return status;
  }

 private:
  static ReportSection task_section(RecordingFile& recording) {
    if (!has_task(recording)) return {};
    const TaskScore score = score_of(recording);
    return {.title = "Task", .sentences = findings_of(score), .figures = figures_of(score)};
  }
  /// @return  1: the fault or what the monitor decided is not reproduced, or not compared
  [[nodiscard]] int report_fault(const Verbosity& verbosity) const {
    const device::FaultFile file = device::read_fault_file(files.front());
    const device::Recomputed recomputed = device::recompute_fault(file);
    const std::string text = device::fault_text(file, recomputed);
    if (output.empty() || output == "-") {
      std::fputs(text.c_str(), stdout);
    } else {
      check_outputs({{"--output", output}}, files, may_overwrite);
      write_file("report", output, text, may_overwrite);
      say_written({output}, verbosity);
    }
    return recomputed.is_same() ? 0 : 1;
  }
  [[nodiscard]] int recompute_one(RecordingFile& recording, const Verbosity& verbosity) const {
    Progress progress("recomputing", verbosity.is_quiet);
    const Recomputed recomputed =
        recompute(recording, with_only_side(recorded_session(recording), side),
                  [&](double ratio) { progress.show(ratio); });
    // beside a page on standard output there is no room for text
    const bool is_page = output == "-";
    std::fputs((recording.mcap().path() + "\n" + recomputed_text(recomputed)).c_str(),
               is_page ? stderr : stdout);
    return recomputed.is_same() ? 0 : 1;
  }
};

}  // namespace

Command add_report_command(CLI::App& app) {
  return add_command<ReportCommand>(
      app, "report", "write the figures of a recording, or of two, as one HTML file");
}

}  // namespace palpate
