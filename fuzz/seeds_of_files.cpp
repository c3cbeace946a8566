// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "base/rig.h"
#include "capture/calibrate/rig_part.h"
#include "fuzz/seeds.h"
#include "tests/support/make_surface.h"
#include "tests/support/striped_scene.h"
#include "tests/support/temp_folder.h"

namespace relievo::fuzz {
namespace {

/// Behind the byte that says what it is.
Bytes marked(std::uint8_t mark, std::string_view text) {
  Bytes out(1 + text.size(), mark);
  std::copy(text.begin(), text.end(), out.begin() + 1);
  return out;
}
Bytes marked(std::uint8_t mark, const Bytes& bytes) {
  return marked(mark, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

std::string matrix(const std::string& name, int rows, int cols, const std::string& data) {
  return name + ": !!opencv-matrix\n   rows: " + std::to_string(rows) + "\n   cols: " + std::to_string(cols) +
         "\n   dt: d\n   data: [ " + data + " ]\n";
}

constexpr const char* kRotation = "1., 0., 0., 0., 1., 0., 0., 0., 1.";

}  // namespace

Status take_seeds(const fs::path&, const fs::path& out) {
  const test::TempFolder folder;
  if (!test::write_striped_take(test::striped_scene(), folder.path(), 2))
    return Error{"the take cannot be written"};
  std::uint8_t number = 0;  // in the order of take.cpp
  for (const char* file :
       {"rig.yaml", "pattern.yaml", "timestamps.csv", "frames/000000.png", "truth/000000.npy"}) {
    write_seed(out / fs::path(file).filename(), marked(number++, read_seed(folder / file)));
  }
  return {};
}

/// As the test of imports has them.
Status calibration_seeds(const fs::path&, const fs::path& out) {
  const auto write = [&](const char* name, const std::string& text) {
    write_seed(out / name, {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
  };
  const std::string lens = "2800., 0., 1500., 0., 2810., 1090., 0., 0., 1.";
  const std::string head = "%YAML:1.0\n---\n";
  write("rig", to_yaml(test::striped_scene().rig));
  write("pattern", to_yaml(test::striped_scene().pattern));
  write("colours", to_yaml(RigPart{.colours = CameraColours{}}));
  write("sltk", head + matrix("cam_size", 2, 1, "2592., 1944.") + matrix("pro_size", 2, 1, "1280., 800.") +
                    matrix("cam_K", 3, 3, lens) + matrix("pro_K", 3, 3, lens) +
                    matrix("cam_kc", 1, 5, "-0.2, 0.1, 0., 0., 0.") +
                    matrix("pro_kc", 5, 1, "0., 1., 0., 0., 0.") + matrix("R", 3, 3, kRotation) +
                    matrix("T", 3, 1, "-183., -23., -60.") + "stereo_rms: 0.61\n");
  write("procam", head + matrix("img_shape", 1, 2, "1944, 2592") + "rms: 0.8\n" +
                      matrix("cam_int", 3, 3, lens) + matrix("cam_dist", 1, 5, "0., 0., 0., 0., 0.") +
                      matrix("proj_int", 3, 3, lens) + matrix("proj_dist", 5, 1, "0., 0., 0., 0., 0.") +
                      matrix("roration", 3, 3, kRotation) + matrix("translation", 3, 1, "-183., -23., -60."));
  write("xml",
        "<?xml version=\"1.0\"?>\n<opencv_storage>\n<img_shape "
        "type_id=\"opencv-matrix\"><rows>1</rows><cols>2</cols>"
        "<dt>d</dt><data>1944. 2592.</data></img_shape>\n<cam_int type_id=\"opencv-matrix\"><rows>3</rows>"
        "<cols>3</cols><dt>d</dt><data>1. 0. 2. 0. 1. 2. 0. 0. 1.</data></cam_int>\n</opencv_storage>\n");
  return {};
}

Status mesh_seeds(const fs::path&, const fs::path& out) {
  const auto write = [&](const char* name, std::uint8_t mark, const std::string& text) {
    write_seed(out / name, marked(mark, text));
  };
  const std::string corners = "0 0 0 255 0 0\n1 0 0 0 255 0\n0 1 0 0 0 255\n";
  const std::string properties =
      "property float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty uchar green\n"
      "property uchar blue\n";
  const std::string vertices = "element vertex 3\n" + properties;
  const std::string faces = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
  write("obj", 0,
        "mtllib mesh.mtl\nv 0 0 0\nv 1 0 0 0.5 1 0\nv 0 1 0\nvt 0 0\nvt 1 0.5\nf 1/1/1 2/2 -1/-1 3\n");
  write("mtl", 1, "newmtl a\nKd 1 1 1\nmap_Kd texture.png\n");
  write("ascii", 3, "ply\nformat ascii 1.0\n" + vertices + faces + corners + "3 0 1 2\n");
  write("cloud_ascii", 4, "ply\nformat ascii 1.0\ncomment c\n" + vertices + "end_header\n" + corners);
  for (const char* format : {"binary_little_endian", "binary_big_endian"}) {
    std::string text = std::string("ply\nformat ") + format + " 1.0\n" + vertices + faces;
    for (int i = 0; i < 3; ++i) text += std::string(12, static_cast<char>(i)) + "\x10\x20\x30";
    text += std::string("\x03\0\0\0\0\0\0\0\1\0\0\0\2", 13);
    write(format, 3, text);
    write((std::string("cloud_") + format).c_str(), 4, text);
  }
  return {};
}

Status picture_seeds(const fs::path&, const fs::path& out) {
  const Image8 picture = test::picture(40, 24);
  const cv::Mat rgb(picture.height(), picture.width(), CV_8UC3, const_cast<std::uint8_t*>(picture.data()));
  for (const char* ending : {".png", ".jpg", ".bmp", ".ppm", ".tiff"}) {
    Bytes file;
    if (!cv::imencode(ending, rgb, file)) return Error{std::string("no encoder of ") + ending};
    write_seed(out / (std::string("of_a_folder") + ending), marked(0, file));
    if (std::string_view(ending) == ".jpg") write_seed(out / "of_a_camera", marked(1, file));
  }
  cv::Mat grey(24, 40, CV_16UC1, cv::Scalar(30000));
  Bytes file;
  if (!cv::imencode(".tiff", grey, file)) return Error{"no encoder of 16 bits"};
  write_seed(out / "grey_16.tiff", marked(0, file));
  if (!cv::imencode(".pgm", grey, file)) return Error{"no encoder of PGM"};
  write_seed(out / "grey_16.pgm", marked(0, file));
  if (!cv::imencode(".jpg", rgb, file, {cv::IMWRITE_JPEG_PROGRESSIVE, 1}))
    return Error{"no progressive JPEG"};
  write_seed(out / "progressive.jpg", marked(0, file));
  return {};
}

/// The commented file that packages install, and what it leaves out.
Status config_seeds(const fs::path& source, const fs::path& out) {
  write_seed(out / "packaged", marked(0, read_seed(source / "packaging" / "server.toml")));
  write_seed(out / "several",
             marked(0,
                    "domain = 3\nweb = \"127.0.0.1:0\"\n[gateway]\nmax_clients = 4\nallow_origins = "
                    "[\"https://a.example\"]\n[recording]\nsplit_every = \"10 min\"\n[projector]\noutput = "
                    "\"auto\"\n[[stream]]\nsource = \"sim:face\"\nstream = \"a\"\ngeometry = \"metric\"\n"
                    "[[stream]]\nsource = \"v4l2:/dev/video0\"\nrecord = \"a.mcap\"\ntexture = \"h264\"\n"
                    "bitrate = \"4M\"\n[stream.camera]\nsize = \"640x480\"\n"));
  write_seed(out / "tokens",
             marked(1, "# of the house\n0123456789abcdef0123456789abcdef\n\nfedcba9876543210fedc\n"));
  return {};
}

Status gateway_seeds(const fs::path&, const fs::path& out) {
  write_seed(out / "watch", marked(0,
                                   "{\"type\":\"credit\",\"n\":2}\n{\"type\":\"time\",\"t0\":1.5}\n{\"type\":"
                                   "\"quality\",\"want\":\"reduced\",\"textures\":[\"jpeg\",\"h264\"]}\n"));
  write_seed(out / "foxglove",
             marked(1,
                    "{\"op\":\"subscribe\",\"subscriptions\":[{\"id\":7,\"channelId\":1}]}\n{\"op\":"
                    "\"unsubscribe\",\"subscriptionIds\":[7]}\n#binary\n"));
  const auto request = [&](const char* name, const std::string& first, const std::string& rest) {
    for (const std::uint8_t mark : {std::uint8_t{2}, std::uint8_t{3}})
      write_seed(out / (std::string(name) + (mark == 3 ? "_with_tokens" : "")), marked(mark, first + rest));
  };
  const std::string from_here = "localhost:8080\nhttp://localhost:8080\n";
  request("range", "GET\n/recordings/face-1.mcap?token=a&b=c\n" + from_here,
          "relievo_token_8080=abc; other=d\nBearer abc\nbytes=0-99\n\"1-2\"\n\"3\"\n\n\n");
  request("record", "POST\n/api/recording/face\n" + from_here,
          "\n\n\n\n\napplication/json; charset=utf-8\n\n{\"action\":\"start\"}");
  request("calibrate", "POST\n/api/calibration\n" + from_here,
          "\n\n\n\n\napplication/"
          "json\n\n{\"action\":\"start\",\"stream\":\"face\",\"kind\":\"colour\",\"board\":\"\"}");
  request("project", "POST\n/api/projector\n" + from_here,
          "\n\n\n\n\napplication/json\n\n{\"action\":\"start\",\"stream\":\"face\",\"show\":\"pattern\"}");
  request("rig", "GET\n/api/rig/face?pictures=camera,coverage\n" + from_here, "\n\n\n\n\n\n\n");
  request("rig_picture", "GET\n/api/rig/face/camera.jpg\n" + from_here, "\n\n\n\n\n\n\n");
  request("watch_face", "GET\n/ws/face\n" + from_here, "\n\n\n\n\n\nx\n");
  request("foxglove_socket", "GET\n/foxglove\n" + from_here, "\n\n\n\n\n\nother, foxglove.sdk.v1\n");
  request("metrics", "HEAD\n/metrics\n[::1]:8080\nhttps://viewer.example\n", "\n\n\n\n\n\n\n");
  return {};
}

}  // namespace relievo::fuzz
