// SPDX-License-Identifier: Apache-2.0
#include "capture/projector/show_slides.h"

#include <chrono>
#include <thread>
#include <utility>
#include <vector>

#include "base/time.h"
#include "capture/pattern/schedule.h"
#include "capture/pattern/slides.h"
#include "capture/projector/refresh_count.h"

namespace relievo {
namespace {

constexpr double kAssumed_hz = 60;  // where the system does not say
constexpr std::chrono::milliseconds kStill{100};
constexpr int kWarmUp = 3;  // the first swaps of a new window wait for the desktop

/// All pictures of one cycle of the schedule, in order.
std::vector<Image8> cycle_of(const Pattern& pattern, const ShowOptions& options, const DisplayMode& mode) {
  std::vector<Image8> out;
  for (int frame = 0; frame < cycle_frames(pattern); ++frame) {
    if (options.interlaced) {
      out.push_back(draw_interlaced(pattern, frame, options.field_order, mode.width, mode.height));
      continue;
    }
    for (const int half : {0, 1})
      out.push_back(draw_field(pattern, shown(pattern, static_cast<std::uint64_t>(frame), half), mode.width,
                               mode.height));
  }
  return out;
}

}  // namespace

Result<ShowReport> show_slides(Display& display, const Pattern& pattern, const ShowOptions& options) {
  return show_cycle(display, cycle_of(pattern, options, display.output().mode), options);
}

Result<ShowReport> show_cycle(Display& display, const std::vector<Image8>& cycle,
                              const ShowOptions& options) {
  const DisplayMode& mode = display.output().mode;
  if (const Status loaded = display.load(cycle); !loaded) return loaded.error();
  const double told_hz = mode.refresh_hz > 0 ? mode.refresh_hz : kAssumed_hz;
  const auto each = static_cast<std::uint64_t>(options.refreshes_each);
  RefreshCount count(told_hz, options.refreshes_each);
  for (int i = 0; i < kWarmUp; ++i)
    if (const auto flip = display.show(0, 1); !flip) return flip.error();
  ShowReport report;
  std::uint64_t place = 0;  // in the schedule, of the picture to show
  std::int64_t due_ns = 0;  // of that picture, where the display does not wait
  while (!(options.stopped && options.stopped()) && !display.closed() &&
         (!options.pictures || report.pictures < *options.pictures)) {
    if (!count.synchronised() && due_ns > steady_now_ns())
      std::this_thread::sleep_for(std::chrono::nanoseconds(due_ns - steady_now_ns()));
    const auto flip = display.show(place % cycle.size(), options.refreshes_each);
    if (!flip) return flip.error();
    const std::uint64_t refresh = count.flip(*flip);
    report = {.pictures = count.pictures(),
              .refreshes = count.refreshes(),
              .missed = count.missed(),
              .refresh_hz = count.refresh_hz(),
              .synchronised = count.synchronised(),
              .counted = flip->refresh.has_value()};
    if (options.progress) options.progress(report);
    // Refreshes that were missed have had their pictures; a part of a picture's time counts as all of it.
    place = (refresh + each - 1) / each + 1;
    const auto interval_ns = static_cast<std::int64_t>(options.refreshes_each * 1e9 / told_hz);
    due_ns = std::max(due_ns + interval_ns, flip->time_ns + interval_ns / 2);
  }
  return report;
}

Status show_still(Display& display, Image8 picture, const std::function<bool()>& stopped) {
  std::vector<Image8> one;
  one.push_back(std::move(picture));
  if (const Status loaded = display.load(one); !loaded) return loaded;
  while (!(stopped && stopped()) && !display.closed()) {
    if (const auto flip = display.show(0, 1); !flip) return flip.error();
    std::this_thread::sleep_for(kStill);
  }
  return {};
}

}  // namespace relievo
