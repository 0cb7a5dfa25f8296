#include <string>

#include "common/core/files.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/options.h"
#include "deploy/palpate/recording_info.h"

namespace palpate {
namespace {

struct ExportCommand {
  std::string file;
  std::string side;
  std::string csv_file;

  void add_to(CLI::App& app) {
    add_recording_argument(app, file);
    add_side_option(app, side);
    app.add_option("--csv", csv_file,
                   "write one row per device tick to this file, with the columns of launch and "
                   "loopback")
        ->required()
        ->type_name("FILE");
  }
  int run() const {
    refuse_shared_file({{"FILE", file}, {"--csv", csv_file}});
    RecordingFile recording(file);
    recording.choose_side(side);
    export_csv(recording, csv_file);
    return 0;
  }
};

}  // namespace

Command add_export_command(CLI::App& app) {
  return add_command<ExportCommand>(app, "export", "write a recording as a table");
}

}  // namespace palpate
