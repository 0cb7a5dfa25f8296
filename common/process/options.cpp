// SPDX-License-Identifier: Apache-2.0
#include "common/process/options.h"

namespace palpate {
namespace {

constexpr double kLongestSeconds = 1e9;  // far below what nanoseconds in 64 bits can hold

CLI::Validator is_time(bool may_be_zero, const std::string& rule) {
  return CLI::Validator(
      [may_be_zero, rule](const std::string& text) {
        double seconds = 0.0;
        const bool is_number = CLI::detail::lexical_cast(text, seconds);
        const bool is_begin = may_be_zero && seconds == 0.0;
        if (is_number && (seconds > 0.0 || is_begin) && seconds <= kLongestSeconds) {
          return std::string();
        }
        return "\"" + text + "\": give a time in s, " + rule;
      },
      "", "time");
}

}  // namespace

void add_override_option(CLI::App& app, std::vector<std::string>& overrides) {
  app.add_option("--set", overrides,
                 "override a field of the session, e.g. mofc.controller=none; repeatable")
      ->type_name("PATH=VALUE")
      ->allow_extra_args(false);
}

void add_seconds_option(CLI::App& app, std::optional<double>& seconds, const std::string& help) {
  app.add_option("--seconds", seconds, help)
      ->type_name("S")
      ->check(is_time(false, "more than 0 and at most 1e9"));
}

void add_csv_option(CLI::App& app, std::string& file, const std::string& more) {
  app.add_option("--csv", file,
                 "write one row per device tick to this file, - for standard output" + more)
      ->type_name("FILE");
}

void add_record_option(CLI::App& app, std::string& file) {
  app.add_option("--record", file, "record every tick, the scene and the session to this MCAP file")
      ->type_name("FILE");
}

void add_overwrite_flag(CLI::App& app, bool& may_overwrite) {
  app.add_flag("--overwrite", may_overwrite,
               "replace existing files; a file that is read is never replaced");
}

void add_no_realtime_flag(CLI::App& app, bool& has_no_realtime) {
  app.add_flag("--no-realtime", has_no_realtime,
               "use ordinary scheduling, whatever the session requests");
}

void add_insecure_flag(CLI::App& app, bool& is_insecure) {
  app.add_flag("--insecure", is_insecure,
               "allow tcp beyond loopback without keys: anyone on the network can then observe the "
               "session and send messages to it");
}

void add_no_adversary_flag(CLI::App& app, bool& has_no_adversary) {
  app.add_flag("--no-adversary", has_no_adversary,
               "leave out `adversary { … }` of the session, which is for lockstep only");
}

void add_unsafe_flag(CLI::App& app, bool& is_unsafe) {
  app.add_flag(
      "--unsafe", is_unsafe,
      "let a real device run with `device { monitor: off }`: nothing then stands between a "
      "wrong clamp and the hand");
}

CLI::Validator is_start_time() { return is_time(true, "at least 0 and at most 1e9"); }

}  // namespace palpate
