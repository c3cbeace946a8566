// SPDX-License-Identifier: Apache-2.0
#include "bench/report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "base/json_text.h"

namespace relievo::bench {
namespace {

using Json = nlohmann::ordered_json;

/// Nearest rank; `sorted` is not empty.
double percentile(const std::vector<double>& sorted, double p) {
  const auto rank = static_cast<std::size_t>(std::ceil(p * static_cast<double>(sorted.size())));
  return sorted[std::clamp<std::size_t>(rank, 1, sorted.size()) - 1];
}

std::string processor() {
  std::ifstream cpuinfo("/proc/cpuinfo");
  for (std::string line; std::getline(cpuinfo, line);) {
    if (line.starts_with("model name")) return line.substr(std::min(line.size(), line.find(':') + 2));
  }
  return "unknown";
}

std::vector<Figure> machine() {
  std::vector<Figure> figures{
      {"processor", processor()},
      {"cores", static_cast<double>(std::max(1U, std::thread::hardware_concurrency()))}};
  double load[3];
  if (getloadavg(load, 3) >= 1) figures.push_back({"load_1min", load[0]});
  return figures;
}

struct ToJson {
  Json operator()(std::monostate) const { return nullptr; }
  Json operator()(bool value) const { return value; }
  Json operator()(double value) const {
    // A count is printed as one.
    if (std::abs(value) < 1e15 && std::floor(value) == value) return static_cast<std::int64_t>(value);
    return value;
  }
  Json operator()(const std::string& value) const { return value; }
  Json operator()(const Spread& s) const {
    return {{"median", s.median}, {"p10", s.p10}, {"p90", s.p90}, {"p99", s.p99},
            {"min", s.min},       {"max", s.max}, {"n", s.n}};
  }
};

void add(Json& object, const std::vector<Figure>& figures) {
  for (const Figure& figure : figures) {
    const std::size_t dot = figure.key.find('.');
    Json& in = dot == std::string::npos ? object : object[figure.key.substr(0, dot)];
    in[dot == std::string::npos ? figure.key : figure.key.substr(dot + 1)] =
        std::visit(ToJson{}, figure.value);
  }
}

void print_json(const Report& report) {
  Json out{{"suite", report.suite}, {"version", RELIEVO_VERSION}};
  add(out["machine"], machine());
  add(out["settings"], report.settings);
  add(out, report.figures);
  if (!report.rows.empty()) {
    Json rows = Json::array();
    for (const Row& row : report.rows) {
      Json object{{"name", row.name}};
      add(object, row.figures);
      rows.push_back(std::move(object));
    }
    out["rows"] = std::move(rows);
  }
  std::printf("%s\n", json_text(out).c_str());
}

/// Three digits or more, without a tail of them.
std::string number(double value) {
  const double size = std::abs(value);
  const int digits = size == 0 || size >= 1000 ? 0 : size >= 100 ? 1 : size >= 10 ? 2 : size >= 0.1 ? 3 : 5;
  char text[48];
  std::snprintf(text, sizeof text, "%.*f", std::floor(value) == value ? 0 : digits, value);
  return text;
}

struct ToText {
  std::string operator()(std::monostate) const { return "-"; }
  std::string operator()(bool value) const { return value ? "yes" : "no"; }
  std::string operator()(double value) const { return number(value); }
  std::string operator()(const std::string& value) const { return value; }
  std::string operator()(const Spread& s) const {
    if (s.n == 0) return "-";
    if (s.p10 == s.p90) return number(s.median);
    return number(s.median) + " (" + number(s.p10) + ".." + number(s.p90) + ")";
  }
};

void print_figures(const std::vector<Figure>& figures) {
  std::size_t width = 0;
  for (const Figure& figure : figures) width = std::max(width, figure.key.size());
  for (const Figure& figure : figures) {
    std::string text = std::visit(ToText{}, figure.value);
    if (const auto* spread = std::get_if<Spread>(&figure.value); spread && spread->n > 1)
      text += "  p99 " + number(spread->p99) + "  max " + number(spread->max);
    std::printf("  %-*s  %s\n", static_cast<int>(width), figure.key.c_str(), text.c_str());
  }
}

void print_rows(const std::vector<Row>& rows) {
  if (rows.empty()) return;
  std::vector<std::vector<std::string>> cells(rows.size() + 1);
  cells[0].push_back("");
  for (const Figure& figure : rows[0].figures) cells[0].push_back(figure.key);
  for (std::size_t r = 0; r < rows.size(); ++r) {
    cells[r + 1].push_back(rows[r].name);
    for (const Figure& figure : rows[r].figures) cells[r + 1].push_back(std::visit(ToText{}, figure.value));
  }
  std::vector<std::size_t> widths(cells[0].size(), 0);
  for (const auto& line : cells)
    for (std::size_t c = 0; c < line.size() && c < widths.size(); ++c)
      widths[c] = std::max(widths[c], line[c].size());
  for (const auto& line : cells) {
    std::string text;
    for (std::size_t c = 0; c < line.size() && c < widths.size(); ++c)
      text += "  " + line[c] + std::string(widths[c] - line[c].size(), ' ');
    text.erase(text.find_last_not_of(' ') + 1);
    std::printf("%s\n", text.c_str());
  }
}

void print_text(const Report& report) {
  std::printf("%s: median (p10..p90)\n", report.suite.c_str());
  std::vector<Figure> settings = machine();
  settings.insert(settings.end(), report.settings.begin(), report.settings.end());
  print_figures(settings);
  std::printf("\n");
  print_figures(report.figures);
  if (!report.figures.empty() && !report.rows.empty()) std::printf("\n");
  print_rows(report.rows);
  for (const std::string& note : report.notes) std::printf("\n%s\n", note.c_str());
}

}  // namespace

Spread spread_of(std::vector<double> values) {
  if (values.empty()) return {};
  std::sort(values.begin(), values.end());
  return {.n = values.size(),
          .median = percentile(values, 0.5),
          .p10 = percentile(values, 0.1),
          .p90 = percentile(values, 0.9),
          .p99 = percentile(values, 0.99),
          .min = values.front(),
          .max = values.back()};
}

void print(const Report& report, bool as_json) {
  as_json ? print_json(report) : print_text(report);
}

}  // namespace relievo::bench
