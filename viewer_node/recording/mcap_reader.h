// mcap_reader.h — reads what McapWriter wrote, also if its end is missing.
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

/// Nothing in the file is believed unchecked. Refused: other compressions, chunks of more than
/// 64 MiB; an index that names more than there is in the file. A file without a whole summary is searched from its beginning; what is cut off or
/// damaged is left out and counted.
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
    std::uint64_t messages = 0;  ///< 0 where the summary is missing
  };

  /// Throws SetupError: no such file, no MCAP, or none of the kind that is understood here.
  explicit McapReader(std::string path);

  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] std::uint64_t file_bytes() const { return file_bytes_; }
  /// Was it closed in order? If not, its last second may be missing.
  [[nodiscard]] bool is_whole() const { return is_whole_; }
  [[nodiscard]] std::uint64_t damaged_chunks() const { return damaged_chunks_; }
  [[nodiscard]] const std::vector<Topic>& topics() const { return topics_; }
  [[nodiscard]] std::size_t chunk_count() const { return chunks_.size(); }
  /// Of the messages; 0 if there is none.
  [[nodiscard]] std::uint64_t begin_ns() const;
  [[nodiscard]] std::uint64_t end_ns() const;
  /// All of that name, a later one over an earlier one; empty if there is none.
  [[nodiscard]] mcap::Strings metadata(const std::string& name) const;

  /// The next message in the order of the file; nullopt at the end.
  [[nodiscard]] std::optional<Message> next();
  /// Back to the first message at or after this time.
  void seek(std::uint64_t log_time_ns);

 private:
  struct Chunk {
    std::uint64_t begin_ns = 0;
    std::uint64_t end_ns = 0;
    std::uint64_t offset = 0;  // of the record
    std::uint64_t length = 0;  // with its head
  };

  [[nodiscard]] bool read(std::uint64_t offset, std::uint64_t length, std::string& bytes) const;
  [[nodiscard]] bool read_summary();
  void search();
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
  std::map<std::uint16_t, std::string> schemas_;  // names
  std::vector<Topic> topics_;
  std::vector<Chunk> chunks_;
  std::vector<std::pair<std::string, mcap::Strings>> metadata_;
  std::uint64_t indexed_bytes_ = 0;  // of chunks and metadata

  std::size_t next_chunk_ = 0;
  std::string chunk_;          // records of the one at hand
  std::string_view rest_;      // of them
  std::uint64_t from_ns_ = 0;  // seek()
  std::uint64_t damaged_chunks_ = 0;
};

}  // namespace palpate::viewer
