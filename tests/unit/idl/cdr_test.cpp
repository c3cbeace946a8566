// SPDX-License-Identifier: Apache-2.0
// Samples as bytes: written here by hand from the XCDR rules, so that the reader is not checked against
// itself.
#include "idl/cdr.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <random>
#include <regex>

#include "base/filter_counts.h"
#include "base/rung.h"
#include "idl/transport.h"

namespace relievo {
namespace {

// XCDR version 2, little-endian: 8-byte values are aligned to 4.
class CdrWriter {
 public:
  template <typename T>
  CdrWriter& put(T value) {
    const std::size_t align = sizeof(T) < 4 ? sizeof(T) : 4;
    while (body_.size() % align != 0) body_.push_back(0);
    const auto* raw = reinterpret_cast<const std::uint8_t*>(&value);
    body_.insert(body_.end(), raw, raw + sizeof value);
    return *this;
  }
  CdrWriter& text(const std::string& value) {
    put(static_cast<std::uint32_t>(value.size() + 1));
    body_.insert(body_.end(), value.begin(), value.end());
    body_.push_back(0);
    return *this;
  }
  CdrWriter& octets(const Bytes& value) {
    put(static_cast<std::uint32_t>(value.size()));
    body_.insert(body_.end(), value.begin(), value.end());
    return *this;
  }
  /// As a top-level @appendable struct.
  Bytes finish() const {
    Bytes out = {0, 9, 0, 0};
    const auto size = static_cast<std::uint32_t>(body_.size());
    const auto* raw = reinterpret_cast<const std::uint8_t*>(&size);
    out.insert(out.end(), raw, raw + 4);
    out.insert(out.end(), body_.begin(), body_.end());
    return out;
  }

 private:
  Bytes body_;
};

CdrWriter frame(const std::string& stream = "face") {
  CdrWriter w;
  w.text(stream).put<std::uint64_t>(7).put<std::uint64_t>(15).put<std::int64_t>(100).put<std::int64_t>(200);
  w.octets({1, 2, 3, 4, 5});
  return w;
}

CdrWriter status(std::uint32_t state, double rate) {
  CdrWriter w;
  w.text("face").put<std::int64_t>(9).put(state).text("fine\x1b[2J").put(rate);
  for (std::uint64_t i = 1; i <= 6; ++i) w.put(i);
  return w.put(1.0).put(2.0).put(3.0);
}

TEST(Cdr, ReadsAFrame) {
  const Bytes bytes = frame().finish();
  const auto view = read_frame_cdr(bytes);
  ASSERT_TRUE(view.ok()) << view.error().message;
  EXPECT_EQ(view->stream, "face");
  EXPECT_EQ(view->sequence, 7u);
  EXPECT_EQ(view->number, 15u);
  EXPECT_EQ(view->capture_time_ns, 100);
  EXPECT_EQ(view->publish_time_ns, 200);
  EXPECT_EQ(Bytes(view->data.begin(), view->data.end()), (Bytes{1, 2, 3, 4, 5}));
}

/// The start of a frame of version 1 (codec/FORMAT.md).
CdrWriter frame_of_3d_video(std::uint8_t flags) {
  Bytes data{'R', 'L', 'V', 'F', 1, flags};
  data.resize(5000);
  CdrWriter w;
  w.text(std::string(64, 'n')).put<std::uint64_t>(7).put<std::uint64_t>(15);
  return w.put<std::int64_t>(100).put<std::int64_t>(200).octets(data);
}

TEST(Cdr, TellsAKeyFrameByItsStart) {
  const Bytes key = frame_of_3d_video(1).finish();
  const Bytes delta = frame_of_3d_video(0).finish();
  EXPECT_TRUE(holds_key_frame(key));
  EXPECT_TRUE(holds_key_frame(std::span(key).first(kFrameStartBytes)));
  EXPECT_FALSE(holds_key_frame(delta));
  EXPECT_FALSE(holds_key_frame(frame().finish())) << "no frame of 3D video";
  for (std::size_t size = 0; size < kFrameStartBytes; ++size) {
    const Bytes part(key.begin(), key.begin() + static_cast<std::ptrdiff_t>(size));  // exact, for asan
    EXPECT_TRUE(!holds_key_frame(part) || size > 64 + 64);
  }
}

TEST(Cdr, SkipsWhatANewerWriterAppended) {
  EXPECT_TRUE(read_frame_cdr(frame().put<std::uint64_t>(1).text("more").finish()).ok());
}

TEST(Cdr, RefusesEveryTruncationAndNeverReadsBeyond) {
  const Bytes whole = frame().finish();
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const Bytes part(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));  // exact, for asan
    EXPECT_FALSE(read_frame_cdr(part).ok()) << size;
  }
}

TEST(Cdr, RefusesHostileFields) {
  EXPECT_FALSE(read_frame_cdr(frame("../up").finish()).ok());
  EXPECT_FALSE(read_frame_cdr(frame(std::string(65, 'a')).finish()).ok());
  EXPECT_FALSE(read_frame_cdr(frame("").finish()).ok());
  Bytes big_endian = frame().finish();
  big_endian[1] = 8;
  EXPECT_FALSE(read_frame_cdr(big_endian).ok());
  Bytes long_text = frame().finish();
  std::memset(&long_text[8], 0xff, 4);
  EXPECT_FALSE(read_frame_cdr(long_text).ok());
  EXPECT_FALSE(read_status_cdr(status(4, 30).finish()).ok());
  EXPECT_FALSE(read_status_cdr(status(1, std::numeric_limits<double>::quiet_NaN()).finish()).ok());
  ASSERT_TRUE(read_status_cdr(status(1, 30).finish()).ok());
  EXPECT_FALSE(read_status_cdr(status(1, 30).put<std::uint32_t>(2).put<std::uint64_t>(1).finish()).ok());
}

TEST(Cdr, TextLosesControlCharacters) {
  EXPECT_EQ(read_status_cdr(status(1, 30).finish())->message, "fine?[2J");
}

TEST(Cdr, SurvivesRandomDamage) {
  std::mt19937 random(1);
  const Bytes good = frame().finish();
  for (int i = 0; i < 20000; ++i) {
    Bytes bad = good;
    for (int n = 0; n < 3; ++n) bad[random() % bad.size()] = static_cast<std::uint8_t>(random());
    (void)read_frame_cdr(bad).ok();
    (void)holds_key_frame(bad);
    (void)read_info_cdr(bad).ok();
    (void)read_status_cdr(bad).ok();
  }
}

// As a server of the first version wrote it, whose rig ends behind the colour matrix and whose pattern behind
// the stripes; with `appended`, as a later one did, and with `quality`, as one of today.
CdrWriter description(std::vector<std::uint32_t> appended, std::vector<double> quality = {}) {
  const auto pinhole = [](CdrWriter& w) {
    w.put<std::uint32_t>(2 * 4 + 14 * 8).put<std::uint32_t>(640).put<std::uint32_t>(480);
    for (int i = 0; i < 14; ++i) w.put<double>(i);
  };
  CdrWriter w;
  w.text("face").text("sim").put<std::int64_t>(9);
  const std::uint32_t more = appended.empty() ? 0 : 4;
  w.put<std::uint32_t>(4 + 8 + 2 * (4 + 2 * 4 + 14 * 8) + (9 + 3 + 9) * 8 + more +
                       8 * static_cast<std::uint32_t>(quality.size()));
  w.put<std::uint32_t>(0).put(29.97);
  pinhole(w);
  pinhole(w);
  for (int i = 0; i < 21; ++i) w.put<double>(i);
  if (more > 0) w.put(appended[0]);
  for (const double value : quality) w.put(value);
  w.put<std::uint32_t>(3 * 4 + 4 + 4 + 2 * 4 + more).put<std::uint32_t>(4).put<std::uint32_t>(2);
  w.octets({1, 2, 4, 7}).put<std::uint32_t>(2).put<std::uint32_t>(0).put<std::uint32_t>(15);
  if (more > 0) w.put(appended[1]);
  return w;
}

TEST(Cdr, ReadsADescriptionOfTheFirstVersion) {
  const auto info = read_info_cdr(description({}).finish());
  ASSERT_TRUE(info.ok()) << info.error().message;
  EXPECT_EQ(info->rig.field_order, FieldOrder::kTop);
  EXPECT_EQ(info->pattern.scheme, Scheme::kComplementary);
  EXPECT_EQ(info->pattern.sequence, (std::vector<int>{0, 15}));
}

TEST(Cdr, ReadsFieldOrderAndScheme) {
  const auto info = read_info_cdr(description({1, 2}).finish());
  ASSERT_TRUE(info.ok()) << info.error().message;
  EXPECT_EQ(info->rig.field_order, FieldOrder::kBottom);
  EXPECT_EQ(info->pattern.scheme, Scheme::kWhiteFrame);
  EXPECT_FALSE(read_info_cdr(description({2, 0}).finish()).ok());
  EXPECT_FALSE(read_info_cdr(description({0, 4}).finish()).ok());
  EXPECT_EQ(info->rig.stereo_rms_px, 0);
  EXPECT_EQ(info->rig.scale_error, 0);
}

TEST(Cdr, ReadsHowGoodTheRigIs) {
  const auto info = read_info_cdr(description({1, 2}, {0.25, 5e-4}).finish());
  ASSERT_TRUE(info.ok()) << info.error().message;
  EXPECT_EQ(info->rig.stereo_rms_px, 0.25);
  EXPECT_EQ(info->rig.scale_error, 5e-4);
  EXPECT_EQ(info->pattern.scheme, Scheme::kWhiteFrame);
  EXPECT_FALSE(read_info_cdr(description({1, 2}, {-0.25, 0}).finish()).ok());
  EXPECT_FALSE(
      read_info_cdr(description({1, 2}, {0, std::numeric_limits<double>::quiet_NaN()}).finish()).ok());
  EXPECT_FALSE(read_info_cdr(description({1, 2}, {0.25}).finish()).ok());
}

TEST(Cdr, ReadsWhereTheCameraStands) {
  const auto read = [](std::vector<double> pose) {
    pose.insert(pose.begin(), {0.25, 5e-4});
    return read_info_cdr(description({1, 2}, pose).finish());
  };
  const auto info = read({0, -1, 0, 1, 0, 0, 0, 0, 1, 1.5, -0.25, 2});
  ASSERT_TRUE(info.ok()) << info.error().message;
  ASSERT_TRUE(info->rig.world_from_camera);
  EXPECT_EQ(info->rig.world_from_camera->rotation, (std::array<double, 9>{0, -1, 0, 1, 0, 0, 0, 0, 1}));
  EXPECT_EQ(info->rig.world_from_camera->translation, (std::array<double, 3>{1.5, -0.25, 2}));
  EXPECT_EQ(info->pattern.scheme, Scheme::kWhiteFrame);
  EXPECT_FALSE(read({}).value().rig.world_from_camera);
  EXPECT_FALSE(read(std::vector<double>(12, 0)).value().rig.world_from_camera);  // not said
  EXPECT_FALSE(read({1, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0}).ok());
  EXPECT_FALSE(read({1, 0, 0, 0, 1, 0, 0, 0, -1, 0, 0, 0}).ok());
  EXPECT_FALSE(read({1, 0, 0, 0, 1, 0, 0, 0, 1}).ok());
  EXPECT_FALSE(read({1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, std::numeric_limits<double>::infinity()}).ok());
}

TEST(Cdr, ReadsTheCamerasGamma) {
  const auto read = [](std::vector<double> pose, std::vector<double> gamma) {
    pose.insert(pose.begin(), {0.25, 5e-4});
    pose.insert(pose.end(), gamma.begin(), gamma.end());
    return read_info_cdr(description({1, 2}, pose).finish());
  };
  const std::vector<double> placed{0, -1, 0, 1, 0, 0, 0, 0, 1, 1.5, -0.25, 2}, silent(12, 0);
  for (const auto& pose : {placed, silent}) {
    const auto said = read(pose, {2.2});
    ASSERT_TRUE(said.ok()) << said.error().message;
    EXPECT_EQ(said->rig.camera_gamma, 2.2);
    EXPECT_EQ(said->rig.world_from_camera.has_value(), pose == placed);
    EXPECT_EQ(said->pattern.scheme, Scheme::kWhiteFrame);
    EXPECT_EQ(read(pose, {}).value().rig.camera_gamma, 1) << "of a server that did not say it";
    EXPECT_EQ(read(pose, {0}).value().rig.camera_gamma, 1);
    EXPECT_EQ(read(pose, {3, 7}).value().rig.camera_gamma, 3) << "of one that says more";
  }
  for (const double impossible : {0.5, -1.0, 3.5, std::numeric_limits<double>::quiet_NaN()})
    EXPECT_FALSE(read(silent, {impossible}).ok()) << impossible;
}

TEST(Cdr, TheIdlNamesFiltersAndRungsAsTheyAreSent) {
  const std::string idl =
      std::regex_replace(std::string(topic_type(Topic::kStatus).idl), std::regex("\\s*\n *// "), " ");
  std::string filters = "did since the start: ";
  for (const Filter& filter : kFilters)
    filters += std::string(filter.name) + (&filter == &kFilters.back() ? "." : ", ");
  EXPECT_THAT(idl, testing::HasSubstr(filters));
  std::string rungs = "Rungs are ";
  for (std::size_t i = 1; i < kRungs.size(); ++i)
    rungs +=
        std::to_string(i) + " " + std::string(to_string(kRungs[i])) + (i + 1 == kRungs.size() ? "." : ", ");
  EXPECT_THAT(idl, testing::HasSubstr(rungs));
}

TEST(Cdr, SchemaIsTheWholeIdl) {
  using testing::HasSubstr;
  EXPECT_EQ(topic_type(Topic::kFrame).type_name, "relievo::Frame");
  EXPECT_THAT(topic_type(Topic::kFrame).idl,
              testing::AllOf(HasSubstr("module relievo {"), HasSubstr("struct Frame"),
                             HasSubstr("struct PinholeModel"), HasSubstr("};\n")));
}

}  // namespace
}  // namespace relievo
