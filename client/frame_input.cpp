// SPDX-License-Identifier: Apache-2.0
#include "client/frame_input.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>

#include "base/time.h"
#include "cli/checks.h"
#include "cli/progress.h"
#include "client/input.h"
#include "client/latest_frame.h"
#include "client/options.h"
#include "client/recorded_stream.h"

namespace relievo {
namespace {

Result<LeftOut> visit_recording(const FrameInput& input, const FrameVisit& visit, StopSignal& stop) {
  auto recorded = RecordedStream::open(input.input, input.stream);
  if (!recorded) return recorded.error();
  if (const Status free = recorded->check_output(visit.out); !free) return free.error();
  recorded->warn_if_cut();
  const auto range = find_range(*input.range, *recorded);
  if (!range) return range.error().in(input.input);
  const auto infos = recorded->read_infos();
  if (!infos) return infos.error();
  auto frames = RangeFrames::open(*recorded, *range);
  if (!frames) return frames.error();

  Progress progress(visit.verb, "frames", std::min(visit.most, range->frames));
  std::uint64_t count = 0;
  while (!stop.stopped() && count < visit.most) {
    const auto next = frames->next();
    if (!next) return next.error();
    if (!*next) break;
    const RecordedInfo* const info = info_of((*next)->sample, *infos);
    const PinholeModel* const camera = info != nullptr ? &info->info.rig.camera : nullptr;
    if (Status seen = visit.frame((*next)->frame, camera); !seen) return seen.error();
    progress.update(++count);
  }
  if (count == 0 && !stop.stopped()) return frames->left_out().all().in(input.input);
  return frames->left_out();
}

Result<LeftOut> visit_live(const FrameInput& input, const FrameVisit& visit, StopSignal& stop) {
  LatestFrame latest;
  auto subscriber = Subscriber::create(*input.domain, input.input, latest.callbacks());
  if (!subscriber) return subscriber.error();
  Progress progress(visit.verb, "frames");
  std::int64_t end_ns = std::numeric_limits<std::int64_t>::max();
  std::uint64_t count = 0;
  while (!stop.stopped() && count < visit.most) {
    const auto taken = latest.take(std::chrono::duration<double>(input.wait_s), stop);
    if (!taken || taken->frame.time_ns > end_ns) break;
    if (count == 0) end_ns = taken->frame.time_ns + std::llround(input.seconds * kNanosecondsPerSecond);
    if (Status seen = visit.frame(taken->frame, &taken->rig.camera); !seen) return seen.error();
    progress.update(++count);
  }
  if (count == 0 && !stop.stopped())
    return Error{"no frame of a stream '" + input.input + "' came in " + duration_text(input.wait_s) +
                 ": is its server running? `relievo streams` lists what there is"};
  return LeftOut();
}

}  // namespace

std::shared_ptr<FrameInput> add_frame_input(CLI::App& app) {
  auto input = std::make_shared<FrameInput>();
  input->domain = add_domain_options(app);
  app.add_option("input", input->input, "Recording, or live stream")->type_name("FILE|STREAM")->required();
  app.add_option("--stream", input->stream, "Which stream, where the file holds several")->type_name("NAME");
  input->range = add_range_options(app);
  app.add_option("--wait", input->wait_s, "Seconds to wait for a live stream")
      ->check(number(0, 1e9))
      ->capture_default_str();
  app.final_callback([input, &app] {
    check_given(app, input->input,
                {.of_files = {"--stream", "--from", "--to", "--frames"}, .of_streams = {"--seconds"}});
  });
  return input;
}

Result<LeftOut> visit_frames(const FrameInput& input, const FrameVisit& visit, StopSignal& stop) {
  const auto file = is_file(input.input);
  if (!file) return file.error();
  return *file ? visit_recording(input, visit, stop) : visit_live(input, visit, stop);
}

}  // namespace relievo
