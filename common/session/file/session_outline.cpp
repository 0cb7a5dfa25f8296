// SPDX-License-Identifier: Apache-2.0
#include "common/session/file/session_outline.h"

#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <algorithm>
#include <utility>

#include "common/core/problems.h"
#include "common/session/file/session_rules.h"
#include "common/session/file/session_text.h"

namespace palpate {

namespace {

namespace pb = google::protobuf;
using pb::io::Tokenizer;

/// Drops what the tokenizer says: the parser says the same.
class NoErrors : public pb::io::ErrorCollector {
 public:
  void AddError(int /*line*/, pb::io::ColumnNumber /*column*/,
                const std::string& /*text*/) override {}
};

/// "−", "１": a character outside ASCII; empty: the text begins with none.
std::string foreign_character_complaint(std::string_view text) {
  const auto first = static_cast<unsigned char>(text.front());
  if (first < 0x80) return {};
  const std::size_t bytes = first >= 0xf0 ? 4 : first >= 0xe0 ? 3 : 2;
  const std::string character(text.substr(0, bytes));
  return "cannot be read: " + character +
         " can stand only in quotes and comments; write letters, digits and signs of ASCII, such "
         "as - for a minus";
}

}  // namespace

std::string curly_quote_complaint(std::string_view text) {
  for (const std::string_view quote : {"“", "”", "„", "‘", "’", "‚", "«", "»"}) {
    if (text.starts_with(quote)) {
      return "cannot be read: " + std::string(quote) +
             " is no quotation mark here; write \" or ' instead";
    }
  }
  return {};
}

SessionOutline::SessionOutline(std::string_view text, const pb::Descriptor& root)
    : scopes_{{.path = "", .type = &root}} {
  read(text);
}

SessionOutline::SessionOutline(std::string_view text, const pb::FieldDescriptor& field)
    : value_of_(&field), scopes_(1) {
  read(text);
}

void SessionOutline::read(std::string_view text) {
  NoErrors errors;
  pb::io::ArrayInputStream input(text.data(), static_cast<int>(text.size()));
  Tokenizer tokens(&input, &errors);
  tokens.set_comment_style(Tokenizer::SH_COMMENT_STYLE);
  tokens.set_allow_f_after_float(true);
  int depth = 0;
  bool is_more = true;
  while (is_more) {
    is_more = tokens.Next();  // the last token is the end of the text
    const Tokenizer::Token& token = tokens.current();
    const TokenPosition position{.line = token.line, .column = token.column};
    const bool is_symbol = token.type == Tokenizer::TYPE_SYMBOL;
    const bool is_open = is_symbol && (token.text == "{" || token.text == "<" || token.text == "[");
    const bool is_close =
        is_symbol && (token.text == "}" || token.text == ">" || token.text == "]");
    if (is_open) {
      if (++depth > kMaxDepth) {
        too_deep_ = position;
        return;
      }
      scopes_.push_back(opened(token.text == "["));
      scopes_.back().opening = tokens_.size();
    }
    if (is_close && depth == 0 && !surplus_brace_) surplus_brace_ = position;
    tokens_.push_back({position, token.type, token.text, scope_});
    if (is_open) scope_ = scopes_.size() - 1;
    if (is_close && depth > 0) {
      --depth;
      scope_ = scopes_[scope_].parent;
    }
  }
}

/// The scope that a brace or bracket begins after the tokens so far.
SessionOutline::Scope SessionOutline::opened(bool is_list) {
  Scope& around = scopes_[scope_];
  const pb::FieldDescriptor* field = around.list != nullptr ? around.list : field_named_last();
  Scope scope{.path = around.path, .parent = scope_};
  if (is_list) {
    scope.list = field;
  } else if (field != nullptr && field->message_type() != nullptr) {
    // elements of a list are counted in the message that has the field
    Scope& owner = around.list != nullptr ? scopes_[around.parent] : around;
    const int index = field->is_repeated() ? owner.counts[field->name()]++ : -1;
    scope.path = child_path(owner.path, field->name(), index);
    scope.type = field->message_type();
  }
  return scope;
}

/// The field whose name, with or without a colon, are the last tokens; null if there is none.
const pb::FieldDescriptor* SessionOutline::field_named_last() const {
  if (tokens_.empty()) return value_of_;
  std::size_t last = tokens_.size() - 1;
  if (tokens_[last].text == ":" && last > 0) --last;
  const pb::Descriptor* type = scopes_[scope_].type;
  if (type == nullptr || tokens_[last].type != Tokenizer::TYPE_IDENTIFIER) return nullptr;
  return type->FindFieldByName(tokens_[last].text);
}

std::optional<std::size_t> SessionOutline::index_at(TokenPosition position) const {
  const auto token =
      std::lower_bound(tokens_.begin(), tokens_.end(), position,
                       [](const Token& a, const TokenPosition& b) { return a.position < b; });
  if (token == tokens_.end() || token->position != position) return std::nullopt;
  return static_cast<std::size_t>(token - tokens_.begin());
}

std::optional<SessionOutline::Name> SessionOutline::unknown_name_before(
    TokenPosition position) const {
  const auto index = index_at(position);
  if (!index || *index == 0) return std::nullopt;
  const Token& token = tokens_[*index - 1];
  const Scope& scope = scopes_[token.scope];
  if (token.type != Tokenizer::TYPE_IDENTIFIER || scope.type == nullptr) return std::nullopt;
  return Name{.text = token.text,
              .position = token.position,
              .message_path = scope.path,
              .message_type = scope.type};
}

std::optional<SessionOutline::WrongEnumerator> SessionOutline::wrong_enumerator_before(
    TokenPosition position) const {
  const auto index = index_at(position);
  if (!index || *index == 0) return std::nullopt;
  const Token& value = tokens_[*index - 1];
  const pb::FieldDescriptor* field = nullptr;
  if (*index == 1) {
    field = value_of_;
  } else if (*index >= 3 && tokens_[*index - 2].text == ":") {
    const pb::Descriptor* type = scopes_[value.scope].type;
    if (type != nullptr) field = type->FindFieldByName(tokens_[*index - 3].text);
  }
  if (field == nullptr || field->enum_type() == nullptr ||
      value.type != Tokenizer::TYPE_IDENTIFIER ||
      field->enum_type()->FindValueByName(value.text) != nullptr) {
    return std::nullopt;
  }
  return WrongEnumerator{.field = field,
                         .value = value.text,
                         .position = value.position,
                         .path = child_path(scopes_[value.scope].path, field->name(), -1)};
}

/// A name of a field: before a colon or a brace, and not a value.
bool SessionOutline::is_name(std::size_t index) const {
  return looks_like_name(index) && scopes_[tokens_[index].scope].type != nullptr;
}
/// The same, also inside what no field is known of.
bool SessionOutline::looks_like_name(std::size_t index) const {
  if (tokens_[index].type != Tokenizer::TYPE_IDENTIFIER || index + 1 == tokens_.size() ||
      (index > 0 && tokens_[index - 1].text == ":")) {
    return false;
  }
  const std::string& next = tokens_[index + 1].text;
  return next == ":" || next == "{" || next == "<";
}

/// Of the first field that belongs to a message further out; else of the message that is open at
/// the end of the text.
std::optional<SessionOutline::Mistake> SessionOutline::missing_brace() const {
  if (scope_ == 0 || value_of_ != nullptr) return std::nullopt;
  const auto opening_of = [&](std::size_t scope) {
    const std::string& path = scopes_[scope].path;
    return "the brace of " + (path.empty() ? "this message" : path) + " (line " +
           std::to_string(tokens_[scopes_[scope].opening].position.line + 1) + ") ";
  };
  for (std::size_t i = 0; i < tokens_.size(); ++i) {
    if (!is_name(i)) continue;
    const Token& token = tokens_[i];
    if (scopes_[token.scope].type->FindFieldByName(token.text) != nullptr) continue;
    for (std::size_t outer = token.scope; outer != 0;) {
      outer = scopes_[outer].parent;
      const pb::Descriptor* type = scopes_[outer].type;
      if (type == nullptr || type->FindFieldByName(token.text) == nullptr) continue;
      return Mistake{token.position, "cannot be read: " + opening_of(token.scope) +
                                         "is still open; close it before '" + token.text + "'"};
    }
  }
  return Mistake{tokens_.back().position,
                 "cannot be read: " + opening_of(scope_) + "is never closed; add the missing one"};
}

std::optional<TokenPosition> SessionOutline::lost_at() const {
  const auto missing = missing_brace();
  for (std::size_t i = 0; i < tokens_.size(); ++i) {
    if (missing && tokens_[i].position >= missing->position) break;
    if (const auto mistake = unreadable(i)) return mistake->position;
  }
  if (!missing) return std::nullopt;
  return missing->position;
}

/// What keeps the rest of the text from being read as it was meant.
std::optional<SessionOutline::Mistake> SessionOutline::unreadable(std::size_t index) const {
  auto mistake = foreign_notation(index);
  if (!mistake) mistake = bad_quotes(index);
  return mistake ? mistake : unit(index);
}

/// "1kHz", "10 ms": a number, and in the same line a word that names no field.
std::optional<SessionOutline::Mistake> SessionOutline::unit(std::size_t index) const {
  const Token& number = tokens_[index];
  if (number.type != Tokenizer::TYPE_INTEGER && number.type != Tokenizer::TYPE_FLOAT) return {};
  if (index + 1 == tokens_.size()) return {};
  const Token& word = tokens_[index + 1];
  if (word.type != Tokenizer::TYPE_IDENTIFIER || looks_like_name(index + 1) ||
      word.position.line != number.position.line) {
    return {};
  }
  return Mistake{number.position,
                 "cannot be read: " + number.text + " " + word.text +
                     ": units are not written; give the number alone, in the unit that the name of "
                     "the field ends with"};
}

/// Comments and quotation marks of other formats, and JSON.
std::optional<SessionOutline::Mistake> SessionOutline::foreign_notation(std::size_t index) const {
  const Token& token = tokens_[index];
  const std::string next = index + 1 < tokens_.size() ? tokens_[index + 1].text : "";
  if (token.text == "/" && (next == "/" || next == "*")) {
    return Mistake{token.position,
                   "cannot be read: /" + next + " begins no comment here; comments begin with #"};
  }
  if (index == 0 && value_of_ == nullptr && token.text == "{") {
    return Mistake{
        token.position,
        "cannot be read: a session has no braces around it, unlike JSON; remove this one "
        "and the last, and write names without quotes"};
  }
  if (token.type == Tokenizer::TYPE_STRING && next == ":") {
    return Mistake{token.position, "cannot be read: " + one_line(token.text) +
                                       ": names of fields have no quotes, unlike in JSON; leave "
                                       "them out"};
  }
  if (token.type != Tokenizer::TYPE_SYMBOL) return {};
  std::string bytes = token.text;  // one byte of a character each
  for (std::size_t i = index + 1; i < std::min(index + 4, tokens_.size()); ++i) {
    bytes += tokens_[i].text;
  }
  std::string complaint = curly_quote_complaint(bytes);
  if (complaint.empty()) complaint = foreign_character_complaint(bytes);
  return complaint.empty() ? std::nullopt : std::optional(Mistake{token.position, complaint});
}

/// The field whose value this token is, one that is no message; null: none is known.
const pb::FieldDescriptor* SessionOutline::field_of_value(std::size_t index) const {
  if (index == 0) return value_of_;
  const Scope& scope = scopes_[tokens_[index].scope];
  if (scope.list != nullptr) return scope.list;
  if (index < 2 || tokens_[index - 1].text != ":" || scope.type == nullptr) return nullptr;
  return scope.type->FindFieldByName(tokens_[index - 2].text);
}

/// "accept: 1": a name is to be given, so that a reader sees what it means.
std::optional<SessionOutline::Mistake> SessionOutline::numbered_name(std::size_t index) const {
  const Token& token = tokens_[index];
  if (token.type != Tokenizer::TYPE_INTEGER) return {};
  const bool is_negative = index > 0 && tokens_[index - 1].text == "-";
  const pb::FieldDescriptor* field = field_of_value(is_negative ? index - 1 : index);
  if (field == nullptr || field->enum_type() == nullptr) return {};
  const std::string text = (is_negative ? "-" : "") + token.text;
  return Mistake{token.position, child_path(scopes_[token.scope].path, field->name(), -1) + " = " +
                                     text + ": must be " + choices_text(*field->enum_type())};
}

/// A text that does not end, or that stands where a number or a name belongs.
std::optional<SessionOutline::Mistake> SessionOutline::bad_quotes(std::size_t index) const {
  const Token& token = tokens_[index];
  if (token.type != Tokenizer::TYPE_STRING) return {};
  const std::string& text = token.text;
  if (text.size() == 1 || text.back() != text.front()) {
    return Mistake{token.position, "cannot be read: " + one_line(text) +
                                       ": the text does not end; " + "end it with " + text.front()};
  }
  const pb::FieldDescriptor* field = field_of_value(index);
  if (field == nullptr || field->cpp_type() == pb::FieldDescriptor::CPPTYPE_STRING ||
      field->message_type() != nullptr) {
    return {};
  }
  return Mistake{token.position, "cannot be read: " + one_line(text) +
                                     ": numbers and names have no quotes; write " +
                                     one_line(text.substr(1, text.size() - 2))};
}

/// "0,003": to the parser two values.
std::optional<SessionOutline::Mistake> SessionOutline::decimal_comma(std::size_t index) const {
  const auto is_number = [](const Token& token) {
    return token.type == Tokenizer::TYPE_INTEGER || token.type == Tokenizer::TYPE_FLOAT;
  };
  if (index + 2 >= tokens_.size()) return std::nullopt;
  const Token& whole = tokens_[index];
  const Token& comma = tokens_[index + 1];
  const Token& part = tokens_[index + 2];
  const auto ends_at = [](const Token& token, const Token& next) {
    return token.position.line == next.position.line &&
           token.position.column + static_cast<int>(token.text.size()) == next.position.column;
  };
  const bool is_in_list = scopes_[whole.scope].list != nullptr;
  if (is_in_list || !is_number(whole) || comma.text != "," || !is_number(part) ||
      !ends_at(whole, comma) || !ends_at(comma, part)) {
    return std::nullopt;
  }
  return Mistake{whole.position, "cannot be read: " + whole.text + "," + part.text +
                                     ": decimals have a point; write " + whole.text + "." +
                                     part.text};
}

std::vector<SessionOutline::Mistake> SessionOutline::mistakes() const {
  std::vector<Mistake> mistakes;
  const auto missing = missing_brace();
  std::map<std::pair<std::size_t, const void*>, std::size_t> seen;  // token, by field or oneof
  for (std::size_t i = 0; i < tokens_.size(); ++i) {
    const Token& token = tokens_[i];
    if (missing && token.position >= missing->position) break;
    if (auto comma = decimal_comma(i)) mistakes.push_back(std::move(*comma));
    if (auto number = numbered_name(i)) mistakes.push_back(std::move(*number));
    if (auto mistake = unreadable(i)) {
      mistakes.push_back(std::move(*mistake));
      return mistakes;
    }
    if (!is_name(i)) continue;
    const Scope& scope = scopes_[token.scope];
    const pb::FieldDescriptor* field = scope.type->FindFieldByName(token.text);
    if (field == nullptr || field->is_repeated()) continue;
    const std::string path = child_path(scope.path, token.text, -1);
    const auto line_of = [&](std::size_t first) {
      return "in line " + std::to_string(tokens_[first].position.line + 1);
    };
    const auto [same, is_first] = seen.try_emplace({token.scope, field}, i);
    if (!is_first) {
      mistakes.push_back({token.position, path + ": is given twice, first " +
                                              line_of(same->second) + "; leave one out"});
      continue;
    }
    const pb::OneofDescriptor* oneof = field->real_containing_oneof();
    if (oneof == nullptr) continue;
    const auto [other, is_only] = seen.try_emplace({token.scope, oneof}, i);
    if (is_only) continue;
    mistakes.push_back({token.position, path + ": excludes " + tokens_[other->second].text + " " +
                                            line_of(other->second) + "; leave one out"});
  }
  if (missing) mistakes.push_back(*missing);
  if (surplus_brace_ && !missing) {
    mistakes.push_back({*surplus_brace_,
                        "cannot be read: a brace too many: nothing is open here; remove it, or one "
                        "before it"});
  }
  return mistakes;
}

}  // namespace palpate
