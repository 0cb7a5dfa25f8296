// SPDX-License-Identifier: Apache-2.0
// recording_shelf.h — which recordings a page may list and download: those that pages of this
// session have made, in one folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace palpate::viewer {

/// A file that is read to where its end was when it was opened. Move-only.
class OpenFile {
 public:
  OpenFile(int descriptor, std::uint64_t size)
      : descriptor_(descriptor), size_(size), left_(size) {}
  OpenFile(OpenFile&& other) noexcept;
  OpenFile& operator=(OpenFile&& other) noexcept;
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;
  ~OpenFile();

  [[nodiscard]] std::uint64_t size() const { return size_; }
  [[nodiscard]] std::uint64_t left() const { return left_; }
  /// The next bytes, at most `most`; empty at the end, or where the file has become shorter.
  [[nodiscard]] std::string_view read(char* buffer, std::size_t most);

 private:
  int descriptor_;
  std::uint64_t size_;
  std::uint64_t left_;
};

class RecordingShelf {
 public:
  /// @param folder   empty: there are none
  /// @param session  the name of the session, which its recordings begin with
  RecordingShelf(std::string folder, std::string session)
      : folder_(std::move(folder)), session_(std::move(session)) {}

  /// SESSION-DATE-TIME.mcap, as PageRecorder names them: nothing else is ever opened.
  [[nodiscard]] bool is_name(std::string_view name) const;
  /// [{"name": …, "bytes": …, "modified_s": since 1970}], the newest first.
  [[nodiscard]] std::string list_json() const;
  /// None: there is no such recording, it is no plain file, or it is being written.
  [[nodiscard]] std::optional<OpenFile> open(std::string_view name) const;

  /// @param may_be_read  false: while places are hidden, which every recording tells
  /// @param written      name of the one that is being written; empty: none
  void set(bool may_be_read, std::string written) {
    may_be_read_ = may_be_read;
    written_ = std::move(written);
  }
  [[nodiscard]] bool may_be_read() const { return may_be_read_; }
  [[nodiscard]] bool exists() const { return !folder_.empty(); }

 private:
  std::string folder_;
  std::string session_;
  std::string written_;
  bool may_be_read_ = false;
};

}  // namespace palpate::viewer
