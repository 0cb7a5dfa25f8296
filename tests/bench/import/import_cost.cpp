// SPDX-License-Identifier: Apache-2.0
// import_cost: what `palpate import` takes, and what it makes, from a public atlas and from label
// maps of `palpate make-organ`: time, memory, volumes against the voxels', angles. Each import is
// done twice: the meshes must be the same. Volumes are counted here, from the voxels and the
// written mesh.
#include <fcntl.h>
#include <spawn.h>
#include <spdlog/fmt/fmt.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <numbers>
#include <numeric>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "common/core/user/temp_folder.h"
#include "deploy/scan/organ_mesh.h"
#include "physics_node/files/tetrahedral_files.h"
#include "tests/bench/bench_output.h"

namespace {

namespace fs = std::filesystem;
using namespace palpate;
using namespace palpate::bench;

const fs::path kAtlas = "/usr/share/mricron/templates/JHU-WhiteMatter-labels-2mm.nii.gz";
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kDegrees = 180.0 / std::numbers::pi;
constexpr std::uint64_t kManyVoxels = 5000;

struct Case {
  std::string name;
  std::vector<std::string> organ;   ///< arguments of make-organ; empty: the atlas
  std::vector<std::string> import;  ///< arguments of import
};

struct Used {
  double wall_s = kNaN;
  double cpu_s = kNaN;
  double peak_mib = kNaN;
};

struct Row {
  Used used;
  double megavoxels = kNaN;
  std::size_t tetrahedra = 0;
  std::size_t labels = 0;
  std::size_t large_labels = 0;       ///< of kManyVoxels or more
  double large_error_percent = kNaN;  ///< of their volumes, the largest
  double small_error_percent = kNaN;  ///< the same of the others that are in the mesh
  std::size_t missing_labels = 0;     ///< nothing of them is in the mesh
  scan::FaceAngles angles;
  bool is_same = false;
};

/// Runs `palpate` to its end. @throws SetupError  if it fails
Used run_palpate(const std::vector<std::string>& arguments) {
  const std::string program = fs::read_symlink("/proc/self/exe").replace_filename("palpate");
  std::vector<char*> words{const_cast<char*>(program.c_str())};
  for (const std::string& argument : arguments)
    words.push_back(const_cast<char*>(argument.c_str()));
  words.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  pid_t child = 0;
  const auto begin = std::chrono::steady_clock::now();
  const int error = posix_spawn(&child, program.c_str(), &actions, nullptr, words.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  int status = -1;
  rusage usage{};
  if (error != 0 || wait4(child, &status, 0, &usage) != child || status != 0)
    throw SetupError(program + " " + arguments.front() + ": fails; build target palpate_tools");
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return {.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count(),
          .cpu_s = seconds(usage.ru_utime) + seconds(usage.ru_stime),
          .peak_mib = static_cast<double>(usage.ru_maxrss) / 1024.0};
}

std::string content(const fs::path& file) {
  FILE* const opened = std::fopen(file.c_str(), "rb");
  if (opened == nullptr) throw SetupError(file.string() + ": cannot be read");
  std::string bytes(fs::file_size(file), '\0');
  const std::size_t count = std::fread(bytes.data(), 1, bytes.size(), opened);
  std::fclose(opened);
  bytes.resize(count);
  return bytes;
}

class Costs {
 public:
  explicit Costs(const BenchOptions& options) : options_(options) {}

  void run() {
    cases_ = {
        {"organ with lesion, 2 mm", {"--voxel-mm", "2", "2", "2"}, {}},
        {"the same, 1 mm", {"--voxel-mm", "1", "1", "1"}, {"--tetrahedra", "20000"}},
        {"thin lobe, oblique, 1 x 1.5 x 2.5 mm",
         {"--voxel-mm", "1", "1.5", "2.5", "--oblique-degrees", "25", "--thin-lobe"},
         {"--tetrahedra", "30000"}},
    };
    if (fs::exists(kAtlas)) {
      cases_.push_back({"JHU atlas of white matter, 2 mm", {}, {"--tetrahedra", "30000"}});
    } else {
      std::puts("without the JHU atlas: install the package mricron-data");
    }
    if (!options_.is_quick) {
      cases_.push_back({"organ, 512 x 512 x 400",
                        {"--voxel-mm", "0.352", "0.2345", "0.2252"},
                        {"--tetrahedra", "50000"}});
    }
    // all children first: the peak of a child is at least that of its parent when it begins
    for (std::size_t i = 0; i < cases_.size(); ++i) import(i);
    for (std::size_t i = 0; i < cases_.size(); ++i) judge(i);
    add_uniform();
    publish();
  }

 private:
  [[nodiscard]] fs::path labels_of(std::size_t i) const {
    return cases_[i].organ.empty() ? kAtlas : folder_.path() / (std::to_string(i) + ".seg.nrrd");
  }
  [[nodiscard]] fs::path folder_of(std::size_t i, int turn) const {
    return folder_.path() / (std::to_string(i) + (turn == 0 ? "" : "_again"));
  }

  void import(std::size_t i) {
    if (!cases_[i].organ.empty()) {
      std::vector<std::string> arguments{"make-organ", "--quiet", "--labels", labels_of(i)};
      arguments.insert(arguments.end(), cases_[i].organ.begin(), cases_[i].organ.end());
      run_palpate(arguments);
    }
    Row row;
    for (int turn = 0; turn < 2; ++turn) {
      std::vector<std::string> arguments{"import", "--quiet", labels_of(i), "-o",
                                         folder_of(i, turn)};
      arguments.insert(arguments.end(), cases_[i].import.begin(), cases_[i].import.end());
      const Used used = run_palpate(arguments);
      // other programs make a run slower, never faster
      if (turn == 0 || used.wall_s < row.used.wall_s) row.used = used;
    }
    row.is_same = true;
    for (const auto& file : fs::directory_iterator(folder_of(i, 0))) {
      const fs::path name = file.path().filename();
      // the session and the report have the solve rate of a timed solution
      if (name.extension() != ".msh" && name.extension() != ".stl") continue;
      row.is_same = row.is_same && content(file.path()) == content(folder_of(i, 1) / name);
    }
    rows_.push_back(row);
    std::printf("%s: %.1f s, %.1f s of processors, %.0f MiB\n", cases_[i].name.c_str(),
                row.used.wall_s, row.used.cpu_s, row.used.peak_mib);
    std::fflush(stdout);
  }

  void judge(std::size_t i) {
    Row& row = rows_[i];
    scan::LabelMap map = scan::load_label_map(labels_of(i));
    row.megavoxels = 1e-6 * static_cast<double>(map.voxels.size());
    std::vector<std::uint32_t> all(map.segments.size());
    std::iota(all.begin(), all.end(), 0U);
    const std::vector<scan::Region> regions = scan::keep_largest_part(map, all);
    const fs::path file = folder_of(i, 0) / "organ.msh";
    const physics::TetrahedralMesh mesh = physics::parse_msh(content(file), file);
    row.tetrahedra = mesh.tetrahedra.size();
    row.angles = scan::face_angles_of(mesh);
    std::vector<double> mesh_m3(mesh.region_names.size(), 0.0);
    for (std::size_t e = 0; e < mesh.tetrahedra.size(); ++e)
      mesh_m3[mesh.regions[e]] += physics::six_volumes_m3(mesh.nodes_m, mesh.tetrahedra[e]) / 6.0;
    for (const scan::Region& region : regions) {
      const std::uint64_t voxels = region.voxels - region.dropped_voxels;
      if (voxels == 0) continue;
      ++row.labels;
      const std::string& name = map.segments[region.segment].name;
      const auto at = std::find(mesh.region_names.begin(), mesh.region_names.end(), name);
      if (voxels >= kManyVoxels) ++row.large_labels;
      if (at == mesh.region_names.end()) {
        ++row.missing_labels;
        continue;
      }
      const double error =
          mesh_m3[static_cast<std::size_t>(at - mesh.region_names.begin())] / region.voxels_m3 -
          1.0;
      double& worst = voxels >= kManyVoxels ? row.large_error_percent : row.small_error_percent;
      if (!(std::abs(100.0 * error) <= std::abs(worst))) worst = 100.0 * error;
    }
  }

  /// One label and cells of one size at the whole surface, in this process: `palpate import` is
  /// fine at the place of touch only.
  void add_uniform() {
    scan::LabelMap map = scan::load_label_map(labels_of(0));
    std::vector<scan::Region> regions = scan::keep_largest_part(map, {0});
    const scan::OrganMesh organ =
        scan::organ_mesh_of(map, std::move(regions), {.tetrahedra = 20'000});
    Row row;
    row.megavoxels = 1e-6 * static_cast<double>(map.voxels.size());
    row.tetrahedra = organ.mesh.tetrahedra.size();
    row.labels = 1;
    row.large_labels = 1;
    row.large_error_percent = 100.0 * (organ.regions[0].mesh_m3 / organ.regions[0].voxels_m3 - 1.0);
    row.angles = organ.angles;
    row.is_same = true;
    cases_.push_back({"its liver alone, surface of one size", {}, {}});
    rows_.push_back(row);
  }

  void publish() const {
    Table table({{"case", "label map", "{}"},
                 {"megavoxels", "10^6 voxels", "{:.2f}"},
                 {"tetrahedra", "tetrahedra", "{:.0f}"},
                 {"wall_s", "s", "{:.1f}"},
                 {"cpu_s", "CPU s", "{:.1f}"},
                 {"peak_mib", "peak MiB", "{:.0f}"},
                 {"labels", "labels", "{:.0f}"},
                 {"large_labels", "of 5000 voxels", "{:.0f}"},
                 {"large_error_percent", "their volume %", "{:+.2f}"},
                 {"small_error_percent", "of others %", "{:+.1f}"},
                 {"missing_labels", "missing", "{:.0f}"},
                 {"least_degrees", "least angle", "{:.1f}"},
                 {"largest_degrees", "largest", "{:.1f}"},
                 {"slivers", "below 5", "{:.0f}"},
                 {"is_same", "same twice", "{}"}});
    std::vector<Table::Column> columns{{"angle", "angle", "{}"}};
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      const Row& row = rows_[i];
      const auto count = [](std::size_t n) { return static_cast<double>(n); };
      table.add({cases_[i].name, row.megavoxels, count(row.tetrahedra), row.used.wall_s,
                 row.used.cpu_s, row.used.peak_mib, count(row.labels), count(row.large_labels),
                 row.large_error_percent, row.small_error_percent, count(row.missing_labels),
                 kDegrees * row.angles.least_rad, kDegrees * row.angles.largest_rad,
                 count(row.angles.slivers), std::string(row.is_same ? "yes" : "NO")});
      columns.push_back({"case_" + std::to_string(i + 1), cases_[i].name + ", %", "{:.2f}"});
    }
    Table angles(columns);
    for (std::size_t bin = 0; bin < 18; ++bin) {
      std::vector<Table::Cell> cells{fmt::format("{} to {}", 10 * bin, 10 * bin + 10)};
      for (const Row& row : rows_) {
        const auto all = std::accumulate(row.angles.histogram.begin(), row.angles.histogram.end(),
                                         std::uint64_t{0});
        cells.emplace_back(100.0 * static_cast<double>(row.angles.histogram[bin]) /
                           static_cast<double>(std::max<std::uint64_t>(all, 1)));
      }
      angles.add(std::move(cells));
    }
    std::printf("\n%s\nAngles between faces\n%s\n%s\n", table.text().c_str(), angles.text().c_str(),
                machine_load().c_str());
    write_table(options_, table.csv());
    write_json(options_, {{"rows", table.json()}, {"angles", angles.json()}});
  }

  const BenchOptions& options_;
  TempFolder folder_;
  std::vector<Case> cases_;
  std::vector<Row> rows_;
};

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"What the import of a label map takes, and what it makes of it."};
  BenchOptions options;
  return run_bench(app, options, argc, argv, [&] { Costs(options).run(); });
}
