#include "core/metrology/camera/planar_camera.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <functional>
#include <limits>

#include "core/numerics/decompositions.hpp"

namespace invar::metrology {

namespace {

using Eigen::Index;
using Eigen::Matrix2Xd;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr Index intrinsics = 10;

// The order of the free numbers: fx, fy, u0, v0, skew, k1, k2, k3, p1, p2.
VectorXd pack(const PinholeCamera& c) {
  VectorXd out(intrinsics);
  out << c.fx, c.fy, c.u0, c.v0, c.skew, c.radial[0], c.radial[1], c.radial[2], c.tangential[0],
      c.tangential[1];
  return out;
}

template <class Numbers>
PinholeCamera unpack(const Numbers& p) {
  return {p(0), p(1), p(2), p(3), p(4), {p(5), p(6), p(7)}, {p(8), p(9)}};
}

std::array<bool, intrinsics> free_of(Lens lens) {
  std::array<bool, intrinsics> out{true, true, true, true, true, false, false, false, false, false};
  out[5] = lens != Lens::pinhole;
  out[6] = lens == Lens::radial_2 || lens == Lens::radial_3 || lens == Lens::radial_2_tangential;
  out[7] = lens == Lens::radial_3;
  out[8] = out[9] = lens == Lens::radial_2_tangential;
  return out;
}

Matrix3d rotation_of(const Vector3d& vector) {
  const double angle = vector.norm();
  return angle > 0.0 ? Eigen::AngleAxisd{angle, vector / angle}.toRotationMatrix() : Matrix3d::Identity();
}

// To mean 0 and mean distance sqrt 2: the homography is then well conditioned (Hartley 1997).
Matrix3d conditioning(const Matrix2Xd& points) {
  const Vector2d mean = points.rowwise().mean();
  const double distance = (points.colwise() - mean).colwise().norm().mean();
  const double scale = std::sqrt(2.0) / distance;
  Matrix3d out;
  out << scale, 0.0, -scale * mean.x(), 0.0, scale, -scale * mean.y(), 0.0, 0.0, 1.0;
  return out;
}

std::optional<Matrix3d> homography(const Matrix2Xd& from, const Matrix2Xd& to) {
  const Matrix3d a = conditioning(from), b = conditioning(to);
  if (!a.allFinite() || !b.allFinite()) return std::nullopt;
  const Index n = from.cols();
  MatrixXd rows(2 * n, 9);
  for (Index i = 0; i < n; ++i) {
    const Vector3d p = a * from.col(i).homogeneous(), q = b * to.col(i).homogeneous();
    rows.row(2 * i) << p.transpose(), 0.0, 0.0, 0.0, -q.x() * p.transpose();
    rows.row(2 * i + 1) << 0.0, 0.0, 0.0, p.transpose(), -q.y() * p.transpose();
  }
  const auto modes = numerics::symmetric_eigen(rows.transpose() * rows);
  if (!(modes.values(1) > 1e-10 * modes.values(8))) return std::nullopt;  // points on a line
  const VectorXd h = modes.vectors.col(0);
  Matrix3d out;
  out << h.segment<3>(0).transpose(), h.segment<3>(3).transpose(), h.segment<3>(6).transpose();
  return b.inverse() * out * a;
}

// Zhang's closed form: two equations a view on the image of the absolute conic.
std::optional<PinholeCamera> start_camera(const std::vector<Matrix3d>& maps) {
  const auto row = [](const Matrix3d& h, Index i, Index j) {
    Eigen::Matrix<double, 1, 6> v;
    v << h(0, i) * h(0, j), h(0, i) * h(1, j) + h(1, i) * h(0, j), h(1, i) * h(1, j),
        h(2, i) * h(0, j) + h(0, i) * h(2, j), h(2, i) * h(1, j) + h(1, i) * h(2, j), h(2, i) * h(2, j);
    return v;
  };
  // Pixels in thousands keep the six unknowns alike.
  const Matrix3d unit = Vector3d{1e-3, 1e-3, 1.0}.asDiagonal();
  MatrixXd system(2 * static_cast<Index>(maps.size()), 6);
  Index next = 0;
  for (const Matrix3d& map : maps) {
    Matrix3d h = unit * map;
    h /= h.norm();
    system.row(next++) = row(h, 0, 1);
    system.row(next++) = row(h, 0, 0) - row(h, 1, 1);
  }
  VectorXd b = numerics::symmetric_eigen(system.transpose() * system).vectors.col(0);
  if (b(0) < 0.0) b = -b;
  const double denominator = b(0) * b(2) - b(1) * b(1);
  const double v0 = (b(1) * b(3) - b(0) * b(4)) / denominator;
  const double lambda = b(5) - (b(3) * b(3) + v0 * (b(1) * b(3) - b(0) * b(4))) / b(0);
  const double fx = std::sqrt(lambda / b(0)), fy = std::sqrt(lambda * b(0) / denominator);
  const double skew = -b(1) * fx * fx * fy / lambda;
  const double u0 = skew * v0 / fy - b(3) * fx * fx / lambda;
  PinholeCamera out{1e3 * fx, 1e3 * fy, 1e3 * u0, 1e3 * v0, 1e3 * skew, {}, {}};
  if (!pack(out).allFinite()) return std::nullopt;
  return out;
}

std::optional<TargetPose> start_pose(const PinholeCamera& camera, const Matrix3d& map) {
  Matrix3d k;
  k << camera.fx, camera.skew, camera.u0, 0.0, camera.fy, camera.v0, 0.0, 0.0, 1.0;
  Matrix3d h = k.inverse() * map;
  h /= 0.5 * (h.col(0).norm() + h.col(1).norm());
  if (h(2, 2) < 0.0) h = -h;  // the target lies in front of the camera
  Matrix3d r;
  r << h.col(0), h.col(1), h.col(0).cross(h.col(1));
  const Matrix3d rotation = numerics::nearest_orthogonal(r);
  if (!rotation.allFinite() || rotation.determinant() < 0.0) return std::nullopt;
  const Eigen::AngleAxisd axis{rotation};
  return TargetPose{axis.angle() * axis.axis(), h.col(2)};
}

// Where each target point of one view is seen; p: intrinsics, rotation, position.
Matrix2Xd project(const Matrix2Xd& target, const VectorXd& p) {
  const PinholeCamera camera = unpack(p);
  const Matrix3d rotation = rotation_of(p.segment<3>(intrinsics));
  const Vector3d position = p.segment<3>(intrinsics + 3);
  Matrix2Xd out(2, target.cols());
  for (Index i = 0; i < target.cols(); ++i)
    out.col(i) = camera.project(rotation.leftCols<2>() * target.col(i) + position);
  return out;
}

// Levenberg-Marquardt over the free intrinsics and all poses, by central differences a view at a time: the poses of
// different views do not meet.
struct Adjusted {
  VectorXd camera;
  std::vector<Eigen::Matrix<double, 6, 1>> poses;
  double square = 0.0;
  MatrixXd normal;  // of the last step: free intrinsics, then the poses
};

std::optional<Adjusted> adjust(const Matrix2Xd& target, const std::vector<Matrix2Xd>& views, Adjusted at,
                               const std::array<bool, intrinsics>& free) {
  std::vector<Index> moving;
  for (Index i = 0; i < intrinsics; ++i)
    if (free[static_cast<std::size_t>(i)]) moving.push_back(i);
  const auto m = static_cast<Index>(moving.size());
  const auto n = static_cast<Index>(views.size());
  const auto whole = [&](const Adjusted& a, Index v) {
    VectorXd p(intrinsics + 6);
    p << a.camera, a.poses[static_cast<std::size_t>(v)];
    return p;
  };
  const auto cost = [&](const Adjusted& a) {
    double sum = 0.0;
    for (Index v = 0; v < n; ++v)
      sum += (views[static_cast<std::size_t>(v)] - project(target, whole(a, v))).squaredNorm();
    return sum;
  };
  at.square = cost(at);
  double damping = 1e-3;
  for (int round = 0; round < 200; ++round) {
    MatrixXd normal = MatrixXd::Zero(m + 6 * n, m + 6 * n);
    VectorXd right = VectorXd::Zero(m + 6 * n);
    for (Index v = 0; v < n; ++v) {
      const VectorXd p = whole(at, v);
      const Matrix2Xd residual = views[static_cast<std::size_t>(v)] - project(target, p);
      MatrixXd jacobian(residual.size(), m + 6);
      for (Index k = 0; k < m + 6; ++k) {
        const Index which = k < m ? moving[static_cast<std::size_t>(k)] : intrinsics + k - m;
        const double step = 1e-6 * std::max(std::abs(p(which)), which < 5 ? 1.0 : 1e-2);
        VectorXd up = p, down = p;
        up(which) += step;
        down(which) -= step;
        const Matrix2Xd slope = (project(target, up) - project(target, down)) / (2.0 * step);
        jacobian.col(k) = slope.reshaped();
      }
      const MatrixXd block = jacobian.transpose() * jacobian;
      const VectorXd part = jacobian.transpose() * residual.reshaped();
      const Index pose = m + 6 * v;
      normal.topLeftCorner(m, m) += block.topLeftCorner(m, m);
      normal.block(0, pose, m, 6) = block.topRightCorner(m, 6);
      normal.block(pose, 0, 6, m) = block.bottomLeftCorner(6, m);
      normal.block(pose, pose, 6, 6) = block.bottomRightCorner(6, 6);
      right.head(m) += part.head(m);
      right.segment(pose, 6) = part.tail(6);
    }
    at.normal = normal;
    for (int attempt = 0;; ++attempt) {
      if (attempt > 40) return at;  // no way down: at the minimum within rounding
      MatrixXd damped = normal;
      damped.diagonal() *= 1.0 + damping;
      const VectorXd step = numerics::solve_symmetric(damped, right);
      if (!step.allFinite()) return std::nullopt;
      Adjusted next = at;
      for (Index k = 0; k < m; ++k) next.camera(moving[static_cast<std::size_t>(k)]) += step(k);
      for (Index v = 0; v < n; ++v) next.poses[static_cast<std::size_t>(v)] += step.segment<6>(m + 6 * v);
      next.square = cost(next);
      if (next.square <= at.square) {
        const double gain = at.square - next.square;
        at = std::move(next);
        damping = std::max(1e-12, 0.2 * damping);
        if (gain <= 1e-12 * at.square) return at;
        break;
      }
      damping *= 5.0;
    }
  }
  return at;
}

ViewFit view_fit(const Matrix2Xd& target, const Matrix2Xd& view, const VectorXd& camera,
                 const Eigen::Matrix<double, 6, 1>& pose) {
  VectorXd p(intrinsics + 6);
  p << camera, pose;
  ViewFit out{{pose.head<3>(), pose.tail<3>()}, 0.0, view - project(target, p)};
  out.rms = std::sqrt(out.residuals.squaredNorm() / static_cast<double>(view.cols()));
  return out;
}

bool usable(const Matrix2Xd& target, const Matrix2Xd& view) {
  return target.cols() >= 6 && view.cols() == target.cols() && target.allFinite() && view.allFinite();
}

}  // namespace

const char* name(Lens lens) {
  switch (lens) {
    case Lens::pinhole:
      return "pinhole";
    case Lens::radial_1:
      return "radial_1";
    case Lens::radial_2:
      return "radial_2";
    case Lens::radial_3:
      return "radial_3";
    case Lens::radial_2_tangential:
      return "radial_2_tangential";
  }
  return "pinhole";
}

Vector2d PinholeCamera::project(const Vector3d& p) const {
  const double x = p.x() / p.z(), y = p.y() / p.z(), r = x * x + y * y;
  const double bend = 1.0 + r * (radial[0] + r * (radial[1] + r * radial[2]));
  const double bx = x * bend + 2.0 * tangential[0] * x * y + tangential[1] * (r + 2.0 * x * x);
  const double by = y * bend + 2.0 * tangential[1] * x * y + tangential[0] * (r + 2.0 * y * y);
  return {u0 + fx * bx + skew * by, v0 + fy * by};
}

std::optional<PlanarCalibration> calibrate_planar(const Matrix2Xd& target,
                                                  const std::vector<Matrix2Xd>& views, Lens lens) {
  if (views.size() < 3) return std::nullopt;
  std::vector<Matrix3d> maps;
  for (const Matrix2Xd& view : views) {
    if (!usable(target, view)) return std::nullopt;
    const auto map = homography(target, view);
    if (!map) return std::nullopt;
    maps.push_back(*map);
  }
  const auto start = start_camera(maps);
  if (!start) return std::nullopt;
  Adjusted first;
  first.camera = pack(*start);
  for (const Matrix3d& map : maps) {
    const auto pose = start_pose(*start, map);
    if (!pose) return std::nullopt;
    Eigen::Matrix<double, 6, 1> p;
    p << pose->rotation, pose->position;
    first.poses.push_back(p);
  }
  const auto free = free_of(lens);
  const auto fit = adjust(target, views, first, free);
  if (!fit || !fit->camera.allFinite()) return std::nullopt;
  PlanarCalibration out;
  out.lens = lens;
  out.camera = unpack(fit->camera);
  for (std::size_t v = 0; v < views.size(); ++v)
    out.views.push_back(view_fit(target, views[v], fit->camera, fit->poses[v]));
  const auto points = static_cast<double>(target.cols()) * static_cast<double>(views.size());
  out.rms = std::sqrt(fit->square / points);
  const double freedom = 2.0 * points - static_cast<double>(fit->normal.rows());
  const VectorXd variance =
      fit->square / std::max(1.0, freedom) *
      numerics::solve_symmetric(fit->normal, MatrixXd::Identity(fit->normal.rows(), fit->normal.rows()))
          .diagonal();
  VectorXd sigma = VectorXd::Zero(intrinsics);
  Index next = 0;
  for (Index i = 0; i < intrinsics; ++i)
    if (free[static_cast<std::size_t>(i)]) sigma(i) = std::sqrt(std::max(0.0, variance(next++)));
  out.sigma = unpack(sigma);
  return out;
}

std::optional<ViewFit> fit_pose(const PinholeCamera& camera, const Matrix2Xd& target, const Matrix2Xd& view) {
  if (!usable(target, view)) return std::nullopt;
  const auto map = homography(target, view);
  const auto pose = map ? start_pose(camera, *map) : std::nullopt;
  if (!pose) return std::nullopt;
  Adjusted first;
  first.camera = pack(camera);
  Eigen::Matrix<double, 6, 1> p;
  p << pose->rotation, pose->position;
  first.poses.push_back(p);
  const auto fit = adjust(target, {view}, first, {});
  if (!fit) return std::nullopt;
  return view_fit(target, view, fit->camera, fit->poses.front());
}

double homography_rms(const Matrix2Xd& target, const Matrix2Xd& view) {
  const auto map = usable(target, view) ? homography(target, view) : std::nullopt;
  if (!map) return std::numeric_limits<double>::infinity();
  const Matrix2Xd seen = (*map * target.colwise().homogeneous()).colwise().hnormalized();
  const double rms = std::sqrt((seen - view).squaredNorm() / static_cast<double>(view.cols()));
  return std::isfinite(rms) ? rms : std::numeric_limits<double>::infinity();
}

Matrix2Xd project_target(const PinholeCamera& camera, const TargetPose& pose, const Matrix2Xd& target) {
  VectorXd p(intrinsics + 6);
  p << pack(camera), pose.rotation, pose.position;
  return project(target, p);
}

std::optional<std::vector<double>> leave_one_view_out(const Matrix2Xd& target,
                                                      const std::vector<Matrix2Xd>& views, Lens lens) {
  std::vector<double> out;
  for (std::size_t left = 0; left < views.size(); ++left) {
    std::vector<Matrix2Xd> others;
    for (std::size_t v = 0; v < views.size(); ++v)
      if (v != left) others.push_back(views[v]);
    const auto fit = calibrate_planar(target, others, lens);
    const auto pose = fit ? fit_pose(fit->camera, target, views[left]) : std::nullopt;
    if (!pose) return std::nullopt;
    out.push_back(pose->rms);
  }
  return out;
}

}  // namespace invar::metrology
