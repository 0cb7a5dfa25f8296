// SPDX-License-Identifier: Apache-2.0
// tissue_bench: the tissue library. Beside other simulators, a bar that hangs and is twisted and a
// slab that a sphere presses and slides over, force against CPU time; and by itself, steps per
// second, memory of many scenes, states.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "tests/bench/bench_output.h"
#include "tests/bench/tissue/comparison.h"
#include "tests/bench/tissue/rates.h"
#include "tests/bench/tissue/recorded.h"

namespace {

using namespace palpate;
using bench::BenchOptions;
using bench::Table;

const std::vector<std::string> kParts{"hang", "press", "slide", "twist", "rates"};

void run(const BenchOptions& options, const bench::RateOptions& rates,
         const std::vector<std::string>& parts) {
  const auto is_wanted = [&](const char* part) {
    return std::find(parts.begin(), parts.end(), part) != parts.end();
  };
  bench::Comparison comparison(options.is_quick);
  if (is_wanted("hang")) comparison.hang();
  if (is_wanted("press") || is_wanted("slide")) comparison.press_and_slide();
  if (is_wanted("twist")) comparison.twist();
  const bool is_compared = !comparison.notes().empty();

  nlohmann::ordered_json json;
  std::string csv;
  if (is_compared) {
    std::fputs(comparison.table().text().c_str(), stdout);
    for (const std::string& note : comparison.notes()) std::printf("%s\n", note.c_str());
    std::printf("%s\n%s\n", bench::kRecordedFrom, bench::kNoMujoco);
#ifndef PALPATE_HAS_BULLET
    std::printf("no Bullet: libbullet-dev was not installed when this was built\n");
#endif
    json["problems"] = comparison.table().json();
    json["notes"] = comparison.notes();
    csv = comparison.table().csv();
  }
  if (is_wanted("rates")) {
    const Table table = bench::rates(rates, options.is_quick);
    std::printf("%s%s", is_compared ? "\n" : "", table.text().c_str());
    json["rates"] = table.json();
    csv += (csv.empty() ? "" : "\n") + table.csv();
  }
  std::printf("%s\n", bench::machine_load().c_str());
  bench::write_table(options, csv);
  bench::write_json(options, json);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "The tissue library: force against CPU time beside other simulators, and steps per second, "
      "memory and states of many scenes."};
  BenchOptions options;
  bench::RateOptions rates;
  std::vector<std::string> parts = kParts;
  app.add_option("--only", parts, "Only these: hang, press (with slide), twist, rates")
      ->check(CLI::IsMember(kParts));
  app.add_option("--scenes", rates.copies, "Rates: how many at once (default 1 16 1000)");
  app.add_option("--threads", rates.threads, "Rates: that make the steps (default 1)");
  app.add_option("--seconds", rates.seconds, "Rates: of each row, simulated (default 0.4)");
  app.add_option("--keep", rates.many_steps,
                 "Instead: so many steps of one scene, and the memory before and after");
  return bench::run_bench(app, options, argc, argv, [&] {
    if (rates.many_steps > 0.0) {
      bench::keep_memory(rates);
    } else {
      run(options, rates, parts);
    }
  });
}
