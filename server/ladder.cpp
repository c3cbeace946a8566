// SPDX-License-Identifier: Apache-2.0
#include "server/ladder.h"

#include <algorithm>
#include <string>
#include <utility>

#include "base/log.h"
#include "base/thread_name.h"
#include "base/time.h"
#include "capture/reconstruct/detection_lines.h"
#include "codec/reduce.h"

namespace relievo {
namespace {

constexpr int kStepBits = 4;         // a sixteenth of a pixel: below the noise of what is measured
constexpr int kTextureQuality = 70;  // of half the size
constexpr float kBound_px = 1;

}  // namespace

EncodeOptions rung_options(const EncodeOptions& full, Rung rung) {
  EncodeOptions options = full;
  if (is_jpeg(rung)) options.texture = TextureCodec::kJpeg;
  if (detail_of(rung) == Rung::kFull) return options;
  options.step_bits = std::min(options.step_bits, kStepBits);
  if (options.bound_px > 0) options.bound_px = std::max(options.bound_px, kBound_px);
  options.texture_quality = std::min(options.texture_quality, kTextureQuality);
  options.quality = false;
  return options;
}

struct Ladder::Step {
  Output output;
  EncodeOptions options;
  FrameEncoder encoder;
  PipelineStats stats;
  std::atomic<std::uint64_t> drops{0};
  // Of the ladder's thread:
  Frame3D frame;  // what is encoded; its memory stays
  std::uint64_t sequence = 0;
  bool was_read = false;
  bool said = false;  // that it could not be published

  Rung detail() const { return detail_of(output.rung); }
  bool takes_all() const { return !output.due && output.readers() > 0; }
  bool takes() const { return output.readers() > 0 && (!output.due || output.due()); }
};

Ladder::Ladder(const Rig& rig, const Pattern& pattern, const EncodeOptions& encode, double depth_resolution)
    : rig_(rig),
      pattern_(pattern),
      encode_(encode),
      depth_resolution_(depth_resolution),
      volume_(encode.volume) {}

Ladder::~Ladder() {
  end();
}

void Ladder::add(Output output) {
  const Rung rung = output.rung;
  steps_.emplace_back(new Step{.output = std::move(output),
                               .options = rung_options(encode_, rung),
                               .encoder = FrameEncoder(rig_, pattern_)});
}

bool Ladder::wanted() {
  return std::any_of(steps_.begin(), steps_.end(), [](const auto& step) { return step->takes(); });
}

void Ladder::take(Frame3D frame, std::int64_t capture_time_ns, int line_stride) {
  if (!thread_.joinable()) thread_ = std::thread([this] { run(); });
  const std::uint64_t before = queue_.drops();
  queue_.push_drop_oldest(Item(std::move(frame), capture_time_ns, line_stride, &give_back_));
  if (queue_.drops() == before) return;
  for (const auto& step : steps_)
    if (step->takes_all()) ++step->drops;
}

void Ladder::end() {
  ending_ = true;
  queue_.close();
  if (thread_.joinable()) thread_.join();
}

void Ladder::run() {
  name_this_thread("ladder");
  std::int64_t key_ns = steady_now_ns() - kWishedKeyInterval_ns;
  while (auto item = queue_.pop()) {
    if (ending_) continue;
    const std::int64_t now_ns = steady_now_ns();
    const bool key = now_ns - key_ns >= kWishedKeyInterval_ns && key_wanted_.exchange(false);
    if (key) key_ns = now_ns;
    bool halved = false;
    for (const auto& step : steps_) {
      const bool is_read = step->takes();
      if (key || (is_read && (step->output.due || !step->was_read))) step->encoder.request_key_frame();
      step->was_read = is_read;
      if (!is_read) continue;
      if (step->detail() != Rung::kFull && !std::exchange(halved, true)) halve(item->frame.texture, half_);
      encode(*step, *item);
    }
  }
}

void Ladder::encode(Step& step, Item& item) {
  const std::int64_t begin_ns = steady_now_ns();
  Frame3D& frame = step.frame;
  frame.number = item.frame.number;
  frame.time_ns = item.frame.time_ns;
  const bool full = step.detail() == Rung::kFull;
  // A surface that lies on no grid goes whole, with the smaller texture.
  const bool halves = step.detail() == Rung::kReduced;
  const int lines = line_count(rig_, item.line_stride);
  const bool whole = full || (halves && !halve_lines(item.frame.surface, lines, frame.surface));
  step.encoder.set_line_stride(item.line_stride * (halves ? 2 : 1));
  if (whole) std::swap(frame.surface, item.frame.surface);
  Image8& texture = full ? item.frame.texture : half_;
  std::swap(frame.texture, texture);
  EncodeOptions options = step.options;
  options.volume = volume_.fit(frame.surface.positions);
  if (const int bits = volume_.bits(depth_resolution_); bits > 0) options.position_bits = bits;
  auto bytes = step.encoder.encode(frame, options);
  std::swap(frame.texture, texture);
  if (whole) std::swap(frame.surface, item.frame.surface);
  const auto fail = [&](const Error& error) {
    if (!std::exchange(step.said, true))
      log_warning("quality " + std::string(to_string(step.output.rung)) + ": " + error.message);
  };
  if (!bytes) return fail(bytes.error());
  if (const std::string notice = step.encoder.take_notice(); !notice.empty())
    log_warning("quality " + std::string(to_string(step.output.rung)) + ": " + notice);
  step.stats.encoded(milliseconds(steady_now_ns() - begin_ns));
  FrameMessage message;
  message.sequence = step.sequence++;
  message.number = frame.number;
  message.capture_time_ns = item.capture_time_ns;
  message.publish_time_ns = utc_now_ns();
  message.data = std::make_shared<const Bytes>(*std::move(bytes));
  message.rung = step.output.rung;
  step.stats.published(message.capture_time_ns, message.publish_time_ns, message.data->size());
  if (const Status sent = step.output.publish(message); !sent) fail(sent.error());
}

std::vector<RungStatus> Ladder::status() const {
  std::vector<RungStatus> out;
  for (const auto& step : steps_) {
    const ServerStatus counts = step->stats.snapshot(utc_now_ns());
    out.push_back({.rung = step->output.rung,
                   .readers = static_cast<std::uint32_t>(std::max(0, step->output.readers())),
                   .frames = counts.frames_published,
                   .drops = step->drops,
                   .encode_ms = counts.encode_ms,
                   .bit_rate = counts.bit_rate});
  }
  return out;
}

}  // namespace relievo
