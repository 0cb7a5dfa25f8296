// SPDX-License-Identifier: Apache-2.0
#include "common/task/tissue_damage.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "common/telemetry/summary.h"

namespace palpate {
namespace {

constexpr double kDeepest_m = 0.05;  // of a tip below the surface at rest

}  // namespace

TissueWatch::TissueWatch(const std::vector<TissueLimit>& limits, double tip_radius_m)
    : tip_radius_m_(tip_radius_m) {
  for (const TissueLimit& limit : limits) {
    watched_.push_back(
        {.tissue = limit.tissue,
         .damage = {.name = limit.name,
                    .most_force_newton = limit.most_force_newton,
                    .most_damage_newton_s = limit.most_damage_newton_s.value_or(kNotKnown)}});
  }
}

bool TissueWatch::has_all() const {
  return std::all_of(watched_.begin(), watched_.end(),
                     [](const Watched& one) { return one.surface != nullptr; });
}

void TissueWatch::take(const SceneState& scene) {
  for (Watched& one : watched_) {
    if (one.surface || one.tissue >= scene.tissues.size()) continue;
    auto surface = std::make_unique<SearchedSurface>(
        SearchedSurface::of_no_area(scene.tissues[one.tissue].mesh, tip_radius_m_));
    if (!surface->empty()) one.surface = std::move(surface);
  }
}

/// Pressed tissue gives way, so the tip is then inside its surface at rest, or nearer than its
/// radius. Beside an edge the plane of the nearest place goes on where the surface does not.
bool TissueWatch::touches(const SearchedSurface& surface, const Vector3& tip_m) const {
  const auto foot = surface.foot_of(tip_m, kDeepest_m);
  if (!foot) return false;
  const Vector3 from_foot_m = tip_m - foot->point_m;
  const double height_m = from_foot_m.dot(foot->normal);
  return height_m < tip_radius_m_ &&
         (from_foot_m - height_m * foot->normal).norm() <= tip_radius_m_;
}

void TissueWatch::count(const Vector3& tip_m, double newton, double elapsed_s) {
  for (Watched& one : watched_) {
    if (!one.surface || !touches(*one.surface, tip_m)) continue;
    one.forces.add(newton, elapsed_s);
    const double beyond_newton = newton - one.damage.most_force_newton;
    if (!(beyond_newton > 0.0)) continue;
    TissueDamage& damage = one.damage;
    damage.overshoot_newton = std::max(damage.overshoot_newton, beyond_newton);
    damage.beyond_s += elapsed_s;
    damage.damage_newton_s += beyond_newton * elapsed_s;
  }
}

std::vector<TissueDamage> TissueWatch::figures() const {
  std::vector<TissueDamage> figures;
  for (const Watched& one : watched_) {
    figures.push_back(one.damage);
    figures.back().is_seen = one.surface != nullptr;
    figures.back().force = one.forces.figures();
  }
  return figures;
}

std::vector<std::string> findings_of(const std::vector<TissueDamage>& tissues) {
  std::vector<std::string> findings;
  for (const TissueDamage& one : tissues) {
    if (!one.is_seen) {
      findings.push_back(fmt::format(
          "Whether you pressed too hard on {} is not known: its surface was not received.",
          one.name));
    } else if (one.is_damaged()) {
      findings.push_back(fmt::format(
          "You damaged {}: {:.2g} N·s beyond {:.2g} N; {:.2g} N·s are allowed.", one.name,
          one.damage_newton_s, one.most_force_newton, one.most_damage_newton_s));
    } else if (one.overshoot_newton > 0.0) {
      findings.push_back(fmt::format(
          "You pressed too hard on {}: up to {:.2g} N, {:.2g} N beyond its limit, for {:.2g} s.",
          one.name, one.most_force_newton + one.overshoot_newton, one.overshoot_newton,
          one.beyond_s));
    }
  }
  return findings;
}

std::vector<std::pair<std::string, std::string>> figures_of(
    const std::vector<TissueDamage>& tissues) {
  std::vector<std::pair<std::string, std::string>> figures;
  for (const TissueDamage& one : tissues) {
    if (!one.is_seen) continue;
    const std::string allowed = std::isfinite(one.most_damage_newton_s)
                                    ? fmt::format(" of {:.3g}", one.most_damage_newton_s)
                                    : "";
    figures.emplace_back("limit of " + one.name,
                         fmt::format("{:.2f} N; beyond it by {:.2f} N, for {:.2f} s, {:.3f}{} N·s",
                                     one.most_force_newton, one.overshoot_newton, one.beyond_s,
                                     one.damage_newton_s, allowed));
  }
  return figures;
}

nlohmann::ordered_json tissues_json(const std::vector<TissueDamage>& tissues) {
  auto json = nlohmann::ordered_json::array();
  for (const TissueDamage& one : tissues) {
    json.push_back({{"name", one.name},
                    {"is_seen", one.is_seen},
                    {"is_damaged", one.is_damaged()},
                    {"most_force_n", one.most_force_newton},
                    {"most_damage_n_s", number_or_null(one.most_damage_newton_s)},
                    {"overshoot_n", one.overshoot_newton},
                    {"beyond_s", one.beyond_s},
                    {"damage_n_s", one.damage_newton_s},
                    {"force", force_json(one.force)}});
  }
  return json;
}

}  // namespace palpate
