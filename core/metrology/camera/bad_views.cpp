#include "core/metrology/camera/bad_views.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "core/numerics/robust.hpp"

namespace invar::metrology {

namespace {

using Eigen::Index;
using Eigen::Matrix2Xd;

// Times the error of a typical view. Up to `alike` a view is as good as that; beyond, one for which a cause is found is bad.
// Views at the edge of the image, far tilted or blurred reach a few times as much; from `far` on a view is bad whatever the
// cause.
constexpr double alike = 3.0;
constexpr double doubtful = 1.5;  // whether u and v are exchanged is tried from here on
constexpr double far = 6.0;
// A lens bends views by a few times what it bends the typical one; points in another order leave far more.
constexpr double far_from_plane = 5.0;
constexpr std::size_t fewest = 4;
constexpr double finest = 0.01;  // px: below it no difference between views counts

std::vector<Matrix2Xd> chosen(const std::vector<Matrix2Xd>& views, const std::vector<std::size_t>& which) {
  std::vector<Matrix2Xd> out;
  for (const std::size_t v : which) out.push_back(views[v]);
  return out;
}

/// The lens by which views are compared: two radial terms, or one where the views do not carry two.
std::optional<std::vector<double>> left_out(const Matrix2Xd& target, const std::vector<Matrix2Xd>& views) {
  if (auto errors = leave_one_view_out(target, views, Lens::radial_2)) return errors;
  return leave_one_view_out(target, views, Lens::radial_1);
}

/// Target and view without some points.
std::array<Matrix2Xd, 2> without(const Matrix2Xd& target, const Matrix2Xd& view,
                                 const std::vector<Index>& points) {
  std::vector<Index> kept;
  for (Index i = 0; i < target.cols(); ++i)
    if (std::find(points.begin(), points.end(), i) == points.end()) kept.push_back(i);
  return {target(Eigen::all, kept), view(Eigen::all, kept)};
}

std::string number_of(Index point) { return std::to_string(point + 1); }

/// "point 12 lies where point 11 should", by where the pose of the sound points expects them.
std::string words_of(const Matrix2Xd& expected, const Matrix2Xd& view, const std::vector<Index>& points,
                     double near) {
  std::string text;
  for (const Index point : points) {
    Index nearest = 0;
    const double distance = (expected.colwise() - view.col(point)).colwise().norm().minCoeff(&nearest);
    text += (text.empty() ? "point " : ", point ") + number_of(point) +
            (distance <= near && nearest != point ? " lies where point " + number_of(nearest) + " should"
                                                  : " lies off its place");
  }
  return text;
}

/// Whether all of these points lie where others should.
bool lie_at_others(const Matrix2Xd& expected, const Matrix2Xd& view, const std::vector<Index>& points,
                   double near) {
  return std::all_of(points.begin(), points.end(), [&](Index point) {
    Index nearest = 0;
    return (expected.colwise() - view.col(point)).colwise().norm().minCoeff(&nearest) <= near &&
           nearest != point;
  });
}

/// A few points alone may be wrong: the farthest is left out until the others are met as other views are.
bool explain_by_points(const PinholeCamera& camera, const Matrix2Xd& target, const Matrix2Xd& view,
                       double usual, BadView& bad) {
  const auto most = static_cast<std::size_t>(std::max<Index>(2, target.cols() / 10));
  std::vector<Index> points;
  while (points.size() < most) {
    const auto [sound_target, sound_view] = without(target, view, points);
    const auto fit = fit_pose(camera, sound_target, sound_view);
    if (!fit) return false;
    const Matrix2Xd expected = project_target(camera, fit->pose, target);
    if (!points.empty() && fit->rms <= alike * usual) {
      // Whoever was left out on the way and lies at its place is none of them.
      std::erase_if(points,
                    [&](Index i) { return (expected.col(i) - view.col(i)).norm() <= 3.0 * alike * usual; });
      bad.points = points;
      bad.has_cause = lie_at_others(expected, view, points, 3.0 * alike * usual);
      bad.why = words_of(expected, view, points, 3.0 * alike * usual);
      return !points.empty();
    }
    Eigen::VectorXd apart = (expected - view).colwise().norm();
    for (const Index i : points) apart(i) = 0.0;
    Index worst = 0;
    apart.maxCoeff(&worst);
    points.push_back(worst);
  }
  return false;
}

void explain(const PinholeCamera& camera, const Matrix2Xd& target, const Matrix2Xd& view, double usual,
             BadView& bad) {
  const auto as_it_is = fit_pose(camera, target, view);
  bad.rms = as_it_is ? as_it_is->rms : std::numeric_limits<double>::quiet_NaN();
  if (explain_by_points(camera, target, view, usual, bad)) return;
  const Matrix2Xd exchanged = view.colwise().reverse();
  const auto by_exchange = fit_pose(camera, target, exchanged);
  bad.has_cause = by_exchange && by_exchange->rms <= alike * usual;
  bad.why = bad.has_cause                               ? "u and v are exchanged"
            : bad.rms > 10.0 * far * usual || !as_it_is ? "its points are not in the order of the target's"
                                                        : "it does not go with the camera of the others";
}

/// Whether the camera of the other views meets this one with u and v exchanged twice as well.
bool is_exchanged(const Matrix2Xd& target, const std::vector<Matrix2Xd>& views, std::ptrdiff_t which) {
  auto others = views;
  const Matrix2Xd view = others[static_cast<std::size_t>(which)];
  others.erase(others.begin() + which);
  const auto camera = calibrate_planar(target, others, Lens::radial_2);
  if (!camera) return false;
  const auto as_it_is = fit_pose(camera->camera, target, view);
  const auto exchanged = fit_pose(camera->camera, target, view.colwise().reverse());
  return as_it_is && exchanged && exchanged->rms < 0.5 * as_it_is->rms;
}

}  // namespace

SortedViews sort_views(const Matrix2Xd& target, const std::vector<Matrix2Xd>& views) {
  SortedViews sorted;
  std::vector<double> bent;  // px, what each view's homography leaves
  for (const Matrix2Xd& view : views) bent.push_back(homography_rms(target, view));
  const double usual_bend = std::max(numerics::median(bent), finest);
  std::vector<std::size_t> bad;
  for (std::size_t v = 0; v < views.size(); ++v)
    (bent[v] <= far_from_plane * usual_bend ? sorted.good : bad).push_back(v);
  std::vector<double> errors;
  const std::size_t most = views.size() / 3;
  while (sorted.good.size() >= fewest) {
    const auto left = left_out(target, chosen(views, sorted.good));
    if (!left) break;
    errors = *left;
    const auto worst = std::max_element(errors.begin(), errors.end());
    if (sorted.good.size() == fewest || bad.size() >= most) break;
    const double usual = std::max(numerics::median(errors), finest);
    if (*worst <= alike * usual &&
        !(*worst > doubtful * usual &&
          is_exchanged(target, chosen(views, sorted.good), worst - errors.begin())))
      break;
    const auto which = sorted.good.begin() + (worst - errors.begin());
    bad.push_back(*which);
    sorted.good.erase(which);
  }
  if (bad.empty() || errors.empty()) {
    for (const std::size_t v : bad) sorted.bad.push_back({v, std::numeric_limits<double>::quiet_NaN()});
    return sorted;
  }
  const double usual = std::max(numerics::median(errors), finest);
  auto camera = calibrate_planar(target, chosen(views, sorted.good), Lens::radial_2);
  if (!camera) camera = calibrate_planar(target, chosen(views, sorted.good), Lens::radial_1);
  std::sort(bad.begin(), bad.end());
  for (const std::size_t v : bad) {
    BadView one{v, std::numeric_limits<double>::quiet_NaN()};
    if (camera) explain(camera->camera, target, views[v], usual, one);
    // A lens may bend a view more than others, or its corners be less certain: nothing is wrong with it.
    if (one.rms <= (one.has_cause ? doubtful : far) * usual)
      sorted.good.push_back(v);
    else
      sorted.bad.push_back(std::move(one));
  }
  std::sort(sorted.good.begin(), sorted.good.end());
  return sorted;
}

}  // namespace invar::metrology
