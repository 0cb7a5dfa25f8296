// SPDX-License-Identifier: Apache-2.0
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <string>
#include <thread>
#include <vector>

#include "common/core/clock.h"
#include "common/core/user/output_file.h"
#include "common/process/options.h"
#include "common/process/terminal.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/options.h"
#include "deploy/palpate/stations/station.h"

namespace palpate {
namespace {

constexpr Duration kPatience = std::chrono::milliseconds(900);
constexpr Duration kInterval = std::chrono::seconds(1);
constexpr std::chrono::milliseconds kPoll{50};

struct StationsCommand {
  std::vector<std::string> texts;
  std::string csv_file;
  bool is_once = false;
  bool may_overwrite = false;

  void add_to(CLI::App& app) {
    app.add_option("STATION", texts, "addresses of pages: [NAME=]http://HOST:PORT/?token=…")
        ->required()
        ->type_name("");
    app.add_flag("--once", is_once, "ask once, and end");
    app.add_option("--csv", csv_file,
                   "write the last table to this file at the end; - for standard output")
        ->type_name("FILE");
    add_overwrite_flag(app, may_overwrite);
  }

  [[nodiscard]] int run(const Verbosity& verbosity) const {
    std::vector<Station> stations;
    for (const std::string& text : texts) stations.push_back(station_of(text));
    check_outputs({{"--csv", csv_file}}, {}, may_overwrite);
    const StopSignal stop;
    const SteadyClock clock;
    const bool is_live = !is_once && isatty(STDOUT_FILENO) == 1;
    std::vector<StationAnswer> answers;
    do {
      const TimePoint next = clock.now() + kInterval;
      answers = ask(stations, kPatience);
      if (csv_file != kStandardOutput) {
        // on a terminal the table stays where it is
        if (is_live) std::fputs("\033[H\033[J", stdout);
        std::fputs(stations_text(stations, answers).c_str(), stdout);
        std::fflush(stdout);
      }
      while (!is_once && !StopSignal::is_requested() && clock.now() < next) {
        std::this_thread::sleep_for(kPoll);
      }
    } while (!is_once && !StopSignal::is_requested());
    if (!csv_file.empty()) {
      write_file("csv file", csv_file, stations_csv(stations, answers), may_overwrite);
    }
    say_written({csv_file}, verbosity);
    return 0;
  }
};

}  // namespace

Command add_stations_command(CLI::App& app) {
  return add_command<StationsCommand>(
      app, "stations", "the tasks of many stations as one table, live, for a teacher");
}

}  // namespace palpate
