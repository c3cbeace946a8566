// SPDX-License-Identifier: Apache-2.0
// MCAP files: by their index and by going through them, every question a reader answers, and recover.
#include <unistd.h>

#include <string>

#include "codec/recording.h"
#include "codec/recording_recover.h"
#include "fuzz/fuzz.h"
#include "fuzz/memory_file.h"

namespace relievo {
namespace {

constexpr int kMostErrors = 100'000;  // of one file: more than its bytes can name is a loop

std::uint64_t read_all(RecordingReader& reader) {
  std::uint64_t messages = 0;
  std::int64_t last_ns = 0;
  for (int errors = 0;;) {
    const auto message = reader.next();
    if (!message) {
      FUZZ_CHECK(++errors < kMostErrors);
      continue;
    }
    if (!*message) return messages;
    FUZZ_CHECK((**message).log_time_ns >= last_ns);
    FUZZ_CHECK((**message).channel < reader.summary().channels.size());
    last_ns = (**message).log_time_ns;
    ++messages;
  }
}

void read(const std::filesystem::path& file, bool rebuild_index) {
  const auto reader = RecordingReader::open(file, {.rebuild_index = rebuild_index});
  if (!reader) return;
  read_all(**reader);
  const RecordingSummary& summary = (*reader)->summary();
  FUZZ_CHECK(summary.channel_messages.size() == summary.channels.size());
  const std::int64_t middle_ns = summary.start_ns + (summary.end_ns - summary.start_ns) / 2;
  static_cast<void>((*reader)->times(0).ok());
  const auto even = [](std::uint16_t, std::span<const std::uint8_t> head) { return head.size() % 2 == 0; };
  const auto key_ns = (*reader)->find_last(middle_ns, even);
  FUZZ_CHECK(!key_ns || *key_ns <= middle_ns);
  if ((*reader)->seek(key_ns.value_or(middle_ns))) static_cast<void>((*reader)->next().ok());
}

/// What it writes is sound: all of it comes back.
void recover(const std::filesystem::path& file) {
  const std::filesystem::path copy =
      fuzz::folder_in_memory() / ("relievo-fuzz-" + std::to_string(::getpid()) + ".mcap");
  const auto recovered = recover_recording(file, copy, [](std::uint64_t) { return true; });
  if (!recovered) return;
  const auto reader = RecordingReader::open(copy);
  FUZZ_CHECK(reader.ok());
  FUZZ_CHECK(!(*reader)->summary().recovered);
  FUZZ_CHECK(read_all(**reader) == recovered->messages);
  std::filesystem::remove(copy);
}

}  // namespace
}  // namespace relievo

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const relievo::fuzz::MemoryFile file({data, size});
  for (const bool rebuild_index : {false, true}) relievo::read(file.path(), rebuild_index);
  relievo::recover(file.path());
  return 0;
}
