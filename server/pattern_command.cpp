// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/counted.h"
#include "base/json_text.h"
#include "base/log.h"
#include "base/new_folder.h"
#include "base/whole_file.h"
#include "capture/calibrate/gray_stack.h"
#include "capture/calibrate/pictures.h"
#include "capture/calibrate/stripe_stack.h"
#include "capture/pattern/gray_code.h"
#include "capture/pattern/repeating.h"
#include "capture/pattern/schedule.h"
#include "capture/pattern/slides.h"
#include "capture/projector/slide_video.h"
#include "capture/rig_file.h"
#include "cli/checks.h"
#include "cli/progress.h"
#include "cli/size_option.h"
#include "codec/export.h"
#include "server/commands.h"
#include "server/options.h"
#include "server/pattern_options.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;

struct Options {
  std::string out;
  PatternOptions pattern;
  std::string field_order = "top";
  Size size{1024, 768};
  bool interlaced = false;
  bool gray = false;
  bool both_axes = false;
  double rate = 29.97;
  double seconds = 10;
  bool json = false;
};

/// Whoever projects a folder projects all of its pictures. Those in `names` are replaced.
Status refuse_other_pictures(const fs::path& folder, const std::vector<std::string>& names) {
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(folder, none)) {
    const std::string name = entry.path().filename().string();
    if (entry.path().extension() != ".png" || std::ranges::find(names, name) != names.end()) continue;
    return Error{folder.string() + " has other pictures (" + name +
                 "), which would be projected with these: give a new folder or remove it"};
  }
  return {};
}

/// A folder of a take, or of views: what was captured is there, not what is to be projected.
bool holds_captures(const fs::path& folder) {
  std::error_code none;
  if (fs::exists(folder / "rig.yaml", none) || fs::exists(folder / "timestamps.csv", none)) return true;
  return std::ranges::any_of(fs::directory_iterator(folder, none), [](const fs::directory_entry& entry) {
    std::error_code ignored;
    if (!entry.is_directory(ignored)) return false;
    const auto pictures = pictures_in(entry.path());
    return pictures && !pictures->empty();
  });
}

/// True of a file that says something else, or cannot be read.
bool is_other_pattern(const fs::path& file, const Pattern& pattern) {
  std::error_code ignored;
  if (!fs::exists(file, ignored)) return false;
  const auto before = read_pattern(file);
  return !before || to_yaml(*before) != to_yaml(pattern);
}

/// Captures cannot be decoded without the pattern that they were taken under.
Status refuse_other_captures(const fs::path& folder, const Pattern& pattern) {
  const fs::path file = folder / "pattern.yaml";
  if (!is_other_pattern(file, pattern) || !holds_captures(folder)) return {};
  return Error{file.string() +
               " is another pattern, which the captures in that folder were taken under: give a new folder"};
}

Status write_gray(const Options& options, StopSignal& stop) {
  const std::size_t count = gray_slides(options.size.width, options.size.height).size();
  std::vector<std::string> names;
  for (std::size_t i = 0; i < count; ++i) names.push_back(gray_slide_name(i));
  if (const Status alone = refuse_other_pictures(options.out, names); !alone) return alone;
  Progress progress("pattern", "slides", count);
  const auto go_on = [&](std::size_t done, std::size_t) {
    progress.update(done);
    return !stop.stopped();
  };
  if (const Status written = write_gray_slides(options.out, options.size.width, options.size.height, go_on);
      !written) {
    if (!stop.stopped()) return written;
    log_info(written.error().message);
    return {};
  }
  progress.finish();
  if (options.json) {
    std::puts(json_text(nlohmann::json({{"folder", options.out}, {"slides", count}})).c_str());
  } else {
    std::printf(
        "%zu slides of Gray code, %dx%d, in %s: project them in the order of their names, one picture each\n",
        count, options.size.width, options.size.height, options.out.c_str());
  }
  return {};
}

/// For calibration: the slides along columns, then along rows.
Status write_both_axes(const Options& options, const Pattern& pattern) {
  const Scan scan = options.interlaced ? Scan::kInterlaced : Scan::kProgressive;
  std::vector<std::string> names = stripe_view_names(pattern.slides, scan);
  for (std::string& name : names) name += ".png";
  if (auto s = refuse_other_pictures(options.out, names); !s) return s;
  if (auto s = refuse_other_captures(options.out, pattern); !s) return s;
  const auto [width, height] = options.size;
  if (auto s = write_stripe_slides(options.out, pattern, width, height, scan,
                                   field_order_named(options.field_order));
      !s)
    return s;
  if (auto s = write_whole_file(fs::path(options.out) / "pattern.yaml", to_yaml(pattern)); !s) return s;
  const std::size_t count = names.size();
  const int rows = row_pattern(pattern, width, height).stripes();
  if (options.json) {
    const nlohmann::json json = {
        {"folder", options.out}, {"slides", count}, {"stripes", pattern.stripes()}, {"row_stripes", rows}};
    std::puts(json_text(json).c_str());
  } else {
    std::printf(
        "%zu slides, %dx%d, of %d stripes along columns and %d along rows, in %s: project them in the order "
        "of "
        "their names, one picture each\n",
        count, width, height, pattern.stripes(), rows, options.out.c_str());
  }
  return {};
}

/// The picture of one field: "slide1", "slide1_complement" or "white".
std::string field_name(const Exposure& exposure) {
  if (exposure.light == Light::kWhite) return "white.png";
  return "slide" + std::to_string(exposure.slide + 1) +
         (exposure.light == Light::kComplement ? "_complement.png" : ".png");
}

/// The pictures in the order of projection: a name a field, or a frame.
std::vector<std::string> names_in_order(const Options& options, const Pattern& pattern) {
  std::vector<std::string> out;
  for (int frame = 0; frame < cycle_frames(pattern); ++frame) {
    if (options.interlaced) {
      out.push_back("frame" + std::to_string(frame + 1) + ".png");
      continue;
    }
    for (const int half : {0, 1})
      out.push_back(field_name(shown(pattern, static_cast<std::uint64_t>(frame), half)));
  }
  return out;
}

/// Beside FILE.mkv, FILE.pattern.yaml, so that what was played is known. The two are replaced together.
Status write_video(const Options& options, const Pattern& pattern, StopSignal& stop) {
  const fs::path file = options.out, yaml = fs::path(file).replace_extension(".pattern.yaml");
  std::error_code ignored;
  if (is_other_pattern(yaml, pattern) && !fs::exists(file, ignored)) {
    return Error{yaml.string() + " is another pattern, and not of a video " + file.string() +
                 ", which is not there: give another name, or remove it"};
  }
  const auto video = write_slide_video(file, pattern,
                                       {.width = options.size.width,
                                        .height = options.size.height,
                                        .interlaced = options.interlaced,
                                        .field_order = field_order_named(options.field_order),
                                        .frame_rate = options.rate,
                                        .duration_s = options.seconds,
                                        .stopped = [&stop] { return stop.stopped(); }});
  if (!video) return stop.stopped() ? Status() : video.error();
  if (auto s = write_whole_file(yaml, to_yaml(pattern)); !s) return s;
  const double rate = static_cast<double>(video->rate_numerator) / video->rate_denominator;
  if (options.json) {
    const nlohmann::json json = {{"file", options.out},
                                 {"pattern", yaml.string()},
                                 {"pictures", video->pictures},
                                 {"rate", {video->rate_numerator, video->rate_denominator}},
                                 {"interlaced", options.interlaced},
                                 {"scheme", to_string(pattern.scheme)},
                                 {"stripes", pattern.stripes()}};
    std::puts(json_text(json).c_str());
  } else {
    std::printf(
        "%llu %s of %d stripes, %dx%d, %.2f a second, %.1f s, in %s: play it in a loop, full screen\n",
        static_cast<unsigned long long>(video->pictures), options.interlaced ? "frames" : "fields",
        pattern.stripes(), options.size.width, options.size.height, rate,
        static_cast<double>(video->pictures) / rate, options.out.c_str());
  }
  return {};
}

bool is_video(const Options& options) {
  return fs::path(options.out).extension() == ".mkv";
}

Status run(const Options& options, StopSignal& stop) {
  if (is_video(options)) {
    const auto pattern = pattern_of(options.pattern);
    if (!pattern) return pattern.error();
    if (const Status fits = fits_projector(*pattern, options.size.width); !fits) return fits;
    return write_video(options, *pattern, stop);
  }
  if (options.gray) return write_gray(options, stop);
  const auto pattern = pattern_of(options.pattern);
  if (!pattern) return pattern.error();
  if (const Status fits = fits_projector(*pattern, options.size.width); !fits) return fits;
  const auto folder = NewFolder::create(options.out);
  if (!folder) return folder.error();
  if (options.both_axes) return write_both_axes(options, *pattern);
  const std::vector<std::string> order = names_in_order(options, *pattern);
  if (const Status alone = refuse_other_pictures(options.out, order); !alone) return alone;
  if (const Status own = refuse_other_captures(options.out, *pattern); !own) return own;
  std::vector<std::string> files;
  const auto [width, height] = options.size;
  const FieldOrder first = field_order_named(options.field_order);
  for (std::size_t i = 0; i < order.size(); ++i) {
    const int frame = static_cast<int>(options.interlaced ? i : i / 2);
    if (std::ranges::find(files, order[i]) != files.end()) continue;  // white again
    files.push_back(order[i]);
    const Image8 picture =
        options.interlaced
            ? draw_interlaced(*pattern, frame, first, width, height)
            : draw_field(*pattern, shown(*pattern, static_cast<std::uint64_t>(frame), i % 2 == 1), width,
                         height);
    if (auto s = write_png(fs::path(options.out) / order[i], picture.view()); !s) return s;
  }
  const std::string yaml = to_yaml(*pattern);
  files.emplace_back("pattern.yaml");
  const std::vector<std::uint8_t> bytes(yaml.begin(), yaml.end());
  if (auto s = write_whole_file(fs::path(options.out) / files.back(), bytes); !s) return s;
  if (options.json) {
    std::puts(json_text(nlohmann::json({{"folder", options.out},
                                        {"files", files},
                                        {"order", order},
                                        {"scheme", to_string(pattern->scheme)},
                                        {"stripes", pattern->stripes()}}))
                  .c_str());
    return {};
  }
  std::printf("%d stripes on %s, %dx%d, in %s\n", pattern->stripes(),
              counted(static_cast<std::uint64_t>(pattern->slides), "slide").c_str(), width, height,
              options.out.c_str());
  std::printf("project, a %s each, again and again:", options.interlaced ? "frame" : "field");
  for (const std::string& name : order) std::printf(" %s", name.c_str());
  std::printf("\n");
  if (pattern->scheme == Scheme::kOneSlide)
    std::printf("codes repeat; no run of %d boundaries does\n", unique_run(*pattern));
  return {};
}

}  // namespace

Command pattern_command() {
  return {
      "pattern", "Write the slides to project as pictures or video, with their pattern.yaml",
      [](CLI::App& app) {
        auto o = std::make_shared<Options>();
        app.add_option("--out", o->out,
                       "Folder without other pictures or captures, made where it is missing, or video "
                       "FILE.mkv: lossless "
                       "(FFV1), to be "
                       "played in a loop")
            ->type_name("DIR|FILE.mkv")
            ->required();
        auto* file = add_pattern_options(app, o->pattern);
        add_size_option(app, "--size", o->size, "The projector's pixels, WIDTHxHEIGHT (default 1024x768)");
        auto* interlaced = app.add_flag(
            "--interlaced", o->interlaced,
            "A picture a frame, for interlaced video: the first field on even rows, the second on odd ones");
        app.add_option("--field-order", o->field_order,
                       "With --interlaced: bottom puts the first field on the odd rows")
            ->check(CLI::IsMember({"top", "bottom"}))
            ->capture_default_str()
            ->needs(interlaced);
        auto* both = app.add_flag(
            "--both-axes", o->both_axes,
            "Stripes along columns, then along rows, for calibrate geometry: give --stripes a divisor of the "
            "width");
        app.add_flag("--gray", o->gray,
                     "Gray code instead of stripes: columns, rows, white and black, for calibration and "
                     "still scenes")
            ->excludes(file)
            ->excludes(interlaced)
            ->excludes(both);
        app.add_option("--rate", o->rate, "Of a video: frames (field pairs) a second")
            ->check(number(1, 1000))
            ->capture_default_str();
        app.add_option("--seconds", o->seconds, "Of a video: its length, rounded up to whole cycles")
            ->check(number(0.01, 36000))
            ->capture_default_str();
        app.add_flag("--json", o->json, "Print the result as JSON");
        app.final_callback([o] {
          if (!o->gray) check_pattern_options(o->pattern);
          if (!is_video(*o) && !folder_name()(o->out).empty())
            throw CLI::ValidationError("--out", "give a folder, or a video's name that ends in .mkv");
          if (is_video(*o) && (o->gray || o->both_axes))
            throw CLI::ValidationError("--out", "Gray code and --both-axes are pictures: give a folder");
        });
        app.footer(scheme_help());
        return [o](StopSignal& stop) { return run(*o, stop); };
      }};
}

}  // namespace relievo
