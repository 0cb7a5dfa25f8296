// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/bench_output.h"

#include <spdlog/fmt/fmt.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <system_error>
#include <thread>

#include "common/core/check.h"
#include "common/core/user/output_file.h"
#include "common/core/user/utf8.h"

namespace palpate::bench {
namespace {

std::string shown(const Table::Cell& cell, const std::string& format) {
  if (const auto* text = std::get_if<std::string>(&cell)) return *text;
  const double value = std::get<double>(cell);
  return std::isfinite(value) ? fmt::format(fmt::runtime(format), value) : "–";
}

}  // namespace

void Table::add(std::vector<Cell> row) {
  PALPATE_REQUIRE(row.size() == columns_.size());
  rows_.push_back(std::move(row));
}

void Table::add_gap() { rows_.emplace_back(); }

std::string Table::text() const {
  std::vector<std::vector<std::string>> lines{{}};
  for (const Column& column : columns_) lines[0].push_back(column.title);
  for (const auto& row : rows_) {
    auto& line = lines.emplace_back();
    for (std::size_t i = 0; i < row.size(); ++i) line.push_back(shown(row[i], columns_[i].format));
  }
  std::vector<std::size_t> widths(columns_.size(), 0);
  for (const auto& line : lines) {
    for (std::size_t i = 0; i < line.size(); ++i)
      widths[i] = std::max(widths[i], columns_of(line[i]));
  }

  // text to the left, numbers to the right
  std::string out;
  for (const auto& line : lines) {
    std::string built;
    for (std::size_t i = 0; i < line.size(); ++i) {
      const std::string padding(widths[i] - columns_of(line[i]), ' ');
      const bool is_text = columns_[i].format.empty();
      built += (i > 0 ? "  " : "") + (is_text ? line[i] + padding : padding + line[i]);
    }
    built.erase(built.find_last_not_of(' ') + 1);
    out += built + "\n";
  }
  return out;
}

namespace {

/// RFC 4180: quotes within are doubled.
std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"') out += '"';
    out += c;
  }
  return out + "\"";
}

}  // namespace

std::string Table::csv() const {
  std::string out;
  for (std::size_t i = 0; i < columns_.size(); ++i) out += (i > 0 ? "," : "") + columns_[i].name;
  out += "\n";
  for (const auto& row : rows_) {
    if (row.empty()) continue;
    for (std::size_t i = 0; i < row.size(); ++i) {
      if (i > 0) out += ",";
      if (const auto* text = std::get_if<std::string>(&row[i])) {
        out += quoted(*text);
      } else if (std::isfinite(std::get<double>(row[i]))) {
        out += fmt::format("{}", std::get<double>(row[i]));
      }
    }
    out += "\n";
  }
  return out;
}

nlohmann::ordered_json Table::json() const {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const auto& row : rows_) {
    if (row.empty()) continue;
    nlohmann::ordered_json entry;
    for (std::size_t i = 0; i < row.size(); ++i) {
      if (const auto* text = std::get_if<std::string>(&row[i])) {
        entry[columns_[i].name] = *text;
      } else {
        const double value = std::get<double>(row[i]);
        entry[columns_[i].name] =
            std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
      }
    }
    json.push_back(entry);
  }
  return {{"schema_version", 1}, {"rows", json}};
}

void Table::publish(const BenchOptions& options) const {
  std::fputs(text().c_str(), stdout);
  write_table(options, csv());
  write_json(options, json());
}

void Steps::next() {
  const std::lock_guard lock(mutex_);
  progress_.show(static_cast<double>(++done_) / static_cast<double>(count_));
}

void write_table(const BenchOptions& options, const std::string& csv) {
  if (options.csv_file.empty()) return;
  palpate::write_file("csv file", options.csv_file, csv, options.may_overwrite);
}

void write_json(const BenchOptions& options, const nlohmann::ordered_json& json) {
  if (options.json_file.empty()) return;
  palpate::write_file("json file", options.json_file, json.dump(2) + "\n", options.may_overwrite);
}

void write_file(const std::filesystem::path& file, const std::string& text) {
  palpate::write_file("file", file.string(), text, true);
}

void draw_figure(const std::filesystem::path& folder, const std::string& name,
                 const std::string& script) {
  std::filesystem::create_directories(folder);
  write_file(folder / (name + ".gp"), script);
  const std::string command = fmt::format("cd '{}' && gnuplot '{}.gp'", folder.string(), name);
  if (std::system(command.c_str()) == 0) {
    std::printf("drawn: %s, by %s.gp\n", folder.c_str(), name.c_str());
  } else {
    std::fprintf(stderr, "no plot: gnuplot %s.gp failed in %s; install gnuplot-nox\n", name.c_str(),
                 folder.c_str());
  }
}

std::string machine_load() {
  double load = 0.0;
  if (getloadavg(&load, 1) != 1) return "unknown";
  return fmt::format("{:.1f} on {} processors", load, std::thread::hardware_concurrency());
}

void add_shard_option(CLI::App& app, Shard& shard) {
  const auto read = [&shard](const std::string& text) {
    const char* const end = text.data() + text.size();
    Shard given{.part = 0, .of = 0};
    const auto [slash, part_error] = std::from_chars(text.data(), end, given.part);
    const bool has_both = part_error == std::errc{} && slash != end && *slash == '/';
    const auto [rest, of_error] = std::from_chars(has_both ? slash + 1 : end, end, given.of);
    if (of_error != std::errc{} || rest != end || given.part == 0 || given.part > given.of) {
      throw SetupError("--shard = " + text + ": must be I/N with 1 ≤ I ≤ N, such as 1/8");
    }
    shard = given;
  };
  app.add_option_function<std::string>("--shard", read, "I/N: the I-th of N parts of the runs");
}

int run_bench(CLI::App& app, BenchOptions& options, int argc, char** argv,
              const std::function<void()>& run) {
  app.add_option("--json", options.json_file, "write the table as JSON");
  app.add_option("--csv", options.csv_file, "write the table as CSV");
  app.add_option("--plot", options.plot_folder,
                 "draw the figures into this folder (needs gnuplot)");
  app.add_flag("--quick", options.is_quick, "the same rows with fewer repeats, a minute at most");
  app.add_flag("--overwrite", options.may_overwrite, "let --json and --csv replace existing files");
  std::signal(SIGPIPE, SIG_IGN);
  try {
    app.parse(argc, argv);
    check_outputs({{"--json", options.json_file}, {"--csv", options.csv_file}}, {},
                  options.may_overwrite);
    run();
    return status_with_output(0, app.get_name());
  } catch (const CLI::ParseError& error) {
    return status_with_output(app.exit(error) == 0 ? 0 : 2, app.get_name());
  } catch (const SetupError& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  } catch (const std::runtime_error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}

}  // namespace palpate::bench
