// SPDX-License-Identifier: Apache-2.0
#include "server/calibration_report.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "base/json_text.h"

namespace relievo {
namespace {

constexpr const char* kChannels[] = {"red", "green", "blue"};

nlohmann::json lens_json(const PinholeModel& lens, const double* sigma) {
  return {{"focal_px", {lens.fx(), lens.fy()}},
          {"focal_sigma_px", {sigma[0], sigma[1]}},
          {"centre_px", {lens.cx(), lens.cy()}},
          {"centre_sigma_px", {sigma[2], sigma[3]}},
          {"distortion", lens.distortion}};
}

}  // namespace

std::string colour_report(const ColourCalibration& c) {
  nlohmann::json colours = nlohmann::json::array();
  for (const ColourReport& r : c.colours) {
    nlohmann::json colour = {{"colour", primary_name(r.colour)},
                             {"captured", r.captured},
                             {"estimated", r.estimated},
                             {"residual", r.residual}};
    if (r.colour != 0 && r.colour != 7) {
      colour["weakest_difference"] = r.weakest_difference;
      colour["margin"] = r.weakest_difference - kDetectionThreshold;
      colour["weakest_in_sigmas"] = r.weakest_in_sigmas;
      colour["weakest_channel"] = kChannels[r.weakest_channel];
    }
    colours.push_back(colour);
  }
  const nlohmann::json json = {
      {"colour_matrix", c.camera.matrix},
      {"residual", c.residual},
      {"noise", c.noise},
      {"camera_gamma", c.camera.gamma},
      {"threshold", kDetectionThreshold},
      {"target",
       {{"box", {c.target.x, c.target.y, c.target.width, c.target.height}}, {"pixels", c.target_pixels}}},
      {"colours", colours}};
  return json_line(json);
}

std::string geometry_report(const Geometry& g) {
  nlohmann::json views = nlohmann::json::array();
  for (const ViewReport& r : g.reports) {
    nlohmann::json view = {
        {"name", r.name}, {"used", r.used}, {"corners", r.corners}, {"corners_left_out", r.corners_left_out}};
    if (r.used) {
      view["camera_rms_px"] = r.camera_rms;
      view["projector_rms_px"] = r.projector_rms;
      view["stereo_rms_px"] = r.stereo_rms;
      view["plane_rms_mm"] = 1000 * r.plane_rms_m;
    } else {
      view["why"] = r.why;
    }
    views.push_back(view);
  }
  nlohmann::json json = {{"stereo_rms_px", g.stereo_rms},
                         {"stereo_rms_all_corners_px", g.stereo_rms_all},
                         {"distance_m", g.distance_m},
                         {"depth_sigma_mm", 1000 * g.depth_sigma_m},
                         {"camera_rms_px", g.camera_rms},
                         {"projector_rms_px", g.projector_rms},
                         {"plane_rms_mm", 1000 * g.plane_rms_m},
                         {"square_error_mm", 1000 * g.square_error_m},
                         {"scale_error", g.scale_error},
                         {"views_used", g.views},
                         {"corners_used", g.corners},
                         {"camera", lens_json(g.camera, g.sigma_px.data())},
                         {"projector", lens_json(g.projector, g.sigma_px.data() + 4)},
                         {"baseline_mm", 1000 * std::hypot(g.projector_from_camera_translation[0],
                                                           g.projector_from_camera_translation[1],
                                                           g.projector_from_camera_translation[2])},
                         {"views", views}};
  return json_line(json);
}

}  // namespace relievo
