// SPDX-License-Identifier: Apache-2.0
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <set>

#include "common/core/check.h"
#include "common/core/problems.h"
#include "common/core/random.h"
#include "common/session/session_file.h"
#include "deploy/campaign/campaign.h"
#include "deploy/campaign/checked_text.h"
#include "mofc_node/make_controller.h"
#include "palpate/v1/campaign.pb.h"

namespace palpate::campaign {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMaxRuns = 20'000'000;
constexpr std::uint64_t kMaxCellsChecked = 1000;

/// Reads one campaign; what it returns is one only if there are no problems.
class Reader {
 public:
  Reader(const v1::Campaign& written, const CheckedText& text) : written_(written), text_(text) {}

  Campaign read() {
    campaign_.name = written_.name();
    text_.check_name(campaign_.name);
    campaign_.overrides = {written_.set().begin(), written_.set().end()};
    for (int i = 0; i < written_.vary_size(); ++i) add_dimension(i);
    campaign_.is_hostile = written_.has_hostile();
    campaign_.has_lying_clamp = written_.hostile().lying_clamp();
    campaign_.has_hostile_wrist = written_.hostile().wrist();
    campaign_.runs_per_cell = written_.has_runs() ? written_.runs() : 1;
    campaign_.first_seed = written_.has_first_seed() ? written_.first_seed() : 1;
    for (int i = 0; i < written_.report_size(); ++i) {
      quantity(fmt::format("report[{}]", i), written_.report(i));
    }
    campaign_.reported = campaign_.quantities.size();
    for (int i = 0; i < written_.limit_size(); ++i) add_limit(i);
    if (campaign_.quantities.empty()) {
      problem("report", "required; give a quantity: " + names_of_quantities());
    }
    campaign_.stops_at_violation = written_.stop_at_violation();
    if (campaign_.stops_at_violation && campaign_.limits.empty()) {
      problem("stop_at_violation", "needs a limit { … }; give one, or leave this out");
    }
    return campaign_;
  }

 private:
  void problem(const std::string& at, const std::string& rule) { text_.problem(at, rule); }

  void add_dimension(int index) {
    const v1::Vary& vary = written_.vary(index);
    const std::string at = fmt::format("vary[{}]", index);
    using Kind = Dimension::Kind;
    Dimension dimension{.name = vary.name().empty() ? vary.field() : vary.name(),
                        .field = vary.field(),
                        .kind = Kind::kCartesian,
                        .values = {}};
    const auto add_values = [&](const v1::Values& values, const std::string& where) {
      if (values.value_size() == 0) problem(where, "needs a value: \"…\"");
      for (const std::string& value : values.value()) {
        dimension.values.push_back({value, {vary.field() + "=" + value}});
      }
    };
    const auto set_range = [&](const v1::Range& range, Kind kind, const std::string& where) {
      dimension.kind = kind;
      dimension.low = range.low();
      dimension.high = range.high();
      if (!(range.low() < range.high())) problem(where, "high must be above low");
      if (kind == Kind::kLogUniform && !(range.low() > 0.0)) problem(where, "low must be > 0");
    };
    switch (vary.design_case()) {
      case v1::Vary::kValues:
        add_values(vary.values(), at + ".values");
        break;
      case v1::Vary::kChoice:
        dimension.kind = Kind::kChoice;
        add_values(vary.choice(), at + ".choice");
        break;
      case v1::Vary::kUniform:
        set_range(vary.uniform(), Kind::kUniform, at + ".uniform");
        break;
      case v1::Vary::kLogUniform:
        set_range(vary.log_uniform(), Kind::kLogUniform, at + ".log_uniform");
        break;
      case v1::Vary::kOptions:
        if (vary.options().option_size() == 0) problem(at + ".options", "needs an option { … }");
        for (const v1::Option& option : vary.options().option()) {
          dimension.values.push_back({option.name(), {option.set().begin(), option.set().end()}});
        }
        break;
      case v1::Vary::DESIGN_NOT_SET:
        problem(at, "needs one of values, options, choice, uniform and log_uniform");
        break;
    }
    const bool has_options = vary.design_case() == v1::Vary::kOptions;
    if (has_options != vary.field().empty()) {
      problem(at, has_options ? "options set fields of their own; leave field out"
                              : "needs field: \"…\", the session field that it varies");
    }
    if (dimension.name.empty()) problem(at, "needs a name: \"…\" for the column of the results");
    if (!names_.insert(dimension.name).second) {
      problem(at, "\"" + dimension.name + "\" is varied twice; give each its own name");
    }
    campaign_.dimensions.push_back(std::move(dimension));
  }

  static std::string names_of_quantities() {
    std::string names;
    for (const Quantity& quantity : quantities()) {
      names += (names.empty() ? "" : ", ") + std::string(quantity.name);
    }
    return names;
  }

  /// Index in Campaign::quantities, where it is added.
  std::size_t quantity(const std::string& at, const std::string& name) {
    auto& known = campaign_.quantities;
    const Quantity* const found = find_quantity(name);
    if (found == nullptr) {
      if (!name.empty()) {
        problem(at, "\"" + name + "\" is no quantity; give one of " + names_of_quantities());
      }
      return 0;
    }
    const auto place = std::find(known.begin(), known.end(), found);
    const auto index = static_cast<std::size_t>(place - known.begin());
    if (place == known.end()) known.push_back(found);
    return index;
  }

  template <class Message>
  Bounds bounds(const std::string& at, const Message& written) {
    Bounds bounds{.quantity = quantity(at + ".quantity", written.quantity())};
    if (written.has_at_least()) bounds.at_least = written.at_least();
    if (written.has_at_most()) bounds.at_most = written.at_most();
    if (!bounds.at_least && !bounds.at_most) problem(at, "needs at_least or at_most");
    return bounds;
  }

  void add_limit(int index) {
    const std::string at = fmt::format("limit[{}]", index);
    const v1::Limit& written = written_.limit(index);
    Limit limit{.bounds = bounds(at, written), .where = {}};
    for (int i = 0; i < written.where_size(); ++i) {
      limit.where.push_back(bounds(fmt::format("{}.where[{}]", at, i), written.where(i)));
    }
    campaign_.limits.push_back(std::move(limit));
  }

  const v1::Campaign& written_;
  const CheckedText& text_;
  std::set<std::string> names_;
  Campaign campaign_;
};

/// Not of the number of runs: a campaign may go on with more.
std::uint64_t fingerprint_of(v1::Campaign written, const std::set<std::string>& files) {
  written.clear_runs();
  std::string text = written.DebugString();
  for (const std::string& file : files) {
    std::error_code error;
    if (fs::is_regular_file(file, error)) text += fmt::format("{:x}\n", hash_of_file(file));
  }
  text += fmt::format("{:x}\n", hash_of_file("/proc/self/exe"));
  return fnv1a(text);
}

/// All files that any run can read, whatever values it combines.
std::set<std::string> files_of_runs(const Campaign& campaign) {
  std::vector<std::string> overrides = campaign.overrides;
  for (const Dimension& dimension : campaign.dimensions) {
    for (const Value& value : dimension.values) {
      overrides.insert(overrides.end(), value.overrides.begin(), value.overrides.end());
    }
  }
  const std::vector<std::string> named = files_of_any(campaign.session_file, overrides);
  std::set<std::string> files(named.begin(), named.end());
  files.insert(mofc::rivals_library());  // which any session may come to need
  return files;
}

}  // namespace

std::uint64_t hash_of_file(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::uint64_t hash = fnv1a(file.filename().string());
  std::string block(1U << 16U, '\0');
  while (in.read(block.data(), static_cast<std::streamsize>(block.size())) || in.gcount() > 0) {
    hash = hash * 1099511628211ULL ^
           fnv1a(std::string_view(block.data(), static_cast<std::size_t>(in.gcount())));
  }
  return hash;
}

Campaign load_campaign(const fs::path& file, std::optional<std::uint64_t> runs) {
  Problems problems(file.string());
  v1::Campaign written;
  const CheckedText text(file, "campaign", written, problems);
  Campaign campaign = Reader(written, text).read();
  problems.throw_if_any();

  campaign.file = file;
  campaign.session_file = (file.parent_path() / written.session()).lexically_normal();
  if (runs) campaign.runs_per_cell = *runs;
  if (campaign.cells() > kMaxRuns || campaign.run_count() > kMaxRuns) {
    throw SetupError(
        fmt::format("{}: has {} cells of {} runs, a campaign has at most {} runs; "
                    "divide it by first_seed or by values",
                    file.string(), campaign.cells(), campaign.runs_per_cell, kMaxRuns));
  }
  const Session first = load_session(campaign.session_file, plan_of(campaign, 0).overrides);
  campaign.seconds = written.has_seconds() ? written.seconds() : first.duration_s;
  for (std::uint64_t cell = 1; cell < std::min(campaign.cells(), kMaxCellsChecked); ++cell) {
    const Plan plan = plan_of(campaign, cell * campaign.runs_per_cell);
    static_cast<void>(load_session(campaign.session_file, plan.overrides));
  }
  const std::set<std::string> files = files_of_runs(campaign);
  for (const std::string& name : files) campaign.marks[name] = mark_of(name);
  campaign.fingerprint = fingerprint_of(written, files);
  campaign.files.assign(files.begin(), files.end());
  campaign.files.push_back(file.string());
  return campaign;
}

}  // namespace palpate::campaign
