// SPDX-License-Identifier: Apache-2.0
#include "client/export_formats.h"

#include <string>

#include "base/new_folder.h"
#include "base/whole_file.h"
#include "client/picture_video.h"
#include "client/ros/bag.h"
#include "codec/export.h"
#include "codec/frame_layout.h"
#include "codec/frame_names.h"
#include "codec/texture_codec.h"
#include "codec/video_file.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;
using Made = Result<std::unique_ptr<ExportWriter>>;

/// A file a frame, by FrameNames. The folder comes with the first.
class FolderWriter : public ExportWriter {
 public:
  explicit FolderWriter(fs::path folder) : folder_(std::move(folder)) {}

  Status add(const Frame3D& frame, std::span<const std::uint8_t>) override {
    if (const Status made = made_.make(folder_); !made) return made;
    return write(folder_, names_.name(frame), frame);
  }

 private:
  virtual Status write(const fs::path& folder, const std::string& name, const Frame3D& frame) = 0;

  fs::path folder_;
  NewFolder made_;
  FrameNames names_;
};

using WriteFile = Status (*)(const fs::path& file, const Frame3D& frame);

class FileWriter final : public FolderWriter {
 public:
  FileWriter(fs::path folder, const char* ending, WriteFile file)
      : FolderWriter(std::move(folder)), ending_(ending), write_(file) {}

 private:
  Status write(const fs::path& folder, const std::string& name, const Frame3D& frame) override {
    return write_(folder / (name + ending_), frame);
  }

  const char* ending_;
  WriteFile write_;
};

class GlbWriter final : public FolderWriter {
 public:
  explicit GlbWriter(const ExportTarget& target)
      : FolderWriter(target.out), options_{.draco = target.draco} {}

 private:
  Status write(const fs::path& folder, const std::string& name, const Frame3D& frame) override {
    return write_glb(folder / (name + ".glb"), frame, options_);
  }

  GlbOptions options_;
};

/// Texture and depth as a camera without lens distortion sees them, and what that camera is.
class DepthWriter final : public FolderWriter {
 public:
  DepthWriter(const ExportTarget& target, const PinholeModel& camera)
      : FolderWriter(target.out),
        camera_(camera),
        pinhole_(pinhole_of(camera)),
        unit_m_(target.depth_unit_m) {}

  Status add(const Frame3D& frame, std::span<const std::uint8_t> bytes) override {
    const Image8& texture = frame.texture;
    if (!texture.empty() && (texture.width() != camera_.width || texture.height() != camera_.height))
      return Error{
          "the texture is not of the camera's size, as of a lower quality, and depth would not lie on it: "
          "record the stream with --quality full, or export another format"};
    return FolderWriter::add(frame, bytes);
  }

 private:
  Status write(const fs::path& folder, const std::string& name, const Frame3D& frame) override {
    if (auto status = write_camera_json(folder / "camera.json", pinhole_, unit_m_); !status) return status;
    if (!frame.texture.empty()) {
      const bool is_straight = camera_.distortion == pinhole_.distortion;
      const Image8 shown = is_straight ? Image8() : straightened(frame.texture.view(), camera_);
      if (auto status =
              write_png(folder / (name + ".png"), is_straight ? frame.texture.view() : shown.view());
          !status)
        return status;
    }
    return write_depth_png(folder / (name + ".depth.png"), frame.surface, pinhole_, unit_m_);
  }

  PinholeModel camera_, pinhole_;
  double unit_m_;
};

class AnimationWriter final : public ExportWriter {
 public:
  explicit AnimationWriter(const ExportTarget& target) : file_(target.out), options_{.draco = target.draco} {}

  Status add(const Frame3D& frame, std::span<const std::uint8_t>) override {
    return animation_.add(frame, options_);
  }
  Status finish() override {
    const auto bytes = animation_.finish();
    return bytes ? write_whole_file(file_, *bytes)
                 : Status(bytes.error().in("cannot write " + file_.string()));
  }

 private:
  fs::path file_;
  GlbOptions options_;
  GlbAnimation animation_;
};

/// The stream's own video as it is.
class VideoCopier final : public ExportWriter {
 public:
  explicit VideoCopier(VideoFile file) : file_(std::move(file)) {}

  Status add(const Frame3D& frame, std::span<const std::uint8_t> bytes) override {
    const auto layout = read_frame_layout(bytes);
    if (!layout) return layout.error();
    const auto section = layout->sections.texture;
    if (layout->header.texture != TextureCodec::kH264 || section.empty()) return Error{kMixed};
    const Image8& texture = frame.texture;
    if (auto fits = file_.check(section, texture.width(), texture.height()); !fits)
      return fits.error().in(kMixed);
    return file_.add(section, texture.width(), texture.height(), frame.time_ns);
  }
  Status finish() override { return file_.finish(); }

 private:
  static constexpr const char* kMixed = "the texture's video cannot be copied into one file: give --reencode";

  VideoFile file_;
};

class VideoCoder final : public ExportWriter {
 public:
  explicit VideoCoder(VideoFile file) : video_(std::move(file)) {}

  Status add(const Frame3D& frame, std::span<const std::uint8_t>) override {
    if (frame.texture.empty()) return Error{"frame " + std::to_string(frame.number) + " has no texture"};
    return video_.add(frame.texture.view(), frame.time_ns);
  }
  Status finish() override { return video_.finish(); }

 private:
  PictureVideo video_;
};

/// The stream's own video where the range begins with a key frame of one, else coded anew.
class VideoWriter final : public ExportWriter {
 public:
  VideoWriter(VideoFile file, bool reencode) : file_(std::move(file)), reencode_(reencode) {}

  Status add(const Frame3D& frame, std::span<const std::uint8_t> bytes) override {
    if (!writer_) {
      const bool copies = !reencode_ && begins_video(bytes);
      if (copies) {
        writer_ = std::make_unique<VideoCopier>(std::move(file_));
      } else {
        writer_ = std::make_unique<VideoCoder>(std::move(file_));
      }
    }
    return writer_->add(frame, bytes);
  }
  Status finish() override { return writer_->finish(); }

 private:
  static bool begins_video(std::span<const std::uint8_t> bytes) {
    const auto layout = read_frame_layout(bytes);
    if (!layout || layout->header.texture != TextureCodec::kH264) return false;
    const auto section = layout->sections.texture;
    return !section.empty() && texture_is_key(TextureCodec::kH264, section);
  }

  VideoFile file_;
  bool reencode_;
  std::unique_ptr<ExportWriter> writer_;
};

class RosWriter final : public ExportWriter {
 public:
  explicit RosWriter(RosBag bag) : bag_(std::move(bag)) {}

  Status add(const Frame3D& frame, std::span<const std::uint8_t>) override { return bag_.add(frame); }
  Status finish() override { return bag_.finish(); }

 private:
  RosBag bag_;
};

template <const char* const* Ending, WriteFile Write>
Made make_files(const ExportTarget& target) {
  return Made(std::make_unique<FileWriter>(target.out, *Ending, Write));
}

Status ply(const fs::path& file, const Frame3D& frame) {
  return write_ply(file, frame.surface, frame.texture.view());
}
Status png(const fs::path& file, const Frame3D& frame) {
  return write_png(file, frame.texture.view());
}
constexpr const char *kPly = ".ply", *kObj = ".obj", *kPng = ".png";

Made make_glb(const ExportTarget& target) {
  return Made(std::make_unique<GlbWriter>(target));
}

Made make_depth(const ExportTarget& target) {
  if (!target.rig)
    return Error{
        "depth needs the camera's calibration, and the recording has no description of the stream: "
        "export another format"};
  return Made(std::make_unique<DepthWriter>(target, target.rig->camera));
}

Made make_animation(const ExportTarget& target) {
  return Made(std::make_unique<AnimationWriter>(target));
}

Made make_video(const ExportTarget& target) {
  auto file = VideoFile::create(target.out);
  if (!file) return file.error();
  return Made(std::make_unique<VideoWriter>(*std::move(file), target.reencode));
}

Made make_ros(const ExportTarget& target) {
  auto bag = RosBag::create(target.out, target.stream, target.rig);
  if (!bag) return bag.error();
  return Made(std::make_unique<RosWriter>(*std::move(bag)));
}

constexpr ExportFormat kFormats[] = {{"ply", false, false, make_files<&kPly, ply>},
                                     {"glb", false, true, make_glb},
                                     {"obj", false, false, make_files<&kObj, write_obj>},
                                     {"png", false, false, make_files<&kPng, png>},
                                     {"depth", false, false, make_depth},
                                     {"animation", true, true, make_animation},
                                     {"video", true, false, make_video},
                                     {"ros2", true, false, make_ros}};

}  // namespace

std::span<const ExportFormat> export_formats() {
  return kFormats;
}

}  // namespace relievo
