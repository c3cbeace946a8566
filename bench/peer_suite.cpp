// SPDX-License-Identifier: Apache-2.0
// Our decoders beside OpenCV's structured_light on one simulated scene that stands still: pictures needed,
// time, how much of the scene is decoded and how well.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/structured_light.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "base/time.h"
#include "bench/options.h"
#include "bench/report.h"
#include "bench/still_scene.h"
#include "bench/suites.h"
#include "bench/usage.h"
#include "capture/calibrate/ray_pairs.h"
#include "capture/evaluate/score.h"
#include "capture/reconstruct/reconstructor.h"
#include "capture/reconstruct/triangulate.h"

namespace relievo::bench {
namespace {

constexpr double kOutlier = 0.02;          // of the depth, as in evaluate
constexpr double kPicturesPerSecond = 60;  // of a rig that shows one field after the other

struct Options {
  std::string scene = "object";
  int runs = 5;
  bool json = false;
};

struct Quality {
  double points = 0, completeness = 0, outliers = 0, median_um_per_m = 0, rms_um_per_m = 0;
};

struct Times {
  std::vector<double> ms, cpu_ms;
};

/// How often, unless it is stopped.
struct Runs {
  int count;
  const StopSignal& stop;
};

/// Calls `decode` as often, and once before, untimed.
Times timed(const Runs& runs, const std::function<void()>& decode) {
  decode();
  Times out;
  for (int i = 0; i == 0 || (i < runs.count && !runs.stop.stopped()); ++i) {
    const std::int64_t cpu = process_cpu_ns(), begin = steady_now_ns();
    decode();
    out.ms.push_back(milliseconds(steady_now_ns() - begin));
    out.cpu_ms.push_back(milliseconds(process_cpu_ns() - cpu));
  }
  return out;
}

/// Depth of each decoded pixel against the truth. Complete is what is lit and decoded right.
Quality quality_of(const StillScene& scene, const ImageF& columns, const ImageF& rows) {
  std::size_t lit = 0, points = 0, right = 0, right_and_lit = 0;
  std::vector<double> errors;
  double squares = 0;
  for (int y = 0; y < columns.height(); ++y) {
    for (int x = 0; x < columns.width(); ++x) {
      const std::size_t i = static_cast<std::size_t>(y) * static_cast<std::size_t>(columns.width()) +
                            static_cast<std::size_t>(x);
      lit += scene.lit[i];
      if (columns.row(y)[x] < 0 || rows.row(y)[x] < 0) continue;
      const auto camera = undistort(scene.rig.camera, x, y);
      const auto projector =
          undistort(scene.rig.projector, double{columns.row(y)[x]}, double{rows.row(y)[x]});
      const auto met = camera && projector ? meet(scene.rig, *camera, *projector) : std::nullopt;
      ++points;
      const double truth = double{scene.truth.row(y)[x]};
      if (!met || truth <= 0) continue;
      const double error = std::fabs(double{met->point[2]} - truth) / truth;
      if (error > kOutlier) continue;
      ++right;
      right_and_lit += scene.lit[i];
      errors.push_back(error);
      squares += error * error;
    }
  }
  Quality out{.points = static_cast<double>(points)};
  if (right == 0 || lit == 0) return out;
  out.completeness = static_cast<double>(right_and_lit) / static_cast<double>(lit);
  out.outliers = static_cast<double>(points - right) / static_cast<double>(points);
  const auto middle = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2);
  std::nth_element(errors.begin(), middle, errors.end());
  out.median_um_per_m = 1e6 * *middle;
  out.rms_um_per_m = 1e6 * std::sqrt(squares / static_cast<double>(right));
  return out;
}

Row row_of(const std::string& name, std::size_t pictures_first, std::size_t pictures, const Times& times,
           const Quality& q) {
  return {name,
          {{"pictures", static_cast<double>(pictures_first)},
           {"pictures_next", static_cast<double>(pictures)},
           {"show_ms", 1e3 * static_cast<double>(pictures) / kPicturesPerSecond},
           {"decode_ms", spread_of(times.ms)},
           {"cpu_ms", spread_of(times.cpu_ms)},
           {"points", q.points},
           {"completeness", q.completeness},
           {"outliers", q.outliers},
           {"median_um_per_m", q.median_um_per_m},
           {"rms_um_per_m", q.rms_um_per_m}}};
}

Row opencv_row(const StillScene& scene, const Runs& runs) {
  const GrayStack& gray = scene.gray;
  const auto peer =
      cv::structured_light::GrayCodePattern::create(gray.projector_width, gray.projector_height);
  const auto matrix = [](const Image8& picture) {
    return cv::Mat(picture.height(), picture.width(), CV_8UC1,
                   const_cast<std::uint8_t*>(picture.data()));  // read only
  };
  std::vector<cv::Mat> pictures;
  for (const auto* pairs : {&gray.columns, &gray.rows}) {
    for (auto pair = pairs->rbegin(); pair != pairs->rend(); ++pair) {
      pictures.push_back(matrix(pair->lit));
      pictures.push_back(matrix(pair->inverse));
    }
  }
  const cv::Mat white = matrix(scene.white), black = matrix(scene.black);
  constexpr int kBlackThreshold = 40;  // its own default, for the mask of what the projector lights
  ImageF columns(white.cols, white.rows, 1), rows(white.cols, white.rows, 1);
  const Times times = timed(runs, [&] {
    for (int y = 0; y < white.rows; ++y) {
      for (int x = 0; x < white.cols; ++x) {
        cv::Point at;
        const bool lit = white.at<std::uint8_t>(y, x) - black.at<std::uint8_t>(y, x) > kBlackThreshold;
        const bool decoded = lit && !peer->getProjPixel(pictures, x, y, at);  // it returns true for an error
        columns.row(y)[x] = decoded ? static_cast<float>(at.x) : -1;
        rows.row(y)[x] = decoded ? static_cast<float>(at.y) : -1;
      }
    }
  });
  const std::size_t count = pictures.size() + 2;
  return row_of("opencv-getProjPixel", count, count, times, quality_of(scene, columns, rows));
}

Row gray_row(const StillScene& scene, const Runs& runs) {
  WorkerPool pool(1);
  std::optional<Result<GrayMaps>> maps;
  const Times times = timed(runs, [&] { maps = decode_gray(scene.gray, {}, pool); });
  const std::size_t count = 2 * (scene.gray.columns.size() + scene.gray.rows.size());
  const bool decoded = maps && maps->ok();
  return row_of("relievo-gray", count, count, times,
                decoded ? quality_of(scene, (*maps)->columns, (*maps)->rows) : Quality{});
}

Result<Row> stripes_row(const StillScene& scene, const Runs& runs) {
  auto reconstructor = Reconstructor::create(scene.rig, scene.pattern, {.texture = false});
  if (!reconstructor) return reconstructor.error();
  std::uint64_t number = 0;
  std::optional<Frame3D> made;
  Status failed;
  const auto next = [&] {
    const CapturedFrame& shown = scene.stripes[number++ % scene.stripes.size()];
    auto frame = reconstructor->add(shown);
    if (!frame) {
      failed = frame.error();
    } else if (*frame) {
      if (made) reconstructor->recycle(*std::exchange(made, std::nullopt));
      made = std::move(*frame);
    }
  };
  for (std::size_t i = 0; i < 2 * scene.stripes.size(); ++i) next();
  const Times times = timed({20 * runs.count, runs.stop}, next);
  if (!failed) return failed.error();
  if (!made) return Error{"the stripes could not be reconstructed"};
  Scorer scorer(scene.rig, scene.pattern);
  scorer.add(scene.truth, &made->surface);
  const Score score = scorer.score();
  return row_of("relievo-stripes", 2 * scene.stripes.size(), 2, times,
                {static_cast<double>(made->surface.positions.size()), score.completeness, score.outliers,
                 score.median_um_per_m, score.rms_um_per_m});
}

Status run(const Options& options, StopSignal& stop) {
  auto scene = render_still_scene(options.scene, stop);
  if (!scene) return scene.error();
  if (stop.stopped()) return {};
  const Runs runs{options.runs, stop};
  auto stripes = stripes_row(*scene, runs);
  if (!stripes) return stripes.error();
  if (stop.stopped()) return {};
  Row gray = gray_row(*scene, runs);
  if (stop.stopped()) return {};
  Row peer = opencv_row(*scene, runs);
  if (stop.stopped()) return {};
  const Report report{
      .suite = "peer",
      .settings = {{"scene", options.scene},
                   {"width", static_cast<double>(scene->rig.camera.width)},
                   {"height", static_cast<double>(scene->rig.camera.height)},
                   {"projector_width", static_cast<double>(scene->rig.projector.width)},
                   {"projector_height", static_cast<double>(scene->rig.projector.height)},
                   {"stripes", static_cast<double>(scene->pattern.stripes())},
                   {"opencv", std::string(CV_VERSION)},
                   {"runs", static_cast<double>(options.runs)}},
      .figures = {},
      .rows = {*std::move(stripes), std::move(gray), std::move(peer)},
      .notes = {
          "The scene stands still, as Gray code needs. One core each. show_ms: the projector's time for the "
          "pictures of a further surface, at 60 a second.",
          "completeness: of the lit pixels decoded right (Gray code), of the visible boundaries (stripes: a "
          "point a boundary and line, not a pixel). Outliers are over 2 % of the depth off."}};
  print(report, options.json);
  return {};
}

}  // namespace

Command peer_suite() {
  return {"peer", "Our decoders beside OpenCV's structured_light, on one simulated scene", [](CLI::App& app) {
            auto options = std::make_shared<Options>();
            app.add_option("--scene", options->scene, "SCENE[,key=value...], as for sim: sources")
                ->capture_default_str();
            app.add_option("--runs", options->runs, "Of each decoder; of stripes 20 times as many")
                ->check(CLI::Range(1, 1000))
                ->capture_default_str();
            add_json_option(app, options->json);
            return [options](StopSignal& stop) { return run(*options, stop); };
          }};
}

}  // namespace relievo::bench
