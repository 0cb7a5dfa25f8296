// SPDX-License-Identifier: Apache-2.0
// mcap_reader.h — reads the files of McapWriter, even if their end is missing, and those of others.
#pragma once

#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "viewer_node/recording/mcap_format.h"

namespace palpate::viewer {

/// Checks everything it reads. Refuses compressed chunks, chunks over 64 MiB, and an index that
/// covers more bytes than the file has. Without a complete summary, or if it is over 64 MiB or
/// lists no chunks or no topics, it scans the file from the beginning; what is damaged is skipped
/// and counted, up to the next record that holds together. Messages outside chunks are read where
/// it scans: they have no check sum, so that only who decodes them knows whether they are damaged.
class McapReader {
 public:
  struct Message {
    std::uint16_t channel_id = 0;
    std::uint64_t log_time_ns = 0;
    std::string_view payload;  ///< valid until the next call
  };
  struct Topic {
    std::uint16_t id = 0;
    std::string topic;
    std::string schema_name;
    std::string schema;          ///< binary FileDescriptorSet
    std::uint64_t messages = 0;  ///< 0 where the summary is missing
  };

  /// Throws SetupError: no such file, not MCAP, or an unsupported kind of MCAP.
  explicit McapReader(std::string path);

  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] std::uint64_t file_bytes() const { return file_bytes_; }
  /// Whether the file was closed properly; otherwise its last half second may be missing.
  [[nodiscard]] bool is_whole() const { return is_whole_; }
  /// Chunks that could not be read so far: all of them once next() has come to the end.
  [[nodiscard]] std::uint64_t damaged_chunks() const { return damaged_chunks_; }
  /// Bytes that belong to no record that could be read, nor to a chunk.
  [[nodiscard]] std::uint64_t unreadable_bytes() const { return unreadable_bytes_; }
  [[nodiscard]] const std::vector<Topic>& topics() const { return topics_; }
  [[nodiscard]] std::size_t chunk_count() const;
  /// Log times of the first and last message; 0 without messages.
  [[nodiscard]] std::uint64_t begin_ns() const;
  [[nodiscard]] std::uint64_t end_ns() const;
  /// All metadata of that name, later entries override earlier ones; empty if there is none.
  [[nodiscard]] mcap::Strings metadata(const std::string& name) const;

  /// The next message in the order of the file; nullopt at the end.
  [[nodiscard]] std::optional<Message> next();
  /// Back to the first message at or after this time. Chunks that begin after `to_ns` are left out.
  void seek(std::uint64_t log_time_ns, std::uint64_t to_ns = ~std::uint64_t{0});

 private:
  struct Chunk {  // or a row of messages outside chunks
    std::uint64_t begin_ns = 0;
    std::uint64_t end_ns = 0;
    std::uint64_t offset = 0;  // of the record
    std::uint64_t length = 0;  // with its head
    bool is_row = false;
    bool is_damaged = false;  // found while reading
  };

  struct Record {
    mcap::Opcode opcode{};
    std::uint64_t offset = 0;
    std::uint64_t end = 0;
  };

  [[nodiscard]] bool read(std::uint64_t offset, std::uint64_t length, std::string& bytes) const;
  enum class Summary : std::uint8_t { kRead, kUnusable, kDamaged };
  [[nodiscard]] Summary read_summary();
  [[nodiscard]] bool take_all(std::string_view summary);
  [[nodiscard]] bool search();
  [[nodiscard]] static std::optional<Record> head_of(std::string_view bytes, std::uint64_t offset);
  [[nodiscard]] std::optional<Record> head_at(std::uint64_t offset) const;
  [[nodiscard]] bool has_form_of_its_kind(const Record& record) const;
  [[nodiscard]] bool is_followed(const Record& record) const;
  [[nodiscard]] bool take_record(const Record& record, bool has_definitions);
  [[nodiscard]] std::uint64_t next_sound_record(std::uint64_t from) const;
  [[nodiscard]] Topic* find_topic(std::uint16_t id);
  [[nodiscard]] bool is_defined(std::uint16_t channel_id) const;
  [[nodiscard]] bool take_bare_message(std::uint64_t offset, std::uint64_t length);
  void take_definitions(const Chunk& chunk);
  [[nodiscard]] bool take(mcap::Opcode opcode, std::string_view content);
  [[nodiscard]] bool count_indexed(std::uint64_t length);
  [[nodiscard]] bool take_metadata(std::uint64_t offset, std::uint64_t length);
  [[nodiscard]] bool load(const Chunk& chunk);
  [[noreturn]] void refuse(const std::string& why) const;

  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  std::string path_;
  std::unique_ptr<std::FILE, Close> file_;
  std::uint64_t file_bytes_ = 0;
  bool is_whole_ = false;
  std::map<std::uint16_t, std::pair<std::string, std::string>> schemas_;  // names, content
  std::vector<Topic> topics_;
  std::vector<Topic> summary_topics_;  // of a summary that does not tell where the chunks are
  std::vector<Chunk> chunks_;
  std::vector<std::pair<std::string, mcap::Strings>> metadata_;
  std::uint64_t indexed_bytes_ = 0;  // of chunks and metadata

  std::size_t next_chunk_ = 0;
  std::string chunk_;          // records of the current chunk
  std::string_view rest_;      // unread part of chunk_
  std::uint64_t from_ns_ = 0;  // seek()
  std::uint64_t to_ns_ = ~std::uint64_t{0};
  std::uint64_t damaged_chunks_ = 0;
  std::uint64_t unreadable_bytes_ = 0;
};

}  // namespace palpate::viewer
