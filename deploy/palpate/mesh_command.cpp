// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <optional>
#include <string>

#include "common/core/check.h"
#include "common/core/user/output_file.h"
#include "common/process/options.h"
#include "common/process/terminal.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/volume_mesh.h"
#include "physics_node/files/surface_files.h"
#include "physics_node/files/tetrahedral_files.h"

namespace palpate {
namespace {

struct MeshCommand {
  std::string surface_file;
  std::string output;
  double unit_m = 1.0;
  std::optional<double> edge_m;
  std::string mesher = "stuffing";
  bool has_given_surface = false;
  double limit_s = VolumeMeshing{}.limit_s;
  bool may_overwrite = false;

  void add_to(CLI::App& app) {
    app.add_option("SURFACE", surface_file, "closed surface of triangles (*.stl, *.obj)")
        ->required()
        ->type_name("");
    app.add_option("-o,--output", output,
                   "write the tetrahedra to this file (Gmsh 2.2, in metres), - for standard "
                   "output")
        ->required()
        ->type_name("FILE");
    app.add_option("--unit-m", unit_m,
                   "length of the surface file's unit in metres (default 1; 0.001 for mm)")
        ->type_name("M")
        ->check(CLI::Range(1e-9, 1e3));
    app.add_option("--edge-m", edge_m,
                   "length of edges to aim at, in metres (default: a 25th of the diagonal)")
        ->type_name("M")
        ->check(CLI::Range(1e-6, 1.0));
    app.add_option("--mesher", mesher,
                   "stuffing (default): takes every closed surface, staircases of voxels too, and "
                   "rounds edges; gmsh: the program gmsh, which keeps edges")
        ->type_name("NAME")
        ->check(CLI::IsMember({"stuffing", "gmsh"}));
    app.add_flag("--given-surface", has_given_surface,
                 "with --mesher gmsh: keep the triangles of the surface; otherwise they are made "
                 "anew with --edge-m");
    app.add_option("--limit-s", limit_s, "end gmsh after this time in s (default 600)")
        ->type_name("S")
        ->check(CLI::Range(1.0, 1e6));
    add_overwrite_flag(app, may_overwrite);
  }

  int run(const Verbosity& verbosity) const {
    const bool is_gmsh = mesher == "gmsh";
    if (has_given_surface && !is_gmsh)
      throw SetupError("--given-surface: only gmsh keeps triangles; add --mesher gmsh");
    check_outputs({{"--output", output}}, {surface_file}, may_overwrite);
    const auto read = physics::load_triangle_mesh(
        {.kind = FileGeometry::Kind::kTriangleSurface, .file = surface_file, .unit_m = unit_m});
    const double aim_m = edge_m.value_or(usual_edge_m(read));
    std::string text;
    {
      const BusyLine busy("mesh", verbosity.is_quiet);
      const physics::TetrahedralMesh mesh =
          is_gmsh
              ? volume_mesh_of(
                    read,
                    {.edge_m = aim_m, .has_given_surface = has_given_surface, .limit_s = limit_s},
                    surface_file)
              : stuffed_mesh_of(read, aim_m, surface_file);
      text = physics::msh_text(mesh);
    }
    // of what a session will read
    const std::string report =
        quality_report(physics::parse_msh(text, output), physics::enclosed_volume_m3(read));
    write_file("mesh", output, text, may_overwrite);
    if (!verbosity.is_quiet) {
      std::fprintf(output == kStandardOutput ? stderr : stdout, "%s: edges of about %.3g mm\n%s",
                   output.c_str(), 1e3 * aim_m, report.c_str());
    }
    return 0;
  }
};

}  // namespace

Command add_mesh_command(CLI::App& app) {
  return add_command<MeshCommand>(app, "mesh",
                                  "fill a closed surface with tetrahedra for a session");
}

}  // namespace palpate
