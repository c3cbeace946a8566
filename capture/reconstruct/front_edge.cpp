// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/front_edge.h"

#include <cmath>
#include <limits>

#include "capture/reconstruct/column_grid.h"

namespace relievo {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
// Measured on simulated scenes and a rendering by others: of what these let through, nine of ten are right.
constexpr float kGoesOn_px = 1.2F;   // off where the front's next boundary is to be
constexpr float kMuchNearer = 0.7F;  // of how far off it is where the back's is to be

}  // namespace

/// What is nearer shows, at the same place of the picture, a stripe further from the projector's side.
FrontEdges::FrontEdges(const Rig& rig) {
  const auto& r = rig.projector_from_camera_rotation;
  const auto& t = rig.projector_from_camera_translation;
  const double projector_x = -(r[0] * t[0] + r[3] * t[1] + r[6] * t[2]);  // in the camera's frame
  front_ = projector_x >= 0 ? -1 : 1;
}

/// In place, from the front's side on. What follows on one that was just corrected is the back's: behind a
/// sliver there is no more of the front.
std::size_t FrontEdges::correct_line(std::vector<Decoded>& line, const Colours& shown,
                                     const Colours& other) const {
  const int count = static_cast<int>(line.size());
  const auto at = [&](int i) -> Decoded& { return line[static_cast<std::size_t>(i)]; };
  // Where the boundary before `i` is to be, by up to three from `i` on in a direction.
  const auto before = [&](int i, int direction) {
    const auto follows = [&](int j) {
      return j >= 0 && j < count && at(j).boundary == at(j - direction).boundary + direction;
    };
    if (i < 0 || i >= count || !follows(i + direction)) return kNone;
    return goes_on_to(at(i).column_px, at(i + direction).column_px,
                      follows(i + 2 * direction) ? at(i + 2 * direction).column_px : kNone);
  };
  const std::size_t front_side = front_ < 0 ? 0 : 1;
  const auto alike = [front_side](const Colours& of, int a, int b) {
    return of[static_cast<std::size_t>(a)][front_side] == of[static_cast<std::size_t>(b)][front_side];
  };
  std::size_t corrected = 0;
  int last_corrected = -1;
  for (int step = 1; step < count; ++step) {
    const int i = front_ < 0 ? step : count - 1 - step;
    const int next = i + front_;  // towards the front
    if (next == last_corrected) continue;
    const int own = at(i).boundary;
    const int fronts = at(next).boundary - front_;
    // Further on than the front's next one.
    if ((own - fronts) * front_ >= 0) continue;
    // On the front's side it shows the front's colour, or did so under the other slide; behind, whatever is
    // there.
    const bool shows = alike(shown, own, fronts) || alike(other, own, fronts);
    if (!shows) continue;
    const float off = std::fabs(at(i).column_px - before(next, front_));
    if (!(off < kGoesOn_px)) continue;
    const int behind = i - front_;
    const bool has_behind = behind >= 0 && behind < count && at(behind).boundary == own - front_;
    const float off_back = has_behind ? std::fabs(at(i).column_px - before(behind, -front_)) : kNone;
    if (off > kMuchNearer * off_back) continue;
    at(i).boundary = fronts;
    last_corrected = i;
    ++corrected;
  }
  return corrected;
}

std::size_t FrontEdges::correct(const EdgeImage& edges, const Colours& shown, const Colours& other,
                                WorkerPool& pool, SequenceResult& result) {
  scratch_.resize(static_cast<std::size_t>(pool.workers()));
  for (Scratch& s : scratch_) s.corrected = 0;
  const std::size_t boundaries = shown.size();
  pool.for_shares(edges.line_start, [&](int begin, int end, int worker) {
    Scratch& scratch = scratch_[static_cast<std::size_t>(worker)];
    for (int line = begin; line < end; ++line) {
      scratch.line.clear();
      for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
           e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e)
        if (result.boundary[e] >= 0)
          scratch.line.push_back({edges.edges[e].column_px, result.boundary[e], e});
      const std::size_t corrected = correct_line(scratch.line, shown, other);
      if (corrected == 0) continue;
      scratch.corrected += corrected;
      float* seen = result.seen_px.data() + static_cast<std::size_t>(line) * boundaries;
      for (const Decoded& d : scratch.line) seen[result.boundary[d.edge]] = kNone;
      for (const Decoded& d : scratch.line) {
        seen[d.boundary] = d.column_px;
        result.boundary[d.edge] = static_cast<std::int16_t>(d.boundary);
      }
    }
  });
  std::size_t total = 0;
  for (const Scratch& s : scratch_) total += s.corrected;
  return total;
}

}  // namespace relievo
