// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/counted.h"
#include "base/json_text.h"
#include "cli/progress.h"
#include "client/commands.h"
#include "codec/recording_recover.h"

namespace relievo {
namespace {

struct Options {
  std::string file;
  std::string out;
  bool json = false;
};

std::string default_out(const std::filesystem::path& file) {
  return (file.parent_path() / (file.stem().string() + "-recovered" + file.extension().string())).string();
}

void report(const Options& options, const RecoveredRecording& recovered) {
  if (options.json) {
    const nlohmann::json j = {{"file", options.out},
                              {"recordings", recovered.recordings},
                              {"messages", recovered.messages},
                              {"attachments", recovered.attachments},
                              {"lost_bytes", recovered.lost_bytes},
                              {"left_out", recovered.left_out}};
    std::puts(json_text(j).c_str());
    return;
  }
  std::printf("%s: %s and %s\n", options.out.c_str(), counted(recovered.messages, "message").c_str(),
              counted(recovered.attachments, "attachment").c_str());
  if (recovered.recordings > 1)
    std::printf("of %zu recordings that lay one behind the other\n", recovered.recordings);
  for (const std::string& line : recovered.left_out) std::printf("left out: %s\n", line.c_str());
  if (recovered.lost_bytes > 0) {
    std::printf("%s of the file %s no part of a recording\n", counted(recovered.lost_bytes, "byte").c_str(),
                is_or_are(recovered.lost_bytes));
  } else if (recovered.left_out.empty()) {
    std::puts("all of the file was readable");
  }
}

Status run(Options options, StopSignal& stop) {
  if (options.out.empty()) options.out = default_out(options.file);
  Progress progress("recover", "messages");
  const auto recovered = recover_recording(options.file, options.out, [&](std::uint64_t done) {
    progress.update(done);
    return !stop.stopped();
  });
  progress.finish();
  if (!recovered) return recovered.error();
  if (recovered->stopped) return Error{"stopped before the whole file was read; nothing was written"};
  report(options, *recovered);
  return {};
}

}  // namespace

Command recover_command() {
  return {
      "recover", "Write a sound copy of a damaged recording, with all that is whole", [](CLI::App& app) {
        auto options = std::make_shared<Options>();
        app.add_option("file", options->file, "Recording; it is not changed")->type_name("FILE")->required();
        app.add_option("--out", options->out, "New file to write (default: NAME-recovered.mcap)")
            ->type_name("FILE");
        app.add_flag("--json", options->json, "Print the result as JSON");
        app.footer("Example:\n  relievo recover face.mcap --out sound.mcap");
        return [options](StopSignal& stop) { return run(*options, stop); };
      }};
}

}  // namespace relievo
