// SPDX-License-Identifier: Apache-2.0
#include <string>

#include "common/core/check.h"
#include "common/core/user/output_file.h"
#include "common/process/options.h"
#include "common/process/terminal.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/options.h"
#include "deploy/palpate/recordings/recording_info.h"
#include "viewer_node/recording/foxglove_export.h"
#include "viewer_node/recording/ros_export.h"

namespace palpate {
namespace {

struct ExportCommand {
  std::string file;
  std::string side;
  std::string csv_file;
  std::string foxglove_file;
  std::string ros_file;
  bool may_overwrite = false;

  void add_to(CLI::App& app) {
    add_recording_argument(app, file);
    add_side_option(app, side);
    app.add_option("--csv", csv_file,
                   "write one row per device tick to this file, - for standard output, with the "
                   "columns of launch and loopback")
        ->type_name("FILE");
    app.add_option("--foxglove", foxglove_file,
                   "write a recording for Foxglove, Lichtblick and Rerun: the scene in 3-D, the "
                   "scalars of every tick and the log, of all sides; - for standard output")
        ->type_name("FILE");
    app.add_option("--ros", ros_file,
                   "write a recording for tools of ROS 2: pose, commanded and applied force of "
                   "every tick, of all sides; - for standard output")
        ->type_name("FILE");
    add_overwrite_flag(app, may_overwrite);
  }
  int run(const Verbosity& verbosity) const {
    if (csv_file.empty() && foxglove_file.empty() && ros_file.empty()) {
      throw SetupError("export: nothing to write; give --csv, --foxglove or --ros FILE");
    }
    check_outputs({{"--csv", csv_file}, {"--foxglove", foxglove_file}, {"--ros", ros_file}}, {file},
                  may_overwrite);
    RecordingFile recording(file);
    Progress progress("export", verbosity.is_quiet);
    const auto show = [&](double ratio) { progress.show(ratio); };
    if (!foxglove_file.empty()) export_foxglove(recording, foxglove_file, may_overwrite, show);
    if (!ros_file.empty()) export_ros(recording, ros_file, may_overwrite, show);
    if (!csv_file.empty()) {
      recording.choose_side(side);
      export_csv(recording, csv_file, may_overwrite, show);
    }
    say_written({foxglove_file, ros_file, csv_file}, verbosity);
    return status_of_damage(recording);
  }
};

}  // namespace

Command add_export_command(CLI::App& app) {
  return add_command<ExportCommand>(app, "export",
                                    "write a recording as a table, for Foxglove, or for ROS");
}

}  // namespace palpate
