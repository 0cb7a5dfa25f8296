// SPDX-License-Identifier: Apache-2.0
#include "deploy/scan/label_votes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <tuple>

namespace palpate::scan {
namespace {

constexpr double kWidth = 0.7;        // of the weights, in the longest edge of a voxel
constexpr double kWidthOfEdge = 0.2;  // at least, in the edge of an element
constexpr double kStepsPerWidth = 1.5;
constexpr double kReach = 2.5;      // in widths
constexpr double kFarReach = 12.0;  // where no label is within kReach
constexpr double kLargestHandicap = 0.45;
constexpr int kRounds = 60;

/// Of an element's region: those with the least loss of votes come first.
struct Change {
  double loss;
  std::size_t element;
  std::uint16_t to;
  [[nodiscard]] bool operator<(const Change& other) const {
    return std::tie(loss, element, to) < std::tie(other.loss, other.element, other.to);
  }
};

}  // namespace

std::vector<LabelVotes::Vote> LabelVotes::votes(const Vector3& index, double edge_m) const {
  const Vector3 spacing_m = map_.spacing_m();
  const Vector3 widths =
      std::max(kWidth * spacing_m.maxCoeff(), kWidthOfEdge * edge_m) * spacing_m.cwiseInverse();
  std::array<std::int64_t, 3> step{};  // where very many voxels would vote, some do
  for (std::size_t a = 0; a < 3; ++a) {
    step[a] = std::max<std::int64_t>(
        1, static_cast<std::int64_t>(widths[static_cast<Eigen::Index>(a)] / kStepsPerWidth));
  }
  std::vector<Vote> found;
  for (const double reach : {kReach, kFarReach}) {
    std::array<std::int64_t, 3> low{};
    std::array<std::int64_t, 3> high{};
    for (std::size_t a = 0; a < 3; ++a) {
      const auto axis = static_cast<Eigen::Index>(a);
      const double radius = reach * widths[axis];
      const auto most = static_cast<double>(map_.size[a]) - 1.0;
      low[a] = static_cast<std::int64_t>(std::clamp(std::ceil(index[axis] - radius), 0.0, most));
      low[a] = (low[a] + step[a] - 1) / step[a] * step[a];
      high[a] = static_cast<std::int64_t>(std::clamp(std::floor(index[axis] + radius), 0.0, most));
    }
    double sum = 0.0;
    for (std::int64_t k = low[2]; k <= high[2]; k += step[2]) {
      for (std::int64_t j = low[1]; j <= high[1]; j += step[1]) {
        for (std::int64_t i = low[0]; i <= high[0]; i += step[0]) {
          const std::uint16_t number = map_.at(i, j, k);
          if (number == 0) continue;
          const Vector3 apart =
              (Vector3(static_cast<double>(i), static_cast<double>(j), static_cast<double>(k)) -
               index)
                  .cwiseQuotient(widths);
          const double weight = std::exp(-0.5 * apart.squaredNorm());
          sum += weight;
          const auto same = std::find_if(found.begin(), found.end(),
                                         [&](const Vote& v) { return v.number == number; });
          if (same == found.end()) {
            found.push_back({number, weight});
          } else {
            same->share += weight;
          }
        }
      }
    }
    if (sum <= 0.0) continue;
    for (Vote& vote : found) vote.share /= sum;
    break;
  }
  return found;
}

std::vector<std::uint16_t> LabelVotes::shared_out(const physics::TetrahedralMesh& mesh,
                                                  const Eigen::Affine3d& index_of_m,
                                                  const std::vector<std::uint32_t>& segments,
                                                  const std::vector<double>& wanted) const {
  std::vector<std::uint16_t> regions(mesh.tetrahedra.size(), 0);
  if (segments.size() == 1) return regions;
  std::vector<std::uint16_t> region_of(map_.segments.size() + 1, 0);
  for (std::size_t r = 0; r < segments.size(); ++r)
    region_of[segments[r] + 1] = static_cast<std::uint16_t>(r);

  std::vector<std::vector<Vote>> all;
  std::vector<double> volumes;
  double total = 0.0;
  for (const auto& corners : mesh.tetrahedra) {
    Vector3 centre_m = Vector3::Zero();
    for (const std::uint32_t corner : corners) centre_m += 0.25 * mesh.nodes_m[corner];
    volumes.push_back(physics::six_volumes_m3(mesh.nodes_m, corners));
    // of a regular tetrahedron of this volume
    const double edge_m = std::cbrt(std::numbers::sqrt2 * volumes.back());
    all.push_back(votes(index_of_m * centre_m, edge_m));
    total += volumes.back();
  }
  double all_wanted = 0.0;
  for (const double w : wanted) all_wanted += w;

  std::vector<double> handicap(segments.size(), 0.0);
  double least_error = -1.0;
  std::vector<double> best_handicap = handicap;
  std::vector<std::uint16_t> now(regions.size(), 0);
  double step = 0.1;
  for (int round = 0; round < kRounds; ++round, step *= 0.92) {
    std::vector<double> sums(segments.size(), 0.0);
    for (std::size_t e = 0; e < all.size(); ++e) {
      double best = -1.0;
      for (const Vote& vote : all[e]) {
        const std::uint16_t region = region_of[vote.number];
        const double value = vote.share + handicap[region];
        if (value > best) {
          best = value;
          now[e] = region;
        }
      }
      sums[now[e]] += volumes[e];
    }
    double error = 0.0;
    const std::vector<double> used = handicap;
    for (std::size_t r = 0; r < segments.size(); ++r) {
      if (wanted[r] <= 0.0) continue;
      const double ratio = sums[r] / total * all_wanted / wanted[r] - 1.0;
      error += std::abs(ratio);
      // small errors take small steps
      handicap[r] = std::clamp(handicap[r] - step * std::clamp(5.0 * ratio, -1.0, 1.0),
                               -kLargestHandicap, kLargestHandicap);
    }
    if (least_error < 0.0 || error < least_error) {
      least_error = error;
      regions = now;
      best_handicap = used;
    }
  }

  // many elements may have the same votes, as along a flat boundary: part of them changes sides
  std::vector<double> target;  // volumes
  std::vector<double> sums(segments.size(), 0.0);
  for (const double w : wanted) target.push_back(w * total / all_wanted);
  for (std::size_t e = 0; e < all.size(); ++e) sums[regions[e]] += volumes[e];
  std::vector<Change> changes;
  for (std::size_t e = 0; e < all.size(); ++e) {
    double here = 0.0;
    for (const Vote& vote : all[e]) {
      if (region_of[vote.number] == regions[e]) here = vote.share + best_handicap[regions[e]];
    }
    for (const Vote& vote : all[e]) {
      const std::uint16_t to = region_of[vote.number];
      if (to != regions[e]) changes.push_back({here - vote.share - best_handicap[to], e, to});
    }
  }
  std::sort(changes.begin(), changes.end());
  for (const Change& change : changes) {
    const std::uint16_t from = regions[change.element];
    const double volume = volumes[change.element];
    if (target[from] <= 0.0 || target[change.to] <= 0.0 || from == change.to) continue;
    const auto error = [&](std::size_t r, double more) {
      return std::abs((sums[r] + more) / target[r] - 1.0);
    };
    if (error(from, -volume) + error(change.to, volume) >= error(from, 0.0) + error(change.to, 0.0))
      continue;
    sums[from] -= volume;
    sums[change.to] += volume;
    regions[change.element] = change.to;
  }
  return regions;
}

}  // namespace palpate::scan
