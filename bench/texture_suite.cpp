// SPDX-License-Identifier: Apache-2.0
// Texture codecs on the same pictures: size, time, error. The table of rows is below.
#include <CLI/CLI.hpp>
#include <cmath>
#include <functional>
#include <memory>
#include <opencv2/imgcodecs.hpp>

#include "base/time.h"
#include "bench/frames.h"
#include "bench/report.h"
#include "bench/suites.h"
#include "codec/jpeg_texture.h"

namespace relievo::bench {
namespace {

struct Options {
  std::string source = "sim:face";
  int frames = 20;
  int rounds = 3;
  bool json = false;
};

struct Codec {
  std::string name;
  std::function<Result<Bytes>(const Image8&)> encode;
  std::function<Result<Image8>(const Bytes&, const Image8& like)> decode;  // of `like` the size alone
};

Codec jpeg(int quality) {
  return {"jpeg-q" + std::to_string(quality),
          [quality](const Image8& picture) -> Result<Bytes> {
            Bytes bytes;
            if (const Status done = append_jpeg(picture.view(), quality, bytes); !done) return done.error();
            return bytes;
          },
          [](const Bytes& bytes, const Image8& like) {
            return decode_jpeg(bytes, static_cast<std::uint32_t>(like.width()),
                               static_cast<std::uint32_t>(like.height()));
          }};
}

/// The reference: lossless. Red and blue change places on the way, which costs a PNG nothing.
Codec png() {
  return {"png",
          [](const Image8& picture) -> Result<Bytes> {
            try {
              // OpenCV has no matrix of constant memory; imencode only reads.
              const cv::Mat mat(picture.height(), picture.width(), CV_8UC(picture.channels()),
                                const_cast<std::uint8_t*>(picture.data()));
              Bytes bytes;
              if (cv::imencode(".png", mat, bytes)) return bytes;
            } catch (const cv::Exception& e) {
              return Error{std::string("cannot encode a PNG: ") + e.what()};
            }
            return Error{"cannot encode a PNG"};
          },
          [](const Bytes& bytes, const Image8& like) -> Result<Image8> {
            try {
              Image8 picture(like.width(), like.height(), like.channels());
              cv::Mat mat(picture.height(), picture.width(), CV_8UC(picture.channels()), picture.data());
              cv::imdecode(bytes, cv::IMREAD_UNCHANGED, &mat);
              if (mat.data == picture.data()) return picture;
            } catch (const cv::Exception& e) {
              return Error{std::string("cannot decode a PNG: ") + e.what()};
            }
            return Error{"a PNG decoded to another size than it was encoded from"};
          }};
}

/// A codec is a row here.
std::vector<Codec> codecs() {
  std::vector<Codec> all{png()};
  for (const int quality : {60, 75, 80, 90, 95}) all.push_back(jpeg(quality));
  return all;
}

/// Over all samples of all channels.
double mean_square_error(const Image8& a, const Image8& b) {
  double squares = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double d = static_cast<double>(a.data()[i]) - static_cast<double>(b.data()[i]);
    squares += d * d;
  }
  return squares / static_cast<double>(a.size());
}

struct Samples {
  std::vector<double> bytes, bits_a_pixel, encode_ms, decode_ms, psnr_db;
  bool lossless = true;
};

Status measure(const Codec& codec, const Image8& picture, Samples& samples) {
  const std::int64_t begin = steady_now_ns();
  const auto bytes = codec.encode(picture);
  const std::int64_t encoded = steady_now_ns();
  if (!bytes) return bytes.error().in(codec.name);
  const std::int64_t decode_begin = steady_now_ns();
  const auto decoded = codec.decode(*bytes, picture);
  const std::int64_t end = steady_now_ns();
  if (!decoded) return decoded.error().in(codec.name);
  if (decoded->size() != picture.size()) return Error{codec.name + ": the picture came back in another size"};
  samples.bytes.push_back(static_cast<double>(bytes->size()));
  samples.bits_a_pixel.push_back(8 * static_cast<double>(bytes->size()) /
                                 (static_cast<double>(picture.width()) * picture.height()));
  samples.encode_ms.push_back(milliseconds(encoded - begin));
  samples.decode_ms.push_back(milliseconds(end - decode_begin));
  const double error = mean_square_error(picture, *decoded);
  if (error > 0) {
    samples.lossless = false;
    samples.psnr_db.push_back(10 * std::log10(255.0 * 255.0 / error));
  }
  return {};
}

Status run(const Options& options, StopSignal& stop) {
  const auto loop = FrameLoop::load(options.source, options.frames + 1, stop);
  if (!loop) return loop.error();
  if (!*loop) return {};
  const auto frames = reconstruct_all(**loop, ReconstructOptions{}.decoder, stop);
  if (!frames) return frames.error();
  if (!*frames) return {};

  // Round by round, so that whatever else the machine does meets all codecs alike.
  const std::vector<Codec> all = codecs();
  std::vector<Samples> samples(all.size());
  Samples warm_up;
  for (int round = 0; round < options.rounds; ++round) {
    for (std::size_t c = 0; c < all.size(); ++c) {
      if (const Status done = measure(all[c], (*frames)->front().texture, warm_up); !done) return done;
      for (const Frame3D& frame : **frames) {
        if (stop.stopped()) return {};
        if (const Status done = measure(all[c], frame.texture, samples[c]); !done) return done;
      }
    }
  }
  std::vector<Row> rows;
  for (std::size_t c = 0; c < all.size(); ++c) {
    const Samples& of = samples[c];
    // No number where nothing was lost: it would be infinite.
    const Value psnr = of.psnr_db.empty() ? Value() : Value(spread_of(of.psnr_db));
    rows.push_back({all[c].name,
                    {{"bytes", spread_of(of.bytes)},
                     {"bits_per_pixel", spread_of(of.bits_a_pixel)},
                     {"encode_ms", spread_of(of.encode_ms)},
                     {"decode_ms", spread_of(of.decode_ms)},
                     {"psnr_db", psnr},
                     {"lossless", of.lossless}}});
  }
  const Image8& picture = (*frames)->front().texture;
  print({.suite = "texture",
         .settings = {{"source", options.source},
                      {"frames", static_cast<double>((*frames)->size())},
                      {"rounds", static_cast<double>(options.rounds)},
                      {"width", static_cast<double>(picture.width())},
                      {"height", static_cast<double>(picture.height())}},
         .figures = {{"raw_bytes", static_cast<double>(picture.size())}},
         .rows = std::move(rows),
         .notes = {"Reference: png, lossless. PSNR over all samples of red, green and blue."}},
        options.json);
  return {};
}

}  // namespace

Command texture_suite() {
  return {"texture", "Texture codecs: bytes, time and PSNR", [](CLI::App& app) {
            auto options = std::make_shared<Options>();
            app.add_option("--source", options->source, "sim:SCENE[,KEY=VALUE...] or take:DIR")
                ->capture_default_str();
            app.add_option("--frames", options->frames, "Pictures to code")
                ->check(CLI::Range(1, 10000))
                ->capture_default_str();
            app.add_option("--rounds", options->rounds, "Times that each codec codes all of them")
                ->check(CLI::Range(1, 1000))
                ->capture_default_str();
            app.add_flag("--json", options->json, "Print JSON");
            return [options](StopSignal& stop) { return run(*options, stop); };
          }};
}

}  // namespace relievo::bench
