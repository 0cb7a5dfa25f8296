// SPDX-License-Identifier: Apache-2.0
#include "deploy/study/plan.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <set>
#include <sstream>

#include "common/core/check.h"
#include "common/core/problems.h"
#include "common/core/random.h"
#include "common/session/session_file.h"
#include "deploy/campaign/campaign.h"
#include "deploy/campaign/checked_text.h"
#include "palpate/v1/session.pb.h"
#include "palpate/v1/study.pb.h"

namespace palpate::study {
namespace {

constexpr int kMostConditions = 26;  // one letter each

template <class Texts>
std::vector<std::string> list_of(const Texts& texts) {
  return {texts.begin(), texts.end()};
}

StaircasePlan to_staircase(const v1::StudyStaircase& written, const campaign::CheckedText& text) {
  StaircasePlan staircase{.field = written.field(), .reference = written.reference()};
  if (written.has_start_ratio()) staircase.start_ratio = written.start_ratio();
  if (written.has_step_factor()) staircase.step_factor = written.step_factor();
  if (written.has_right_answers()) staircase.right_answers = written.right_answers();
  if (written.has_reversals()) staircase.reversals = written.reversals();
  if (written.has_most_trials()) staircase.most_trials = written.most_trials();
  for (const v1::StudyAlternative& one : written.alternative()) {
    staircase.alternatives.push_back(list_of(one.set()));
  }
  if (staircase.alternatives.size() < 2) {
    text.problem("staircase",
                 "needs at least two of alternative { set: … }, where the difference "
                 "may be");
  }
  return staircase;
}

Plan to_plan(const v1::Study& written, const campaign::CheckedText& text) {
  Plan plan;
  plan.name = written.name();
  text.check_name(plan.name);
  plan.overrides = list_of(written.set());
  std::set<std::string> names;
  for (int i = 0; i < written.condition_size(); ++i) {
    const v1::StudyCondition& one = written.condition(i);
    if (!names.insert(one.name()).second) {
      text.problem(fmt::format("condition[{}].name", i),
                   "another condition has this name too; give each its own");
    }
    plan.conditions.push_back({.name = one.name(), .overrides = list_of(one.set())});
  }
  if (plan.conditions.empty() || written.condition_size() > kMostConditions) {
    text.problem("condition", "1 … 26 are required; give condition { name: … set: … }");
  }
  if (written.has_repeats()) plan.repeats = written.repeats();
  if (written.has_seconds()) plan.seconds = written.seconds();
  if (written.has_seed()) plan.seed = written.seed();
  if (written.has_staircase()) {
    plan.staircase = to_staircase(written.staircase(), text);
    if (written.has_repeats()) {
      text.problem("repeats", "a staircase ends by itself; leave repeats out");
    }
  }
  return plan;
}

/// An override and the field of the plan that has it.
struct Origin {
  std::string override_text;
  std::string at;
};

std::vector<Origin> origins_of(const Plan& plan, std::size_t condition, std::size_t alternative) {
  std::vector<Origin> origins;
  const auto add = [&](const std::string& above, const std::vector<std::string>& sets) {
    for (std::size_t i = 0; i < sets.size(); ++i) {
      origins.push_back({sets[i], fmt::format("{}set[{}]", above, i)});
    }
  };
  add("", plan.overrides);
  add(fmt::format("condition[{}].", condition), plan.conditions[condition].overrides);
  if (!plan.staircase) return origins;
  add(fmt::format("staircase.alternative[{}].", alternative),
      plan.staircase->alternatives[alternative]);
  const auto field = plan.staircase->field + "=";
  for (const std::string& one : plan.overrides_of(condition, alternative, 0.0)) {
    if (one.starts_with(field)) origins.push_back({one, "staircase.field"});
  }
  return origins;
}

/// What is wrong with the session of a condition, where the plan has it. False: it is wrong in the
/// session itself.
bool blame(const Plan& plan, std::size_t condition, std::size_t alternative,
           const std::string& complaint, const campaign::CheckedText& text) {
  bool is_of_plan = false;
  std::istringstream lines(complaint);
  for (std::string line; std::getline(lines, line);) {
    for (const Origin& origin : origins_of(plan, condition, alternative)) {
      const std::string begin = "--set " + one_line(origin.override_text) + ": ";
      if (!line.starts_with(begin)) continue;
      is_of_plan = true;
      const bool is_of_condition = origin.at.starts_with("condition");
      text.problem(origin.at,
                   (is_of_condition ? fmt::format("of condition \"{}\": ",
                                                  one_line(plan.conditions[condition].name))
                                    : "") +
                       line.substr(begin.size()));
      break;
    }
  }
  return is_of_plan;
}

/// A staircase needs a field that takes any value.
void check_field(const std::string& path, const campaign::CheckedText& text) {
  const google::protobuf::Descriptor* message = v1::Session::descriptor();
  const google::protobuf::FieldDescriptor* field = nullptr;
  std::istringstream names(path);
  for (std::string name; std::getline(names, name, '.');) {
    field = message == nullptr ? nullptr : message->FindFieldByName(name.substr(0, name.find('[')));
    if (field == nullptr) return;  // the session says so
    message = field->message_type();
  }
  if (field != nullptr && field->type() == google::protobuf::FieldDescriptor::TYPE_DOUBLE) return;
  text.problem("staircase.field",
               "\"" + one_line(path) +
                   "\" is no number with decimals; give the path of one in the session, such as "
                   "scene.tissue[0].kelvin_voigt.stiffness_newton_per_m");
}

}  // namespace

std::vector<std::string> Plan::overrides_of(std::size_t condition, std::size_t alternative,
                                            double difference_ratio) const {
  std::vector<std::string> all = overrides;
  const auto add = [&](const std::vector<std::string>& more) {
    all.insert(all.end(), more.begin(), more.end());
  };
  add(conditions[condition].overrides);
  if (!staircase) return all;
  all.push_back(
      fmt::format("{}={:.9g}", staircase->field, staircase->reference * (1.0 + difference_ratio)));
  add(staircase->alternatives[alternative]);
  return all;
}

namespace {

/// Nothing else may set what the staircase sets, nor a message that has it: the difference of a
/// trial would be another one than its row says.
void refuse_rivals_of_staircase(const Plan& plan) {
  if (!plan.staircase) return;
  const auto check = [&](const std::vector<std::string>& overrides) {
    for (const std::string& one : overrides) {
      const std::string path = one.substr(0, one.find('='));
      if (!plan.staircase->field.starts_with(path)) continue;
      const std::string rest = plan.staircase->field.substr(path.size());
      if (!rest.empty() && rest.front() != '.' && rest.front() != '[') continue;
      throw SetupError(plan.file.string() + ": \"" + one + "\" sets what the staircase sets, " +
                       plan.staircase->field +
                       "; leave it out, or give the staircase another field");
    }
  };
  check(plan.overrides);
  for (const Condition& condition : plan.conditions) check(condition.overrides);
  for (const auto& alternative : plan.staircase->alternatives) check(alternative);
}

void check_session(const Plan& plan, const Session& session) {
  if (!session.task) {
    throw SetupError(plan.session_file.string() +
                     ": has no task, so its trials have no score; give task { … }");
  }
  const auto* search = session.task->palpation();
  if (plan.staircase && (search == nullptr || search->targets.empty())) {
    throw SetupError(plan.session_file.string() +
                     ": a staircase needs task { palpation { target { … } } }: an answer is right "
                     "if the first mark is where a target is");
  }
}

}  // namespace

Plan load_plan(const std::filesystem::path& file) {
  Problems problems(file.string());
  v1::Study written;
  const campaign::CheckedText text(file, "study", written, problems);
  Plan plan = to_plan(written, text);
  if (plan.staircase && !plan.staircase->field.empty()) check_field(plan.staircase->field, text);
  problems.throw_if_any();
  plan.file = file;
  refuse_rivals_of_staircase(plan);
  plan.session_file = (file.parent_path() / written.session()).lexically_normal();
  std::string all = written.DebugString();
  std::vector<std::string> named;  // overrides of any trial
  const std::size_t alternatives = plan.staircase ? plan.staircase->alternatives.size() : 1;
  for (std::size_t i = 0; i < plan.conditions.size() * alternatives; ++i) {
    const std::size_t condition = i / alternatives;
    const std::size_t alternative = i % alternatives;
    const std::vector<std::string> overrides = plan.overrides_of(condition, alternative, 0.0);
    named.insert(named.end(), overrides.begin(), overrides.end());
    try {
      check_session(plan, load_session(plan.session_file, overrides));
    } catch (const SetupError& error) {
      if (!blame(plan, condition, alternative, error.what(), text)) throw;
    }
  }
  problems.throw_if_any();
  for (const std::string& name : files_of_any(plan.session_file, named)) {
    all += fmt::format("{}\n{:x}\n", name, campaign::hash_of_file(name));
  }
  plan.fingerprint = fnv1a(all);
  return plan;
}

}  // namespace palpate::study
