// SPDX-License-Identifier: Apache-2.0
#include "cli/program.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <iostream>
#include <string_view>
#include <utility>

#include "base/log.h"
#include "base/log_format.h"
#include "cli/help.h"

namespace relievo {
namespace {

constexpr std::size_t kMostOfALine = 2000;

struct Verbosity {
  bool verbose = false;
  bool quiet = false;
  bool json_log = false;
  bool version = false;
};

// Every command has the common flags itself, so that they work behind the verb and show in its --help.
void add_common_flags(CLI::App& app, Verbosity& verbosity) {
  auto* verbose = app.add_flag("-v,--verbose", verbosity.verbose, "Log more");
  app.add_flag("-q,--quiet", verbosity.quiet, "Log errors only, draw no progress bar")->excludes(verbose);
  app.add_flag("--log-json", verbosity.json_log, "Log lines as JSON: time (UTC), level, message");
  app.add_flag_callback(
      "--version", [] { throw CLI::CallForVersion(RELIEVO_VERSION, 0); }, "Print the version and exit");
}

/// Of what is as long as a whole file, given for an argument, the start and the end.
std::string one_line(std::string text) {
  while (!text.empty() && text.back() == '\n') text.pop_back();
  for (char& c : text) {
    if (c == '\n') c = ' ';
  }
  if (text.size() <= kMostOfALine) return text;
  const auto whole_letters = [&](std::size_t at) {  // of UTF-8
    while (at < text.size() && (static_cast<unsigned char>(text[at]) & 0xc0) == 0x80) ++at;
    return at;
  };
  const std::size_t cut = whole_letters(kMostOfALine / 2);
  return text.replace(cut, whole_letters(text.size() - kMostOfALine / 2) - cut, " [...] ");
}

/// The one line that says what was not done, and who says it.
void say_failed(const std::string& who, const std::string& why) {
  if (log_format() == LogFormat::kJson) return log_error(who + ": " + one_line(why));
  std::fprintf(stderr, "%s: error: %s\n", who.c_str(), one_line(why).c_str());
}

int usage_error(const std::string& name, const std::string& message) {
  std::fprintf(stderr, "%s: %s (see %s --help)\n", name.c_str(), one_line(message).c_str(), name.c_str());
  return kExitUsage;
}

// What stands where the command should, or nothing.
std::string first_word(int argc, char** argv) {
  for (int i = 1; i < argc; ++i) {
    if (argv[i][0] != '-') return argv[i];
  }
  return {};
}

/// The program with the command that was given, and the command in that.
std::string name_in_full(const CLI::App& app) {
  std::string name = app.get_name();
  for (const CLI::App* given : app.get_subcommands()) name += ' ' + name_in_full(*given);
  return name;
}

/// CLI11 says of a word that is no command that a command is required.
std::string what_is_wrong(const CLI::ParseError& e, const CLI::App& app) {
  if (!std::string_view(e.what()).starts_with("A subcommand is required")) return e.what();
  const std::vector<std::string> left = app.remaining(true);
  return left.empty() ? "which command?" : "there is no command '" + left.front() + "'";
}

/// A script's variable that was not set: what an option would take for not given.
void refuse_empty_values(const CLI::App& app) {
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& value : option->results())
      if (value.empty())
        throw CLI::ValidationError(option->get_name(), "its value is empty: give one, or leave it out");
  }
  for (const CLI::App* given : app.get_subcommands()) refuse_empty_values(*given);
}

// Results that could not be written (a full disk, a closed pipe) are a failure, not silence.
int flush_results(const std::string& name, int code) {
  std::cout.flush();
  // What was more than the buffer holds has failed before.
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0 && std::cout.good()) return code;
  say_failed(name, "cannot write the results to standard output: it is closed or its disk is full");
  return code == kExitDone ? kExitFailed : code;
}

int parse_and_run(const std::string& name, const std::string& description,
                  const std::vector<Command>& commands, int argc, char** argv) {
  StopSignal stop;
  CLI::App app(description, name);
  app.formatter(make_help_formatter());  // the verbs inherit it
  Verbosity verbosity;
  add_common_flags(app, verbosity);
  app.require_subcommand(1);
  std::vector<std::pair<CLI::App*, std::function<Status(StopSignal&)>>> actions;
  for (const Command& command : commands) {
    CLI::App* sub = app.add_subcommand(command.name, command.description)->group("Commands");
    add_common_flags(*sub, verbosity);
    actions.emplace_back(sub, command.define(*sub));
    for (CLI::App* nested : sub->get_subcommands([](CLI::App*) { return true; }))
      add_common_flags(*nested, verbosity);
  }

  const std::string word = first_word(argc, argv);
  const bool known =
      std::any_of(commands.begin(), commands.end(), [&](const Command& c) { return c.name == word; });
  if (!word.empty() && !known) {  // CLI11 would say that a command is required
    return usage_error(name, "there is no command '" + word + "'");
  }
  try {
    app.parse(argc, argv);
    refuse_empty_values(app);
  } catch (const CLI::CallForVersion&) {
    std::printf("%s %s\n", name.c_str(), RELIEVO_VERSION);
    return flush_results(name, kExitDone);
  } catch (const CLI::Success& e) {  // --help, in its kinds
    return flush_results(name, app.exit(e));
  } catch (const CLI::ParseError& e) {
    return usage_error(name_in_full(app), what_is_wrong(e, app));
  }

  if (verbosity.verbose) set_log_level(LogLevel::kDebug);
  if (verbosity.quiet) set_log_level(LogLevel::kError);
  if (verbosity.json_log) set_log_format(LogFormat::kJson);
  for (const auto& [sub, action] : actions) {
    if (!sub->parsed()) continue;
    const Status status = action(stop);
    if (status.ok()) return flush_results(name, kExitDone);
    std::cout.flush();
    std::fflush(stdout);
    say_failed(name_in_full(app), status.error().message);
    return kExitFailed;
  }
  return kExitUsage;  // not reached: one command is required
}

}  // namespace

int run_program(const std::string& name, const std::string& description, const std::vector<Command>& commands,
                int argc, char** argv) {
  try {
    return parse_and_run(name, description, commands, argc, argv);
  } catch (const std::exception& e) {
    say_failed(name, e.what());
    return kExitFailed;
  }
}

}  // namespace relievo
