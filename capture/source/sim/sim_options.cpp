// SPDX-License-Identifier: Apache-2.0
#include "capture/source/sim/sim_options.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <set>
#include <string_view>
#include <variant>

namespace relievo::sim {
namespace {

struct Key {
  std::string_view name;
  std::variant<int SimOptions::*, double SimOptions::*, std::uint32_t SimOptions::*> field;
  double low, high;
  std::string_view meaning;
};

constexpr Key kKeys[] = {
    {"width", &SimOptions::width, 32, 4096, "camera pixels"},
    {"height", &SimOptions::height, 32, 4096, "camera pixels"},
    {"rate", &SimOptions::rate, 1, 1000, "frames a second"},
    {"frames", &SimOptions::frames, 0, 1e6, "frames of one pass, 0: one period"},
    {"period", &SimOptions::period, 2, 10000, "frames until all motion repeats"},
    {"drop", &SimOptions::drop, 0, 1e6, "every n-th camera frame is lost, 0: none"},
    {"projector_width", &SimOptions::projector_width, 32, 8192, "projector pixels"},
    {"projector_height", &SimOptions::projector_height, 32, 8192, "projector pixels"},
    {"base", &SimOptions::base, 3, 6, "colours of the code"},
    {"slides", &SimOptions::slides, 1, 2, "slides projected in turn: more are not decoded"},
    {"stripes", &SimOptions::stripes, 2, 8192, "stripes across the projector"},
    {"first", &SimOptions::first, 0, 1e9, "first stripe within the code's path"},
    {"phase", &SimOptions::phase, 0, 14, "fields by which the projector is ahead of the camera"},
    {"drift", &SimOptions::drift, -100, 100, "fields a second that the projector gains on the camera"},
    {"shutter", &SimOptions::shutter, 0.01, 1, "exposure, of a field"},
    {"noise", &SimOptions::noise, 0, 100, "sigma, of 255"},
    {"chroma", &SimOptions::chroma, 0, 20, "sigma of the chroma blur, camera pixels"},
    {"defocus", &SimOptions::defocus, 0, 8, "sigma of the projector's blur, projector pixels"},
    {"ambient", &SimOptions::ambient, 0, 10, "light that is not the projector's, of its white"},
    {"flicker", &SimOptions::flicker, 0, 1, "of the ambient light, that comes and goes on mains of 50 Hz"},
    {"gloss", &SimOptions::gloss, 0, 100, "times each material's gloss"},
    {"albedo", &SimOptions::albedo, 0, 2, "times each material's albedo"},
    {"crosstalk", &SimOptions::crosstalk, 0, 1, "of the colour channels, 0: none"},
    {"gamma", &SimOptions::gamma, 1, 3, "of the camera, whose rig.yaml says so"},
    {"exposure", &SimOptions::exposure, 0.01, 100, "times the scene's own"},
    {"rays", &SimOptions::rays, 1, 8,
     "rays of a pixel each way where shapes meet, 1: one through its middle alone"},
    {"distortion", &SimOptions::distortion, 0, 2, "times a cheap lens's distortion"},
    {"baseline", &SimOptions::baseline, -4, 4,
     "times the scene's own; below 0: the projector stands to the camera's left"},
    {"roll", &SimOptions::roll, -180, 180, "degrees by which the projector is turned about its axis"},
    {"seed", &SimOptions::seed, 0, 4294967295.0, "of the noise"},
};

constexpr double kLeastBaseline = 0.01;
constexpr int kWhiteFramePeriod = 84;  // of cycles of 2 or 3 frames

std::string text(double value) {
  char out[32];
  std::snprintf(out, sizeof out, "%.10g", value);
  return out;
}

std::string key_names() {
  std::string out = "scan";
  for (const Key& key : kKeys) out += ", " + std::string(key.name);
  return out + ", field_order, scheme, path";
}

Status set(SimOptions& options, const std::string& name, const std::string& value) {
  if (name == "scan") {
    if (value != "interlaced" && value != "progressive") {
      return Error{"scan=" + value + ": give interlaced or progressive"};
    }
    options.scan = value == "interlaced" ? Scan::kInterlaced : Scan::kProgressive;
    return {};
  }
  if (name == "field_order") {
    if (value != "top" && value != "bottom") return Error{"field_order=" + value + ": give top or bottom"};
    options.field_order = value == "top" ? FieldOrder::kTop : FieldOrder::kBottom;
    return {};
  }
  if (name == "scheme") {
    const auto scheme = scheme_named(value);
    if (!scheme) return Error{"scheme=" + value + ": give " + scheme_names()};
    options.scheme = *scheme;
    return {};
  }
  if (name == "path") {
    const auto path = code_path_named(value);
    if (!path) return Error{"path=" + value + ": give clear or paper"};
    options.path = *path;
    return {};
  }
  for (const Key& key : kKeys) {
    if (name != key.name) continue;
    double number = 0;
    const auto [end, code] = std::from_chars(value.data(), value.data() + value.size(), number);
    const bool whole = !std::holds_alternative<double SimOptions::*>(key.field);
    if (code != std::errc{} || end != value.data() + value.size() ||
        !(number >= key.low && number <= key.high) || (whole && number != std::floor(number))) {
      return Error{name + "=" + value + ": give a " + (whole ? "whole number " : "number ") + text(key.low) +
                   " to " + text(key.high) + " (" + std::string(key.meaning) + ")"};
    }
    if (const auto* i = std::get_if<0>(&key.field)) options.*(*i) = static_cast<int>(number);
    if (const auto* d = std::get_if<1>(&key.field)) options.*(*d) = number;
    if (const auto* u = std::get_if<2>(&key.field)) options.*(*u) = static_cast<std::uint32_t>(number);
    return {};
  }
  return Error{"unknown key \"" + name + "\": give one of " + key_names()};
}

/// Where the scene's name ends: at the first comma, of a mesh at the first behind its file's extension, since
/// a file's name may have some.
std::size_t end_of_scene(const std::string& spec) {
  if (spec.starts_with("mesh:")) {
    for (std::size_t at = spec.find('.'); at != std::string::npos; at = spec.find('.', at + 1)) {
      std::string extension = spec.substr(at, 5);
      std::ranges::transform(extension, extension.begin(), [](unsigned char c) { return std::tolower(c); });
      for (const char* known : {".ply", ".obj"}) {
        if (extension == known) return std::string::npos;
        if (extension == std::string(known) + ',') return at + 4;
      }
    }
  }
  return spec.find(',');
}

}  // namespace

Result<SimOptions> parse_sim_options(const std::string& spec) {
  SimOptions options;
  std::set<std::string> given;
  std::size_t at = end_of_scene(spec);
  options.scene = spec.substr(0, at);
  while (at != std::string::npos) {
    const std::size_t end = spec.find(',', at + 1);
    const std::string item = spec.substr(at + 1, end == std::string::npos ? end : end - at - 1);
    const std::size_t equals = item.find('=');
    if (equals == std::string::npos)
      return Error{"\"" + item + "\" is no key=value; keys are " + key_names()};
    const std::string name = item.substr(0, equals);
    if (!given.insert(name).second) return Error{name + " is given twice"};
    if (const Status status = set(options, name, item.substr(equals + 1)); !status) return status.error();
    at = end;
  }
  if (options.scheme == Scheme::kOneSlide) {
    if (given.contains("slides") && options.slides != 1)
      return Error{"slides=" + std::to_string(options.slides) + ": scheme=one-slide has one"};
    options.slides = 1;
  }
  if (std::fabs(options.baseline) < kLeastBaseline)
    return Error{"baseline=" + text(options.baseline) + ": depth needs one, of " + text(kLeastBaseline) +
                 " at least to either side"};
  const bool white_frame = options.scheme == Scheme::kWhiteFrame;
  const int cycle = options.slides + (white_frame ? 1 : 0);
  if (white_frame && !given.contains("period")) options.period = kWhiteFramePeriod / cycle * cycle;
  if (options.period % cycle != 0 || options.period % 2 != 0) {
    return Error{"period=" + std::to_string(options.period) + ": give an even number that " +
                 (white_frame ? "slides + 1 (scheme=white-frame) = " : "slides=") + std::to_string(cycle) +
                 " divides, so that a loop goes on with the right slide"};
  }
  if (options.scan == Scan::kInterlaced && options.height % 2 != 0) {
    return Error{"height=" + std::to_string(options.height) + ": an interlaced picture has an even height"};
  }
  if (options.drop == 1) return Error{"drop=1 loses every frame: give 0 or 2 and above"};
  if (options.stripes * 2 > options.projector_width) {
    return Error{"stripes=" + std::to_string(options.stripes) +
                 ": give at most half of projector_width=" + std::to_string(options.projector_width)};
  }
  return options;
}

std::string sim_options_help() {
  const SimOptions defaults;
  std::string out =
      "scan=interlaced|progressive (interlaced)\n"
      "field_order=top|bottom (top): the field that an interlaced frame exposes first\n"
      "scheme=complementary|white-field|white-frame|one-slide (complementary): what is projected in turn\n"
      "path=clear|paper (clear): which path through the code, one whose boundaries flip many channels or the "
      "published one; one-slide has its own\n";
  for (const Key& key : kKeys) {
    const double value =
        std::visit([&](auto field) { return static_cast<double>(defaults.*field); }, key.field);
    out += std::string(key.name) + "=" + text(key.low) + ".." + text(key.high) + " (" + text(value) +
           "): " + std::string(key.meaning) + "\n";
  }
  return out;
}

}  // namespace relievo::sim
