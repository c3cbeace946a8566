// SPDX-License-Identifier: Apache-2.0
#include "server/calibrate_views.h"

#include <algorithm>
#include <filesystem>

#include "base/log.h"
#include "capture/calibrate/gray_stack.h"
#include "capture/calibrate/stripe_stack.h"
#include "capture/rig_file.h"
#include "cli/progress.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;

/// The folders of VIEWS, in the order of their names; VIEWS itself where it holds pictures is a usual
/// mistake.
Result<std::vector<fs::path>> views_in(const std::string& folder) {
  std::error_code code;
  if (!fs::is_directory(folder, code)) return Error{folder + " is no folder"};
  std::vector<fs::path> out;
  for (fs::directory_iterator it(folder, code), end; !code && it != end; it.increment(code)) {
    std::error_code ignored;
    if (it->is_directory(ignored)) out.push_back(it->path());
  }
  if (code) return Error{"cannot read the folder " + folder + ": " + code.message()};
  if (fs::is_directory(fs::path(folder) / "views", code))
    return Error{folder + " holds a folder of views: give " + (fs::path(folder) / "views").string()};
  std::sort(out.begin(), out.end());
  if (out.empty())
    return Error{folder + " has no folders: a calibration needs several views, a folder of pictures each"};
  return out;
}

struct OneView {
  MeasuredView view;
  int width = 0, height = 0;  // 0 where it could not be read
  bool of_fields = false;     // frames of an interlaced camera
};

/// The size of most views' pictures; of two as frequent ones the first.
Size usual_size(const std::vector<OneView>& views) {
  const auto same = [&](const OneView& one) {
    return std::ranges::count_if(
        views, [&](const OneView& v) { return v.width == one.width && v.height == one.height; });
  };
  Size out;
  std::ptrdiff_t most = 0;
  for (const OneView& one : views) {
    if (one.width == 0 || same(one) <= most) continue;
    most = same(one);
    out = {one.width, one.height};
  }
  return out;
}

std::string text_of(Size size) {
  return std::to_string(size.width) + "x" + std::to_string(size.height);
}

OneView measure_one(const fs::path& folder, const ViewCode& code, const Board& board, WorkerPool& pool,
                    StopSignal& stop) {
  const std::string name = folder.filename().string();
  const auto go_on = [&](std::size_t, std::size_t) { return !stop.stopped(); };
  const auto [width, height] = code.projector;
  const auto measured = [&](const auto& stack, const auto& how) {
    // A folder of something else, or a capture cut short: the others may do.
    if (!stack) return OneView{{.name = name, .corners = {}, .refused = stack.error().message}};
    return OneView{measure_view(name, *stack, board, how, pool), stack->width(), stack->height()};
  };
  if (!code.stripes) return measured(read_gray_stack(folder, width, height, go_on), GrayDecodeOptions{});
  const auto stack = read_stripe_stack(folder, *code.stripes, width, height,
                                       {.field_order = code.field_order, .on_picture = go_on});
  OneView one = measured(stack, code.colours);
  one.of_fields = stack && stack->of_fields;
  return one;
}

}  // namespace

Result<RigPart> rig_to_update(const std::string& file) {
  std::error_code ignored;
  if (!fs::exists(file, ignored))
    return Error{file + " is missing, which --update is to add to: --out " + file + " begins a new one"};
  return read_rig_part(file);
}

Result<std::optional<Pattern>> stripes_of(const std::string& folder, const std::string& pattern) {
  if (pattern == "gray") return std::optional<Pattern>();
  const fs::path file = pattern.empty() ? fs::path(folder) / "pattern.yaml" : fs::path(pattern);
  std::error_code ignored;
  if (pattern.empty() && !fs::exists(file, ignored)) return std::optional<Pattern>();
  auto read = read_pattern(file);
  if (!read) return read.error();
  return std::optional<Pattern>(*std::move(read));
}

Result<MeasuredViews> measure_views(const std::string& folder, const ViewCode& code, const Board& board,
                                    int threads, StopSignal& stop) {
  auto folders = views_in(folder);
  if (!folders) return folders.error();
  std::vector<OneView> views;
  WorkerPool pool(threads);
  Progress progress("calibrate", "views", folders->size());
  for (const fs::path& path : *folders) {
    OneView one = measure_one(path, code, board, pool, stop);
    if (stop.stopped()) return Error{"stopped"};
    if (!one.view.refused.empty()) log_warning("view " + one.view.name + " is left out: " + one.view.refused);
    views.push_back(std::move(one));
    progress.update(views.size());
  }
  const Size size = usual_size(views);
  MeasuredViews out;
  out.camera.width = size.width;
  out.camera.height = size.height;
  for (OneView& one : views) {
    if (one.view.refused.empty() && (one.width != size.width || one.height != size.height)) {
      one.view.refused = "its pictures are " + text_of({one.width, one.height}) + ", others " + text_of(size);
      log_warning("view " + one.view.name + " is left out: " + one.view.refused);
    }
    out.of_fields = out.of_fields || one.of_fields;
    out.views.push_back(std::move(one.view));
  }
  if (out.camera.width == 0)
    return Error{"no view of " + folder + " can be used: " + out.views.front().refused};
  return out;
}

}  // namespace relievo
