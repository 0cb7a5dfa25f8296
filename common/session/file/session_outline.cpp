#include "common/session/file/session_outline.h"

#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <algorithm>
#include <utility>

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

}  // namespace

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
    }
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
  return WrongEnumerator{.field = field, .value = value.text};
}

}  // namespace palpate
