// SPDX-License-Identifier: Apache-2.0
// Plays pictures into a V4L2 output: into vivid's, whose pictures its camera can be given, or v4l2loopback's.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <linux/videodev2.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <vector>

namespace relievo::test {

struct OutputFormat {
  std::uint32_t fourcc = V4L2_PIX_FMT_RGB24;
  std::uint32_t width = 0, height = 0;  // of a buffer
  std::uint32_t field = V4L2_FIELD_NONE;
  v4l2_std_id standard = 0;
};

/// One thread. Failures are the test's.
class OutputDevice {
 public:
  OutputDevice(const std::string& path, const OutputFormat& wanted) : field_(wanted.field) {
    fd_ = open(path.c_str(), O_RDWR | O_CLOEXEC);
    if (fd_ < 0) ADD_FAILURE() << path;
    if (wanted.standard != 0) {
      int output = 0;  // S-Video
      v4l2_std_id standard = wanted.standard;
      call(VIDIOC_S_OUTPUT, &output, "S_OUTPUT");
      call(VIDIOC_S_STD, &standard, "S_STD");
    }
    v4l2_format format{};
    format.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
    format.fmt.pix.pixelformat = wanted.fourcc;
    format.fmt.pix.width = wanted.width;
    format.fmt.pix.height = wanted.height;
    format.fmt.pix.field = wanted.field;
    format.fmt.pix.colorspace = V4L2_COLORSPACE_SRGB;
    call(VIDIOC_S_FMT, &format, "S_FMT");
    EXPECT_EQ(format.fmt.pix.pixelformat, wanted.fourcc);
    EXPECT_EQ(format.fmt.pix.height, wanted.height);
    EXPECT_EQ(format.fmt.pix.field, wanted.field);
  }
  OutputDevice(const OutputDevice&) = delete;
  OutputDevice& operator=(const OutputDevice&) = delete;
  ~OutputDevice() {
    for (const std::span<std::uint8_t>& buffer : buffers_) munmap(buffer.data(), buffer.size());
    close(fd_);
  }

  /// With write(), which returns at once on v4l2loopback.
  bool write(std::span<const std::uint8_t> picture) {
    return ::write(fd_, picture.data(), picture.size()) == static_cast<ssize_t>(picture.size());
  }

  /// Through mapped buffers, at the output's own pace; waits while all are queued. `field` of alternating
  /// ones.
  bool play(std::span<const std::uint8_t> picture, std::uint32_t field) {
    if (buffers_.empty()) map();
    v4l2_buffer buffer = header();
    if (queued_ < buffers_.size()) {
      buffer.index = static_cast<__u32>(queued_++);
    } else if (ioctl(fd_, VIDIOC_DQBUF, &buffer) != 0) {
      return false;
    }
    const std::uint32_t index = buffer.index;
    std::memcpy(buffers_[index].data(), picture.data(), std::min(picture.size(), buffers_[index].size()));
    buffer = header();
    buffer.index = index;
    buffer.field = field_ == V4L2_FIELD_ALTERNATE ? field : field_;
    buffer.bytesused = static_cast<__u32>(picture.size());
    if (ioctl(fd_, VIDIOC_QBUF, &buffer) != 0) return false;
    if (queued_ < buffers_.size() || std::exchange(streaming_, true)) return true;
    int type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
    return ioctl(fd_, VIDIOC_STREAMON, &type) == 0;
  }

 private:
  void call(unsigned long request, void* argument, const char* name) {
    if (ioctl(fd_, request, argument) != 0) ADD_FAILURE() << name << ": " << std::strerror(errno);
  }
  static v4l2_buffer header() {
    v4l2_buffer buffer{};
    buffer.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
    buffer.memory = V4L2_MEMORY_MMAP;
    return buffer;
  }
  void map() {
    v4l2_requestbuffers request{};
    request.count = 4;
    request.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
    request.memory = V4L2_MEMORY_MMAP;
    call(VIDIOC_REQBUFS, &request, "REQBUFS");
    for (std::uint32_t i = 0; i < request.count; ++i) {
      v4l2_buffer buffer = header();
      buffer.index = i;
      call(VIDIOC_QUERYBUF, &buffer, "QUERYBUF");
      void* const at = mmap(nullptr, buffer.length, PROT_READ | PROT_WRITE, MAP_SHARED, fd_, buffer.m.offset);
      ASSERT_NE(at, MAP_FAILED);
      buffers_.emplace_back(static_cast<std::uint8_t*>(at), buffer.length);
    }
  }

  int fd_ = -1;
  std::uint32_t field_;
  std::vector<std::span<std::uint8_t>> buffers_;
  std::size_t queued_ = 0;
  bool streaming_ = false;
};

}  // namespace relievo::test
