// SPDX-License-Identifier: Apache-2.0
// A warm stream allocates nothing: a program of its own, since it counts every operator new of the process.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <new>
#include <optional>
#include <random>
#include <vector>

#include "capture/pattern/repeating.h"
#include "capture/reconstruct/reconstructor.h"
#include "tests/support/striped_scene.h"

namespace {
std::atomic<std::size_t> allocations{0};

void* counted(std::size_t size, std::size_t alignment) {
  ++allocations;
  const std::size_t whole = (size + alignment - 1) / alignment * alignment;
  void* memory = std::aligned_alloc(alignment, whole > 0 ? whole : alignment);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}
}  // namespace

void* operator new(std::size_t size) {
  return counted(size, alignof(std::max_align_t));
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  return counted(size, static_cast<std::size_t>(alignment));
}
// Not inlined: GCC would see free() beside a new that it did not inline, and warn of a mismatch.
[[gnu::noinline]] void operator delete(void* memory) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::align_val_t) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::size_t, std::align_val_t) noexcept {
  std::free(memory);
}

namespace relievo {
namespace {

class WarmStream : public testing::TestWithParam<std::tuple<Decoder, Scan, int>> {};

TEST_P(WarmStream, AllocatesNothing) {
  const auto [decoder, scan, threads] = GetParam();
  const test::StripedScene scene = test::striped_scene(scan);
  std::vector<CapturedFrame> frames;
  for (std::uint64_t n = 0; n < 2; ++n) frames.push_back(test::draw_frame(scene, n));
  auto made = Reconstructor::create(scene.rig, scene.pattern, {.decoder = decoder, .threads = threads});
  ASSERT_TRUE(made);
  std::size_t surfaces = 0;
  const auto run = [&](int rounds) {
    for (int i = 0; i < rounds; ++i) {
      auto result = made->add(frames[static_cast<std::size_t>(i % 2)]);
      if (!result || !*result) continue;
      surfaces += !(*result)->surface.triangles.empty();
      made->recycle(*std::move(*result));
    }
  };
  const std::size_t at_start = allocations;
  run(6);
  ASSERT_GT(allocations, at_start);  // the counter counts
  surfaces = 0;
  const std::size_t warm = allocations;
  run(10);
  EXPECT_EQ(allocations, warm);
  EXPECT_EQ(surfaces, 10U);
}

INSTANTIATE_TEST_SUITE_P(
    , WarmStream,
    testing::Combine(testing::Values(Decoder::kOrdered, Decoder::kQuick, Decoder::kPaper),
                     testing::Values(Scan::kInterlaced, Scan::kProgressive), testing::Values(1, 3)));

/// The same under every scheme, whose surfaces come from one or two frames each, with noise.
class WarmScheme : public testing::TestWithParam<std::tuple<Scheme, Decoder>> {};

TEST_P(WarmScheme, AllocatesNothing) {
  const auto [scheme, decoder] = GetParam();
  test::StripedScene scene = test::striped_scene();
  if (scheme == Scheme::kOneSlide) scene.pattern = *make_repeating_pattern(6, 3, 32);
  scene.pattern.scheme = scheme;
  std::mt19937 random(4);
  std::normal_distribution<float> noise(0, 2);
  std::vector<CapturedFrame> frames;
  for (std::uint64_t n = 0; n < 6; ++n) {
    frames.push_back(test::draw_scheme_frame(scene, n));
    Image8& picture = frames.back().picture;
    for (std::size_t i = 0; i < picture.size(); ++i)
      picture.data()[i] = static_cast<std::uint8_t>(
          std::clamp(static_cast<float>(picture.data()[i]) + noise(random), 0.F, 255.F));
  }
  auto made = Reconstructor::create(scene.rig, scene.pattern, {.decoder = decoder, .threads = 3});
  ASSERT_TRUE(made);
  std::size_t surfaces = 0;
  std::uint64_t next = 0;
  const auto run = [&](int rounds) {
    for (int i = 0; i < rounds; ++i, ++next) {
      CapturedFrame& frame = frames[next % frames.size()];
      frame.time_ns = std::llround(static_cast<double>(next) * 1e9 / scene.rig.frame_rate);
      auto result = made->add(frame);
      if (!result) continue;
      for (std::optional<Frame3D> surface = *std::move(result); surface; surface = made->next()) {
        surfaces += !surface->surface.triangles.empty();
        made->recycle(*std::move(surface));
      }
    }
  };
  run(18);
  surfaces = 0;
  const std::size_t warm = allocations;
  run(12);
  EXPECT_EQ(allocations, warm);
  EXPECT_GE(surfaces, 8U);
}

INSTANTIATE_TEST_SUITE_P(, WarmScheme,
                         testing::Combine(testing::Values(Scheme::kComplementary, Scheme::kWhiteField,
                                                          Scheme::kWhiteFrame, Scheme::kOneSlide),
                                          testing::Values(Decoder::kOrdered, Decoder::kQuick)));

TEST(Recycle, MemoryThatCameBackChangesNothing) {
  const test::StripedScene scene = test::striped_scene();
  auto kept = Reconstructor::create(scene.rig, scene.pattern, {});
  auto recycled = Reconstructor::create(scene.rig, scene.pattern, {});
  ASSERT_TRUE(kept && recycled);
  for (std::uint64_t n = 0; n < 6; ++n) {
    auto a = kept->add(test::draw_frame(scene, n));
    auto b = recycled->add(test::draw_frame(scene, n));
    ASSERT_TRUE(a && b);
    ASSERT_EQ(a->has_value(), b->has_value());
    if (!*a) continue;
    const Surface& s = (*a)->surface;
    const Surface& r = (*b)->surface;
    EXPECT_EQ(s.positions, r.positions);
    EXPECT_EQ(s.normals, r.normals);
    EXPECT_EQ(s.triangles, r.triangles);
    EXPECT_EQ(s.texture_coordinates, r.texture_coordinates);
    EXPECT_TRUE(
        std::equal((*a)->texture.data(), (*a)->texture.data() + (*a)->texture.size(), (*b)->texture.data()));
    // Whatever was in it.
    (*b)->surface.positions.resize(7 + 1000 * (n % 2));
    (*b)->surface.triangles.assign(5, {1, 2, 3});
    recycled->recycle(*std::move(*b));
  }
}

TEST(Recycle, AFrameWithoutTextureHasNone) {
  const test::StripedScene scene = test::striped_scene();
  auto made = Reconstructor::create(scene.rig, scene.pattern, {.texture = false});
  ASSERT_TRUE(made);
  Frame3D foreign;
  foreign.texture = Image8(8, 8, 3);
  made->recycle(std::move(foreign));
  ASSERT_TRUE(made->add(test::draw_frame(scene, 0)));
  auto frame = made->add(test::draw_frame(scene, 1));
  ASSERT_TRUE(frame && *frame);
  EXPECT_TRUE((*frame)->texture.empty());
}

}  // namespace
}  // namespace relievo
