// SPDX-License-Identifier: Apache-2.0
// Takes written by `simulate`: read back the same, and whole or not there.
#include "capture/source/take_writer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <csignal>
#include <random>

#include "capture/source/npy.h"
#include "small_take.h"

namespace relievo {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

std::unique_ptr<SimSource> small_sim(const std::string& more) {
  auto source = make_sim("object,width=64,height=48,stripes=20,frames=5" + more, {.truth = true});
  EXPECT_TRUE(source) << source.error().message;
  return source ? *std::move(source) : nullptr;
}

std::size_t entries(const std::filesystem::path& folder) {
  std::size_t count = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder)) ++count;
  return count;
}

TEST(TakeWriter, WhatIsWrittenIsReadBackTheSame) {
  for (const char* scan : {",scan=interlaced,drop=3", ",scan=progressive,distortion=1"}) {
    test::TempFolder folder;
    const auto take = folder.path() / "take";
    const auto source = small_sim(scan);
    std::uint64_t progress = 0;
    const Status written = write_take(take, *source, {.progress = [&](std::uint64_t n) { progress = n; }});
    ASSERT_TRUE(written) << written.error().message;
    EXPECT_EQ(progress, 5u);
    EXPECT_EQ(entries(folder.path()), 1u);

    auto read = open_source("take:" + take.string(), {});
    ASSERT_TRUE(read) << read.error().message;
    const SourceInfo &a = source->info(), &b = (*read)->info();
    EXPECT_EQ(to_yaml(a.rig), to_yaml(b.rig));
    EXPECT_EQ(to_yaml(a.pattern), to_yaml(b.pattern));
    const auto again = small_sim(scan);
    for (std::uint64_t i = 0; i < 5; ++i) {
      auto rendered = again->next(), frame = (*read)->next();
      ASSERT_TRUE(rendered && *rendered && frame && *frame);
      EXPECT_EQ((*frame)->number, i);
      EXPECT_EQ((*frame)->time_ns, (*rendered)->time_ns);
      const auto same = [](const auto& x, const auto& y) {
        return x.size() == y.size() && std::equal(x.data(), x.data() + x.size(), y.data());
      };
      EXPECT_TRUE(same((*frame)->picture, (*rendered)->picture));
      EXPECT_TRUE(same((*frame)->complement, (*rendered)->complement));
      const auto truth = read_npy(take_truth(take, i));
      ASSERT_TRUE(truth) << truth.error().message;
      EXPECT_TRUE(same(*truth, again->truth()));
    }
    EXPECT_FALSE(*(*read)->next());
  }
}

TEST(TakeWriter, StopsAtTheFramesAskedFor) {
  test::TempFolder folder;
  const auto source = small_sim("");
  ASSERT_TRUE(write_take(folder.path() / "take", *source, {.frames = 2}));
  EXPECT_EQ(entries(folder.path() / "take" / "frames"), 2u);
  EXPECT_EQ(entries(folder.path() / "take" / "truth"), 2u);
}

TEST(TakeWriter, RefusesAFolderWithSomethingInIt) {
  test::TempFolder folder;
  test::write_text(folder.path() / "precious.txt", "x");
  const auto source = small_sim("");
  const Status refused = write_take(folder.path(), *source, {});
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("exists already"));
  EXPECT_EQ(test::read_text(folder.path() / "precious.txt"), "x");
  std::filesystem::create_directory(folder.path() / "empty");
  EXPECT_TRUE(write_take(folder.path() / "empty/", *source, {}));
}

TEST(TakeWriter, WhetherATakeCanBeThereIsToldBeforehand) {
  test::TempFolder folder;
  EXPECT_TRUE(check_take_target(folder.path() / "take"));
  EXPECT_TRUE(check_take_target(folder.path() / "not/yet/take/"));
  EXPECT_EQ(entries(folder.path()), 0u);
  std::filesystem::create_directory(folder.path() / "empty");
  EXPECT_TRUE(check_take_target(folder.path() / "empty"));
  test::write_text(folder.path() / "file", "x");
  const auto refusal = [](const std::filesystem::path& take) {
    const Status possible = check_take_target(take);
    return possible ? "" : possible.error().message;
  };
  EXPECT_THAT(refusal(folder.path()), HasSubstr("exists already"));
  EXPECT_THAT(refusal(folder.path() / "file"), HasSubstr("exists already"));
  EXPECT_THAT(refusal(folder.path() / "file/take"), HasSubstr("cannot be created"));
  std::filesystem::create_symlink("circle", folder.path() / "circle");
  EXPECT_THAT(refusal(folder.path() / "circle"), StartsWith((folder.path() / "circle cannot").string()));
  EXPECT_THAT(refusal(folder.path() / "circle/take"),
              StartsWith((folder.path() / "circle/take cannot").string()));
  EXPECT_THAT(refusal("/proc/take"), HasSubstr("cannot be created in /proc: "));
}

TEST(TakeWriter, GoesWhereALinkLeads) {
  test::TempFolder folder;
  std::filesystem::create_directory(folder.path() / "large_disk");
  std::filesystem::create_directory_symlink("large_disk", folder.path() / "take");
  ASSERT_TRUE(write_take(folder.path() / "take", *small_sim(""), {.frames = 1}));
  EXPECT_TRUE(std::filesystem::is_symlink(folder.path() / "take"));
  EXPECT_EQ(entries(folder.path() / "large_disk" / "frames"), 1u);
}

TEST(TakeWriter, StoppedLeavesNothingBehind) {
  test::TempFolder folder;
  const auto source = small_sim("");
  std::atomic<bool> stop{false};
  const Status stopped = write_take(folder.path() / "new" / "take", *source,
                                    {.progress = [&](std::uint64_t n) { stop = n == 2; }, .stop = &stop});
  ASSERT_FALSE(stopped);
  EXPECT_THAT(stopped.error().message, HasSubstr("stopped"));
  EXPECT_EQ(entries(folder.path()), 0u);
}

TEST(TakeWriter, AFailureLeavesNothingBehind) {
  test::TempFolder folder;
  test::write_text(folder.path() / "file", "x");
  const auto source = small_sim("");
  const Status failed = write_take(folder.path() / "file" / "take", *source, {});
  ASSERT_FALSE(failed);
  EXPECT_THAT(failed.error().message, HasSubstr("cannot be created"));
  EXPECT_EQ(entries(folder.path()), 1u);
}

/// Files of this process larger than `bytes` are refused, as by a full disk.
class FullDisk {
 public:
  explicit FullDisk(rlim_t bytes) {
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit now{bytes, before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &now);
    signal_ = std::signal(SIGXFSZ, SIG_IGN);
  }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;
  ~FullDisk() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, signal_);
  }

 private:
  rlimit before_{};
  void (*signal_)(int);
};

/// Black but for the last picture of the third frame, whose noise no PNG makes small.
class GrowingPictures final : public FieldSource {
 public:
  explicit GrowingPictures(Scan scan)
      : source_(small_sim(scan == Scan::kProgressive ? ",scan=progressive" : "")) {}
  const SourceInfo& info() const override { return source_->info(); }
  Result<std::optional<CapturedFrame>> next() override {
    auto frame = source_->next();
    if (!frame || !*frame) return frame;
    CapturedFrame& f = **frame;
    Image8& last = f.scan == Scan::kProgressive ? f.complement : f.picture;
    std::minstd_rand random(1);
    for (Image8* picture : {&f.picture, &last}) {
      std::fill(picture->data(), picture->data() + picture->size(), std::uint8_t{0});
    }
    if (f.number == 2)
      std::generate(last.data(), last.data() + last.size(),
                    [&] { return static_cast<std::uint8_t>(random()); });
    return frame;
  }
  void request_stop() override { source_->request_stop(); }

 private:
  const std::unique_ptr<FieldSource> source_;
};

TEST(TakeWriter, WhatWasWrittenIsKeptWhereThatIsWanted) {
  for (const Scan scan : {Scan::kInterlaced, Scan::kProgressive}) {
    test::TempFolder folder;
    GrowingPictures source(scan);
    const std::filesystem::path take = folder.path() / "take";
    Status done;
    {
      const FullDisk full(8000);
      done = write_take(take, source, {.keep_written = true});
    }
    ASSERT_FALSE(done);
    EXPECT_THAT(done.error().message, HasSubstr("png: the file may not grow further"));
    EXPECT_THAT(done.error().message, HasSubstr("has the first 2 frames"));
    EXPECT_EQ(entries(folder.path()), 1u);
    EXPECT_EQ(entries(take / "frames"), scan == Scan::kProgressive ? 4u : 2u);
    const auto read = open_source("take:" + take.string(), {});
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_EQ((*read)->info().frames, 2u);
    for (int i = 0; i < 2; ++i) EXPECT_TRUE((*read)->next());
  }
}

TEST(TakeWriter, WhatIsKeptHasAnotherNameWhereSomethingIsThereByNow) {
  test::TempFolder folder;
  const std::filesystem::path take = folder.path() / "take";
  ASSERT_TRUE(write_take(take, *small_sim(""), {}));
  ASSERT_FALSE(write_take(take, *small_sim(""), {}));
  for (const char* name : {"take-2", "take-3"}) {
    const Status done = write_take(take, *small_sim(""), {.keep_written = true});
    ASSERT_FALSE(done);
    const std::filesystem::path there = folder.path() / name;
    EXPECT_EQ(done.error().message, take.string() + " exists by now: the frames are in " + there.string());
    EXPECT_EQ(entries(there / "frames"), 5u);
  }
}

TEST(TakeWriter, OfNoFrameNothingIsKept) {
  test::TempFolder folder;
  const auto source = small_sim("");
  const FullDisk full(100);
  const Status failed = write_take(folder.path() / "take", *source, {.keep_written = true});
  ASSERT_FALSE(failed);
  EXPECT_THAT(failed.error().message, HasSubstr("png: the file may not grow further"));
  EXPECT_THAT(failed.error().message, StartsWith("cannot write " + (folder.path() / "take" / "").string()))
      << "not the name that it has until it is whole";
  EXPECT_EQ(entries(folder.path()), 0u);
}

}  // namespace
}  // namespace relievo
