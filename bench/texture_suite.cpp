// SPDX-License-Identifier: Apache-2.0
// Texture codecs on the same pictures: size, time, error. The table of rows is below.
#include <CLI/CLI.hpp>
#include <cmath>
#include <memory>

#include "base/time.h"
#include "bench/frames.h"
#include "bench/options.h"
#include "bench/report.h"
#include "bench/suites.h"
#include "codec/texture_codec.h"

namespace relievo::bench {
namespace {

struct Options {
  std::string source = "sim:face";
  Repeats repeats;
  bool json = false;
};

struct Codec {
  std::string name;
  TextureCodec codec;
  int quality;
};

/// A codec is a row here; H.264 only where this build has it.
std::vector<Codec> codecs() {
  std::vector<Codec> all{{"png", TextureCodec::kPng, 80}};
  for (const int quality : {60, 75, 80, 90, 95})
    all.push_back({"jpeg-q" + std::to_string(quality), TextureCodec::kJpeg, quality});
  for (const int quality : {60, 80, 90})
    all.push_back({"webp-q" + std::to_string(quality), TextureCodec::kWebp, quality});
  if (!check_texture_codec(TextureCodec::kH264)) return all;
  for (const int quality : {40, 60, 70, 80, 90})
    all.push_back({"h264-q" + std::to_string(quality), TextureCodec::kH264, quality});
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
  std::vector<double> bytes, key_bytes, bits_a_pixel, encode_ms, decode_ms, psnr_db;
  bool lossless = true;
};

/// The pictures of one round: a stream, since pictures may build on each other.
class Stream {
 public:
  explicit Stream(const Codec& codec)
      : codec_(codec),
        encoder_(make_texture_encoder(codec.codec)),
        decoder_(make_texture_decoder(codec.codec)) {}

  Status add(const Image8& picture, Samples& samples) {
    Bytes section;
    const std::int64_t begin = steady_now_ns();
    const auto alone = encoder_->encode(picture.view(), {.quality = codec_.quality}, section);
    const std::int64_t encoded = steady_now_ns();
    if (!alone) return alone.error().in(codec_.name);
    const std::int64_t decode_begin = steady_now_ns();
    const Status decoded = decoder_->decode(section, static_cast<std::uint32_t>(picture.width()),
                                            static_cast<std::uint32_t>(picture.height()), decoded_);
    const std::int64_t end = steady_now_ns();
    if (!decoded) return decoded.error().in(codec_.name);
    const bool is_video_key = *alone && codec_.codec == TextureCodec::kH264;
    (is_video_key ? samples.key_bytes : samples.bytes).push_back(static_cast<double>(section.size()));
    samples.bits_a_pixel.push_back(8 * static_cast<double>(section.size()) /
                                   (static_cast<double>(picture.width()) * picture.height()));
    samples.encode_ms.push_back(milliseconds(encoded - begin));
    samples.decode_ms.push_back(milliseconds(end - decode_begin));
    const double error = mean_square_error(picture, decoded_);
    if (error > 0) {
      samples.lossless = false;
      samples.psnr_db.push_back(10 * std::log10(255.0 * 255.0 / error));
    }
    return {};
  }

 private:
  const Codec& codec_;
  std::unique_ptr<TextureEncoder> encoder_;
  std::unique_ptr<TextureDecoder> decoder_;
  Image8 decoded_;
};

Status run(const Options& options, StopSignal& stop) {
  const auto loaded = load_reconstructed(options.source, options.repeats.frames + 1, stop);
  if (!loaded) return loaded.error();
  if (!*loaded) return {};
  const std::vector<Frame3D>& frames = (*loaded)->frames;

  // Round by round, so that whatever else the machine does meets all codecs alike.
  const std::vector<Codec> all = codecs();
  std::vector<Samples> samples(all.size());
  for (int round = 0; round < options.repeats.rounds; ++round) {
    for (std::size_t c = 0; c < all.size(); ++c) {
      Samples warm_up;
      if (const Status done = Stream(all[c]).add(frames.front().texture, warm_up); !done) return done;
      Stream stream(all[c]);
      for (const Frame3D& frame : frames) {
        if (stop.stopped()) return {};
        if (const Status done = stream.add(frame.texture, samples[c]); !done) return done;
      }
    }
  }
  std::vector<Row> rows;
  for (std::size_t c = 0; c < all.size(); ++c) {
    const Samples& of = samples[c];
    // No number where nothing was lost: it would be infinite.
    const Value psnr = of.psnr_db.empty() ? Value() : Value(spread_of(of.psnr_db));
    const Value key = of.key_bytes.empty() ? Value() : Value(spread_of(of.key_bytes));
    const Value bytes =
        of.bytes.empty() ? key : Value(spread_of(of.bytes));  // of one picture: the key picture's
    rows.push_back({all[c].name,
                    {{"bytes", bytes},
                     {"key_bytes", key},
                     {"bits_per_pixel", spread_of(of.bits_a_pixel)},
                     {"encode_ms", spread_of(of.encode_ms)},
                     {"decode_ms", spread_of(of.decode_ms)},
                     {"psnr_db", psnr},
                     {"lossless", of.lossless}}});
  }
  const Image8& picture = frames.front().texture;
  print({.suite = "texture",
         .settings = {{"source", options.source},
                      {"frames", static_cast<double>(frames.size())},
                      {"rounds", static_cast<double>(options.repeats.rounds)},
                      {"width", static_cast<double>(picture.width())},
                      {"height", static_cast<double>(picture.height())}},
         .figures = {{"raw_bytes", static_cast<double>(picture.size())}},
         .rows = std::move(rows),
         .notes = {"Reference: png, lossless. PSNR over all samples of red, green and blue.",
                   "h264: the first picture of a round is a key picture (key_bytes), bytes are those of the "
                   "others."}},
        options.json);
  return {};
}

}  // namespace

Command texture_suite() {
  return {"texture", "Texture codecs: bytes, time and PSNR", [](CLI::App& app) {
            auto options = std::make_shared<Options>();
            add_source_option(app, options->source);
            add_repeat_options(app, options->repeats);
            add_json_option(app, options->json);
            return [options](StopSignal& stop) { return run(*options, stop); };
          }};
}

}  // namespace relievo::bench
