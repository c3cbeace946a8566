// SPDX-License-Identifier: Apache-2.0
// A server's configuration; where the first byte is not 0 its file of tokens.
#include "server/config.h"

#include "base/log.h"
#include "fuzz/fuzz.h"
#include "fuzz/memory_file.h"
#include "web/gateway/access.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace relievo;
  set_log_level(LogLevel::kError);
  if (size == 0) return 0;
  const fuzz::MemoryFile file({data + 1, size - 1});
  if (data[0] == 0) {
    ServeConfig config;
    if (!read_config(file.path(), config)) return 0;
    static_cast<void>(find_mistake(config).has_value());
    FUZZ_CHECK(!config.all_streams().empty());
    for (const StreamConfig& stream : config.all_streams()) static_cast<void>(encode_options(stream));
  } else if (const auto tokens = Tokens::load(file.path())) {
    FUZZ_CHECK(tokens->needed() && tokens->accepts(tokens->first()) && !tokens->accepts(""));
  }
  return 0;
}
