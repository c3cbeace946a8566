// SPDX-License-Identifier: Apache-2.0
#include "capture/source/take_source.h"

#include <atomic>
#include <cmath>
#include <filesystem>
#include <utility>
#include <vector>

#include "capture/rig_file.h"
#include "capture/source/take_files.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kCacheBytes = std::size_t{1} << 30;

/// The pictures of one frame: two where the scan is progressive.
struct Pictures {
  Image8 first, second;
};

class TakeSource final : public FieldSource {
 public:
  TakeSource(fs::path take, SourceInfo info, std::vector<TakeStamp> stamps, bool loop)
      : take_(std::move(take)), info_(std::move(info)), stamps_(std::move(stamps)), loop_(loop) {
    const TakeStamp& last = stamps_.back();
    pass_frames_ = last.frame - stamps_.front().frame + 1;
    pass_ns_ = last.time_ns - stamps_.front().time_ns + std::llround(1e9 / info_.rig.frame_rate);
    if (loop_) cache_.resize(stamps_.size());
  }

  const SourceInfo& info() const override { return info_; }

  Result<std::optional<CapturedFrame>> next() override {
    if (stopped_ || ended_) return std::optional<CapturedFrame>{};
    if (index_ == stamps_.size()) {
      if (!loop_ || !read_any_) {  // a pass without one readable frame would loop for ever
        ended_ = true;
        return std::optional<CapturedFrame>{};
      }
      index_ = 0;
      ++pass_;
      read_any_ = false;
    }
    std::error_code code;
    if (!fs::exists(take_ / "frames", code)) {  // asked each time, so that a cached loop notices as well
      ended_ = true;
      return Error{"take " + take_.string() + " was removed while it was being read"};
    }
    const std::size_t index = index_++;
    Result<Pictures> pictures = read(index);
    if (!pictures) return pictures.error();
    CapturedFrame frame;
    frame.starts_again = pass_ > 0 && !read_any_;
    read_any_ = true;
    frame.number = stamps_[index].frame + pass_ * pass_frames_;
    frame.time_ns = stamps_[index].time_ns + static_cast<std::int64_t>(pass_) * pass_ns_;
    frame.scan = info_.rig.scan;
    frame.field_order = info_.rig.field_order;
    frame.picture = std::move(pictures->first);
    frame.complement = std::move(pictures->second);
    return std::optional(std::move(frame));
  }

  void request_stop() override { stopped_ = true; }

 private:
  Result<Pictures> read(std::size_t index) {
    if (loop_ && !cache_[index].first.empty()) {
      return Pictures{cache_[index].first.clone(), cache_[index].second.clone()};
    }
    const PinholeModel& camera = info_.rig.camera;
    const bool progressive = info_.rig.scan == Scan::kProgressive;
    const std::uint64_t picture = stamps_[index].frame * (progressive ? 2 : 1);
    Pictures pictures;
    for (const bool second : {false, true}) {
      if (second && !progressive) break;
      Result<Image8> image = read_picture(take_picture(take_, picture + second), camera.width, camera.height);
      if (!image) return image.error();
      (second ? pictures.second : pictures.first) = *std::move(image);
    }
    const std::size_t bytes = pictures.first.size() + pictures.second.size();
    if (loop_ && cached_bytes_ + bytes <= kCacheBytes) {
      cached_bytes_ += bytes;
      cache_[index] = {pictures.first.clone(), pictures.second.clone()};
    }
    return pictures;
  }

  const fs::path take_;
  const SourceInfo info_;
  const std::vector<TakeStamp> stamps_;
  const bool loop_;
  std::uint64_t pass_frames_ = 0;
  std::int64_t pass_ns_ = 0;
  std::vector<Pictures> cache_;  // looped only; empty pictures where not read yet
  std::size_t cached_bytes_ = 0;
  std::size_t index_ = 0;
  std::uint64_t pass_ = 0;
  bool read_any_ = false;  // in this pass
  bool ended_ = false;
  std::atomic<bool> stopped_{false};
};

}  // namespace

Result<std::unique_ptr<FieldSource>> open_take(const std::string& take, const SourceOptions& options) {
  const fs::path folder(take);
  std::error_code code;
  if (!fs::is_directory(folder, code)) {
    return Error{"take " + take +
                 " is no folder: give one with rig.yaml, pattern.yaml, timestamps.csv and frames/"};
  }
  Result<Rig> rig = read_rig(folder / "rig.yaml");
  if (!rig) return rig.error();
  Result<Pattern> pattern = read_pattern(folder / "pattern.yaml");
  if (!pattern) return pattern.error();
  Result<std::vector<TakeStamp>> stamps = read_timestamps(folder / "timestamps.csv");
  if (!stamps) return stamps.error();
  if (!fs::is_directory(folder / "frames", code)) return Error{"take " + take + " has no folder frames/"};
  SourceInfo info;
  info.name = "take:" + take;
  info.rig = *std::move(rig);
  info.pattern = *std::move(pattern);
  info.frames = stamps->size();
  return std::unique_ptr<FieldSource>(
      std::make_unique<TakeSource>(folder, std::move(info), *std::move(stamps), options.loop));
}

}  // namespace relievo
