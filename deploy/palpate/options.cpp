// SPDX-License-Identifier: Apache-2.0
#include "deploy/palpate/options.h"

#include <cstdio>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "common/core/user/utf8.h"
#include "common/process/options.h"
#include "common/process/run_node.h"
#include "common/process/terminal.h"
#include "common/session/session_file.h"

namespace palpate {

void say(const std::string& text) {
  std::fprintf(stderr, "%spalpate: %s\n", line_start(STDERR_FILENO).c_str(), text.c_str());
}

void say_written(const std::vector<std::string>& files, const Verbosity& verbosity) {
  if (verbosity.is_quiet) return;
  for (const std::string& file : files) {
    if (!file.empty() && file != kStandardOutput) say(file + ": written");
  }
}

void SessionOptions::add_to(CLI::App& app) {
  app.add_option("SESSION", file, "session file (*.txtpb)")->required()->type_name("");
  add_override_option(app, overrides);
}

Session SessionOptions::load(const Verbosity& verbosity) const {
  Session session = load_session(file, overrides);
  if (verbosity.is_verbose) {
    for (const std::string& read : files_of(session)) {
      say("reads " + read);
    }
  }
  return session;
}

void refuse_empty_files(CLI::App& parser) {
  for (CLI::Option* option : parser.get_options()) {
    if (option->get_type_name().rfind("FILE", 0) != 0) continue;
    option->check([](const std::string& file) {
      return file.empty() ? std::string("is empty; give the name of a file, or leave it out")
                          : std::string();
    });
  }
}

void add_recording_argument(CLI::App& app, std::string& file) {
  app.add_option("FILE", file, "recording (*.mcap)")->required()->type_name("");
}

int status_of_damage(const RecordingFile& recording) {
  const std::string damage = recording.damage();
  if (damage.empty()) return 0;
  say("recording " + recording.mcap().path() + " is damaged; missing: " + damage +
      "; `palpate recover` writes the rest as a whole recording");
  return kExitFailure;
}

void add_side_option(CLI::App& app, std::string& side) {
  app.add_option("--side", side, "which device, if the session or recording has several")
      ->type_name("NAME");
}

void add_trust_flag(CLI::App& app, bool& is_trusted) {
  app.add_flag(
      "--trust", is_trusted,
      "run the program and load the libraries that the session names although another user "
      "may have written them; remembered until one of the files changes");
}

void OutputOptions::add_to(CLI::App& app, const std::string& more_on_csv) {
  add_csv_option(app, csv_file, more_on_csv);
  app.add_option("--json", json_file, "write the summary to this file; - for standard output")
      ->type_name("FILE");
  add_record_option(app, record_file);
  add_overwrite_flag(app, may_overwrite);
}

void OutputOptions::check(const Session& session, const std::vector<std::string>& tables,
                          const std::string& input) const {
  std::vector<std::string> inputs = files_of(session);
  inputs.push_back(input);
  std::vector<NamedOutput> outputs{{"--json", json_file}, {"--record", record_file}};
  for (const std::string& table : tables) outputs.push_back({"--csv", table});
  check_outputs(outputs, inputs, may_overwrite);
}

void OutputOptions::say_written(std::vector<std::string> tables, const Verbosity& verbosity) const {
  tables.insert(tables.end(), {json_file, record_file});
  palpate::say_written(tables, verbosity);
}

JsonOutput::JsonOutput(const OutputOptions& options) {
  if (options.json_file.empty()) return;
  file_.emplace("json file", options.json_file, OutputFile::Kind::kWhole, options.may_overwrite);
}

void JsonOutput::write(const nlohmann::ordered_json& json) {
  if (!file_) return;
  if (!file_->write(json_text(json, 2) + "\n") || !file_->close()) {
    throw std::runtime_error(file_->complaint());
  }
}

}  // namespace palpate
