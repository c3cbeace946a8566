// SPDX-License-Identifier: Apache-2.0
// Camera frames in, surfaces out: milliseconds a frame and a stage, against reading the frame once.
#include <CLI/CLI.hpp>
#include <memory>

#include "base/time.h"
#include "bench/frames.h"
#include "bench/memory.h"
#include "bench/options.h"
#include "bench/report.h"
#include "bench/suites.h"
#include "bench/usage.h"
#include "capture/reconstruct/quick_difference.h"
#include "capture/reconstruct/quick_sequence.h"
#include "cli/checks.h"
#include "cli/size_option.h"
#include "server/options.h"

namespace relievo::bench {
namespace {

constexpr int kDistinctFrames = 24;
constexpr std::uint64_t kWarmUp = 4;  // frames, untimed: both slides seen, memory allocated
constexpr std::uint64_t kFrames = 100;
constexpr std::uint64_t kFloorFrames = 40;
constexpr std::int64_t kTime_ns = 3 * kNanosecondsPerSecond;

struct Options {
  std::string source = "sim:object";
  Size size;        // 0: the source's
  int stripes = 0;  // 0: the source's
  int threads = 1;
  int line_stride = 1;
  std::uint64_t frames = 0;  // 0: kFrames and kTime_ns, both
  Decoder decoder = ReconstructOptions{}.decoder;
  bool json = false;
};

Result<std::string> source_of(const Options& options) {
  std::string uri = options.source;
  if (options.size.width == 0 && options.stripes == 0) return uri;
  if (!uri.starts_with("sim:"))
    return Error{"--size and --stripes shape the simulated rig; " + uri + " has its own: leave them out"};
  if (options.size.width > 0)
    uri += ",width=" + std::to_string(options.size.width) + ",height=" + std::to_string(options.size.height);
  if (options.stripes > 0) uri += ",stripes=" + std::to_string(options.stripes);
  return uri;
}

struct Samples {
  std::vector<double> frame, cpu, detect, match, triangulate, surface, texture, points, boundaries, decoded;

  void add(double ms, double cpu_ms, const ReconstructReport& report, const Surface& made) {
    frame.push_back(ms);
    cpu.push_back(cpu_ms);
    detect.push_back(report.detect_ms);
    match.push_back(report.match_ms);
    triangulate.push_back(report.triangulate_ms);
    surface.push_back(report.surface_ms);
    texture.push_back(report.texture_ms);
    points.push_back(static_cast<double>(made.positions.size()));
    boundaries.push_back(static_cast<double>(report.boundaries));
    decoded.push_back(static_cast<double>(report.matched));
  }
};

/// What no decoder does without: the cheapest passes that there are here.
struct Floor {
  std::vector<double> difference, edges;

  /// Both fields' difference and luma, low-passed and by the colour matrix, of all pixels; and the same with
  /// the boundaries' places.
  Status measure(Reconstructor& reconstructor, const FrameLoop& frames, int threads) {
    WorkerPool pool(threads);
    QuickDifferencer differencer(frames.info().rig.colour_matrix);
    QuickSequence sequence(frames.info().pattern);
    QuickImage image;
    for (std::uint64_t n = 0; n < kFloorFrames; ++n) {
      auto frame = reconstructor.add(frames.at(n));
      if (!frame) return frame.error();
      if (*frame) reconstructor.recycle(*std::move(*frame));
      const CapturedFrame* pair = reconstructor.decoded();
      if (pair == nullptr) continue;
      const std::int64_t begin = process_cpu_ns();
      differencer.difference(*pair, pool, image, [](int, int, int) {});
      const std::int64_t middle = process_cpu_ns();
      sequence.find_edges(*pair, differencer, pool, image);
      if (n < kWarmUp) continue;
      difference.push_back(milliseconds(middle - begin));
      edges.push_back(milliseconds(process_cpu_ns() - middle));
    }
    return {};
  }
};

Status run(const Options& options, StopSignal& stop) {
  const auto uri = source_of(options);
  if (!uri) return uri.error();
  const auto loop = FrameLoop::load(*uri, kDistinctFrames, stop);
  if (!loop) return loop.error();
  if (!*loop) return {};
  const FrameLoop& frames = **loop;
  auto reconstructor = Reconstructor::create(
      frames.info().rig, frames.info().pattern,
      {.decoder = options.decoder, .threads = options.threads, .line_stride = options.line_stride});
  if (!reconstructor) return reconstructor.error();

  Samples samples;
  const std::int64_t end_ns = steady_now_ns() + kTime_ns;
  const std::uint64_t wanted = options.frames > 0 ? options.frames : kFrames;
  const auto enough = [&](std::uint64_t timed) {
    return timed >= wanted && (options.frames > 0 || steady_now_ns() >= end_ns);
  };
  for (std::uint64_t n = 0; n < kWarmUp || !enough(n - kWarmUp); ++n) {
    if (stop.stopped()) return {};
    const std::int64_t cpu_begin = process_cpu_ns();
    const std::int64_t begin = steady_now_ns();
    auto frame = reconstructor->add(frames.at(n));
    const double ms = milliseconds(steady_now_ns() - begin);
    const double cpu_ms = milliseconds(process_cpu_ns() - cpu_begin);
    if (!frame) return frame.error();
    if (n >= kWarmUp && *frame) samples.add(ms, cpu_ms, reconstructor->report(), (*frame)->surface);
    if (*frame) reconstructor->recycle(*std::move(*frame));
  }
  if (samples.frame.empty()) return Error{"no frame of " + *uri + " could be reconstructed"};

  Floor floor;
  if (auto measured = floor.measure(*reconstructor, frames, options.threads); !measured)
    return measured.error();
  const Spread bandwidth = measure_read_bandwidth(options.threads);
  const double bound_ms = 1e3 * static_cast<double>(frames.frame_bytes()) / bandwidth.max;
  const Spread frame_ms = spread_of(samples.frame);
  const Rig& rig = frames.info().rig;
  const Report report{
      .suite = "reconstruct",
      .settings = {{"source", *uri},
                   {"width", static_cast<double>(rig.camera.width)},
                   {"height", static_cast<double>(rig.camera.height)},
                   {"scan", std::string(to_string(rig.scan))},
                   {"stripes", static_cast<double>(frames.info().pattern.stripes())},
                   {"threads", static_cast<double>(options.threads)},
                   {"decoder", std::string(decoder_name(options.decoder))},
                   {"line_stride", static_cast<double>(options.line_stride)},
                   {"distinct_frames", static_cast<double>(frames.size())}},
      .figures = {{"frame_ms", frame_ms},
                  {"cpu_ms", spread_of(samples.cpu)},
                  {"stage_ms.detect", spread_of(samples.detect)},
                  {"stage_ms.match", spread_of(samples.match)},
                  {"stage_ms.triangulate", spread_of(samples.triangulate)},
                  {"stage_ms.surface", spread_of(samples.surface)},
                  {"stage_ms.texture", spread_of(samples.texture)},
                  {"floor_ms.difference", spread_of(floor.difference)},
                  {"floor_ms.edges", spread_of(floor.edges)},
                  {"points", spread_of(samples.points)},
                  {"boundaries", spread_of(samples.boundaries)},
                  {"boundaries_decoded", spread_of(samples.decoded)},
                  {"bound_ms", bound_ms},
                  {"times_bound", frame_ms.median / bound_ms},
                  {"read_bytes_per_s", bandwidth},
                  {"frame_bytes", static_cast<double>(frames.frame_bytes())}},
      .notes = {
          "bound_ms: reading the frame's two fields once at the best of the measured read_bytes_per_s.",
          "floor_ms: processor time of the cheapest passes: the fields' difference and luma, low-passed; and "
          "that with every boundary's place."}};
  print(report, options.json);
  return {};
}

}  // namespace

Command reconstruct_suite() {
  return {"reconstruct", "Camera frames to surfaces: ms a frame and a stage", [](CLI::App& app) {
            auto options = std::make_shared<Options>();
            add_source_option(app, options->source);
            add_size_option(app, "--size", options->size, "Of the simulated camera (default 640x480)");
            app.add_option("--stripes", options->stripes, "Of the simulated projector (default 90)")
                ->check(CLI::Range(2, 8192));
            add_threads_option(app, options->threads);
            app.add_option("--frames", options->frames, "Timed frames (default 100 and 3 s at least)")
                ->check(whole_number(1, 1'000'000));
            add_decoder_option(app, options->decoder);
            add_half_lines_option(app, options->line_stride);
            add_json_option(app, options->json);
            return [options](StopSignal& stop) { return run(*options, stop); };
          }};
}

}  // namespace relievo::bench
