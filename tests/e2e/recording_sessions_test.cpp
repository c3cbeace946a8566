// SPDX-License-Identifier: Apache-2.0
// A recording of two sessions of a server, whose rigs differ, told of, played and made into something else.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <mutex>

#include "codec/frame3d_codec.h"
#include "idl/transport.h"
#include "tests/e2e/record_play.h"
#include "tests/support/temp_folder.h"

namespace relievo::test {
namespace {

using testing::HasSubstr;

/// A recording of two sessions of one server, whose rigs differ: a restart that a recorder goes on over.
std::filesystem::path record_two_sessions(const TempFolder& folder) {
  const auto both = folder / "both.mcap";
  std::ofstream out(both, std::ios::binary);
  for (const std::string source : {"sim:plane,width=160,height=120,stripes=30",
                                   "sim:plane,width=192,height=144,stripes=30,baseline=0.8"}) {
    const std::string part = folder / "part.mcap";
    std::filesystem::remove(part);
    const auto served =
        run({program("relievo-server"), "serve", "--source", source, "--stream", "s", "--web", "none",
             "--domain", kDomain, "--interface", "lo", "--fast", "--frames", "8", "--record", part});
    EXPECT_EQ(served.status, 0) << served.err;
    out << std::ifstream(part, std::ios::binary).rdbuf();
  }
  return both;
}

std::vector<Frame3D> decoded(const std::filesystem::path& file) {
  std::vector<Frame3D> out;
  FrameDecoder decoder;
  for (const Bytes& cdr : recorded_frames(file)) {
    auto frame = decoder.decode(read_frame_cdr(cdr)->data);
    EXPECT_TRUE(frame.ok()) << (frame ? "" : frame.error().message);
    if (frame) out.push_back(*std::move(frame));
  }
  return out;
}

/// Of what two frames have in the same places.
float largest_error_m(const Frame3D& a, const Frame3D& b) {
  EXPECT_EQ(a.surface.positions.size(), b.surface.positions.size());
  float largest = 0;
  for (std::size_t i = 0; i < std::min(a.surface.positions.size(), b.surface.positions.size()); ++i)
    for (std::size_t axis = 0; axis < 3; ++axis)
      largest = std::max(largest, std::abs(a.surface.positions[i][axis] - b.surface.positions[i][axis]));
  return largest;
}

TEST(RecordingSessions, EachSessionIsConvertedByItsOwnCalibration) {
  const TempFolder folder;
  const auto both = record_two_sessions(folder);
  const auto before = decoded(both);
  ASSERT_GT(before.size(), 12u);
  const auto convert = [&](const char* to, std::vector<std::string> more) {
    more.insert(more.begin(), {program("relievo"), "convert", both, "--out", folder / to});
    const auto done = run(more);
    EXPECT_EQ(done.status, 0) << done.err;
    return decoded(folder / to);
  };
  const auto after = convert("grid.mcap", {"--geometry", "grid", "--step-bits", "8"});
  ASSERT_EQ(after.size(), before.size());
  for (std::size_t i = 0; i < after.size(); ++i) EXPECT_LT(largest_error_m(before[i], after[i]), 2e-4F) << i;

  const auto later = std::to_string(before.size() - 3) + ":";
  EXPECT_EQ(convert("later.mcap", {"--frames", later}).size(), 3u);
  for (const char* file : {"later.mcap", "grid.mcap"}) {
    const auto of_second = info(folder / file);
    EXPECT_EQ(
        of_second["info"]["rig"]["camera"]["size"],
        nlohmann::json(file == std::string("later.mcap") ? std::vector{192, 144} : std::vector{160, 120}));
  }
}

TEST(RecordingSessions, InfoDescribesEachSession) {
  const TempFolder folder;
  const auto both = record_two_sessions(folder);
  const auto said = info(both);
  ASSERT_EQ(said["sessions"].size(), 2u) << said;
  EXPECT_EQ(said["sessions"][0]["rig"], said["info"]["rig"]);
  EXPECT_EQ(said["sessions"][0]["rig"]["camera"]["size"], nlohmann::json({160, 120}));
  EXPECT_EQ(said["sessions"][1]["rig"]["camera"]["size"], nlohmann::json({192, 144}));
  EXPECT_EQ(said["sessions"][0]["start_s"], 0.0);
  EXPECT_GT(said["sessions"][1]["start_s"], 0.0);
  EXPECT_EQ(said["sessions"][0]["frames"].get<int>() + said["sessions"][1]["frames"].get<int>(),
            said["frames"]);
  EXPECT_GE(said["sessions"][1]["frames"], 6);
  const auto text = run({program("relievo"), "info", both});
  for (const char* part : {"session 1   from 0.000 s on, ", "session 2   from ", "160 x 120", "192 x 144"})
    EXPECT_THAT(text.out, HasSubstr(part));
}

TEST(RecordingSessions, WhatIsPlayedIsDescribedAsItsSessionWas) {
  const TempFolder folder;
  const auto both = record_two_sessions(folder);
  const auto count = info(both)["frames"].get<std::size_t>();
  const auto widths_played = [&](const std::vector<std::string>& more) {
    std::vector<int> widths;
    std::mutex mutex;
    {
      Subscriber::Callbacks callbacks;
      callbacks.info = [&](const StreamInfo& played) {
        const std::lock_guard lock(mutex);
        const int width = played.rig.camera.width;
        if (widths.empty() || widths.back() != width) widths.push_back(width);
      };
      callbacks.frame = [](const std::string&, const FrameMessage&) {};  // what is waited for
      const auto subscriber = Subscriber::create({own_domain(), "lo"}, "s", callbacks);
      EXPECT_TRUE(subscriber.ok());
      std::vector<std::string> words{"play", both, "--wait-readers", "1"};
      words.insert(words.end(), more.begin(), more.end());
      const auto done = run(on_loopback(words));
      EXPECT_EQ(done.status, 0) << done.err;
    }
    return widths;
  };
  EXPECT_EQ(widths_played({}), (std::vector{160, 192}));
  EXPECT_EQ(widths_played({"--frames", std::to_string(count - 3) + ":"}), std::vector{192})
      << "the first session's is of another camera";
}

TEST(RecordingSessions, TheRecordingIsNotWrittenOver) {
  const TempFolder folder;
  const std::filesystem::path recorded = record_two_sessions(folder);
  const std::string file = folder / "both.glb", picture = folder / "both.png";
  std::filesystem::copy_file(recorded, picture);
  std::filesystem::rename(recorded, file);
  const auto size = std::filesystem::file_size(file);
  for (const std::vector<std::string>& how :
       std::vector<std::vector<std::string>>{{"export", file, "--format", "animation"}, {"shot", picture}}) {
    auto words = how;
    words.insert(words.begin(), program("relievo"));
    words.insert(words.end(), {"--out", how[1]});
    const auto done = run(words);
    EXPECT_EQ(done.status, 1);
    EXPECT_THAT(done.err, HasSubstr("is the recording itself"));
    EXPECT_EQ(std::filesystem::file_size(how[1]), size);
  }
  const auto animation =
      run({program("relievo"), "export", file, "--format", "animation", "--out", folder / "a.glb"});
  EXPECT_EQ(animation.status, 0) << animation.err;
}

TEST(RecordingSessions, DepthIsOfOneCamera) {
  const TempFolder folder;
  const auto both = record_two_sessions(folder);
  const auto depth = [&](std::vector<std::string> more) {
    more.insert(more.begin(),
                {program("relievo"), "export", both, "--format", "depth", "--out", folder / "d"});
    return run(more);
  };
  const auto refused = depth({});
  EXPECT_EQ(refused.status, 1);
  const auto from = refused.err.find("--from ");
  ASSERT_NE(from, std::string::npos) << refused.err;
  EXPECT_FALSE(std::filesystem::exists(folder / "d"));
  const auto second =
      depth({"--from", refused.err.substr(from + 7, refused.err.find('\n', from) - from - 7)});
  EXPECT_EQ(second.status, 0) << second.err;
  std::ifstream camera(folder / "d" / "camera.json");
  EXPECT_EQ(nlohmann::json::parse(camera)["width"], 192);
}

TEST(RecordingSessions, AVideoIsOfOneSize) {
  const TempFolder folder;
  const auto both = record_two_sessions(folder);
  const auto video = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {program("relievo"), "export", both, "--format", "video", "--reencode", "--out",
                               folder / "v.mp4"});
    return run(more);
  };
  const auto refused = video({});
  if (refused.err.find("cannot write video") != std::string::npos) GTEST_SKIP() << refused.err;
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.err, HasSubstr("160 x 120 at first and then 192 x 144"));
  EXPECT_FALSE(std::filesystem::exists(folder / "v.mp4"));
  for (const std::string option : {"--to ", "--from "}) {
    const auto at = refused.err.find(option);
    ASSERT_NE(at, std::string::npos) << refused.err;
    const auto begin = at + option.size();
    const auto part = video({option.substr(0, option.size() - 1),
                             refused.err.substr(begin, refused.err.find_first_of(",\n", begin) - begin)});
    EXPECT_EQ(part.status, 0) << part.err;
  }
}

}  // namespace
}  // namespace relievo::test
