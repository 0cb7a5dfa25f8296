// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/csv_writer.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <utility>

#include "common/core/check.h"
#include "common/core/user/utf8.h"

namespace palpate {
namespace {

constexpr const char* kHeader =
    "t_s,x_m,y_m,z_m,xm_m,ym_m,zm_m,fe_x,fe_y,fe_z,fs_x,fs_y,fs_z,fi_x,fi_y,fi_z,"
    "f_max_x,f_max_y,f_max_z,energy_j,true_energy_j,force_age_s,"
    "in_contact,clamped,fallback,peak_limited,"
    "judged_s,transparency_s,along_n2s,ideal_n2s,error_n2s,error_ns,beyond_jnd_s,grip";
constexpr const char* kWristHeader = ",a_1,a_2,a_3,te_1,te_2,te_3,ts_1,ts_2,ts_3,ti_1,ti_2,ti_3";

// One write to the file per this many bytes, about a thousand rows.
constexpr std::size_t kBufferBytes = 1U << 18U;
// 50 numbers of at most 24 characters, 4 flags and the commas.
constexpr std::size_t kMaxRowBytes = 1536;

// Appends to a row; every field but the first is preceded by a comma.
class RowText {
 public:
  void number(double value) {
    if (end_ != text_.data()) *end_++ = ',';
    if (std::isnan(value)) {  // never "-nan"
      std::memcpy(end_, "nan", 3);
      end_ += 3;
      return;
    }
    end_ = std::to_chars(end_, text_.data() + text_.size(), value).ptr;
  }
  void vector(const Vector3& v) {
    for (int axis = 0; axis < 3; ++axis) number(v[axis]);
  }
  void flag(std::optional<bool> value) {
    if (!value) return number(kNaN);
    *end_++ = ',';
    *end_++ = *value ? '1' : '0';
  }
  void append_to(std::string& buffer) {
    *end_++ = '\n';
    buffer.append(text_.data(), static_cast<std::size_t>(end_ - text_.data()));
  }

 private:
  std::array<char, kMaxRowBytes> text_;
  char* end_ = text_.data();
};

bool is_number(const std::string& text) {
  double value = 0.0;
  const char* const begin = text.data() + (text.starts_with('+') ? 1 : 0);
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(begin, end, value);
  return error == std::errc() && rest == end;
}

bool has_force_of_physics(const MofcTick& mofc) {
  return mofc.state != MofcState::kNoPhysics && mofc.state != MofcState::kClutched;
}

}  // namespace

std::string csv_text(const std::string& any_text) {
  // readers of CSV take UTF-8; names of files may be anything
  std::string text;
  for (std::size_t at = 0; at < any_text.size();) {
    const std::size_t length = utf8_character_at(std::string_view(any_text).substr(at)).length;
    text += length == 0 ? "\xEF\xBF\xBD" : any_text.substr(at, length);
    at += std::max<std::size_t>(1, length);
  }
  const bool is_formula = text.find_first_of("=+-@\t\r") == 0 && !is_number(text);
  return is_formula ? "'" + text : text;
}

std::string csv_cell(const std::string& any_text) {
  const std::string text = csv_text(any_text);
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string cell(1, '"');
  for (const char c : text) {
    if (c == '"') cell += '"';
    cell += c;
  }
  cell += '"';
  return cell;
}

std::string csv_file_of(const std::string& file, const std::string& side) {
  if (side.empty()) return file;
  if (file == kStandardOutput) {
    throw SetupError("--csv -: several sides make several tables; give a file name");
  }
  std::filesystem::path path(file);
  const std::string extension = path.extension().string();
  return path.replace_extension(side + extension).string();
}

CsvWriter::CsvWriter(const std::string& path, bool may_overwrite, OutputFile::Kind kind)
    : file_("csv file", path, kind, may_overwrite) {
  buffer_.reserve(kBufferBytes + kMaxRowBytes);
}

CsvWriter::~CsvWriter() {
  begin(false);
  flush();
}

void CsvWriter::begin(bool has_wrist) {
  if (std::exchange(has_begun_, true)) return;
  has_wrist_ = has_wrist;
  buffer_ = kHeader;
  if (has_wrist) buffer_ += kWristHeader;
  buffer_ += '\n';
}

void CsvWriter::write(const TickRow& row) {
  if (!file_.is_open()) return;
  begin(row.device.has_wrist());
  if (row.device_session_id != device_session_id_) {
    device_session_id_ = row.device_session_id;
    was_answered_ = false;
  }
  was_answered_ = was_answered_ || row.device.is_answered;
  const bool has_answer =
      row.device.guard == GuardState::kAnswered || row.device.guard == GuardState::kLeased;
  const Vector3 unknown = Vector3::Constant(kNaN);
  const auto& mofc = row.mofc;

  RowText text;
  text.number(seconds_of(row.device.sampled_at));
  text.vector(row.device.true_tool_position_world_m);
  text.vector(row.device.measured_tool_position_world_m);
  text.vector(mofc ? mofc->requested_force_on_hand_newton : unknown);
  text.vector(row.device.force_on_hand_newton);
  text.vector(row.ideal_force_on_hand_newton);
  text.vector(mofc ? mofc->f_max_newton : unknown);
  text.number(mofc ? mofc->ledger_energy_joule : kNaN);
  text.number(row.device.true_energy_joule);
  text.number(mofc && has_force_of_physics(*mofc) ? to_seconds(mofc->force_age) : kNaN);
  text.flag(row.is_truly_in_contact || !mofc ? row.is_truly_in_contact : mofc->is_in_contact);
  text.flag(mofc ? std::optional(mofc->is_clamped) : std::nullopt);
  text.flag(was_answered_ && !has_answer);
  text.flag(row.device.is_peak_limited);
  // sums of these columns give the figures of the summary
  const ForceComparison::Integrals since =
      row.to_ideal ? row.to_ideal->integrals() : ForceComparison::Integrals{};
  for (const double integral :
       {since.judged_s, since.transparency_s, since.along_n2s, since.reference_n2s, since.error_n2s,
        since.error_ns, since.beyond_jnd_s}) {
    text.number(row.to_ideal ? integral : kNaN);
  }
  text.number(mofc ? static_cast<double>(mofc->grip) : kNaN);
  if (has_wrist_) {
    text.vector(row.device.true_wrist_angle_rad);
    text.vector(mofc ? mofc->requested_wrist_torque_newton_m : unknown);
    text.vector(row.device.wrist_torque_newton_m);
    text.vector(row.ideal_wrist_torque_newton_m);
  }
  text.append_to(buffer_);

  if (buffer_.size() >= kBufferBytes) flush();
}

void CsvWriter::flush() {
  file_.write(buffer_);
  buffer_.clear();
}

void CsvWriter::close() {
  begin(false);
  flush();
  file_.close();
}

std::optional<std::string> CsvWriter::take_error() {
  if (file_.complaint().empty() || std::exchange(has_given_error_, true)) return std::nullopt;
  return file_.complaint() + ": the rows from here on are missing";
}

}  // namespace palpate
