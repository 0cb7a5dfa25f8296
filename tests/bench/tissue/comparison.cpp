// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/tissue/comparison.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string_view>
#include <utility>

#include "tests/bench/elastic/elastic_rows.h"
#include "tests/bench/tissue/recorded.h"
#include "tests/bench/tissue/tissue_problems.h"

namespace palpate::bench {
namespace {

using elastic::Law;

constexpr double kLibraryStep_s = 1e-3;
// Bullet keeps the sphere out only where the steps are short.
constexpr double kShortStep_s = 2e-3;
constexpr double kMiddleStep_s = 5e-3;
constexpr double kLongStep_s = 20e-3;  // a full solution of the library has this length
constexpr double kSample_s = 20e-3;    // between two looks at what is measured
// Until something has come to rest. Short steps of backward Euler damp little, and cost more.
constexpr double kLongest_s = 4.0;
constexpr double kLongestOfShortSteps_s = 1.2;
constexpr int kStillSamples = 10;  // that differ by less than
constexpr double kStill_ratio = 5e-4;
constexpr double kAbove_m = 5e-3;  // of the sphere at the start
constexpr double kPress_m_per_s = 0.4;
constexpr double kSlide_m_per_s = 0.2;  // the waves of the slab run at 10 m/s
constexpr double kTurn_rad_per_s = kTwist_rad / 1.2;

std::string counted(std::size_t elements, const char* kind) {
  return elements < 1000 ? fmt::format("{} {}", elements, kind)
                         : fmt::format("{},{:03} {}", elements / 1000, elements % 1000, kind);
}

}  // namespace

/// One body of one program, its steps and their CPU time.
class Comparison::Run {
 public:
  explicit Run(const Contender& contender) : body(contender.make()), step_s_(contender.step_s) {}
  std::unique_ptr<SoftBody> body;

  void step() {
    const double from_s = process_cpu_s();
    body->step(step_s_);
    cpu_us_.push_back(1e6 * (process_cpu_s() - from_s));
  }
  /// From now on the figures are of another part of the run.
  void begin_part() { cpu_us_.clear(); }

  /// Steps to the next look.
  void sample() {
    const auto steps = static_cast<int>(std::lround(kSample_s / step_s_));
    for (int i = 0; i < steps; ++i) step();
  }

  /// Moves evenly: `place(way)` for ways from 0 to `whole`, which is reached.
  template <class Place>
  void move(double whole, double speed, const Place& place) {
    const auto steps = static_cast<int>(std::ceil(whole / speed / step_s_ - 1e-9));
    for (int i = 1; i <= steps; ++i) {
      place(whole * i / steps);
      step();
    }
  }

  struct Settled {
    double value = 0.0;         ///< where it did not come to rest, the mean of the last second
    double spread_ratio = 0.0;  ///< largest less least of that second over it; 0: it is at rest
  };
  /// Until what is measured stays the same.
  template <class Quantity>
  Settled settle(const Quantity& quantity) {
    std::vector<double> values{quantity()};
    int still = 0;
    const double longest_s = step_s_ < kSample_s ? kLongestOfShortSteps_s : kLongest_s;
    while (still < kStillSamples && kSample_s * static_cast<double>(values.size()) < longest_s) {
      sample();
      values.push_back(quantity());
      const double change = values.back() - values[values.size() - 2];
      still = std::abs(change) < kStill_ratio * std::abs(values.back()) ? still + 1 : 0;
    }
    if (still == kStillSamples) return {.value = values.back()};
    const auto from = values.end() - std::lround(1.0 / kSample_s);
    const auto [least, largest] = std::minmax_element(from, values.end());
    const double mean =
        std::accumulate(from, values.end(), 0.0) / static_cast<double>(values.end() - from);
    return {.value = mean, .spread_ratio = (*largest - *least) / std::abs(mean)};
  }

  [[nodiscard]] double step_s() const { return step_s_; }
  [[nodiscard]] double mean_us() const {
    return std::accumulate(cpu_us_.begin(), cpu_us_.end(), 0.0) /
           static_cast<double>(cpu_us_.size());
  }
  [[nodiscard]] double p99_us() const {
    std::vector<double> sorted = cpu_us_;
    std::sort(sorted.begin(), sorted.end());
    return sorted[static_cast<std::size_t>(0.99 * static_cast<double>(sorted.size() - 1))];
  }

 private:
  double step_s_;
  std::vector<double> cpu_us_;
};

/// The same bar twice: of linear elements, and of an eighth as many that are quadratic.
struct Comparison::Bars {
  explicit Bars(bool is_quick)
      : fine(is_quick ? bar_mesh(3, 8) : bar_mesh(6, 16)),
        coarse(is_quick ? bar_mesh(2, 5) : bar_mesh(3, 8)),
        linear(counted(fine.element_count(), "linear")),
        quadratic(counted(coarse.element_count(), "quadratic")) {}

  elastic::Mesh fine;
  elastic::Mesh coarse;
  std::string linear;
  std::string quadratic;
};

/// Our classes and Bullet. @param bars  must outlive the contenders
void Comparison::add_solvers(const Bars& bars, elastic::BodyDescription (*body)(elastic::Mesh, Law),
                             std::vector<Contender>& contenders) {
  contenders.push_back({"palpate, classes of elastic/", bars.quadratic, kLongStep_s, [&bars, body] {
                          return elastic_soft_body(
                              body(elastic::quadratic(bars.coarse), Law::kStableNeoHookean));
                        }});
  contenders.push_back({"palpate, classes of elastic/", bars.linear, kLongStep_s, [&bars, body] {
                          return elastic_soft_body(body(bars.fine, Law::kStableNeoHookean));
                        }});
  contenders.push_back({"Bullet, neo-Hookean", bars.linear, kLongStep_s, [&bars, body] {
                          return bullet_soft_body(body(bars.fine, Law::kStableNeoHookean));
                        }});
  contenders.push_back({"Bullet, corotated linear", bars.linear, kLongStep_s, [&bars, body] {
                          return bullet_soft_body(body(bars.fine, Law::kCorotational));
                        }});
}

void Comparison::hang() {
  const Reference reference = references_.sag_m();
  add_reference("hang", reference, 1e3, references_.sag_checks());
  add_known("hang", "slender bar at small strain", "", "closed form", 1e3 * slender_sag_m(),
            1e3 * reference.value);
  const Bars bars(is_quick_);
  std::vector<Contender> contenders{
      {"palpate_tissue, begins at rest", bars.quadratic, kLibraryStep_s,
       [&] { return library_soft_body(hanging_bar(bars.coarse, Law::kStableNeoHookean), true); }},
      {"palpate_tissue, begins at rest", bars.linear, kLibraryStep_s,
       [&] { return library_soft_body(hanging_bar(bars.fine, Law::kStableNeoHookean), false); }}};
  add_solvers(bars, hanging_bar, contenders);
  for (const Contender& contender : contenders) hang(contender, reference);
  add_recorded("hang", 1e3 * reference.value);
  table_.add_gap();
}

void Comparison::hang(const Contender& contender, const Reference& reference) {
  Run run(contender);
  if (!run.body) return;
  const Run::Settled sag_m = run.settle([&] { return run.body->sag_m(); });
  add_run("hang", contender, run, 1e3 * sag_m.value, sag_m.value / reference.value - 1.0);
  note_unrest("hang", contender, sag_m.spread_ratio);
}

void Comparison::press_and_slide() {
  const Reference reference = references_.press_newton();
  const References::Along along(is_quick_);
  add_reference("press", reference, 1.0, references_.press_checks());
  add_known("press", "half-space (Hertz)", "", "closed form", hertz_newton(kPress_m),
            reference.value);
  add_known("press", "layer, small strain (Dimitriadis)", "", "closed form", layer_newton(kPress_m),
            reference.value);
  notes_.push_back(
      fmt::format("slide: the force at the end of the way is {:+.2f} % of that in the middle; the "
                  "error is the root mean square along the way over it",
                  1e2 * (along.at(kSlide_m) - 1.0)));
  const auto cells = is_quick_ ? std::pair{6, 3} : std::pair{20, 8};
  const elastic::Mesh fine = slab_mesh(cells.first, cells.second);
  const elastic::Mesh coarse = is_quick_ ? slab_mesh(4, 2) : slab_mesh(10, 4);
  const std::string linear = counted(fine.element_count(), "linear");
  const std::string quadratic = counted(coarse.element_count(), "quadratic");
  std::vector<Contender> contenders{
      {"palpate_tissue", quadratic, kLibraryStep_s,
       [&] { return library_soft_body(held_slab(coarse, Law::kStableNeoHookean), true); }},
      {"palpate_tissue", linear, kLibraryStep_s,
       [&] { return library_soft_body(held_slab(fine, Law::kStableNeoHookean), false); }},
      {"palpate, classes of elastic/", linear, kLongStep_s,
       [&] { return elastic_soft_body(held_slab(fine, Law::kStableNeoHookean)); }},
      {"Bullet, corotated linear", linear, kMiddleStep_s,
       [&] { return bullet_soft_body(held_slab(fine, Law::kCorotational)); }}};
  if (!is_quick_) {
    contenders.push_back({"Bullet, corotated linear", linear, kShortStep_s,
                          [&] { return bullet_soft_body(held_slab(fine, Law::kCorotational)); }});
  }
  for (const Contender& contender : contenders) press_and_slide(contender, reference, along);
  add_recorded("press", reference.value);
  table_.add_gap();
}

void Comparison::press_and_slide(const Contender& contender, const Reference& reference,
                                 const References::Along& along) {
  Run run(contender);
  if (!run.body) return;
  run.body->move_sphere(sphere_at(-kAbove_m));
  run.step();
  run.begin_part();
  run.move(kAbove_m + kPress_m, kPress_m_per_s,
           [&](double way_m) { run.body->move_sphere(sphere_at(way_m - kAbove_m)); });
  const auto force = [&] { return run.body->force_on_sphere_newton(); };
  const Run::Settled pressed = run.settle(force);
  add_run("press", contender, run, pressed.value, pressed.value / reference.value - 1.0);
  note_unrest("press", contender, pressed.spread_ratio);

  run.begin_part();
  double squares = 0.0;
  double sum_newton = 0.0;
  int samples = 0;
  const auto per_sample = static_cast<int>(std::lround(kSample_s / run.step_s()));
  int steps = 0;
  double last_m = 0.0;
  const auto look = [&] {
    if (steps++ % per_sample != 0 || last_m == 0.0) return;
    const double newton = force();
    const double error = newton / (reference.value * along.at(last_m)) - 1.0;
    squares += error * error;
    sum_newton += newton;
    ++samples;
  };
  run.move(kSlide_m, kSlide_m_per_s, [&](double way_m) {
    look();  // at the step before
    last_m = way_m;
    run.body->move_sphere(sphere_at(kPress_m, way_m));
  });
  add_run("slide", contender, run, sum_newton / samples, std::sqrt(squares / samples));
}

void Comparison::twist() {
  const Reference reference = references_.torque_newton_m();
  add_reference("twist", reference, 1.0, references_.torque_checks());
  add_known("twist", "Saint-Venant, ends may warp", "", "closed form",
            torsion_stiffness_newton_m2() * kTwist_rad / kBarLength_m, reference.value);
  const Bars bars(is_quick_);
  std::vector<Contender> contenders;
  add_solvers(bars, twisted_bar, contenders);
  for (const Contender& contender : contenders) twist(contender, reference);
  table_.add_gap();
}

void Comparison::twist(const Contender& contender, const Reference& reference) {
  Run run(contender);
  if (!run.body) return;
  run.move(kTwist_rad, kTurn_rad_per_s,
           [&](double angle_rad) { run.body->turn_lower_end(angle_rad); });
  const Run::Settled torque = run.settle([&] { return run.body->torque_newton_m(); });
  add_run("twist", contender, run, torque.value, torque.value / reference.value - 1.0);
  note_unrest("twist", contender, torque.spread_ratio);
}

void Comparison::add_reference(const char* problem, const Reference& reference, double unit,
                               const std::vector<Check>& checks) {
  table_.add({problem, "reference: palpate at rest", counted(reference.nodes, "nodes, quadratic"),
              "this run", NAN, unit * reference.value, NAN, NAN, NAN, NAN});
  notes_.push_back(fmt::format("{}: the last refinement changed the reference by {:.2f} %", problem,
                               1e2 * reference.changed_ratio));
  for (const Check& check : checks) {
    notes_.push_back(fmt::format("{}: {}: {:.4g}, {:.4g}: {:+.2f} %", problem, check.name,
                                 check.found, check.closed_form,
                                 1e2 * (check.found / check.closed_form - 1.0)));
  }
}

void Comparison::add_known(const char* problem, const std::string& program, const std::string& mesh,
                           const char* source, double value, double reference) {
  table_.add(
      {problem, program, mesh, source, NAN, value, 1e2 * (value / reference - 1.0), NAN, NAN, NAN});
}

void Comparison::add_recorded(const char* problem, double reference) {
  for (const RecordedRow& row : kRecorded) {
    if (std::string_view(row.problem) != problem) continue;
    add_known(problem, row.program, row.mesh, "recorded", row.value, reference);
  }
}

void Comparison::add_run(const char* problem, const Contender& contender, const Run& run,
                         double value, double error_ratio) {
  table_.add({problem, contender.program, contender.mesh, "this run", 1e3 * run.step_s(), value,
              1e2 * error_ratio, run.mean_us(), run.p99_us(), 1e-6 * run.mean_us() / run.step_s()});
}

void Comparison::note_unrest(const char* problem, const Contender& contender, double spread_ratio) {
  if (spread_ratio == 0.0) return;
  notes_.push_back(fmt::format(
      "{}: {}, {}, steps of {:.0f} ms: does not come to rest; mean of the last second, in which it "
      "varies by {:.2g} %",
      problem, contender.program, contender.mesh, 1e3 * contender.step_s, 1e2 * spread_ratio));
}

}  // namespace palpate::bench
