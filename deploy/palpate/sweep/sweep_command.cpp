// SPDX-License-Identifier: Apache-2.0
#include <spdlog/fmt/fmt.h>

#include <cstdio>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/core/check.h"
#include "common/core/user/output_file.h"
#include "common/process/options.h"
#include "common/process/run_node.h"
#include "common/process/terminal.h"
#include "common/session/session_file.h"
#include "deploy/campaign/maps.h"
#include "deploy/campaign/pool.h"
#include "deploy/campaign/slurm.h"
#include "deploy/campaign/tables.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/options.h"

namespace palpate {
namespace {

using campaign::Campaign;
using campaign::Results;

/// What `palpate sweep` and `palpate sweep report` share.
struct CampaignOptions {
  std::string file;
  std::string folder;
  std::optional<std::uint64_t> runs;
  bool may_overwrite = false;

  void add_to(CLI::App& app, bool is_required) {
    CLI::Option* const option = app.add_option("CAMPAIGN", file, "campaign file (*.txtpb)");
    option->type_name("");
    if (is_required) option->required();
    app.add_option("--folder", folder,
                   "where the results are kept and found again (default: NAME.sweep here)")
        ->type_name("DIR");
    app.add_option("--runs", runs, "runs of each cell, instead of those of the campaign")
        ->type_name("N")
        ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{20'000'000}));
    add_overwrite_flag(app, may_overwrite);
  }
  [[nodiscard]] Campaign load() const { return campaign::load_campaign(file, runs); }
  [[nodiscard]] std::string folder_of(const Campaign& campaign) const {
    return folder.empty() ? default_folder(campaign).string() : folder;
  }
  /// check_outputs(), also against the results. Throws SetupError.
  void check(const std::vector<NamedOutput>& outputs, const Campaign& campaign) const {
    std::vector<std::string> inputs = campaign.files;
    inputs.push_back(folder_of(campaign));
    check_outputs(outputs, inputs, may_overwrite);
  }
};

/// A file that is complete or not there. Construct it before anything is printed: then other text
/// keeps out of standard output if that is the file. Without a name it is nothing.
class WholeFile {
 public:
  WholeFile(const char* what, const std::string& file, bool may_overwrite) {
    if (!file.empty()) file_.emplace(what, file, OutputFile::Kind::kWhole, may_overwrite);
  }
  void write(const std::function<std::string()>& text) {
    if (!file_) return;
    if (!file_->write(text()) || !file_->close()) throw std::runtime_error(file_->complaint());
  }

 private:
  std::optional<OutputFile> file_;
};

// --- report -------------------------------------------------------------------------------------

struct SweepReportCommand {
  CampaignOptions campaign;
  campaign::MapRequest map;
  std::string svg_file;

  void add_to(CLI::App& app) {
    campaign.add_to(app, true);
    app.add_option("--across", map.across, "dimension of the columns (default: the last one)")
        ->type_name("NAME");
    app.add_option("--down", map.down, "dimension of the rows (default: the one before)")
        ->type_name("NAME");
    app.add_option("--quantity", map.quantity, "what is mapped (default: the first one reported)")
        ->type_name("NAME");
    const std::map<std::string, campaign::Merge> merges{{"mean", campaign::Merge::kMean},
                                                        {"least", campaign::Merge::kLeast},
                                                        {"greatest", campaign::Merge::kGreatest}};
    app.add_option("--of", map.merge, "of several runs: mean, least or greatest (default: mean)")
        ->type_name("WHICH")
        ->transform(CLI::CheckedTransformer(merges).description(""));
    app.add_option("--svg", svg_file, "draw the maps to this file, too")->type_name("FILE");
  }

  [[nodiscard]] int run(const Verbosity& verbosity) const {
    const Campaign loaded = campaign.load();
    if (!std::filesystem::exists(campaign.folder_of(loaded))) {
      throw SetupError(campaign.folder_of(loaded) +
                       ": no results yet; compute some with `palpate sweep`, or name their folder "
                       "with --folder");
    }
    const campaign::Folder folder(campaign.folder_of(loaded), loaded, true);
    Results results(loaded);
    results.refresh(folder.path());
    campaign.check({{"--svg", svg_file}}, loaded);
    WholeFile svg("map", svg_file, campaign.may_overwrite);
    std::fputs((map_text(loaded, results, map) + summary_text(loaded, results)).c_str(), stdout);
    if (!results.is_complete()) {
      say(fmt::format("{} of {} runs are missing; `palpate sweep` computes them",
                      results.needed() - results.known(), results.needed()));
    }
    svg.write([&] { return map_svg(loaded, results, map); });
    say_written({svg_file}, verbosity);
    return 0;
  }
};

// --- sweep --------------------------------------------------------------------------------------

struct SweepCommand {
  CampaignOptions campaign;
  unsigned workers = std::max(1U, std::thread::hardware_concurrency());
  std::string csv_file;
  std::string json_file;
  std::size_t worst = 0;
  std::optional<std::uint64_t> shown_run;
  bool is_slurm = false;
  std::vector<std::string> sbatch;
  std::string share_text;
  std::pair<std::uint64_t, std::uint64_t> share{0, 0};  ///< of a number of shares; 0: all

  void add_to(CLI::App& app) {
    campaign.add_to(app, false);
    app.add_option("--workers", workers,
                   "processes, or with --slurm tasks (default: the processors here)")
        ->type_name("N")
        ->check(CLI::Range(1U, 1000U));
    app.add_option("--csv", csv_file, "write one row per run to this file, - for standard output")
        ->type_name("FILE");
    app.add_option("--json", json_file, "the same as JSON lines")->type_name("FILE");
    app.add_option("--worst", worst,
                   "record the N runs nearest to the first limit, or beyond it, in the folder: "
                   "worst-1.mcap …")
        ->type_name("N")
        ->check(CLI::Range(std::size_t{1}, std::size_t{100}));
    app.add_option("--show", shown_run, "print the `palpate loopback` line of this run, no more")
        ->type_name("RUN");
    auto* const slurm = app.add_flag("--slurm", is_slurm, "compute with an array job of Slurm");
    app.add_option("--sbatch", sbatch,
                   "one more argument of sbatch, e.g. --sbatch=--partition=long")
        ->type_name("ARGUMENT")
        ->allow_extra_args(false)
        ->needs(slurm);
    app.add_option("--share", share_text,
                   "compute only the runs with number I modulo N, for schedulers of your own; the "
                   "command without --share collects")
        ->type_name("I/N")
        ->check(CLI::Validator([this](const std::string& text) { return parse_share(text); }, "",
                               "share"))
        ->excludes(slurm);
  }

  std::string parse_share(const std::string& text) {
    char end = 0;
    unsigned long long index = 0;
    unsigned long long count = 0;
    if (std::sscanf(text.c_str(), "%llu/%llu%c", &index, &count, &end) != 2 || index >= count) {
      return "\"" + text + "\": give I/N with I below N, such as 0/4";
    }
    share = {index, count};
    return {};
  }

  [[nodiscard]] int run(const Verbosity& verbosity) const;

 private:
  [[nodiscard]] bool compute(const Campaign& loaded, const campaign::Folder& folder,
                             Results& results, const Verbosity& verbosity) const;
  void record_worst(const Campaign& loaded, const campaign::Folder& folder,
                    const Results& results) const;
};

bool SweepCommand::compute(const Campaign& loaded, const campaign::Folder& folder, Results& results,
                           const Verbosity& verbosity) const {
  const StopSignal stop;
  Progress progress("sweep", verbosity.is_quiet);
  const auto may_go_on = [&](std::uint64_t done, std::uint64_t of) {
    progress.show(of > 0 ? static_cast<double>(done) / static_cast<double>(of) : 1.0);
    return !StopSignal::is_requested();
  };
  if (share.second > 0) {
    return compute_share(loaded, folder, results, share.first, share.second, may_go_on);
  }
  if (!is_slurm) return compute_all(loaded, folder, results, {workers, may_go_on});
  std::vector<std::string> arguments{std::filesystem::absolute(campaign.file).string()};
  if (campaign.runs) arguments.push_back(fmt::format("--runs={}", *campaign.runs));
  return compute_with_slurm(loaded, folder, results,
                            {.shares = workers,
                             .sbatch = sbatch,
                             .arguments = arguments,
                             .say =
                                 [&](const std::string& line) {
                                   if (!verbosity.is_quiet) say(line);
                                 },
                             .may_go_on = may_go_on});
}

void SweepCommand::record_worst(const Campaign& loaded, const campaign::Folder& folder,
                                const Results& results) const {
  int number = 0;
  for (const std::uint64_t run : worst_runs(loaded, results, worst)) {
    const auto file = folder.path() / fmt::format("worst-{}.mcap", ++number);
    static_cast<void>(campaign::compute(loaded, plan_of(loaded, run), file.string(), true));
    std::printf("%s: run %llu\n", file.c_str(), static_cast<unsigned long long>(run));
  }
}

int SweepCommand::run(const Verbosity& verbosity) const {
  if (campaign.file.empty()) throw SetupError("palpate sweep: give a campaign file (*.txtpb)");
  const Campaign loaded = campaign.load();
  if (shown_run) {
    if (*shown_run >= loaded.run_count()) {
      throw SetupError(fmt::format("--show {}: the campaign has runs 0 … {}", *shown_run,
                                   loaded.run_count() - 1));
    }
    std::printf("%s\n", command_line(loaded, plan_of(loaded, *shown_run)).c_str());
    return 0;
  }
  if (worst > 0 && loaded.limits.empty()) {
    throw SetupError("--worst: the campaign has no limit { … }, so no run is worse than another");
  }
  campaign.check({{"--csv", csv_file}, {"--json", json_file}}, loaded);

  WholeFile csv("csv file", csv_file, campaign.may_overwrite);
  WholeFile json("json file", json_file, campaign.may_overwrite);
  const campaign::Folder folder(campaign.folder_of(loaded), loaded, share.second > 0);
  Results results(loaded);
  results.refresh(folder.path());
  const std::uint64_t known = results.known();
  const SteadyClock wall;
  const TimePoint begin = wall.now();
  const bool is_done = compute(loaded, folder, results, verbosity);
  const double wall_s = to_seconds(wall.now() - begin);
  if (!is_done) {
    say(fmt::format("stopped; {} of {} runs are done, the same command goes on", results.known(),
                    results.needed()));
    return kExitFailure;
  }
  if (share.second > 0) return 0;

  if (!verbosity.is_quiet) {
    const std::uint64_t computed = results.known() - known;
    std::fputs(summary_text(loaded, results).c_str(), stdout);
    std::printf("  %llu runs computed in %.1f s (%.0f runs/s), %llu from before\n",
                static_cast<unsigned long long>(computed), wall_s,
                static_cast<double>(computed) / std::max(wall_s, 1e-9),
                static_cast<unsigned long long>(known));
  }
  if (worst > 0) record_worst(loaded, folder, results);
  csv.write([&] { return csv_text(loaded, results); });
  json.write([&] { return json_lines(loaded, results); });
  say_written({csv_file, json_file}, verbosity);
  return violations(loaded, results) > 0 ? kExitFailure : 0;
}

}  // namespace

Command add_sweep_command(CLI::App& app) {
  CLI::App& parser = *app.add_subcommand(
      "sweep", "run a campaign: many runs in lockstep, on all processors or with Slurm");
  auto sweep = std::make_shared<SweepCommand>();
  sweep->add_to(parser);
  CLI::App& report =
      *parser.add_subcommand("report", "maps and figures of what a sweep has computed");
  auto report_command = std::make_shared<SweepReportCommand>();
  report_command->add_to(report);
  return {&parser, [&report, sweep, report_command](const Verbosity& verbosity) {
            return report.parsed() ? report_command->run(verbosity) : sweep->run(verbosity);
          }};
}

}  // namespace palpate
