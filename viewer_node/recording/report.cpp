#include "viewer_node/recording/report.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "common/telemetry/metrics.h"
#include "common/telemetry/quantile.h"
#include "common/telemetry/summary.h"
#include "viewer_node/recording/recording.h"

namespace palpate {
namespace {

// Layout of a figure, in SVG units.
constexpr double kWidth = 860.0;
constexpr double kHeight = 240.0;
constexpr double kLeft = 64.0;
constexpr double kBottom = 34.0;
constexpr double kTop = 10.0;
constexpr double kRight = 10.0;
constexpr int kColumns = 780;  // horizontal resolution

constexpr const char* kStyle = R"(
:root { color-scheme: light dark; --ink: #1b1f24; --faint: #d5d9de; --paper: #fff;
  --a: #0b63ce; --b: #d9480f; --c: #2b8a3e; --d: #868e96; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e8eb; --faint: #3a4048; --paper: #15181c;
  --a: #6ab0ff; --b: #ff9f6b; --c: #69db7c; --d: #9aa2ab; } }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper);
  max-width: 900px; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.1rem; margin: 2rem 0 .3rem; }
svg { width: 100%; height: auto; } svg text { font-size: 11px; fill: var(--ink); }
.grid { stroke: var(--faint); } .line { fill: none; stroke-width: 1.3; }
.s0 { stroke: var(--a); } .s1 { stroke: var(--b); } .s2 { stroke: var(--c); } .s3 { stroke: var(--d); }
.key { display: inline-block; margin-right: 1.2em; } .key svg { width: 1.4em; height: .7em; }
table { border-collapse: collapse; } td, th { text-align: left; padding: .15rem 1.2rem .15rem 0;
  border-bottom: 1px solid var(--faint); } pre { overflow: auto; font-size: 12px; }
)";

std::string escaped(const std::string& text) {
  std::string html;
  for (const char c : text) {
    switch (c) {
      case '<':
        html += "&lt;";
        break;
      case '>':
        html += "&gt;";
        break;
      case '&':
        html += "&amp;";
        break;
      case '"':
        html += "&quot;";
        break;
      default:
        html += c;
    }
  }
  return html;
}

struct Axis {
  double low = 0.0;
  double high = 1.0;
  bool is_logarithmic = false;

  [[nodiscard]] double share(double value) const {
    return is_logarithmic ? std::log(value / low) / std::log(high / low)
                          : (value - low) / (high - low);
  }
};

Axis axis_of(double low, double high) {
  if (!(low < high)) {  // one value, or none
    const double middle = std::isfinite(low) ? low : 0.0;
    return {.low = middle - 0.5, .high = middle + 0.5};
  }
  return {.low = low, .high = high};
}

/// About `count` round values: 1, 2 or 5 times a power of ten.
std::vector<double> ticks_of(const Axis& axis, int count) {
  std::vector<double> ticks;
  if (axis.is_logarithmic) {
    for (double tick = std::pow(10.0, std::ceil(std::log10(axis.low) - 1e-9));
         tick <= axis.high * (1.0 + 1e-9); tick *= 10.0) {
      ticks.push_back(tick);
    }
    return ticks;
  }
  const double raw = (axis.high - axis.low) / count;
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  const double digit = raw / power;
  const double step = power * (digit <= 1.0 ? 1.0 : digit <= 2.0 ? 2.0 : digit <= 5.0 ? 5.0 : 10.0);
  const double first = std::ceil(axis.low / step);
  for (int i = 0; (first + i) * step <= axis.high; ++i) ticks.push_back((first + i) * step);
  return ticks;
}

/// Lines over x, reduced to the figure's resolution: the first, smallest, largest and last value of
/// each column, so that peaks stay. Values that are not finite leave a gap.
class Figure {
 public:
  Figure(std::string title, std::string x_label, std::string y_label)
      : title_(std::move(title)), x_label_(std::move(x_label)), y_label_(std::move(y_label)) {}

  void add(std::string name, const std::vector<double>& x, const std::vector<double>& y) {
    lines_.push_back({std::move(name), {}, {}});
    Line& line = lines_.back();
    for (std::size_t i = 0; i < x.size(); ++i) {
      line.x.push_back(x[i]);
      line.y.push_back(y[i]);
      if (!std::isfinite(y[i]) || !std::isfinite(x[i])) continue;
      x_low_ = std::min(x_low_, x[i]);
      x_high_ = std::max(x_high_, x[i]);
      y_low_ = std::min(y_low_, y[i]);
      y_high_ = std::max(y_high_, y[i]);
    }
  }
  void set_y(double low, double high) {
    y_low_ = low;
    y_high_ = high;
  }
  void set_logarithmic_x() { is_logarithmic_ = true; }

  [[nodiscard]] std::string html() const {
    std::string html = "<h2>" + escaped(title_) + "</h2>\n";
    if (!(x_low_ <= x_high_)) return html + "<p>Not in this recording.</p>\n";
    Axis x = axis_of(x_low_, x_high_);
    x.is_logarithmic = is_logarithmic_ && x.low > 0.0;
    Axis y = axis_of(y_low_, y_high_);
    const double margin = 0.04 * (y.high - y.low);
    y.low -= margin;
    y.high += margin;

    html += "<p>";
    for (std::size_t i = 0; i < lines_.size(); ++i) {
      html += fmt::format(
          "<span class=\"key\"><svg viewBox=\"0 0 14 7\"><path class=\"line s{}\" d=\"M0 4H14\"/>"
          "</svg> {}</span>",
          i % 4, escaped(lines_[i].name));
    }
    html +=
        fmt::format("</p>\n<svg viewBox=\"0 0 {:.0f} {:.0f}\" role=\"img\" aria-label=\"{}\">\n",
                    kWidth, kHeight, escaped(title_));
    for (const double tick : ticks_of(y, 5)) {
      const double at = y_at(y, tick);
      html += fmt::format(
          "<path class=\"grid\" d=\"M{:.0f} {:.1f}H{:.0f}\"/><text x=\"{:.0f}\" y=\"{:.1f}\" "
          "text-anchor=\"end\">{:g}</text>\n",
          kLeft, at, kWidth - kRight, kLeft - 5, at + 4, rounded(tick));
    }
    for (const double tick : ticks_of(x, 8)) {
      const double at = x_at(x, tick);
      html += fmt::format(
          "<path class=\"grid\" d=\"M{:.1f} {:.0f}V{:.0f}\"/><text x=\"{:.1f}\" y=\"{:.0f}\" "
          "text-anchor=\"middle\">{:g}</text>\n",
          at, kTop, kHeight - kBottom, at, kHeight - kBottom + 14, rounded(tick));
    }
    html += fmt::format(
        "<text x=\"{:.0f}\" y=\"{:.0f}\" text-anchor=\"end\">{}</text>"
        "<text x=\"12\" y=\"{:.0f}\" transform=\"rotate(-90 12 {:.0f})\" "
        "text-anchor=\"middle\">{}</text>\n",
        kWidth - kRight, kHeight - 4, escaped(x_label_), kHeight / 2, kHeight / 2,
        escaped(y_label_));
    for (std::size_t i = 0; i < lines_.size(); ++i) {
      html += fmt::format("<path class=\"line s{}\" d=\"{}\"/>\n", i % 4, path(lines_[i], x, y));
    }
    return html + "</svg>\n";
  }

 private:
  struct Line {
    std::string name;
    std::vector<double> x;
    std::vector<double> y;
  };

  static double rounded(double tick) { return std::abs(tick) < 1e-12 ? 0.0 : tick; }
  static double x_at(const Axis& axis, double value) {
    return kLeft + axis.share(value) * (kWidth - kLeft - kRight);
  }
  static double y_at(const Axis& axis, double value) {
    return kHeight - kBottom - std::clamp(axis.share(value), 0.0, 1.0) * (kHeight - kBottom - kTop);
  }

  [[nodiscard]] std::string path(const Line& line, const Axis& x, const Axis& y) const {
    std::string d;
    bool is_drawing = false;
    const auto point = [&](std::size_t i) {
      d += fmt::format("{}{:.1f} {:.1f}", is_drawing ? 'L' : 'M', x_at(x, line.x[i]),
                       y_at(y, line.y[i]));
      is_drawing = true;
    };
    const auto column = [&](std::size_t i) {
      return static_cast<int>(x.share(line.x[i]) * kColumns);
    };
    for (std::size_t i = 0; i < line.x.size();) {
      if (!std::isfinite(line.y[i]) || !std::isfinite(line.x[i])) {
        is_drawing = false;
        ++i;
        continue;
      }
      std::size_t end = i;
      std::size_t least = i;
      std::size_t greatest = i;
      while (end < line.x.size() && std::isfinite(line.y[end]) && column(end) == column(i)) {
        if (line.y[end] < line.y[least]) least = end;
        if (line.y[end] > line.y[greatest]) greatest = end;
        ++end;
      }
      std::array<std::size_t, 4> shown = {i, least, greatest, end - 1};
      std::sort(shown.begin(), shown.end());
      const auto shown_end = std::unique(shown.begin(), shown.end());
      std::for_each(shown.begin(), shown_end, point);
      i = end;
    }
    return d;
  }

  std::string title_;
  std::string x_label_;
  std::string y_label_;
  std::vector<Line> lines_;
  bool is_logarithmic_ = false;
  double x_low_ = INFINITY;
  double x_high_ = -INFINITY;
  double y_low_ = INFINITY;
  double y_high_ = -INFINITY;
};

/// Share of ticks at or below each duration.
void add_distribution(Figure& figure, const std::string& name, std::vector<double> microseconds) {
  constexpr double kLeast_us = 1.0;  // lower limit of the axis
  std::sort(microseconds.begin(), microseconds.end());
  std::vector<double> x;
  std::vector<double> share;
  for (std::size_t i = 0; i < microseconds.size(); ++i) {
    x.push_back(std::max(microseconds[i], kLeast_us));
    share.push_back(static_cast<double>(i + 1) / static_cast<double>(microseconds.size()));
  }
  if (!x.empty()) figure.add(name, x, share);
}

std::string quantiles(std::vector<double> values) {
  if (values.empty()) return "–";
  const auto at = [&](double q) { return quantile(values, q); };
  return fmt::format("{:.0f} / {:.0f} / {:.0f} / {:.0f} µs", at(0.5), at(0.99), at(0.999), at(1.0));
}

/// The run, column by column.
struct Columns {
  std::vector<double> t_s;
  std::array<std::vector<double>, 3> position_mm;
  std::array<std::vector<double>, 3> asked_newton;
  std::array<std::vector<double>, 3> applied_newton;
  std::vector<double> asked_norm_newton, applied_norm_newton, f_max_newton;
  std::vector<double> ledger_millijoule, true_millijoule;
  std::vector<double> transparency;
  std::vector<double> reply_us, lateness_us, force_age_us;
  RunStatistics statistics;
  std::uint64_t unanswered_ticks = 0;
};

Columns columns_of(RecordingFile& recording, const std::function<void(double)>& on_progress) {
  Columns c;
  std::optional<TimePoint> begin;
  ProjectedTransparency transparency;
  for_each_row(recording, [&](const TickRow& row) {
    if (on_progress) on_progress(recording.passed_ratio());
    const DeviceTick& device = row.device;
    if (!begin) begin = device.sampled_at;
    c.statistics.add(row, {});
    c.t_s.push_back(to_seconds(device.sampled_at - *begin));
    const Vector3 asked =
        row.mofc ? row.mofc->asked_force_on_hand_newton : Vector3(Vector3::Constant(kNaN));
    for (std::size_t i = 0; i < 3; ++i) {
      const auto axis = static_cast<Eigen::Index>(i);
      c.position_mm[i].push_back(1e3 * device.measured_tool_position_world_m[axis]);
      c.asked_newton[i].push_back(asked[axis]);
      c.applied_newton[i].push_back(device.force_on_hand_newton[axis]);
    }
    c.asked_norm_newton.push_back(asked.norm());
    c.applied_norm_newton.push_back(device.force_on_hand_newton.norm());
    c.f_max_newton.push_back(row.mofc ? row.mofc->f_max_newton.minCoeff() : kNaN);
    c.ledger_millijoule.push_back(row.mofc ? 1e3 * row.mofc->ledger_energy_joule : kNaN);
    c.true_millijoule.push_back(1e3 * device.true_energy_joule);
    if (row.mofc) transparency.add(asked, device.force_on_hand_newton);
    c.transparency.push_back(transparency.mean());
    const auto micro = [](Duration d) { return static_cast<double>(d.count()) * 1e-3; };
    c.lateness_us.push_back(micro(device.lateness));
    if (device.is_answered) {
      c.reply_us.push_back(micro(device.reply_time));
    } else {
      ++c.unanswered_ticks;
    }
    if (row.mofc && row.mofc->force_age.count() > 0) {
      c.force_age_us.push_back(micro(row.mofc->force_age));
    }
  });
  return c;
}

std::string table(const RecordingFile& recording, const Columns& c) {
  const RunStatistics& s = c.statistics;
  std::string html = "<table>\n";
  const auto line = [&](const char* what, const std::string& value) {
    html += fmt::format("<tr><th>{}</th><td>{}</td></tr>\n", what, escaped(value));
  };
  const auto reversals = s.reversals();
  line("session", recording.name() + ", seed " + recording.about("seed"));
  line("controller", recording.about("controller"));
  line("recorded by", recording.about("recorded_by") + ", version " + recording.about("version"));
  line("length", fmt::format("{:.3f} s, {} ticks", recording.length_s(), s.ticks()));
  line("in contact", fmt::format("{} ticks", s.contact_ticks()));
  line("transparency",
       figure(s.vector_transparency(), "{:.3f}") + " (rendered / requested, projected)");
  line("ideal force", "not recorded; palpate loopback SESSION --hand RECORDING computes one");
  line("clamped", figure(100.0 * s.clamp_ratio(), "{:.1f} %") + " of the ticks with a force");
  line("largest force", figure(s.maximum_force_newton(), "{:.3f} N"));
  line("least true energy", figure(1e6 * s.minimum_true_energy_joule(), "{:.3f} µJ"));
  line("velocity reversals",
       fmt::format("{}, {}, {} (x, y, z)", reversals[0], reversals[1], reversals[2]));
  line("not answered in time", fmt::format("{} ticks", c.unanswered_ticks));
  line("reply time p50 / p99 / p99.9 / max", quantiles(c.reply_us));
  line("tick lateness p50 / p99 / p99.9 / max", quantiles(c.lateness_us));
  line("age of the force p50 / p99 / p99.9 / max", quantiles(c.force_age_us));
  if (!recording.mcap().is_whole()) line("recording", "incomplete: its end is missing");
  return html + "</table>\n";
}

}  // namespace

std::string report_html(RecordingFile& recording, const std::function<void(double)>& on_progress) {
  const Columns c = columns_of(recording, on_progress);
  const std::string title = "Palpate: " + recording.name() + ", " + recording.about("controller");
  std::string html =
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; "
      "style-src 'unsafe-inline'\">\n<title>" +
      escaped(title) + "</title>\n<style>" + kStyle + "</style></head>\n<body>\n<h1>" +
      escaped(title) + "</h1>\n" + table(recording, c);

  constexpr const char* kAxes[] = {"x", "y", "z"};
  constexpr const char* kTime = "time / s";
  Figure position("Tool position, measured, world", kTime, "mm");
  for (std::size_t i = 0; i < 3; ++i) position.add(kAxes[i], c.t_s, c.position_mm[i]);
  html += position.html();

  Figure force("Force on the hand: before and after the clamp", kTime, "N");
  force.add("requested", c.t_s, c.asked_norm_newton);
  force.add("rendered", c.t_s, c.applied_norm_newton);
  html += force.html();
  for (std::size_t i = 0; i < 3; ++i) {
    Figure component(std::string("Force on the hand, ") + kAxes[i], kTime, "N");
    component.add("requested", c.t_s, c.asked_newton[i]);
    component.add("rendered", c.t_s, c.applied_newton[i]);
    html += component.html();
  }

  Figure bound("Bound of the clamp, smallest component", kTime, "N");
  bound.add("f_max", c.t_s, c.f_max_newton);
  html += bound.html();

  Figure energy("Energy: the controller's ledger and, for a simulated device, the true energy",
                kTime, "mJ");
  energy.add("ledger", c.t_s, c.ledger_millijoule);
  energy.add("true", c.t_s, c.true_millijoule);
  html += energy.html();

  Figure transparency("Transparency so far: rendered against requested, projected and capped",
                      kTime, "ratio");
  transparency.add("transparency", c.t_s, c.transparency);
  transparency.set_y(0.0, 1.0);
  html += transparency.html();

  Figure latency("Latency: share of ticks at or below each duration", "µs", "share");
  latency.set_logarithmic_x();
  add_distribution(latency, "reply time", c.reply_us);
  add_distribution(latency, "tick lateness", c.lateness_us);
  add_distribution(latency, "age of the force", c.force_age_us);
  latency.set_y(0.0, 1.0);
  html += latency.html();

  return html + "<h2>Session</h2>\n<pre>" + escaped(recording.about("session")) +
         "</pre>\n</body></html>\n";
}

}  // namespace palpate
