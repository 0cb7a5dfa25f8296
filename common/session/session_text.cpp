#include "common/session/session_text.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/io/tokenizer.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>
#include <google/protobuf/stubs/logging.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <memory>
#include <numeric>

namespace palpate {

namespace {

namespace pb = google::protobuf;

constexpr int kMaxDepth = 32;  // of braces and brackets; the schema needs 6
constexpr double kMaxNumber = 1e9;
constexpr double kMaxSeconds = 1e6;
constexpr int kTokenizerTabWidth = 8;
constexpr std::size_t kMaxNameBytes = 64;  // longer names are not compared

/// What the parser of protobuf has to say; lines and columns from 0, tabs counted as up to 8.
class Complaints : public pb::io::ErrorCollector {
 public:
  struct Complaint {
    int line = 0;
    int column = 0;
    std::string text;
  };
  void AddError(int line, pb::io::ColumnNumber column, const std::string& text) override {
    if (errors.size() < kMaxKept) errors.push_back({line, column, text});
  }
  void AddWarning(int line, pb::io::ColumnNumber column, const std::string& text) override {
    if (warnings.size() < kMaxKept) warnings.push_back({line, column, text});
  }

  std::vector<Complaint> errors;    // of syntax and type; the first ends the reading
  std::vector<Complaint> warnings;  // unknown fields, skipped

 private:
  static constexpr std::size_t kMaxKept = 101;  // one more than Problems keeps
};

pb::TextFormat::Parser make_parser(Complaints& complaints) {
  pb::TextFormat::Parser parser;
  parser.RecordErrorsTo(&complaints);
  parser.AllowUnknownField(true);
  return parser;
}

/// Fewest insertions, deletions and replacements from one word to the other.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, diagonal + 1});
    }
  }
  return row.back();
}

/// The field the user may have meant, or all there are.
std::string suggestion(const pb::Descriptor& message, std::string_view name) {
  std::string all;
  std::string best;
  std::size_t best_distance = std::max<std::size_t>(2, name.size() / 3) + 1;
  for (int i = 0; i < message.field_count(); ++i) {
    const std::string& field = message.field(i)->name();
    all += (all.empty() ? "" : ", ") + field;
    if (name.empty() || name.size() > kMaxNameBytes) continue;
    // a forgotten unit is the commonest slip: "mass" for "mass_kg"
    const bool is_beginning = field.starts_with(name) || name.starts_with(field);
    const std::size_t distance = is_beginning ? 0 : edit_distance(name, field);
    if (distance < best_distance) {
      best_distance = distance;
      best = field;
    }
  }
  return best.empty() ? "it has " + all : "did you mean '" + best + "'?";
}

std::string names_of(const pb::EnumDescriptor& type) {
  std::string names;
  for (int i = 0; i < type.value_count(); ++i) {
    names += (names.empty() ? "" : ", ") + type.value(i)->name();
  }
  return names;
}

/// `text` cut at the quotation marks.
std::vector<std::string> split_at_quotes(const std::string& text) {
  std::vector<std::string> parts(1);
  for (const char c : text) {
    if (c == '"') {
      parts.emplace_back();
    } else {
      parts.back() += c;
    }
  }
  return parts;
}

/// A complaint of the parser that ends the reading, with what can be done about it.
std::string with_remedy(const std::string& complaint, const char* remedy) {
  // 'Unknown enumeration value of "fast" for field "mode".'
  const std::vector<std::string> parts = split_at_quotes(complaint);
  const bool is_enum = parts.size() == 5 && parts[0] == "Unknown enumeration value of ";
  const pb::FileDescriptor& schema = *v1::Session::descriptor()->file();
  for (int i = 0; is_enum && i < schema.message_type_count(); ++i) {
    const pb::FieldDescriptor* field = schema.message_type(i)->FindFieldByName(parts[3]);
    if (field == nullptr || field->enum_type() == nullptr) continue;
    return field->name() + " = " + one_line(parts[1]) + ": must be one of " +
           names_of(*field->enum_type());
  }
  return "cannot be read: " + one_line(complaint) + "; " + remedy;
}

/// The message type and the field of 'Message type "Device" has no field named "mas_kg".'; a null
/// type for any other text.
std::pair<const pb::Descriptor*, std::string> unknown_field_in(const std::string& complaint) {
  const std::vector<std::string> parts = split_at_quotes(complaint);
  if (parts.size() != 5) return {nullptr, ""};
  return {v1::Session::descriptor()->file()->pool()->FindMessageTypeByName(parts[1]), parts[3]};
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

std::string number_complaint(const std::string& field_name, double value) {
  if (!std::isfinite(value)) return "must be a finite number";
  if (std::abs(value) > kMaxNumber) return "must be within ±1e9; mind the unit in the name";
  double unit_s = 0.0;
  if (field_name.ends_with("_us")) unit_s = 1e-6;
  if (field_name.ends_with("_ms")) unit_s = 1e-3;
  if (field_name.ends_with("_s") && !field_name.ends_with("_per_s")) unit_s = 1.0;
  if (std::abs(value) * unit_s > kMaxSeconds) {
    return "must be within ±1e6 s; mind the unit in the name";
  }
  return {};
}

// --- reading ----------------------------------------------------------------------------------

bool SessionText::read(std::string_view text) {
  const pb::LogSilencer silence;
  text_ = text;
  note_lines();
  if (is_too_deep(text)) return false;

  Complaints complaints;
  pb::TextFormat::ParseInfoTree tree;
  pb::TextFormat::Parser parser = make_parser(complaints);
  parser.WriteLocationsTo(&tree);
  pb::io::ArrayInputStream input(text.data(), static_cast<int>(text.size()));
  const bool is_read = parser.Parse(&input, &message_) && complaints.errors.empty();

  record(message_, tree, "");
  for (const auto& [line, column, complaint] : complaints.warnings) {
    report_unknown(line, column, complaint);
  }
  for (const auto& [line, column, complaint] : complaints.errors) {
    problems_.add(place_of(offset_of(line, column)),
                  with_remedy(complaint, "write 'name: value' or 'name { … }'"));
  }
  return is_read;
}

/// The parser skips what it does not know by recursion; endless braces would end its stack.
bool SessionText::is_too_deep(std::string_view text) {
  Complaints ignored;  // the parser will say the same
  pb::io::ArrayInputStream input(text.data(), static_cast<int>(text.size()));
  pb::io::Tokenizer tokens(&input, &ignored);
  tokens.set_comment_style(pb::io::Tokenizer::SH_COMMENT_STYLE);
  tokens.set_allow_f_after_float(true);
  int depth = 0;
  while (tokens.Next()) {
    const auto& token = tokens.current();
    if (token.type != pb::io::Tokenizer::TYPE_SYMBOL) continue;
    if (token.text == "{" || token.text == "[" || token.text == "<") ++depth;
    if (token.text == "}" || token.text == "]" || token.text == ">") --depth;
    if (depth > kMaxDepth) {
      problems_.add(place_of(offset_of(token.line, token.column)),
                    "cannot be read: braces nested more than " + std::to_string(kMaxDepth) +
                        " deep; close some");
      return true;
    }
  }
  return false;
}

/// Notes where lines begin and where tabs end, so that places are found without reading lines
/// again.
void SessionText::note_lines() {
  line_begins_.assign(1, 0);
  anchors_.assign(1, {});
  Anchor at;
  for (std::size_t i = 0; i < text_.size(); ++i) {
    if (text_[i] == '\n') {
      at = {.line = at.line + 1, .column = 0, .offset = i + 1};
      line_begins_.push_back(i + 1);
      anchors_.push_back(at);
    } else if (text_[i] == '\t') {
      const int column = at.column + static_cast<int>(i - at.offset);
      at.column = column + kTokenizerTabWidth - column % kTokenizerTabWidth;
      at.offset = i + 1;
      anchors_.push_back(at);
    }
  }
}

/// Byte of the text at the tokenizer's line and column.
std::size_t SessionText::offset_of(int line, int column) const {
  const auto after = std::upper_bound(anchors_.begin(), anchors_.end(), std::pair(line, column),
                                      [](const std::pair<int, int>& place, const Anchor& anchor) {
                                        return place < std::pair(anchor.line, anchor.column);
                                      });
  if (after == anchors_.begin()) return 0;
  const Anchor& anchor = *(after - 1);
  const std::size_t offset = anchor.offset + static_cast<std::size_t>(column - anchor.column);
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
        const std::size_t begin = offset_of(range.start.line, range.start.column);
        places_[child] = place_of(begin);
        spans_.push_back({child, begin, offset_of(range.end.line, range.end.column)});
      }
      const auto* nested = tree.GetTreeForNested(field, index);
      if (nested == nullptr) continue;
      record(field->is_repeated() ? reflection.GetRepeatedMessage(message, field, n)
                                  : reflection.GetMessage(message, field),
             *nested, child);
    }
  }
}

/// 'Message type "palpate.v1.Device" has no field named "mas_kg".', at the token after the name.
void SessionText::report_unknown(int line, int column, const std::string& complaint) {
  const std::size_t token = offset_of(line, column);
  const auto [type, name] = unknown_field_in(complaint);
  if (type == nullptr) {
    problems_.add(place_of(token), one_line(complaint));
    return;
  }
  const std::size_t found = text_.substr(0, token).rfind(name);
  const std::size_t begin = found == std::string_view::npos ? token : found;
  // the innermost message around it
  const Span* around = nullptr;
  for (const Span& span : spans_) {
    if (span.begin <= begin && begin < span.end &&
        (around == nullptr || span.begin >= around->begin)) {
      around = &span;
    }
  }
  const std::string path = child_path(around == nullptr ? "" : around->path, name, -1);
  problems_.add(place_of(begin), one_line(path) + ": no such field; " + suggestion(*type, name));
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
      equals == std::string::npos
          ? "must be path=value, e.g. mofc.controller=none"
          : assign(assignment.substr(0, equals), assignment.substr(equals + 1), place);
  if (!complaint.empty()) problems_.add(place, complaint);
}

/// Returns what is wrong, or nothing.
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
      return one_line(child_path(walked, name, -1)) + ": no such field; " + suggestion(type, name);
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

    // another member of the same oneof goes
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
      return walked + ": say which one: " + walked + "[0], …";
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
  if (field->cpp_type() == pb::FieldDescriptor::CPPTYPE_STRING && !value.starts_with('"') &&
      !value.starts_with('\'')) {
    scratch->GetReflection()->SetString(scratch.get(), field, value);
  } else {
    Complaints complaints;
    const bool is_read =
        make_parser(complaints).ParseFieldValueFromString(value, field, scratch.get());
    if (!complaints.errors.empty()) {
      return walked + ": " +
             with_remedy(complaints.errors.front().text,
                         "write path=value, or path={ … } for a message");
    }
    if (!is_read) return walked + ": cannot be read: something follows the value";
    for (const auto& warning : complaints.warnings) {
      const auto [type, name] = unknown_field_in(warning.text);
      if (type == nullptr) return walked + ": " + one_line(warning.text);
      return walked + ": no field '" + one_line(name) + "' in " + type->name() + "; " +
             suggestion(*type, name);
    }
  }
  const pb::Reflection& reflection = *message->GetReflection();
  if (index >= 0) {
    reflection.MutableRepeatedMessage(message, field, index)
        ->CopyFrom(scratch->GetReflection()->GetRepeatedMessage(*scratch, field, 0));
  } else {
    if (field->is_repeated()) {
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
      const std::string complaint = number_complaint(field->name(), value);
      if (complaint.empty()) continue;
      std::string shown;
      pb::TextFormat::PrintFieldValueToString(message, field, -1, &shown);
      problems_.add(place(child), child + " = " + shown + ": " + complaint);
    }
  }
}

}  // namespace palpate
