// SPDX-License-Identifier: Apache-2.0
#include "server/rig_report.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/json_text.h"
#include "capture/calibrate/colour.h"

namespace relievo {
namespace {

using Json = nlohmann::ordered_json;

constexpr float kMarginNeeded = 20;    // tc of 5.2.2
constexpr double kClippedMost = 0.01;  // of the picture
constexpr int kBrightLeast = 100;      // grey levels that the brightest hundredth should reach
constexpr double kLitLeast = 0.02;     // of the picture: less is stray light
constexpr double kCoverageLeast = 0.85;
constexpr double kOrderMost = 0.05;

std::string percent(double share) {
  char out[16];
  std::snprintf(out, sizeof out, share < 0.1 ? "%.1f %%" : "%.0f %%", 100 * share);
  return out;
}

/// The grey level that a hundredth of the values of a channel exceed, of the brightest channel.
int bright_level(const ExposureCheck& exposure) {
  int out = 0;
  for (const auto& channel : exposure.histogram) {
    std::uint64_t all = 0, above = 0;
    for (const std::uint64_t count : channel) all += count;
    int bin = kExposureBins - 1;
    while (bin > 0 && (above += channel[static_cast<std::size_t>(bin)]) * 100 < all) --bin;
    out = std::max(out, (bin + 1) * 256 / kExposureBins - 1);
  }
  return out;
}

double lit_share(const RigCheck& check) {
  return check.cover.empty() ? 0
                             : static_cast<double>(check.lit_px) / static_cast<double>(check.cover.size());
}

double order_share(const RigCheck& check) {
  return static_cast<double>(check.order_errors.size()) /
         std::max<double>(1, static_cast<double>(check.neighbours));
}

Json histogram_json(const ExposureCheck& exposure) {
  return {{"red", exposure.histogram[0]}, {"green", exposure.histogram[1]}, {"blue", exposure.histogram[2]}};
}

double tenths(float value) {
  return std::round(10 * static_cast<double>(value)) / 10;
}

Json margins_json(const RigCheck& check) {
  Json out = Json::array();
  for (const ColourMargin& m : check.margins) {
    Json one{{"colour", primary_name(m.colour)},
             {"pieces", m.stripes},
             {"median", nullptr},
             {"low", nullptr},
             {"wrong", nullptr}};
    if (m.stripes > 0) {
      one["median"] = tenths(m.median);
      one["low"] = tenths(m.low);
      one["wrong"] = m.wrong;
    }
    out.push_back(std::move(one));
  }
  return out;
}

Json step_json(const StepStatus& step) {
  Json out{
      {"mixed", step.mixed}, {"regrouped", step.regrouped}, {"phase", nullptr}, {"drift_fields_s", nullptr}};
  if (step.phase) out["phase"] = *step.phase;
  if (step.drift_fields_s) out["drift_fields_s"] = *step.drift_fields_s;
  return out;
}

/// As the page's table names it.
std::string colour_name(Primary colour) {
  static constexpr std::array<const char*, 8> kNames = {"black", "red",     "green", "yellow",
                                                        "blue",  "magenta", "cyan",  "white"};
  return kNames[colour & 7];
}

std::string sentence(std::string words) {
  words.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(words.front())));
  if (words.back() != '.' && words.back() != '?') words += '.';
  return words;
}

void advise_on_stripes(const RigCheck& check, std::vector<std::string>& out) {
  if (check.coverage() < kCoverageLeast)
    out.push_back("stripes are decoded on " + percent(check.coverage()) +
                  " of where their light arrives: focus both lenses, or project fewer stripes");
  std::string weak;
  for (const ColourMargin& m : check.margins)
    if (m.stripes > 0 && m.low < kMarginNeeded) weak += (weak.empty() ? "" : ", ") + colour_name(m.colour);
  if (!weak.empty())
    out.push_back("hardly told: " + weak + "; calibrate the colours, or keep other light away");
  if (order_share(check) > kOrderMost)
    out.push_back(
        percent(order_share(check)) +
        " of neighbouring boundaries do not fit together: stripes are too fine, out of focus, or not of "
        "this pattern");
}

}  // namespace

std::vector<std::string> rig_advice(const TappedFrame& frame, const RigCheck& check) {
  std::vector<std::string> out;
  if (!frame.calibrated)
    out.emplace_back(
        "the rig is not calibrated: its shapes are guesses until it is; set the exposure, then calibrate the "
        "colours, and after them the geometry");
  if (check.exposure.clipped > kClippedMost) {
    out.push_back(percent(check.exposure.clipped) +
                  " of the picture is clipped: expose shorter, lower the camera's gain or close its iris");
  } else if (const int level = bright_level(check.exposure); level < kBrightLeast) {
    out.push_back("the brightest hundredth of the picture reaches level " + std::to_string(level) +
                  " of 255 only: expose longer, raise the gain or open the iris");
  }
  if (!frame.step_advice.empty()) out.push_back(frame.step_advice);
  if (const double excess = std::fabs(frame.report.slide_excess); excess > ReconstructReport::kNotableExcess)
    out.push_back(
        "one exposure of a frame is " + percent(excess) +
        " brighter than the other, which is taken out but for some noise: light with lamps on DC or by day, "
        "or expose for whole periods of the mains, with the camera's automatic exposure switched off");
  if (frame.decoded && lit_share(check) < kLitLeast) {
    out.emplace_back(
        "no stripes arrive: is the projector on, does it show the pattern, and does the camera see where?");
  } else if (frame.decoded && frame.calibrated) {
    advise_on_stripes(check, out);  // a guess says nothing of focus and colours
  }
  for (std::string& line : out) line = sentence(std::move(line));
  return out;
}

std::string rig_report(const std::string& stream, const TappedFrame& frame, const RigCheck& check,
                       const RigView& made, const Rig& rig) {
  Json filters;
  for (const Filter& filter : kFilters)
    filters[std::string(filter.name)] = frame.report.filters.*filter.count;
  Json pictures = Json::array();
  for (const auto& [name, jpeg] : made.pictures) pictures.push_back(name);
  const Json out{
      {"state", "measured"},
      {"stream", stream},
      {"frame", frame.captured.number},
      {"camera", {{"width", rig.camera.width}, {"height", rig.camera.height}}},
      {"exposure",
       {{"histogram", histogram_json(check.exposure)},
        {"clipped", check.exposure.clipped},
        {"clipped_level", kClippedLevel},
        {"dark", check.exposure.dark},
        {"dark_level", kDarkLevel},
        {"bright", bright_level(check.exposure)},
        {"slide_excess", frame.report.slide_excess}}},
      {"margins", margins_json(check)},
      {"margin_needed", kMarginNeeded},
      {"noise", tenths(check.noise)},
      {"coverage", {{"lit", lit_share(check)}, {"share", check.coverage()}}},
      {"boundaries",
       {{"seen", check.boundaries},
        {"matched", frame.report.matched},
        {"points", frame.grid.size()},
        {"neighbours", check.neighbours},
        {"order_errors", check.order_errors.size()}}},
      {"filters", std::move(filters)},
      {"step", step_json(frame.step)},
      {"advice", rig_advice(frame, check)},
      {"pictures", std::move(pictures)},
  };
  return json_line(out);
}

}  // namespace relievo
