// SPDX-License-Identifier: Apache-2.0
// random_task.h — lesions at random in an elastic body, how hard they are to find, and a simulated
// hand that searches for them.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "common/core/random.h"
#include "common/core/vector.h"
#include "common/session/session.h"
#include "physics_node/elastic_tissue/elastic_body.h"

namespace palpate {

/// From … to.
using Range = std::array<double, 2>;

struct LesionRanges {
  std::array<std::uint32_t, 2> count{1, 1};
  Range radius_m{0.007, 0.010};
  Range depth_m{0.003, 0.015};       ///< of its nearest place, below the surface
  Range stiffness_ratio{4.0, 10.0};  ///< of Young's modulus, to that of the body
};

/// A ball in the body.
struct Lesion {
  Vector3 center_m = Vector3::Zero();
  double radius_m = 0.0;
  double depth_m = 0.0;
  double young_pa = 0.0;
  Vector3 above_m = Vector3::Zero();  ///< the nearest place on the surface
  /// Predicted.
  double palpable_newton = std::numeric_limits<double>::quiet_NaN();
  double contrast_ratio = 0.0;
};

/// A hand that presses on a grid over the area.
struct SearchHand {
  double newton = 0.0;  ///< of each press, where there is no lesion
  double spacing_m = 0.008;
};

/// A session with a search in an elastic body, without targets. Throws SetupError: it has another
/// task, or targets.
class RandomTask {
 public:
  /// @param session  must outlive it
  explicit RandomTask(const Session& session);

  /// The same for a seed; all can be felt with most_newton(). Throws SetupError if there is no room
  /// for them, or they cannot be felt.
  [[nodiscard]] std::vector<Lesion> lesions(const LesionRanges& ranges, std::uint64_t seed) const;

  /// Fields for parse_session() that put them into the session, with their targets.
  [[nodiscard]] std::vector<std::string> fields_of(const std::vector<Lesion>& lesions) const;

  /// The hand's intended path as CSV (t,x,y,z), and the fields for its presses of the mark_button:
  /// where it presses over a lesion at least as hard as that can be felt.
  struct Search {
    std::string path_csv;
    std::vector<std::string> presses;
    double length_s = 0.0;
  };
  [[nodiscard]] Search search(const SearchHand& hand, const std::vector<Lesion>& lesions) const;

  /// Where a hand waits: above the middle of the surface.
  [[nodiscard]] Vector3 rest_m() const;

  /// The largest force that is predicted for: the task's, else 5 N.
  [[nodiscard]] double most_newton() const;

 private:
  struct Place {
    Vector3 point_m;
    Vector3 normal;
  };
  [[nodiscard]] const TissueConfig& tissue() const;
  [[nodiscard]] TissueConfig tissue_with(const std::vector<Lesion>& lesions) const;
  [[nodiscard]] std::vector<Lesion> placed(const LesionRanges& ranges,
                                           const physics::ElasticBody& body, Random& random,
                                           std::uint64_t seed) const;
  void predict(std::vector<Lesion>& lesions) const;
  [[nodiscard]] std::optional<double> height_m(double x_m, double y_m) const;

  const Session& session_;
  const PalpationTask* task_ = nullptr;
  std::vector<std::array<Vector3, 3>> triangles_;  // of the surface that is to be searched
  std::vector<double> area_until_m2_;              // of the triangles up to each
};

}  // namespace palpate
