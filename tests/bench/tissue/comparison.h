// SPDX-License-Identifier: Apache-2.0
// comparison.h — the four problems of tissue_bench: force against CPU time, ours beside others.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "tests/bench/bench_output.h"
#include "tests/bench/tissue/references.h"
#include "tests/bench/tissue/soft_body.h"

namespace palpate::bench {

/// Runs the problems that it is asked for and keeps their rows, and what is to be said of them.
class Comparison {
 public:
  explicit Comparison(bool is_quick) : is_quick_(is_quick), references_(is_quick) {}

  void hang();
  /// The sphere is pressed in, and then slides: the rows of both.
  void press_and_slide();
  void twist();

  [[nodiscard]] const Table& table() const { return table_; }
  /// One to a line.
  [[nodiscard]] const std::vector<std::string>& notes() const { return notes_; }

 private:
  /// A program with a mesh and the length of its steps.
  struct Contender {
    std::string program;
    std::string mesh;
    double step_s = 0.0;
    std::function<std::unique_ptr<SoftBody>()> make;
  };
  struct Bars;
  class Run;

  static void add_solvers(const Bars& bars,
                          elastic::BodyDescription (*body)(elastic::Mesh, elastic::Law),
                          std::vector<Contender>& contenders);
  void hang(const Contender& contender, const Reference& reference);
  void press_and_slide(const Contender& contender, const Reference& reference,
                       const References::Along& along);
  void twist(const Contender& contender, const Reference& reference);

  void add_reference(const char* problem, const Reference& reference, double unit,
                     const std::vector<Check>& checks);
  void add_known(const char* problem, const std::string& program, const std::string& mesh,
                 const char* source, double value, double reference);
  void add_recorded(const char* problem, double reference);
  void add_run(const char* problem, const Contender& contender, const Run& run, double value,
               double error_ratio);
  void note_unrest(const char* problem, const Contender& contender, double spread_ratio);

  bool is_quick_;
  References references_;
  std::vector<std::string> notes_;
  Table table_{{{"problem", "problem", ""},
                {"program", "program", ""},
                {"mesh", "mesh", ""},
                {"source", "source", ""},
                {"step_ms", "step [ms]", "{:.0f}"},
                {"value", "mm, N, N m", "{:.2f}"},
                {"error_percent", "error [%]", "{:+.1f}"},
                {"cpu_mean_us", "CPU a step [us]", "{:.0f}"},
                {"cpu_p99_us", "p99", "{:.0f}"},
                {"cpu_ratio", "CPU/simulated", "{:.2f}"}}};
};

}  // namespace palpate::bench
