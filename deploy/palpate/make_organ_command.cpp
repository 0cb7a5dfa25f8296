// SPDX-License-Identifier: Apache-2.0
#include <cstdint>
#include <string>

#include "common/core/check.h"
#include "common/core/user/output_file.h"
#include "common/process/options.h"
#include "common/process/terminal.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/organ.h"
#include "physics_node/files/ply.h"
#include "physics_node/files/tetrahedral_files.h"

namespace palpate {
namespace {

struct MakeOrganCommand {
  std::string cloud_file;
  std::string mesh_file;
  std::string block_file;
  std::uint32_t points = 3000;
  std::uint32_t subdivisions = 2;
  std::uint32_t cells = 4;
  bool may_overwrite = false;

  void add_to(CLI::App& app) {
    app.add_option("--cloud", cloud_file,
                   "write a point cloud to this file (PLY), - for standard output")
        ->type_name("FILE");
    app.add_option("--points", points, "number of points of the cloud (default 3000)")
        ->type_name("N")
        ->check(CLI::Range(10, 100'000'000));
    app.add_option("--mesh", mesh_file,
                   "write a tetrahedral mesh to this file (Gmsh 2.2), - for standard output")
        ->type_name("FILE");
    app.add_option("--subdivisions", subdivisions,
                   "subdivisions of the mesh surface (default 2: 2240 tetrahedra)")
        ->type_name("N")
        ->check(CLI::Range(0, 6));
    app.add_option(
           "--block", block_file,
           "write a block of 100 x 100 x 50 mm in tetrahedra to this file (Gmsh 2.2), - for "
           "standard output")
        ->type_name("FILE");
    app.add_option("--cells", cells,
                   "cells of the block from top to bottom (default 4: 1280 tetrahedra)")
        ->type_name("N")
        ->check(CLI::Range(2, 16));
    add_overwrite_flag(app, may_overwrite);
  }

  int run(const Verbosity& verbosity) const {
    if (cloud_file.empty() && mesh_file.empty() && block_file.empty()) {
      throw SetupError(
          "make-organ: nothing to write; give --cloud FILE, --mesh FILE or --block FILE");
    }
    check_outputs({{"--cloud", cloud_file}, {"--mesh", mesh_file}, {"--block", block_file}}, {},
                  may_overwrite);
    if (!cloud_file.empty()) {
      Progress progress("make-organ", verbosity.is_quiet);
      const auto cloud = organ_cloud(points, [&](double ratio) { progress.show(ratio); });
      write_file("cloud", cloud_file, physics::ply_text(cloud), may_overwrite);
    }
    if (!mesh_file.empty()) {
      const BusyLine busy("make-organ", verbosity.is_quiet);
      write_file("mesh", mesh_file, physics::msh_text(organ_mesh(subdivisions)), may_overwrite);
    }
    if (!block_file.empty()) {
      write_file("block", block_file, physics::msh_text(block_mesh(cells)), may_overwrite);
    }
    return 0;
  }
};

}  // namespace

Command add_make_organ_command(CLI::App& app) {
  return add_command<MakeOrganCommand>(
      app, "make-organ",
      "write an organ-like body as a point cloud or a mesh, for trying out sessions");
}

}  // namespace palpate
