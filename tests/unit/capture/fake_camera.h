// SPDX-License-Identifier: Apache-2.0
// A scripted V4L2 driver: one camera whose buffers the test fills, in virtual time.
#pragma once

#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <deque>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "capture/source/v4l2/io.h"

namespace relievo::test {

/// 8x4 RGB24 by default. One thread. Every buffer that is mapped, opened or queued must be let go again: see
/// `mapped` and `opened`.
class FakeCamera final : public v4l2::Io {
 public:
  struct Shot {
    std::uint32_t sequence = 0;
    std::uint32_t flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
    std::uint32_t field = V4L2_FIELD_NONE;
    std::uint8_t value = 0;      // of every byte
    std::uint32_t short_by = 0;  // bytes missing at the end
    std::int64_t late_ns = 0;    // its stamp lies so far behind its arrival
  };

  // What the camera is.
  std::uint32_t fourcc = V4L2_PIX_FMT_RGB24;
  std::uint32_t width = 8, height = 4, field = V4L2_FIELD_NONE, bytes_a_pixel = 3;
  std::uint32_t capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
  std::uint32_t input_status = 0;
  std::int64_t period_ns = 10'000'000;

  // What goes wrong.
  int open_error = 0;
  std::map<unsigned long, std::deque<int>> errors;  // the next results of a request; 0: as usual
  bool unplugged = false;

  // What was seen.
  int opened = 0, mapped = 0, streams = 0;
  std::deque<Shot> shots;                 // to come
  std::function<void()> on_idle = [] {};  // when a buffer is waited for in vain
  std::function<void()> on_sleep = [] {};
  std::int64_t now_ns = 1'000'000'000;

  int open(const std::string&, int& fd) override {
    if (unplugged) return ENOENT;
    if (open_error != 0) return open_error;
    ++opened;
    fd = 7;
    return 0;
  }
  void close(int) override { --opened; }
  int map(int, std::size_t bytes, std::int64_t offset, std::uint8_t*& data) override {
    auto& memory = buffers_[static_cast<std::uint32_t>(offset)];
    memory.resize(bytes);
    data = memory.data();
    ++mapped;
    return 0;
  }
  void unmap(std::uint8_t*, std::size_t) override { --mapped; }
  int wait(int, int timeout_ms) override {
    if (unplugged || !shots.empty()) return 0;
    now_ns += std::int64_t{timeout_ms} * 1'000'000;
    on_idle();
    return EAGAIN;
  }
  void sleep_ms(int ms) override {
    now_ns += std::int64_t{ms} * 1'000'000;
    on_sleep();
  }
  std::int64_t monotonic_ns() override { return now_ns; }
  std::int64_t utc_ns() override { return now_ns + kUtc_ns; }
  static constexpr std::int64_t kUtc_ns = 1'700'000'000'000'000'000;

  int control(int, unsigned long request, void* argument) override {
    if (unplugged) return ENODEV;
    auto& planned = errors[request];
    if (!planned.empty()) {
      const int error = planned.front();
      planned.pop_front();
      if (error != 0) return error;
    }
    switch (request) {
      case VIDIOC_QUERYCAP:
        return answer(argument, v4l2_capability{.capabilities = capabilities});
      case VIDIOC_ENUM_FMT: {
        auto& description = *static_cast<v4l2_fmtdesc*>(argument);
        if (description.index > 0) return EINVAL;
        description.pixelformat = fourcc;
        return 0;
      }
      case VIDIOC_G_FMT:
      case VIDIOC_S_FMT: {
        auto& pix = static_cast<v4l2_format*>(argument)->fmt.pix;
        pix = {.width = width,
               .height = height,
               .pixelformat = fourcc,
               .field = field,
               .bytesperline = width * bytes_a_pixel,
               .sizeimage = width * height * bytes_a_pixel};
        return 0;
      }
      case VIDIOC_G_PARM:
      case VIDIOC_S_PARM:
        static_cast<v4l2_streamparm*>(argument)->parm.capture.timeperframe = {
            static_cast<__u32>(period_ns / 1000), 1'000'000};
        return 0;
      case VIDIOC_G_INPUT:
        *static_cast<int*>(argument) = 0;
        return 0;
      case VIDIOC_ENUMINPUT: {
        auto& input = *static_cast<v4l2_input*>(argument);
        if (input.index > 0) return EINVAL;
        std::memcpy(input.name, "Camera", 7);
        input.status = input_status;
        return 0;
      }
      case VIDIOC_REQBUFS:
        queued_.clear();
        return 0;
      case VIDIOC_QUERYBUF: {
        auto& buffer = *static_cast<v4l2_buffer*>(argument);
        buffer.length = width * height * bytes_a_pixel;
        buffer.m.offset = buffer.index;
        return 0;
      }
      case VIDIOC_QBUF:
        queued_.push_back(static_cast<v4l2_buffer*>(argument)->index);
        return 0;
      case VIDIOC_DQBUF:
        return fill(*static_cast<v4l2_buffer*>(argument));
      case VIDIOC_STREAMON:
        ++streams;
        return 0;
      case VIDIOC_STREAMOFF:
        --streams;
        return 0;
      default:
        return ENOTTY;
    }
  }

  std::size_t queued() const { return queued_.size(); }
  /// As many pictures one after the other, numbered on from `sequence`; their values count from there too.
  void film(std::uint32_t sequence, int count) {
    for (int i = 0; i < count; ++i, ++sequence) {
      shots.push_back({.sequence = sequence, .field = field, .value = static_cast<std::uint8_t>(sequence)});
    }
  }

 private:
  template <typename T>
  static int answer(void* argument, const T& value) {
    *static_cast<T*>(argument) = value;
    return 0;
  }
  int fill(v4l2_buffer& buffer) {
    if (shots.empty() || queued_.empty()) return EAGAIN;
    const Shot shot = shots.front();
    shots.pop_front();
    now_ns += period_ns;
    buffer.index = queued_.front();
    queued_.pop_front();
    auto& memory = buffers_[buffer.index];
    std::fill(memory.begin(), memory.end(), shot.value);
    buffer.bytesused = width * height * bytes_a_pixel - shot.short_by;
    buffer.sequence = shot.sequence;
    buffer.flags = shot.flags;
    buffer.field = shot.field;
    const std::int64_t stamp_ns = now_ns - shot.late_ns;
    buffer.timestamp = {stamp_ns / 1'000'000'000, stamp_ns % 1'000'000'000 / 1000};
    return 0;
  }

  std::map<std::uint32_t, std::vector<std::uint8_t>> buffers_;
  std::deque<std::uint32_t> queued_;
};

}  // namespace relievo::test
