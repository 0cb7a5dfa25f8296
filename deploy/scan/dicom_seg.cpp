// SPDX-License-Identifier: Apache-2.0
// DICOM Segmentation (PS3.3 A.51, C.8.20), read by DCMTK; only in builds with PALPATE_DICOM.
#include <dcmtk/config/osconfig.h>
// the configuration comes first
#include <dcmtk/dcmdata/dcfilefo.h>
#include <dcmtk/dcmdata/dcistrmb.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/oflog/oflog.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <span>
#include <vector>

#include "common/core/check.h"
#include "deploy/scan/label_map.h"

namespace palpate::scan {
namespace {

constexpr const char* kExport = "export the segmentation as .seg.nrrd from 3D Slicer";
constexpr double kSame_mm = 1e-3;
constexpr double kUneven = 0.05;  // of the distance of two slices
constexpr std::uint32_t kMostFrames = 1'000'000;

struct Frame {
  std::uint32_t segment = 0;
  Vector3 place_mm = Vector3::Zero();  // LPS, of the first pixel
  std::uint32_t slice = 0;
};

class Reader {
 public:
  explicit Reader(std::string name) : name_(std::move(name)) {}

  LabelMap read(std::string_view bytes) {
    load(bytes);
    check_kind();
    size_[0] = whole(*data_, DCM_Columns);
    size_[1] = whole(*data_, DCM_Rows);
    read_segments();
    read_frames();
    place_slices();
    check_grid(size_, 1, affine_, name_);
    std::vector<Layer> layers = read_voxels();
    LabelMap map = label_map_of(size_, affine_, std::move(layers), std::move(table_), name_);
    map.notes.insert(map.notes.begin(), notes_.begin(), notes_.end());
    return map;
  }

 private:
  [[noreturn]] void fail(const std::string& what) const { throw SetupError(name_ + ": " + what); }
  [[noreturn]] void fail(const DcmTagKey& key, const std::string& rule) const {
    DcmTag field(key);
    fail(std::string(field.getTagName()) + " " + key.toString().c_str() + ": " + rule);
  }

  void load(std::string_view bytes) {
    // what is wrong is said once, by fail()
    OFLog::configure(OFLogger::OFF_LOG_LEVEL);
    DcmInputBufferStream stream;
    stream.setBuffer(bytes.data(), static_cast<offile_off_t>(bytes.size()));
    stream.setEos();
    file_.transferInit();
    const OFCondition result = file_.read(stream);
    file_.transferEnd();
    if (result.bad())
      fail(std::string("cannot be read as DICOM: ") + result.text() + "; copy the file again");
    data_ = file_.getDataset();
    const DcmXfer transfer(data_->getOriginalXfer());
    if (transfer.isEncapsulated()) {
      fail(std::string("its voxels are compressed (") + transfer.getXferName() +
           "): must be plain; save it so, with dcmdrle or gdcmconv --raw");
    }
    data_->convertToUTF8();  // names; if that fails, they are shown as they are
  }

  void check_kind() {
    const std::string kind = text(*data_, DCM_SOPClassUID);
    if (kind != UID_SegmentationStorage) {
      fail(DCM_SOPClassUID, "'" + kind +
                                "': must be a segmentation, " UID_SegmentationStorage
                                "; export the segmentation, not the scan");
    }
    const std::string type = text(*data_, DCM_SegmentationType);
    is_fractional_ = type == "FRACTIONAL";
    if (!is_fractional_ && type != "BINARY")
      fail(DCM_SegmentationType, "'" + type + "': must be BINARY or FRACTIONAL; " + kExport);
    const std::uint32_t bits = whole(*data_, DCM_BitsAllocated);
    if (bits != (is_fractional_ ? 8U : 1U))
      fail(DCM_BitsAllocated, std::to_string(bits) + ": must be 1, or 8 if FRACTIONAL");
    if (is_fractional_) {
      most_ = whole(*data_, DCM_MaximumFractionalValue);
      notes_.emplace_back("fractional: a voxel is in a segment from half of the largest value on");
    }
    notes_.emplace_back("orientation from the plane orientation of the file, in the patient (LPS)");
  }

  void read_segments() {
    std::set<std::uint32_t> numbers;
    for (DcmItem* item : items(*data_, DCM_SegmentSequence)) {
      Segment segment;
      segment.value = whole(*item, DCM_SegmentNumber);
      if (!numbers.insert(segment.value).second)
        fail(DCM_SegmentNumber, std::to_string(segment.value) + ": is given twice");
      segment.name = text(*item, DCM_SegmentLabel);
      DcmItem* code = nullptr;
      if (item->findAndGetSequenceItem(DCM_SegmentedPropertyTypeCodeSequence, code).good()) {
        const std::string scheme = text(*code, DCM_CodingSchemeDesignator);
        const std::string value = text(*code, DCM_CodeValue);
        if (!scheme.empty() && !value.empty()) {
          segment.code = scheme;
          segment.code += ':';
          segment.code += value;
        }
      }
      table_.push_back(std::move(segment));
    }
  }

  void read_frames() {
    const std::uint32_t count = whole(*data_, DCM_NumberOfFrames);
    const std::vector<DcmItem*> per_frame = items(*data_, DCM_PerFrameFunctionalGroupsSequence);
    if (count != per_frame.size() || count > kMostFrames) {
      fail(DCM_NumberOfFrames, std::to_string(count) +
                                   ": must be the number of functional groups, " +
                                   std::to_string(per_frame.size()));
    }
    data_->findAndGetSequenceItem(DCM_SharedFunctionalGroupsSequence, shared_);
    for (DcmItem* groups : per_frame) {
      Frame frame;
      frame.segment =
          whole(group(*groups, DCM_SegmentIdentificationSequence), DCM_ReferencedSegmentNumber);
      if (std::none_of(table_.begin(), table_.end(),
                       [&](const Segment& segment) { return segment.value == frame.segment; })) {
        fail(DCM_ReferencedSegmentNumber,
             std::to_string(frame.segment) + ": no segment has this number");
      }
      frame.place_mm =
          reals<3>(group(*groups, DCM_PlanePositionSequence), DCM_ImagePositionPatient);
      const Eigen::Matrix<double, 6, 1> axes =
          reals<6>(group(*groups, DCM_PlaneOrientationSequence), DCM_ImageOrientationPatient);
      const Eigen::Matrix<double, 2, 1> spacing_mm =
          reals<2>(group(*groups, DCM_PixelMeasuresSequence), DCM_PixelSpacing);
      if (frames_.empty()) {
        axes_ = axes;
        spacing_mm_ = spacing_mm;
        DcmItem& measures = group(*groups, DCM_PixelMeasuresSequence);
        between_mm_ = length_mm(measures, DCM_SpacingBetweenSlices);
        thickness_mm_ = length_mm(measures, DCM_SliceThickness);
      } else if (!(axes - axes_).isZero(1e-4) || !(spacing_mm - spacing_mm_).isZero(kSame_mm)) {
        fail(DCM_ImageOrientationPatient, std::string("must be that of all frames; ") + kExport);
      }
      frames_.push_back(frame);
    }
  }

  /// Slices are where frames are; empty ones may be left out of the file.
  void place_slices() {
    const Vector3 along_i = axes_.head<3>();
    const Vector3 along_j = axes_.tail<3>();
    const Vector3 normal = along_i.cross(along_j);
    if (!(std::abs(normal.norm() - 1.0) < 1e-3))
      fail(DCM_ImageOrientationPatient, "must be two unit vectors at right angles");
    const auto height_mm = [&](const Frame& frame) { return normal.dot(frame.place_mm); };
    const auto [low, high] = std::minmax_element(
        frames_.begin(), frames_.end(),
        [&](const Frame& a, const Frame& b) { return height_mm(a) < height_mm(b); });
    const Vector3 first_mm = low->place_mm;
    const double extent_mm = height_mm(*high) - height_mm(*low);
    const double step_mm = slice_step_mm(normal, extent_mm);
    const double steps = std::round(extent_mm / step_mm);
    if (!(steps < static_cast<double>(kMostVoxels)))
      fail(DCM_ImagePositionPatient, "the slices lie too far apart");
    size_[2] = static_cast<std::uint64_t>(steps) + 1;
    const Vector3 along_k_mm =
        steps > 0.0 ? Vector3((high->place_mm - first_mm) / steps) : Vector3(step_mm * normal);
    for (Frame& frame : frames_) {
      const double slice = std::round((height_mm(frame) - normal.dot(first_mm)) / step_mm);
      if (!((first_mm + slice * along_k_mm - frame.place_mm).norm() <= kUneven * step_mm)) {
        fail(DCM_ImagePositionPatient,
             "the slices must follow each other at the same distance; resample the segmentation");
      }
      frame.slice = static_cast<std::uint32_t>(slice);
    }
    affine_.linear().col(0) = spacing_mm_[1] * along_i;
    affine_.linear().col(1) = spacing_mm_[0] * along_j;
    affine_.linear().col(2) = along_k_mm;
    affine_.translation() = first_mm;
    affine_.matrix().topRows<3>() =
        1e-3 * Vector3(-1, -1, 1).asDiagonal() * affine_.matrix().topRows<3>();
  }

  /// The distance that the file gives if the frames are at multiples of it, or else the smallest
  /// between two frames.
  [[nodiscard]] double slice_step_mm(const Vector3& normal, double extent_mm) const {
    std::vector<double> heights_mm;
    for (const Frame& frame : frames_) heights_mm.push_back(normal.dot(frame.place_mm));
    std::sort(heights_mm.begin(), heights_mm.end());
    double least_mm = extent_mm;
    bool is_multiple = between_mm_ > kSame_mm;
    for (std::size_t f = 1; f < heights_mm.size(); ++f) {
      const double gap_mm = heights_mm[f] - heights_mm[f - 1];
      if (gap_mm > kSame_mm) least_mm = std::min(least_mm, gap_mm);
      const double slices = (heights_mm[f] - heights_mm[0]) / between_mm_;
      is_multiple = is_multiple && std::abs(slices - std::round(slices)) < kUneven;
    }
    if (is_multiple) return between_mm_;
    if (!(extent_mm > kSame_mm)) {
      if (thickness_mm_ > kSame_mm) return thickness_mm_;
      fail(DCM_SpacingBetweenSlices, "must be given where there is one slice only");
    }
    return extent_mm / std::round(extent_mm / least_mm);
  }

  std::vector<Layer> read_voxels() {
    const Uint8* bytes = nullptr;
    unsigned long count = 0;
    if (data_->findAndGetUint8Array(DCM_PixelData, bytes, &count).bad() || bytes == nullptr)
      fail(DCM_PixelData, std::string("must be in the file; ") + kExport);
    const std::uint64_t pixels = size_[0] * size_[1];
    const std::uint64_t all = pixels * frames_.size();
    if (count < (is_fractional_ ? all : (all + 7) / 8))
      fail(DCM_PixelData, "is too short for the frames; copy or download the file again");
    const auto is_in = [&](std::size_t frame, std::uint64_t pixel) {
      const std::uint64_t at = frame * pixels + pixel;
      return is_fractional_ ? 2U * bytes[at] >= most_ && bytes[at] > 0
                            : (bytes[at / 8] >> (at % 8) & 1) != 0;
    };

    // segments may overlap: each goes to the first layer in which nothing is in its way
    std::vector<Layer> layers;
    for (Segment& segment : table_) {
      const auto for_each = [&](const auto& visit) {
        for (std::size_t f = 0; f < frames_.size(); ++f) {
          if (frames_[f].segment != segment.value) continue;
          for (std::uint64_t p = 0; p < pixels; ++p) {
            if (is_in(f, p)) visit(frames_[f].slice * pixels + p);
          }
        }
      };
      std::size_t layer = 0;
      for (bool is_free = false; !is_free; layer += is_free ? 0 : 1) {
        if (layer == layers.size()) {
          if (layer == kMostLayers) fail(std::string("more than 64 segments overlap; ") + kExport);
          check_grid(size_, layers.size() + 1, affine_, name_);
          layers.emplace_back(pixels * size_[2]);
        }
        is_free = true;
        for_each([&](std::uint64_t at) { is_free = is_free && layers[layer][at] == 0; });
      }
      segment.layer = static_cast<std::uint32_t>(layer);
      for_each(
          [&](std::uint64_t at) { layers[layer][at] = static_cast<std::uint16_t>(segment.value); });
    }
    return layers;
  }

  // --- fields
  // -------------------------------------------------------------------------------------

  [[nodiscard]] static std::string text(DcmItem& item, const DcmTagKey& key) {
    OFString value;
    return item.findAndGetOFString(key, value).good() ? std::string(value.c_str()) : std::string();
  }
  /// A number 1 … 65535, or more where it is text.
  [[nodiscard]] std::uint32_t whole(DcmItem& item, const DcmTagKey& key) const {
    Uint16 number = 0;
    Sint32 in_text = 0;
    if (item.findAndGetUint16(key, number).good() && number > 0) return number;
    if (item.findAndGetSint32(key, in_text).good() && in_text > 0)
      return static_cast<std::uint32_t>(in_text);
    fail(key, "must be a whole number above 0");
  }
  template <int kCount>
  [[nodiscard]] Eigen::Matrix<double, kCount, 1> reals(DcmItem& item, const DcmTagKey& key) const {
    Eigen::Matrix<double, kCount, 1> values;
    for (int i = 0; i < kCount; ++i) {
      Float64 value = 0.0;
      if (item.findAndGetFloat64(key, value, static_cast<unsigned long>(i)).bad() ||
          !std::isfinite(value))
        fail(key, "must be " + std::to_string(kCount) + " finite numbers");
      values[i] = value;
    }
    return values;
  }
  /// A length; 0: not given.
  [[nodiscard]] static double length_mm(DcmItem& measures, const DcmTagKey& key) {
    Float64 value = 0.0;
    const bool is_given = measures.findAndGetFloat64(key, value).good() && std::isfinite(value);
    return is_given ? std::max(value, 0.0) : 0.0;
  }
  [[nodiscard]] std::vector<DcmItem*> items(DcmItem& item, const DcmTagKey& key) const {
    DcmSequenceOfItems* sequence = nullptr;
    std::vector<DcmItem*> found;
    if (item.findAndGetSequence(key, sequence).good() && sequence != nullptr) {
      DcmObject* next = nullptr;
      while ((next = sequence->nextInContainer(next)) != nullptr)
        found.push_back(static_cast<DcmItem*>(next));
    }
    if (found.empty()) fail(key, std::string("must have an item; ") + kExport);
    return found;
  }
  /// Of a frame, or else of all.
  [[nodiscard]] DcmItem& group(DcmItem& frame, const DcmTagKey& key) const {
    DcmItem* found = nullptr;
    for (DcmItem* groups : {&frame, shared_}) {
      if (groups != nullptr && groups->findAndGetSequenceItem(key, found).good() &&
          found != nullptr)
        return *found;
    }
    fail(key, std::string("must be given for each frame or for all; ") + kExport);
  }

  std::string name_;
  DcmFileFormat file_;
  DcmDataset* data_ = nullptr;
  DcmItem* shared_ = nullptr;
  bool is_fractional_ = false;
  std::uint32_t most_ = 1;
  std::array<std::uint64_t, 3> size_{1, 1, 1};
  std::vector<Segment> table_;
  std::vector<Frame> frames_;
  Eigen::Matrix<double, 6, 1> axes_ = Eigen::Matrix<double, 6, 1>::Zero();
  Eigen::Matrix<double, 2, 1> spacing_mm_ = Eigen::Matrix<double, 2, 1>::Zero();
  double between_mm_ = 0.0;    // slices
  double thickness_mm_ = 0.0;  // of a slice
  Eigen::Affine3d affine_ = Eigen::Affine3d::Identity();
  std::vector<std::string> notes_;
};

}  // namespace

LabelMap parse_dicom_seg(std::string_view bytes, const std::string& name) {
  return Reader(name).read(bytes);
}

}  // namespace palpate::scan
