// SPDX-License-Identifier: Apache-2.0
// What a person should know of the mesh of an elastic tissue.
#include <algorithm>
#include <cstdio>
#include <cstring>

#include "physics_node/elastic_tissue/elastic_body.h"

namespace palpate::physics {

std::string mesh_report(const ElasticBody& body) {
  const elastic::MeshQuality quality = elastic::quality_of(body.body->mesh());
  const std::vector<std::uint8_t>& regions = body.body->mesh().regions;
  const auto in_parts =
      std::count_if(regions.begin(), regions.end(), [](std::uint8_t region) { return region > 0; });
  const std::vector<elastic::Attachment>& attachments = body.body->description().attachments;
  char attached[90] = "";  // NOLINT: for snprintf
  if (!attachments.empty()) {
    double newton_per_m = 0.0;
    std::size_t tearing = 0;
    for (const elastic::Attachment& one : attachments) {
      newton_per_m += one.stiffness_newton_per_m;
      tearing += one.tears() ? 1U : 0U;
    }
    std::snprintf(attached, sizeof attached, ", %zu attached with %.3g N/m", attachments.size(),
                  newton_per_m);
    if (tearing > 0) {
      const std::size_t end = std::strlen(attached);
      std::snprintf(attached + end, sizeof attached - end, ", %zu of them may tear", tearing);
    }
  }
  char text[400];  // NOLINT: for snprintf
  std::snprintf(
      text, sizeof text,
      "elastic: %zu tetrahedra, %zu nodes (%zu fixed%s), %td tetrahedra in parts; least "
      "quality %.2f, %zu slivers; edges %.2g to %.2g mm; %zu contact points; sags %.2g mm",
      quality.elements, quality.nodes, body.body->description().fixed_nodes.size(), attached,
      in_parts, quality.least_quality, quality.slivers, 1e3 * quality.shortest_edge_m,
      1e3 * quality.longest_edge_m, body.points.size(), 1e3 * body.sag_m);
  std::string report = text;
  if (body.scan_error_m >= 0.0) {
    char more[100];  // NOLINT: for snprintf
    std::snprintf(more, sizeof more, "; has the shape of the scan within %.2g mm under its gravity",
                  1e3 * body.scan_error_m);
    report += more;
  }
  if (quality.is_scale_doubtful()) {
    report += "; WARNING: extends over " + std::to_string(quality.extent_m) +
              " m, which no organ does: check unit_m";
  }
  return report;
}

}  // namespace palpate::physics
