// SPDX-License-Identifier: Apache-2.0
// rig.yaml and pattern.yaml: what is written is read back, and every listed error is refused by name.
#include "capture/rig_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "capture/field_order_file.h"
#include "small_take.h"

namespace relievo {
namespace {

using testing::HasSubstr;

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

/// The text of `yaml` without `key` and the indented lines below it.
std::string without_key(const std::string& yaml, const std::string& key) {
  const std::size_t begin = yaml.find("\n" + key + ":") + 1;
  std::size_t end = yaml.find('\n', begin) + 1;
  while (end < yaml.size() && yaml[end] == ' ') end = yaml.find('\n', end) + 1;
  return yaml.substr(0, begin) + yaml.substr(end);
}

TEST(RigFile, ReadsBackTheSameDoubles) {
  test::TempFolder folder;
  for (const Scan scan : {Scan::kInterlaced, Scan::kProgressive}) {
    Rig rig = test::small_rig(scan);
    rig.camera.distortion = {-0.1 / 3, 0.02, 1e-4, -1e-5, 1.0 / 7};
    rig.camera.matrix[0] = 1050.0 / 7;
    const auto file = folder.path() / "rig.yaml";
    test::write_text(file, to_yaml(rig));
    const Result<Rig> read = read_rig(file);
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_EQ(read->scan, rig.scan);
    EXPECT_EQ(read->frame_rate, rig.frame_rate);
    EXPECT_EQ(read->camera.matrix, rig.camera.matrix);
    EXPECT_EQ(read->camera.distortion, rig.camera.distortion);
    EXPECT_EQ(read->projector.width, rig.projector.width);
    EXPECT_EQ(read->projector_from_camera_rotation, rig.projector_from_camera_rotation);
    EXPECT_EQ(read->projector_from_camera_translation, rig.projector_from_camera_translation);
    EXPECT_EQ(read->colour_matrix, rig.colour_matrix);
  }
}

TEST(RigFile, EveryMissingKeyIsNamed) {
  test::TempFolder folder;
  const auto file = folder.path() / "rig.yaml";
  const std::string good = to_yaml(test::small_rig(Scan::kInterlaced));
  for (const char* key :
       {"scan", "frame_rate", "camera_width", "camera_height", "camera_matrix", "camera_distortion",
        "projector_width", "projector_height", "projector_matrix", "projector_distortion",
        "projector_from_camera_rotation", "projector_from_camera_translation", "colour_matrix"}) {
    test::write_text(file, without_key(good, key));
    const Result<Rig> rig = read_rig(file);
    ASSERT_FALSE(rig) << key;
    EXPECT_EQ(rig.error().message, file.string() + ": key " + key + " is missing");
  }
}

struct Refusal {
  const char* from;
  const char* to;
  const char* message;
};

TEST(RigFile, RefusesWhatIsMisshapenOrOutOfRange) {
  test::TempFolder folder;
  const auto file = folder.path() / "rig.yaml";
  const std::string good = to_yaml(test::small_rig(Scan::kInterlaced));
  const Refusal refusals[] = {
      {"scan: interlaced", "scan: woven", "scan must be interlaced or progressive"},
      {"frame_rate: 29.969999999999999", "frame_rate: fast", "frame_rate must be a number"},
      {"frame_rate: 29.969999999999999", "frame_rate: 0.0", "frame_rate is 0"},
      {"frame_rate: 29.969999999999999", "frame_rate: .Nan", "must be 0.001 to 10000"},
      {"camera_width: 32", "camera_width: -32", "camera_width is -32"},
      {"camera_width: 32", "camera_width: 32.5", "camera_width is 32.5, must be a whole number"},
      {"projector_height: 48", "projector_height: 1000000", "projector_height is 1e+06"},
      {"data: [ 50.0", "data: [ 0.0", "camera_matrix has a focal length"},
      {"data: [ 50.0", "data: [ 1.0", "camera_matrix has a focal length that is not above a pixel"},
      {"data: [ 50.0", "data: [ 1e6", "camera_matrix holds 1e+06, must be below a million"},
      {"data: [ -0.2", "data: [ -2000000.2",
       "projector_from_camera_translation, metres, holds -2e+06, must be below a million"},
      {"data: [ 50.0, 0.0", "data: [ 50.0, 3.0", "camera_matrix must be [fx 0 cx; 0 fy cy; 0 0 1]"},
      {"data: [ 50.0", "data: [ .Inf", "camera_matrix holds a value that is no finite number"},
      {"rows: 3", "rows: 2", "camera_matrix is 2 x 3, must be 3 x 3"},
      {"rows: 3", "rows: 1000000000", "camera_matrix is 1000000000 x 3"},
      {"camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 50.0, ",
       "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ ",
       "camera_matrix must be a 3 x 3 !!opencv-matrix"},
      {"data: [ 1.0, 0.0, 0.0, 0.0, 1.0", "data: [ 1.0, 0.5, 0.0, 0.0, 1.0",
       "projector_from_camera_rotation is no rotation"},
      {"data: [ 1.0, 0.0, 0.0, 0.0, 1.0", "data: [ -1.0, 0.0, 0.0, 0.0, 1.0",
       "projector_from_camera_rotation is no rotation"},
      {"data: [ -0.2", "data: [ 0.0", "projector_from_camera_translation is zero"},
      {"%YAML", "YAML", "is no OpenCV YAML file"},
      {"scan: interlaced", "scan: [ interlaced", "is no valid YAML"},
  };
  for (const Refusal& refusal : refusals) {
    test::write_text(file, replaced(good, refusal.from, refusal.to));
    const Result<Rig> rig = read_rig(file);
    ASSERT_FALSE(rig) << refusal.to;
    EXPECT_THAT(rig.error().message, HasSubstr(file.string()));
    EXPECT_THAT(rig.error().message, HasSubstr(refusal.message));
    EXPECT_EQ(rig.error().message.find('\n'), std::string::npos) << rig.error().message;
  }
  Rig flat = test::small_rig(Scan::kInterlaced);
  flat.colour_matrix = {1, 2, 3, 2, 4, 6, 0, 0, 1};
  test::write_text(file, to_yaml(flat));
  const Result<Rig> rig = read_rig(file);
  ASSERT_FALSE(rig);
  EXPECT_THAT(rig.error().message, HasSubstr("colour_matrix is singular"));
}

TEST(RigFile, RefusesFilesThatAreNone) {
  test::TempFolder folder;
  EXPECT_THAT(read_rig(folder.path() / "rig.yaml").error().message, HasSubstr("rig.yaml is missing"));
  ASSERT_EQ(mkfifo((folder.path() / "pipe").c_str(), 0600), 0);
  EXPECT_THAT(read_rig(folder.path() / "pipe").error().message, HasSubstr("it is a pipe"));
  for (const std::string& content : {std::string(), std::string("%YAML:1.0"), std::string("%YAML:1.0\n---\n"),
                                     std::string(3000, 'x'), std::string("%YAML:1.0\n---\n\x01\x02{{{{[[[["),
                                     std::string("%YAML:1.0\n---\nscan: !!binary |\n  @@@\n")}) {
    test::write_text(folder.path() / "rig.yaml", content);
    EXPECT_FALSE(read_rig(folder.path() / "rig.yaml")) << content;
  }
}

/// OpenCV's parser never comes back from what is behind the end of a document and begins with a dash.
TEST(RigFile, RefusesWhatTheParserWouldNeverEndAt) {
  test::TempFolder folder;
  const auto file = folder.path() / "rig.yaml";
  for (const std::string& content :
       {std::string("%YAML:1.0\n---ML:1.0\n---\n--\n"), std::string("%YAML:1.0\n---\na: 1\n---\n--\n"),
        std::string("%YAML:1.0\n---\na: 1\n...\n--\n"), std::string("%YAML:1.0\n---\n  a: 1\nabc-: 1\n"),
        std::string("%YAML:1.0\n---\n{a: 1}abc-\n"), std::string("%YAML:1.0\n---\n- 1\nabc-\n"),
        std::string("%YAML:1.0\n---\na: 1\n\0---\n--\n", 26)}) {
    test::write_text(file, content);
    const Result<Rig> rig = read_rig(file);
    ASSERT_FALSE(rig) << content;
    EXPECT_THAT(rig.error().message, HasSubstr("it must be one map")) << content;
  }
}

TEST(RigFile, ReadsWhatPeopleWrite) {
  test::TempFolder folder;
  const auto file = folder.path() / "rig.yaml";
  const std::string good = to_yaml(test::small_rig(Scan::kInterlaced));
  for (const std::string& content :
       {"%YAML:1.0\n# a rig\n---\n\n# of ours\n" + good.substr(good.find("---") + 4), good + "...\n\n",
        good + "# and no more\n", replaced(good, "---\n", "")}) {
    test::write_text(file, content);
    const Result<Rig> rig = read_rig(file);
    EXPECT_TRUE(rig) << (rig ? "" : rig.error().message) << "\n" << content;
  }
}

TEST(RigFile, RefusesNestingThatWouldExhaustTheParser) {
  test::TempFolder folder;
  const auto file = folder.path() / "rig.yaml";
  for (const std::string level : {"[", "{a: ", "- "}) {
    std::string text = "%YAML:1.0\n---\nscan: ";
    for (int i = 0; i < 200'000; ++i) text += level;
    test::write_text(file, text + "\n");
    const Result<Rig> rig = read_rig(file);
    ASSERT_FALSE(rig) << level;
    EXPECT_THAT(rig.error().message, HasSubstr("nests too deep"));
  }
}

TEST(RigFile, CommentsNestNothing) {
  test::TempFolder folder;
  const auto file = folder.path() / "pattern.yaml";
  const std::string text = to_yaml(test::small_pattern());
  const std::string head = "%YAML:1.0\n---\n";
  ASSERT_TRUE(text.starts_with(head));
  const std::string ruler = "# " + std::string(60, '-') + "\n # " + std::string(60, '[') + "\n";
  test::write_text(file, head + ruler + text.substr(head.size()));
  const Result<Pattern> read = read_pattern(file);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->stripes(), test::small_pattern().stripes());
}

TEST(PatternFile, ReadsBack) {
  test::TempFolder folder;
  const auto file = folder.path() / "pattern.yaml";
  const Pattern one_slide{3, 1, {1, 2, 4}, {0, 1, 2, 0, 2, 1, 0}};  // all six arcs of b = 3, s = 1
  for (const Pattern& pattern : {test::small_pattern(), one_slide}) {
    test::write_text(file, to_yaml(pattern));
    const Result<Pattern> read = read_pattern(file);
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_EQ(read->base, pattern.base);
    EXPECT_EQ(read->slides, pattern.slides);
    EXPECT_EQ(read->palette, pattern.palette);
    EXPECT_EQ(read->sequence, pattern.sequence);
  }
}

TEST(RigFile, FieldOrderIsTopUnlessItSaysOtherwise) {
  test::TempFolder folder;
  const auto file = folder.path() / "rig.yaml";
  Rig rig = test::small_rig(Scan::kInterlaced);
  EXPECT_EQ(to_yaml(rig).find("field_order"), std::string::npos);
  for (const FieldOrder order : {FieldOrder::kTop, FieldOrder::kBottom}) {
    rig.field_order = order;
    test::write_text(file, to_yaml(rig));
    const Result<Rig> read = read_rig(file);
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_EQ(read->field_order, order);
  }
  test::write_text(file, replaced(to_yaml(rig), "field_order: bottom", "field_order: odd"));
  const Result<Rig> read = read_rig(file);
  ASSERT_FALSE(read);
  EXPECT_THAT(read.error().message, HasSubstr("field_order must be top or bottom"));
}

TEST(RigFile, ItsFieldOrderIsStatedOrNot) {
  const test::TempFolder folder;
  const auto file = folder.path() / "rig.yaml", other = folder.path() / "other.yaml";
  Rig rig = test::small_rig(Scan::kInterlaced);
  test::write_text(file, to_yaml(rig));
  EXPECT_FALSE(states_field_order(file));
  EXPECT_EQ(keeping_field_order(to_yaml(rig), file), to_yaml(rig));
  EXPECT_FALSE(states_field_order(folder.path() / "none.yaml"));
  const std::string stated = with_field_order(to_yaml(rig), rig);
  test::write_text(other, stated);
  EXPECT_TRUE(states_field_order(other));
  EXPECT_EQ(read_rig(other)->field_order, FieldOrder::kTop);
  EXPECT_EQ(keeping_field_order(to_yaml(rig), other), stated);
  rig.field_order = FieldOrder::kBottom;
  EXPECT_EQ(keeping_field_order(to_yaml(rig), other), to_yaml(rig)) << "what is newly said holds";
  rig.scan = Scan::kProgressive;
  rig.field_order = FieldOrder::kTop;
  EXPECT_EQ(with_field_order(to_yaml(rig), rig), to_yaml(rig));
}

TEST(RigFile, SaysHowGoodItsCalibrationFoundItWhereThatIsKnown) {
  test::TempFolder folder;
  const auto file = folder.path() / "rig.yaml";
  Rig rig = test::small_rig(Scan::kInterlaced);
  const std::string without = to_yaml(rig);
  EXPECT_THAT(without, testing::Not(testing::AnyOf(HasSubstr("stereo_rms_px"), HasSubstr("scale_error"))));
  test::write_text(file, without);
  Result<Rig> read = read_rig(file);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(to_yaml(*read), without);

  rig.stereo_rms_px = 1.0 / 7;
  rig.scale_error = 3e-4;
  test::write_text(file, to_yaml(rig));
  read = read_rig(file);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->stereo_rms_px, rig.stereo_rms_px);
  EXPECT_EQ(read->scale_error, rig.scale_error);

  for (const auto& [key, wrong] : {std::pair("stereo_rms_px", "-0.5"), std::pair("scale_error", "30.0")}) {
    test::write_text(file, without + key + ": " + wrong + "\n");
    read = read_rig(file);
    ASSERT_FALSE(read) << key;
    EXPECT_THAT(read.error().message, HasSubstr(std::string(key) + " is "));
  }
}

TEST(RigFile, AStraightCameraIsNotSaidToBeOne) {
  test::TempFolder folder;
  const auto file = folder.path() / "rig.yaml";
  Rig rig = test::small_rig(Scan::kInterlaced);
  const std::string without = to_yaml(rig);
  EXPECT_EQ(without.find("camera_gamma"), std::string::npos);
  rig.camera_gamma = 2 + 1.0 / 7;
  test::write_text(file, to_yaml(rig));
  const Result<Rig> read = read_rig(file);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->camera_gamma, rig.camera_gamma);
  for (const char* wrong : {"0.45", "5", "sRGB", ".Nan"}) {
    test::write_text(file, without + "camera_gamma: " + wrong + "\n");
    const Result<Rig> refused = read_rig(file);
    ASSERT_FALSE(refused) << wrong;
    EXPECT_THAT(refused.error().message, HasSubstr("camera_gamma"));
  }
}

TEST(RigFile, SaysWhereItsCameraStandsWhereThatIsKnown) {
  test::TempFolder folder;
  const auto file = folder.path() / "rig.yaml";
  Rig rig = test::small_rig(Scan::kInterlaced);
  const std::string without = to_yaml(rig);
  EXPECT_THAT(without, testing::Not(HasSubstr("world_from_camera")));
  test::write_text(file, without);
  EXPECT_FALSE(read_rig(file).value().world_from_camera);

  rig.world_from_camera = {.rotation = {0, -1, 0, 1, 0, 0, 0, 0, 1}, .translation = {1.0 / 3, -0.25, 2}};
  const std::string with = to_yaml(rig);
  test::write_text(file, with);
  Result<Rig> read = read_rig(file);
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_TRUE(read->world_from_camera);
  EXPECT_EQ(read->world_from_camera->rotation, rig.world_from_camera->rotation);
  EXPECT_EQ(read->world_from_camera->translation, rig.world_from_camera->translation);

  test::write_text(file, with.substr(0, with.find("world_from_camera_translation")));
  read = read_rig(file);
  ASSERT_FALSE(read);
  EXPECT_THAT(read.error().message, HasSubstr("world_from_camera_translation is missing"));
  rig.world_from_camera->rotation[8] = -1;
  test::write_text(file, to_yaml(rig));
  read = read_rig(file);
  ASSERT_FALSE(read);
  EXPECT_THAT(read.error().message, HasSubstr("world_from_camera_rotation is no rotation"));
}

TEST(PatternFile, SchemeIsComplementaryUnlessItSaysOtherwise) {
  test::TempFolder folder;
  const auto file = folder.path() / "pattern.yaml";
  Pattern pattern{3, 1, {1, 2, 4}, {0, 1, 2, 0}};
  EXPECT_EQ(to_yaml(pattern).find("scheme"), std::string::npos);
  for (const Scheme scheme :
       {Scheme::kComplementary, Scheme::kWhiteField, Scheme::kWhiteFrame, Scheme::kOneSlide}) {
    pattern.scheme = scheme;
    test::write_text(file, to_yaml(pattern));
    const Result<Pattern> read = read_pattern(file);
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_EQ(read->scheme, scheme);
    EXPECT_EQ(read->sequence, pattern.sequence);
  }
  test::write_text(file, replaced(to_yaml(pattern), "one-slide", "striped"));
  const Result<Pattern> read = read_pattern(file);
  ASSERT_FALSE(read);
  EXPECT_THAT(read.error().message,
              HasSubstr("scheme must be complementary, white-field, white-frame or one-slide"));
}

TEST(PatternFile, RefusesByName) {
  test::TempFolder folder;
  const auto file = folder.path() / "pattern.yaml";
  const std::string good = to_yaml(test::small_pattern());
  for (const char* key : {"base", "slides", "palette", "sequence"}) {
    test::write_text(file, without_key(good, key));
    EXPECT_EQ(read_pattern(file).error().message, file.string() + ": key " + key + " is missing");
  }
  const Refusal refusals[] = {
      {"base: 6", "base: 2", "base is 2"},
      {"base: 6", "base: 5", "palette has 6 colours, base 5 needs 5"},
      {"slides: 2", "slides: 0", "slides is 0"},
      {"\"100\"", "100", "palette colour 0 must be a quoted string"},
      {"\"100\"", "\"120\"", "palette colour 0 must be a quoted string"},
      {"\"010\"", "\"111\"", "palette colour 1 is white"},
      {"\"001\"", "\"000\"", "palette colour 2 is black"},
      {"\"001\"", "\"010\"", "palette colour 2 repeats colour 1"},
      {"[ 0, 7,", "[ 0, x,", "sequence stripe 1 must be a whole number"},
      {"[ 0, 7,", "[ 0, 36,", "sequence stripe 1 is 36, must be 0 to 35"},
      {"[ 0, 7,", "[ 0, 5,", "sequence stripes 0 and 1 share colour 0 on slide 1"},
      {"[ 0, 7,", "[ 0, 6,", "sequence stripes 0 and 1 share colour 0 on slide 2"},
      {"35, 0, 8", "35, 0, 7", "boundary 6 repeats the code 00|11 of boundary 0"},
      {"sequence: [ 0, 7, 14, 21, 28, 35, 0, 8, 15 ]", "sequence: [ 0 ]", "must have 2 or more"},
      {"sequence: [ 0, 7, 14, 21, 28, 35, 0, 8, 15 ]", "sequence: 3", "sequence must be a list"},
  };
  for (const Refusal& refusal : refusals) {
    test::write_text(file, replaced(good, refusal.from, refusal.to));
    const Result<Pattern> pattern = read_pattern(file);
    ASSERT_FALSE(pattern) << refusal.to;
    EXPECT_THAT(pattern.error().message, HasSubstr(file.string()));
    EXPECT_THAT(pattern.error().message, HasSubstr(refusal.message));
  }
}

}  // namespace
}  // namespace relievo
