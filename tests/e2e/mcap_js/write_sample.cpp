// SPDX-License-Identifier: Apache-2.0
// write_sample FILE.mcap|FILE.glb|FILE.draco.glb: a recording of known CDR messages, for validate.mjs to
// read; or a surface, the last compressed, for validate_glb.mjs.
#include <cstdio>
#include <string_view>

#include "codec/byte_io.h"
#include "codec/export.h"
#include "codec/recording.h"
#include "tests/support/make_surface.h"

namespace relievo {
namespace {

/// struct Sample { string name; unsigned long long number; sequence<octet> data; } as XCDR1, little endian.
Bytes sample(std::uint64_t number) {
  Bytes cdr;
  cdr.reserve(1100);
  append(cdr, std::uint32_t{0x0100});               // bytes 0 1 0 0: CDR, little endian
  append_string(cdr, std::string_view("face", 5));  // with its terminating zero
  cdr.resize(4 + 16);  // the next field is aligned to 8, behind the encapsulation
  append(cdr, number);
  append(cdr, std::uint32_t{1000});
  cdr.resize(cdr.size() + 1000, static_cast<std::uint8_t>(number));
  return cdr;
}

Status write(const char* file) {
  auto writer = RecordingWriter::create(file, {.chunk_ns = 100'000'000});
  if (!writer) return writer.error();
  const RecordingSchema schema{
      "test::Sample", "omgidl",
      "module test { struct Sample { string name; unsigned long long number; sequence<octet> data; }; };"};
  const auto channel =
      (*writer)->add_channel(schema, {"test/sample", "cdr", schema.name, {{"stream", "face"}}});
  if (!channel) return channel.error();
  const Bytes text{'f', 'x', ':', ' ', '1'};
  if (auto status = (*writer)->add_attachment({"rig.yaml", "application/yaml", 0, text}); !status)
    return status;
  for (std::uint32_t i = 0; i < 60; ++i) {
    const std::int64_t time = 1'700'000'000'000'000'000 + std::int64_t{i} * 33'366'667;
    if (auto status = (*writer)->write({*channel, i, time, time - 5'000'000, sample(i)}); !status)
      return status;
  }
  return (*writer)->finish();
}

}  // namespace
}  // namespace relievo

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const std::string_view name(argv[1]);
  const relievo::GlbOptions options{.draco = name.ends_with(".draco.glb")};
  const auto status = name.ends_with(".glb") ? relievo::write_glb(name, relievo::test::frame(40, 30), options)
                                             : relievo::write(argv[1]);
  if (!status) std::fprintf(stderr, "%s\n", status.error().message.c_str());
  return status.ok() ? 0 : 1;
}
