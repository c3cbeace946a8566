// SPDX-License-Identifier: Apache-2.0
#include "capture/source/v4l2/buffer_stream.h"

#include <fcntl.h>
#include <linux/dma-buf.h>

#include <algorithm>
#include <cerrno>
#include <utility>

namespace relievo::v4l2 {
namespace {

/// A v4l2_buffer with the planes of a multi-planar device.
struct Message {
  v4l2_buffer buffer{};
  std::array<v4l2_plane, VIDEO_MAX_PLANES> planes{};

  Message(const Device& device, std::uint32_t index) {
    buffer.type = device.type();
    buffer.memory = V4L2_MEMORY_MMAP;
    buffer.index = index;
    if (device.multiplanar()) {
      buffer.m.planes = planes.data();
      buffer.length = static_cast<__u32>(planes.size());
    }
  }
  Message(const Message&) = delete;
  Message& operator=(const Message&) = delete;
};

}  // namespace

Result<BufferStream> BufferStream::start(const Device& device, const Options& options) {
  BufferStream stream(device);
  v4l2_requestbuffers request{};
  request.count = static_cast<__u32>(options.buffers);
  request.type = device.type();
  request.memory = V4L2_MEMORY_MMAP;
  if (const int error = device.call(VIDIOC_REQBUFS, &request); error != 0)
    return device.refused("provide buffers", error);
  if (request.count < 2) return Error{device.path() + ": the driver has memory for no more than one buffer"};
  stream.buffers_.resize(request.count);
  for (std::uint32_t i = 0; i < request.count; ++i) {
    if (const Status mapped = stream.map(i, options.dmabuf); !mapped) return mapped.error();
  }
  std::uint32_t queued = 0;
  int last_error = 0;
  for (std::uint32_t i = 0; i < request.count; ++i) {
    const int error = stream.queue(i);
    if (error == 0)
      ++queued;
    else
      last_error = error;
  }
  if (queued == 0) return device.refused("take a buffer", last_error);
  int type = static_cast<int>(device.type());
  if (const int error = device.call(VIDIOC_STREAMON, &type); error != 0)
    return device.refused("start streaming", error);
  stream.streaming_ = true;
  return stream;
}

BufferStream::BufferStream(BufferStream&& other) noexcept
    : device_(other.device_),
      buffers_(std::exchange(other.buffers_, {})),
      streaming_(std::exchange(other.streaming_, false)),
      ended_(other.ended_),
      refused_count_(other.refused_count_) {}

BufferStream::~BufferStream() {
  Io& io = device_->io();
  if (streaming_) {
    int type = static_cast<int>(device_->type());
    device_->call(VIDIOC_STREAMOFF, &type);
  }
  for (Buffer& buffer : buffers_) {
    for (Mapping& mapping : buffer.planes) {
      if (mapping.data != nullptr) io.unmap(mapping.data, mapping.bytes);
      if (mapping.dmabuf >= 0) io.close(mapping.dmabuf);
    }
  }
  if (buffers_.empty()) return;
  v4l2_requestbuffers none{};
  none.type = device_->type();
  none.memory = V4L2_MEMORY_MMAP;
  device_->call(VIDIOC_REQBUFS, &none);
}

Status BufferStream::map(std::uint32_t index, bool dmabuf) {
  Message message(*device_, index);
  if (const int error = device_->call(VIDIOC_QUERYBUF, &message.buffer); error != 0)
    return device_->refused("describe its buffers", error);
  Buffer& buffer = buffers_[index];
  buffer.plane_count = device_->multiplanar() ? message.buffer.length : 1;
  if (buffer.plane_count == 0 || buffer.plane_count > buffer.planes.size())
    return Error{device_->path() + ": gives pictures in " + std::to_string(buffer.plane_count) +
                 " planes, which no format that can be read here has"};
  for (std::uint32_t plane = 0; plane < buffer.plane_count; ++plane) {
    Mapping& mapping = buffer.planes[plane];
    const v4l2_plane& described = message.planes[plane];
    mapping.bytes = device_->multiplanar() ? described.length : message.buffer.length;
    const std::int64_t offset = device_->multiplanar() ? described.m.mem_offset : message.buffer.m.offset;
    if (const Status mapped = map_plane(index, plane, offset, dmabuf, mapping); !mapped) return mapped;
  }
  return {};
}

Status BufferStream::map_plane(std::uint32_t index, std::uint32_t plane, std::int64_t offset, bool dmabuf,
                               Mapping& mapping) {
  int from = device_->fd();
  if (dmabuf) {
    v4l2_exportbuffer wanted{};
    wanted.type = device_->type();
    wanted.index = index;
    wanted.plane = plane;
    wanted.flags = O_RDWR | O_CLOEXEC;
    if (const int error = device_->call(VIDIOC_EXPBUF, &wanted); error != 0)
      return Error{device_->refused("export its buffers", error).message + "; leave --dmabuf out"};
    mapping.dmabuf = wanted.fd;
    from = wanted.fd;
    offset = 0;
  }
  if (const int error = device_->io().map(from, mapping.bytes, offset, mapping.data); error != 0) {
    mapping.data = nullptr;
    return device_->refused("let its buffers be mapped", error);
  }
  return {};
}

int BufferStream::queue(std::uint32_t index) {
  Message message(*device_, index);
  const int error = device_->call(VIDIOC_QBUF, &message.buffer);
  buffers_[index].queued = error == 0;
  if (error != 0) ++refused_count_;
  return error;
}

void BufferStream::sync(const Buffer& buffer, std::uint64_t flags) const {
  for (const Mapping& mapping : buffer.planes) {
    if (mapping.dmabuf < 0) continue;
    dma_buf_sync sync{flags | DMA_BUF_SYNC_READ};
    device_->io().control(mapping.dmabuf, DMA_BUF_IOCTL_SYNC, &sync);
  }
}

void BufferStream::end(int error) {
  ended_ = error == ENODEV || error == ENXIO || error == EBADF ? StreamEnd::kUnplugged : StreamEnd::kBroken;
}

std::optional<Filled> BufferStream::take(int timeout_ms) {
  if (ended_) return std::nullopt;
  for (std::uint32_t i = 0; i < buffers_.size(); ++i) {  // what was refused before
    if (buffers_[i].queued || buffers_[i].with_us) continue;
    if (queue(i) == ENODEV) {
      end(ENODEV);
      return std::nullopt;
    }
  }
  if (const int error = device_->io().wait(device_->fd(), timeout_ms); error != 0) {
    if (error != EAGAIN) end(error);
    return std::nullopt;
  }
  Message message(*device_, 0);
  if (const int error = device_->call(VIDIOC_DQBUF, &message.buffer); error != 0) {
    if (error != EAGAIN) end(error);
    return std::nullopt;
  }
  const v4l2_buffer& done = message.buffer;
  if (done.index >= buffers_.size()) {
    end(EIO);
    return std::nullopt;
  }
  Buffer& buffer = buffers_[done.index];
  buffer.queued = false;
  buffer.with_us = true;
  sync(buffer, DMA_BUF_SYNC_START);
  Filled filled;
  filled.index = done.index;
  filled.sequence = done.sequence;
  filled.field = done.field;
  filled.damaged = (done.flags & V4L2_BUF_FLAG_ERROR) != 0;
  filled.time_ns = std::int64_t{done.timestamp.tv_sec} * 1'000'000'000 + done.timestamp.tv_usec * 1000;
  filled.monotonic = (done.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  filled.stamped_at_end = (done.flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_EOF;
  for (std::size_t i = 0; i < buffer.plane_count; ++i) {
    const Mapping& mapping = buffer.planes[i];
    std::size_t begin = 0, used = done.bytesused;
    if (device_->multiplanar()) {
      begin = std::min<std::size_t>(message.planes[i].data_offset, mapping.bytes);
      used = std::max<std::size_t>(message.planes[i].bytesused, begin) - begin;
    }
    filled.planes[i] = {mapping.data + begin, std::min(used, mapping.bytes - begin), mapping.bytes - begin};
  }
  return filled;
}

void BufferStream::give_back(const Filled& filled) {
  Buffer& buffer = buffers_[filled.index];
  sync(buffer, DMA_BUF_SYNC_END);
  buffer.with_us = false;
  if (queue(filled.index) == ENODEV) end(ENODEV);
}

}  // namespace relievo::v4l2
