// SPDX-License-Identifier: Apache-2.0
// options.h — command line options that several programs share, each worded once.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

namespace palpate {

/// --set PATH=VALUE, repeatable.
void add_override_option(CLI::App& app, std::vector<std::string>& overrides);
/// --seconds: a finite number above 0.
void add_seconds_option(CLI::App& app, std::optional<double>& seconds, const std::string& help);
/// --csv: one row per device tick.
/// @param more  appended to the help text
void add_csv_option(CLI::App& app, std::string& file, const std::string& more = {});
/// --record: an MCAP file.
void add_record_option(CLI::App& app, std::string& file);
/// --overwrite, for every file that the program writes.
void add_overwrite_flag(CLI::App& app, bool& may_overwrite);
/// --no-realtime
void add_no_realtime_flag(CLI::App& app, bool& has_no_realtime);
/// --insecure
void add_insecure_flag(CLI::App& app, bool& is_insecure);
/// --no-adversary
void add_no_adversary_flag(CLI::App& app, bool& has_no_adversary);
/// --unsafe
void add_unsafe_flag(CLI::App& app, bool& is_unsafe);

/// A time in s: finite, at least 0.
[[nodiscard]] CLI::Validator is_start_time();

}  // namespace palpate
