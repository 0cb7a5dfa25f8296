// SPDX-License-Identifier: Apache-2.0
#include "common/session/file/session_text.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/io/tokenizer.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>
#include <google/protobuf/stubs/logging.h>

#include <algorithm>
#include <charconv>
#include <memory>

#include "common/core/user/nearest.h"
#include "common/session/file/session_outline.h"
#include "common/session/file/session_rules.h"

namespace palpate {

namespace {

namespace pb = google::protobuf;

constexpr int kTokenizerTabWidth = 8;

// The parser skips unknown fields by recursion: endless braces would overflow its stack.
static_assert(SessionOutline::kMaxDepth == 32);
constexpr const char* kTooDeep = "cannot be read: braces nested more than 32 deep; close some";

/// Collects the messages of protobuf's parser. Its texts are shown, never interpreted: the fields
/// that they are about follow from their positions (SessionOutline).
class ParserMessages : public pb::io::ErrorCollector {
 public:
  struct Message {
    TokenPosition position;
    std::string text;
  };
  void AddError(int line, pb::io::ColumnNumber column, const std::string& text) override {
    if (errors.size() < kMaxKept) errors.push_back({{line, column}, text});
  }
  void AddWarning(int line, pb::io::ColumnNumber column, const std::string& text) override {
    if (warnings.size() < kMaxKept) warnings.push_back({{line, column}, text});
  }

  std::vector<Message> errors;    // of syntax and type; the first ends the reading
  std::vector<Message> warnings;  // unknown fields, which are skipped

 private:
  static constexpr std::size_t kMaxKept = 101;  // one more than Problems keeps
};

pb::TextFormat::Parser make_parser(ParserMessages& messages) {
  pb::TextFormat::Parser parser;
  parser.RecordErrorsTo(&messages);
  parser.AllowUnknownField(true);
  return parser;
}

/// The field that the user may have meant, of the message or of one inside it; else all fields.
/// @param path  of the message, written before the field; "" for a name that stands inside it
std::string suggestion(const pb::Descriptor& message, std::string_view name,
                       const std::string& path = {}) {
  const std::string before = path.empty() ? "" : path + ".";
  std::string all;
  std::string inside;
  std::vector<std::string> fields;
  for (int i = 0; i < message.field_count(); ++i) {
    const pb::FieldDescriptor& field = *message.field(i);
    fields.push_back(field.name());
    all += (all.empty() ? "" : ", ") + fields.back();
    const bool is_one_message = field.message_type() != nullptr && !field.is_repeated();
    if (is_one_message && field.message_type()->FindFieldByName(std::string(name)) != nullptr) {
      inside +=
          (inside.empty() ? "'" : " or '") + before + field.name() + "." + std::string(name) + "'";
    }
  }
  if (!inside.empty()) return "did you mean " + inside + "?";
  const std::string meant = nearest(name, fields);
  if (all.empty()) return "it has none";
  return meant.empty() ? "it has " + all : "did you mean '" + before + meant + "'?";
}

/// "none or mofc", and the one that the user may have meant.
std::string names_of(const pb::EnumDescriptor& type, const std::string& written) {
  std::vector<std::string> names;
  for (int i = 1; i < type.value_count(); ++i) names.push_back(type.value(i)->name());
  const std::string meant = nearest(written, names);
  return choices_text(type) + (meant.empty() ? "" : "; did you mean '" + meant + "'?");
}

/// What the parser says, without its full stop; it quotes the end of the text as nothing.
std::string parser_words(std::string text) {
  if (text.ends_with('.')) text.pop_back();
  if (text.ends_with("got: -")) return "a whole number without a sign is required, got: -";
  return text.ends_with("got: ") ? text + "nothing" : text;
}

/// An error of the parser, which ends the reading, with what can be done about it.
std::string error_text(const ParserMessages::Message& error, const SessionOutline& outline,
                       const char* remedy) {
  if (const auto wrong = outline.wrong_enumerator_before(error.position)) {
    return one_line(wrong->path) + " = " + one_line(wrong->value) + ": must be " +
           names_of(*wrong->field->enum_type(), wrong->value);
  }
  return "cannot be read: " + one_line(parser_words(error.text)) + "; " + remedy;
}

/// "scene.tissue[2].name" → "scene.tissue[2]" → "scene.tissue" → "scene" → "".
std::string around(const std::string& path) {
  const std::size_t end = path.find_last_of(".[");
  return end == std::string::npos ? "" : path.substr(0, end);
}

}  // namespace

std::string child_path(const std::string& path, const std::string& name, int index) {
  std::string child = path.empty() ? name : path + "." + name;
  if (index >= 0) child += "[" + std::to_string(index) + "]";
  return child;
}

// --- reading ----------------------------------------------------------------------------------

bool SessionText::read(std::string_view text) {
  const pb::LogSilencer silence;
  text_ = text;
  note_lines();
  const SessionOutline outline(text, *v1::Session::descriptor());
  if (outline.too_deep()) {
    problems_.add(place_of(offset_of(*outline.too_deep())), kTooDeep);
    return false;
  }

  ParserMessages messages;
  pb::TextFormat::ParseInfoTree tree;
  pb::TextFormat::Parser parser = make_parser(messages);
  parser.WriteLocationsTo(&tree);
  pb::io::ArrayInputStream input(text.data(), static_cast<int>(text.size()));
  const bool is_read = parser.Parse(&input, &message_) && messages.errors.empty();

  record(message_, tree, "");
  const std::vector<SessionOutline::Mistake> mistakes = outline.mistakes();
  const std::optional<TokenPosition> lost_at = outline.lost_at();
  for (const auto& [position, warning] : messages.warnings) {
    if (lost_at && position > *lost_at) continue;  // of a name that stands in the wrong message
    const auto name = outline.unknown_name_before(position);
    if (name) {
      problems_.add(place_of(offset_of(name->position)),
                    one_line(child_path(name->message_path, name->text, -1)) + ": no such field; " +
                        suggestion(*name->message_type, name->text));
    } else if (mistakes.empty() || position < mistakes.front().position) {
      problems_.add(place_of(offset_of(position)), one_line(warning));
    }
  }
  for (const SessionOutline::Mistake& mistake : mistakes) {
    problems_.add(place_of(offset_of(mistake.position)), one_line(mistake.text));
  }
  for (const auto& error : messages.errors) {
    const auto wrong = outline.wrong_enumerator_before(error.position);
    if (!wrong && !mistakes.empty() && error.position >= mistakes.front().position) continue;
    problems_.add(place_of(offset_of(wrong ? wrong->position : error.position)),
                  error_text(error, outline, "write 'name: value' or 'name { … }'"));
  }
  return is_read && mistakes.empty();
}

/// Finds the beginnings of lines and the ends of tabs, from which places are computed.
void SessionText::note_lines() {
  line_begins_.assign(1, 0);
  anchors_.assign(1, {});
  Anchor at;
  for (std::size_t i = 0; i < text_.size(); ++i) {
    if (text_[i] == '\n') {
      at = {.position = {.line = at.position.line + 1, .column = 0}, .offset = i + 1};
      line_begins_.push_back(i + 1);
      anchors_.push_back(at);
    } else if (text_[i] == '\t') {
      const int column = at.position.column + static_cast<int>(i - at.offset);
      at.position.column = column + kTokenizerTabWidth - column % kTokenizerTabWidth;
      at.offset = i + 1;
      anchors_.push_back(at);
    }
  }
}

/// Byte of the text at the tokenizer's line and column.
std::size_t SessionText::offset_of(TokenPosition position) const {
  const auto after =
      std::upper_bound(anchors_.begin(), anchors_.end(), position,
                       [](const TokenPosition& a, const Anchor& b) { return a < b.position; });
  if (after == anchors_.begin()) return 0;
  const Anchor& anchor = *(after - 1);
  const std::size_t offset =
      anchor.offset + static_cast<std::size_t>(position.column - anchor.position.column);
  return std::min(offset, text_.size());
}

Place SessionText::place_of(std::size_t offset) const {
  const auto after = std::upper_bound(line_begins_.begin(), line_begins_.end(), offset);
  const auto line = after - line_begins_.begin();
  return {.line = static_cast<int>(line), .column = static_cast<int>(offset - *(after - 1)) + 1};
}

void SessionText::record(const pb::Message& message, const pb::TextFormat::ParseInfoTree& tree,
                         const std::string& path) {
  const pb::Descriptor& type = *message.GetDescriptor();
  const pb::Reflection& reflection = *message.GetReflection();
  for (int i = 0; i < type.field_count(); ++i) {
    const pb::FieldDescriptor* field = type.field(i);
    const int count = field->is_repeated() ? reflection.FieldSize(message, field) : 1;
    for (int n = 0; n < count; ++n) {
      const int index = field->is_repeated() ? n : -1;
      const std::string child = child_path(path, field->name(), index);
      const auto range = tree.GetLocationRange(field, index);
      if (range.start.line >= 0) {
        places_[child] = place_of(offset_of({range.start.line, range.start.column}));
      }
      const auto* nested = tree.GetTreeForNested(field, index);
      if (nested == nullptr) continue;
      record(field->is_repeated() ? reflection.GetRepeatedMessage(message, field, n)
                                  : reflection.GetMessage(message, field),
             *nested, child);
    }
  }
}

Place SessionText::place(std::string path) const {
  for (path = written_path(path); !path.empty(); path = around(path)) {
    const auto found = places_.find(path);
    if (found != places_.end()) return found->second;
  }
  return {};
}

// --- sides ------------------------------------------------------------------------------------

SessionText SessionText::for_side(int index) const {
  SessionText text = *this;
  text.side_ = child_path("", "side", index) + ".";
  v1::Session& session = text.message_;
  const v1::Side side = session.side(index);
  if (side.hand().press_size() > 0) session.mutable_hand()->clear_press();
  if (side.has_device()) session.mutable_device()->MergeFrom(side.device());
  if (side.has_hand()) session.mutable_hand()->MergeFrom(side.hand());
  if (side.has_mofc()) session.mutable_mofc()->MergeFrom(side.mofc());
  if (side.has_links()) session.mutable_links()->MergeFrom(side.links());
  if (side.has_realtime()) session.mutable_realtime()->MergeFrom(side.realtime());
  session.clear_side();
  return text;
}

std::string SessionText::written_path(const std::string& path) const {
  if (side_.empty()) return path;
  for (std::string part = path; !part.empty(); part = around(part)) {
    if (places_.contains(side_ + part)) return side_ + path;
    if (places_.contains(part)) return path;
  }
  return path;
}

// --- overrides --------------------------------------------------------------------------------

void SessionText::apply_override(int number, const std::string& assignment) {
  const pb::LogSilencer silence;
  const Place place{.override_number = number};
  const std::size_t equals = assignment.find('=');
  const std::string complaint =
      equals == std::string::npos || equals == 0
          ? "must be path=value, e.g. mofc.controller=none"
          : assign(assignment.substr(0, equals), assignment.substr(equals + 1), place);
  if (!complaint.empty()) problems_.add(place, complaint);
}

namespace {

/// Reads the text of one value into `field` of `message`. Returns what is wrong; empty if nothing.
std::string read_value(const pb::FieldDescriptor& field, const std::string& value,
                       pb::Message& message) {
  const SessionOutline outline(value, field);
  if (outline.too_deep()) return kTooDeep;
  ParserMessages messages;
  const bool is_read = make_parser(messages).ParseFieldValueFromString(value, &field, &message);
  if (const auto mistakes = outline.mistakes(); !mistakes.empty()) return mistakes.front().text;
  if (!messages.errors.empty()) {
    return error_text(messages.errors.front(), outline,
                      "write path=value, or path={ … } for a message");
  }
  if (!is_read) return "cannot be read: something follows the value";
  if (messages.warnings.empty()) return {};
  const ParserMessages::Message& warning = messages.warnings.front();
  const auto name = outline.unknown_name_before(warning.position);
  if (!name) return one_line(warning.text);
  return "no field '" + one_line(name->text) + "' in " + name->message_type->name() + "; " +
         suggestion(*name->message_type, name->text);
}

/// Of "[a, \"b, c\"]", without the blanks around; of anything else, that.
std::vector<std::string> elements_of(const std::string& value) {
  if (!value.starts_with('[') || !value.ends_with(']')) return {value};
  std::vector<std::string> elements(1);
  char quote = '\0';
  for (std::size_t i = 1; i + 1 < value.size(); ++i) {
    const char c = value[i];
    if (quote != '\0' && c == '\\' && i + 2 < value.size()) {
      elements.back() += c;
      elements.back() += value[++i];
      continue;
    }
    if (quote == '\0' && c == ',') {
      elements.emplace_back();
      continue;
    }
    if (c == quote) {
      quote = '\0';
    } else if (quote == '\0' && (c == '"' || c == '\'')) {
      quote = c;
    }
    elements.back() += c;
  }
  for (std::string& element : elements) {
    element.erase(0, std::min(element.find_first_not_of(' '), element.size()));
    element.erase(element.find_last_not_of(' ') + 1);
  }
  if (elements.size() == 1 && elements.front().empty()) elements.clear();
  return elements;
}

std::string one_of_several(const std::string& path) {
  return path + ": say which one: " + path + "[0], …";
}

/// Reads a list, or its one element, into `field` of `message`. Texts need no quotes. Returns what
/// is wrong; empty if nothing.
std::string read_list(const pb::FieldDescriptor& field, const std::string& value,
                      pb::Message& message) {
  for (const std::string& element : elements_of(value)) {
    if (std::string complaint = curly_quote_complaint(element); !complaint.empty()) {
      return complaint;
    }
    if (field.cpp_type() == pb::FieldDescriptor::CPPTYPE_STRING && !element.starts_with('"') &&
        !element.starts_with('\'')) {
      message.GetReflection()->AddString(&message, &field, element);
      continue;
    }
    if (std::string complaint = read_value(field, element, message); !complaint.empty()) {
      return complaint;
    }
  }
  return {};
}

}  // namespace

/// Returns what is wrong; empty if nothing.
std::string SessionText::assign(const std::string& path, const std::string& value,
                                const Place& place) {
  v1::Session changed = message_;  // a complaint leaves the session as it was
  std::vector<std::string> replaced;
  std::vector<std::string> made;

  // walk down to the message that holds the field
  pb::Message* message = &changed;
  const pb::FieldDescriptor* field = nullptr;
  int index = -1;
  std::string parent;
  std::string walked;
  for (std::size_t begin = 0; begin <= path.size();) {
    const std::size_t end = std::min(path.find('.', begin), path.size());
    std::string name = path.substr(begin, end - begin);
    begin = end + 1;
    const bool is_last = end == path.size();

    // name or name[index]
    index = -1;
    if (const std::size_t bracket = name.find('['); bracket != std::string::npos) {
      const char* const last = name.data() + name.size();
      const auto [stop, error] = std::from_chars(name.data() + bracket + 1, last, index);
      if (error != std::errc() || index < 0 || stop + 1 != last || *stop != ']') {
        return one_line(name) + ": an index is written [0], [1], …";
      }
      name.resize(bracket);
    }
    const pb::Descriptor& type = *message->GetDescriptor();
    field = type.FindFieldByName(name);
    if (field == nullptr) {
      return one_line(child_path(walked, name, -1)) + ": no such field; " +
             suggestion(type, name, walked);
    }
    parent = walked;
    walked = child_path(parent, name, index);
    const pb::Reflection& reflection = *message->GetReflection();
    if (index >= 0 && !field->is_repeated()) {
      return walked + ": there is only one; leave the index out";
    }
    const int size = field->is_repeated() ? reflection.FieldSize(*message, field) : 0;
    if (index >= size) {
      return walked + ": there are only " + std::to_string(size) + ", counted from [0]; " +
             child_path(parent, name, -1) + "={ … } adds one";
    }

    // replaces another member of the same oneof
    if (const pb::OneofDescriptor* oneof = field->real_containing_oneof()) {
      const pb::FieldDescriptor* given = reflection.GetOneofFieldDescriptor(*message, oneof);
      if (given != nullptr && given != field) {
        replaced.push_back(child_path(parent, given->name(), -1));
      }
    }
    if (is_last) break;

    if (field->cpp_type() != pb::FieldDescriptor::CPPTYPE_MESSAGE) {
      return walked + ": is a single value and has no fields";
    }
    if (field->is_repeated() && index < 0) {
      return one_of_several(walked);
    }
    if (index >= 0) {
      message = reflection.MutableRepeatedMessage(message, field, index);
    } else {
      if (!reflection.HasField(*message, field)) made.push_back(walked);
      message = reflection.MutableMessage(message, field);
    }
  }

  // read the value into an empty message of the same type, then put it in its place
  const std::unique_ptr<pb::Message> scratch(message->New());
  const bool is_list =
      field->is_repeated() && field->cpp_type() != pb::FieldDescriptor::CPPTYPE_MESSAGE;
  if (is_list) {
    if (index >= 0)
      return walked + ": give the whole list, " + child_path(parent, field->name(), -1) + "=[…]";
    const std::string complaint = read_list(*field, value, *scratch);
    if (!complaint.empty()) return walked + ": " + complaint;
  } else if (const std::string curly = curly_quote_complaint(value); !curly.empty()) {
    return walked + ": " + curly;
  } else if (field->cpp_type() == pb::FieldDescriptor::CPPTYPE_STRING && !value.starts_with('"') &&
             !value.starts_with('\'')) {
    scratch->GetReflection()->SetString(scratch.get(), field, value);
  } else {
    const std::string complaint = read_value(*field, value, *scratch);
    if (!complaint.empty()) return walked + ": " + complaint;
  }
  const pb::Reflection& reflection = *message->GetReflection();
  if (index >= 0) {
    reflection.MutableRepeatedMessage(message, field, index)
        ->CopyFrom(scratch->GetReflection()->GetRepeatedMessage(*scratch, field, 0));
  } else {
    if (field->is_repeated() && !is_list) {
      walked = child_path(parent, field->name(), reflection.FieldSize(*message, field));
    } else {
      reflection.ClearField(message, field);
    }
    message->MergeFrom(*scratch);
  }

  message_ = std::move(changed);
  replaced.push_back(walked);
  for (const std::string& old : replaced) forget(old);
  for (const std::string& created : made) places_[created] = place;
  places_[walked] = place;
  return {};
}

/// Drops the places of the field and of everything in it.
void SessionText::forget(const std::string& path) {
  std::erase_if(places_, [&](const auto& entry) {
    const std::string& key = entry.first;
    return key.starts_with(path) &&
           (key.size() == path.size() || key[path.size()] == '.' || key[path.size()] == '[');
  });
}

// --- numbers ----------------------------------------------------------------------------------

void SessionText::check_numbers(const pb::Message& message, const std::string& path) {
  const pb::Reflection& reflection = *message.GetReflection();
  std::vector<const pb::FieldDescriptor*> given;
  reflection.ListFields(message, &given);
  for (const pb::FieldDescriptor* field : given) {
    const std::string child = child_path(path, field->name(), -1);
    if (field->cpp_type() == pb::FieldDescriptor::CPPTYPE_MESSAGE) {
      if (!field->is_repeated()) {
        check_numbers(reflection.GetMessage(message, field), child);
        continue;
      }
      for (int i = 0; i < reflection.FieldSize(message, field); ++i) {
        check_numbers(reflection.GetRepeatedMessage(message, field, i),
                      child_path(path, field->name(), i));
      }
    } else if (field->cpp_type() == pb::FieldDescriptor::CPPTYPE_DOUBLE) {
      const double value = reflection.GetDouble(message, field);
      const std::string complaint = number_complaint(*field, value);
      if (complaint.empty()) continue;
      std::string shown;
      pb::TextFormat::PrintFieldValueToString(message, field, -1, &shown);
      std::string text = child;
      text.append(" = ").append(shown).append(": ").append(complaint);
      problems_.add(place(child), text);
    }
  }
}

}  // namespace palpate
