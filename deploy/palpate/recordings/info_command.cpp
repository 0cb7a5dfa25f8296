// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <optional>
#include <string>
#include <utility>

#include "common/process/terminal.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/options.h"
#include "deploy/palpate/recordings/recording_info.h"

namespace palpate {
namespace {

struct InfoCommand {
  std::string file;
  bool is_json = false;

  void add_to(CLI::App& app) {
    add_recording_argument(app, file);
    app.add_flag("--json", is_json, "print JSON");
  }
  int run(const Verbosity& verbosity) const {
    RecordingFile recording(file);
    std::optional<BusyLine> busy(std::in_place, "info", verbosity.is_quiet);
    const std::string text = is_json ? info_json(recording).dump(2) + "\n" : info_text(recording);
    busy.reset();
    std::fputs(text.c_str(), stdout);
    return status_of_damage(recording);
  }
};

}  // namespace

Command add_info_command(CLI::App& app) {
  return add_command<InfoCommand>(app, "info", "print what a recording contains");
}

}  // namespace palpate
