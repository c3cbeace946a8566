// SPDX-License-Identifier: Apache-2.0
// Bytes that no encoder wrote: versions to come, cut and mutated frames, bombs.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cmath>
#include <cstring>

#include "codec/frame3d_codec.h"
#include "tests/support/make_surface.h"

namespace relievo {
namespace {

Bytes valid(int speed = 5, bool points = false) {
  Frame3D frame = test::frame(12, 14, 40, 30);
  if (points) frame.surface.triangles.clear();
  frame.surface.normals.assign(frame.surface.positions.size(), Vec3f{0, 0, -1});
  EncodeOptions options;
  options.draco_speed = speed;
  options.normal_bits = 8;
  return std::move(*encode_frame(frame, options));
}

template <typename T>
Bytes with(Bytes bytes, std::size_t at, T value) {
  std::memcpy(bytes.data() + at, &value, sizeof(T));
  return bytes;
}

std::string refusal(const Bytes& bytes, const DecodeLimits& limits = {}) {
  const auto frame = decode_frame(bytes, limits);
  return frame ? "no error" : frame.error().message;
}

std::size_t u32_at(const Bytes& bytes, std::size_t at) {
  std::uint32_t value = 0;
  std::memcpy(&value, bytes.data() + at, 4);
  return value;
}

TEST(HostileFrame, ANewerVersionIsNamed) {
  EXPECT_NE(refusal(with<std::uint8_t>(valid(), 4, 2)).find("version 2"), std::string::npos);
  EXPECT_FALSE(read_frame_header(with<std::uint8_t>(valid(), 4, 0)).ok());
}

TEST(HostileFrame, OnlyAFrameOfAKnownVersionIsAKeyFrame) {
  const Bytes bytes = valid();
  EXPECT_TRUE(is_key_frame(bytes));
  EXPECT_FALSE(is_key_frame(with<std::uint8_t>(bytes, 5, 0)));
  EXPECT_FALSE(is_key_frame(with<std::uint8_t>(bytes, 4, 2)));
  EXPECT_FALSE(is_key_frame(with<std::uint8_t>(bytes, 0, 'X')));
  EXPECT_FALSE(is_key_frame(std::span(bytes).first(63)));
  EXPECT_FALSE(is_key_frame({}));
}

TEST(HostileFrame, UnknownFlagsAndCodecsAreRefused) {
  EXPECT_NE(refusal(with<std::uint8_t>(valid(), 5, 3)).find("flags"), std::string::npos);
  EXPECT_NE(refusal(with<std::uint8_t>(valid(), 65, 7)).find("codec 7"), std::string::npos);
  EXPECT_NE(refusal(with<std::uint8_t>(valid(), 73, 9)).find("codec 9"), std::string::npos);
}

TEST(HostileFrame, LaterFieldsAndSectionsAreSteppedOver) {
  const Bytes old = valid();
  // A later writer: 8 more bytes of fixed fields, entries 4 bytes longer, one more section of kind 200.
  Bytes newer(old.begin(), old.begin() + 64);
  newer = with<std::uint16_t>(newer, 6, 64 + 8 + 3 * 12);
  newer = with<std::uint8_t>(newer, 56, 3);
  newer = with<std::uint8_t>(newer, 57, 12);
  newer = with<std::uint16_t>(newer, 58, 72);
  newer.insert(newer.end(), 8, 0xee);
  newer.insert(newer.end(), old.begin() + 64, old.begin() + 72);
  newer.insert(newer.end(), 4, 0xee);
  const Bytes extra{200, 1, 0, 0, 5, 0, 0, 0, 1, 2, 3, 4};
  newer.insert(newer.end(), extra.begin(), extra.end());
  newer.insert(newer.end(), old.begin() + 72, old.begin() + 80);
  newer.insert(newer.end(), 4, 0xee);
  const auto geometry_end = old.begin() + 80 + static_cast<std::ptrdiff_t>(u32_at(old, 68));
  newer.insert(newer.end(), old.begin() + 80, geometry_end);
  newer.insert(newer.end(), 5, 0x55);
  newer.insert(newer.end(), geometry_end, old.end());
  const auto a = decode_frame(old);
  const auto b = decode_frame(newer);
  ASSERT_TRUE(a.ok());
  ASSERT_TRUE(b.ok()) << b.error().message;
  EXPECT_EQ(a->surface.positions, b->surface.positions);
  EXPECT_EQ(a->texture.size(), b->texture.size());
  // The same section marked as needed.
  EXPECT_NE(refusal(with<std::uint16_t>(newer, 72 + 12 + 2, 1)).find("kind 200"), std::string::npos);
}

TEST(HostileFrame, EveryTruncationIsRefused) {
  for (const bool points : {false, true}) {
    const Bytes whole = valid(5, points);
    ASSERT_TRUE(decode_frame(whole).ok());
    for (std::size_t size = 0; size < whole.size(); ++size)
      ASSERT_FALSE(decode_frame(std::span(whole).first(size)).ok()) << size;
  }
}

TEST(HostileFrame, TrailingBytesAreRefused) {
  Bytes bytes = valid();
  bytes.push_back(0);
  EXPECT_NE(refusal(bytes).find("1 bytes behind"), std::string::npos);
}

TEST(HostileFrame, CountsThatDisagreeAreRefused) {
  const Bytes bytes = valid();
  EXPECT_NE(refusal(with<std::uint32_t>(bytes, 40, 100)).find("declares 100"), std::string::npos);
  EXPECT_NE(refusal(with<std::uint32_t>(bytes, 44, 100)).find("and 100"), std::string::npos);
  EXPECT_NE(refusal(with<std::uint32_t>(bytes, 48, 41)).find("41x30"), std::string::npos);
  EXPECT_FALSE(decode_frame(with<std::uint32_t>(bytes, 40, 0)).ok());
}

TEST(HostileFrame, LimitsAreKept) {
  const Bytes bytes = valid();
  EXPECT_NE(refusal(bytes, {.vertices = 10}).find("limit of 10"), std::string::npos);
  EXPECT_NE(refusal(bytes, {.triangles = 10}).find("limit of 10"), std::string::npos);
  EXPECT_NE(refusal(bytes, {.texture_pixels = 10}).find("limit of 10"), std::string::npos);
}

/// A stream of a few bytes that declares millions must be refused at its declaration, not when memory is
/// gone.
TEST(HostileFrame, ASmallStreamThatDeclaresMillionsCostsNothing) {
  Bytes bytes = valid();
  const Bytes draco{'D', 'R', 'A', 'C', 'O', 2, 2, 1, 1, 0, 0, 0,
                    // vertices and triangles as varints: 4,000,000 and 7,999,999
                    0x80, 0x92, 0xf4, 0x01, 0xff, 0xa3, 0xe8, 0x03, 0};
  bytes.resize(80);
  bytes = with<std::uint32_t>(bytes, 40, 4'000'000);
  bytes = with<std::uint32_t>(bytes, 44, 7'999'999);
  bytes = with<std::uint8_t>(bytes, 56, 1);
  bytes = with<std::uint16_t>(bytes, 6, 72);
  bytes = with<std::uint32_t>(bytes, 48, 0);
  bytes = with<std::uint32_t>(bytes, 52, 0);
  bytes = with<std::uint32_t>(bytes, 68, static_cast<std::uint32_t>(draco.size()));
  bytes.resize(72);
  bytes.insert(bytes.end(), draco.begin(), draco.end());
  EXPECT_NE(refusal(bytes).find("can hold"), std::string::npos);
  // The frame declares little, the stream much.
  EXPECT_NE(refusal(with<std::uint32_t>(with<std::uint32_t>(bytes, 40, 4), 44, 3)).find("7999999"),
            std::string::npos);
}

TEST(HostileFrame, DracoStreamsThatTheFormatDoesNotAllowAreRefused) {
  const Bytes bytes = valid();
  EXPECT_NE(refusal(with<std::uint8_t>(bytes, 80 + 8, 0)).find("does not allow"), std::string::npos);
  EXPECT_NE(refusal(with<std::uint8_t>(bytes, 80 + 5, 1)).find("does not allow"), std::string::npos);
  EXPECT_NE(refusal(with<std::uint16_t>(bytes, 80 + 9, 0x8000)).find("does not allow"), std::string::npos);
  EXPECT_NE(refusal(with<std::uint8_t>(bytes, 80, 'd')).find("not a Draco"), std::string::npos);
}

/// Each mutated frame is refused or is a sound frame within the limits; the process stays small.
void mutate(const Bytes& original, std::uint64_t seed, int rounds) {
  test::Random random(seed);
  int survived = 0;
  for (int round = 0; round < rounds; ++round) {
    Bytes bytes = original;
    const std::uint32_t changes = 1 + random.below(4);
    for (std::uint32_t i = 0; i < changes; ++i) {
      const std::size_t at = random.below(static_cast<std::uint32_t>(bytes.size()));
      switch (random.below(4)) {
        case 0:
          bytes[at] ^= static_cast<std::uint8_t>(1u << random.below(8));
          break;
        case 1:
          bytes[at] = static_cast<std::uint8_t>(random.bits());
          break;
        case 2:
          bytes[at] = 0xff;
          break;
        default:  // a run copied from elsewhere
          for (std::size_t k = 0; k < 8 && at + k < bytes.size(); ++k)
            bytes[at + k] = original[(at * 7 + k) % original.size()];
      }
    }
    const auto frame = decode_frame(bytes);
    if (!frame) continue;
    ++survived;
    const std::size_t count = frame->surface.positions.size();
    ASSERT_LE(count, 24 * bytes.size());
    for (const Vec3f& p : frame->surface.positions)
      ASSERT_TRUE(std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]));
    for (const Triangle& t : frame->surface.triangles)
      for (const std::uint32_t index : t) ASSERT_LT(index, count);
    ASSERT_TRUE(frame->surface.normals.empty() || frame->surface.normals.size() == count);
  }
  EXPECT_LT(survived, rounds);
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  testing::Test::RecordProperty("survived", survived);
  testing::Test::RecordProperty("peak_kib", static_cast<int>(usage.ru_maxrss));
  EXPECT_LT(usage.ru_maxrss, 1'000'000) << "kibibytes";
}

TEST(FrameFuzz, MutatedMeshFrames) {
  mutate(valid(5), 1, 4000);
}
TEST(FrameFuzz, MutatedMeshFramesOfTheSmallestCoding) {
  mutate(valid(0), 2, 3000);
}
TEST(FrameFuzz, MutatedPointFrames) {
  mutate(valid(5, true), 3, 3000);
}

TEST(FrameFuzz, Noise) {
  test::Random random(4);
  const Bytes start = valid();
  for (int round = 0; round < 3000; ++round) {
    Bytes bytes(start.begin(), start.begin() + random.below(200));
    const std::uint32_t more = random.below(300);
    for (std::uint32_t i = 0; i < more; ++i) bytes.push_back(static_cast<std::uint8_t>(random.bits()));
    EXPECT_FALSE(decode_frame(bytes).ok());
  }
}

}  // namespace
}  // namespace relievo
