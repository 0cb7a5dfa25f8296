// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/recording/report.h"

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "common/core/user/output_file.h"
#include "common/process/options.h"
#include "common/process/terminal.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/options.h"
#include "viewer_node/recording/recording_file.h"

namespace palpate {
namespace {

struct ReportCommand {
  std::vector<std::string> files;  // one, or two to compare
  std::string side;
  std::string output;
  bool may_overwrite = false;

  void add_to(CLI::App& app) {
    app.add_option("FILE", files, "recording (*.mcap); two are shown side by side")
        ->required()
        ->expected(1, 2)
        ->type_name("");
    add_side_option(app, side);
    app.add_option("-o,--output", output,
                   "write one self-contained HTML file; - for standard output")
        ->required()
        ->type_name("FILE");
    add_overwrite_flag(app, may_overwrite);
  }
  int run(const Verbosity& verbosity) const {
    check_outputs({{"--output", output}}, files, may_overwrite);
    std::vector<std::unique_ptr<RecordingFile>> recordings;
    for (const std::string& file : files) {
      recordings.push_back(std::make_unique<RecordingFile>(file));
      recordings.back()->choose_side(side);
    }
    Progress progress("report", verbosity.is_quiet);
    const std::string html = report_html(recordings, [&](double ratio) { progress.show(ratio); });
    write_file("report", output, html, may_overwrite);
    if (!verbosity.is_quiet && output != "-") say(output + ": written");
    int status = 0;
    for (const auto& recording : recordings) {
      status = std::max(status, status_of_damage(*recording));
    }
    return status;
  }
};

}  // namespace

Command add_report_command(CLI::App& app) {
  return add_command<ReportCommand>(
      app, "report", "write the figures of a recording, or of two, as one HTML file");
}

}  // namespace palpate
