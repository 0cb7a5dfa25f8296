// SPDX-License-Identifier: Apache-2.0
#include <spdlog/fmt/fmt.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <string>
#include <variant>
#include <vector>

#include "common/core/check.h"
#include "common/core/user/output_file.h"
#include "common/process/options.h"
#include "common/process/terminal.h"
#include "common/session/session_file.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/options.h"
#include "deploy/palpate/task/random_task.h"

namespace palpate {
namespace {

struct MakeTaskCommand {
  SessionOptions session;
  std::uint64_t seed = 1;
  std::uint32_t count = 1;
  std::vector<std::uint32_t> lesions{1, 1};
  std::vector<double> radius_mm{7.0, 10.0};
  std::vector<double> depth_mm{3.0, 15.0};
  std::vector<double> stiffness_ratio{4.0, 10.0};
  double search_newton = 0.0;
  double spacing_mm = 8.0;
  std::string folder;
  bool may_overwrite = false;

  void add_to(CLI::App& app) {
    session.add_to(app);
    app.add_option("--seed", seed, "of the first task (default 1)")
        ->type_name("N")
        ->check(CLI::Range(std::int64_t{0}, std::numeric_limits<std::int64_t>::max()));
    app.add_option("--count", count, "make so many tasks, with seeds that follow (default 1)")
        ->type_name("N")
        ->check(CLI::Range(1, 1000));
    const auto add_range = [&](const char* name, auto& range, const char* text, double least,
                               double most) {
      app.add_option(name, range, text)
          ->type_name("FROM TO")
          ->expected(2)
          ->check(CLI::Range(least, most));
    };
    add_range("--lesions", lesions, "how many lesions a task has (default 1 1); 0: none", 0, 16);
    add_range("--radius-mm", radius_mm, "their radius in mm (default 7 10)", 1.0, 100.0);
    add_range("--depth-mm", depth_mm, "how deep their top is below the surface, mm (default 3 15)",
              0.0, 200.0);
    add_range("--stiffness-ratio", stiffness_ratio,
              "their Young's modulus as a multiple of the body's (default 4 10)", 1.01, 1e4);
    app.add_option("--search-newton", search_newton,
                   "let a simulated hand search: presses of this force on a grid over the area, "
                   "and a mark where the force is predicted to be enough")
        ->type_name("N")
        ->check(CLI::Range(0.1, 50.0));
    app.add_option("--spacing-mm", spacing_mm, "between the presses of that hand (default 8)")
        ->type_name("MM")
        ->check(CLI::Range(1.0, 100.0));
    app.add_option("-o,--output", folder, "write the sessions into this folder, which must exist")
        ->required()
        ->type_name("FOLDER");
    add_overwrite_flag(app, may_overwrite);
  }

  int run(const Verbosity& verbosity) const {
    const Session given = session.load(verbosity);
    // lesions that the session has are replaced
    const std::string text = without_targets(given.text);
    const Session loaded =
        parse_session(text, session.file, {}, std::filesystem::path(session.file).parent_path());
    if (!std::filesystem::is_directory(folder)) {
      throw SetupError("--output " + folder + ": no such folder; make it first");
    }
    const LesionRanges ranges = ranges_of();
    const RandomTask task(loaded);
    std::vector<std::string> written;
    Progress progress("make-task", verbosity.is_quiet);
    std::string table = kTable;
    for (std::uint32_t i = 0; i < count; ++i) {
      progress.show(static_cast<double>(i) / count);
      const std::uint64_t one_seed = seed + i;
      const std::string stem = fmt::format("{}_{}", loaded.name, one_seed);
      const std::string file = (std::filesystem::path(folder) / (stem + ".txtpb")).string();
      const std::string path_file = (std::filesystem::path(folder) / (stem + ".csv")).string();
      std::vector<NamedOutput> outputs{{"--output", file}};
      if (search_newton > 0.0) outputs.push_back({"--output", path_file});
      check_outputs(outputs, files_of(loaded), may_overwrite);
      const std::vector<Lesion> lesions_made = task.lesions(ranges, one_seed);
      std::vector<std::string> fields = moved_files(loaded);
      for (std::string& field : task.fields_of(lesions_made)) fields.push_back(std::move(field));
      const Vector3 rest_m = task.rest_m();
      if (search_newton == 0.0) {
        fields.push_back(
            fmt::format("hand.hold={{ position_m {{ x: {:.4f} y: {:.4f} z: {:.4f} }} }}",
                        rest_m.x(), rest_m.y(), rest_m.z()));
      } else {
        RandomTask::Search search =
            task.search({.newton = search_newton, .spacing_m = 1e-3 * spacing_mm}, lesions_made);
        write_file("path", path_file, search.path_csv, may_overwrite);
        written.push_back(path_file);
        fields.push_back("hand.recorded={ file: \"" + stem + ".csv\" }");
        fields.push_back(fmt::format("duration_s={:.2f}", search.length_s));
        for (std::string& press : search.presses) fields.push_back(std::move(press));
      }
      const Session made = parse_session(text, session.file, fields, folder);
      write_file("session", file,
                 "# Made by palpate make-task --seed " + std::to_string(one_seed) + " from " +
                     std::filesystem::path(session.file).filename().string() + ".\n" + made.text,
                 may_overwrite);
      written.push_back(file);
      for (const Lesion& lesion : lesions_made) table += row_of(one_seed, lesion);
      if (lesions_made.empty()) table += fmt::format("{:>6}  no lesion\n", one_seed);
    }
    progress.show(1.0);
    if (!verbosity.is_quiet) std::fputs(table.c_str(), stdout);
    say_written(written, verbosity);
    return 0;
  }

 private:
  static constexpr const char* kTable =
      "  seed     x mm     y mm  radius mm  depth mm  modulus kPa  contrast %  palpable from N\n";

  static std::string row_of(std::uint64_t seed, const Lesion& lesion) {
    return fmt::format(
        "{:>6} {:>8.1f} {:>8.1f} {:>10.1f} {:>9.1f} {:>12.1f} {:>11.1f} {:>16}\n", seed,
        1e3 * lesion.above_m.x(), 1e3 * lesion.above_m.y(), 1e3 * lesion.radius_m,
        1e3 * lesion.depth_m, 1e-3 * lesion.young_pa, 100.0 * lesion.contrast_ratio,
        std::isfinite(lesion.palpable_newton) ? fmt::format("{:.2f}", lesion.palpable_newton)
                                              : "not");
  }

  [[nodiscard]] LesionRanges ranges_of() const {
    const auto checked = [](const char* option, double from, double to, double scale) {
      if (from > to) {
        throw SetupError(
            fmt::format("{} {:g} {:g}: the first must not be the larger one", option, from, to));
      }
      return Range{scale * from, scale * to};
    };
    static_cast<void>(checked("--lesions", lesions[0], lesions[1], 1.0));
    return {.count = {lesions[0], lesions[1]},
            .radius_m = checked("--radius-mm", radius_mm[0], radius_mm[1], 1e-3),
            .depth_m = checked("--depth-mm", depth_mm[0], depth_mm[1], 1e-3),
            .stiffness_ratio =
                checked("--stiffness-ratio", stiffness_ratio[0], stiffness_ratio[1], 1.0)};
  }

  /// The files of the session, as they are named from the new folder.
  [[nodiscard]] std::vector<std::string> moved_files(const Session& loaded) const {
    std::vector<std::string> fields;
    const auto from_there = [&](const std::string& file) {
      return std::filesystem::relative(std::filesystem::absolute(file), folder).generic_string();
    };
    constexpr const char* kKinds[] = {"point_cloud", "triangle_surface", "tetrahedral_mesh"};
    for (std::size_t i = 0; i < loaded.scene.tissues.size(); ++i) {
      const auto* geometry = std::get_if<FileGeometry>(&loaded.scene.tissues[i].geometry);
      if (geometry == nullptr) continue;
      fields.push_back(fmt::format("scene.tissue[{}].{}.file={}", i,
                                   kKinds[static_cast<std::size_t>(geometry->kind)],
                                   from_there(geometry->file)));
    }
    return fields;
  }
};

}  // namespace

Command add_make_task_command(CLI::App& app) {
  return add_command<MakeTaskCommand>(
      app, "make-task",
      "place lesions at random in an elastic body, and predict how hard they are to find");
}

}  // namespace palpate
