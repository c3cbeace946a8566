// SPDX-License-Identifier: Apache-2.0
// Recordings of many files, and damaged ones: real processes on the loopback.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <fstream>

#include "tests/e2e/record_play.h"
#include "tests/support/patience.h"
#include "tests/support/temp_folder.h"

namespace relievo::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

std::vector<std::string> record(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), {program("relievo"), "record", "face"});
  arguments.insert(arguments.end(), {"--domain", kDomain, "--interface", "lo", "--json"});
  return arguments;
}

std::vector<fs::path> files_in(const fs::path& folder) {
  std::vector<fs::path> out;
  for (const auto& entry : fs::directory_iterator(folder)) out.push_back(entry.path());
  std::ranges::sort(out);
  return out;
}

/// Of the frames in a file.
std::vector<std::uint64_t> sequence_numbers(const fs::path& file) {
  std::vector<std::uint64_t> out;
  for (const Bytes& cdr : recorded_frames(file)) {
    const auto frame = read_frame_cdr(cdr);
    EXPECT_TRUE(frame.ok());
    if (frame) out.push_back(frame->sequence);
  }
  return out;
}

TEST(RecordFiles, EachSegmentStandsAloneAndNothingIsLostBetweenThem) {
  const TempFolder folder;
  Process server(publish_face(0));
  const auto command = record({"--out", folder / "face.mcap", "--split-size", "60kB", "--frames", "100"});
  std::size_t before = 0;
  for (int pass = 1; pass <= 2; ++pass) {
    const auto done = run(command);
    ASSERT_EQ(done.status, 0) << done.err;
    const auto result = nlohmann::json::parse(done.out);
    EXPECT_EQ(result["frames"], 100);
    const auto added = result["files"].get<std::ptrdiff_t>();
    EXPECT_GE(added, 3);
    const std::vector<fs::path> files = files_in(folder.path());
    ASSERT_EQ(files.size(), before + static_cast<std::size_t>(added)) << "the second run goes on counting";
    before = files.size();
    EXPECT_EQ(result["paths"].get<std::vector<fs::path>>(),
              std::vector<fs::path>(files.end() - added, files.end()));
    EXPECT_EQ(result["file"], files.back().string());
    EXPECT_EQ(result["removed_files"], 0);
    std::vector<std::uint64_t> sequence;
    for (auto file = files.end() - added; file != files.end(); ++file) {
      EXPECT_TRUE(fs::file_size(*file) >= 60'000u || file + 1 == files.end());
      const auto description = info(*file);
      EXPECT_EQ(description["recovered"], false);
      EXPECT_EQ(description["info"]["pattern"]["stripes"], 7) << "described in each file";
      EXPECT_THAT(description["attachments"].dump(),
                  HasSubstr(R"(["rig.yaml","pattern.yaml","stream_info.cdr"])"));
      for (const std::uint64_t number : sequence_numbers(*file)) sequence.push_back(number);
    }
    ASSERT_EQ(sequence.size(), 100u);
    EXPECT_EQ(sequence.back() - sequence.front(), 99u + result["lost"].get<std::uint64_t>());
  }
}

void expect_each_is_read_alone(const fs::path& folder, const fs::path& exports) {
  const std::vector<fs::path> files = files_in(folder);
  EXPECT_GE(files.size(), 3U);
  for (const fs::path& file : files) {
    SCOPED_TRACE(file);
    EXPECT_THAT(info(file)["attachments"].dump(),
                HasSubstr(R"(["rig.yaml","pattern.yaml","stream_info.cdr"])"));
    const std::vector<Bytes> frames = recorded_frames(file);
    ASSERT_FALSE(frames.empty());
    EXPECT_TRUE(holds_key_frame(frames[0]));
    const auto exported = run({program("relievo"), "export", file, "--out", exports / file.stem(), "--json"});
    ASSERT_EQ(exported.status, 0) << exported.err;
    EXPECT_EQ(nlohmann::json::parse(exported.out)["frames"], frames.size()) << "each decodes";
  }
}

/// Split by time, where no frame decodes alone but the first, and those that the recorders ask for.
TEST(RecordFiles, FilesOfALengthBeginWithAKeyFrameAndTheCalibration) {
  const TempFolder folder;
  fs::create_directory(folder / "served");
  fs::create_directory(folder / "received");
  Process received(record({"--out", folder / "received/face.mcap", "--split-every", "1s", "--seconds", "4"}));
  const auto served = run({program("relievo-server"),
                           "serve",
                           "--source",
                           "sim:plane,width=160,height=120,stripes=30",
                           "--stream",
                           "face",
                           "--web",
                           "none",
                           "--domain",
                           kDomain,
                           "--interface",
                           "lo",
                           "--frames",
                           "150",
                           "--geometry",
                           "grid",
                           "--key-interval",
                           "1000",
                           "--record",
                           folder / "served/face.mcap",
                           "--split-every",
                           "1s"});
  ASSERT_EQ(served.status, 0) << served.err;
  ASSERT_EQ(received.wait(), 0) << received.err();
  for (const char* files : {"served", "received"}) {
    SCOPED_TRACE(files);
    expect_each_is_read_alone(folder / files, folder / "ply" / files);
  }
}

TEST(RecordFiles, OldSegmentsGo) {
  const TempFolder folder;
  Process server(publish_face(0));
  const auto done = run(record(
      {"--out", folder / "face.mcap", "--split-size", "30kB", "--keep-size", "250kB", "--frames", "300"}));
  ASSERT_EQ(done.status, 0) << done.err;
  const auto result = nlohmann::json::parse(done.out);
  const std::vector<fs::path> files = files_in(folder.path());
  EXPECT_EQ(result["paths"].get<std::vector<fs::path>>(), files) << "none that went";
  EXPECT_EQ(result["files"], files.size());
  EXPECT_GE(result["removed_files"], 1);
  const int written = result["files"].get<int>() + result["removed_files"].get<int>();
  char last[32];
  std::snprintf(last, sizeof last, "face_%06d.mcap", written - 1);
  EXPECT_EQ(files.back().filename(), last);
  std::uintmax_t bytes = 0;
  for (const fs::path& file : files) {
    const std::uintmax_t size = fs::file_size(file);
    EXPECT_TRUE((size >= 30'000u && size < 100'000u) || file == files.back()) << file << ' ' << size;
    bytes += size;
  }
  EXPECT_GE(files.size(), 3u);
  EXPECT_LE(bytes, 250'000u + 100'000u) << "the one being written comes on top";

  const auto refused = run(record({"--out", folder / "face.mcap", "--keep-size", "1MB"}));
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.err, HasSubstr("--split-size"));
}

TEST(RecordFiles, ADamagedRecordingIsRecoveredAndPlays) {
  const TempFolder folder;
  {
    Process server(publish_face(20000));
    const auto done = run(record({"--out", folder / "face.mcap", "--frames", "120"}));
    ASSERT_EQ(done.status, 0) << done.err;
  }
  const std::size_t whole = sequence_numbers(folder / "face.mcap").size();
  ASSERT_EQ(whole, 120u);
  {  // 4 kB of it were overwritten, and its end with the index is missing
    std::fstream file(folder / "face.mcap", std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(fs::file_size(folder / "face.mcap") / 2));
    file << std::string(4096, '\x06');
  }
  fs::resize_file(folder / "face.mcap", fs::file_size(folder / "face.mcap") - 500);

  // Its frames are no surfaces, so none is written.
  const auto exported =
      run({program("relievo"), "export", folder / "face.mcap", "--out", folder / "ply", "--format", "ply"});
  EXPECT_THAT(exported.err, testing::HasSubstr("was cut short or damaged: this is of what is whole in it"));
  const auto done = run({program("relievo"), "recover", folder / "face.mcap", "--json"});
  ASSERT_EQ(done.status, 0) << done.err;
  const auto result = nlohmann::json::parse(done.out);
  const fs::path copy = folder / "face-recovered.mcap";
  EXPECT_EQ(result["file"], copy.string());
  EXPECT_FALSE(result["left_out"].empty());
  const std::size_t kept = sequence_numbers(copy).size();
  EXPECT_LT(kept, whole);
  EXPECT_GE(kept, whole / 3);
  const auto description = info(copy);
  EXPECT_EQ(description["recovered"], false);
  EXPECT_EQ(description["frames"], kept);
  EXPECT_EQ(description["damaged_parts"], 0);

  const auto again = run({program("relievo"), "recover", folder / "face.mcap"});
  EXPECT_EQ(again.status, 1);
  EXPECT_THAT(again.err, HasSubstr("exists already"));

  const fs::path nowhere = folder / "none" / "copy.mcap";
  const auto refused = run({program("relievo"), "recover", folder / "face.mcap", "--out", nowhere});
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.err, HasSubstr(nowhere.string()));
  EXPECT_THAT(refused.err, Not(HasSubstr(".part")));
}

/// Few frames, in one chunk.
void record_at_once(const fs::path& file) {
  const auto served = run({program("relievo-server"), "serve", "--source",
                           "sim:plane,width=160,height=120,stripes=30", "--web", "none", "--domain", kDomain,
                           "--interface", "lo", "--fast", "--frames", "4", "--record", file});
  ASSERT_EQ(served.status, 0) << served.err;
}

TEST(RecordFiles, WhereNoFrameIsWholeConvertWritesNoFile) {
  const TempFolder folder;
  const fs::path damaged = folder / "a.mcap", out = folder / "out.mcap";
  record_at_once(damaged);
  std::fstream file(damaged, std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(static_cast<std::streamoff>(fs::file_size(damaged) / 2));
  file << std::string(100, '\x06');
  file.close();
  for (const std::vector<std::string>& more : {std::vector<std::string>{}, {"--geometry", "grid"}}) {
    std::vector<std::string> command{program("relievo"), "convert", damaged, "--out", out};
    command.insert(command.end(), more.begin(), more.end());
    const auto done = run(command);
    EXPECT_EQ(done.status, 1) << done.out;
    EXPECT_THAT(done.err, HasSubstr("no frame in that range is whole"));
    EXPECT_FALSE(fs::exists(out));
  }
}

TEST(RecordFiles, LinksLeadToTheirFile) {
  const TempFolder folder;
  const fs::path original = folder / "a.mcap", link = folder / "link.mcap", target = folder / "linked.mcap";
  record_at_once(original);
  fs::create_symlink("linked.mcap", link);
  for (const std::string verb : {"convert", "recover"}) {
    EXPECT_EQ(run({program("relievo"), verb, folder / "none.mcap", "--out", link}).status, 1);
    const auto done = run({program("relievo"), verb, original, "--out", link});
    EXPECT_EQ(done.status, 0) << done.err;
    EXPECT_TRUE(fs::is_symlink(link));
    EXPECT_EQ(info(target)["frames"], info(original)["frames"]);
    const auto again = run({program("relievo"), verb, original, "--out", link});
    EXPECT_THAT(again.err, HasSubstr("exists already"));
    EXPECT_TRUE(fs::remove(target));
  }
  Process server(publish_face(3000));
  const auto recorded = run(record({"--out", link, "--frames", "2"}));
  EXPECT_EQ(recorded.status, 0) << recorded.err;
  EXPECT_EQ(info(target)["frames"], 2);
  EXPECT_THAT(run(record({"--out", link, "--frames", "2"})).err, HasSubstr("exists already"));
  EXPECT_TRUE(fs::remove(target));
  EXPECT_EQ(run({program("relievo"), "convert", original, "--out", link, "--from", "99"}).status, 1);
  EXPECT_TRUE(fs::is_symlink(link)) << "which nobody but its owner removes";
  fs::create_symlink("circle.mcap", folder / "circle.mcap");
  const auto circle = run({program("relievo"), "convert", original, "--out", folder / "circle.mcap"});
  EXPECT_EQ(circle.status, 1);
  EXPECT_THAT(circle.err, HasSubstr("cannot record to " + (folder / "circle.mcap").string()));
}

}  // namespace
}  // namespace relievo::test
