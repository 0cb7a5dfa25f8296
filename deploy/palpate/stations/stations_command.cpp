// SPDX-License-Identifier: Apache-2.0
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "common/core/check.h"
#include "common/core/clock.h"
#include "common/core/user/output_file.h"
#include "common/process/options.h"
#include "common/process/terminal.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/options.h"
#include "deploy/palpate/stations/station.h"
#include "viewer_node/server/web_server.h"

// the files of report_assets.S
extern "C" const char palpate_report_css[], palpate_report_css_end[];
extern "C" const char palpate_stations_html[], palpate_stations_html_end[];
extern "C" const char palpate_stations_js[], palpate_stations_js_end[];

namespace palpate {
namespace {

constexpr Duration kPatience = std::chrono::milliseconds(900);
constexpr Duration kInterval = std::chrono::seconds(1);
constexpr std::chrono::milliseconds kPoll{50};

/// The table as a page, for this machine alone.
class StationsPage {
 public:
  explicit StationsPage(std::uint16_t port)
      : server_(
            {.port = port, .rules = {.hosts = {}, .origins = {}, .token = {}, .assets = kAssets}},
            {}) {}

  [[nodiscard]] static bool is_built() { return !kAssets.front().bytes.empty(); }
  [[nodiscard]] std::string url() const { return server_.url(); }
  void show(const std::string& table) { server_.set_task(table); }

 private:
  static std::string_view text(const char* begin, const char* end) {
    return {begin, static_cast<std::size_t>(end - begin)};
  }
  static inline const std::array<viewer::WebAsset, 3> kAssets{
      {{"/", "text/html; charset=utf-8", text(palpate_stations_html, palpate_stations_html_end),
        false, ""},
       {"/stations.js", "text/javascript; charset=utf-8",
        text(palpate_stations_js, palpate_stations_js_end), false, ""},
       {"/report.css", "text/css; charset=utf-8", text(palpate_report_css, palpate_report_css_end),
        false, ""}}};

  viewer::WebServer server_;
};

struct StationsCommand {
  std::vector<std::string> texts;
  std::string csv_file;
  std::optional<std::uint16_t> web_port;
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
    app.add_option("--web-port", web_port,
                   "show the table as a page on this port of this machine; 0: any")
        ->type_name("PORT");
    add_overwrite_flag(app, may_overwrite);
  }

  [[nodiscard]] int run(const Verbosity& verbosity) const {
    std::vector<Station> stations;
    for (const std::string& text : texts) {
      stations.push_back(station_of(text));
      const std::string& name = stations.back().name;
      if (std::count_if(stations.begin(), stations.end(),
                        [&](const Station& station) { return station.name == name; }) > 1) {
        throw SetupError("station " + one_line(name) +
                         ": is given twice; give each a name of its own, NAME=http://…");
      }
    }
    check_outputs({{"--csv", csv_file}}, {}, may_overwrite);
    if (web_port && !StationsPage::is_built()) {
      throw SetupError("--web-port: this build has no page; build it with npm (PALPATE_WEB=ON)");
    }
    const StopSignal stop;
    std::optional<StationsPage> page;
    if (web_port) page.emplace(*web_port);
    const SteadyClock clock;
    const bool is_live = !is_once && isatty(STDOUT_FILENO) == 1;
    std::vector<StationAnswer> answers;
    do {
      const TimePoint next = clock.now() + kInterval;
      answers = ask(stations, kPatience);
      if (page) page->show(stations_json(stations, answers));
      if (csv_file != kStandardOutput) {
        // on a terminal the table stays where it is
        if (is_live) std::fputs("\033[H\033[J", stdout);
        if (page) std::printf("%s\n", page->url().c_str());
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
