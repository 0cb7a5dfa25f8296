// SPDX-License-Identifier: Apache-2.0
#include "deploy/palpate/volume_mesh.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <numbers>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "common/contact/bounds.h"
#include "common/core/check.h"
#include "common/core/user/files.h"
#include "common/core/user/temp_folder.h"
#include "common/process/terminal.h"
#include "deploy/scan/organ_mesh.h"
#include "deploy/scan/stuffing.h"
#include "physics_node/elastic/mesh.h"
#include "physics_node/elastic_tissue/elastic_body.h"
#include "physics_node/files/tetrahedral_files.h"

namespace palpate {
namespace {

constexpr double kUsualShare = 1.0 / 25.0;
constexpr double kMostTetrahedra = 1e6;
constexpr int kCoarsestInside = 1;  // cubes of twice the edge
constexpr std::uintmax_t kMostBytes = 2'000'000'000;
constexpr const char* kSurfaceName = "surface.msh";
constexpr const char* kScriptName = "volume.geo";
constexpr const char* kResultName = "volume.msh";
constexpr const char* kLogName = "log.txt";
// Edges between faces at a larger angle stay edges when the surface is meshed anew.
constexpr const char* kFeatureAngle = "40*Pi/180";
// Relative to the volume that the surface encloses.
constexpr double kVolumeError = 0.02;

/// The triangles as Gmsh 2.2, with all digits.
std::string surface_text(const physics::TriangleMesh& surface) {
  std::string text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n" +
                     std::to_string(surface.vertices_m.size()) + "\n";
  std::array<char, 128> line{};
  for (std::size_t i = 0; i < surface.vertices_m.size(); ++i) {
    const Vector3& vertex = surface.vertices_m[i];
    std::snprintf(line.data(), line.size(), "%zu %.17g %.17g %.17g\n", i + 1, vertex.x(),
                  vertex.y(), vertex.z());
    text += line.data();
  }
  text += "$EndNodes\n$Elements\n" + std::to_string(surface.triangles.size()) + "\n";
  for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
    text += std::to_string(i + 1) + " 2 2 1 1";
    for (const std::uint32_t corner : surface.triangles[i]) {
      text += " " + std::to_string(corner + 1);
    }
    text += "\n";
  }
  return text + "$EndElements\n";
}

std::string script(const VolumeMeshing& meshing) {
  std::array<char, 64> edge{};
  std::snprintf(edge.data(), edge.size(), "%.17g", meshing.edge_m);
  std::string text = std::string("Merge \"") + kSurfaceName + "\";\n";
  if (meshing.has_given_surface) {
    text += "CreateTopology;\n";
  } else {
    text += std::string("ClassifySurfaces{") + kFeatureAngle + ", 1, 1, Pi};\nCreateGeometry;\n";
  }
  // only elements of a physical group are written
  text += "Surface Loop(1) = Surface{:};\nVolume(1) = {1};\nPhysical Volume(1) = {1};\n";
  for (const char* limit : {"Min", "Max"}) {
    text += std::string("Mesh.MeshSize") + limit + " = " + edge.data() + ";\n";
  }
  // otherwise the size inside is that of the given triangles
  if (meshing.has_given_surface) text += "Mesh.MeshSizeExtendFromBoundary = 0;\n";
  return text + "Mesh.Optimize = 1;\n";
}

// Exit status of timeout(1), part of every Debian: ended at the limit; killed 5 s later, because
// that did not end it; the program is not there.
constexpr int kIsTooLong = 124;
constexpr int kIsKilled = 137;
constexpr int kIsNotThere = 127;

std::string log_of(const TempFolder& folder) {
  return read_regular_file(folder.path() / kLogName, kMostBytes).bytes;
}

/// Runs gmsh in the folder; its output is in kLogName. @return exit status, kIsTooLong at the limit
int run_gmsh(const TempFolder& folder, double limit_s) {
  const std::string script = (folder.path() / kScriptName).string();
  const std::string result = (folder.path() / kResultName).string();
  const std::string log = (folder.path() / kLogName).string();
  // in the foreground: Ctrl-C reaches gmsh, too, and this process stays to remove the folder
  std::vector<std::string> words{"timeout",
                                 "--foreground",
                                 "--kill-after=5",
                                 std::to_string(limit_s),
                                 "gmsh",
                                 script,
                                 "-3",
                                 "-format",
                                 "msh22",
                                 "-nt",
                                 "1",
                                 "-v",
                                 "3",
                                 "-o",
                                 result};
  std::vector<char*> arguments;
  arguments.reserve(words.size() + 1);
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);

  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC,
                                   0600);
  posix_spawn_file_actions_adddup2(&files, STDOUT_FILENO, STDERR_FILENO);
  const StopSignal stop;
  pid_t pid = 0;
  const int error =
      posix_spawnp(&pid, words.front().c_str(), &files, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&files);
  if (error != 0)
    throw SetupError("timeout, of coreutils: " + std::generic_category().message(error));
  int status = 0;
  while (waitpid(pid, &status, 0) < 0) {
    if (errno != EINTR) throw std::system_error(errno, std::generic_category(), "gmsh");
  }
  if (StopSignal::is_requested()) throw std::runtime_error("gmsh was interrupted");
  const int exit_status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  if (exit_status == kIsNotThere) {
    throw SetupError(
        "gmsh is not installed or does not start; the volume mesh is made by it: apt-get install "
        "gmsh\n" +
        log_of(folder));
  }
  return exit_status == kIsKilled && WIFEXITED(status) ? kIsTooLong : exit_status;
}

/// The first error that gmsh reports, "" if there is none.
std::string first_error(const std::string& log) {
  constexpr std::string_view kBegin = "Error   : ";
  const std::size_t at = log.find(kBegin);
  if (at == std::string::npos) return {};
  const std::size_t begin = at + kBegin.size();
  return log.substr(begin, log.find('\n', begin) - begin);
}

elastic::MeshQuality quality_of(const physics::TetrahedralMesh& mesh) {
  elastic::Mesh same;
  same.nodes_m.assign(mesh.nodes_m.begin(), mesh.nodes_m.end());
  for (const auto& corners : mesh.tetrahedra) {
    same.elements.insert(same.elements.end(), corners.begin(), corners.end());
  }
  return elastic::quality_of(same);
}

/// Throws SetupError unless the surface can be filled with edges of this length.
void check_fillable(const physics::TriangleMesh& surface, double edge_m,
                    const std::string& file_name) {
  if (!physics::TriangleSurface(surface).is_closed()) {
    throw SetupError(file_name +
                     ": the surface is open: must be closed to be filled with tetrahedra; close "
                     "its holes, for instance with MeshLab");
  }
  // of a regular tetrahedron: edge³/(6√2)
  const double expected =
      physics::enclosed_volume_m3(surface) * 6.0 * std::numbers::sqrt2 / (edge_m * edge_m * edge_m);
  if (!(expected <= kMostTetrahedra)) {
    const double least_m = edge_m * std::cbrt(expected / kMostTetrahedra);
    throw SetupError(file_name + ": --edge-m = " + std::to_string(edge_m) +
                     ": makes more than a million tetrahedra; give at least " +
                     std::to_string(least_m));
  }
}

}  // namespace

double usual_edge_m(const physics::TriangleMesh& surface) {
  const Bounds bounds = bounds_of(surface.vertices_m);
  return kUsualShare * (bounds.highest_m - bounds.lowest_m).norm();
}

physics::TetrahedralMesh stuffed_mesh_of(const physics::TriangleMesh& surface, double edge_m,
                                         const std::string& file_name) {
  check_fillable(surface, edge_m, file_name);
  const physics::TriangleSurface closed(surface);
  const Bounds bounds = bounds_of(surface.vertices_m);
  const Vector3 margin_m = Vector3::Constant(edge_m);
  scan::Stuffing stuffing{
      .bounds = {bounds.lowest_m - margin_m, bounds.highest_m + margin_m},
      .cell_m = edge_m,
      .coarsest = kCoarsestInside,
  };
  stuffing.inside = [&](const Vector3& place_m) { return -closed.view(place_m).distance_m; };
  std::vector<std::uint32_t> kept;
  physics::TetrahedralMesh mesh = scan::stuffed(stuffing);
  if (!mesh.tetrahedra.empty()) mesh = scan::one_solid(mesh, kept);
  if (mesh.tetrahedra.empty()) {
    throw SetupError(file_name + ": --edge-m = " + std::to_string(edge_m) +
                     ": is longer than the body is thick; give less");
  }
  scan::open_slivers(mesh);
  return mesh;
}

physics::TetrahedralMesh volume_mesh_of(const physics::TriangleMesh& surface,
                                        const VolumeMeshing& meshing,
                                        const std::string& file_name) {
  check_fillable(surface, meshing.edge_m, file_name);
  const TempFolder folder;
  folder.write(kSurfaceName, surface_text(surface));
  folder.write(kScriptName, script(meshing));
  const std::string other_ways =
      std::string("try ") +
      (meshing.has_given_surface ? "without --given-surface, " : "--given-surface, ") +
      "another --edge-m, or mend the surface, for instance with MeshLab";
  const int status = run_gmsh(folder, meshing.limit_s);
  if (status == kIsTooLong) {
    std::array<char, 32> limit{};
    std::snprintf(limit.data(), limit.size(), "%g", meshing.limit_s);
    throw SetupError(file_name + ": gmsh does not end within " + limit.data() + " s (--limit-s); " +
                     other_ways);
  }
  const std::string error = first_error(log_of(folder));
  const FileContent result = read_regular_file(folder.path() / kResultName, kMostBytes);
  if (status != 0 || !error.empty() || !result.complaint.empty()) {
    throw SetupError(file_name + ": gmsh does not mesh it (exit status " + std::to_string(status) +
                     (error.empty() ? "" : ": " + error) + "); " + other_ways);
  }
  return physics::parse_msh(result.bytes, "the result of gmsh");
}

std::string quality_report(const physics::TetrahedralMesh& mesh, double surface_volume_m3) {
  const elastic::MeshQuality quality = quality_of(mesh);
  const scan::FaceAngles angles = scan::face_angles_of(mesh);
  constexpr double kDegrees = 180.0 / std::numbers::pi;
  std::array<char, 600> text{};
  std::snprintf(text.data(), text.size(),
                "number   %zu tetrahedra, %zu nodes\n"
                "scale    diagonal %.3g mm, edges %.3g to %.3g mm\n"
                "shape    %zu inverted, %zu slivers (quality below %.2g); least quality %.2f "
                "(tetrahedron %zu), angles between faces %.1f to %.1f degrees\n"
                "volume   %.4g ml, the surface encloses %.4g ml\n",
                quality.elements, quality.nodes, 1e3 * quality.extent_m,
                1e3 * quality.shortest_edge_m, 1e3 * quality.longest_edge_m, quality.inverted,
                quality.slivers, elastic::kSliver, quality.least_quality, quality.worst_element + 1,
                kDegrees * angles.least_rad, kDegrees * angles.largest_rad, 1e6 * quality.volume_m3,
                1e6 * surface_volume_m3);
  std::string report = text.data();
  if (quality.is_scale_doubtful()) {
    report += "WARNING: no organ is smaller than 1 mm or larger than 10 m; check --unit-m\n";
  }
  if (quality.slivers > 0) {
    report += "WARNING: slivers make an elastic body stiff and slow; try another --edge-m\n";
  }
  if (!(std::abs(quality.volume_m3 - surface_volume_m3) <= kVolumeError * surface_volume_m3)) {
    report +=
        "WARNING: the volume differs from that of the surface by more than 2 %; give a "
        "shorter --edge-m\n";
  }
  if (quality.elements > physics::kMostElasticElements) {
    report += "WARNING: a session takes at most " + std::to_string(physics::kMostElasticElements) +
              " tetrahedra as an elastic body; give a longer --edge-m\n";
  }
  return report;
}

}  // namespace palpate
