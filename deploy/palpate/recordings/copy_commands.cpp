// SPDX-License-Identifier: Apache-2.0
// cut, recover and merge: recordings made of recordings.
#include <spdlog/fmt/fmt.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "common/core/user/output_file.h"
#include "common/process/options.h"
#include "common/process/run_node.h"
#include "common/process/terminal.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/options.h"
#include "viewer_node/recording/recording_copy.h"

namespace palpate {
namespace {

/// Copies `inputs`, and says what came of it on standard error.
viewer::CopyResult copy(const std::vector<std::string>& inputs, const viewer::CopyOptions& options,
                        const Verbosity& verbosity) {
  check_outputs({{"OUT", options.file}}, inputs, options.may_overwrite);
  std::vector<std::unique_ptr<viewer::McapReader>> sources;
  sources.reserve(inputs.size());
  for (const std::string& input : inputs) {
    sources.push_back(std::make_unique<viewer::McapReader>(input));
  }
  std::optional<Progress> progress(std::in_place, options.command, verbosity.is_quiet);
  const viewer::CopyResult result =
      copy_recordings(sources, options, [&](double ratio) { progress->show(ratio); });
  progress.reset();
  if (!verbosity.is_quiet && options.file != "-") {
    say(fmt::format("{}: {} messages written", options.file, result.messages));
  }
  return result;
}

void add_output_argument(CLI::App& app, std::string& file) {
  app.add_option("OUT", file, "recording to write; - for standard output")
      ->required()
      ->type_name("");
}

struct CutCommand {
  std::string input;
  viewer::CopyOptions options{.command = "cut"};

  void add_to(CLI::App& app) {
    add_recording_argument(app, input);
    add_output_argument(app, options.file);
    app.add_option("--from", options.from_s,
                   "begin at this time of the recording, with the scene as it was (default: 0)")
        ->type_name("S")
        ->check(is_start_time());
    app.add_option("--to", options.to_s, "end at this time of the recording (default: its end)")
        ->type_name("S")
        ->check(is_start_time());
    app.add_option("--topics", options.topics, "copy only these, e.g. /device,/mofc (default: all)")
        ->type_name("TOPIC,…")
        ->delimiter(',')
        ->allow_extra_args(false);
    add_overwrite_flag(app, options.may_overwrite);
  }
  int run(const Verbosity& verbosity) const {
    if (options.to_s <= options.from_s) {
      throw SetupError(fmt::format("--to {:g}: is not after --from {:g}; give a later time",
                                   options.to_s, options.from_s));
    }
    const viewer::CopyResult result = copy({input}, options, verbosity);
    if (result.loss().empty()) return 0;
    say(fmt::format("recording {}: {} are left out", input, result.loss()));
    return kExitFailure;
  }
};

struct RecoverCommand {
  std::string input;
  viewer::CopyOptions options{.command = "recover", .is_recovery = true};

  void add_to(CLI::App& app) {
    add_recording_argument(app, input);
    add_output_argument(app, options.file);
    add_overwrite_flag(app, options.may_overwrite);
  }
  int run(const Verbosity& verbosity) const {
    const viewer::CopyResult result = copy({input}, options, verbosity);
    if (!result.loss().empty()) {
      say(fmt::format("recording {}: {} left out, the rest is recovered", input, result.loss()));
    } else if (!verbosity.is_quiet) {
      say(fmt::format("recording {}: everything in it is recovered", input));
    }
    return 0;
  }
};

struct MergeCommand {
  std::vector<std::string> files;  // the last one is written
  viewer::CopyOptions options{.command = "merge"};

  void add_to(CLI::App& app) {
    app.add_option("FILES", files,
                   "recordings of one session, and last the one to write; - for standard output")
        ->required()
        ->expected(1, 1000)
        ->type_name("FILE FILE … OUT");
    app.add_flag("--append", options.is_sequence,
                 "one after the other (default: each message at the time when it was recorded)");
    add_overwrite_flag(app, options.may_overwrite);
  }
  int run(const Verbosity& verbosity) {
    if (files.size() < 3) {
      throw SetupError("merge: give two recordings or more, and last the file to write");
    }
    const std::vector<std::string> inputs(files.begin(), files.end() - 1);
    options.file = files.back();
    const viewer::CopyResult result = copy(inputs, options, verbosity);
    if (!verbosity.is_quiet && result.duplicates > 0) {
      say(fmt::format("{} messages were in two recordings, and are written once",
                      result.duplicates));
    }
    if (result.loss().empty()) return 0;
    say(fmt::format("{} are left out", result.loss()));
    return kExitFailure;
  }
};

}  // namespace

Command add_cut_command(CLI::App& app) {
  return add_command<CutCommand>(app, "cut", "write a part of a recording: some time, some topics");
}
Command add_recover_command(CLI::App& app) {
  return add_command<RecoverCommand>(app, "recover",
                                     "write what is readable of a damaged or unfinished recording");
}
Command add_merge_command(CLI::App& app) {
  return add_command<MergeCommand>(app, "merge", "write several recordings as one");
}

}  // namespace palpate
