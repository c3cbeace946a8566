// SPDX-License-Identifier: Apache-2.0
// Proves: a recording that another program writes can be read meanwhile as a whole file with an index, of
// which nothing that was there before ever changes, wherever it is looked at and whatever is cut or broken in
// it.
#include "codec/recording_follower.h"

#include <gtest/gtest.h>

#include <cstring>
#include <map>

#include "tests/support/temp_folder.h"
#include "tests/unit/codec/sample_recording.h"

namespace relievo::test {
namespace {

using Found = RecordingFollower::Found;

class Following : public ::testing::Test {
 protected:
  void SetUp() override { write_sample(folder_ / "whole.mcap", 23); }

  void write_to(std::size_t size) { write_file(file_, std::span(whole()).first(size)); }
  const Bytes& whole() {
    if (whole_.empty()) whole_ = read_file(folder_ / "whole.mcap");
    return whole_;
  }
  /// Where the data ends: what is behind it is the index.
  std::size_t data_bytes() {
    std::uint64_t summary = 0;
    std::memcpy(&summary, whole().data() + whole().size() - 8 - 20, sizeof summary);
    return summary - 13;
  }
  /// The messages of what is whole now, read as the file that it is said to be.
  std::vector<RecordedMessage> messages(std::uint64_t bytes) {
    const auto end = follower_.growing()->end_at(bytes);
    if (!end) return {};
    Bytes now(whole().begin(), whole().begin() + static_cast<std::ptrdiff_t>(bytes));
    now.insert(now.end(), end->begin(), end->end());
    write_file(folder_ / "now.mcap", now);
    const auto reader = open(folder_ / "now.mcap");
    EXPECT_FALSE(reader->summary().recovered) << "it has an index";
    EXPECT_EQ(reader->summary().damage, std::vector<std::string>());
    ReadBack back = read_all(*reader);
    EXPECT_TRUE(back.errors.empty());
    EXPECT_EQ(reader->summary().messages, back.messages.size());
    std::size_t listed = 0;
    for (std::uint16_t channel = 0; channel < 2; ++channel) listed += reader->times(channel)->size();
    EXPECT_EQ(listed, back.messages.size());
    EXPECT_GE(reader->summary().attachments.size(), 1U);
    return std::move(back.messages);
  }

  TempFolder folder_;
  const std::filesystem::path file_ = folder_ / "growing.mcap";
  RecordingFollower follower_{file_};

 private:
  Bytes whole_;
};

TEST_F(Following, WhereverItIsLookedAt) {
  std::map<std::uint64_t, Bytes> ends;
  std::size_t read = 0;
  for (std::size_t size = 0; size < data_bytes(); size += 7) {
    write_to(size);
    const auto found = follower_.look();
    ASSERT_TRUE(found) << size << found.error().message;
    const std::uint64_t bytes = follower_.growing()->bytes();
    EXPECT_LE(bytes, size);
    EXPECT_EQ(*found == Found::kMore, bytes > 0 && !ends.contains(bytes)) << size;
    if (*found != Found::kMore) continue;
    ends[bytes] = *follower_.growing()->end_at(bytes);
    const auto now = messages(bytes);
    EXPECT_GT(now.size(), read);
    read = now.size();
  }
  EXPECT_EQ(ends.size(), 4U) << "of five chunks the last has nothing behind it yet";
  for (const auto& [bytes, end] : ends)
    EXPECT_EQ(*follower_.growing()->end_at(bytes), end) << "always the same";
  EXPECT_EQ(follower_.growing()->end_at(ends.begin()->first + 1), nullptr);

  for (std::size_t size = data_bytes(); size < whole().size(); size += 11) {
    write_to(size);
    const auto found = follower_.look();
    EXPECT_TRUE(found && *found != Found::kFinished) << "its index is not all there";
  }
  write_to(whole().size());
  EXPECT_EQ(*follower_.look(), Found::kFinished);
  EXPECT_EQ(*follower_.look(), Found::kFinished);
  EXPECT_EQ(messages(follower_.growing()->bytes()).size(), 23U);
}

TEST_F(Following, TheLastChunkCountsWhenNothingComesBehindIt) {
  // The second attachment is behind the last chunk, and one that was killed has none.
  {
    const auto writer = create(folder_ / "killed.mcap", {.chunk_ns = 5 * kStep_ns, .chunk_bytes = 1 << 20});
    ASSERT_TRUE(writer->add_channel(schema(), channel("relievo/frame")));
    for (int i = 0; i < 11; ++i) ASSERT_TRUE(writer->write(message(0, i, 40)).ok());
    std::filesystem::copy_file(folder_ / "killed.mcap", file_);
  }
  EXPECT_EQ(*follower_.look(), Found::kMore);
  const std::uint64_t first = follower_.growing()->bytes();
  EXPECT_LT(first, std::filesystem::file_size(file_));
  EXPECT_EQ(*follower_.look(), Found::kMore);
  EXPECT_EQ(follower_.growing()->bytes(), std::filesystem::file_size(file_));
  EXPECT_EQ(*follower_.look(), Found::kNothing);
}

/// As of a writer that was killed, or a copy that was cut.
TEST_F(Following, AChunkThatIsNotAllThereIsBehindTheOneBeforeIt) {
  write_to(data_bytes());
  ASSERT_EQ(*follower_.look(), Found::kMore);
  const std::uint64_t whole_chunks = follower_.growing()->bytes();
  for (std::uint64_t bytes = whole_chunks - 1; bytes > 0; --bytes) {
    if (!follower_.growing()->end_at(bytes)) continue;
    write_to(bytes + 40);
    RecordingFollower cut(file_);
    EXPECT_EQ(*cut.look(), Found::kMore);
    EXPECT_EQ(cut.growing()->bytes(), bytes);
    EXPECT_EQ(*cut.look(), Found::kNothing);
  }
}

/// As of a writer that was killed: a file that is opened now has all of that chunk.
TEST_F(Following, AChunkWhoseMessageIndexesAreNotAllThereIsHeldBack) {
  write_to(data_bytes());
  ASSERT_EQ(*follower_.look(), Found::kMore);
  const std::uint64_t chunk_end = follower_.growing()->bytes();
  for (const std::uint64_t less : {std::uint64_t{1}, std::uint64_t{30}}) {
    write_to(chunk_end - less);
    RecordingFollower cut(file_);
    EXPECT_EQ(*cut.look(), Found::kMore);
    EXPECT_EQ(*cut.look(), Found::kNothing);
    EXPECT_LT(cut.growing()->bytes(), chunk_end);
    EXPECT_TRUE(cut.holds_back());
    write_to(whole().size());
    EXPECT_EQ(*cut.look(), Found::kFinished) << "it was not killed";
    EXPECT_FALSE(cut.holds_back());
  }
}

TEST_F(Following, AnotherOneThatIsWrittenOverItIsToldFromIt) {
  write_sample(folder_ / "other.mcap", 23, 41);
  const Bytes other = read_file(folder_ / "other.mcap");
  for (const std::size_t size : {data_bytes() / 2, data_bytes(), whole().size()}) {
    write_to(size);
    RecordingFollower follower(file_);
    ASSERT_TRUE(follower.look());
    const std::uint64_t bytes = follower.growing()->bytes();
    write_file(file_, std::span(other).first(size));
    EXPECT_EQ(*follower.look(), Found::kAnother) << size;
    EXPECT_EQ(follower.growing()->bytes(), bytes) << "nothing of the other is among it";
  }
}

TEST_F(Following, ReadsNothingTwiceButTheHeadsOfTwoChunks) {
  write_to(data_bytes());
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(follower_.look());
  Bytes other(whole().begin(), whole().begin() + static_cast<std::ptrdiff_t>(data_bytes()));
  std::fill(other.begin(), other.begin() + 80, 0xee);
  write_file(file_, other);
  EXPECT_EQ(*follower_.look(), Found::kNothing) << "what is done with is not looked at again";
}

TEST_F(Following, DamageEndsItAndWhatWasWholeStays) {
  write_to(data_bytes() / 2);
  ASSERT_EQ(*follower_.look(), Found::kMore);
  const std::uint64_t bytes = follower_.growing()->bytes();
  const auto before = messages(bytes).size();
  Bytes broken = whole();
  for (std::size_t i = data_bytes() / 2; i < data_bytes(); ++i) broken[i] = 0;
  write_file(file_, broken);
  for (int i = 0; i < 3; ++i) (void)follower_.look().ok();
  EXPECT_FALSE(follower_.look());
  EXPECT_EQ(messages(bytes).size(), before);

  write_to(20);  // it was cut, or is another file
  EXPECT_FALSE(follower_.look());
  std::filesystem::remove(file_);
  EXPECT_FALSE(follower_.look());
  RecordingFollower none(folder_ / "none");
  EXPECT_FALSE(none.look());
  write_file(folder_ / "none", payload(1, 1000));
  EXPECT_FALSE(none.look());
  EXPECT_EQ(none.growing()->bytes(), 0U);
}

TEST_F(Following, AnyBytesAreNoHarm) {
  Random random(7);
  for (int i = 0; i < 300; ++i) {
    Bytes broken = whole();
    for (int n = 0; n < 4; ++n)
      broken[random.bits() % broken.size()] = static_cast<std::uint8_t>(random.bits());
    write_file(file_, std::span(broken).first(random.bits() % broken.size()));
    RecordingFollower follower(file_);
    (void)follower.look().ok();
    (void)follower.look().ok();
    const std::uint64_t bytes = follower.growing()->bytes();
    EXPECT_LE(bytes, broken.size());
    EXPECT_EQ(follower.growing()->end_at(bytes) != nullptr, bytes > 0);
  }
}

}  // namespace
}  // namespace relievo::test
