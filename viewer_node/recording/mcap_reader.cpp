// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/recording/mcap_reader.h"

#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <tuple>
#include <utility>

#include "common/core/check.h"

namespace palpate::viewer {

using mcap::Fields;
using mcap::kRecordHead;
using mcap::Opcode;

namespace {

constexpr std::uint64_t kMaxRecordBytes = std::uint64_t{64} << 20;
constexpr std::uint8_t kLastOpcode = 0x0F;             // of version 0
constexpr std::uint8_t kPrivateOpcodes = 0x80;         // and above
constexpr std::uint64_t kMessageHead = 2 + 4 + 8 + 8;  // channel, sequence, times
constexpr std::uint64_t kMaxRowBytes = std::uint64_t{1} << 20;

bool is_private(Opcode opcode) { return static_cast<std::uint8_t>(opcode) >= kPrivateOpcodes; }

}  // namespace

McapReader::McapReader(std::string path)
    : path_(std::move(path)), file_(std::fopen(path_.c_str(), "rb")) {
  if (file_ == nullptr) refuse(std::string(std::strerror(errno)) + "; check the path");
  struct stat status {};
  if (fstat(fileno(file_.get()), &status) != 0 || !S_ISREG(status.st_mode)) {
    refuse("is not a regular file");
  }
  file_bytes_ = static_cast<std::uint64_t>(status.st_size);

  std::string magic;
  if (!read(0, mcap::kMagic.size(), magic) || magic != mcap::kMagic) {
    refuse("not an MCAP file; give a file written by --record");
  }
  const Summary summary = read_summary();
  is_whole_ = summary == Summary::kRead || (search() && summary == Summary::kUnusable);
}

void McapReader::refuse(const std::string& why) const {
  throw SetupError("recording " + path_ + ": " + why);
}

bool McapReader::read(std::uint64_t offset, std::uint64_t length, std::string& bytes) const {
  if (offset > file_bytes_ || length > file_bytes_ - offset || length > kMaxRecordBytes) {
    return false;
  }
  bytes.resize(length);
  return fseeko(file_.get(), static_cast<off_t>(offset), SEEK_SET) == 0 &&
         std::fread(bytes.data(), 1, bytes.size(), file_.get()) == bytes.size();
}

/// kUnusable: the file was closed, but its summary does not tell what is in it.
McapReader::Summary McapReader::read_summary() {
  const std::uint64_t end_bytes = mcap::kFooterBytes + mcap::kMagic.size();
  std::string end;
  if (file_bytes_ < end_bytes || !read(file_bytes_ - end_bytes, end_bytes, end)) {
    return Summary::kDamaged;
  }
  Fields footer(end);
  const auto opcode = footer.number<std::uint8_t>();
  const auto length = footer.number<std::uint64_t>();
  const auto start = footer.number<std::uint64_t>();
  footer.number<std::uint64_t>();
  const auto crc = footer.number<std::uint32_t>();
  if (static_cast<Opcode>(opcode) != Opcode::kFooter || length != 20 ||
      footer.rest() != mcap::kMagic || start > file_bytes_ - end_bytes) {
    return Summary::kDamaged;
  }
  const std::uint64_t summary_bytes = file_bytes_ - mcap::kMagic.size() - 4 - start;
  if (start == 0 || summary_bytes > kMaxRecordBytes) return Summary::kUnusable;

  std::string summary;
  if (!read(start, summary_bytes, summary) || (crc != 0 && mcap::crc_of(summary) != crc)) {
    return Summary::kDamaged;
  }
  const bool is_good = take_all(summary);
  if (is_good && !chunks_.empty() && !topics_.empty()) return Summary::kRead;
  if (is_good) summary_topics_ = std::move(topics_);
  for (Topic& topic : summary_topics_) topic.messages = 0;
  schemas_.clear();
  topics_.clear();
  chunks_.clear();
  metadata_.clear();
  indexed_bytes_ = 0;
  return is_good ? Summary::kUnusable : Summary::kDamaged;
}

bool McapReader::take_all(std::string_view summary) {
  bool is_good = true;
  for (Fields records(summary); is_good && !records.rest().empty();) {
    const auto group = static_cast<Opcode>(records.number<std::uint8_t>());
    const auto size = records.number<std::uint64_t>();
    if (group == Opcode::kFooter) break;
    const std::string_view content = records.take(size);
    is_good = records.is_good() && take(group, content);
  }
  return is_good;
}

/// Records do not overlap, so an index cannot cover more bytes than the file has.
bool McapReader::count_indexed(std::uint64_t length) {
  if (length > file_bytes_ - indexed_bytes_) return false;
  indexed_bytes_ += length;
  return true;
}

/// Reads the records from the beginning. What is damaged is left out and counted, up to the next
/// record that can be read. True if it comes to the end of the data.
bool McapReader::search() {
  bool has_definitions = false;  // before the first chunk
  bool is_at_end = false;
  std::uint64_t offset = mcap::kMagic.size();
  while (offset < file_bytes_) {
    const std::optional<Record> record = head_at(offset);
    const bool has_form = record && has_form_of_its_kind(*record);
    is_at_end = has_form && record->opcode == Opcode::kDataEnd;
    if (is_at_end || (has_form && record->opcode == Opcode::kFooter)) break;
    if (record && record->opcode == Opcode::kChunk && chunks_.empty()) {
      has_definitions = !topics_.empty();
    }
    // messages behind a damaged place are known by the channels before it
    const bool defines =
        has_form && (record->opcode == Opcode::kSchema || record->opcode == Opcode::kChannel);
    if (has_form && (defines || is_followed(*record)) && take_record(*record, has_definitions)) {
      offset = record->end;
      continue;
    }
    // good, if the next one that can be read is not in it
    const std::uint64_t next = next_sound_record(offset + 1);
    const bool is_good = has_form && next >= record->end && take_record(*record, has_definitions);
    unreadable_bytes_ += next - (is_good ? record->end : offset);
    offset = next;
  }
  for (const Topic& topic : summary_topics_) {  // the definition in the data may be damaged
    Topic* const known = find_topic(topic.id);
    if (known == nullptr) {
      topics_.push_back(topic);
    } else if (known->schema_name.empty()) {
      *known = topic;
    }
  }
  return is_at_end;
}

/// The record that may begin with these bytes, by its known or private opcode; it may end beyond
/// the file.
std::optional<McapReader::Record> McapReader::head_of(std::string_view bytes,
                                                      std::uint64_t offset) {
  Fields head(bytes);
  const auto opcode = head.number<std::uint8_t>();
  const auto length = head.number<std::uint64_t>();
  const bool is_known = (opcode >= 0x01 && opcode <= kLastOpcode) || opcode >= kPrivateOpcodes;
  if (!is_known || !head.is_good() || length > ~std::uint64_t{0} - offset - kRecordHead) return {};
  return Record{static_cast<Opcode>(opcode), offset, offset + kRecordHead + length};
}

std::optional<McapReader::Record> McapReader::head_at(std::uint64_t offset) const {
  std::string bytes;
  return read(offset, kRecordHead, bytes) ? head_of(bytes, offset) : std::nullopt;
}

/// By another record, which may be cut by the end of the file.
bool McapReader::is_followed(const Record& record) const {
  // the sizes in the head of a chunk agree with each other
  if (record.opcode == Opcode::kChunk || file_bytes_ - record.end < kRecordHead) return true;
  const std::optional<Record> next = head_at(record.end);
  if (!next || next->end <= file_bytes_) return next.has_value();
  return !is_private(next->opcode) && next->end - next->offset <= kMaxRecordBytes + kRecordHead;
}

/// Whether it ends within the file, and the sizes in it agree with its own, for records that belong
/// before DataEnd.
bool McapReader::has_form_of_its_kind(const Record& record) const {
  if (record.end > file_bytes_) return false;
  const std::uint64_t length = record.end - record.offset - kRecordHead;
  constexpr std::uint64_t kHeadBytes = 64;
  std::string bytes;
  if (!read(record.offset + kRecordHead, std::min(length, kHeadBytes), bytes)) return false;
  Fields fields(bytes);
  switch (record.opcode) {
    case Opcode::kHeader:
      return record.offset == mcap::kMagic.size();
    case Opcode::kFooter:
      return length == 20 && record.end + mcap::kMagic.size() == file_bytes_;
    case Opcode::kMessage:
      return length >= kMessageHead && is_defined(fields.number<std::uint16_t>());
    case Opcode::kChunk: {
      fields.take(8 + 8);
      const auto size = fields.number<std::uint64_t>();
      fields.number<std::uint32_t>();  // check sum
      const bool is_compressed = !fields.text().empty();
      const auto size_here = fields.number<std::uint64_t>();
      return fields.is_good() && size_here == length - (bytes.size() - fields.rest().size()) &&
             (is_compressed || size == size_here);
    }
    case Opcode::kMessageIndex:
      fields.number<std::uint16_t>();
      return fields.number<std::uint32_t>() == length - 6 && fields.is_good();
    case Opcode::kDataEnd:
      return length == 4;
    case Opcode::kSchema:
    case Opcode::kChannel:
    case Opcode::kMetadata:
    case Opcode::kAttachment:
      return true;  // judged as a whole where it is taken
    default:
      return is_private(record.opcode);
  }
}

/// False if it is malformed.
bool McapReader::take_record(const Record& record, bool has_definitions) {
  const std::uint64_t length = record.end - record.offset;
  std::string bytes;
  switch (record.opcode) {
    case Opcode::kChunk: {
      if (!read(record.offset + kRecordHead, 2 * sizeof(std::uint64_t), bytes)) return false;
      Fields fields(bytes);
      const auto begin_ns = fields.number<std::uint64_t>();
      const auto end_ns = fields.number<std::uint64_t>();
      chunks_.push_back({begin_ns, end_ns, record.offset, length});
      if (!has_definitions) take_definitions(chunks_.back());
      return true;
    }
    case Opcode::kMessage:
      return take_bare_message(record.offset, length);
    case Opcode::kMetadata:
      return take_metadata(record.offset, length);
    case Opcode::kSchema:
    case Opcode::kChannel:
      return read(record.offset + kRecordHead, length - kRecordHead, bytes) &&
             take(record.opcode, bytes);
    case Opcode::kHeader:
    case Opcode::kMessageIndex:
    case Opcode::kAttachment:
      return true;  // not needed
    default:
      unreadable_bytes_ += length;  // private: what it is only its program knows
      return true;
  }
}

/// Where the next record begins that holds together, and is followed by another one; or the end of
/// the file.
std::uint64_t McapReader::next_sound_record(std::uint64_t from) const {
  constexpr std::uint64_t kMostBlockBytes = std::uint64_t{1} << 20;
  std::string block;
  for (std::uint64_t size = 512; from < file_bytes_ && file_bytes_ - from >= kRecordHead;
       size = std::min(2 * size, kMostBlockBytes)) {
    if (!read(from, std::min(size, file_bytes_ - from), block)) break;
    for (std::size_t i = 0; i + kRecordHead <= block.size(); ++i) {
      const std::string_view head = std::string_view(block).substr(i, kRecordHead);
      const std::optional<Record> record = head_of(head, from + i);
      if (record && !is_private(record->opcode) && record->opcode != Opcode::kHeader &&
          record->opcode != Opcode::kAttachment && has_form_of_its_kind(*record) &&
          is_followed(*record)) {
        return record->offset;
      }
    }
    from += block.size() - (kRecordHead - 1);
  }
  return file_bytes_;
}

McapReader::Topic* McapReader::find_topic(std::uint16_t id) {
  const auto topic = std::find_if(topics_.begin(), topics_.end(),
                                  [id](const Topic& known) { return known.id == id; });
  return topic == topics_.end() ? nullptr : &*topic;
}

bool McapReader::is_defined(std::uint16_t channel_id) const {
  const auto is_it = [channel_id](const Topic& topic) { return topic.id == channel_id; };
  return std::any_of(topics_.begin(), topics_.end(), is_it) ||
         std::any_of(summary_topics_.begin(), summary_topics_.end(), is_it);
}

/// Messages that follow one another are read at once.
bool McapReader::take_bare_message(std::uint64_t offset, std::uint64_t length) {
  std::string bytes;
  if (!read(offset + kRecordHead, 2 + 4 + 8, bytes)) return false;
  Fields fields(bytes);
  fields.number<std::uint16_t>();  // channel
  fields.number<std::uint32_t>();  // sequence
  const auto time_ns = fields.number<std::uint64_t>();
  const bool is_next = !chunks_.empty() && chunks_.back().is_row &&
                       chunks_.back().offset + chunks_.back().length == offset &&
                       chunks_.back().length + length <= kMaxRowBytes;
  if (!is_next) chunks_.push_back({time_ns, time_ns, offset, 0, true});
  Chunk& row = chunks_.back();
  row.begin_ns = std::min(row.begin_ns, time_ns);
  row.end_ns = std::max(row.end_ns, time_ns);
  row.length += length;
  return true;
}

/// Other writers put schemas and channels into the chunk that first needs them.
void McapReader::take_definitions(const Chunk& chunk) {
  if (!load(chunk)) return;
  for (Fields records(rest_); !records.rest().empty();) {
    const auto opcode = static_cast<Opcode>(records.number<std::uint8_t>());
    const std::string_view content = records.take(records.number<std::uint64_t>());
    if (opcode != Opcode::kSchema && opcode != Opcode::kChannel) continue;
    if (!records.is_good() || !take(opcode, content)) break;
  }
  rest_ = {};
}

/// Reads one record of the summary, or a definition; false if it is malformed.
bool McapReader::take(Opcode opcode, std::string_view content) {
  Fields fields(content);
  switch (opcode) {
    case Opcode::kSchema: {
      const auto id = fields.number<std::uint16_t>();
      const std::string name(fields.text());
      fields.text();  // encoding
      schemas_[id] = {name, std::string(fields.text())};
      break;
    }
    case Opcode::kChannel: {
      Topic topic;
      topic.id = fields.number<std::uint16_t>();
      std::tie(topic.schema_name, topic.schema) = schemas_[fields.number<std::uint16_t>()];
      topic.topic = std::string(fields.text());
      if (fields.is_good() && find_topic(topic.id) == nullptr) topics_.push_back(topic);
      break;
    }
    case Opcode::kStatistics: {
      fields.take(8 + 2 + 4 + 4 + 4 + 4 + 8 + 8);
      Fields counts(fields.text());
      while (counts.is_good() && !counts.rest().empty()) {
        const auto id = counts.number<std::uint16_t>();
        const auto count = counts.number<std::uint64_t>();
        for (Topic& topic : topics_) {
          if (topic.id == id) topic.messages = count;
        }
      }
      break;
    }
    case Opcode::kChunkIndex: {
      Chunk chunk;
      chunk.begin_ns = fields.number<std::uint64_t>();
      chunk.end_ns = fields.number<std::uint64_t>();
      chunk.offset = fields.number<std::uint64_t>();
      chunk.length = fields.number<std::uint64_t>();
      if (!count_indexed(chunk.length)) return false;
      chunks_.push_back(chunk);
      break;
    }
    case Opcode::kMetadataIndex: {
      const auto offset = fields.number<std::uint64_t>();
      const auto length = fields.number<std::uint64_t>();
      if (!count_indexed(length) || !take_metadata(offset, length)) return false;
      break;
    }
    default:
      break;  // not needed
  }
  return fields.is_good();
}

bool McapReader::take_metadata(std::uint64_t offset, std::uint64_t length) {
  std::string bytes;
  if (length < kRecordHead || !read(offset, length, bytes)) return false;
  Fields fields(std::string_view(bytes).substr(kRecordHead));
  std::string name(fields.text());
  mcap::Strings strings = fields.strings();
  if (!fields.is_good()) return false;
  metadata_.emplace_back(std::move(name), std::move(strings));
  return true;
}

std::size_t McapReader::chunk_count() const {
  return static_cast<std::size_t>(std::count_if(chunks_.begin(), chunks_.end(),
                                                [](const Chunk& chunk) { return !chunk.is_row; }));
}

std::uint64_t McapReader::begin_ns() const {
  std::uint64_t begin_ns = chunks_.empty() ? 0 : chunks_.front().begin_ns;
  for (const Chunk& chunk : chunks_) begin_ns = std::min(begin_ns, chunk.begin_ns);
  return begin_ns;
}

std::uint64_t McapReader::end_ns() const {
  std::uint64_t end_ns = 0;
  for (const Chunk& chunk : chunks_) end_ns = std::max(end_ns, chunk.end_ns);
  return end_ns;
}

mcap::Strings McapReader::metadata(const std::string& name) const {
  mcap::Strings all;
  for (const auto& [its_name, strings] : metadata_) {
    if (its_name != name) continue;
    for (const auto& [key, value] : strings) all[key] = value;
  }
  return all;
}

void McapReader::seek(std::uint64_t log_time_ns, std::uint64_t to_ns) {
  from_ns_ = log_time_ns;
  to_ns_ = to_ns;
  next_chunk_ = 0;
  rest_ = {};
}

bool McapReader::load(const Chunk& chunk) {
  std::string record;
  if (chunk.length < kRecordHead || !read(chunk.offset, chunk.length, record)) return false;
  if (chunk.is_row) {
    chunk_ = std::move(record);
    rest_ = chunk_;
    return true;
  }
  Fields fields(record);
  const auto opcode = static_cast<Opcode>(fields.number<std::uint8_t>());
  fields.take(8 + 8 + 8);  // length, times
  const auto size = fields.number<std::uint64_t>();
  const auto crc = fields.number<std::uint32_t>();
  const std::string_view compression = fields.text();
  if (!compression.empty()) {
    refuse("chunks are compressed with \"" + std::string(compression) +
           "\"; convert it with: mcap compress --compression none");
  }
  const std::string_view records = fields.take(fields.number<std::uint64_t>());
  if (!fields.is_good() || opcode != Opcode::kChunk || records.size() != size ||
      (crc != 0 && mcap::crc_of(records) != crc)) {
    return false;
  }
  chunk_ = records;
  rest_ = chunk_;
  return true;
}

std::optional<McapReader::Message> McapReader::next() {
  while (true) {
    while (rest_.empty()) {
      if (next_chunk_ == chunks_.size()) return std::nullopt;
      Chunk& chunk = chunks_[next_chunk_++];
      if (chunk.end_ns < from_ns_ || chunk.begin_ns > to_ns_) continue;
      // counted once, however often the file is read
      if (!load(chunk) && !std::exchange(chunk.is_damaged, true)) ++damaged_chunks_;
    }
    Fields fields(rest_);
    const auto opcode = static_cast<Opcode>(fields.number<std::uint8_t>());
    Fields content(fields.take(fields.number<std::uint64_t>()));
    rest_ = fields.rest();
    if (opcode != Opcode::kMessage) continue;
    Message message;
    message.channel_id = content.number<std::uint16_t>();
    content.number<std::uint32_t>();
    message.log_time_ns = content.number<std::uint64_t>();
    content.number<std::uint64_t>();
    message.payload = content.rest();
    if (content.is_good() && message.log_time_ns >= from_ns_) return message;
  }
}

}  // namespace palpate::viewer
