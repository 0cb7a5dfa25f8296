// SPDX-License-Identifier: Apache-2.0
// imported_organ.h — from a label map to the files of `palpate import`: mesh, surfaces, session,
// report.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "deploy/palpate/import/import_reach.h"
#include "deploy/scan/label_map.h"
#include "deploy/scan/organ_mesh.h"

namespace palpate {

struct ImportOptions {
  std::vector<std::string> labels{};   ///< names of the segments of the body; empty: all
  std::vector<std::string> lesions{};  ///< empty: those whose name or code says so
  std::vector<std::string> fixed{};    ///< held as a whole; empty: the lowest fifth of the body
  std::string up = "anterior";         ///< side of the patient that is up, +z of W
  /// How the patient lay in the scan: gravity is in its shape; "none": it is taken as free of load.
  std::string scanned = "none";
  std::optional<double> cell_m{};
  std::size_t tetrahedra = 6000;
  ReachDevice device{};   ///< whose workspace is laid over the organ
  bool is_timed = false;  ///< solve rate after a solution on this machine; else 25 Hz
};

inline constexpr const char* kImportedSession = "session.txtpb";
inline constexpr const char* kImportedMesh = "organ.msh";
inline constexpr const char* kImportedReport = "report.txt";

struct ImportedOrgan {
  std::map<std::string, std::string> files;  ///< name in the folder → content; with the three above
  std::string report;
};

/// Labels, sizes, names and voxels of a map, a line each.
[[nodiscard]] std::string label_list(const scan::LabelMap& map, const std::string& file);

/// @param file  of the map, for the report
/// @throws SetupError  a label that is not there; a body that cannot be meshed or held
[[nodiscard]] ImportedOrgan imported_organ(scan::LabelMap map, const ImportOptions& options,
                                           const std::string& file);

}  // namespace palpate
