// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/colour.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "capture/calibrate/white_target.h"
#include "capture/camera_response.h"

namespace relievo {
namespace {

constexpr Primary kBlack = 0, kWhite = 7;
constexpr int kSaturated = 254;

/// A capture's target: mean colour, and the noise of one pixel.
struct Response {
  Primary colour;
  std::string name;
  Eigen::Vector3d mean;
  Eigen::Vector3d noise;
};

std::string percent(double share) {
  char text[16];
  std::snprintf(text, sizeof text, "%.1f %%", 100 * share);
  return text;
}

std::string whole(double value) {
  return std::to_string(std::lround(value));
}

Eigen::Vector3d projected(Primary colour) {
  return {colour & 1 ? 255.0 : 0.0, colour & 2 ? 255.0 : 0.0, colour & 4 ? 255.0 : 0.0};
}

Response respond(const ColourCapture& capture, const std::vector<std::uint8_t>& target) {
  Response out{capture.colour, capture.name, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  const int width = capture.picture.width();
  std::array<std::vector<int>, 3> steps;  // between neighbours: the target is smooth, so they are noise
  std::size_t pixels = 0;
  for (int y = 0; y < capture.picture.height(); ++y) {
    const std::uint8_t* rgb = capture.picture.row(y);
    const std::uint8_t* in = target.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
    for (int x = 0; x < width; ++x) {
      if (in[x] == 0) continue;
      ++pixels;
      for (int c = 0; c < 3; ++c) {
        out.mean[c] += rgb[3 * x + c];
        if (x > 0 && in[x - 1])
          steps[static_cast<std::size_t>(c)].push_back(std::abs(rgb[3 * x + c] - rgb[3 * x - 3 + c]));
      }
    }
  }
  out.mean /= static_cast<double>(std::max<std::size_t>(1, pixels));
  for (int c = 0; c < 3; ++c) {
    double squares = 0;
    const auto& all = steps[static_cast<std::size_t>(c)];
    for (const int step : all) squares += double{1} * step * step;
    out.noise[c] = all.empty() ? 0 : std::sqrt(squares / static_cast<double>(all.size()) / 2);
  }
  return out;
}

/// Which captures must be taken again, and how.
Status check_exposure(const std::vector<ColourCapture>& captures, const std::vector<Response>& responses,
                      const std::vector<std::uint8_t>& target, const ColourOptions& options) {
  const auto pixels = static_cast<double>(std::count(target.begin(), target.end(), 1));
  std::string saturated;
  double most = 0;
  for (const ColourCapture& capture : captures) {
    double worst = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      std::size_t full = 0;
      for (std::size_t i = 0; i < target.size(); ++i) {
        full += target[i] != 0 && capture.picture.data()[3 * i + c] >= kSaturated;
      }
      worst = std::max(worst, static_cast<double>(full) / pixels);
    }
    if (worst > options.saturated_share) saturated += (saturated.empty() ? "" : ", ") + capture.name;
    most = std::max(most, worst);
  }
  if (!saturated.empty()) {
    return Error{
        saturated + ": saturated, up to " + percent(most) +
        " of the target is full in a channel; shorten the exposure or close the iris, and take all captures "
        "again with the same setting"};
  }
  double white = 0;
  for (const Response& r : responses) {
    if (r.colour != kWhite) continue;
    white = r.mean.maxCoeff();
    if (white < options.dimmest_white) {
      return Error{r.name + " is under-exposed: the target reaches " + whole(white) + " of 255, at least " +
                   whole(options.dimmest_white) +
                   " is needed; lengthen the exposure or open the iris, and take all captures again with the "
                   "same setting"};
    }
  }
  Eigen::Vector3d black = Eigen::Vector3d::Zero();
  for (const Response& r : responses) {
    if (r.colour == kBlack) black = r.mean;
  }
  for (const Response& r : responses) {
    if (r.colour == kBlack && r.mean.maxCoeff() > options.ambient_share * white) {
      return Error{r.name + ": the target is at " + whole(r.mean.maxCoeff()) +
                   " of 255 without projected light; darken the room"};
    }
    if (r.colour != kBlack && (r.mean - black).maxCoeff() < 0.1 * white) {
      return Error{r.name + " is under-exposed: the target is hardly brighter than under black (" +
                   whole(r.mean.maxCoeff()) + " of 255); is it the picture of colour " +
                   primary_name(r.colour) + ", and the exposure that of the others?"};
    }
  }
  return {};
}

Status check_set(const std::vector<ColourCapture>& captures) {
  const auto has = [&](Primary colour) {
    return std::any_of(captures.begin(), captures.end(),
                       [&](const ColourCapture& c) { return c.colour == colour; });
  };
  for (const Primary needed : {kBlack, kWhite}) {
    if (!has(needed)) {
      return Error{"the capture under " + std::string(needed == kBlack ? "black, 000" : "white, 111") +
                   ".png, is missing"};
    }
  }
  const ColourCapture& first = captures.front();
  for (const ColourCapture& c : captures) {
    if (c.picture.width() != first.picture.width() || c.picture.height() != first.picture.height()) {
      return Error{c.name + " is " + std::to_string(c.picture.width()) + "x" +
                   std::to_string(c.picture.height()) + ", " + first.name + " " +
                   std::to_string(first.picture.width()) + "x" + std::to_string(first.picture.height()) +
                   ": all captures must be of one size"};
    }
  }
  return {};
}

/// Captures of one colour become one response.
std::vector<Response> average(const std::vector<Response>& all) {
  std::vector<Response> out;
  for (Primary colour = 0; colour < 8; ++colour) {
    Response sum{colour, "", Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
    int count = 0;
    for (const Response& r : all) {
      if (r.colour != colour) continue;
      sum.mean += r.mean;
      sum.noise += r.noise;
      sum.name = r.name;
      ++count;
    }
    if (count == 0) continue;
    sum.mean /= count;
    sum.noise /= count;
    out.push_back(sum);
  }
  return out;
}

/// Eq. 2 by least squares: M (C C') = S C'.
Result<Eigen::Matrix3d> solve(const std::vector<Response>& responses) {
  Eigen::Matrix3d cc = Eigen::Matrix3d::Zero(), sc = Eigen::Matrix3d::Zero();
  for (const Response& r : responses) {
    cc += r.mean * r.mean.transpose();
    sc += projected(r.colour) * r.mean.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> spread(cc);
  if (!(spread.eigenvalues()[0] > 1e-5 * spread.eigenvalues()[2])) {
    return Error{
        "the captures do not tell three colours apart: the folder needs red, green and blue (100, 010, 001) "
        "or "
        "their complements, each under its own light"};
  }
  const Eigen::Matrix3d solved = cc.ldlt().solve(sc.transpose());
  return Eigen::Matrix3d(solved.transpose());
}

/// RMS over the channels of what a matrix leaves of the responses, of 255.
double residual_of(const Eigen::Matrix3d& m, const std::vector<Response>& responses) {
  double squares = 0;
  for (const Response& r : responses) squares += (m * r.mean - projected(r.colour)).squaredNorm();
  return std::sqrt(squares / (3.0 * static_cast<double>(responses.size())));
}

/// Captures in light.
std::vector<Response> in_light(std::vector<Response> responses, double gamma) {
  for (Response& r : responses) {
    const Eigen::Array3d captured = r.mean.array() / 255;
    r.mean = 255 * captured.pow(gamma).matrix();
    r.noise = r.noise.array() * gamma * captured.pow(gamma - 1);
  }
  return responses;
}

/// The gamma under which the colours' light adds up best, 1 where that is not much better than as it is.
double gamma_of(const std::vector<Response>& responses) {
  constexpr double kMost = CameraResponse::kMostGamma, kStep = 0.05, kFineStep = 0.01;
  constexpr double kLeast = 1.2;       // less costs next to nothing
  constexpr double kMuchBetter = 0.5;  // of the residual without
  const auto left = [&](double gamma) {
    const std::vector<Response> straight = in_light(responses, gamma);
    const auto m = solve(straight);
    return m ? residual_of(*m, straight) : std::numeric_limits<double>::infinity();
  };
  double best = left(1) * kMuchBetter;
  double out = 1;
  if (!std::isfinite(best)) return out;  // too few colours: a curve does not tell them apart, either
  const auto look = [&](double from, double to, double step) {
    for (double gamma = from; gamma < to + step / 2; gamma += step) {
      const double residual = left(gamma);
      if (residual >= best) continue;
      best = residual;
      out = gamma;
    }
  };
  look(kLeast, kMost, kStep);
  if (out > 1) look(out - kStep, out + kStep, kFineStep);
  return out;
}

/// How well captures add up, at the gamma that is given or told by them.
struct Sum {
  double residual = std::numeric_limits<double>::infinity();  // where they determine nothing
  double own = 0;  // how much each channel of the camera counts for the projector's own: M's diagonal
};

Sum sum_of(const std::vector<Response>& responses, const std::optional<double>& gamma) {
  const std::vector<Response> light = in_light(responses, gamma ? *gamma : gamma_of(responses));
  const auto m = solve(light);
  return m ? Sum{residual_of(*m, light), m->trace()} : Sum{};
}

/// The colour that a capture shows by what the others do.
Primary shown_by(const Response& capture, const std::vector<Response>& others,
                 const std::optional<double>& known_gamma) {
  const double gamma = known_gamma ? *known_gamma : gamma_of(others);
  const auto m = solve(in_light(others, gamma));
  if (!m) return capture.colour;
  const Eigen::Vector3d estimated = *m * in_light({capture}, gamma).front().mean;
  Primary out = 0;
  for (int c = 0; c < 3; ++c) out = static_cast<Primary>(out | (estimated[c] > 127.5) << c);
  return out;
}

/// Where captures do not add up: whether they do without one of them, which shows another colour then, or
/// with two names exchanged.
Status check_names(const std::vector<Response>& each, double residual, const std::optional<double>& gamma) {
  constexpr std::size_t kLeastColours = 6;  // with black: fewer leave nothing over to tell by
  const double good = std::min(kMostResidual, residual / 3);
  const std::vector<Response> captured = average(each);
  if (residual <= kMostResidual || captured.size() < kLeastColours) return {};
  for (std::size_t i = 0; i < each.size(); ++i) {
    std::vector<Response> others = each;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
    others = average(others);
    if (others.size() + 1 < kLeastColours || sum_of(others, gamma).residual > good) continue;
    const Primary seen = shown_by(each[i], others, gamma);
    if (seen == each[i].colour) continue;
    return Error{each[i].name + " shows " + primary_name(seen) +
                 ", by what the other captures show: name it so, or take it again"};
  }
  // Two primaries exchanged add up as their two complements do, with the camera's channels exchanged, too.
  Sum best;
  std::string swapped;
  for (std::size_t a = 0; a < captured.size(); ++a) {
    for (std::size_t b = a + 1; b < captured.size(); ++b) {
      std::vector<Response> exchanged = captured;
      std::swap(exchanged[a].colour, exchanged[b].colour);
      const Sum sum = sum_of(exchanged, gamma);
      if (sum.residual > good || (!swapped.empty() && sum.own <= best.own)) continue;
      best = sum;
      swapped = primary_name(captured[a].colour) + " and " + primary_name(captured[b].colour);
    }
  }
  if (swapped.empty()) return {};
  return Error{"the pictures of " + swapped + " seem to be swapped: as they are colours miss by " +
               whole(residual) + " of 255, with the two names exchanged by " + whole(best.residual) +
               "; exchange them, or take both again"};
}

/// What the difference of a colour and its complement leaves for detection (5.2).
void weigh_detection(const Eigen::Matrix3d& m, const std::vector<Response>& responses, double brightest,
                     const Response& r, ColourReport& report) {
  const auto of = [&](Primary colour) -> const Response* {
    const auto at = std::find_if(responses.begin(), responses.end(),
                                 [&](const Response& x) { return x.colour == colour; });
    return at == responses.end() ? nullptr : &*at;
  };
  const Response* complement = of(static_cast<Primary>(r.colour ^ 7));
  // Light adds up: what a complement that was not captured would have been.
  const Eigen::Vector3d other = complement ? complement->mean : of(kWhite)->mean + of(kBlack)->mean - r.mean;
  const Eigen::Vector3d other_noise = complement ? complement->noise : r.noise;
  const Eigen::Vector3d difference = m * (r.mean - other) * (255 / brightest);
  report.weakest_difference = 1e9;
  for (int c = 0; c < 3; ++c) {
    const double right = (r.colour >> c & 1) ? difference[c] : -difference[c];
    double variance = 0;
    for (int k = 0; k < 3; ++k) {
      variance += std::pow(m(c, k) * 255 / brightest, 2) *
                  (r.noise[k] * r.noise[k] + other_noise[k] * other_noise[k]);
    }
    if (right >= report.weakest_difference) continue;
    report.weakest_difference = right;
    report.weakest_channel = c;
    report.weakest_in_sigmas = right / std::max(1e-9, std::sqrt(variance));
  }
}

}  // namespace

Result<ColourCalibration> calibrate_colour(const std::vector<ColourCapture>& captures,
                                           const ColourOptions& options) {
  if (captures.empty()) return Error{"there are no captures"};
  if (const Status complete = check_set(captures); !complete) return complete.error();
  auto target = find_white_target(captures, options.roi);
  if (!target) return target.error();
  std::vector<Response> each;
  for (const ColourCapture& capture : captures) each.push_back(respond(capture, target->mask));
  if (const Status good = check_exposure(captures, each, target->mask, options); !good) return good.error();
  const std::vector<Response> captured = average(each);
  const double gamma = options.camera_gamma ? *options.camera_gamma : gamma_of(captured);
  const std::vector<Response> responses = in_light(captured, gamma);
  const auto matrix = solve(responses);
  if (!matrix) return matrix.error();
  const Eigen::Matrix3d& m = *matrix;

  ColourCalibration out;
  out.residual = residual_of(m, responses);
  if (const Status named = check_names(each, out.residual, options.camera_gamma); !named)
    return named.error();
  out.camera.gamma = gamma;
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(out.camera.matrix.data()) = m;
  out.target = target->box;
  out.target_pixels = target->pixels;
  double brightest = 0, noise = 0;
  for (const Response& r : responses) brightest = std::max(brightest, (m * r.mean).maxCoeff());
  for (std::size_t i = 0; i < responses.size(); ++i) {
    const Response& r = responses[i];
    ColourReport report{.colour = r.colour};
    const Eigen::Vector3d estimated = m * r.mean;
    for (int c = 0; c < 3; ++c) {
      report.captured[static_cast<std::size_t>(c)] = captured[i].mean[c];
      report.estimated[static_cast<std::size_t>(c)] = estimated[c];
    }
    const Eigen::Vector3d off = estimated - projected(r.colour);
    report.residual = std::sqrt(off.squaredNorm() / 3);
    noise += captured[i].noise.squaredNorm();
    if (r.colour != kBlack && r.colour != kWhite) weigh_detection(m, responses, brightest, r, report);
    out.colours.push_back(report);
  }
  out.noise = std::sqrt(noise / (3.0 * static_cast<double>(responses.size())));
  return out;
}

std::string primary_name(Primary colour) {
  return {colour & 1 ? '1' : '0', colour & 2 ? '1' : '0', colour & 4 ? '1' : '0'};
}

std::optional<Primary> primary_of(const std::string& name) {
  if (name.size() != 3 || name.find_first_not_of("01") != std::string::npos) return std::nullopt;
  return static_cast<Primary>((name[0] - '0') | (name[1] - '0') << 1 | (name[2] - '0') << 2);
}

}  // namespace relievo
