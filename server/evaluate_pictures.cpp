// SPDX-License-Identifier: Apache-2.0
#include "server/evaluate_pictures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string_view>
#include <utility>

#include "base/html.h"
#include "base/whole_file.h"
#include "capture/camera_response.h"
#include "codec/export.h"

namespace relievo {
namespace {

constexpr float kErrorRange = 1e-3F;  // of depth, at the ends of the error map's scale

struct Stage {
  std::string_view name;  // of the file
  std::string_view caption;
};
constexpr std::array<Stage, 10> kStages{{
    {"errors", "Error of the depth: blue too near, red too far, magenta wrong"},
    {"completeness", "Visible boundaries: found green, missed red; wrong points magenta"},
    {"slide", "Field under the slide"},
    {"complement", "Field under its complement"},
    {"difference", "Difference image"},
    {"boundaries", "Decoded boundaries, in the colours projected on both sides"},
    {"depth", "Depth"},
    {"normals", "Normals"},
    {"sigma", "Standard deviation of the depth"},
    {"texture", "Texture"},
}};

constexpr std::string_view kStyle =
    "body{background:#0e1014;color:#d8dbe0;font:15px/1.5 system-ui,sans-serif;margin:0 auto;max-width:1500px;"
    "padding:24px}h1{font-size:22px;margin:0 0 4px}h2{font-size:17px;margin:36px 0 4px}"
    "p{color:#9aa2ad;margin:0 0 12px}nav a{display:inline-block;color:#86b7ff;margin-right:12px}"
    "table{border-collapse:collapse;margin:8px 24px 8px 0;display:inline-table;vertical-align:top}"
    "td,th{padding:3px 14px 3px 0;text-align:left;font-weight:400;border-bottom:1px solid #22262d}"
    "td{font-variant-numeric:tabular-nums;text-align:right;color:#fff}"
    ".stages{display:grid;grid-template-columns:repeat(auto-fill,minmax(340px,1fr));gap:16px}"
    "figure{margin:0;background:#161a20;border-radius:8px;overflow:hidden}"
    "figure img{display:block;width:100%;height:auto}figcaption{padding:8px "
    "12px;font-size:13px;color:#b6bdc7}";

template <typename... Values>
std::string format(const char* pattern, Values... values) {
  std::array<char, 256> out{};
  std::snprintf(out.data(), out.size(), pattern, values...);
  return out.data();
}

std::string file_name(std::uint64_t number, std::string_view stage) {
  return format("%06llu-", static_cast<unsigned long long>(number)) + std::string(stage) + ".png";
}

std::string row(std::string_view name, const std::string& value) {
  return "<tr><th>" + html_escaped(name) + "</th><td>" + value + "</td></tr>\n";
}

double share(std::size_t part, std::size_t whole) {
  return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : 0;
}

std::string error(double um_per_m) {
  return std::isnan(um_per_m) ? "not known" : format("%.1f &micro;m/m", um_per_m);
}

std::string figures(const Score& s) {
  return "<table>" + row("frames scored", format("%zu of %zu", s.frames, s.of)) +
         row("vertices a frame", format("%.0f", s.vertices_per_frame)) +
         row("completeness", format("%.4f", s.completeness)) +
         row("outliers", format("%.3f %%", 100 * s.outliers)) +
         row("median error", error(s.median_um_per_m)) + row("RMS error", error(s.rms_um_per_m)) +
         row("95 % under", error(s.p95_um_per_m)) + "</table>\n";
}

std::string filter_table(const FilterCounts& filters, std::size_t frames) {
  std::string out = "<table><tr><th>filter</th><td>a frame</td></tr>\n";
  for (const Filter& filter : kFilters) {
    const double each = static_cast<double>(filters.*filter.count) / static_cast<double>(frames);
    if (each > 0) out += row(filter.meaning, format("%.1f", each));
  }
  return out + "</table>\n";
}

CapturedFrame in_light(const CapturedFrame& frame, const Rig& rig) {
  CapturedFrame out;
  WorkerPool pool(1);
  CameraResponse(rig.camera_gamma).straighten(frame, pool, out);
  return out;
}

}  // namespace

Result<EvaluationPictures> EvaluationPictures::create(const std::filesystem::path& folder, const Rig& rig,
                                                      const Pattern& pattern) {
  auto made = NewFolder::create(folder);
  if (!made) return made.error();
  return EvaluationPictures(folder, *std::move(made), rig, pattern);
}

Status EvaluationPictures::add(const CapturedFrame& frame, int slide, const Frame3D& result,
                               const Judgement& judgement) {
  const auto write = [&](std::string_view stage, const Image8& picture) {
    return write_png(folder_ / file_name(frame.number, stage), picture.view());
  };
  const Surface& surface = result.surface;
  const std::array<Status, kStages.size()> written{
      write("errors", draw_errors(frame, judgement, kErrorRange)),
      write("completeness", draw_completeness(frame, judgement)),
      write("slide", draw_field(frame, false)),
      write("complement", draw_field(frame, true)),
      write("difference", draw_difference(in_light(frame, rig_), rig_)),
      write("boundaries", draw_boundaries(frame, surface, pattern_, slide)),
      write("depth", draw_depth(surface, rig_)),
      write("normals", draw_normals(surface, rig_)),
      write("sigma", draw_sigma(surface, rig_)),
      write("texture", result.texture)};
  for (const Status& status : written)
    if (!status) return status;

  Page page{frame.number, judgement.vertices.size(), 0, judgement.boundaries.size(), 0, 0};
  std::vector<float> errors;
  for (const JudgedVertex& v : judgement.vertices) {
    page.wrong += !v.right;
    if (v.right) errors.push_back(std::fabs(v.error));
  }
  for (const JudgedBoundary& b : judgement.boundaries) page.found += b.found;
  if (!errors.empty()) {
    const auto middle = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2);
    std::nth_element(errors.begin(), middle, errors.end());
    page.median_um_per_m = 1e6 * static_cast<double>(*middle);
  }
  pages_.push_back(page);
  return {};
}

Status EvaluationPictures::finish(const std::string& title, const Score& score,
                                  const FilterCounts& filters) const {
  std::string html = "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>" +
                     html_escaped(title) + "</title><style>" + std::string(kStyle) +
                     "</style></head><body>\n<h1>" + html_escaped(title) +
                     "</h1>\n<p>relievo-server evaluate</p>\n" + figures(score);
  html += filter_table(filters, std::max<std::size_t>(1, score.frames)) + "<nav>";
  for (const Page& p : pages_) {
    const auto number = static_cast<unsigned long long>(p.number);
    html += format("<a href=\"#f%llu\">frame %llu</a>", number, number);
  }
  html += "</nav>\n";
  for (const Page& p : pages_) {
    const auto number = static_cast<unsigned long long>(p.number);
    html += format("<h2 id=\"f%llu\">Frame %llu</h2>\n", number, number);
    html += format(
        "<p>%zu vertices, %zu wrong (%.3f %%); %.2f %% of %zu boundary pixels found; median %.1f "
        "&micro;m/m</p>\n",
        p.vertices, p.wrong, 100 * share(p.wrong, p.vertices), 100 * share(p.found, p.boundaries),
        p.boundaries, p.median_um_per_m);
    html += "<div class=\"stages\">\n";
    for (const Stage& stage : kStages) {
      const std::string file = file_name(p.number, stage.name);
      html += "<figure><a href=\"" + file + "\"><img loading=\"lazy\" src=\"" + file + "\" alt=\"" +
              std::string(stage.name) + "\"></a><figcaption>" + html_escaped(stage.caption) +
              "</figcaption></figure>\n";
    }
    html += "</div>\n";
  }
  html += "</body></html>\n";
  return write_whole_file(folder_ / "index.html", html);
}

}  // namespace relievo
