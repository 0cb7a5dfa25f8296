// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/recording/report_data.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include "common/telemetry/remote_events.h"

namespace palpate {
namespace {

using nlohmann::json;

constexpr double kMicro = 1e-3;       // of nanoseconds
constexpr double kShortest_us = 1.0;  // lower end of the axis of durations
constexpr std::size_t kDurationSteps = 240;

struct Series {
  const char* name;
  const char* colour;  // of the page's style sheet
};
constexpr Series kRequested{"requested", "asked"};
constexpr Series kRendered{"rendered", "applied"};
constexpr Series kIdeal{"ideal", "truth"};

/// The run, column by column.
struct Columns {
  std::vector<double> t_s;
  std::array<std::vector<double>, 3> position_mm, requested_newton, applied_newton, ideal_newton;
  std::vector<double> requested_norm_newton, applied_norm_newton, ideal_norm_newton, f_max_newton;
  std::vector<double> ledger_millijoule, true_millijoule, transparency;
  std::vector<double> requested_newton_m, applied_newton_m, ideal_newton_m;
  std::vector<double> reply_us, lateness_us, force_age_us;
  RequestComparison so_far;
  std::optional<std::uint64_t> session_id;
  std::optional<TimePoint> begin;

  void add(const TickRow& row);
};

void Columns::add(const TickRow& row) {
  const DeviceTick& device = row.device;
  if (!begin) begin = device.sampled_at;
  t_s.push_back(to_seconds(device.sampled_at - *begin));
  const Vector3 asked =
      row.mofc ? row.mofc->requested_force_on_hand_newton : Vector3(Vector3::Constant(kNaN));
  for (std::size_t i = 0; i < 3; ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    position_mm[i].push_back(1e3 * device.measured_tool_position_world_m[axis]);
    requested_newton[i].push_back(asked[axis]);
    applied_newton[i].push_back(device.force_on_hand_newton[axis]);
    ideal_newton[i].push_back(row.ideal_force_on_hand_newton[axis]);
  }
  requested_norm_newton.push_back(asked.norm());
  applied_norm_newton.push_back(device.force_on_hand_newton.norm());
  ideal_norm_newton.push_back(row.ideal_force_on_hand_newton.norm());
  f_max_newton.push_back(row.mofc ? row.mofc->f_max_newton.minCoeff() : kNaN);
  requested_newton_m.push_back(row.mofc ? row.mofc->requested_wrist_torque_newton_m.norm() : kNaN);
  applied_newton_m.push_back(device.wrist_torque_newton_m.norm());
  ideal_newton_m.push_back(row.ideal_wrist_torque_newton_m.norm());
  ledger_millijoule.push_back(row.mofc ? 1e3 * row.mofc->ledger_energy_joule : kNaN);
  true_millijoule.push_back(1e3 * device.true_energy_joule);
  if (session_id && session_id != row.device_session_id) so_far.interrupt();
  session_id = row.device_session_id;
  so_far.add(device, row.mofc);
  transparency.push_back(so_far.rendered().transparency());
  const auto micro = [](Duration d) { return static_cast<double>(d.count()) * kMicro; };
  lateness_us.push_back(micro(device.lateness));
  if (device.is_answered) reply_us.push_back(micro(device.reply_time));
  if (row.mofc && row.mofc->force_age.count() > 0) {
    force_age_us.push_back(micro(row.mofc->force_age));
  }
}

/// Five digits, null where it is not finite.
json value(double x) {
  if (!std::isfinite(x)) return nullptr;
  if (x == 0.0) return 0;
  const double scale = std::pow(10.0, 5.0 - std::ceil(std::log10(std::abs(x))));
  return std::round(x * scale) / scale;
}

class Reduction {
 public:
  explicit Reduction(const std::vector<double>& t_s)
      : size_(t_s.size()), step_(std::max<std::size_t>(1, 2 * size_ / kMostReportPoints)) {
    for (std::size_t i = 0; i < size_; i += step_) {
      x_.push_back(std::round(t_s[i] * 1e6) * 1e-6);
      if (step_ > 1) x_.push_back(std::round(t_s[std::min(i + step_ / 2, size_ - 1)] * 1e6) * 1e-6);
    }
  }
  [[nodiscard]] const json& x() const { return x_; }
  /// Smallest and largest value of each part, in the order in which they come.
  [[nodiscard]] json y(const std::vector<double>& values) const {
    json reduced = json::array();
    for (std::size_t i = 0; i < size_; i += step_) {
      std::optional<std::size_t> least;
      std::optional<std::size_t> greatest;
      for (std::size_t k = i; k < std::min(i + step_, size_); ++k) {
        if (!std::isfinite(values[k])) continue;
        if (!least || values[k] < values[*least]) least = k;
        if (!greatest || values[k] > values[*greatest]) greatest = k;
      }
      if (least && *greatest < *least) std::swap(*least, *greatest);
      reduced.push_back(least ? value(values[*least]) : json());
      if (step_ > 1) reduced.push_back(greatest ? value(values[*greatest]) : json());
    }
    return reduced;
  }

 private:
  std::size_t size_;
  std::size_t step_;
  json x_ = json::array();
};

json figure_of(std::size_t index, const char* x, const char* y) {
  return {{"title", report_titles()[index]},
          {"x", x},
          {"y", y},
          {"is_time", true},
          {"range", nullptr},
          {"series", json::array()},
          {"data", json::array()}};
}

void add_series(json& figure, const Series& series, json column) {
  figure["series"].push_back({{"name", series.name}, {"colour", series.colour}});
  figure["data"].push_back(std::move(column));
}

/// Share of the ticks at or below each duration.
json durations_of(std::size_t index, Columns& c) {
  json figure = figure_of(index, "µs", "share");
  figure["is_time"] = false;
  figure["range"] = {0.0, 1.05};
  double longest_us = 10.0 * kShortest_us;
  for (std::vector<double>* values : {&c.reply_us, &c.lateness_us, &c.force_age_us}) {
    std::sort(values->begin(), values->end());
    if (!values->empty()) longest_us = std::max(longest_us, values->back());
  }
  std::vector<double> x;
  for (std::size_t i = 0; i < kDurationSteps; ++i) {
    x.push_back(kShortest_us *
                std::pow(longest_us / kShortest_us, static_cast<double>(i) / (kDurationSteps - 1)));
  }
  json times = json::array();
  for (const double time_us : x) times.push_back(value(time_us));
  figure["data"].push_back(std::move(times));
  const auto add = [&](const Series& series, const std::vector<double>& sorted) {
    json share = json::array();
    for (const double time_us : x) {
      const auto below = std::upper_bound(sorted.begin(), sorted.end(), time_us * (1.0 + 1e-9));
      share.push_back(sorted.empty() ? json()
                                     : value(static_cast<double>(below - sorted.begin()) /
                                             static_cast<double>(sorted.size())));
    }
    add_series(figure, series, std::move(share));
  };
  add({"reply time", "applied"}, c.reply_us);
  add({"tick lateness", "asked"}, c.lateness_us);
  add({"age of the force", "ledger"}, c.force_age_us);
  return figure;
}

json figures_of(Columns& c) {
  const Reduction reduction(c.t_s);
  json figures = json::array();
  const auto add = [&](const char* unit,
                       const std::vector<std::pair<Series, const std::vector<double>*>>& series) {
    json figure = figure_of(figures.size(), "time / s", unit);
    figure["data"].push_back(reduction.x());
    for (const auto& [what, values] : series) {
      const bool is_known = std::any_of(values->begin(), values->end(),
                                        [](double value) { return std::isfinite(value); });
      if (is_known) add_series(figure, what, reduction.y(*values));
    }
    figures.push_back(std::move(figure));
  };
  add("mm", {{{"x", "asked"}, &c.position_mm[0]},
             {{"y", "applied"}, &c.position_mm[1]},
             {{"z", "ledger"}, &c.position_mm[2]}});
  add("N", {{kRequested, &c.requested_norm_newton},
            {kRendered, &c.applied_norm_newton},
            {kIdeal, &c.ideal_norm_newton}});
  for (std::size_t i = 0; i < 3; ++i) {
    add("N", {{kRequested, &c.requested_newton[i]},
              {kRendered, &c.applied_newton[i]},
              {kIdeal, &c.ideal_newton[i]}});
  }
  add("N·m", {{kRequested, &c.requested_newton_m},
              {kRendered, &c.applied_newton_m},
              {kIdeal, &c.ideal_newton_m}});
  add("N", {{{"f_max", "bound"}, &c.f_max_newton}});
  add("mJ",
      {{{"ledger", "ledger"}, &c.ledger_millijoule}, {{"true", "truth"}, &c.true_millijoule}});
  add("ratio", {{{"transparency", "applied"}, &c.transparency}});
  figures.back()["range"] = {0.0, 1.05};
  figures.push_back(durations_of(figures.size(), c));
  return figures;
}

/// The log lines of one node, from its counters.
template <class Record, class Counters>
class NodeLog {
 public:
  NodeLog(std::string name, std::vector<std::pair<std::uint64_t, ReportEvent>>& events)
      : name_(std::move(name)),
        events_(events),
        log_([this](spdlog::level::level_enum level, const std::string& text) {
          add(level >= spdlog::level::err    ? "error"
              : level == spdlog::level::warn ? "warn"
                                             : "info",
              text);
        }) {}
  void note(const TelemetryBatch<Record, Counters>& batch, std::uint64_t at_ns) {
    at_ns_ = at_ns;
    const bool is_first = sessions_.empty();
    if (sessions_.insert(batch.header.session_id).second && !is_first) {
      add("warn", "event=restarted");
    }
    log_.note(batch, TimePoint(Duration(static_cast<std::int64_t>(at_ns))));
  }

 private:
  void add(const char* level, const std::string& text) {
    events_.emplace_back(at_ns_, ReportEvent{0.0, level, name_, text});
  }
  std::string name_;
  std::vector<std::pair<std::uint64_t, ReportEvent>>& events_;
  RemoteEvents<Record, Counters> log_;
  std::set<std::uint64_t> sessions_;
  std::uint64_t at_ns_ = 0;
};

}  // namespace

const std::vector<std::string>& report_titles() {
  static const std::vector<std::string> titles{
      "Tool position, measured, world",
      "Force on the hand: before and after the clamp",
      "Force on the hand, x",
      "Force on the hand, y",
      "Force on the hand, z",
      "Torque on the joints of the wrist: before and after the clamp",
      "Bound of the clamp, smallest component",
      "Energy: the controller's ledger and, for a simulated device, the true energy",
      "Transparency so far: rendered against requested, projected and capped",
      "Latency: share of ticks at or below each duration"};
  return titles;
}

void read_report(RecordingFile& recording, ReportRun& report,
                 const std::function<void(double)>& on_progress) {
  Columns columns;
  std::vector<std::pair<std::uint64_t, ReportEvent>> events;  // by log time
  NodeLog<DeviceTick, DeviceCounters> device("device_node", events);
  NodeLog<MofcTick, MofcCounters> mofc("mofc_node", events);
  NodeLog<PhysicsTick, PhysicsCounters> physics("physics_node", events);
  std::optional<std::uint64_t> first_tick_ns;  // log time of the first recorded tick
  read_run(
      recording, report.run, [&](const TickRow& row) { columns.add(row); },
      [&](const RecordingFile::Item& item) {
        if (on_progress) on_progress(recording.passed_ratio());
        if (const auto* batch = std::get_if<DeviceBatch>(&item.message)) {
          if (!first_tick_ns && !batch->records.empty()) {
            first_tick_ns =
                recording.log_time_of(batch->header.session_id, batch->records.front().sampled_at);
          }
          device.note(*batch, item.log_time_ns);
        } else if (const auto* answers = std::get_if<MofcBatch>(&item.message)) {
          mofc.note(*answers, item.log_time_ns);
        } else if (const auto* steps = std::get_if<PhysicsBatch>(&item.message)) {
          physics.note(*steps, item.log_time_ns);
        }
      });
  for (const Marker& marker : recording.markers()) {
    events.emplace_back(marker.at_ns, ReportEvent{0.0, "marker", marker.origin, marker.text});
  }
  std::stable_sort(events.begin(), events.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  const std::uint64_t begin_ns = first_tick_ns.value_or(recording.mcap().begin_ns());
  for (auto& [at_ns, event] : events) {
    event.t_s = (static_cast<double>(at_ns) - static_cast<double>(begin_ns)) * 1e-9;
    report.events.push_back(std::move(event));
  }
  report.figures = figures_of(columns);
}

}  // namespace palpate
