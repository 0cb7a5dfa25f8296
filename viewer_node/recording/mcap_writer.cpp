// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/recording/mcap_writer.h"

#include <algorithm>
#include <utility>

namespace palpate::viewer {

using mcap::Bytes;
using mcap::Opcode;

namespace {

std::string record(Opcode opcode, const std::string& content) {
  std::string bytes;
  Bytes(bytes).head(opcode, content.size());
  return bytes + content;
}

}  // namespace

McapWriter::McapWriter(std::string path, bool may_overwrite,
                       const std::vector<mcap::Channel>& channels, OutputFile::Kind kind)
    : file_("recording", std::move(path), kind, may_overwrite), kind_(kind) {
  std::string schemas;
  std::string topics;
  for (const mcap::Channel& channel : channels) {
    const auto id = static_cast<std::uint16_t>(topics_.size() + 1);
    topics_.push_back({.id = id, .sequence = 0, .index = {}});
    std::string schema;
    Bytes(schema)
        .number(id)
        .text(channel.schema_name)
        .text(channel.schema_encoding)
        .text(channel.schema);
    schemas += record(Opcode::kSchema, schema);
    std::string topic;
    Bytes(topic).number(id).number(id).text(channel.topic).text(channel.encoding).strings({});
    topics += record(Opcode::kChannel, topic);
  }
  definition_bytes_ = {schemas.size(), topics.size()};
  definitions_ = schemas + topics;

  std::string header;
  Bytes(header).text("").text("palpate");
  put(std::string(mcap::kMagic) + record(Opcode::kHeader, header) + definitions_);
}

McapWriter::~McapWriter() {
  if (kind_ == OutputFile::Kind::kStream) close();
}

void McapWriter::add_metadata(const std::string& name, const mcap::Strings& strings) {
  end_chunk();
  std::string content;
  Bytes(content).text(name).strings(strings);
  const std::string bytes = record(Opcode::kMetadata, content);
  metadata_.push_back({.offset = offset_, .length = bytes.size(), .name = name});
  put(bytes);
}

void McapWriter::write(std::size_t channel, std::uint64_t log_time_ns, std::string_view payload) {
  if (!file_.is_open()) return;
  // ticks are a little older than the messages that brought them
  const bool is_over =
      log_time_ns >= chunk_begin_ns_ + kChunkSpan_ns || log_time_ns + kChunkSpan_ns < chunk_end_ns_;
  if (!chunk_.empty() && is_over) end_chunk();
  if (chunk_.empty()) chunk_begin_ns_ = chunk_end_ns_ = log_time_ns;
  chunk_begin_ns_ = std::min(chunk_begin_ns_, log_time_ns);
  chunk_end_ns_ = std::max(chunk_end_ns_, log_time_ns);

  Topic& topic = topics_[channel];
  topic.index.emplace_back(log_time_ns, chunk_.size());
  Bytes(chunk_)
      .head(Opcode::kMessage, 2 + 4 + 8 + 8 + payload.size())
      .number(topic.id)
      .number(topic.sequence++)
      .number(log_time_ns)
      .number(log_time_ns);
  chunk_ += payload;
  if (chunk_.size() >= kChunkBytes) end_chunk();
}

void McapWriter::end_chunk() {
  if (!file_.is_open() || chunk_.empty()) return;
  begin_ns_ = chunks_ == 0 ? chunk_begin_ns_ : std::min(begin_ns_, chunk_begin_ns_);
  end_ns_ = std::max(end_ns_, chunk_end_ns_);

  constexpr std::size_t kChunkHead = 8 + 8 + 8 + 4 + 4 + 8;
  std::string bytes;
  Bytes(bytes)
      .head(Opcode::kChunk, kChunkHead + chunk_.size())
      .number(chunk_begin_ns_)
      .number(chunk_end_ns_)
      .number(std::uint64_t{chunk_.size()})
      .number(mcap::crc_of(chunk_))
      .text("")  // compression
      .number(std::uint64_t{chunk_.size()});
  bytes += chunk_;
  const std::uint64_t length = bytes.size();

  // offsets of each topic's messages in it
  std::string index_offsets;
  for (Topic& topic : topics_) {
    if (topic.index.empty()) continue;
    Bytes(index_offsets).number(topic.id).number(offset_ + bytes.size());
    std::string entries;
    for (const auto& [time_ns, at] : topic.index) Bytes(entries).number(time_ns).number(at);
    std::string content;
    Bytes(content).number(topic.id).text(entries);
    bytes += record(Opcode::kMessageIndex, content);
    topic.index.clear();
  }
  std::string place;
  Bytes(place)
      .number(chunk_begin_ns_)
      .number(chunk_end_ns_)
      .number(offset_)
      .number(length)
      .text(index_offsets)
      .number(bytes.size() - length)
      .text("")  // compression
      .number(std::uint64_t{chunk_.size()})
      .number(std::uint64_t{chunk_.size()});
  chunk_indexes_ += record(Opcode::kChunkIndex, place);
  ++chunks_;
  chunk_.clear();
  put(bytes);
}

void McapWriter::flush() { end_chunk(); }

void McapWriter::close() {
  end_chunk();
  if (!file_.is_open()) return;
  std::string end;
  Bytes(end).number(data_crc_);
  put(record(Opcode::kDataEnd, end));
  put(summary());
  file_.close();
}

std::string McapWriter::summary() const {
  std::string bytes;
  std::string offsets;
  const auto note = [&](Opcode group, std::size_t begin, std::size_t length) {
    if (length == 0) return;
    std::string content;
    Bytes(content).number(static_cast<std::uint8_t>(group));
    Bytes(content).number(offset_ + begin).number(std::uint64_t{length});
    offsets += record(Opcode::kSummaryOffset, content);
  };

  bytes = definitions_;
  note(Opcode::kSchema, 0, definition_bytes_.first);
  note(Opcode::kChannel, definition_bytes_.first, definition_bytes_.second);

  std::size_t begin = bytes.size();
  std::string counts;
  std::uint64_t messages = 0;
  for (const Topic& topic : topics_) {
    Bytes(counts).number(topic.id).number(std::uint64_t{topic.sequence});
    messages += topic.sequence;
  }
  std::string statistics;
  Bytes(statistics)
      .number(messages)
      .number(static_cast<std::uint16_t>(topics_.size()))
      .number(static_cast<std::uint32_t>(topics_.size()))
      .number(std::uint32_t{0})  // attachments
      .number(static_cast<std::uint32_t>(metadata_.size()))
      .number(chunks_)
      .number(begin_ns_)
      .number(end_ns_)
      .text(counts);
  bytes += record(Opcode::kStatistics, statistics);
  note(Opcode::kStatistics, begin, bytes.size() - begin);

  begin = bytes.size();
  bytes += chunk_indexes_;
  note(Opcode::kChunkIndex, begin, bytes.size() - begin);

  begin = bytes.size();
  for (const MetadataPlace& place : metadata_) {
    std::string content;
    Bytes(content).number(place.offset).number(place.length).text(place.name);
    bytes += record(Opcode::kMetadataIndex, content);
  }
  note(Opcode::kMetadataIndex, begin, bytes.size() - begin);

  // the footer's checksum covers the summary and the footer before the checksum
  const std::uint64_t summary_start = offset_;
  const std::uint64_t offsets_start = offset_ + bytes.size();
  bytes += offsets;
  Bytes(bytes).head(Opcode::kFooter, 20).number(summary_start).number(offsets_start);
  Bytes(bytes).number(mcap::crc_of(bytes));
  return bytes + std::string(mcap::kMagic);
}

void McapWriter::put(const std::string& bytes) {
  if (!file_.write(bytes)) return;
  offset_ += bytes.size();
  data_crc_ = mcap::crc_of(bytes, data_crc_);
}

std::optional<std::string> McapWriter::take_error() {
  if (file_.complaint().empty() || std::exchange(has_given_error_, true)) return std::nullopt;
  return file_.complaint() + ": recording stopped here; earlier data can be read";
}

}  // namespace palpate::viewer
