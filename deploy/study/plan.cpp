// SPDX-License-Identifier: Apache-2.0
#include "deploy/study/plan.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <set>
#include <sstream>

#include "common/core/check.h"
#include "common/core/problems.h"
#include "common/core/random.h"
#include "common/core/user/files.h"
#include "common/core/user/utf8.h"
#include "common/session/session_file.h"
#include "common/telemetry/csv_writer.h"
#include "deploy/campaign/campaign.h"
#include "deploy/campaign/checked_text.h"
#include "palpate/v1/session.pb.h"
#include "palpate/v1/study.pb.h"

namespace palpate::study {
namespace {

constexpr int kMostConditions = 26;  // one letter each
constexpr std::uintmax_t kMostSessionBytes = 10'000'000;

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
    if (not_utf8_at(one.name()) || one.name().find('\0') != std::string::npos) {
      text.problem(fmt::format("condition[{}].name", i),
                   "is not UTF-8 text, or has zero bytes; give letters");
    }
    if (!names.insert(csv_text(one.name())).second) {
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

/// One of the sessions that a plan makes.
struct Case {
  std::size_t condition = 0;
  std::size_t alternative = 0;
  double difference_ratio = 0.0;
};

std::vector<std::string> overrides_of(const Plan& plan, const Case& one) {
  return plan.overrides_of(one.condition, one.alternative, one.difference_ratio);
}

std::vector<Origin> origins_of(const Plan& plan, const Case& session) {
  std::vector<Origin> origins;
  const auto add = [&](const std::string& above, const std::vector<std::string>& sets) {
    for (std::size_t i = 0; i < sets.size(); ++i) {
      origins.push_back({sets[i], fmt::format("{}set[{}]", above, i)});
    }
  };
  add("", plan.overrides);
  add(fmt::format("condition[{}].", session.condition),
      plan.conditions[session.condition].overrides);
  if (!plan.staircase) return origins;
  add(fmt::format("staircase.alternative[{}].", session.alternative),
      plan.staircase->alternatives[session.alternative]);
  const auto field = plan.staircase->field + "=";
  const bool is_start = session.difference_ratio > 0.0;
  for (const std::string& one : overrides_of(plan, session)) {
    if (!one.starts_with(field)) continue;
    origins.push_back({one, is_start ? "staircase.start_ratio" : "staircase.field"});
  }
  return origins;
}

/// What is wrong with the session of a condition, where the plan has it. False: it is wrong in the
/// session itself.
bool blame(const Plan& plan, const Case& session, const std::string& complaint,
           const campaign::CheckedText& text) {
  bool is_of_plan = false;
  std::istringstream lines(complaint);
  for (std::string line; std::getline(lines, line);) {
    for (const Origin& origin : origins_of(plan, session)) {
      const std::string begin = "--set " + one_line(origin.override_text) + ": ";
      if (!line.starts_with(begin)) continue;
      is_of_plan = true;
      const bool is_of_condition = origin.at.starts_with("condition");
      text.problem(origin.at,
                   (is_of_condition ? fmt::format("of condition \"{}\": ",
                                                  one_line(plan.conditions[session.condition].name))
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
void refuse_rivals_of_staircase(const Plan& plan, const campaign::CheckedText& text) {
  if (!plan.staircase) return;
  const auto check = [&](const std::string& above, const std::vector<std::string>& overrides) {
    for (std::size_t i = 0; i < overrides.size(); ++i) {
      const std::string path = overrides[i].substr(0, overrides[i].find('='));
      if (!plan.staircase->field.starts_with(path)) continue;
      const std::string rest = plan.staircase->field.substr(path.size());
      if (!rest.empty() && rest.front() != '.' && rest.front() != '[') continue;
      text.problem(fmt::format("{}set[{}]", above, i),
                   "\"" + one_line(overrides[i]) + "\" sets what the staircase sets, " +
                       one_line(plan.staircase->field) +
                       "; leave it out, or give the staircase another field");
    }
  };
  check("", plan.overrides);
  for (std::size_t i = 0; i < plan.conditions.size(); ++i) {
    check(fmt::format("condition[{}].", i), plan.conditions[i].overrides);
  }
  for (std::size_t i = 0; i < plan.staircase->alternatives.size(); ++i) {
    check(fmt::format("staircase.alternative[{}].", i), plan.staircase->alternatives[i]);
  }
}

void check_session(const Plan& plan, const Session& session, const campaign::CheckedText& text) {
  const std::string file = one_line(plan.session_file.string());
  if (!session.task) {
    text.problem("session",
                 file +
                     ": has no task, so its trials have no score; give it task { … }, or name "
                     "another session");
    return;
  }
  const auto* search = session.task->palpation();
  if (plan.staircase && (search == nullptr || search->targets.empty())) {
    text.problem("staircase", "of " + file +
                                  ": a staircase needs task { palpation { target { … } } }: an "
                                  "answer is right if the first mark is where a target is");
  }
}

/// Why the session cannot be made; "" if it can.
std::string complaint_of(const Plan& plan, const Case& one) {
  try {
    static_cast<void>(load_session(plan.session_file, overrides_of(plan, one)));
    return "";
  } catch (const SetupError& error) {
    return error.what();
  }
}

std::vector<Case> cases_of(const Plan& plan, double difference_ratio) {
  std::vector<Case> cases;
  const std::size_t alternatives = plan.staircase ? plan.staircase->alternatives.size() : 1;
  for (std::size_t i = 0; i < plan.conditions.size() * alternatives; ++i) {
    cases.push_back({.condition = i / alternatives,
                     .alternative = i % alternatives,
                     .difference_ratio = difference_ratio});
  }
  return cases;
}

/// The largest difference that the session takes, between one that it takes and one that it does
/// not: to 0.01 %, and in three digits if that is one.
double largest_difference(const Plan& plan, Case session, double taken, double refused) {
  constexpr double kNear = 1.0001;
  const auto is_taken = [&](double difference_ratio) {
    session.difference_ratio = difference_ratio;
    return complaint_of(plan, session).empty();
  };
  while (refused / taken > kNear) {
    const double middle = std::sqrt(taken * refused);
    (is_taken(middle) ? taken : refused) = middle;
  }
  const double rounded = std::stod(fmt::format("{:.3g}", taken));
  return rounded > taken && rounded <= refused * kNear && is_taken(rounded) ? rounded : taken;
}

/// Wrong answers let the difference grow: as far as every session takes it.
void limit_differences(Plan& plan, const campaign::CheckedText& text) {
  if (!plan.staircase) return;
  StaircasePlan& staircase = *plan.staircase;
  const double start = staircase.start_ratio;
  const double most = std::min(
      staircase.most_ratio,
      start * std::pow(staircase.step_factor, static_cast<double>(staircase.most_trials - 1)));
  std::string why;
  for (Case session : cases_of(plan, start)) {
    const std::string complaint = complaint_of(plan, session);
    if (!complaint.empty()) {
      if (!blame(plan, session, complaint, text)) throw SetupError(complaint);
      continue;
    }
    session.difference_ratio = std::min(most, staircase.most_ratio);
    std::string of_largest = complaint_of(plan, session);
    if (of_largest.empty()) continue;
    why = std::move(of_largest);
    staircase.most_ratio = largest_difference(plan, session, start, session.difference_ratio);
  }
  if (why.empty()) return;
  // the complaint has a count and then its lines
  why = why.substr(why.rfind('\n') + 1);
  const std::size_t set = why.find(": ");
  if (why.starts_with("--set ") && set != std::string::npos) why = why.substr(set + 2);
  plan.notes.push_back(
      fmt::format("{}: the session takes a difference of at most {:.4g} %, so no series grows "
                  "beyond it, whatever the answers ({}); if participants need more, give another "
                  "reference or another field",
                  text.where("staircase.field"), 100.0 * staircase.most_ratio, one_line(why)));
}

}  // namespace

Plan load_plan(const std::filesystem::path& file) {
  Problems problems(file.string());
  v1::Study written;
  const campaign::CheckedText text(file, "study", written, problems);
  Plan plan = to_plan(written, text);
  if (plan.staircase && !plan.staircase->field.empty()) check_field(plan.staircase->field, text);
  plan.session_file = (file.parent_path() / written.session()).lexically_normal();
  if (!written.session().empty()) {
    const std::string complaint = read_text_file(plan.session_file, kMostSessionBytes).complaint;
    if (!complaint.empty()) {
      text.problem("session", one_line(plan.session_file.string()) + ": " + complaint);
    }
  }
  problems.throw_if_any();
  plan.file = file;
  refuse_rivals_of_staircase(plan, text);
  problems.throw_if_any();
  std::string all = written.DebugString();
  std::vector<std::string> named;  // overrides of any trial
  for (const Case& one : cases_of(plan, 0.0)) {
    const std::vector<std::string> overrides = overrides_of(plan, one);
    named.insert(named.end(), overrides.begin(), overrides.end());
    try {
      check_session(plan, load_session(plan.session_file, overrides), text);
    } catch (const SetupError& error) {
      if (!blame(plan, one, error.what(), text)) throw;
    }
  }
  problems.throw_if_any();
  limit_differences(plan, text);
  problems.throw_if_any();
  plan.files = files_of_any(plan.session_file, named);
  for (const std::string& name : plan.files) {
    all += fmt::format("{}\n{:x}\n", name, campaign::hash_of_file(name));
  }
  plan.fingerprint = fnv1a(all);
  return plan;
}

}  // namespace palpate::study
