// SPDX-License-Identifier: Apache-2.0
// output_file.h — the files that a command writes. Nothing is replaced by accident: an existing
// file only with --overwrite, a file that the command reads never.
#pragma once

#include <cstdint>
#include <exception>
#include <string>
#include <string_view>
#include <vector>

namespace palpate {

/// Stands for standard output wherever an option names a file to write.
inline constexpr const char* kStandardOutput = "-";

/// Thrown where nothing is left to do once the reader of standard output has closed its pipe: the
/// program ends without a message, and with status 0.
struct ReaderHasLeft : std::exception {};

struct NamedOutput {
  std::string option;  ///< "--csv"
  std::string file;    ///< empty: not given
};

/// Checks every output of a command before the first one is opened. Throws SetupError if two name
/// the same file, if one is a file that the command reads (by path, link or second name of the same
/// file), or if one exists and `may_overwrite` is false. Pipes and devices always exist and are
/// not replaced.
/// @param inputs  files that the command reads; of a folder the files in it
void check_outputs(const std::vector<NamedOutput>& outputs, const std::vector<std::string>& inputs,
                   bool may_overwrite);

/// A file that is being written, without a buffer.
///
/// A pipe or device keeps its name and what was written. Opening a pipe waits for its reader and
/// says so on standard error. While an output is kStandardOutput, everything else that this process
/// and its children print to standard output goes to standard error.
class OutputFile {
 public:
  enum class Kind : std::uint8_t {
    kStream,  ///< written as it goes: a reader sees what is there, and an error leaves it
    kWhole,   ///< a regular file appears under its name at close(), complete, or not at all
  };

  /// Throws SetupError if the file cannot be created, or if it exists and `may_overwrite` is false.
  /// A kWhole file is created by the first write().
  /// @param what  for messages: "csv file"
  OutputFile(std::string what, std::string path, Kind kind, bool may_overwrite);
  /// Closes a stream; a kWhole file that was not closed is removed.
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  /// False after an error; then nothing more is written. No error is a reader of standard output
  /// that has what it wanted (`| head`): the rest is dropped.
  bool write(std::string_view bytes);
  /// Gives a kWhole file its name. False after an error.
  bool close();
  [[nodiscard]] bool is_open() const { return is_open_; }
  /// False once the reader of standard output has closed its pipe.
  [[nodiscard]] bool has_reader() const { return has_reader_; }
  /// The first error, "csv file run.csv: No space left on device"; empty without one.
  [[nodiscard]] const std::string& complaint() const { return complaint_; }

 private:
  [[noreturn]] void refuse(const std::string& why) const;
  void take_standard_output();
  void give_standard_output_back();
  void open_stream(bool is_regular, bool is_pipe);
  void prepare_whole(bool exists);
  bool create_whole();
  [[nodiscard]] std::string temporary_name() const;
  bool give_name();
  void fail(int error);
  void release();

  std::string what_;
  std::string path_;
  bool may_overwrite_;
  bool is_standard_output_ = false;
  bool is_open_ = true;
  bool has_reader_ = true;
  int file_ = -1;
  std::string target_{};   // of a kWhole file: path_ without symbolic links
  std::string partial_{};  // its temporary name, while it has one
  std::string complaint_{};
};

/// Writes a kWhole file. Throws SetupError if it cannot be created, std::runtime_error if writing
/// it fails.
void write_file(const std::string& what, const std::string& path, std::string_view text,
                bool may_overwrite);

/// Call it at the end of a program: flushes standard output and reports on standard error if
/// something that was printed there is lost.
/// @return `status`; 1 instead of 0 if something is lost
[[nodiscard]] int status_with_output(int status, const std::string& program);

}  // namespace palpate
