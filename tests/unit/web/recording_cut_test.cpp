// SPDX-License-Identifier: Apache-2.0
// Proves: a recording that a crash cut short, or that was written over, is listed and read as what it is,
// also by who followed it before.
#include <gmock/gmock.h>

#include "tests/unit/web/recording_fixture.h"

namespace relievo::test {
namespace {

using testing::StartsWith;

TEST_F(RecordingApi, WhatACrashCutShortIsListedSoAndNoCacheKeepsIt) {
  const auto cut = [&](const std::string& file) {
    const Json all = list();
    for (const Json& one : all["recordings"])
      if (one["file"] == file) return one["cut"];
    return Json();
  };
  const auto kept = [&](const std::string& file) {
    return request(port, "GET", "/recordings/" + file).headers.at("cache-control");
  };
  ASSERT_EQ(post_json(port, kFace, kStart).status, 200);
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(control.grow());
  EXPECT_EQ(cut("face-1.mcap"), false) << "it is being written";
  ASSERT_EQ(post_json(port, kFace, kStop).status, 200);
  const std::string content = content_of(folder / "face-1.mcap");
  EXPECT_EQ(cut("face-1.mcap"), false);
  EXPECT_EQ(kept("face-1.mcap"), "max-age=0, s-maxage=300");
  const std::size_t nothing_whole = content.find(std::string(100, 7)) + 100;
  for (const std::size_t bytes :
       {std::size_t{0}, std::size_t{8}, nothing_whole, content.size() / 2, content.size() - 1}) {
    std::ofstream(folder / "cut.mcap", std::ios::binary) << content.substr(0, bytes);
    EXPECT_EQ(cut("cut.mcap"), bytes > nothing_whole ? Json(true) : Json()) << bytes;
    EXPECT_EQ(kept("cut.mcap"), "no-cache") << bytes;
    EXPECT_EQ(request(port, "GET", "/recordings/cut.mcap").body, content.substr(0, bytes));
  }
  std::ofstream(folder / "cut.mcap", std::ios::binary) << "no recording at all";
  EXPECT_EQ(cut("cut.mcap"), true) << "damaged, perhaps";
  std::ofstream(folder / "cut.mcap", std::ios::binary) << content;
  EXPECT_EQ(cut("cut.mcap"), false) << "mended";
  EXPECT_EQ(kept("cut.mcap"), "max-age=0, s-maxage=300");
}

TEST_F(RecordingApi, WhatACrashCutShortIsReadWithAnIndexThatIsNotInIt) {
  ASSERT_EQ(post_json(port, kFace, kStart).status, 200);
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(control.grow());
  ASSERT_EQ(post_json(port, kFace, kStop).status, 200);
  const std::string content = content_of(folder / "face-1.mcap");
  const std::string cut = content.substr(0, content.size() / 2);
  const auto left = [&](std::chrono::seconds ago) {
    std::filesystem::last_write_time(folder / "cut.mcap",
                                     std::filesystem::file_time_type::clock::now() - ago);
  };
  const auto get_cut = [&](const std::string& headers = {}) {
    return request(port, "GET", "/recordings/cut.mcap", headers);
  };
  std::ofstream(folder / "cut.mcap", std::ios::binary) << cut;
  EXPECT_EQ(get_cut().body, cut) << "another program may be writing it";
  left(10s);
  const auto got = get_cut();
  ASSERT_EQ(got.status, 200);
  const std::uint64_t messages = messages_in(got.body);
  EXPECT_GE(messages, 1u);
  EXPECT_LT(messages, 5u);
  EXPECT_EQ(content_of(folder / "cut.mcap"), cut) << "it was written to";
  EXPECT_EQ(got.headers.at("cache-control"), "no-cache");
  EXPECT_THAT(got.headers.at("etag"), StartsWith("\"cut-"));
  const std::string same = "If-Range: " + got.headers.at("etag") + "\r\n";
  std::string parts;
  while (parts.size() < got.body.size()) {
    const auto part = get_cut("Range: bytes=" + std::to_string(parts.size()) + "-" +
                              std::to_string(parts.size() + 499) + "\r\n" + same);
    ASSERT_EQ(part.status, 206);
    parts += part.body;
  }
  EXPECT_EQ(parts, got.body);
  EXPECT_EQ(get_cut("If-None-Match: " + got.headers.at("etag") + "\r\n").status, 304);

  std::ofstream(folder / "cut.mcap", std::ios::binary) << content;
  left(10s);
  EXPECT_EQ(get_cut("Range: bytes=0-9\r\n" + same).body, content) << "mended, it is another";
  std::ofstream(folder / "cut.mcap", std::ios::binary) << "no recording at all";
  left(10s);
  EXPECT_EQ(get_cut().body, "no recording at all");
}

// Of a server that was killed and is there again: until it is clear that nobody writes the file.
TEST_F(RecordingApi, WhoFollowedWhatACrashCutShortGoesOnAtOnce) {
  ASSERT_EQ(post_json(port, kFace, kStart).status, 200);
  ASSERT_TRUE(control.grow());
  const auto had = request(port, "GET", "/recordings/face-1.mcap");
  ASSERT_THAT(had.headers.at("etag"), StartsWith("\"growing-"));
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(control.grow());
  ASSERT_EQ(post_json(port, kFace, kStop).status, 200);
  const std::string content = content_of(folder / "face-1.mcap");
  std::filesystem::resize_file(folder / "face-1.mcap", end_of_data(content) - 10);
  const auto got =
      request(port, "GET", "/recordings/face-1.mcap", new_since(had.body, had.headers.at("etag")));
  ASSERT_EQ(got.status, 206);
  EXPECT_THAT(got.headers.at("etag"), StartsWith("\"growing-"));
  const std::string now = had.body.substr(0, end_of_data(had.body)) + got.body;
  EXPECT_GT(messages_in(now), messages_in(had.body)) << "it has an index";
}

// As many bytes, so that its chunks lie where those of the one before it did.
class WrittenOver : public RecordingApi, public testing::WithParamInterface<bool> {};
INSTANTIATE_TEST_SUITE_P(ByItsWriter, WrittenOver, testing::Bool(), [](const auto& param) {
  return std::string(param.param ? "Remembered" : "Forgotten");
});
TEST_P(WrittenOver, WhoFollowedAFileHasNoPartOfAnother) {
  ASSERT_EQ(post_json(port, kFace, kStart).status, 200);
  ASSERT_TRUE(control.grow());
  const auto had = get();
  const std::string etag = had.headers.at("etag");
  ASSERT_TRUE(control.grow());
  ASSERT_EQ(post_json(port, kFace, kStop).status, 200);
  if (!GetParam()) control.has_just_begun();  // nobody knows any more how it grew
  EXPECT_EQ(get("Range: bytes=0-9\r\nIf-Range: " + etag + "\r\n").status, 206);
  EXPECT_EQ(get(new_since(had.body, etag)).status, 206);

  const TempFolder elsewhere;
  OneStream later(elsewhere.path());
  later.starts_at(1000);
  ASSERT_TRUE(later.start("face"));
  ASSERT_TRUE(later.grow());
  ASSERT_TRUE(later.grow());
  ASSERT_TRUE(later.stop("face"));
  const std::string other = content_of(elsewhere / "face-1.mcap");
  ASSERT_EQ(other.size(), content_of(folder / "face-1.mcap").size());
  std::fstream(folder / "face-1.mcap", std::ios::binary | std::ios::in | std::ios::out) << other;
  for (const std::string& asked :
       {"Range: bytes=0-9\r\nIf-Range: " + etag + "\r\n", new_since(had.body, etag)}) {
    const auto got = get(asked);
    EXPECT_EQ(got.status, 200) << asked;
    EXPECT_TRUE(got.body == other) << asked;
  }
}

}  // namespace
}  // namespace relievo::test
