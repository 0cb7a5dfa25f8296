// SPDX-License-Identifier: Apache-2.0
#include "deploy/campaign/campaign.h"

#include <spdlog/fmt/fmt.h>
#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <optional>

#include "common/core/check.h"
#include "common/core/random.h"
#include "common/session/session_file.h"
#include "deploy/campaign/hostile_design.h"
#include "deploy/campaign/shell_word.h"
#include "deploy/lockstep/loopback.h"

namespace palpate::campaign {
namespace {

/// The value that a random dimension has in a run of this seed.
std::string drawn(const Dimension& dimension, std::uint64_t seed) {
  Random random(stream_seed(seed, ("vary " + dimension.name).c_str()));
  switch (dimension.kind) {
    case Dimension::Kind::kChoice:
      return dimension.values[random.below(dimension.values.size())].label;
    case Dimension::Kind::kUniform:
      return fmt::format("{}", random.uniform(dimension.low, dimension.high));
    default:
      return fmt::format(
          "{}", dimension.low * std::pow(dimension.high / dimension.low, random.uniform()));
  }
}

std::int64_t ns_of(const timespec& time) {
  return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
}

}  // namespace

FileMark mark_of(const std::string& file) {
  struct stat state {};
  if (::stat(file.c_str(), &state) != 0) return {};
  return {.device = state.st_dev,
          .inode = state.st_ino,
          .bytes = state.st_size,
          .modified_ns = ns_of(state.st_mtim),
          .changed_ns = ns_of(state.st_ctim)};
}

std::string Bounds::text(const std::vector<const Quantity*>& quantities) const {
  std::string text = quantities[quantity]->name;
  if (at_least) text += fmt::format(" ≥ {}", *at_least);
  if (at_most) text += fmt::format(" ≤ {}", *at_most);
  return text;
}

bool Limit::applies(std::span<const double> figures) const {
  return std::all_of(where.begin(), where.end(),
                     [&](const Bounds& condition) { return condition.hold(figures); });
}

std::uint64_t Campaign::cells() const {
  std::uint64_t cells = 1;
  for (const Dimension& dimension : dimensions) {
    if (dimension.kind == Dimension::Kind::kCartesian) cells *= dimension.values.size();
  }
  return cells;
}

bool Campaign::needs_ideal() const {
  return std::any_of(quantities.begin(), quantities.end(),
                     [](const Quantity* quantity) { return quantity->needs_ideal; });
}

bool Campaign::is_violated(std::span<const double> figures) const {
  return std::any_of(limits.begin(), limits.end(),
                     [&](const Limit& limit) { return limit.is_violated(figures); });
}

Plan plan_of(const Campaign& campaign, std::uint64_t run) {
  Plan plan{.run = run,
            .seed = campaign.first_seed + run % campaign.runs_per_cell,
            .overrides = campaign.overrides,
            .labels = std::vector<std::string>(campaign.dimensions.size())};
  const auto add = [&](const std::vector<std::string>& more) {
    plan.overrides.insert(plan.overrides.end(), more.begin(), more.end());
  };
  if (campaign.is_hostile) add(hostile_overrides(plan.seed));
  if (campaign.has_hostile_wrist) add(hostile_wrist_overrides(plan.seed));
  if (campaign.has_lying_clamp) plan.overrides.push_back(lying_clamp_override(plan.seed));

  // the last dimension varies fastest
  std::vector<const Value*> chosen(campaign.dimensions.size());
  std::uint64_t cell = run / campaign.runs_per_cell;
  for (std::size_t i = campaign.dimensions.size(); i-- > 0;) {
    const Dimension& dimension = campaign.dimensions[i];
    if (dimension.kind != Dimension::Kind::kCartesian) continue;
    chosen[i] = &dimension.values[cell % dimension.values.size()];
    cell /= dimension.values.size();
  }
  for (std::size_t i = 0; i < campaign.dimensions.size(); ++i) {
    const Dimension& dimension = campaign.dimensions[i];
    if (chosen[i] != nullptr) {
      plan.labels[i] = chosen[i]->label;
      add(chosen[i]->overrides);
    } else {
      plan.labels[i] = drawn(dimension, plan.seed);
      plan.overrides.push_back(dimension.field + "=" + plan.labels[i]);
    }
  }
  plan.overrides.push_back(fmt::format("seed={}", plan.seed));
  return plan;
}

std::string command_line(const Campaign& campaign, const Plan& plan) {
  std::string line = fmt::format("palpate loopback {} --seconds {}",
                                 shell_word(campaign.session_file.string()), campaign.seconds);
  for (const std::string& override : plan.overrides)
    line += fmt::format(" --set {}", shell_word(override));
  return line;
}

namespace {

void check_unchanged(const Campaign& campaign) {
  for (const auto& [file, mark] : campaign.marks) {
    if (mark_of(file) == mark) continue;
    throw SetupError(file +
                     ": has changed since the sweep began; with its old content the same command "
                     "goes on, for the new one give another --folder");
  }
}

}  // namespace

std::vector<double> compute(const Campaign& campaign, const Plan& plan,
                            const std::string& mcap_file, bool may_overwrite) {
  std::optional<Session> session;
  RunReport report;
  try {
    session = load_session(campaign.session_file, plan.overrides);
    for (const std::string& file : files_of(*session)) {
      if (campaign.marks.contains(file)) continue;
      throw SetupError(file +
                       ": was not named when the sweep began, so its results do not depend on it; "
                       "begin again with another --folder");
    }
    report = run_loopback(*session, {.seconds = campaign.seconds,
                                     .record = {.file = mcap_file, .may_overwrite = may_overwrite},
                                     .recorded_by = "palpate sweep",
                                     .lockstep = {.has_ideal = campaign.needs_ideal()}});
  } catch (const std::exception&) {
    check_unchanged(campaign);  // a file read while it was being written holds anything
    throw;
  }
  check_unchanged(campaign);
  std::vector<double> figures;
  figures.reserve(campaign.quantities.size());
  for (const Quantity* quantity : campaign.quantities) {
    figures.push_back(quantity->of(report, session->side()));
  }
  return figures;
}

}  // namespace palpate::campaign
