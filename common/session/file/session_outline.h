// SPDX-License-Identifier: Apache-2.0
// session_outline.h — the tokens of a text in protobuf text format, each with the message around
// it. Gives messages of protobuf's parser, which have a line and a column, the field that they are
// about.
#pragma once

#include <google/protobuf/descriptor.h>
#include <google/protobuf/io/tokenizer.h>

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace palpate {

/// Line and column as the tokenizer of protobuf counts: from 0, a tab ends at a multiple of 8.
struct TokenPosition {
  int line = 0;
  int column = 0;
  friend auto operator<=>(const TokenPosition&, const TokenPosition&) = default;
};

/// What is wrong with a text that begins with “, „, ‘, ’ or «, as word processors write quotation
/// marks; empty: it does not.
[[nodiscard]] std::string curly_quote_complaint(std::string_view text);

class SessionOutline {
 public:
  /// A field name as it stands in the text.
  struct Name {
    std::string text;
    TokenPosition position;
    std::string message_path;                                    ///< "scene.tissue[0]"
    const google::protobuf::Descriptor* message_type = nullptr;  ///< of the message around it
  };

  /// The fields of a message of type `root`.
  SessionOutline(std::string_view text, const google::protobuf::Descriptor& root);
  /// The value of one field: a scalar or "{ … }".
  SessionOutline(std::string_view text, const google::protobuf::FieldDescriptor& field);

  /// The first brace or bracket beyond the depth that the parser can be given.
  [[nodiscard]] const std::optional<TokenPosition>& too_deep() const { return too_deep_; }
  static constexpr int kMaxDepth = 32;  ///< of braces and brackets; the schema needs 6

  /// The unknown field name that ends before `position`, where the parser warns about it.
  [[nodiscard]] std::optional<Name> unknown_name_before(TokenPosition position) const;

  /// An enumerator that does not exist.
  struct WrongEnumerator {
    const google::protobuf::FieldDescriptor* field = nullptr;
    std::string value;
    TokenPosition position;
    std::string path;  ///< of the field: "mofc.mode"
  };
  /// The one that ends before `position`, where the parser reports it.
  [[nodiscard]] std::optional<WrongEnumerator> wrong_enumerator_before(
      TokenPosition position) const;

  /// A mistake that the parser describes badly, or where it goes unnoticed.
  struct Mistake {
    TokenPosition position;
    std::string text;  ///< with what to do
  };
  /// Fields given twice, two members of a oneof, numbers with a decimal comma or a unit or where a
  /// name belongs, notation
  /// of other formats (// comments, JSON, “quotes”), texts in quotes that are numbers or not
  /// closed, braces that are missing or too many; in order.
  [[nodiscard]] std::vector<Mistake> mistakes() const;
  /// Where a brace is missing, or what follows is not as it was meant: from there on names are
  /// taken for others.
  [[nodiscard]] std::optional<TokenPosition> lost_at() const;

 private:
  struct Token {
    TokenPosition position;
    google::protobuf::io::Tokenizer::TokenType type;
    std::string text;
    std::size_t scope;
  };
  /// A pair of braces or brackets.
  struct Scope {
    std::string path;
    const google::protobuf::Descriptor* type = nullptr;       // null in a list, or if unknown
    const google::protobuf::FieldDescriptor* list = nullptr;  // whose elements it holds
    std::size_t parent = 0;
    std::size_t opening = 0;              // token
    std::map<std::string, int> counts{};  // elements of repeated fields so far
  };

  void read(std::string_view text);
  [[nodiscard]] Scope opened(bool is_list);
  [[nodiscard]] const google::protobuf::FieldDescriptor* field_named_last() const;
  [[nodiscard]] std::optional<std::size_t> index_at(TokenPosition position) const;
  [[nodiscard]] bool is_name(std::size_t index) const;
  [[nodiscard]] bool looks_like_name(std::size_t index) const;
  [[nodiscard]] std::optional<Mistake> missing_brace() const;
  [[nodiscard]] const google::protobuf::FieldDescriptor* field_of_value(std::size_t index) const;
  [[nodiscard]] std::optional<Mistake> numbered_name(std::size_t index) const;
  [[nodiscard]] std::optional<Mistake> decimal_comma(std::size_t index) const;
  [[nodiscard]] std::optional<Mistake> unit(std::size_t index) const;
  [[nodiscard]] std::optional<Mistake> foreign_notation(std::size_t index) const;
  [[nodiscard]] std::optional<Mistake> bad_quotes(std::size_t index) const;
  [[nodiscard]] std::optional<Mistake> unreadable(std::size_t index) const;

  const google::protobuf::FieldDescriptor* value_of_ = nullptr;
  std::vector<Scope> scopes_;
  std::size_t scope_ = 0;  // of the next token
  std::vector<Token> tokens_;
  std::optional<TokenPosition> too_deep_;
  std::optional<TokenPosition> surplus_brace_;
};

}  // namespace palpate
