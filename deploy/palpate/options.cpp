#include "deploy/palpate/options.h"

#include <cerrno>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <system_error>

#include "common/core/check.h"
#include "common/core/files.h"
#include "common/process/options.h"
#include "common/session/session_file.h"

namespace palpate {

void SessionOptions::add_to(CLI::App& app) {
  app.add_option("SESSION", file, "session file (*.txtpb)")->required()->type_name("");
  add_override_option(app, overrides);
}

Session SessionOptions::load() const { return load_session(file, overrides); }

void add_recording_argument(CLI::App& app, std::string& file) {
  app.add_option("FILE", file, "recording (*.mcap)")->required()->type_name("");
}

void add_side_option(CLI::App& app, std::string& side) {
  app.add_option("--side", side, "which device, if the session or recording has several")
      ->type_name("NAME");
}

void OutputOptions::add_to(CLI::App& app, const std::string& more_on_csv) {
  add_csv_option(app, csv_file, more_on_csv);
  app.add_option("--json", json_file, "write the summary to this file; - for standard output")
      ->type_name("FILE");
  add_record_options(app, record.file, record.may_overwrite);
}

JsonOutput::JsonOutput(const std::string& path) : path_(path) {
  if (path_.empty() || is_standard_output()) return;
  if (!std::ofstream(path_, std::ios::app)) {
    throw SetupError("json file " + path_ + ": " + std::generic_category().message(errno) +
                     ": give a path in a folder that exists and is writable");
  }
}

void JsonOutput::write(const nlohmann::ordered_json& json) const {
  if (path_.empty()) return;
  const std::string text = json.dump(2) + "\n";
  if (is_standard_output()) {
    std::fputs(text.c_str(), stdout);
    return;
  }
  const std::string complaint = write_file(path_, text);
  if (!complaint.empty()) throw std::runtime_error("json file " + path_ + ": " + complaint);
}

}  // namespace palpate
