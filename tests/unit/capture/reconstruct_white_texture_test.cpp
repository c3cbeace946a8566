// SPDX-License-Identifier: Apache-2.0
// What is left of the stripes in the texture, measured against the same scene rendered in white light.
#include "capture/reconstruct/white_texture.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "capture/reconstruct/reconstructor.h"
#include "capture/reconstruct/texture.h"
#include "tests/support/simulated.h"

namespace relievo {
namespace {

/// A scene under stripes, and in white light without noise.
struct Filmed : test::Simulated {
  using Simulated::Simulated;

  /// A white field and a black one, added.
  Image8 white(std::uint64_t index) const {
    sim::SimOptions o = options;
    o.noise = 0;
    o.scan = Scan::kProgressive;
    Pattern all_white = pattern;
    for (Primary& p : all_white.palette) p = 7;
    const sim::Renderer in_white(o, sim::make_rig(o, scene->view()), all_white, scene);
    const CameraResponse response(rig.camera_gamma);
    const sim::RenderedFrame r = in_white.render(index, false);
    Image8 out = r.picture.clone();
    for (std::size_t i = 0; i < out.size(); ++i)
      out.data()[i] = response.value_of(response.light_of(r.picture.data()[i]) +
                                        response.light_of(r.complement.data()[i]));
    return out;
  }
};

Image8 added(const CapturedFrame& frame) {
  WorkerPool pool(1);
  Image8 out;
  add_fields(frame, pool, out);
  return out;
}

/// The texture that reconstruction gives of the second of two frames in a row.
Image8 reconstructed(const Filmed& filmed, const CapturedFrame& first, const CapturedFrame& second,
                     int threads = 1, Decoder decoder = Decoder::kOrdered) {
  auto reconstructor =
      Reconstructor::create(filmed.rig, filmed.pattern, {.decoder = decoder, .threads = threads});
  EXPECT_TRUE(reconstructor.ok()) << reconstructor.error().message;
  EXPECT_TRUE(reconstructor->add(first).ok());
  auto frame = reconstructor->add(second);
  EXPECT_TRUE(frame.ok() && *frame);
  return std::move((*frame)->texture);
}

/// Sum of what the channels of two pixels differ by.
int difference(const std::uint8_t* a, const std::uint8_t* b) {
  return std::abs(a[0] - b[0]) + std::abs(a[1] - b[1]) + std::abs(a[2] - b[2]);
}

/// dB, over the pixels that `counts(x, y)`; `margin` rows at either end do not.
template <typename Counts>
double psnr_where(const Image8& texture, const Image8& white, int margin, const Counts& counts) {
  double sum = 0;
  std::size_t count = 0;
  for (int y = margin; y + margin < white.height(); ++y) {
    for (int x = 0; x < white.width(); ++x) {
      if (!counts(x, y)) continue;
      for (int c = 3 * x; c < 3 * x + 3; ++c) {
        const double e = texture.row(y)[c] - white.row(y)[c];
        sum += e * e;
        ++count;
      }
    }
  }
  return 10 * std::log10(255.0 * 255.0 * static_cast<double>(count) / sum);
}

/// Over the pixels where the white picture differs by `contrast` or more from row to row.
double psnr(const Image8& texture, const Image8& white, int contrast) {
  return psnr_where(texture, white, 2, [&](int x, int y) {
    return difference(white.row(y + 1) + 3 * x, white.row(y - 1) + 3 * x) >= contrast;
  });
}

/// Over the pixels that are others a frame later.
double psnr_moving(const Image8& texture, const Image8& white, const Image8& later) {
  constexpr int kOther = 6;  // grey levels of all channels
  return psnr_where(texture, white, 0, [&](int x, int y) {
    return difference(white.row(y) + 3 * x, later.row(y) + 3 * x) >= kOther;
  });
}

/// The same of those that are drawn: about the middles of the surface's triangles.
double psnr_drawn(const Surface& surface, const Image8& texture, const Image8& white, const Image8& later) {
  constexpr int kReach_px = 2;
  Image8 drawn(white.width(), white.height(), 1);
  std::fill_n(drawn.data(), drawn.size(), std::uint8_t{0});
  for (const auto& triangle : surface.triangles) {
    float x = 0;
    float y = 0;
    for (const std::uint32_t vertex : triangle) {
      x += surface.texture_coordinates[vertex][0] / 3;
      y += surface.texture_coordinates[vertex][1] / 3;
    }
    const int column = static_cast<int>(x * static_cast<float>(white.width()));
    const int row = static_cast<int>(y * static_cast<float>(white.height()));
    for (int v = std::max(0, row - 1); v <= std::min(white.height() - 1, row + 1); ++v)
      for (int u = std::max(0, column - kReach_px); u <= std::min(white.width() - 1, column + kReach_px); ++u)
        drawn.row(v)[u] = 1;
  }
  return psnr_where(texture, white, 0, [&](int x, int y) {
    return drawn.row(y)[x] != 0 && difference(white.row(y) + 3 * x, later.row(y) + 3 * x) >= 6;
  });
}

/// Root mean square of what differs from the mean over some stripes on the line, as a share of that mean.
double stripe_residue(const Image8& texture) {
  constexpr int kReach = 24;
  double sum = 0;
  std::size_t count = 0;
  for (int y = 20; y + 20 < texture.height(); y += 3) {
    for (int x = 60; x + 60 < texture.width(); ++x) {
      for (int c = 0; c < 3; ++c) {
        double mean = 0;
        for (int d = -kReach; d <= kReach; ++d) mean += texture.row(y)[3 * (x + d) + c];
        mean /= 2 * kReach + 1;
        const double e = texture.row(y)[3 * x + c] / mean - 1;
        sum += e * e;
        ++count;
      }
    }
  }
  return std::sqrt(sum / static_cast<double>(count));
}

/// The complement as of a projector (or an exposure) that shows its primaries at these levels.
void dim_complement(const Filmed& filmed, const std::array<double, 3>& levels, CapturedFrame& frame) {
  const auto& m = filmed.rig.colour_matrix;
  // Back from projected to captured colours, by Cramer's rule.
  std::array<double, 9> inverse{};
  double det = 0;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      inverse[3 * j + i] = m[3 * ((i + 1) % 3) + (j + 1) % 3] * m[3 * ((i + 2) % 3) + (j + 2) % 3] -
                           m[3 * ((i + 1) % 3) + (j + 2) % 3] * m[3 * ((i + 2) % 3) + (j + 1) % 3];
  for (std::size_t j = 0; j < 3; ++j) det += m[j] * inverse[3 * j];
  const bool interlaced = frame.scan == Scan::kInterlaced;
  Image8& picture = interlaced ? frame.picture : frame.complement;
  for (int y = interlaced ? 1 : 0; y < picture.height(); y += interlaced ? 2 : 1) {
    for (int x = 0; x < picture.width(); ++x) {
      std::uint8_t* p = picture.row(y) + 3 * x;
      std::array<double, 3> projected{};
      for (std::size_t i = 0; i < 3; ++i)
        projected[i] = levels[i] * (m[3 * i] * p[0] + m[3 * i + 1] * p[1] + m[3 * i + 2] * p[2]);
      for (std::size_t i = 0; i < 3; ++i) {
        double value = 0;
        for (std::size_t j = 0; j < 3; ++j) value += inverse[3 * i + j] * projected[j] / det;
        p[i] = static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0, 255.0)));
      }
    }
  }
}

TEST(WhiteTexture, RowsComeFromTheirOwnSurface) {
  const Filmed filmed("object");
  const CapturedFrame second = filmed.frame(11);
  const Image8 white = filmed.white(11);
  const Image8 sum = added(second);
  const Image8 texture = reconstructed(filmed, filmed.frame(10), second);
  RecordProperty("psnr_added", std::to_string(psnr(sum, white, 0)));
  RecordProperty("psnr", std::to_string(psnr(texture, white, 0)));
  EXPECT_GT(psnr(texture, white, 0), psnr(sum, white, 0) + 2);
  EXPECT_GT(psnr(texture, white, 40), psnr(sum, white, 40) + 5);
}

TEST(WhiteTexture, IsNoWorseOfWhatMoves) {
  for (const std::string scene : {"walk", "face"}) {
    const Filmed filmed(scene);
    const CapturedFrame second = filmed.frame(21);
    const Image8 white = filmed.white(21);
    const Image8 later = filmed.white(22);
    const double texture = psnr_moving(reconstructed(filmed, filmed.frame(20), second), white, later);
    RecordProperty("psnr_moving_" + scene, std::to_string(texture));
    EXPECT_GT(texture, psnr_moving(added(second), white, later) - 0.3) << scene;
  }
}

// A person walks: the fields' sum has stripes on body and legs.
TEST(MovingTexture, StripesAreGoneFromTheSurfaceOfWhatMoves) {
  struct Case {
    std::string scene;
    Decoder decoder;
    double better;  // dB
    int line_stride = 1;
  };
  for (const Case& c :
       {Case{"walk", Decoder::kOrdered, 0.5}, Case{"walk", Decoder::kQuick, 0.6},
        Case{"walk,seed=5", Decoder::kOrdered, 0.6}, Case{"walk,field_order=bottom", Decoder::kOrdered, 0.5},
        Case{"walk,roll=180", Decoder::kQuick, 0.5}, Case{"walk", Decoder::kQuick, 0.3, 2},
        Case{"walk,scheme=one-slide", Decoder::kOrdered, 0.3},
        Case{"walk,scan=progressive,width=1280,height=720,stripes=120", Decoder::kOrdered, 1.5}}) {
    const Filmed filmed(c.scene);
    auto reconstructor = Reconstructor::create(filmed.rig, filmed.pattern,
                                               {.decoder = c.decoder, .line_stride = c.line_stride});
    ASSERT_TRUE(reconstructor.ok()) << reconstructor.error().message;
    constexpr std::uint64_t kFirst = 12, kLast = 21;
    Frame3D frame;
    for (std::uint64_t i = kFirst; i <= kLast; ++i) {
      auto made = reconstructor->add(filmed.frame(i));
      ASSERT_TRUE(made.ok());
      if (*made) frame = std::move(**made);
    }
    const Image8 white = filmed.white(kLast);
    const Image8 later = filmed.white(kLast + 1);
    const double mended = psnr_drawn(frame.surface, frame.texture, white, later);
    const double sum = psnr_drawn(frame.surface, added(filmed.frame(kLast)), white, later);
    const std::string name =
        c.scene + " " + std::string(decoder_name(c.decoder)) + " " + std::to_string(c.line_stride);
    RecordProperty(name, std::to_string(mended));
    RecordProperty(name + " added", std::to_string(sum));
    EXPECT_GT(mended, sum + c.better) << c.scene;
  }
}

TEST(WhiteTexture, IsNoWorseWhereNothingIsAmiss) {
  for (const char* spec : {"plane", "plane,scan=progressive", "face"}) {
    const Filmed filmed(spec);
    const CapturedFrame second = filmed.frame(11);
    const Image8 white = filmed.white(11);
    const Image8 texture = reconstructed(filmed, filmed.frame(10), second);
    // A quarter of a grey level, by which adding rounds up, can be in its favour.
    EXPECT_GT(psnr(texture, white, 0), psnr(added(second), white, 0) - 0.3) << spec;
  }
}

TEST(WhiteTexture, LevelsAComplementOfOtherBrightness) {
  for (const char* spec : {"plane,noise=0", "plane,noise=0,scan=progressive"}) {
    SCOPED_TRACE(spec);
    const Filmed filmed(spec);
    CapturedFrame first = filmed.frame(10);
    CapturedFrame second = filmed.frame(11);
    const double clean = stripe_residue(added(second));
    for (CapturedFrame* f : {&first, &second}) dim_complement(filmed, {0.85, 0.92, 0.75}, *f);
    const double sum = stripe_residue(added(second));
    const double levelled = stripe_residue(reconstructed(filmed, first, second));
    RecordProperty(std::string(spec) + " clean", std::to_string(clean));
    RecordProperty(std::string(spec) + " added", std::to_string(sum));
    RecordProperty(std::string(spec) + " levelled", std::to_string(levelled));
    EXPECT_GT(sum, 0.03);
    EXPECT_LT(levelled, 0.25 * sum);
    EXPECT_LT(levelled, clean + 0.006);
  }
}

// What light adds up to, in the camera's own values: as good as of a camera without a curve, where dark
// levels are as fine as they were captured.
TEST(WhiteTexture, ACurvedCamerasLightAddsUp) {
  const std::pair<std::string, double> scenes[] = {
      {"object", 33}, {"face,scan=progressive,width=320,height=240,stripes=60", 33}, {"walk", 29}};
  for (const auto& [scene, least] : scenes) {
    for (const Decoder decoder : {Decoder::kOrdered, Decoder::kQuick}) {
      const Filmed curved(scene + ",gamma=2.2");
      Filmed untold(scene + ",gamma=2.2");
      untold.rig.camera_gamma = 1;
      const Image8 white = curved.white(21);
      const auto texture = [&](const Filmed& filmed) {
        return psnr(reconstructed(filmed, filmed.frame(20), filmed.frame(21), 1, decoder), white, 0);
      };
      const double told = texture(curved);
      RecordProperty("psnr_" + scene, std::to_string(told));
      EXPECT_GT(told, least) << scene;
      EXPECT_GT(told, texture(untold) + 3) << scene;
    }
  }
}

TEST(WhiteTexture, GainsAreThoseOfTheComplement) {
  const Filmed filmed("plane,scan=progressive");
  CapturedFrame first = filmed.frame(10);
  CapturedFrame second = filmed.frame(11);
  for (CapturedFrame* f : {&first, &second}) dim_complement(filmed, {0.8, 1, 0.9}, *f);
  auto reconstructor = Reconstructor::create(filmed.rig, filmed.pattern, {});
  ASSERT_TRUE(reconstructor.ok());
  ASSERT_TRUE(reconstructor->add(first).ok());
  auto frame = reconstructor->add(second);
  ASSERT_TRUE(frame.ok() && *frame);
  DecodedGrid grid;
  grid.reset(filmed.pattern.boundaries(), filmed.rig.camera.height);
  for (const GridPoint& at : (*frame)->surface.grid)
    grid.put(at.line, at.boundary, at.column_px, at.sigma_px, 0);
  WhiteTexture texture(filmed.rig.colour_matrix, CameraResponse());
  WorkerPool pool(1);
  Image8 out;
  texture.make({second, second}, grid, pool, out);
  EXPECT_NEAR(texture.gains()[0], 1 / 0.8, 0.03);
  EXPECT_NEAR(texture.gains()[1], 1, 0.03);
  EXPECT_NEAR(texture.gains()[2], 1 / 0.9, 0.03);
  grid.reset(filmed.pattern.boundaries(), filmed.rig.camera.height);
  texture.make({second, second}, grid, pool, out);  // nothing tells: as they are
  EXPECT_EQ(texture.gains(), (std::array<float, 3>{1, 1, 1}));
}

TEST(WhiteTexture, ThreadsDoNotChangeIt) {
  const Filmed filmed("object,width=320,height=240,stripes=45");
  const CapturedFrame first = filmed.frame(3);
  const CapturedFrame second = filmed.frame(4);
  const Image8 one = reconstructed(filmed, first, second);
  const Image8 three = reconstructed(filmed, first, second, 3);
  ASSERT_EQ(one.size(), three.size());
  EXPECT_TRUE(std::equal(one.data(), one.data() + one.size(), three.data()));
}

TEST(WhiteTexture, SmallPicturesAreAdded) {
  for (const int height : {1, 2, 3, 5}) {
    CapturedFrame frame;
    frame.picture = Image8(7, height, 3);
    std::fill_n(frame.picture.data(), frame.picture.size(), std::uint8_t{60});
    WhiteTexture texture({1, 0, 0, 0, 1, 0, 0, 0, 1}, CameraResponse());
    WorkerPool pool(1);
    Image8 out;
    texture.make({frame, frame}, DecodedGrid(), pool, out);
    ASSERT_EQ(out.height(), height);
    for (std::size_t i = 0; i < out.size(); ++i) EXPECT_EQ(out.data()[i], height == 1 ? 60 : 120);
  }
}

}  // namespace
}  // namespace relievo
