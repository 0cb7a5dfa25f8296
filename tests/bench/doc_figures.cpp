// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/doc_figures.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "common/core/check.h"

namespace palpate::bench {
namespace {

using nlohmann::json;
using Cells = std::vector<std::string>;

double number(const json& value) {
  return value.is_number() ? value.get<double>() : std::numeric_limits<double>::quiet_NaN();
}

std::string text(const json& row, const char* key) { return row.at(key).get<std::string>(); }

/// A number with `digits` decimals, never "-0"; – where it is not known.
std::string fixed(double value, int digits) {
  if (!std::isfinite(value)) return "–";
  const double unit = std::pow(10.0, -digits);
  if (std::abs(value) < 0.5 * unit) value = 0.0;
  return fmt::format("{:.{}f}", value, digits);
}

std::string fixed(const json& row, const char* key, int digits) {
  return fixed(number(row.at(key)), digits);
}

/// µJ, mJ from 1 mJ on.
std::string energy(double microjoule) {
  return std::abs(microjoule) < 1000.0 ? fixed(microjoule, 0) + " µJ"
                                       : fixed(1e-3 * microjoule, 1) + " mJ";
}

std::string markdown(const Cells& head, const std::vector<Cells>& rows) {
  const auto line = [](const Cells& cells) {
    std::string out = "|";
    for (const std::string& cell : cells) out += cell.empty() ? " |" : " " + cell + " |";
    return out + "\n";
  };
  std::string out = line(head) + "|";
  for (std::size_t i = 0; i < head.size(); ++i) out += "---|";
  out += "\n";
  for (const Cells& row : rows) out += line(row);
  return out;
}

/// The one row that fulfils the condition.
const json& only(const json& rows, const std::function<bool(const json&)>& is_wanted) {
  const json* found = nullptr;
  for (const json& row : rows) {
    if (!is_wanted(row)) continue;
    if (found != nullptr) throw SetupError("figures: two rows where the table has one");
    found = &row;
  }
  if (found == nullptr) throw SetupError("figures: a row of the table is missing in the output");
  return *found;
}

// --- the controllers on the sessions of the paper -------------------------------------------

std::string controllers_table(const std::vector<json>& outputs) {
  std::vector<Cells> rows;
  for (const json& row : outputs.at(0).at("rows")) {
    rows.push_back({text(row, "tissue"), text(row, "controller"),
                    fmt::format("{} / {} / {}", fixed(row, "transparency_x_percent", 0),
                                fixed(row, "transparency_y_percent", 0),
                                fixed(row, "transparency_z_percent", 0)),
                    fixed(row, "clamped_percent", 0), fixed(row, "excess_reversals", 0),
                    fixed(row, "max_force_n", 2), energy(number(row.at("min_true_energy_uj"))),
                    text(row, "paper_transparency")});
  }
  return markdown({"tissue", "MOFC", "transparency x / y / z %", "clamped %", "excess reversals",
                   "peak N", "least true energy", "the paper"},
                  rows);
}

// --- the fit of the paper ---------------------------------------------------------------------

std::string fit_table(const std::vector<json>& outputs) {
  std::vector<Cells> rows;
  for (const json& row : outputs.at(0).at("statements").at("rows")) {
    rows.push_back(
        {text(row, "experiment"), text(row, "printed"),
         fmt::format("{} / {} / {}", fixed(row, "transparency_x_percent", 1),
                     fixed(row, "transparency_y_percent", 1),
                     fixed(row, "transparency_z_percent", 1)),
         fmt::format("{} to {}", fixed(row, "first_sample", 0), fixed(row, "last_sample", 0)),
         fmt::format("{} / {} / {}", fixed(row, "limited_x", 0), fixed(row, "limited_y", 0),
                     fixed(row, "limited_z", 0)),
         fixed(row, "at_peak", 0), fixed(row, "excess_reversals", 0),
         energy(number(row.at("min_true_energy_uj")))});
  }
  return markdown({"experiment", "the paper", "transparency x / y / z %", "samples in contact",
                   "limited x / y / z", "at 3.3 N", "excess reversals", "least true energy"},
                  rows);
}

std::string sensitivity_table(const std::vector<json>& outputs) {
  const auto axes = [](const json& row, const std::string& prefix) {
    return fmt::format("{} / {} / {}", fixed(row, (prefix + "x_percent").c_str(), 0),
                       fixed(row, (prefix + "y_percent").c_str(), 0),
                       fixed(row, (prefix + "z_percent").c_str(), 0));
  };
  std::vector<Cells> rows;
  for (const json& row : outputs.at(0).at("sensitivity").at("rows")) {
    rows.push_back({text(row, "change"), axes(row, ""), fixed(row, "excess_reversals", 1),
                    fixed(row, "samples", 1), axes(row, "without_"),
                    fixed(row, "without_excess_reversals", 1)});
  }
  return markdown({"changed", "with: x / y / z %", "excess reversals", "samples in contact",
                   "without: x / y / z %", "excess reversals"},
                  rows);
}

// --- held force and contact model -----------------------------------------------------------

std::string transparency_table(const std::vector<json>& outputs) {
  const json& rows = outputs.at(0).at("rows");
  constexpr double kDelayMs = 50.0;
  constexpr double kLossPercent = 20.0;
  std::vector<std::string> tissues;
  for (const json& row : rows) {
    const std::string tissue = text(row, "tissue");
    const bool is_shown = tissue.find("frozen") == std::string::npos;
    if (is_shown && (tissues.empty() || tissues.back() != tissue)) tissues.push_back(tissue);
  }
  std::vector<Cells> table;
  for (const std::string& tissue : tissues) {
    Cells cells{tissue};
    for (const char* interaction : {"local", "held"}) {
      const json& row = only(rows, [&](const json& r) {
        return r.at("tissue") == tissue && r.at("interaction") == interaction &&
               r.at("controller") == "guard" && number(r.at("delay_ms")) == kDelayMs &&
               number(r.at("loss_percent")) == kLossPercent;
      });
      cells.push_back(fmt::format("{}, {} %, {} mm, {}", fixed(row, "capped_transparency", 2),
                                  fixed(row, "force_error_percent", 1),
                                  fixed(row, "path_rms_mm", 3), fixed(row, "excess_reversals", 0)));
    }
    table.push_back(cells);
  }
  return markdown({"tissue",
                   "contact model: transparency, force error rms, path deviation rms, "
                   "excess reversals",
                   "held force: the same"},
                  table);
}

// --- surfaces and tissues over a disturbed network ------------------------------------------

std::string black_box_table(const std::vector<json>& outputs) {
  std::vector<Cells> rows;
  for (const json& row : outputs.at(0).at("rows")) {
    const std::string tissue = text(row, "tissue");
    if (rows.empty() || rows.back().front() != tissue) rows.push_back({tissue});
    rows.back().push_back(fixed(row, "capped_transparency", 3));
  }
  return markdown({"transparency", "force, held", "force, model estimated", "force anywhere",
                   "points, model estimated", "its own model"},
                  rows);
}

std::string disturbed_table(const std::vector<json>& outputs) {
  const json& rows = outputs.at(0).at("rows");
  std::vector<std::string> scenes;
  for (const json& row : rows) {
    const std::string scene = text(row, "surface");
    if (scenes.empty() || scenes.back() != scene) scenes.push_back(scene);
  }
  std::vector<Cells> table;
  for (const std::string& scene : scenes) {
    Cells cells{scene};
    for (const char* disturbance :
         {"none", "50 ms, 20 % lost, 50 Hz", "100 ms, 20 % lost, 50 Hz"}) {
      const json& row = only(rows, [&](const json& r) {
        return r.at("surface") == scene && r.at("disturbance") == disturbance;
      });
      cells.push_back(fmt::format("{}, {} %, {} mm, {}", fixed(row, "capped_transparency", 3),
                                  fixed(row, "force_error_percent", 1),
                                  fixed(row, "path_rms_mm", 2), fixed(row, "excess_reversals", 0)));
    }
    table.push_back(cells);
  }
  return markdown({"tissue",
                   "undisturbed: transparency, force error rms, path deviation rms, excess "
                   "reversals",
                   "50 ms each way, 20 % lost, physics at 50 Hz", "100 ms, the same"},
                  table);
}

// --- descriptions made to cost time ---------------------------------------------------------

std::string descriptions_table(const std::vector<json>& outputs) {
  std::vector<Cells> table;
  for (const json& row : outputs.at(0).at("rows")) {
    table.push_back({text(row, "kind"), text(row, "physics"), fixed(row, "rate_hz", 0),
                     fixed(row, "reply_p50_us", 0), fixed(row, "reply_p99_us", 0),
                     fixed(row, "dies_p99_us", 0), fixed(row, "dies_answered_percent", 1)});
  }
  return markdown({"worst found", "costly physics", "device, Hz", "reply p50, µs", "p99, µs",
                   "the first falls silent: p99, µs", "answered in time, %"},
                  table);
}

// --- velocity estimators --------------------------------------------------------------------

std::string velocity_table(const std::vector<json>& outputs) {
  const json& rows = outputs.at(0).at("rows");
  constexpr const char* kShown[][2] = {
      {"difference", "backward difference"},
      {"low-pass 10 ms", "backward difference, low-pass 10 ms"},
      {"FOAW best 10 ms", "adaptive window, best fit, 10 ms"},
      {"Kalman a 10, no force", "Kalman, motor force unknown"},
      {"Kalman a 10", "Kalman with motor force, hand unknown"},
      {"Kalman hand (default)", "Kalman with motor force and hand (default)"},
      {"Kalman hand, half as stiff and damped", "the same, hand set half as stiff and damped"},
      {"Kalman hand, mass set to 0.2 kg", "the same, mass set to 0.2 kg"},
      {"Kalman hand, mass set to 0.6 kg", "the same, mass set to 0.6 kg"},
      {"Kalman hand, mass set to 0.1 kg", "the same, mass set to 0.1 kg"},
      {"Kalman hand, mass set to 1 kg", "the same, mass set to 1 kg"}};
  std::vector<Cells> table;
  for (const auto& [key, label] : kShown) {
    const json& row = only(rows, [estimator = key](const json& r) {
      return r.at("motion") == "paper_rigid in the loop" && r.at("estimator") == estimator;
    });
    table.push_back({label, fixed(row, "transparency_percent", 0),
                     fixed(row, "force_error_percent", 0), fixed(row, "clamped_percent", 0),
                     fixed(row, "path_deviation_mm", 2), fixed(row, "excess_reversals", 1)});
  }
  return markdown({"estimator", "transparency %", "force error rms %", "clamped %",
                   "path deviation rms, mm", "excess reversals"},
                  table);
}

std::string velocity_cases_table(const std::vector<json>& outputs) {
  std::vector<Cells> table;
  for (const json& row : outputs.at(0).at("rows")) {
    if (row.at("estimator") != "default") continue;
    table.push_back({text(row, "motion"), fixed(row, "force_error_percent", 1),
                     fixed(row, "beyond_jnd_percent", 1), fixed(row, "transparency_percent", 1),
                     fixed(row, "path_deviation_mm", 2)});
  }
  return markdown(
      {"case", "force error rms %", "beyond the JND %", "transparency %", "path deviation rms, mm"},
      table);
}

// --- deadbands ------------------------------------------------------------------------------

std::string deadband_table(const std::vector<json>& outputs) {
  const json& rows = outputs.at(0).at("rows");
  std::vector<Cells> table;
  for (const char* tissue : {"palpation", "paper soft", "paper rigid"}) {
    for (const bool is_thinned : {false, true}) {
      const json& row = only(rows, [&](const json& r) {
        return r.at("tissue") == tissue && r.at("interaction") == "local" &&
               r.at("hops") == (is_thinned ? "2, 3" : "none") &&
               (!is_thinned || number(r.at("ratio")) == 0.05);
      });
      table.push_back({tissue, is_thinned ? "5 %" : "off", fixed(row, "motions_saved_percent", 0),
                       fixed(row, "interactions_saved_percent", 0),
                       fixed(row, "transparency_percent", 1), fixed(row, "force_error_percent", 1),
                       fixed(row, "path_deviation_mm", 3)});
    }
  }
  return markdown({"tissue", "deadband", "motions saved %", "interactions saved %",
                   "transparency %", "force error rms %", "path deviation rms, mm"},
                  table);
}

// --- tasks ----------------------------------------------------------------------------------

std::string task_motion_table(const std::vector<json>& outputs) {
  std::vector<Cells> table;
  for (const json& row : outputs.at(0).at("motions").at("rows")) {
    table.push_back({text(row, "motion"), fixed(row, "path_mm", 0),
                     fixed(row, "path_error_percent", 1), fixed(row, "path_error_fine_percent", 1),
                     fixed(row, "smoothness", 1), fixed(row, "smoothness_seen", 1),
                     fixed(row, "smoothness_fine", 1)});
  }
  return markdown({"motion", "path mm", "`path_m`, error %", "without encoder steps %",
                   "smoothness", "`smoothness`", "without encoder steps"},
                  table);
}

std::string staircase_table(const std::vector<json>& outputs) {
  std::vector<Cells> table;
  for (const json& row : outputs.at(0).at("staircases").at("rows")) {
    table.push_back({fixed(row, "start", 1), fixed(row, "reversals", 0), fixed(row, "trials", 0),
                     fixed(row, "too_high_percent", 0), fixed(row, "spread_percent", 0)});
  }
  return markdown({"start, of the threshold", "reversals", "trials", "threshold too high by %",
                   "spread of one series %"},
                  table);
}

// --- how true -------------------------------------------------------------------------------

struct TruthRow {
  const char* label;
  const char* arguments;
};
constexpr TruthRow kTruthRows[] = {
    {"block with an inclusion, no disturbance", "deploy/sessions/default.txtpb"},
    {"the same, physics at 50 Hz, 50 ms away, 20 % loss each way",
     "deploy/sessions/default.txtpb --set physics.rate_hz=50 --set faults.tool_motion.delay_ms=50 "
     "--set faults.tool_motion.loss_ratio=0.2 --set faults.interaction.delay_ms=50 "
     "--set faults.interaction.loss_ratio=0.2"},
    {"the same, with the force held between messages",
     "deploy/sessions/default.txtpb --set mofc.interaction=held --set physics.rate_hz=50 "
     "--set faults.tool_motion.delay_ms=50 --set faults.tool_motion.loss_ratio=0.2 "
     "--set faults.interaction.delay_ms=50 --set faults.interaction.loss_ratio=0.2"},
    {"the block, 1 % of the readings lost inside the tick (hop 1)",
     "deploy/sessions/default.txtpb --set faults.device_state.loss_ratio=0.01"},
    {"the block, twenty times a second no tick for 4 ms",
     "deploy/sessions/default.txtpb "
     "--set 'faults.device.skip={from_s:0.0201,until_s:0.024,every_s:0.05}'"},
    {"the block, 5 % of the ticks late by 1 to 5 periods",
     "deploy/sessions/default.txtpb --set faults.device.late_ratio=0.05"},
    {"organ from a point cloud (`cloud`)", "deploy/sessions/cloud.txtpb"},
    {"organ from a tetrahedral mesh (`liver`)", "deploy/sessions/liver.txtpb"},
    {"the same, physics at 50 Hz, 50 ms away, 20 % loss each way",
     "deploy/sessions/liver.txtpb --set physics.rate_hz=50 --set faults.tool_motion.delay_ms=50 "
     "--set faults.tool_motion.loss_ratio=0.2 --set faults.interaction.delay_ms=50 "
     "--set faults.interaction.loss_ratio=0.2"}};

DocFigures truth() {
  DocFigures figures{.name = "truth"};
  for (const TruthRow& row : kTruthRows) {
    figures.commands.push_back(std::string("palpate loopback ") + row.arguments);
  }
  figures.table = [](const std::vector<json>& outputs) {
    std::vector<Cells> rows;
    for (std::size_t i = 0; i < outputs.size(); ++i) {
      const json& run = outputs[i];
      const auto percent = [&](const json& value) { return fixed(100.0 * number(value), 1); };
      rows.push_back({kTruthRows[i].label, percent(run.at("transparency").at("ideal")),
                      fixed(number(run.at("gain")), 3), percent(run.at("force_error_rms_ratio")),
                      percent(run.at("beyond_jnd_ratio")),
                      fixed(1e3 * number(run.at("path_deviation_rms_m")), 3),
                      percent(run.at("clamp_ratio"))});
    }
    return markdown({"session", "transparency %", "gain", "force error rms %", "beyond the JND %",
                     "path deviation rms, mm", "clamped %"},
                    rows);
  };
  return figures;
}

// --- disturbed sessions ---------------------------------------------------------------------

std::string sessions_table(const std::vector<json>& outputs) {
  std::vector<std::string> sessions;
  std::vector<Cells> rows;
  for (const json& row : outputs.at(0).at("rows")) {
    if (sessions.empty() || sessions.back() != text(row, "session")) {
      sessions.push_back(text(row, "session"));
    }
    const std::string disturbance = text(row, "disturbance");
    auto cells = std::find_if(rows.begin(), rows.end(),
                              [&](const Cells& c) { return c.front() == disturbance; });
    if (cells == rows.end()) cells = rows.insert(rows.end(), {disturbance});
    cells->push_back(fmt::format("{}, {} %, {} mm, {}, {}", fixed(row, "capped_transparency", 3),
                                 fixed(row, "force_error_percent", 1), fixed(row, "path_rms_mm", 3),
                                 fixed(row, "excess_reversals", 0),
                                 energy(number(row.at("min_true_energy_uj")))));
  }
  Cells head{"disturbance"};
  for (const std::string& session : sessions) head.push_back(fmt::format("`{}`", session));
  return markdown(head, rows);
}

// --- real processes in real time ------------------------------------------------------------

std::string joined(const json& row, const std::vector<const char*>& keys, int digits) {
  std::string all;
  for (const char* key : keys) {
    if (!all.empty()) all += " / ";
    all += fixed(row, key, digits);
  }
  return all;
}

std::string faults_table(const std::vector<json>& outputs) {
  std::vector<Cells> rows;
  for (const json& row : outputs.at(0).at("rows")) {
    const auto ms = [&](const char* key) {
      return row.at(key).is_null() ? std::string("–") : fixed(row, key, 1) + " ms";
    };
    std::string safe = ms("safe_after_ms");
    if (safe != "–") safe += " (" + fixed(row, "safe_limit_ms", 0) + " ms)";
    rows.push_back({text(row, "fault"), fixed(row, "noticed_newton", 2),
                    fixed(row, "peak_newton", 2), energy(number(row.at("min_true_energy_uj"))),
                    safe, ms("back_after_ms")});
  }
  return markdown({"fault while the hand presses", "N when noticed", "largest N after",
                   "least true energy", "safe after (documented)", "tissue back after"},
                  rows);
}

std::string realtime_table(const std::vector<json>& outputs) {
  std::vector<Cells> rows;
  for (const json& row : outputs.at(0).at("rows")) {
    rows.push_back({fmt::format("`{}`", text(row, "session")), text(row, "conditions"),
                    fixed(row, "transparency_percent", 1), fixed(row, "answered_percent", 2),
                    fixed(row, "skipped_percent", 2),
                    joined(row, {"reply_p50_us", "reply_p99_us", "reply_p999_us"}, 0),
                    joined(row, {"lateness_p50_us", "lateness_p99_us", "lateness_p999_us"}, 0),
                    joined(row, {"force_age_p50_ms", "force_age_p99_ms"}, 0),
                    energy(number(row.at("min_true_energy_uj"))), fixed(row, "pictures_per_s", 0)});
  }
  return markdown({"session", "conditions", "T %", "answered %", "skipped %",
                   "reply p50 / p99 / p99.9 µs", "lateness p50 / p99 / p99.9 µs",
                   "force age p50 / p99 ms", "least true energy", "pictures/s"},
                  rows);
}

std::string exchange_table(const std::vector<json>& outputs) {
  const std::vector<const char*> us{"p50_us", "p99_us", "p999_us"};
  std::vector<Cells> rows;
  for (const json& row : outputs.at(0).at("rows")) {
    const std::string link = text(row, "link");
    if (link == "palpate, ipc") {
      rows.push_back({text(row, "case"), joined(row, us, 0),
                      joined(row, {"p50_to_raw", "p99_to_raw", "p999_to_raw"}, 2), "–", "–"});
    }
    if (link == "palpate, --together") rows.back()[3] = joined(row, us, 0);
    if (link == "Gazebo Transport") rows.back()[4] = joined(row, us, 0);
  }
  return markdown({"case", "palpate, ipc", "times the ZeroMQ ipc echo", "`--together`",
                   "Gazebo Transport echo"},
                  rows);
}

// --- how safe -------------------------------------------------------------------------------

/// The adversities that break an assumption of the guarantee (docs/theory.md §1).
bool is_outside(const std::string& adversity) {
  for (const char* broken : {"profile friction 2×", "profile friction 5×",
                             "profile with the other kind", "hand of 1 m/s", "hand of 2 m/s"}) {
    if (adversity.starts_with(broken)) return true;
  }
  return false;
}

std::string safety_table(const std::vector<json>& outputs) {
  struct Sum {
    std::uint64_t runs = 0;
    std::uint64_t negative = 0;
    double least_microjoule = 0.0;
    void add(const json& row) {
      runs += static_cast<std::uint64_t>(number(row.at("seeds")));
      negative += static_cast<std::uint64_t>(number(row.at("negative_runs")));
      least_microjoule = std::min(least_microjoule, number(row.at("min_true_energy_uj")));
    }
  };
  std::map<std::string, std::array<Sum, 2>> sums;
  for (const json& row : outputs.at(0).at("adversity").at("rows")) {
    sums[text(row, "mode")][is_outside(text(row, "adversity")) ? 1 : 0].add(row);
  }
  std::vector<Cells> rows;
  for (const char* mode : {"none", "paper", "vector", "guard"}) {
    Cells cells{mode};
    for (const Sum& sum : sums.at(mode)) {
      cells.push_back(fmt::format("{} of {}", sum.negative, sum.runs));
      cells.push_back(energy(sum.least_microjoule));
    }
    rows.push_back(cells);
  }
  return markdown({"mode", "runs below −1 µJ", "least true energy",
                   "with an assumption broken: below −1 µJ", "least true energy"},
                  rows);
}

/// Rows come in pairs, without and with the protection.
std::string monitor_table(const std::vector<json>& outputs) {
  const json& all = outputs.at(0).at("monitor").at("rows");
  std::vector<Cells> rows;
  for (std::size_t i = 0; i + 1 < all.size(); i += 2) {
    const json& without = all.at(i);
    const json& with = all.at(i + 1);
    const auto negative = [](const json& row) {
      return fmt::format("{} of {}", number(row.at("negative_runs")), number(row.at("seeds")));
    };
    rows.push_back({text(without, "case"), text(without, "friction"), negative(without),
                    energy(number(without.at("min_true_energy_uj"))), text(with, "protection"),
                    negative(with), energy(number(with.at("min_true_energy_uj"))),
                    fixed(with, "monitor_reductions", 0), fixed(with, "ledger_excesses", 0)});
  }
  return markdown({"case", "friction", "without: below −1 µJ", "least true energy", "with",
                   "below −1 µJ", "least true energy", "commands reduced", "ledgers too high"},
                  rows);
}

}  // namespace

std::string DocFigures::shown_commands() const {
  if (commands.size() == 1) return commands.front();
  return commands.front() + " (and " + std::to_string(commands.size() - 1) +
         " more, tests/bench/doc_figures.cpp)";
}

std::vector<DocFigures> doc_figures() {
  return {
      truth(),
      {.name = "safety",
       .commands = {"guarantee_bench --quick --only adversity"},
       .is_checked = false,
       .table = safety_table},
      {.name = "monitor",
       .commands = {"guarantee_bench --only monitor"},
       .is_checked = false,
       .table = monitor_table},
      {.name = "controllers",
       .commands = {"paper_experiments --excerpt"},
       .table = controllers_table},
      {.name = "paper_fit", .commands = {"paper_experiments --fit --quick"}, .table = fit_table},
      {.name = "paper_sensitivity",
       .commands = {"paper_experiments --fit"},
       .is_checked = false,
       .table = sensitivity_table},
      {.name = "transparency",
       .commands = {"transparency_bench --quick"},
       .table = transparency_table},
      {.name = "black_box",
       .commands = {"transparency_bench --black-box"},
       .table = black_box_table},
      {.name = "disturbed",
       .commands = {"transparency_bench --disturbed --excerpt"},
       .table = disturbed_table},
      {.name = "sessions",
       .commands = {"transparency_bench --disturbed=sessions"},
       .is_checked = false,
       .table = sessions_table},
      {.name = "faults",
       .commands = {"palpate_faults"},
       .is_checked = false,
       .is_of_real_time = true,
       .table = faults_table},
      {.name = "realtime",
       .commands = {"realtime_bench"},
       .is_checked = false,
       .is_of_real_time = true,
       .table = realtime_table},
      {.name = "network",
       .commands = {"realtime_bench --network --quick"},
       .is_checked = false,
       .is_of_real_time = true,
       .table = realtime_table},
      {.name = "exchange",
       .commands = {"exchange_bench --quick"},
       .is_checked = false,
       .is_of_real_time = true,
       .table = exchange_table},
      {.name = "descriptions",
       .commands = {"descriptions_bench"},
       .is_checked = false,
       .is_of_real_time = true,
       .table = descriptions_table},
      {.name = "velocity", .commands = {"velocity_bench --quick"}, .table = velocity_table},
      {.name = "cases", .commands = {"velocity_bench --quick"}, .table = velocity_cases_table},
      {.name = "deadbands", .commands = {"deadband_bench"}, .table = deadband_table},
      {.name = "task_motion", .commands = {"task_bench"}, .table = task_motion_table},
      {.name = "staircases", .commands = {"task_bench"}, .table = staircase_table},
  };
}

}  // namespace palpate::bench
