#include "core/vision/labels.hpp"

#include <algorithm>
#include <bit>
#include <cstring>
#include <numbers>

namespace invar::vision {

namespace {

// The runs of all rows, and for each the first of those that it hangs together with (union-find).
void find_runs(const BitMask& mask, std::vector<BlobRun>& runs, std::vector<int>& parent) {
  const auto root = [&](int i) {
    while (parent[static_cast<std::size_t>(i)] != i) {
      parent[static_cast<std::size_t>(i)] =
          parent[static_cast<std::size_t>(parent[static_cast<std::size_t>(i)])];
      i = parent[static_cast<std::size_t>(i)];
    }
    return i;
  };
  std::size_t above_begin = 0, above_end = 0;
  for (int y = 0; y < mask.rows(); ++y) {
    const std::uint64_t* row = mask.row(y);
    const std::size_t first = runs.size();
    std::size_t above = above_begin;
    int begin = -1;  // of the run that is open
    const auto close = [&](int end) {
      const int id = static_cast<int>(runs.size());
      runs.push_back({y, begin, end, 0});
      parent.push_back(id);
      while (above < above_end && runs[above].end < begin) ++above;
      for (std::size_t k = above; k < above_end && runs[k].begin <= end; ++k) {
        const int a = root(static_cast<int>(k)), b = root(id);
        if (a != b) parent[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
      }
      begin = -1;
    };
    std::uint64_t before = 0;  // the last pixel of the word before
    for (int word = 0; word < mask.words(); ++word) {
      const std::uint64_t bits = row[word];
      for (std::uint64_t changes = bits ^ (bits << 1 | before); changes != 0; changes &= changes - 1) {
        const int x = 64 * word + std::countr_zero(changes);
        if (begin < 0)
          begin = x;
        else
          close(x);
      }
      before = bits >> 63;
    }
    if (begin >= 0) close(64 * mask.words());
    above_begin = first;
    above_end = runs.size();
  }
  for (std::size_t i = 0; i < runs.size(); ++i) parent[i] = root(static_cast<int>(i));
}

}  // namespace

Blobs label_blobs(const BitMask& mask, double smallest) {
  Blobs out;
  auto& runs = out.runs;
  std::vector<int> parent;
  runs.reserve(4096);
  parent.reserve(4096);
  find_runs(mask, runs, parent);
  struct Sums {  // in whole numbers: x twice, its square four times
    std::int64_t n = 0, x2 = 0, y = 0, xx4 = 0, yy = 0;
    int left = 1 << 30, top = 1 << 30, right = -1, bottom = -1;
  };
  std::vector<int> set(runs.size(), -1);  // which blob a root is, counted as they come
  std::vector<Sums> sums;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    BlobRun& run = runs[i];
    int& which = set[static_cast<std::size_t>(parent[i])];
    if (which < 0) {
      which = static_cast<int>(sums.size());
      sums.emplace_back();
    }
    run.label = which;
    Sums& s = sums[static_cast<std::size_t>(which)];
    const std::int64_t n = run.end - run.begin, middle2 = run.begin + run.end - 1, y = run.y;
    s.n += n;
    s.x2 += n * middle2;
    s.y += n * y;
    s.xx4 += n * middle2 * middle2 + n * (n * n - 1) / 3;
    s.yy += n * y * y;
    s.left = std::min(s.left, run.begin);
    s.right = std::max(s.right, run.end - 1);
    s.top = std::min(s.top, run.y);
    s.bottom = std::max(s.bottom, run.y);
  }
  std::vector<int> label(sums.size(), -1);
  auto& blobs = out.blobs;
  for (std::size_t i = 0; i < sums.size(); ++i) {
    const Sums& s = sums[i];
    const auto n = static_cast<double>(s.n);
    if (n < std::max(1.0, smallest)) continue;
    const double x = 0.5 * static_cast<double>(s.x2) / n, y = static_cast<double>(s.y) / n;
    // Each pixel is a square of its own second moment, 1/12 each way.
    const double moment =
        0.25 * static_cast<double>(s.xx4) - n * x * x + static_cast<double>(s.yy) - n * y * y + n / 6.0;
    label[i] = static_cast<int>(blobs.size());
    blobs.push_back(
        {label[i], n, x, y, n * n / (2.0 * std::numbers::pi * moment), s.left, s.top, s.right, s.bottom});
  }
  for (BlobRun& run : runs) run.label = label[static_cast<std::size_t>(run.label)] + 1;
  return out;
}

cv::Mat1b mask_of(const Blobs& blobs, const Blob& blob) {
  cv::Mat1b mask(blob.bottom - blob.top + 3, blob.right - blob.left + 3, static_cast<std::uint8_t>(0));
  auto run = std::lower_bound(blobs.runs.begin(), blobs.runs.end(), blob.top,
                              [](const BlobRun& a, int y) { return a.y < y; });
  for (; run != blobs.runs.end() && run->y <= blob.bottom; ++run)
    if (run->label == blob.label + 1)
      std::memset(mask.ptr<std::uint8_t>(run->y - blob.top + 1) + run->begin - blob.left + 1, 255,
                  static_cast<std::size_t>(run->end - run->begin));
  return mask;
}

}  // namespace invar::vision
