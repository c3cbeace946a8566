// SPDX-License-Identifier: Apache-2.0
// fuzz_seeds SOURCE_DIR OUT [TARGET]: sound inputs of every fuzz target, or of that one, OUT/TARGET/*, from
// the conformance vectors and the writers.
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "base/result.h"
#include "codec/byte_io.h"
#include "codec/mcap_records.h"
#include "codec/recording.h"
#include "codec/texture_codec.h"
#include "fuzz/seeds.h"
#include "idl/cdr.h"
#include "tests/support/make_surface.h"
#include "tests/support/temp_folder.h"

namespace relievo::fuzz {

namespace {

[[noreturn]] void fail(const char* what, const fs::path& file) {
  const std::string why = std::strerror(errno);
  std::fprintf(stderr, "seeds: cannot %s %s: %s\n", what, file.c_str(), why.c_str());
  std::exit(1);
}

constexpr const char* kVectors = "tests/conformance";

}  // namespace

Bytes read_seed(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) fail("read", file);
  return Bytes(std::istreambuf_iterator<char>(in), {});
}

void write_seed(const fs::path& file, std::span<const std::uint8_t> bytes) {
  fs::create_directories(file.parent_path());
  std::ofstream out(file, std::ios::binary);
  out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  out.close();
  if (!out) fail("write", file);
}

namespace {

/// Each vector, those to be refused too, and each sequence of frames that build on one another.
Status frames(const fs::path& source, const fs::path& out) {
  for (const char* folder : {"frame_v1", "grid_v1", "draco_grid_v1"}) {
    for (const auto& entry : fs::directory_iterator(source / kVectors / folder))
      if (entry.path().extension() == ".rlv")
        write_seed(out / (std::string(folder) + "_" + entry.path().filename().string()),
                   read_seed(entry.path()));
  }
  std::ifstream expected(source / kVectors / "grid_v1" / "expected.json");
  const nlohmann::json told = nlohmann::json::parse(expected);
  int number = 0;
  for (const auto& sequence : told["sequences"]) {
    Bytes all;
    for (const auto& frame : sequence)
      append_bytes(all, read_seed(source / kVectors / "grid_v1" / frame["file"].get<std::string>()));
    write_seed(out / ("sequence_" + std::to_string(number++)), all);
  }
  return {};
}

/// So that changes are not all caught by a CRC before they get anywhere.
Bytes without_crcs(Bytes bytes) {
  constexpr std::size_t kChunkCrcAt = 24;  // in the record's content, as kFooterCrcAt
  constexpr std::size_t kFooterCrcAt = 16;
  std::span<const std::uint8_t> rest = std::span(bytes).subspan(mcap::kMagic.size());
  while (const auto record = mcap::take_record(rest)) {
    const auto at = static_cast<std::size_t>(record->content.data() - bytes.data());
    if (record->op == mcap::Op::kChunk) put(bytes, at + kChunkCrcAt, std::uint32_t{0});
    if (record->op == mcap::Op::kFooter) put(bytes, at + kFooterCrcAt, std::uint32_t{0});
  }
  return bytes;
}

/// A frame as a sample.
Bytes frame_sample(const fs::path& source) {
  return write_frame_cdr({"face", 1, 2, 3, 4, read_seed(source / kVectors / "grid_v1" / "plain.rlv")});
}

Status record(const fs::path& file, const Bytes& sample) {
  const auto writer = RecordingWriter::create(file, {.chunk_ns = 100});
  if (!writer) return writer.error();
  const RecordingSchema schema{"relievo::Frame", "omgidl", "struct Frame {};"};
  for (const char* topic : {"relievo/frame", "relievo/status"})
    if (auto status = (*writer)->add_channel(schema, {topic, "cdr", schema.name, {{"stream", "s"}}}); !status)
      return status.error();
  if (auto status = (*writer)->add_attachment({"rig.yaml", "application/yaml", 5, {'a', ':', ' ', '1'}});
      !status)
    return status.error();
  for (std::uint16_t i = 0; i < 9; ++i)
    if (auto status = (*writer)->write({static_cast<std::uint16_t>(i % 2), i, 1000 + 30 * i, 1000, sample});
        !status)
      return status.error();
  const auto finished = (*writer)->finish();
  return finished ? Status() : finished.error();
}

Status recordings(const fs::path& source, const fs::path& out) {
  const test::TempFolder folder;
  const fs::path file = folder / "a.mcap";
  if (auto status = record(file, frame_sample(source)); !status) return status;
  const Bytes whole = read_seed(file);
  write_seed(out / "whole", whole);
  write_seed(out / "cut", std::span(whole).first(whole.size() / 2));
  write_seed(out / "no_crcs", without_crcs(whole));
  // Two files one behind the other, the first of them whole or cut short.
  for (const auto& [name, size] :
       {std::pair{"joined", whole.size()}, {"joined_behind_a_cut", whole.size() / 2}}) {
    Bytes both(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
    append_bytes(both, without_crcs(whole));
    write_seed(out / name, both);
  }
  return {};
}

void append_text(Bytes& out, std::string_view text) {
  append(out, static_cast<std::uint32_t>(text.size() + 1));
  out.insert(out.end(), text.begin(), text.end());
  out.push_back(0);
  out.resize((out.size() + 3) / 4 * 4);
}

/// As a top-level @appendable struct.
Bytes sample_of(const Bytes& body) {
  Bytes out{0, 9, 0, 0};
  append(out, static_cast<std::uint32_t>(body.size()));
  append_bytes(out, body);
  return out;
}

void append_pinhole(Bytes& out) {
  constexpr std::uint32_t kBytes = 4 + 4 + (9 + 5) * 8;
  append(out, kBytes);
  append(out, std::uint32_t{640});
  append(out, std::uint32_t{480});
  for (int i = 0; i < 9 + 5; ++i) append(out, 1.0 + i);
}

Bytes info_sample() {
  Bytes rig;
  append(rig, std::uint32_t{0});
  append(rig, 29.97);
  append_pinhole(rig);
  append_pinhole(rig);
  for (int i = 0; i < 9 + 3 + 9; ++i) append(rig, 0.5 * i);
  Bytes pattern;
  append(pattern, std::uint32_t{2});
  append(pattern, std::uint32_t{2});
  append(pattern, std::uint32_t{2});
  append(pattern, std::uint32_t{0x0201});  // two colours and padding
  append(pattern, std::uint32_t{3});
  for (const std::uint32_t stripe : {0U, 1U, 3U}) append(pattern, stripe);
  Bytes body;
  append_text(body, "face");
  append_text(body, "sim:face");
  append(body, std::int64_t{7});
  for (const Bytes& part : {rig, pattern}) {
    append(body, static_cast<std::uint32_t>(part.size()));
    append_bytes(body, part);
  }
  return sample_of(body);
}

Bytes status_sample() {
  Bytes body;
  append_text(body, "face");
  append(body, std::int64_t{7});
  append(body, std::uint32_t{1});
  append_text(body, "fine");
  append(body, 30.0);
  for (std::uint64_t i = 0; i < 6; ++i) append(body, i);
  for (int i = 0; i < 3; ++i) append(body, 1.5 * i);
  append(body, std::uint32_t{2});                         // filters
  for (std::uint64_t i = 0; i < 4; ++i) append(body, i);  // those, mixed, regrouped
  for (int i = 0; i < 2; ++i) {
    append(body, std::uint32_t{1});
    append(body, 0.5);
  }
  return sample_of(body);
}

Status samples(const fs::path& source, const fs::path& out) {
  write_seed(out / "frame", frame_sample(source));
  write_seed(out / "info", info_sample());
  write_seed(out / "status", status_sample());
  if (const auto info = read_info_cdr(info_sample()); !info) return info.error();
  if (const auto status = read_status_cdr(status_sample()); !status) return status.error();
  return {};
}

/// As texture.cpp reads them: three pictures of each codec that this build can encode.
Status textures(const fs::path&, const fs::path& out) {
  for (const auto codec :
       {TextureCodec::kJpeg, TextureCodec::kWebp, TextureCodec::kPng, TextureCodec::kH264}) {
    if (!check_texture_codec(codec)) continue;
    const auto encoder = make_texture_encoder(codec);
    Bytes bytes{static_cast<std::uint8_t>(codec), 3};
    append(bytes, std::uint16_t{40});
    append(bytes, std::uint16_t{24});
    for (int i = 0; i < 3; ++i) {
      Bytes section;
      if (const auto made =
              encoder->encode(test::picture(40, 24).view(), {.quality = 60, .key = i == 0}, section);
          !made)
        return made.error();
      append(bytes, static_cast<std::uint16_t>(section.size()));
      append_bytes(bytes, section);
    }
    write_seed(out / std::to_string(static_cast<int>(codec)), bytes);
  }
  return {};
}

struct Target {
  const char* name;
  Status (*make)(const fs::path& source, const fs::path& out);
};
constexpr Target kTargets[] = {{"frame", frames},        {"recording", recordings},
                               {"cdr", samples},         {"texture", textures},
                               {"take", take_seeds},     {"calibration", calibration_seeds},
                               {"mesh", mesh_seeds},     {"picture", picture_seeds},
                               {"config", config_seeds}, {"gateway", gateway_seeds}};

}  // namespace
}  // namespace relievo::fuzz

int main(int argc, char** argv) {
  using namespace relievo;
  using namespace relievo::fuzz;
  if (argc != 3 && argc != 4) return 2;
  const fs::path source = argv[1];
  const fs::path out = argv[2];
  bool made = true;
  for (const Target& target : kTargets) {
    if (argc == 4 && std::string_view(argv[3]) != target.name) continue;
    const Status status = target.make(source, out / target.name);
    if (!status) std::fprintf(stderr, "seeds of %s: %s\n", target.name, status.error().message.c_str());
    made = made && status.ok();
  }
  return made ? 0 : 1;
}
