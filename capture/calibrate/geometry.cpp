// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/geometry.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <opencv2/calib3d.hpp>

#include "capture/calibrate/compare_rigs.h"
#include "capture/calibrate/plane_check.h"

namespace relievo {
namespace {

// Of the corners, pixels: a fit that is too good to be true must not make the priors vanish.
constexpr double kLeastNoise = 0.03, kMostNoise = 2;
constexpr double kLooseLoss = 20;  // pixels, of the first adjustment
constexpr double kLossSigmas = 4;  // where the robust loss begins to bend

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double squared(Vec2d v) {
  return v[0] * v[0] + v[1] * v[1];
}

Vec2d minus(Vec2d a, Vec2d b) {
  return {a[0] - b[0], a[1] - b[1]};
}

double depth_sigma(const BundleResult& fit, double distance_m) {
  const Rig rig = rig_of(fit);
  double squares = 0;
  for (const Devices& moved : fit.deviations) {
    const auto difference = compare_rigs(rig_of(moved), rig, distance_m);
    squares += difference ? difference->depth_rms_m * difference->depth_rms_m
                          : std::numeric_limits<double>::infinity();
  }
  return std::sqrt(squares);
}

/// A view on its way through the calibration.
struct Working {
  std::size_t index;  // in the reports
  BoardView view;
  std::vector<CornerSight> left_out;
};

/// How one lens sees its views, from a start that holds what few views cannot tell at what lenses usually
/// have.
struct LensStart {
  PinholeModel lens;
  std::vector<Pose> poses;
};

/// `centre_y`: of the principal point, as a share of the picture's height.
LensStart start_lens(const std::vector<Working>& views, const PinholeModel& size, bool projector,
                     double centre_y) {
  std::vector<std::vector<cv::Point3f>> board;
  std::vector<std::vector<cv::Point2f>> seen;
  for (const Working& w : views) {
    auto& b = board.emplace_back();
    auto& s = seen.emplace_back();
    for (const CornerSight& c : w.view.corners) {
      const Vec2d at = projector ? c.projector_px : c.camera_px;
      b.emplace_back(static_cast<float>(c.board_m[0]), static_cast<float>(c.board_m[1]), 0.0f);
      s.emplace_back(static_cast<float>(at[0]), static_cast<float>(at[1]));
    }
  }
  const double focal = 1.5 * size.width;
  cv::Mat matrix = (cv::Mat_<double>(3, 3) << focal, 0, (size.width - 1) / 2.0, 0, focal,
                    centre_y * (size.height - 1), 0, 0, 1);
  cv::Mat distortion = cv::Mat::zeros(1, 5, CV_64F);
  std::vector<cv::Mat> turns, shifts;
  cv::calibrateCamera(board, seen, {size.width, size.height}, matrix, distortion, turns, shifts,
                      cv::CALIB_USE_INTRINSIC_GUESS | cv::CALIB_FIX_PRINCIPAL_POINT |
                          cv::CALIB_FIX_ASPECT_RATIO | cv::CALIB_ZERO_TANGENT_DIST | cv::CALIB_FIX_K1 |
                          cv::CALIB_FIX_K2 | cv::CALIB_FIX_K3);
  LensStart out{size, {}};
  std::copy(matrix.begin<double>(), matrix.end<double>(), out.lens.matrix.begin());
  out.lens.distortion = {};
  for (std::size_t v = 0; v < turns.size(); ++v) {
    const auto r = turns[v].begin<double>(), t = shifts[v].begin<double>();
    out.poses.push_back({r[0], r[1], r[2], t[0], t[1], t[2]});
  }
  return out;
}

/// The pose between the devices that explains the other views best, of those each view gives by itself.
Pose start_pose(const std::vector<Working>& views, const LensStart& camera, const LensStart& projector) {
  Pose best{};
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t v = 0; v < views.size(); ++v) {
    const Pose between = compose(projector.poses[v], inverse(camera.poses[v]));
    std::vector<double> off;
    for (std::size_t w = 0; w < views.size(); ++w) {
      const Pose pose = compose(between, camera.poses[w]);
      for (const CornerSight& c : views[w].view.corners) {
        off.push_back(squared(minus(project_board(projector.lens, pose, c.board_m), c.projector_px)));
      }
    }
    if (const double typical = median(std::move(off)); typical < least) {
      least = typical;
      best = between;
    }
  }
  return best;
}

struct Offs {
  Vec2d camera, projector;
};

Offs offs_of(const BundleResult& fit, const Pose& board, const CornerSight& c) {
  return {minus(c.camera_px, project_board(fit.camera, board, c.board_m)),
          minus(c.projector_px,
                project_board(fit.projector, compose(fit.projector_from_camera, board), c.board_m))};
}

double depth_of(const Pose& camera_from_board, Vec2d board_m) {
  const auto r = rotation_matrix(camera_from_board);
  return r[6] * board_m[0] + r[7] * board_m[1] + camera_from_board[5];
}

class Calibration {
 public:
  Calibration(const std::vector<MeasuredView>& views, const PinholeModel& camera,
              const PinholeModel& projector, const GeometryOptions& options)
      : camera_size_(camera), projector_size_(projector), options_(options) {
    for (const MeasuredView& view : views) {
      ViewReport report{.name = view.name, .used = view.refused.empty(), .why = view.refused};
      report.corners = view.corners.size();
      if (report.used) {
        fitted_.push_back(out_.reports.size());
        working_.push_back({out_.reports.size(), {view.corners, {}}, {}});
      }
      out_.reports.push_back(report);
    }
  }

  Result<Geometry> run() {
    if (Status enough = check_count(); !enough) return enough.error();
    BundleProblem start = best_start();
    BundlePriors priors = options_.priors;
    for (int round = 0;; ++round) {
      BundleProblem problem = start;
      for (const Working& w : working_) problem.views.push_back(w.view);
      auto fit = adjust_bundle(problem, priors);
      if (!fit) return fit.error();
      for (std::size_t v = 0; v < working_.size(); ++v)
        working_[v].view.camera_from_board = fit->camera_from_board[v];
      start.camera = fit->camera;
      start.projector = fit->projector;
      start.projector_from_camera = fit->projector_from_camera;
      const bool changed = round < 50 && (leave_out_corners(*fit) || leave_out_view(*fit));
      // What the corners are good for is known from how well they fit: priors then weigh what they should.
      const double noise = noise_of(*fit);
      const bool settled = std::fabs(noise / priors.noise_px - 1) < 0.02;
      priors.noise_px = noise;
      priors.loss_px = kLossSigmas * noise;
      if (!changed && (settled || round >= 50)) return fitting(finish(*fit));
      if (Status enough = check_count(); !enough) return enough.error();
    }
  }

 private:
  /// Adjusts loosely from projectors that throw straight, upwards and downwards: the lens shift is a tilt
  /// that few views hardly tell from a turned projector, and the adjustment alone would stay near where it
  /// began.
  BundleProblem best_start() {
    const LensStart camera = start_lens(working_, camera_size_, false, 0.5);
    BundleProblem best;
    double least = std::numeric_limits<double>::infinity();
    for (const double centre_y : {0.5, 0.0, 1.0}) {
      const LensStart projector = start_lens(working_, projector_size_, true, centre_y);
      BundleProblem problem{camera.lens, projector.lens, start_pose(working_, camera, projector), {}};
      for (std::size_t v = 0; v < working_.size(); ++v) {
        problem.views.push_back(working_[v].view);
        problem.views.back().camera_from_board = camera.poses[v];
      }
      BundlePriors loose = options_.priors;
      loose.loss_px = kLooseLoss;
      const auto fit = adjust_bundle(problem, loose);
      if (!fit || fit->cost >= least) continue;
      least = fit->cost;
      best = {fit->camera, fit->projector, fit->projector_from_camera, {}};
      for (std::size_t v = 0; v < working_.size(); ++v)
        working_[v].view.camera_from_board = fit->camera_from_board[v];
    }
    if (!std::isfinite(least)) {
      best = {camera.lens, camera.lens, {}, {}};  // adjusting this reports what is degenerate
    }
    return best;
  }

  Status check_count() const {
    if (working_.size() >= options_.min_views) return {};
    std::string why;
    for (std::size_t i : fitted_) {
      const ViewReport& r = out_.reports[i];
      if (!r.used) why += (why.empty() ? ": " : "; ") + r.name + " (" + r.why + ")";
    }
    return Error{std::to_string(working_.size()) + " of " + std::to_string(out_.reports.size()) +
                 " views can be used, at least " + std::to_string(options_.min_views) + " are needed" + why};
  }

  /// Sigma in one direction, robust.
  double noise_of(const BundleResult& fit) const {
    std::vector<double> offs;
    for (const Working& w : working_) {
      for (const CornerSight& c : w.view.corners) {
        const Offs off = offs_of(fit, w.view.camera_from_board, c);
        offs.push_back(std::sqrt(squared(off.camera)));
        offs.push_back(std::sqrt(squared(off.projector)));
      }
    }
    return std::clamp(median(std::move(offs)) / 1.1774, kLeastNoise, kMostNoise);
  }

  bool leave_out_corners(const BundleResult& fit) {
    std::vector<double> camera, projector;
    for (const Working& w : working_) {
      for (const CornerSight& c : w.view.corners) {
        const Offs off = offs_of(fit, w.view.camera_from_board, c);
        camera.push_back(std::sqrt(squared(off.camera)));
        projector.push_back(std::sqrt(squared(off.projector)));
      }
    }
    // The median distance of a plane normal error is 1.1774 of its sigma in each direction.
    const auto limit = [&](const std::vector<double>& offs) {
      return std::max(options_.bad_corner_px, options_.bad_corner * median(offs) / 1.1774);
    };
    const double camera_limit = limit(camera), projector_limit = limit(projector);
    bool changed = false;
    for (Working& w : working_) {
      const auto bad = [&](const CornerSight& c) {
        const Offs off = offs_of(fit, w.view.camera_from_board, c);
        return std::sqrt(squared(off.camera)) > camera_limit ||
               std::sqrt(squared(off.projector)) > projector_limit;
      };
      std::copy_if(w.view.corners.begin(), w.view.corners.end(), std::back_inserter(w.left_out), bad);
      const std::size_t gone = std::erase_if(w.view.corners, bad);
      ViewReport& report = out_.reports[w.index];
      report.corners_left_out += gone;
      changed = changed || gone > 0;
    }
    std::erase_if(working_, [&](const Working& w) {
      ViewReport& report = out_.reports[w.index];
      if (4 * report.corners_left_out <= report.corners) return false;
      report.used = false;
      report.why = std::to_string(report.corners_left_out) + " of its " + std::to_string(report.corners) +
                   " corners do not fit the other views";
      return true;
    });
    return changed;
  }

  bool leave_out_view(const BundleResult& fit) {
    if (working_.size() <= options_.min_views) return false;
    std::vector<double> rms;
    for (const Working& w : working_) rms.push_back(view_rms(fit, w).stereo_rms);
    const auto worst = std::max_element(rms.begin(), rms.end());
    const double usual = median(rms);
    const double limit = std::min(std::max(options_.bad_view_px, options_.bad_view * usual),
                                  std::max(options_.stray_view_px, options_.stray_view * usual));
    if (*worst <= limit) return false;
    const auto at = working_.begin() + (worst - rms.begin());
    char why[128];
    std::snprintf(
        why, sizeof why,
        "its stereo RMS of %.2f px is %.1f times the views' median; are all its pictures of one pose?",
        *worst, *worst / usual);
    out_.reports[at->index].used = false;
    out_.reports[at->index].why = why;
    working_.erase(at);
    return true;
  }

  static ViewReport view_rms(const BundleResult& fit, const Working& w) {
    double camera = 0, projector = 0;
    for (const CornerSight& c : w.view.corners) {
      const Offs off = offs_of(fit, w.view.camera_from_board, c);
      camera += squared(off.camera);
      projector += squared(off.projector);
    }
    const auto n = static_cast<double>(w.view.corners.size());
    ViewReport out;
    out.camera_rms = std::sqrt(camera / n);
    out.projector_rms = std::sqrt(projector / n);
    out.stereo_rms = std::sqrt((camera + projector) / (2 * n));
    return out;
  }

  Geometry finish(const BundleResult& fit) {
    Geometry& g = out_;
    const Rig rig = rig_of(fit);
    g.camera = rig.camera;
    g.projector = rig.projector;
    g.projector_from_camera_rotation = rig.projector_from_camera_rotation;
    g.projector_from_camera_translation = rig.projector_from_camera_translation;
    g.sigma_px = fit.sigma_px;
    double camera = 0, projector = 0, left_out = 0;
    std::size_t corners_left_out = 0;
    std::vector<double> depths;
    std::vector<PlaneCheck> planes;
    for (const Working& w : working_) {
      ViewReport& report = g.reports[w.index];
      const ViewReport rms = view_rms(fit, w);
      report.camera_rms = rms.camera_rms;
      report.projector_rms = rms.projector_rms;
      report.stereo_rms = rms.stereo_rms;
      planes.push_back(check_plane(rig, w.view));
      report.plane_rms_m = planes.back().plane_rms_m;
      for (const CornerSight& c : w.left_out) {
        const Offs off = offs_of(fit, w.view.camera_from_board, c);
        left_out += squared(off.camera) + squared(off.projector);
        ++corners_left_out;
      }
      const auto n = static_cast<double>(w.view.corners.size());
      camera += n * rms.camera_rms * rms.camera_rms;
      projector += n * rms.projector_rms * rms.projector_rms;
      g.corners += w.view.corners.size();
      for (const CornerSight& c : w.view.corners) {
        const Offs off = offs_of(fit, w.view.camera_from_board, c);
        depths.push_back(depth_of(w.view.camera_from_board, c.board_m));
        g.residuals.push_back({w.index, c.camera_px, off.camera, c.projector_px, off.projector});
      }
    }
    g.views = working_.size();
    const auto n = static_cast<double>(g.corners);
    g.camera_rms = std::sqrt(camera / n);
    g.projector_rms = std::sqrt(projector / n);
    g.stereo_rms = std::sqrt((camera + projector) / (2 * n));
    g.stereo_rms_all =
        std::sqrt((camera + projector + left_out) / (2 * (n + static_cast<double>(corners_left_out))));
    g.distance_m = median(std::move(depths));
    g.depth_sigma_m = depth_sigma(fit, g.distance_m);
    const PlaneCheck all = together(planes);
    g.plane_rms_m = all.plane_rms_m;
    g.square_error_m = all.length_rms_m;
    g.scale_error = all.scale_error;
    return std::move(out_);
  }

  Result<Geometry> fitting(Geometry geometry) const {
    char figure[32];
    if (geometry.stereo_rms > options_.most_rms_px) {
      std::snprintf(figure, sizeof figure, "%.1f", geometry.stereo_rms);
      return Error{std::string("no rig fits the views: the best leaves a stereo RMS of ") + figure +
                   " px; are the projector's size and the pattern those that were projected, unmirrored, and "
                   "did nothing but the board move?"};
    }
    if (!(geometry.depth_sigma_m <= options_.most_depth_sigma * geometry.distance_m)) {
      std::snprintf(figure, sizeof figure, "%.2g", 100 * geometry.depth_sigma_m / geometry.distance_m);
      return Error{std::string("the views tell depths to ") + figure +
                   " % only: take more, with the board tilted in different directions and in all parts of "
                   "the picture"};
    }
    return geometry;
  }

  PinholeModel camera_size_, projector_size_;
  const GeometryOptions& options_;
  std::vector<std::size_t> fitted_;  // of the reports: views that measuring did not refuse
  std::vector<Working> working_;
  Geometry out_;
};

}  // namespace

Result<Geometry> calibrate_geometry(const std::vector<MeasuredView>& views, const PinholeModel& camera_size,
                                    const PinholeModel& projector_size, const GeometryOptions& options) {
  try {
    return Calibration(views, camera_size, projector_size, options).run();
  } catch (const cv::Exception& e) {
    return Error{"the views do not determine the rig (" + e.err + "): take more, with the board tilted"};
  }
}

Rig with_geometry(Rig rig, const Geometry& geometry) {
  rig.camera = geometry.camera;
  rig.projector = geometry.projector;
  rig.projector_from_camera_rotation = geometry.projector_from_camera_rotation;
  rig.projector_from_camera_translation = geometry.projector_from_camera_translation;
  rig.stereo_rms_px = geometry.stereo_rms;
  rig.scale_error = std::hypot(geometry.scale_error, geometry.depth_sigma_m / geometry.distance_m);
  return rig;
}

}  // namespace relievo
