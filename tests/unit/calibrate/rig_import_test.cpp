// SPDX-License-Identifier: Apache-2.0
// Calibrations of other programs, and rig.yaml files built step by step.
#include "capture/calibrate/rig_import.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "capture/calibrate/rig_part.h"
#include "tests/support/temp_folder.h"

namespace relievo {
namespace {

using test::TempFolder;
using testing::HasSubstr;

std::string matrix(const std::string& name, int rows, int cols, const std::string& data) {
  return name + ": !!opencv-matrix\n   rows: " + std::to_string(rows) + "\n   cols: " + std::to_string(cols) +
         "\n   dt: d\n   data: [ " + data + " ]\n";
}

std::string sltk(const std::string& translation = "-183., -23., -60.") {
  return "%YAML:1.0\n---\n" + matrix("cam_size", 2, 1, "2592., 1944.") +
         matrix("pro_size", 2, 1, "1280., 800.") +
         matrix("cam_K", 3, 3, "2800., 0., 1500., 0., 2810., 1090., 0., 0., 1.") +
         matrix("pro_K", 3, 3, "1650., 0., 620., 0., 1720., 360., 0., 0., 1.") +
         matrix("cam_kc", 1, 5, "-0.2, 0.1, 0., 0., 0.") + matrix("pro_kc", 5, 1, "0., 1., 0., 0., 0.") +
         matrix("R", 3, 3, "1., 0., 0., 0., 1., 0., 0., 0., 1.") + matrix("T", 3, 1, translation) +
         "stereo_rms: 0.61\n";
}

TEST(RigImport, SltkInMillimetres) {
  const TempFolder folder;
  std::ofstream(folder / "c.yaml") << sltk();
  const auto rig = import_rig(folder / "c.yaml", 0, 0);
  ASSERT_TRUE(rig.ok()) << rig.error().message;
  EXPECT_EQ(rig->format, "sltk");
  EXPECT_EQ(rig->stereo_rms, 0.61);
  EXPECT_EQ(rig->rig.camera.width, 2592);
  EXPECT_EQ(rig->rig.projector.height, 800);
  EXPECT_EQ(rig->rig.projector.fy(), 1720);
  EXPECT_EQ(rig->rig.projector.distortion[1], 1);
  EXPECT_NEAR(rig->rig.projector_from_camera_translation[0], -0.183, 1e-12);
  EXPECT_THAT(import_rig(folder / "c.yaml", 1024, 768).error().message,
              HasSubstr("its projector is 1280x800, not 1024x768"));
}

TEST(RigImport, ErrorsNameFileAndKey) {
  const TempFolder folder;
  EXPECT_THAT(import_rig(folder / "none.yaml", 0, 0).error().message, HasSubstr("none.yaml is missing"));
  std::ofstream(folder / "short.yaml") << sltk("-183., -23.");
  EXPECT_FALSE(import_rig(folder / "short.yaml", 0, 0).ok());
  std::ofstream(folder / "nan.yaml") << sltk(".Nan, 1., 2.");
  EXPECT_THAT(import_rig(folder / "nan.yaml", 0, 0).error().message,
              HasSubstr("T holds a value that is no finite number"));
  std::ofstream(folder / "other.yaml") << "%YAML:1.0\n---\nsomething: 1\n";
  EXPECT_THAT(import_rig(folder / "other.yaml", 0, 0).error().message,
              HasSubstr("no calibration known here"));
  std::ofstream(folder / "text.yaml") << "hello";
  EXPECT_FALSE(import_rig(folder / "text.yaml", 0, 0).ok());
}

/// Inputs that fuzzing found: OpenCV's parser never comes back from them.
std::string found(const std::string& name) {
  std::ifstream in(RELIEVO_SOURCE_DIR "/fuzz/corpus/" + name, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

TEST(RigImport, RefusesWhatTheParserWouldNeverEndAt) {
  const TempFolder folder;
  const std::string behind = found("take/yaml_behind_its_end").substr(1);  // which file of a take it is
  ASSERT_TRUE(behind.starts_with("%YAML"));
  for (const std::string& content : {behind, sltk() + "---\n--\n", sltk() + "...\n--\n"}) {
    std::ofstream(folder / "c.yaml") << content;
    EXPECT_THAT(import_rig(folder / "c.yaml", 0, 0).error().message, HasSubstr("it must be one map"))
        << content;
    EXPECT_THAT(read_rig_part(folder / "c.yaml").error().message, HasSubstr("it must be one map")) << content;
  }
}

TEST(RigImport, RefusesBase64ThatTheParserWouldNeverEndAt) {
  const TempFolder folder;
  const std::string yaml = found("calibration/base64_that_never_ends");
  ASSERT_TRUE(yaml.starts_with("%YAML"));
  for (const std::string& content :
       {yaml, std::string("<?xml version=\"1.0\"?>\n<opencv_storage><a type_id=\"binary\">MWQg</a>")}) {
    std::ofstream(folder / "c.yaml") << content;
    EXPECT_THAT(import_rig(folder / "c.yaml", 0, 0).error().message, HasSubstr("binary data")) << content;
  }
  std::ofstream(folder / "c.yaml") << "%YAML:1.0\n---\n# no binary data\n" << sltk().substr(14);
  EXPECT_TRUE(import_rig(folder / "c.yaml", 0, 0).ok());
}

/// The first is one that fuzzing found: OpenCV's parser dereferences null.
TEST(RigImport, RefusesXmlThatOpenCvWouldNotWrite) {
  const TempFolder folder;
  const auto refusal = [&](const std::string& content) {
    std::ofstream(folder / "c.xml") << content;
    const auto rig = import_rig(folder / "c.xml", 1024, 768);
    return rig.ok() ? std::string("read") : rig.error().message;
  };
  const std::string head = "<?xml version=\"1.0\"?>\n<opencv_storage>";
  const std::string none = "no XML that OpenCV writes";
  EXPECT_THAT(refusal(found("calibration/xml_that_is_none")), HasSubstr(none));
  EXPECT_THAT(refusal(head + "<a>1</a></opencv_storage>\n"), HasSubstr("no calibration known here"));
  for (const char* rest :
       {"", "<a>", "</a>", "<a>1</b></opencv_storage>", "<a b=\"1\">1</a></opencv_storage>",
        "<1a>1</1a></opencv_storage>", "<a type_id=\"x>1</a></opencv_storage>", "1</opencv_storage>",
        "<a>&lt;</a></opencv_storage>", "<a>\xff</a></opencv_storage>",
        "</opencv_storage><opencv_storage></opencv_storage>", "<a/></opencv_storage>"})
    EXPECT_THAT(refusal(head + rest), HasSubstr(none)) << rest;
  EXPECT_THAT(refusal("<?xml version=\"1.0\"?>\n<b></b>"), HasSubstr(none));
}

TEST(RigImport, ProcamCalibrationIsRead) {
  const TempFolder folder;
  const auto matrix = [](const std::string& name, const std::string& rows, const std::string& cols,
                         const std::string& data) {
    return "<" + name + " type_id=\"opencv-matrix\">\n  <rows>" + rows + "</rows>\n  <cols>" + cols +
           "</cols>\n  <dt>d</dt>\n  <data>\n    " + data + "</data></" + name + ">\n";
  };
  const std::string lens = "2800. 0. 1500. 0. 2810. 1090. 0. 0. 1.", none = "0. 0. 0. 0. 0.";
  std::ofstream(folder / "c.xml") << "<?xml version=\"1.0\"?>\n<opencv_storage>\n"
                                  << matrix("img_shape", "1", "2", "1944. 2592.") << "<rms>0.8</rms>\n"
                                  << matrix("cam_int", "3", "3", lens) << matrix("cam_dist", "1", "5", none)
                                  << matrix("proj_int", "3", "3", lens) << matrix("proj_dist", "1", "5", none)
                                  << matrix("roration", "3", "3", "1. 0. 0. 0. 1. 0. 0. 0. 1.")
                                  << matrix("translation", "3", "1", "100. 0. 0.") << "</opencv_storage>\n";
  const auto rig = import_rig(folder / "c.xml", 1024, 768);
  ASSERT_TRUE(rig.ok()) << rig.error().message;
  EXPECT_EQ(rig->format, "procam-calibration");
  EXPECT_EQ(rig->stereo_rms, 0.8);
  EXPECT_EQ(rig->rig.camera.height, 1944);
  EXPECT_NEAR(rig->rig.projector_from_camera_translation[0], 0.1, 1e-12);
}

/// Each level would take of the parser's stack.
TEST(RigImport, RefusesNestingThatWouldExhaustTheParser) {
  const TempFolder folder;
  std::string xml = "<?xml version=\"1.0\"?>\n<opencv_storage>\n", list = "%YAML:1.0\n---\na: ";
  for (int i = 0; i < 100'000; ++i) {
    xml += "<a>";
    list += '[';
  }
  std::ofstream(folder / "c.xml") << xml;
  EXPECT_THAT(import_rig(folder / "c.xml", 0, 0).error().message, HasSubstr("nests too deep"));
  std::ofstream(folder / "c.yaml") << list;
  EXPECT_THAT(import_rig(folder / "c.yaml", 0, 0).error().message, HasSubstr("nests too deep"));
  EXPECT_THAT(read_rig_part(folder / "c.yaml").error().message, HasSubstr("nests too deep"));
}

/// OpenCV's own matrix reader takes the memory of what is declared, and writes as many sizes as there are
/// into room for 32.
TEST(RigImport, RefusesMatricesThatDeclareMoreThanTheyHold) {
  const TempFolder folder;
  std::string sizes = "sizes: [ 1";
  for (int i = 0; i < 5000; ++i) sizes += ", 1";
  for (const std::string& shape : {std::string("rows: 20000\n   cols: 20000\n   dt: d"),
                                   std::string("rows: 3\n   cols: 3\n   dt: \"512d\""),
                                   std::string("rows: -3\n   cols: -3\n   dt: d"), sizes + " ]\n   dt: d"}) {
    const std::string colours = "%YAML:1.0\n---\ncolour_matrix: !!opencv-matrix\n   " + shape +
                                "\n   data: [ 1., 0., 0., 0., 1., 0., 0., 0., 1. ]\n";
    std::ofstream(folder / "rig.yaml") << colours;
    EXPECT_THAT(read_rig_part(folder / "rig.yaml").error().message, HasSubstr("3 x 3")) << shape;
    std::string foreign = sltk();
    const std::string was = "T: !!opencv-matrix\n   rows: 3\n   cols: 1\n   dt: d\n";
    foreign.replace(foreign.find(was), was.size(), "T: !!opencv-matrix\n   " + shape + "\n");
    std::ofstream(folder / "c.yaml") << foreign;
    EXPECT_THAT(import_rig(folder / "c.yaml", 0, 0).error().message, HasSubstr("3 x 1")) << shape;
  }
}

/// What is imported becomes a rig.yaml, which must be one that is read again.
TEST(RigImport, RefusesWhatWouldBeNoRig) {
  const TempFolder folder;
  std::ofstream(folder / "c.yaml") << sltk("0., 0., 0.");
  EXPECT_THAT(import_rig(folder / "c.yaml", 0, 0).error().message, HasSubstr("depth needs a baseline"));
}

TEST(RigPart, ColoursThatAreNoNumbersAreRefused) {
  const TempFolder folder;
  std::ofstream(folder / "rig.yaml") << "%YAML:1.0\n---\n"
                                     << matrix("colour_matrix", 3, 3, "1., 0., 0., 0., .Nan, 0., 0., 0., 1.");
  EXPECT_THAT(read_rig_part(folder / "rig.yaml").error().message, HasSubstr("no finite number"));
}

TEST(RigPart, ColoursAloneReadBackExactly) {
  const TempFolder folder;
  const CameraColours colours{{1.25, -0.1, 1.0 / 3, 0, 1, 0, -1e-7, 0, 2}, 1 + 1.0 / 3};
  std::ofstream(folder / "rig.yaml") << to_yaml(RigPart{.colours = colours});
  const auto part = read_rig_part(folder / "rig.yaml");
  ASSERT_TRUE(part.ok()) << part.error().message;
  EXPECT_FALSE(part->whole);
  EXPECT_EQ(part->colours->matrix, colours.matrix);
  EXPECT_EQ(part->colours->gamma, colours.gamma);
  std::ofstream(folder / "empty.yaml") << "%YAML:1.0\n---\nscan: interlaced\n";
  EXPECT_THAT(read_rig_part(folder / "empty.yaml").error().message, HasSubstr("is no rig.yaml"));
}

}  // namespace
}  // namespace relievo
