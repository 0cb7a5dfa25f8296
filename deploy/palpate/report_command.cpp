#include "viewer_node/recording/report.h"

#include <string>

#include "common/core/files.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/options.h"
#include "viewer_node/recording/recording_file.h"

namespace palpate {
namespace {

struct ReportCommand {
  std::string file;
  std::string side;
  std::string output;

  void add_to(CLI::App& app) {
    add_recording_argument(app, file);
    add_side_option(app, side);
    app.add_option("-o,--output", output, "write one self-contained HTML file")
        ->required()
        ->type_name("FILE");
  }
  int run() const {
    refuse_shared_file({{"FILE", file}, {"--output", output}});
    RecordingFile recording(file);
    recording.choose_side(side);
    write_report(recording, output);
    return 0;
  }
};

}  // namespace

Command add_report_command(CLI::App& app) {
  return add_command<ReportCommand>(app, "report",
                                    "write the figures of a recording as one HTML file");
}

}  // namespace palpate
