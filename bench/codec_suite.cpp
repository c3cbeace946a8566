// SPDX-License-Identifier: Apache-2.0
// Geometry codecs on the same surfaces: size, time, error. The table of rows is below.
#include <CLI/CLI.hpp>
#include <cstring>
#include <functional>
#include <memory>
#include <span>

#include "base/time.h"
#include "bench/frames.h"
#include "bench/grid_stages.h"
#include "bench/options.h"
#include "bench/report.h"
#include "bench/suites.h"
#include "bench/surface_error.h"
#include "capture/evaluate/score.h"
#include "codec/draco_mesh.h"
#include "codec/frame3d_codec.h"
#include "server/options.h"
#include "server/pipeline.h"
#include "server/working_volume.h"

namespace relievo::bench {
namespace {

struct Options {
  std::string source = "sim:object";
  Repeats repeats;
  std::vector<std::string> only;
  Decoder decoder = ReconstructOptions{}.decoder;
  bool json = false;
};

/// How a stream would code this surface: its box, and the bits that the pipeline's resolution takes in it.
struct Job {
  const Frame3D& frame;
  const ImageF* truth;  // null: not known
  Volume volume;
  int pipeline_bits;
  const Surface& surface = frame.surface;
};

struct Coded {
  Bytes bytes;
  std::uint32_t vertices = 0, triangles = 0;
};

/// `decode` may use the memory of the surface that it is given: the last one's of the same codec, as streams
/// do.
struct Codec {
  std::string name;
  std::function<int(const Job&)> bits;  // a coordinate, of positions
  std::function<Result<Coded>(const Job&)> encode;
  std::function<Status(const Coded&, Surface&)> decode;
};

template <typename T>
void store(Bytes& out, const std::vector<T>& values) {
  const std::size_t at = out.size();
  out.resize(at + values.size() * sizeof(T));
  if (!values.empty()) std::memcpy(out.data() + at, values.data(), values.size() * sizeof(T));
}

template <typename T>
void fetch(std::span<const std::uint8_t>& in, std::size_t count, std::vector<T>& values) {
  values.resize(count);
  if (count > 0) std::memcpy(values.data(), in.data(), count * sizeof(T));
  in = in.subspan(count * sizeof(T));
}

/// The reference: the memory of positions, texture coordinates and triangles as it is.
Codec raw() {
  return {"raw-float32", [](const Job&) { return 32; },
          [](const Job& job) -> Result<Coded> {
            Coded coded;
            coded.vertices = static_cast<std::uint32_t>(job.surface.positions.size());
            coded.triangles = static_cast<std::uint32_t>(job.surface.triangles.size());
            store(coded.bytes, job.surface.positions);
            store(coded.bytes, job.surface.texture_coordinates);
            store(coded.bytes, job.surface.triangles);
            return coded;
          },
          [](const Coded& coded, Surface& surface) -> Status {
            std::span<const std::uint8_t> in(coded.bytes);
            fetch(in, coded.vertices, surface.positions);
            fetch(in, coded.vertices, surface.texture_coordinates);
            fetch(in, coded.triangles, surface.triangles);
            return {};
          }};
}

/// `bits` 0: as the pipeline chooses.
Codec draco(int speed, int bits) {
  const auto bits_of = [bits](const Job& job) { return bits > 0 ? bits : job.pipeline_bits; };
  return {
      "draco-mesh-s" + std::to_string(speed) + (bits > 0 ? "-" + std::to_string(bits) + "bit" : "-pipeline"),
      bits_of,
      [speed, bits_of](const Job& job) -> Result<Coded> {
        EncodeOptions options;
        options.position_bits = bits_of(job);
        options.draco_speed = speed;
        options.volume = job.volume;
        auto encoded = encode_draco(job.surface, options);
        if (!encoded) return encoded.error();
        return Coded{std::move(encoded->bytes), encoded->vertices, encoded->triangles};
      },
      [](const Coded& coded, Surface& surface) -> Status {
        auto decoded = decode_draco(coded.bytes, coded.vertices, coded.triangles);
        if (!decoded) return decoded.error();
        surface = *std::move(decoded);
        return {};
      }};
}

/// Frames without texture, as a stream's encoder and decoder make and read them, one after the other.
Codec grid(const std::string& name, const SourceInfo& source, const EncodeOptions& options) {
  auto encoder = std::make_shared<FrameEncoder>(source.rig, source.pattern);
  auto decoder = std::make_shared<FrameDecoder>();
  auto frame = std::make_shared<Frame3D>();
  return {name, [options](const Job&) { return options.step_bits; },
          [encoder, options](const Job& job) -> Result<Coded> {
            auto bytes = encoder->encode(job.frame, options);
            if (!bytes) return bytes.error();
            const auto header = read_frame_header(*bytes);
            if (!header) return header.error();
            if (header->geometry != options.geometry)
              return Error{"the surface does not lie on the grid of stripes and lines"};
            return Coded{std::move(*bytes), header->vertices, header->triangles};
          },
          [decoder, frame](const Coded& coded, Surface& surface) -> Status {
            std::swap(frame->surface, surface);
            const Status done = decoder->decode(coded.bytes, *frame);
            std::swap(frame->surface, surface);
            return done;
          }};
}

/// A codec is a row here.
std::vector<Codec> codecs(const SourceInfo& source) {
  std::vector<Codec> all{raw()};
  EncodeOptions options;
  options.geometry = GeometryCodec::kGrid;
  options.texture = TextureCodec::kNone;
  options.quality = false;
  all.push_back(grid("grid-1/16px", source, options));
  options.step_bits = 6;
  all.push_back(grid("grid-1/64px", source, options));
  options.step_bits = 4;
  options.key_interval = 10;
  all.push_back(grid("grid-1/16px-delta", source, options));
  options.key_interval = 1;
  options.quality = true;
  all.push_back(grid("grid-1/16px-sigma", source, options));
  options.geometry = GeometryCodec::kDracoGrid;
  all.push_back(grid("draco-grid-1/16px-sigma", source, options));
  options.quality = false;
  all.push_back(grid("draco-grid-1/16px", source, options));
  options.step_bits = 6;
  all.push_back(grid("draco-grid-1/64px", source, options));
  options.geometry = GeometryCodec::kGrid;
  options.key_interval = 30;
  options.step_bits = 6;
  options.estimate = true;
  all.push_back(grid("metric", source, options));
  options.estimate = false;
  options.bound_px = 0.5F;
  all.push_back(grid("visual", source, options));
  options.bound_px = 1;
  all.push_back(grid("visual-1px", source, options));
  for (const int bits : {8, 9, 10, 11}) all.push_back(draco(0, bits));  // as coarse as visual
  all.push_back(draco(5, 11));                                          // at no smaller error than grid
  for (const int bits : {12, 0})
    for (const int speed : {0, 4, 5, 7, 9}) all.push_back(draco(speed, bits));
  return all;
}

/// The source's truth, and how surfaces are held against it and against each other.
struct Judge {
  const Rig& rig;
  const Pattern& pattern;
};

struct Samples {
  std::vector<double> bits, bytes, bits_a_vertex, encode_ms, decode_ms, rms_mm, max_mm;
  std::vector<double> truth_um_per_m, truth_outliers;
  Surface decoded;
};

/// Against the truth where it is known: once a frame, decoders being deterministic.
void judge(const Judge& by, const Job& job, Samples& samples) {
  if (job.truth == nullptr) return;
  Scorer scorer(by.rig, by.pattern);
  scorer.add(*job.truth, &samples.decoded);
  const Score score = scorer.score();
  samples.truth_um_per_m.push_back(score.rms_um_per_m);
  samples.truth_outliers.push_back(score.outliers);
}

Status measure(const Codec& codec, const Judge& by, const Job& job, Samples& samples) {
  const std::int64_t begin = steady_now_ns();
  const auto coded = codec.encode(job);
  const std::int64_t encoded = steady_now_ns();
  if (!coded) return coded.error().in(codec.name);
  const std::int64_t decode_begin = steady_now_ns();
  const Status decoded = codec.decode(*coded, samples.decoded);
  const std::int64_t end = steady_now_ns();
  if (!decoded) return decoded.error().in(codec.name);
  const auto error = surface_error(job.surface, samples.decoded, by.rig, by.pattern);
  if (!error) return error.error().in(codec.name);
  const auto bytes = static_cast<double>(coded->bytes.size());
  samples.bits.push_back(codec.bits(job));
  samples.bytes.push_back(bytes);
  samples.bits_a_vertex.push_back(8 * bytes / static_cast<double>(samples.decoded.positions.size()));
  samples.encode_ms.push_back(milliseconds(encoded - begin));
  samples.decode_ms.push_back(milliseconds(end - decode_begin));
  samples.rms_mm.push_back(1e3 * error->rms_m);
  samples.max_mm.push_back(1e3 * error->max_m);
  return {};
}

Status run(const Options& options, StopSignal& stop) {
  const auto loaded =
      load_reconstructed(options.source, options.repeats.frames + 1, stop, options.decoder, {.truth = true});
  if (!loaded) return loaded.error();
  if (!*loaded) return {};
  const auto& [loop, frames] = **loaded;

  std::vector<Job> jobs;
  std::vector<double> vertices, triangles;
  WorkingVolume volume{Volume{}};
  for (const Frame3D& frame : frames) {
    const Volume& box = volume.fit(frame.surface.positions);
    jobs.push_back({frame, loop.truth(frame.number), box, volume.bits(PipelineOptions{}.depth_resolution)});
    vertices.push_back(static_cast<double>(frame.surface.positions.size()));
    triangles.push_back(static_cast<double>(frame.surface.triangles.size()));
  }

  // Round by round, so that whatever else the machine does meets all codecs alike.
  const SourceInfo& source = loop.info();
  const Judge by{source.rig, source.pattern};
  std::vector<Codec> all = codecs(source);
  if (!options.only.empty())
    std::erase_if(all, [&](const Codec& codec) {
      return std::ranges::none_of(options.only,
                                  [&](const std::string& begin) { return codec.name.starts_with(begin); });
    });
  std::vector<Samples> samples(all.size());
  Samples warm_up;
  GridStages stages(source.rig, source.pattern);
  for (int round = 0; round < options.repeats.rounds; ++round) {
    for (std::size_t c = 0; c < all.size(); ++c) {
      if (const Status done = measure(all[c], by, jobs.front(), warm_up); !done) return done;
      for (const Job& job : jobs) {
        if (stop.stopped()) return {};
        if (const Status done = measure(all[c], by, job, samples[c]); !done) return done;
        if (round == 0) judge(by, job, samples[c]);
      }
    }
    for (const Job& job : jobs)
      if (const Status done = stages.measure(job.surface); !done) return done;
  }
  std::vector<Row> rows;
  for (std::size_t c = 0; c < all.size(); ++c) {
    const Samples& of = samples[c];
    rows.push_back({all[c].name,
                    {{"bits", spread_of(of.bits)},
                     {"bytes", spread_of(of.bytes)},
                     {"bits_per_vertex", spread_of(of.bits_a_vertex)},
                     {"encode_ms", spread_of(of.encode_ms)},
                     {"decode_ms", spread_of(of.decode_ms)},
                     {"rms_mm", spread_of(of.rms_mm)},
                     {"max_mm", spread_of(of.max_mm)},
                     {"truth_um_per_m", spread_of(of.truth_um_per_m)},
                     {"truth_outliers", spread_of(of.truth_outliers)}}});
  }
  std::vector<Figure> figures = stages.figures();
  figures.insert(figures.begin(), {{"vertices", spread_of(vertices)},
                                   {"triangles", spread_of(triangles)},
                                   {"volume_m", static_cast<double>(jobs.back().volume.size_m)}});
  print({.suite = "codec",
         .settings = {{"source", options.source},
                      {"frames", static_cast<double>(jobs.size())},
                      {"rounds", static_cast<double>(options.repeats.rounds)},
                      {"decoder", std::string(decoder_name(options.decoder))}},
         .figures = std::move(figures),
         .rows = std::move(rows),
         .notes =
             {"Reference: raw-float32. Errors are distances from the surface that was encoded, vertex "
              "by vertex; "
              "\"pipeline\": the bits that serve would choose.",
              "Against truth, where the source has it: RMS of the depth in micrometres a metre, over "
              "vertices within 2 % of it; the share of the others.",
              "Stages of grid-1/16px, nanoseconds a vertex: gather (surface to grid), code (grid to bytes), "
              "decode (bytes to grid), surface (grid to positions, texture coordinates, places and "
              "triangles)."}},
        options.json);
  return {};
}

}  // namespace

Command codec_suite() {
  return {"codec", "Geometry codecs: bytes, time and error", [](CLI::App& app) {
            auto options = std::make_shared<Options>();
            add_source_option(app, options->source);
            add_repeat_options(app, options->repeats);
            app.add_option("--only", options->only, "Only codecs whose names begin so; may be given often");
            add_decoder_option(app, options->decoder);
            add_json_option(app, options->json);
            return [options](StopSignal& stop) { return run(*options, stop); };
          }};
}

}  // namespace relievo::bench
