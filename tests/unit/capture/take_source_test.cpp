// SPDX-License-Identifier: Apache-2.0
// The take folder: pixels, times, and each fault as one clear line.
#include "capture/source/take_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <csignal>

#include "capture/source/npy.h"
#include "small_take.h"

namespace relievo {
namespace {

using testing::HasSubstr;

std::unique_ptr<FieldSource> open(const std::filesystem::path& take, bool loop = false) {
  auto source = open_source("take:" + take.string(), {.loop = loop});
  EXPECT_TRUE(source) << source.error().message;
  return source ? *std::move(source) : nullptr;
}

TEST(TakeSource, InterlacedFieldsAreTheRowsOfThePicture) {
  test::TempFolder folder;
  test::write_small_take(folder.path(), Scan::kInterlaced, 3);
  const auto source = open(folder.path());
  EXPECT_EQ(source->info().frames, 3u);
  for (std::size_t t = 0; t < 3; ++t) {
    auto frame = source->next();
    ASSERT_TRUE(frame && *frame);
    EXPECT_EQ((*frame)->number, t);
    EXPECT_NEAR(static_cast<double>((*frame)->time_ns), static_cast<double>(t) / 29.97 * 1e9, 1000);
    const View8 slide = (*frame)->slide_field(), complement = (*frame)->complement_field();
    ASSERT_EQ(slide.height, 8);
    for (int y = 0; y < 8; ++y) {
      for (int i = 0; i < 96; ++i) {
        ASSERT_EQ(slide.row(y)[i], test::small_pixel(t, static_cast<std::size_t>(2 * y * 96 + i)));
        ASSERT_EQ(complement.row(y)[i], test::small_pixel(t, static_cast<std::size_t>((2 * y + 1) * 96 + i)));
      }
    }
  }
  auto end = source->next();
  ASSERT_TRUE(end);
  EXPECT_FALSE(*end);
}

TEST(TakeSource, ProgressiveFramesAreTwoPictures) {
  test::TempFolder folder;
  test::write_small_take(folder.path(), Scan::kProgressive, 2);
  const auto source = open(folder.path());
  for (std::size_t t = 0; t < 2; ++t) {
    auto frame = source->next();
    ASSERT_TRUE(frame && *frame);
    EXPECT_EQ((*frame)->slide_field().height, 16);
    EXPECT_EQ((*frame)->picture.row(3)[5], test::small_pixel(2 * t, 3 * 96 + 5));
    EXPECT_EQ((*frame)->complement.row(3)[5], test::small_pixel(2 * t + 1, 3 * 96 + 5));
  }
}

TEST(TakeSource, LoopGoesOnInNumberAndTime) {
  test::TempFolder folder;
  test::write_small_take(folder.path(), Scan::kInterlaced, 3);
  const auto source = open(folder.path(), true);
  for (std::size_t t = 0; t < 8; ++t) {
    auto frame = source->next();
    ASSERT_TRUE(frame && *frame);
    EXPECT_EQ((*frame)->number, t);
    EXPECT_NEAR(static_cast<double>((*frame)->time_ns), static_cast<double>(t) / 29.97 * 1e9, 3000);
    EXPECT_EQ((*frame)->picture.data()[7], test::small_pixel(t % 3, 7));
    EXPECT_EQ((*frame)->starts_again, t == 3 || t == 6);
  }
}

TEST(TakeSource, ALoopHasNoGapWhereNumbersDoNotBeginAtZero) {
  test::TempFolder folder;
  test::write_small_take(folder.path(), Scan::kInterlaced, 5);
  test::write_text(folder.path() / "timestamps.csv", "frame,time_s\n2,0\n3,0.033\n4,0.067\n");
  const auto source = open(folder.path(), true);
  for (std::size_t t = 0; t < 8; ++t) {
    auto frame = source->next();
    ASSERT_TRUE(frame && *frame);
    EXPECT_EQ((*frame)->number, 2 + t);
    EXPECT_EQ((*frame)->picture.data()[7], test::small_pixel(2 + t % 3, 7));
  }
}

TEST(TakeSource, ADamagedPictureCostsOneFrameAlone) {
  test::TempFolder folder;
  test::write_small_take(folder.path(), Scan::kInterlaced, 6);
  const auto frames = folder.path() / "frames";
  std::string png = test::read_text(frames / "000001.png");
  png[png.size() / 2] = static_cast<char>(png[png.size() / 2] ^ 1);
  test::write_text(frames / "000001.png", png);
  test::write_text(frames / "000002.png", test::read_text(frames / "000002.png").substr(0, 200));
  std::filesystem::remove(frames / "000003.png");
  Image8 other(16, 32, 3);
  ASSERT_TRUE(write_picture(frames / "000004.png", other));
  const char* expected[] = {nullptr,
                            "000001.png is damaged: wrong checksum",
                            "000002.png is cut short",
                            "000003.png is missing",
                            "000004.png is 16 x 32, but rig.yaml says 32 x 16",
                            nullptr};
  const auto source = open(folder.path());
  for (std::uint64_t t = 0; t < 6; ++t) {
    auto frame = source->next();
    ASSERT_EQ(frame.ok(), expected[t] == nullptr) << t;
    if (expected[t]) {
      EXPECT_THAT(frame.error().message, HasSubstr(expected[t]));
    } else {
      EXPECT_EQ((*frame)->number, t);
    }
  }
  EXPECT_FALSE(*source->next());
}

TEST(TakeSource, PipesInPlaceOfItsFilesAreRefusedWithoutWaiting) {
  test::TempFolder folder;
  test::write_small_take(folder.path(), Scan::kInterlaced, 2);
  const auto put_pipe = [](const std::filesystem::path& at) {
    return std::filesystem::remove(at) && mkfifo(at.c_str(), 0600) == 0;
  };
  ASSERT_TRUE(put_pipe(folder.path() / "frames" / "000000.png"));
  const auto source = open(folder.path());
  EXPECT_THAT(source->next().error().message, HasSubstr("000000.png: it is a pipe"));
  EXPECT_TRUE(source->next());
  ASSERT_TRUE(put_pipe(folder.path() / "timestamps.csv"));
  EXPECT_THAT(open_source("take:" + folder.path().string(), {}).error().message,
              HasSubstr("timestamps.csv: it is a pipe"));
}

TEST(TakeSource, ALoopWithoutOneGoodPictureEnds) {
  test::TempFolder folder;
  test::write_small_take(folder.path(), Scan::kInterlaced, 2);
  std::filesystem::remove(folder.path() / "frames" / "000000.png");
  std::filesystem::remove(folder.path() / "frames" / "000001.png");
  const auto source = open(folder.path(), true);
  EXPECT_FALSE(source->next());
  EXPECT_FALSE(source->next());
  auto end = source->next();
  ASSERT_TRUE(end);
  EXPECT_FALSE(*end);
}

TEST(TakeSource, ATakeRemovedMidRunIsOneErrorThenTheEnd) {
  for (const bool loop : {false, true}) {
    test::TempFolder folder;
    const auto take = folder.path() / "take";
    test::write_small_take(take, Scan::kInterlaced, 3);
    const auto source = open(take, loop);
    for (int t = 0; t < (loop ? 5 : 1); ++t) ASSERT_TRUE(source->next());
    std::filesystem::remove_all(take);
    auto gone = source->next();
    ASSERT_FALSE(gone);
    EXPECT_THAT(gone.error().message, HasSubstr("was removed while it was being read"));
    auto end = source->next();
    ASSERT_TRUE(end);
    EXPECT_FALSE(*end);
  }
}

TEST(TakeSource, TimestampsAreParsedStrictly) {
  test::TempFolder folder;
  test::write_small_take(folder.path(), Scan::kInterlaced, 1);
  const struct {
    const char* content;
    const char* message;
  } refusals[] = {
      {"", "lists no frame"},
      {"frame,time_s\n", "lists no frame"},
      {"frame, time_s\n0,0\n", "line 1: must be the header"},
      {"frame,time_s\n0,0\n1\n", "line 3: must be a frame number and a time"},
      {"frame,time_s\n0,0\n1,0.03s\n", "line 3: must be a frame number and a time"},
      {"frame,time_s\n-1,0\n", "line 2: must be a frame number and a time"},
      {"frame,time_s\n0,inf\n", "line 2: must be a frame number and a time"},
      {"frame,time_s\n0,0\n\n1,1\n", "line 3: must be a frame number and a time"},
      {"frame,time_s\n0,0\n0,1\n", "line 3: frame numbers must increase"},
      {"frame,time_s\n0,1\n1,1\n", "line 3: times must increase"},
  };
  for (const auto& refusal : refusals) {
    test::write_text(folder.path() / "timestamps.csv", refusal.content);
    const auto source = open_source("take:" + folder.path().string(), {});
    ASSERT_FALSE(source) << refusal.content;
    EXPECT_THAT(source.error().message, HasSubstr(refusal.message));
  }
  // As editors of Windows write them.
  for (const char* text : {"rig.yaml", "pattern.yaml"})
    test::write_text(folder.path() / text, "\xEF\xBB\xBF" + test::read_text(folder.path() / text));
  test::write_text(folder.path() / "timestamps.csv",
                   "\xEF\xBB\xBF"
                   "frame,time_s\r\n0,0\r\n");
  const auto marked = open_source("take:" + folder.path().string(), {});
  EXPECT_TRUE(marked) << marked.error().message;
  test::write_text(folder.path() / "timestamps.csv", "frame,time_s\n0,0\n\n");  // as some editors end a file
  EXPECT_TRUE(open_source("take:" + folder.path().string(), {}));
}

// A camera's rows are what they are: fields would change places.
TEST(TakeSource, FramesAreNotTurnedByWhatTheirMetadataSays) {
  test::TempFolder folder;
  test::write_small_take(folder.path(), Scan::kInterlaced, 1);
  const std::filesystem::path file = take_picture(folder.path(), 0);
  std::string png = test::read_text(file);
  // Big-endian TIFF with orientation 3, behind the signature and IHDR.
  const std::string exif(
      "\0\0\0\x1a"
      "eXIf"
      "MM\0\x2a\0\0\0\x08"
      "\0\x01"
      "\x01\x12\0\x03\0\0\0\x01\0\x03\0\0"
      "\0\0\0\0"
      "\x84\x5f\x64\xce",
      38);
  png.insert(33, exif);
  test::write_text(file, png);
  auto frame = open(folder.path())->next();
  ASSERT_TRUE(frame && *frame) << frame.error().message;
  for (int i = 0; i < 96; ++i)
    ASSERT_EQ((*frame)->picture.row(0)[i], test::small_pixel(0, static_cast<std::size_t>(i)));
}

TEST(TakeSource, OpeningNamesWhatIsMissing) {
  test::TempFolder folder;
  const auto take = folder.path() / "take";
  EXPECT_THAT(open_source("take:" + take.string(), {}).error().message, HasSubstr("is no folder"));
  for (const char* part : {"rig.yaml", "pattern.yaml", "timestamps.csv", "frames"}) {
    test::write_small_take(take, Scan::kInterlaced, 1);
    std::filesystem::remove_all(take / part);
    EXPECT_THAT(open_source("take:" + take.string(), {}).error().message, HasSubstr(part));
  }
  EXPECT_THAT(open_source("video:x", {}).error().message, HasSubstr("take:DIR"));
}

TEST(Npy, APipeOrAFolderInItsPlaceIsSaid) {
  test::TempFolder folder;
  ASSERT_EQ(mkfifo((folder.path() / "pipe.npy").c_str(), 0600), 0);
  EXPECT_THAT(read_npy(folder.path() / "pipe.npy").error().message, HasSubstr("pipe.npy: it is a pipe"));
  std::filesystem::create_directory(folder.path() / "folder.npy");
  EXPECT_THAT(read_npy(folder.path() / "folder.npy").error().message, HasSubstr("it is a folder"));
}

TEST(Npy, ReadsBackAndRefusesOtherFiles) {
  test::TempFolder folder;
  const auto file = folder.path() / "a.npy";
  ImageF image(7, 3, 1);
  for (std::size_t i = 0; i < image.size(); ++i) image.data()[i] = static_cast<float>(i) / 3;
  ASSERT_TRUE(write_npy(file, image));
  const Result<ImageF> read = read_npy(file);
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_EQ(read->width(), 7);
  ASSERT_EQ(read->height(), 3);
  for (std::size_t i = 0; i < image.size(); ++i) EXPECT_EQ(read->data()[i], image.data()[i]);

  const std::string bytes = test::read_text(file);
  EXPECT_EQ((bytes.size() - image.size() * 4) % 64, 0u);
  test::write_text(file, bytes.substr(0, bytes.size() - 1));
  EXPECT_FALSE(read_npy(file));
  test::write_text(file, bytes + "x");
  EXPECT_FALSE(read_npy(file));
  std::string other = bytes;
  other.replace(other.find("<f4"), 3, "<f8");
  test::write_text(file, other);
  EXPECT_FALSE(read_npy(file));
  EXPECT_FALSE(read_npy(folder.path() / "none.npy"));
}

/// A limit on the file's size stands in for a full disk.
TEST(Npy, AFullDiskLeavesWhatWasThere) {
  test::TempFolder folder;
  const auto file = folder.path() / "a.npy";
  test::write_text(file, "of before");
  const pid_t child = fork();
  if (child == 0) {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit size{1000, 1000};
    setrlimit(RLIMIT_FSIZE, &size);
    _exit(write_npy(file, ImageF(40, 30, 1)).ok() ? 1 : 0);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_EQ(WEXITSTATUS(status), 0);
  EXPECT_EQ(test::read_text(file), "of before");
}

TEST(SharedTakes, OpenAsTheyAre) {
  const char* shared = std::getenv("RELIEVO_SHARED");
  const std::filesystem::path takes =
      std::filesystem::path(shared ? shared : RELIEVO_SOURCE_DIR "/../shared") / "takes";
  if (!std::filesystem::exists(takes)) GTEST_SKIP() << "no takes at " << takes << ": set RELIEVO_SHARED";
  for (const char* name : {"bunny", "shell"}) {
    const auto source = open(takes / name);
    ASSERT_TRUE(source);
    auto frame = source->next();
    ASSERT_TRUE(frame && *frame) << name;
    EXPECT_EQ((*frame)->picture.width(), source->info().rig.camera.width);
  }
}

}  // namespace
}  // namespace relievo
