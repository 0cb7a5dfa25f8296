#include <string>

#include "common/core/user/output_file.h"
#include "common/process/options.h"
#include "common/process/terminal.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/options.h"
#include "deploy/palpate/recording_info.h"

namespace palpate {
namespace {

struct ExportCommand {
  std::string file;
  std::string side;
  std::string csv_file;
  bool may_overwrite = false;

  void add_to(CLI::App& app) {
    add_recording_argument(app, file);
    add_side_option(app, side);
    app.add_option("--csv", csv_file,
                   "write one row per device tick to this file, - for standard output, with the "
                   "columns of launch and "
                   "loopback")
        ->required()
        ->type_name("FILE");
    add_overwrite_flag(app, may_overwrite);
  }
  int run(const Verbosity& verbosity) const {
    check_outputs({{"--csv", csv_file}}, {file}, may_overwrite);
    RecordingFile recording(file);
    recording.choose_side(side);
    Progress progress("export", verbosity.is_quiet);
    export_csv(recording, csv_file, may_overwrite, [&](double ratio) { progress.show(ratio); });
    return 0;
  }
};

}  // namespace

Command add_export_command(CLI::App& app) {
  return add_command<ExportCommand>(app, "export", "write a recording as a table");
}

}  // namespace palpate
