#include "viewer_node/recording/report.h"

#include <string>

#include "common/core/user/output_file.h"
#include "common/process/options.h"
#include "common/process/terminal.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/options.h"
#include "viewer_node/recording/recording_file.h"

namespace palpate {
namespace {

struct ReportCommand {
  std::string file;
  std::string side;
  std::string output;
  bool may_overwrite = false;

  void add_to(CLI::App& app) {
    add_recording_argument(app, file);
    add_side_option(app, side);
    app.add_option("-o,--output", output,
                   "write one self-contained HTML file; - for standard output")
        ->required()
        ->type_name("FILE");
    add_overwrite_flag(app, may_overwrite);
  }
  int run(const Verbosity& verbosity) const {
    check_outputs({{"--output", output}}, {file}, may_overwrite);
    RecordingFile recording(file);
    recording.choose_side(side);
    Progress progress("report", verbosity.is_quiet);
    const std::string html = report_html(recording, [&](double ratio) { progress.show(ratio); });
    write_file("report", output, html, may_overwrite);
    return 0;
  }
};

}  // namespace

Command add_report_command(CLI::App& app) {
  return add_command<ReportCommand>(app, "report",
                                    "write the figures of a recording as one HTML file");
}

}  // namespace palpate
