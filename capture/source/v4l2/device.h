// SPDX-License-Identifier: Apache-2.0
// One open V4L2 device: its file descriptor, and which of the two buffer types it captures with.
#pragma once

#include <linux/videodev2.h>

#include <string>

#include "base/result.h"
#include "capture/source/v4l2/io.h"

namespace relievo::v4l2 {

/// Move-only; closes the device. One thread at a time.
class Device {
 public:
  /// Fails where there is no such device, it is in use or not permitted, or is no camera that streams. `io`
  /// must outlive it.
  static Result<Device> open(Io& io, const std::string& path);
  Device(Device&& other) noexcept;
  Device& operator=(Device&&) = delete;
  ~Device();

  /// 0 or an errno.
  int call(unsigned long request, void* argument) const { return io_->control(fd_, request, argument); }

  Io& io() const { return *io_; }
  int fd() const { return fd_; }
  const std::string& path() const { return path_; }
  const v4l2_capability& capability() const { return capability_; }
  bool multiplanar() const { return multiplanar_; }
  v4l2_buf_type type() const {
    return multiplanar_ ? V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE : V4L2_BUF_TYPE_VIDEO_CAPTURE;
  }

  /// "/dev/video0: the driver refused to WHAT: why".
  Error refused(const std::string& what, int error) const;

 private:
  Device(Io& io, std::string path, int fd) : io_(&io), path_(std::move(path)), fd_(fd) {}

  Io* io_;
  std::string path_;
  int fd_ = -1;
  v4l2_capability capability_{};
  bool multiplanar_ = false;
};

}  // namespace relievo::v4l2
