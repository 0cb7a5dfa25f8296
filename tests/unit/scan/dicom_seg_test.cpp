// SPDX-License-Identifier: Apache-2.0
// DICOM segmentations written by DCMTK's own library for them (dcmseg), read by ours.
#include <dcmtk/config/osconfig.h>
// the configuration comes first
#include <dcmtk/dcmdata/dcfilefo.h>
#include <dcmtk/dcmdata/dcuid.h>
#include <dcmtk/dcmfg/fgfracon.h>
#include <dcmtk/dcmfg/fgpixmsr.h>
#include <dcmtk/dcmfg/fgplanor.h>
#include <dcmtk/dcmfg/fgplanpo.h>
#include <dcmtk/dcmseg/segdoc.h>
#include <dcmtk/dcmseg/segment.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "common/core/user/files.h"
#include "deploy/scan/label_map.h"
#include "tests/support/temp_folder.h"

namespace palpate::scan {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

// Pixels of a frame are a multiple of 8: others dcmseg 3.6.7 does not pack as PS3.5 8.1.1 says.
constexpr Uint16 kRows = 8;
constexpr Uint16 kColumns = 3;
constexpr int kSlices = 4;
constexpr double kAlong_mm = 2.0;   // from a column to the next
constexpr double kAcross_mm = 1.5;  // from a row to the next
constexpr double kSlice_mm = 4.0;
// Of the patient (LPS): rows run to the back and a little to the head, columns to the left.
const Vector3 kAlong(0.0, 0.8, 0.6);
const Vector3 kAcross(1.0, 0.0, 0.0);
const Vector3 kFirst_mm(10.0, -20.0, 30.0);

struct Written {
  std::string label;
  std::string code;
  std::function<bool(int i, int j, int k)> has;
};

void expect_good(const OFCondition& result) { PALPATE_REQUIRE(result.good()); }

OFString decimal(double value) { return std::to_string(value).c_str(); }

std::string bytes_of(DcmDataset& data, E_TransferSyntax syntax) {
  const test::TempFolder folder;
  const std::string name = (folder.path() / "a.dcm").string();
  DcmFileFormat file(&data);
  expect_good(file.saveFile(name.c_str(), syntax));
  return read_regular_file(name, 1 << 20).bytes;
}

/// Frames without a pixel are left out, as writers do. @param heights  of the slices, in slices
std::unique_ptr<DcmDataset> dataset_of(const std::vector<Written>& segments, bool is_fractional,
                                       std::array<double, kSlices> heights = {0, 1, 2, 3}) {
  const IODGeneralEquipmentModule::EquipmentInfo equipment("a", "b", "c", "d");
  const ContentIdentificationMacro content("1", "LABELS", "", "");
  DcmSegmentation* made = nullptr;
  expect_good(
      is_fractional
          ? DcmSegmentation::createFractionalSegmentation(
                made, kRows, kColumns, DcmSegTypes::SFT_PROBABILITY, 200, equipment, content)
          : DcmSegmentation::createBinarySegmentation(made, kRows, kColumns, equipment, content));
  const std::unique_ptr<DcmSegmentation> document(made);
  document->setCheckFGOnWrite(OFFalse);
  document->setCheckDimensionsOnWrite(OFFalse);

  std::array<char, 100> uid{};
  expect_good(document->getDimensions().addDimensionIndex(DCM_ImagePositionPatient,
                                                          dcmGenerateUniqueIdentifier(uid.data()),
                                                          DCM_PlanePositionSequence, "place"));

  const std::unique_ptr<FGPlaneOrientationPatient> orientation(
      FGPlaneOrientationPatient::createMinimal(decimal(kAlong.x()), decimal(kAlong.y()),
                                               decimal(kAlong.z()), decimal(kAcross.x()),
                                               decimal(kAcross.y()), decimal(kAcross.z())));
  expect_good(document->addForAllFrames(*orientation));
  FGPixelMeasures measures;
  expect_good(measures.setPixelSpacing(decimal(kAcross_mm) + "\\" + decimal(kAlong_mm)));
  expect_good(measures.setSliceThickness("1.0"));  // thinner than the distance
  expect_good(document->addForAllFrames(measures));

  const Vector3 step_mm = kSlice_mm * kAlong.cross(kAcross);
  for (const Written& segment : segments) {
    DcmSegment* described = nullptr;
    expect_good(DcmSegment::create(described, segment.label.c_str(),
                                   CodeSequenceMacro("123037004", "SCT", "Anatomical Structure"),
                                   CodeSequenceMacro(segment.code.c_str(), "SCT", "so called"),
                                   DcmSegTypes::SAT_MANUAL));
    Uint16 number = 0;
    expect_good(document->addSegment(described, number));
    for (int k = kSlices - 1; k >= 0; --k) {  // in no particular order
      std::vector<Uint8> pixels;
      bool has_any = false;
      for (int j = 0; j < kRows; ++j) {
        for (int i = 0; i < kColumns; ++i) {
          pixels.push_back(segment.has(i, j, k) ? 101 : is_fractional ? 99 : 0);
          has_any = has_any || segment.has(i, j, k);
        }
      }
      if (!has_any) continue;
      const Vector3 place_mm = kFirst_mm + heights[static_cast<std::size_t>(k)] * step_mm;
      const std::unique_ptr<FGPlanePosPatient> place(FGPlanePosPatient::createMinimal(
          decimal(place_mm.x()), decimal(place_mm.y()), decimal(place_mm.z())));
      FGFrameContent frame;
      expect_good(frame.setStackID("1"));
      expect_good(frame.setInStackPositionNumber(static_cast<Uint32>(k + 1)));
      expect_good(frame.setDimensionIndexValues(static_cast<Uint32>(k + 1), 0));
      expect_good(document->addFrame(pixels.data(), number, {place.get(), &frame}));
    }
  }
  expect_good(document->getStudy().setStudyInstanceUID(dcmGenerateUniqueIdentifier(uid.data())));
  expect_good(document->getSeries().setSeriesInstanceUID(dcmGenerateUniqueIdentifier(uid.data())));
  expect_good(document->getSeries().setSeriesNumber("1"));
  expect_good(document->getSOPCommon().setSOPInstanceUID(dcmGenerateUniqueIdentifier(uid.data())));
  expect_good(document->getFrameOfReference().setFrameOfReferenceUID(
      dcmGenerateUniqueIdentifier(uid.data())));
  auto data = std::make_unique<DcmDataset>();
  expect_good(document->writeDataset(*data));
  return data;
}

bool is_in_organ(int i, int j, int k) {
  return k > 0 && !(i == 2 && j == 4) && !(k == 2 && i == 0);
}
bool is_in_lesion(int i, int j, int k) { return k == 2 && i == 1 && j > 1; }
const std::vector<Written> kSegments = {
    {"liver", "10200004", is_in_organ},
    {"tumor", "4147007", is_in_lesion},
    {"vessel", "59820001", [](int i, int j, int k) { return k == 0 && i == 2 && j == 4; }}};

/// The smallest of those that have it.
int label_at(int i, int j, int k) {
  for (const int label : {3, 2, 1}) {
    if (kSegments[static_cast<std::size_t>(label - 1)].has(i, j, k)) return label;
  }
  return 0;
}

std::string complaint_about(const std::string& bytes) {
  try {
    (void)parse_dicom_seg(bytes, "a.dcm");
  } catch (const SetupError& error) {
    return error.what();
  }
  return "";
}

TEST(DicomSeg, HasTheVoxelsNamesAndPlacesThatDcmsegWrote) {
  for (const bool is_fractional : {false, true}) {
    for (const E_TransferSyntax syntax :
         {EXS_LittleEndianExplicit, EXS_LittleEndianImplicit, EXS_DeflatedLittleEndianExplicit}) {
      const LabelMap map =
          parse_dicom_seg(bytes_of(*dataset_of(kSegments, is_fractional), syntax), "a.dcm");

      ASSERT_EQ(map.segments.size(), 3u) << testing::PrintToString(map.notes);
      EXPECT_EQ(map.segments[0].name, "liver");
      EXPECT_EQ(map.segments[0].code, "SCT:10200004");
      EXPECT_EQ(map.segments[1].name, "tumor");
      // the slices' order follows their normal, along × across
      ASSERT_EQ(map.size, (std::array<std::uint32_t, 3>{kColumns, kRows, kSlices}));
      for (int k = 0; k < kSlices; ++k) {
        for (int j = 0; j < kRows; ++j) {
          for (int i = 0; i < kColumns; ++i) {
            EXPECT_EQ(map.at(i, j, k), label_at(i, j, k)) << i << ' ' << j << ' ' << k;
            const Vector3 lps_mm = kFirst_mm + i * kAlong_mm * kAlong + j * kAcross_mm * kAcross +
                                   k * kSlice_mm * kAlong.cross(kAcross);
            const Vector3 ras_mm(-lps_mm.x(), -lps_mm.y(), lps_mm.z());
            EXPECT_LT((1e3 * (map.ras_of_index_m * Vector3(i, j, k)) - ras_mm).norm(), 1e-3);
          }
        }
      }
    }
  }
}

TEST(DicomSeg, ASliceWithoutFramesIsEmpty) {
  const std::vector<Written> segments = {
      {"liver", "10200004", [](int, int, int k) { return k != 2; }}};
  const LabelMap map =
      parse_dicom_seg(bytes_of(*dataset_of(segments, false), EXS_LittleEndianExplicit), "a.dcm");
  EXPECT_EQ(map.size[2], 4u);
  EXPECT_EQ(map.at(1, 1, 1), 1);
  EXPECT_EQ(map.at(1, 1, 2), 0);
  EXPECT_EQ(map.at(1, 1, 3), 1);
}

TEST(DicomSeg, FramesFollowEachOtherBitByBit) {
  constexpr int kFewer = 7;
  const std::unique_ptr<DcmDataset> data = dataset_of(kSegments, false);
  std::vector<Uint8> bits;
  std::size_t count = 0;
  for (const Written& segment : kSegments) {
    for (int k = kSlices - 1; k >= 0; --k) {
      bool has_any = false;
      for (int p = 0; p < kRows * kColumns; ++p)
        has_any = has_any || segment.has(p % kColumns, p / kColumns, k);
      for (int p = 0; has_any && p < kFewer * kColumns; ++p, ++count) {
        if (count % 8 == 0) bits.push_back(0);
        if (segment.has(p % kColumns, p / kColumns, k))
          bits.back() = static_cast<Uint8>(bits.back() | 1U << (count % 8));
      }
    }
  }
  if (bits.size() % 2 != 0) bits.push_back(0);
  expect_good(data->putAndInsertUint16(DCM_Rows, kFewer));
  expect_good(data->putAndInsertUint8Array(DCM_PixelData, bits.data(), bits.size()));
  const LabelMap map = parse_dicom_seg(bytes_of(*data, EXS_LittleEndianExplicit), "a.dcm");
  for (int k = 0; k < kSlices; ++k) {
    for (int j = 0; j < kFewer; ++j) {
      for (int i = 0; i < kColumns; ++i)
        EXPECT_EQ(map.at(i, j, k), label_at(i, j, k)) << i << ' ' << j << ' ' << k;
    }
  }
}

TEST(DicomSeg, NamesWhatIsWrong) {
  const auto changed = [](const std::function<void(DcmDataset&)>& change) {
    const std::unique_ptr<DcmDataset> data = dataset_of(kSegments, false);
    change(*data);
    return complaint_about(bytes_of(*data, EXS_LittleEndianExplicit));
  };
  EXPECT_EQ(changed([](DcmDataset&) {}), "");
  EXPECT_THAT(changed([](DcmDataset& data) {
                data.putAndInsertString(DCM_SOPClassUID, UID_CTImageStorage);
              }),
              HasSubstr("a.dcm: SOPClassUID (0008,0016): '1.2.840.10008.5.1.4.1.1.2': must be a "
                        "segmentation"));
  EXPECT_THAT(
      changed([](DcmDataset& data) { data.putAndInsertString(DCM_SegmentationType, "LABELMAP"); }),
      HasSubstr("must be BINARY or FRACTIONAL"));
  EXPECT_THAT(changed([](DcmDataset& data) { data.putAndInsertString(DCM_NumberOfFrames, "90"); }),
              HasSubstr("NumberOfFrames (0028,0008): 90: must be the number of functional groups"));
  EXPECT_THAT(changed([](DcmDataset& data) { data.putAndInsertUint16(DCM_Columns, 30'000); }),
              HasSubstr("too short"));
  EXPECT_THAT(changed([](DcmDataset& data) { data.putAndInsertUint16(DCM_Rows, 0); }),
              HasSubstr("Rows (0028,0010): must be a whole number"));
  EXPECT_THAT(changed([](DcmDataset& data) { data.findAndDeleteElement(DCM_PixelData); }),
              HasSubstr("PixelData"));
  EXPECT_THAT(changed([](DcmDataset& data) { data.findAndDeleteElement(DCM_SegmentSequence); }),
              HasSubstr("SegmentSequence (0062,0002): must have an item"));
  EXPECT_THAT(changed([](DcmDataset& data) {
                data.findAndDeleteElement(DCM_PlaneOrientationSequence, OFTrue, OFTrue);
              }),
              HasSubstr("PlaneOrientationSequence (0020,9116)"));
  EXPECT_THAT(changed([](DcmDataset& data) {
                data.findAndDeleteElement(DCM_PlanePositionSequence, OFTrue, OFTrue);
              }),
              HasSubstr("PlanePositionSequence (0020,9113)"));
  EXPECT_THAT(complaint_about(bytes_of(*dataset_of(kSegments, false, {0, 1, 2, 3.4}),
                                       EXS_LittleEndianExplicit)),
              HasSubstr("at the same distance"));
  EXPECT_THAT(complaint_about("no DICOM"), HasSubstr("a.dcm"));
}

TEST(DicomSeg, EveryFileThatEndsTooEarlyIsRefused) {
  const std::string whole = bytes_of(*dataset_of(kSegments, false), EXS_LittleEndianExplicit);
  for (std::size_t size = 0; size + 2 < whole.size(); size += 13) {
    EXPECT_NE(complaint_about(whole.substr(0, size)), "") << size;
  }
}

}  // namespace
}  // namespace palpate::scan
